//! Progress of one garment, in the form that monitors receive.

use if_core::math::Real;
use if_core::monitor::{Cancelled, Monitor, Progress};

/// A garment is begun.
pub(crate) const VERIFY: &str = "verify";
/// Intersections of the garment with itself are removed.
pub(crate) const UNTANGLE: &str = "untangle";
/// Algorithm 1 begins.
pub(crate) const ALGORITHM_1: &str = "algorithm 1";
/// Contacts and cloth settle.
pub(crate) const SETTLE: &str = "settle";
/// The remaining intersections are repaired.
pub(crate) const REPAIR: &str = "repair";
/// The garment is finished.
pub(crate) const DONE: &str = "done";

/// Reports the stages of one garment to a monitor.
pub(crate) struct GarmentProgress<'a> {
    pub(crate) monitor: &'a mut dyn Monitor,
    /// The garment's name.
    pub(crate) name: &'a str,
    /// Its index: 0 for the innermost garment.
    pub(crate) index: usize,
    /// Number of garments.
    pub(crate) count: usize,
}

impl GarmentProgress<'_> {
    /// Reports a round of a stage, with the number of intersecting triangle pairs if it is known.
    pub(crate) fn report(
        &mut self,
        stage: &'static str,
        round: usize,
        pairs: Option<usize>,
    ) -> Result<(), Cancelled> {
        let measures = [
            ("garment", (self.index + 1) as Real),
            ("garments", self.count as Real),
            ("pairs", pairs.unwrap_or(0) as Real),
        ];
        let known = if pairs.is_some() { 3 } else { 2 };
        let progress =
            Progress { done: round, measures: &measures[..known], ..Progress::stage(stage) };
        self.monitor.report(&progress.of(self.name))
    }
}
