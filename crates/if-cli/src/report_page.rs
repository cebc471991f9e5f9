//! `report.html`: an outfit before and after, to turn in a browser, with its tables.

use crate::outcome::Done;
use crate::outfit_file::OutfitSpec;
use crate::table;
use if_outfit::Cleanness;
use if_outfit::outfit::Outfit;
use if_pipeline::outfit_page::{add_report, viewer};
use if_render::{Intersections, Page};

/// The page without pictures. It has no seconds: the same input gives the same bytes.
pub(crate) fn page(
    spec: &OutfitSpec,
    ([before, after], found): ([&Outfit; 2], [&Intersections; 2]),
    done: &Done,
) -> Page {
    let mut page = Page::new(&spec.title());
    let totals = table::totals(&done.report.before, &done.report.after);
    let state = done.state();
    page.verdict(state != Cleanness::NotClean, &format!("{totals}: {state}"));
    for note in &done.notes {
        page.text(note);
    }
    page.viewer(viewer(before, after).intersections(&found));
    add_report(&mut page, &done.report);
    page
}

/// The page with pictures.
pub(crate) fn html(mut page: Page, pngs: &[Vec<u8>]) -> String {
    page.heading("Pictures");
    for (caption, png) in ["before", "after"].iter().zip(pngs) {
        page.picture(caption, png);
    }
    page.html()
}
