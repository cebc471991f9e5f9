//! Walked frames that smoothing still needs: in memory, and on disk with the state after the last,
//! so that a run that was stopped goes on from there.

use super::animator::{AnimateParams, Animator};
use super::error::AnimateError;
use super::frames::Frames;
use super::movement::Movement;
use super::report::FrameReport;
use if_core::math::Point;
use std::collections::BTreeMap;
use std::path::Path;

/// Some frames in a row before smoothing.
#[derive(Debug)]
pub(super) struct Window {
    stored: Frames,
    frames: BTreeMap<usize, WalkedFrame>,
    /// The first frame on disk.
    first: usize,
    /// The frame after the last.
    next: usize,
}

/// A frame before smoothing.
#[derive(Debug)]
pub(super) struct WalkedFrame {
    /// Of all layers, the body first.
    pub(super) positions: Vec<Point>,
    pub(super) row: FrameReport,
}

impl Window {
    /// Without frames yet.
    pub(super) fn open(
        folder: &Path,
        movement: Movement<'_>,
        params: &AnimateParams,
    ) -> Result<Self, AnimateError> {
        let stored = Frames::open(folder, movement, params)?;
        Ok(Self { stored, frames: BTreeMap::new(), first: 0, next: 0 })
    }

    /// Takes over frames from `first` on and brings the animator to the state after them, if all are
    /// there and unchanged.
    pub(super) fn resume(&mut self, first: usize, animator: &mut Animator<'_>) {
        let Some((last, state)) = self.stored.state() else { return };
        let read = |frame| {
            let (row, positions) = self.stored.stored(frame)?;
            Some((frame, WalkedFrame { positions, row }))
        };
        let frames: Option<BTreeMap<_, _>> = (first..=last).map(read).collect();
        if let Some(frames) = frames.filter(|frames| !frames.is_empty())
            && animator.resume(last, state.place, &state.snapshot)
        {
            (self.frames, self.first, self.next) = (frames, first, last + 1);
        }
    }

    /// The next frame to be walked to.
    pub(super) fn next(&self) -> usize {
        self.next
    }

    /// Adds the next frame, after which the animator is in its present state.
    pub(super) fn push(
        &mut self,
        positions: Vec<Point>,
        row: FrameReport,
        animator: &Animator<'_>,
    ) -> Result<(), AnimateError> {
        self.stored.write(&positions, &row)?;
        self.stored.write_state(self.next, animator)?;
        self.frames.insert(self.next, WalkedFrame { positions, row });
        self.next += 1;
        Ok(())
    }

    /// A frame that was not forgotten.
    pub(super) fn frame(&self, frame: usize) -> &WalkedFrame {
        &self.frames[&frame]
    }

    /// The frames from `first` to `last`, as far as they are there.
    pub(super) fn frames(
        &self,
        first: usize,
        last: usize,
    ) -> impl Iterator<Item = (usize, &WalkedFrame)> {
        self.frames.range(first..=last).map(|(frame, walked)| (*frame, walked))
    }

    /// Forgets all frames before `needed`, and removes those before `first` from disk: those between
    /// are for a run that goes on from here.
    pub(super) fn forget(&mut self, needed: usize, first: usize) -> Result<(), AnimateError> {
        self.frames = self.frames.split_off(&needed);
        for frame in self.first..first {
            self.stored.remove(frame)?;
        }
        self.first = self.first.max(first);
        Ok(())
    }
}
