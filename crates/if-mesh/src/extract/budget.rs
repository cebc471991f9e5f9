//! What an extraction has used and may still use: evaluations, memory, and its monitor.

use crate::extract::error::ExtractError;
use if_core::math::Real;
use if_core::monitor::{Cancelled, Monitor, Progress};

/// Counts evaluations, reports them to the monitor, and limits memory.
pub(super) struct Budget<'a> {
    /// Points at which the field was evaluated so far, in all attempts.
    pub(super) evaluations: usize,
    /// Side of the cells of the current attempt, in metres; 0 before the first.
    pub(super) cell: Real,
    /// Bytes that may be held at once.
    pub(super) memory: usize,
    pub(super) monitor: &'a mut dyn Monitor,
}

impl Budget<'_> {
    /// Counts `points` evaluations of `stage` and reports them.
    pub(super) fn evaluated(
        &mut self,
        stage: &'static str,
        points: usize,
    ) -> Result<(), Cancelled> {
        self.report(stage, points, self.cell)
    }

    /// Counts `points` evaluations at the corners of boxes with sides of `step` cells.
    pub(super) fn refined(&mut self, step: u32, points: usize) -> Result<(), Cancelled> {
        self.report("refine", points, self.cell * Real::from(step))
    }

    fn report(&mut self, stage: &'static str, points: usize, side: Real) -> Result<(), Cancelled> {
        self.evaluations += points;
        let measures =
            [("evaluations", self.evaluations as Real), ("cell", self.cell), ("box", side)];
        let done = self.evaluations;
        self.monitor.report(&Progress { done, measures: &measures, ..Progress::stage(stage) })
    }

    /// Fails if `held` bytes and `more` exceed the memory allowed.
    pub(super) fn room(&self, held: usize, more: usize) -> Result<(), ExtractError> {
        let bytes = held.saturating_add(more);
        if bytes > self.memory {
            return Err(ExtractError::TooLarge { bytes, limit: self.memory, cell: self.cell });
        }
        Ok(())
    }
}
