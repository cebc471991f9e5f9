//! The frames over which displacements are smoothed.

use super::shots::Shots;
use if_core::math::Real;
use std::ops::Range;

/// What the windows of all frames have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Windows<'a> {
    pub(super) shots: &'a Shots,
    /// Frames to each side.
    pub(super) radius: usize,
    /// Displacement of the body, in metres, that every frame may have.
    pub(super) body_limit: Real,
}

impl Windows<'_> {
    /// The window of frame `k`: it ends at cuts.
    pub(super) fn of(&self, k: usize) -> Range<usize> {
        self.shots.window(k, self.radius)
    }
}
