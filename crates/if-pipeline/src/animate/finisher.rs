//! The second pass over a frame: smoothed, over a body that is displaced no more than it may be, verified,
//! measured.

use super::error::AnimateError;
use super::frames::Frames;
use super::measure::Measurer;
use super::movement::Movement;
use super::report::FrameReport;
use super::smoother::Smoother;
use super::windows::Windows;
use if_core::math::{Point, Real};
use if_core::monitor::Monitor;
use if_outfit::motion::Walker;
use std::time::Instant;

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
        windows: Windows<'a>,
        depth: Real,
    ) -> Self {
        let smoother = Smoother::new(movement, walker.clone(), windows);
        Self { walker, smoother, measurer: Measurer::new(movement), depth }
    }

    /// The positions of frame `k` and its row.
    pub(super) fn frame(
        &mut self,
        k: usize,
        [walked, means]: [&Frames; 2],
        monitor: &mut dyn Monitor,
    ) -> Result<(Vec<Point>, FrameReport), AnimateError> {
        let start = Instant::now();
        let (row, unsmoothed) = walked.written(k)?;
        // Contacts keep layers apart, and not vertices on their sides.
        let mut smoothed = None;
        for positions in self.smoother.frame(k, [walked, means], monitor)? {
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
                let found = self.measurer.verify(&self.walker, &unsmoothed)?;
                (unsmoothed, found)
            }
        };
        let within = (&positions[..], self.depth);
        if let Some(kept) = self.measurer.within(&mut self.walker, k, within, monitor)? {
            (positions, found) = kept;
        }
        let mut row = FrameReport {
            pairs: found.pairs,
            inside: found.inside,
            own_pairs: found.own_pairs,
            body_own_pairs: found.body_own_pairs,
            new_own_pairs: found.new_own_pairs,
            first_pairs: found.first_pairs,
            first_inside: found.first_inside,
            smoothed: is_smoothed,
            pinch: found.pinch,
            ..row
        };
        self.measurer.measure(&self.walker, k, &positions, &mut row)?;
        row.seconds += start.elapsed().as_secs_f64();
        Ok((positions, row))
    }
}
