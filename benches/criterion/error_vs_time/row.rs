//! One run, and the runs that no other beats.

use serde::Serialize;

/// One run.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Row {
    pub(crate) problem: String,
    pub(crate) method: String,
    pub(crate) parameter: String,
    pub(crate) milliseconds: f64,
    pub(crate) error: f64,
    pub(crate) unit: &'static str,
    /// Evaluations of fields, visits of constraints, or whatever the method counts; 0 where it
    /// counts nothing.
    pub(crate) evaluations: u64,
    /// The same that were not needed.
    pub(crate) skipped: u64,
    /// What the libraries do unless told otherwise.
    pub(crate) default: bool,
}

/// Runs that no other beats in both, by time.
pub(crate) fn front<'a>(rows: &[&'a Row]) -> Vec<&'a Row> {
    let mut sorted: Vec<&Row> = rows.iter().copied().filter(|r| r.error.is_finite()).collect();
    sorted.sort_by(|a, b| a.milliseconds.total_cmp(&b.milliseconds));
    let mut least = f64::INFINITY;
    sorted.retain(|r| {
        let better = r.error < least;
        least = least.min(r.error);
        better
    });
    sorted
}
