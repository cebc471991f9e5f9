//! `report.html` of an animation: frames to turn in a browser, and a row for each.

use super::pictures::{STRIP, meshes};
use super::{AnimateFault, summary};
use crate::output_error::OutputError;
use crate::staging::Staging;
use crate::table::counted;
use if_outfit::outfit::Outfit;
use if_pipeline::animate::{Animation, IntervalReport};
use if_render::{Page, Viewer};
use miette::Report;
use std::path::Path;

/// The page of an animation.
pub(super) const FILE: &str = "report.html";
/// Most frames that can be turned; each takes some hundred kilobytes.
const MOST: usize = 12;

/// Writes the page, and returns its name. The strip of pictures must be there.
pub(super) fn write(
    title: &str,
    outfit: &Outfit,
    (animation, between): (&Animation, Option<&[IntervalReport]>),
    (staging, out): (&Staging, &Path),
) -> Result<String, Report> {
    let report = &animation.report;
    let frames = animation.frames.len();
    let step = frames.div_ceil(MOST).max(1);
    let shown: Vec<usize> = (0..frames).step_by(step).collect();
    let number = |frame: &usize| report.frames[*frame].frame;
    let names: Vec<String> = shown.iter().map(|k| format!("frame {}", number(k))).collect();
    let mut states = Vec::new();
    for &frame in &shown {
        let positions = animation.frames.positions(frame);
        let positions = positions.map_err(|source| AnimateFault::Animate { source })?;
        states.push(meshes(outfit, &positions));
    }
    let mut page = Page::new(&format!("{}, in motion", title));
    let verdict = format!(
        "{}: {} clean, {} clean everywhere",
        counted(frames, "frame"),
        report.clean,
        report.clean_everywhere
    );
    page.verdict(report.clean == frames, &verdict);
    if !names.is_empty() {
        let mut viewer = Viewer::new(&names.iter().map(String::as_str).collect::<Vec<_>>());
        for (k, layer) in outfit.layers().enumerate() {
            viewer.layer(&layer.name, &states.iter().map(|meshes| &meshes[k]).collect::<Vec<_>>());
        }
        page.viewer(&viewer);
    }
    let fault = |name: &str| {
        let path = out.join(name);
        move |source| OutputError::File { path, source }
    };
    let strip = std::fs::read(staging.path(STRIP)).map_err(fault(STRIP))?;
    page.picture("skinned alone, intersecting triangles in red, and as written", &strip);
    let rows: Vec<Vec<String>> =
        report.frames.iter().enumerate().map(|row| summary::cells(row).to_vec()).collect();
    page.heading("Frames").table(&summary::HEADER, &rows);
    if let Some(between) = between {
        page.heading("Between frames").text(&summary::between_line(between));
        let rows: Vec<Vec<String>> =
            summary::crossed(between).map(|row| summary::between_cells(row).to_vec()).collect();
        if !rows.is_empty() {
            page.table(&summary::BETWEEN, &rows);
        }
    }
    std::fs::write(staging.path(FILE), page.html()).map_err(fault(FILE))?;
    Ok(FILE.into())
}
