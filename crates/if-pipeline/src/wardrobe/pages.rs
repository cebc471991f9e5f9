//! HTML reports of results and batches.

use super::result::{MatchResult, State, Timings};
use super::summary::{BatchSummary, Entry};
use if_outfit::report::ResolveReport;
use if_render::Page;

/// The report of a result.
pub(super) fn result(result: &MatchResult, timings: &Timings, pngs: &[Vec<u8>]) -> String {
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
    for (caption, png) in ["before", "after"].iter().zip(pngs) {
        page.picture(caption, png);
    }
    alignments(&mut page, result);
    if let Some(report) = &result.report {
        layers(&mut page, report);
        pairs(&mut page, report);
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

fn mm(metres: f64) -> String {
    format!("{:.2} mm", metres * 1e3)
}

fn percent(share: f64) -> String {
    format!("{:.2} %", share * 1e2)
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
            "inside its own body",
            "inside this body",
        ],
        &rows,
    );
}

fn layers(page: &mut Page, report: &ResolveReport) {
    let rows: Vec<Vec<String>> = report
        .layers
        .iter()
        .map(|l| {
            vec![
                l.name.clone(),
                mm(l.moved.mean),
                mm(l.moved.p95),
                mm(l.moved.max),
                percent(l.strain.rms),
                percent(l.strain.p99),
                percent(l.strain.max),
                format!("{} → {}", l.own_pairs.before, l.own_pairs.after),
                l.rounds.to_string(),
            ]
        })
        .collect();
    let head =
        ["layer", "moved, mean", "p95", "max", "strain, rms", "p99", "max", "own pairs", "rounds"];
    page.heading("Resolving").table(&head, &rows);
    for layer in report.layers.iter().filter(|l| l.tucked[0] > 0) {
        let [before, after] = layer.tucked;
        page.text(&format!(
            "{} was pressed in below the layers above: {before} → {after} vertices stick out of them.",
            layer.name
        ));
    }
    for layer in report.layers.iter().filter(|l| l.split > 0) {
        page.text(&format!(
            "{}: {} triangles of the input were split into smaller ones.",
            layer.name, layer.split
        ));
    }
}

fn pairs(page: &mut Page, report: &ResolveReport) {
    let after = |k: usize| report.after.pairs.get(k);
    let rows: Vec<Vec<String>> = report
        .before
        .pairs
        .iter()
        .enumerate()
        .map(|(k, before)| {
            let number = |n: Option<usize>| n.map_or("?".to_owned(), |n| n.to_string());
            vec![
                format!("{} over {}", before.outer, before.inner),
                before.pairs.total().to_string(),
                number(after(k).map(|p| p.pairs.total())),
                before.vertices_inside.to_string(),
                number(after(k).map(|p| p.vertices_inside)),
                mm(before.deepest),
            ]
        })
        .collect();
    let head =
        ["layers", "pairs before", "after", "vertices inside before", "after", "deepest before"];
    page.heading("Intersections").table(&head, &rows);
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
        mm(entry.moved),
        percent(entry.strain),
        entry.seconds.map_or(String::new(), |s| format!("{s:.2}")),
        entry.folder.clone(),
        entry.error.as_ref().map_or(String::new(), |e| format!("{}: {}", e.kind, e.message)),
    ]
}
