//! What a report page shows of an outfit that was resolved.

use if_outfit::outfit::Outfit;
use if_outfit::report::ResolveReport;
use if_render::{Page, Viewer};

/// The layers of an outfit before and after, to turn in a browser. Both have the same layers.
///
/// # Examples
///
/// ```
/// # use if_body::mannequin::{Garment, MannequinParams, body, garment};
/// # use if_outfit::outfit::{Layer, Outfit};
/// # use if_outfit::storage::Storage;
/// # use if_pipeline::outfit_page::viewer;
/// # use if_render::Page;
/// # let rough = MannequinParams { resolution: 0.7, ..Default::default() };
/// # let layer = |name: &str, mesh| Layer { name: name.into(), mesh, storage: Storage::F32 };
/// # let garments = vec![layer("skirt", garment(Garment::Skirt, &rough))];
/// # let before = Outfit { body: layer("body", body(&rough)), garments };
/// # let after = before.clone();
/// let mut page = Page::new("skirt over body");
/// page.viewer(&viewer(&before, &after));
/// assert!(page.html().contains("\"skirt\""));
/// ```
pub fn viewer<'a>(before: &'a Outfit, after: &'a Outfit) -> Viewer<'a> {
    let mut viewer = Viewer::new(&["before", "after"]);
    for (was, is) in before.layers().zip(after.layers()) {
        viewer.layer(&was.name, &[&was.mesh, &is.mesh]);
    }
    viewer
}

/// Adds tables of what was done to each layer, and of the pairs of layers before and after.
pub fn add_report(page: &mut Page, report: &ResolveReport) {
    layers(page, report);
    pairs(page, report);
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

/// A length, in millimetres.
pub(crate) fn mm(metres: f64) -> String {
    format!("{:.2} mm", metres * 1e3)
}

/// A share, in percent.
pub(crate) fn percent(share: f64) -> String {
    format!("{:.2} %", share * 1e2)
}
