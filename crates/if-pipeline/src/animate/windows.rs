//! The frames over which displacements are smoothed.

use super::shots::Shots;
use std::ops::Range;

/// What the windows of all frames have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Windows<'a> {
    pub(super) shots: &'a Shots,
    /// Frames to each side.
    pub(super) radius: usize,
}

impl Windows<'_> {
    /// The window of frame `k`: it ends at cuts.
    pub(super) fn of(&self, k: usize) -> Range<usize> {
        self.shots.window(k, self.radius)
    }
}
