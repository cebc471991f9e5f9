//! HTML reports of results and batches.

use super::result::{MatchResult, State, Timings};
use super::summary::{BatchSummary, Entry};
use crate::outfit_page::{self, mm, percent};
use if_outfit::outfit::Outfit;
use if_render::Page;

/// The report of a result, with its layers to turn where `layers` has them before and after.
pub(super) fn result(
    result: &MatchResult,
    timings: &Timings,
    pngs: &[Vec<u8>],
    layers: Option<[&Outfit; 2]>,
) -> String {
    let mut page = Page::new(&result.combination.to_string());
    match (&result.error, &result.report) {
        (None, Some(report)) => {
            let (pairs, inside) = (report.before.total_pairs(), report.before.total_inside());
            page.verdict(
                true,
                &format!("Clean: {pairs} intersecting triangle pairs and {inside} vertices on a wrong side before, none after."),
            )
        }
        (error, _) => page.verdict(false, error.as_ref().map_or("Not resolved.", |e| &e.message)),
    };
    if let Some([before, after]) = layers {
        page.viewer(&outfit_page::viewer(before, after));
    }
    for (caption, png) in ["before", "after"].iter().zip(pngs) {
        page.picture(caption, png);
    }
    alignments(&mut page, result);
    if let Some(report) = &result.report {
        outfit_page::add_report(&mut page, report);
    }
    let seconds = |x: f64| format!("{x:.2} s");
    page.heading("Timings").table(
        &["align", "resolve", "pictures", "write", "all"],
        &[[timings.align, timings.resolve, timings.pictures, timings.write, timings.total]
            .map(seconds)
            .to_vec()],
    );
    page.heading("What decides the result")
        .text(&format!("Key {}.", result.key))
        .json(&result.request);
    page.html()
}

fn alignments(page: &mut Page, result: &MatchResult) {
    let rows: Vec<Vec<String>> = result
        .combination
        .garments
        .iter()
        .zip(&result.alignments)
        .map(|(name, a)| {
            vec![
                name.clone(),
                format!("{:?}", a.method).to_lowercase(),
                mm(a.residual),
                mm(a.moved.mean),
                mm(a.moved.max),
                percent(a.strain.rms),
                percent(a.strain.p99),
                percent(a.inside[0]),
                percent(a.inside[1]),
            ]
        })
        .collect();
    page.heading("Alignment").table(
        &[
            "garment",
            "bodies by",
            "residual",
            "moved, mean",
            "max",
            "strain, rms",
            "p99",
            "inside its own body",
            "inside this body",
        ],
        &rows,
    );
}

/// The report of a batch: pictures, failures first, then a table of all.
pub(super) fn batch(summary: &BatchSummary, picture: impl Fn(&Entry) -> Option<Vec<u8>>) -> String {
    /// Largest number of pictures; others are in the reports of their results.
    const PICTURES: usize = 24;
    let mut page = Page::new(&format!("{} combinations", summary.entries.len()));
    page.verdict(summary.clean == summary.entries.len(), &summary.to_string());
    let failures = summary.entries.iter().filter(|e| e.state != State::Clean);
    let rest = summary.entries.iter().filter(|e| e.state == State::Clean);
    for entry in failures.chain(rest).take(PICTURES) {
        if let Some(png) = picture(entry) {
            page.picture(&entry.combination.to_string(), &png);
        }
    }
    let rows: Vec<Vec<String>> = summary.entries.iter().map(row).collect();
    page.heading("All").table(
        &[
            "combination",
            "state",
            "pairs before",
            "after",
            "own pairs at rest",
            "after",
            "alignment's strain, p99",
            "moved, max",
            "strain, max",
            "seconds",
            "folder",
            "error",
        ],
        &rows,
    );
    page.html()
}

fn row(entry: &Entry) -> Vec<String> {
    vec![
        entry.combination.to_string(),
        format!("{:?}", entry.state).to_lowercase(),
        entry.pairs[0].to_string(),
        entry.pairs[1].to_string(),
        entry.own_pairs[0].to_string(),
        entry.own_pairs[1].to_string(),
        percent(entry.alignment_strain),
        mm(entry.moved),
        percent(entry.strain),
        entry.seconds.map_or(String::new(), |s| format!("{s:.2}")),
        entry.folder.clone(),
        entry.error.as_ref().map_or(String::new(), |e| format!("{}: {}", e.kind, e.message)),
    ]
}
