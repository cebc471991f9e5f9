//! The summary of a batch.

use super::combination::Combination;
use super::error::WardrobeError;
use super::result::{Fault, MatchResult, State};
use if_outfit::Cleanness;
use serde::{Deserialize, Serialize};

/// The result of a combination, in short.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The combination.
    pub combination: Combination,
    /// Its state.
    pub state: State,
    /// The error, if any.
    pub error: Option<Fault>,
    /// Its folder below `results`; empty if it has none.
    pub folder: String,
    /// Intersecting pairs before and after.
    pub pairs: [usize; 2],
    /// Vertices on the wrong side before and after.
    pub inside: [usize; 2],
    /// Pairs of garments with themselves: at rest, on their own bodies, and after.
    pub own_pairs: [usize; 2],
    /// Whether the result is clean everywhere, the body included.
    pub everywhere: bool,
    /// Largest strain of the hundredth part of a garment's edges by the alignment with the body.
    #[serde(default)]
    pub alignment_strain: f64,
    /// Largest displacement of a vertex by resolving, in metres.
    pub moved: f64,
    /// Largest strain of an edge by resolving.
    pub strain: f64,
    /// Seconds; not in `summary.json`.
    #[serde(skip)]
    pub seconds: Option<f64>,
}

/// The summary of a batch: `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BatchSummary {
    /// Number without intersections.
    pub clean: usize,
    /// Number with remaining intersections.
    pub remaining: usize,
    /// Number of failures.
    pub failed: usize,
    /// In the order of the list.
    pub entries: Vec<Entry>,
}

impl std::fmt::Display for BatchSummary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { clean, remaining, failed, entries } = self;
        let everywhere = entries.iter().filter(|entry| entry.everywhere).count();
        let share = 100.0 * *clean as f64 / entries.len().max(1) as f64;
        write!(
            f,
            "{} combinations: {clean} clean ({share:.1} %), {everywhere} of them everywhere, {remaining} with intersections left, {failed} failed",
            entries.len()
        )
    }
}

impl Entry {
    /// The entry of a result in a folder below `results`.
    pub(super) fn of(result: &MatchResult, folder: String, seconds: Option<f64>) -> Self {
        let report = result.report.as_ref();
        let largest = |of: fn(&if_outfit::report::LayerReport) -> f64| {
            report.map_or(0.0, |r| r.layers.iter().map(of).fold(0.0, f64::max))
        };
        Self {
            combination: result.combination.clone(),
            state: result.state,
            error: result.error.clone(),
            pairs: report.map_or([0; 2], |r| [r.before.total_pairs(), r.after.total_pairs()]),
            own_pairs: result.own_pairs(),
            everywhere: result.cleanness() == Some(Cleanness::Everywhere),
            inside: report.map_or([0; 2], |r| [r.before.total_inside(), r.after.total_inside()]),
            alignment_strain: result.alignments.iter().map(|a| a.strain.p99).fold(0.0, f64::max),
            moved: largest(|l| l.moved.max),
            strain: largest(|l| l.strain.max),
            folder,
            seconds,
        }
    }

    /// The entry of a combination without a result.
    pub(super) fn failure(combination: &Combination, error: &WardrobeError) -> Self {
        Self {
            combination: combination.clone(),
            state: State::Failed,
            error: Some(Fault { kind: error.kind().into(), message: error.to_string() }),
            folder: String::new(),
            pairs: [0; 2],
            inside: [0; 2],
            own_pairs: [0; 2],
            everywhere: false,
            alignment_strain: 0.0,
            moved: 0.0,
            strain: 0.0,
            seconds: None,
        }
    }
}
