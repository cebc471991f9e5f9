//! The second pass over a frame: smoothed, over a body that is displaced no more than it may be, verified,
//! measured.

use super::error::AnimateError;
use super::measure::Measurer;
use super::movement::Movement;
use super::report::FrameReport;
use super::smoother::Smoother;
use super::window::Window;
use if_core::math::{Point, Real};
use if_outfit::motion::Walker;

/// Finishes frames one after the other.
#[derive(Debug)]
pub(super) struct Finisher<'a> {
    walker: Walker,
    smoother: Smoother<'a>,
    measurer: Measurer<'a>,
    /// The body may be displaced by this much, in metres.
    depth: Real,
}

impl<'a> Finisher<'a> {
    /// `walker` is of this outfit. The body may be displaced by `depth` metres.
    pub(super) fn new(
        movement: Movement<'a>,
        walker: Walker,
        (radius, depth): (usize, Real),
    ) -> Self {
        let smoother = Smoother::new(movement, walker.clone(), radius);
        Self { walker, smoother, measurer: Measurer::new(movement), depth }
    }

    /// Goes to frame `next`, before which `positions` has all frames.
    pub(super) fn resume(
        &mut self,
        next: usize,
        positions: impl Fn(usize) -> Result<Vec<Point>, AnimateError>,
    ) -> Result<(), AnimateError> {
        self.measurer.resume(next, positions)
    }

    /// The positions of frame `k` and its row.
    pub(super) fn frame(
        &mut self,
        k: usize,
        window: &Window,
    ) -> Result<(Vec<Point>, FrameReport), AnimateError> {
        let walked = window.frame(k);
        // Contacts keep layers apart, and not vertices on their sides.
        let mut smoothed = None;
        for positions in self.smoother.frame(k, window)? {
            let found = self.measurer.verify(&self.walker, &positions)?;
            if found.is_clean() {
                smoothed = Some((positions, found));
                break;
            }
        }
        let is_smoothed = smoothed.is_some();
        let (mut positions, mut found) = match smoothed {
            Some(clean) => clean,
            None => {
                let found = self.measurer.verify(&self.walker, &walked.positions)?;
                (walked.positions.clone(), found)
            }
        };
        if let Some(kept) = self.measurer.within(&mut self.walker, k, &positions, self.depth)? {
            (positions, found) = kept;
        }
        let mut row = FrameReport {
            pairs: found.pairs,
            inside: found.inside,
            own_pairs: found.own_pairs,
            body_own_pairs: found.body_own_pairs,
            new_own_pairs: found.new_own_pairs,
            smoothed: is_smoothed,
            pinch: found.pinch,
            ..walked.row.clone()
        };
        self.measurer.measure(&self.walker, k, &positions, &mut row)?;
        Ok((positions, row))
    }
}
