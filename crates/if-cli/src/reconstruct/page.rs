//! The page that shows a reconstructed person.

use super::summary::{moved, summary};
use if_core::mesh::TriMesh;
use if_pipeline::reconstruct::{
    FieldsReport, FieldsRound, FrameMotion, MotionReport, MotionRound, ReconstructReport,
    Reconstruction, Round,
};
use if_render::{PALETTE, Page, RenderLayer, View, Viewer, side_by_side};
use std::io;

/// Pixels of one view.
const SIZE: [u32; 2] = [360, 600];
/// What is told of each round of a fit.
const FIT: [&str; 3] = ["silhouettes, mm", "normals, degrees", "step, mm"];

/// The page, as HTML.
pub(super) fn page(name: &str, found: &Reconstruction) -> io::Result<String> {
    let report = &found.report;
    let mut page = Page::new(&format!("{name}, reconstructed"));
    page.text(&summary(name, report, report.seconds.sum()));
    let parts = labelled(found);
    let mut viewer = Viewer::new(&["rest pose"]);
    viewer.one_surface();
    for (label, mesh) in parts.iter().filter(|(_, mesh)| !mesh.triangles().is_empty()) {
        let garment = found.garments.iter().find(|g| usize::from(g.label) == *label);
        let name = garment.map_or(if *label == 1 { "skin" } else { "no label" }, |g| &g.name);
        viewer.colored(name, color(*label), &[mesh]);
    }
    page.viewer(&viewer);
    page.heading("The person").picture("front, three quarters, back", &picture(&parts)?);
    page.heading("The garments").picture("cut and cleaned", &picture(&garments(found))?);
    surface_rounds(&mut page, report);
    match (&report.fields, &report.motion) {
        (Some(fields), _) => training(&mut page, fields),
        (None, Some(motion)) => motion_of_frames(&mut page, motion, report.seconds.motion),
        (None, None) => {}
    }
    page.heading("Everything").json(report);
    Ok(page.html())
}

fn surface_rounds(page: &mut Page, report: &ReconstructReport) {
    let row = |(k, r): (usize, &Round)| {
        vec![
            (k + 1).to_string(),
            format!("{:.2}", r.silhouette_mm),
            format!("{:.2}", r.normal_degrees),
            format!("{:.2}", r.step_mm),
            r.rim_vertices.to_string(),
            r.seen_triangles.to_string(),
        ]
    };
    let rows: Vec<Vec<String>> = report.surface.rounds.iter().enumerate().map(row).collect();
    let head = ["round", FIT[0], FIT[1], FIT[2], "rim vertices", "triangles seen"];
    page.heading("Rounds, each as it began").table(&head, &rows);
}

fn training(page: &mut Page, fields: &FieldsReport) {
    let row = |r: &FieldsRound| {
        vec![
            r.steps.to_string(),
            format!("{:.2}", r.silhouette_mm),
            format!("{:.2}", r.normal_degrees),
            format!("{:.2}", r.motion_mm),
            r.rays.used.to_string(),
            (r.rays.grazing + r.rays.lost + r.rays.contradicting).to_string(),
            format!("{:.1}", r.seconds),
        ]
    };
    let rows: Vec<Vec<String>> = fields.rounds.iter().map(row).collect();
    let head = ["steps", FIT[0], FIT[1], "|d|, mm", "rays used", "rays rejected", "seconds"];
    page.heading("Training of φ and d: means of the steps").table(&head, &rows);
}

fn motion_of_frames(page: &mut Page, motion: &MotionReport, seconds: f64) {
    let row = |(k, r): (usize, &MotionRound)| {
        vec![
            (k + 1).to_string(),
            format!("{:.2}", r.silhouette_mm),
            format!("{:.2}", r.normal_degrees),
            format!("{:.2}", r.step_mm),
        ]
    };
    let rows: Vec<Vec<String>> = motion.rounds.iter().enumerate().map(row).collect();
    page.heading("Motion of single frames: rounds, each as it began, mean of the frames");
    page.text(&format!("{}It took {seconds:.1} s.", moved(motion)))
        .table(&["round", FIT[0], FIT[1], FIT[2]], &rows);
    let row = |f: &FrameMotion| {
        let from =
            if f.solved { "its pictures and its neighbours'" } else { "its neighbours' motion" };
        vec![
            f.frame.to_string(),
            from.into(),
            format!("{:.2}", f.mean_mm),
            format!("{:.2}", f.max_mm),
        ]
    };
    let rows: Vec<Vec<String>> = motion.frames.iter().map(row).collect();
    page.heading("Motion of single frames")
        .table(&["frame", "from", "|d| on average, mm", "at most, mm"], &rows);
}

/// The canonical mesh in the colours of its labels: a mesh for each.
fn labelled(found: &Reconstruction) -> Vec<(usize, TriMesh)> {
    let most = found.labels.iter().copied().max().unwrap_or(0);
    let part = |label: u8| {
        let mine = found
            .mesh
            .triangles()
            .iter()
            .filter(|t| t.iter().map(|v| found.labels[*v as usize]).max() == Some(label));
        let mesh = TriMesh::new(found.mesh.vertices().to_vec(), mine.copied().collect());
        (usize::from(label), mesh.expect("a part of a mesh is a mesh"))
    };
    (0..=most).map(part).collect()
}

fn garments(found: &Reconstruction) -> Vec<(usize, TriMesh)> {
    found.garments.iter().map(|g| (usize::from(g.label), g.mesh.clone())).collect()
}

fn color(label: usize) -> [u8; 3] {
    PALETTE[label.saturating_sub(1) % PALETTE.len()]
}

fn picture(parts: &[(usize, TriMesh)]) -> io::Result<Vec<u8>> {
    let layers: Vec<RenderLayer> = parts
        .iter()
        .map(|(label, mesh)| RenderLayer { mesh, color: color(*label), highlight: &[] })
        .collect();
    let mut png = Vec::new();
    side_by_side(&layers, &[View::FRONT, View::THREE_QUARTER, View::BACK], SIZE[0], SIZE[1])
        .write_png(&mut png)
        .map_err(io::Error::other)?;
    Ok(png)
}
