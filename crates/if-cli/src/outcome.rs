//! How the resolution of one outfit ended.

use crate::file_record::OutputFile;
use crate::phases::Phase;
use if_outfit::Cleanness;
use if_outfit::report::ResolveReport;
use if_outfit::unresolved::Unresolved;
use miette::Diagnostic;

/// How it went.
pub(crate) enum Outcome {
    /// It was resolved before to this state, and nothing has changed since.
    Finished(Cleanness),
    /// The user cancelled.
    Cancelled,
    /// It was resolved, as far as possible.
    Resolved(Box<Done>),
}

/// A resolved outfit.
pub(crate) struct Done {
    /// Notes on the inputs.
    pub(crate) notes: Vec<String>,
    pub(crate) report: ResolveReport,
    /// What was written; nothing where intersections are left, unless asked for.
    pub(crate) outputs: Vec<OutputFile>,
    /// What remains; `None` if the outfit is proven.
    pub(crate) unresolved: Option<UnresolvedOutfit>,
    /// Wall time, reading and writing included.
    pub(crate) seconds: f64,
    /// Where the time went, if asked for.
    pub(crate) phases: Option<Phase>,
    /// Of this process so far, in bytes; `None` where the system does not count it.
    pub(crate) peak_memory: Option<u64>,
}

impl Done {
    /// The state in receipts and JSON.
    pub(crate) fn state(&self) -> Cleanness {
        if self.unresolved.is_none() { self.report.cleanness() } else { Cleanness::NotClean }
    }
}

/// Intersections that could not be removed.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("outfit `{outfit}`: {unresolved}")]
#[diagnostic(
    code(ifg::unresolved),
    help("{}{}", advice(unresolved), if *written { "what was reached is written" } else { "--write-unproven writes what was reached" })
)]
pub(crate) struct UnresolvedOutfit {
    outfit: String,
    unresolved: Box<Unresolved>,
    /// Whether what was reached is written.
    written: bool,
}

impl UnresolvedOutfit {
    /// What is left of `outfit`.
    pub(crate) fn new(outfit: &str, unresolved: Box<Unresolved>, written: bool) -> Self {
        Self { outfit: outfit.to_owned(), unresolved, written }
    }
}

/// Where to look, and at which triangles; empty if none is named.
fn advice(unresolved: &Unresolved) -> String {
    /// More pairs than these do not help a person.
    const SHOWN: usize = 8;
    let shown = unresolved.triangles.iter().take(SHOWN);
    let shown: Vec<String> = shown.map(|[a, b]| format!("({a}, {b})")).collect();
    let which = if unresolved.between.is_some() { " (inner, outer)" } else { "" };
    let Some(p) = unresolved.place else { return String::new() };
    format!(
        "look near ({:.3}, {:.3}, {:.3}) m, at the triangles{which} {} (polygons count as fans of them); ",
        p.x,
        p.y,
        p.z,
        shown.join(" ")
    )
}
