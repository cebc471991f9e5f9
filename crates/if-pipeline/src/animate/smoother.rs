//! The second pass: displacements smoothed over time, each frame clean again.

use super::error::AnimateError;
use super::local::PoseMaps;
use super::movement::Movement;
use super::window::Window;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Silent;
use if_outfit::motion::Walker;
use std::collections::BTreeMap;

/// Correction of a frame, in metres, below which it stays as it is: a hundredth of the jitter that
/// can be seen. Ten times more leaves steps between frames that stay and frames that do not.
const STILL: Real = 1e-5;

/// Moves each frame towards the mean of its neighbours' displacements, as far as contacts permit.
///
/// ```text
/// ū_f = Σ w_d u_{f+d} / Σ w_d,   w_d = r + 1 − |d|,   |d| ≤ r,   in the frames of the rest pose
/// x_f → target_f + turned(ū_f)                                   (Walker::approach)
/// ```
///
/// Frames whose pose was not reached have no weight. A frame depends on the walked frames of its
/// window alone, so that the bits do not depend on where a run was interrupted.
#[derive(Debug)]
pub(super) struct Smoother<'a> {
    movement: Movement<'a>,
    walker: Walker,
    radius: usize,
    /// Local displacements of the frames of the window.
    local: BTreeMap<usize, Vec<Vector>>,
}

impl<'a> Smoother<'a> {
    /// `walker` is of this outfit.
    pub(super) fn new(movement: Movement<'a>, walker: Walker, radius: usize) -> Self {
        Self { movement, walker, radius, local: BTreeMap::new() }
    }

    /// The positions of frame `k`; those of the window if smoothing has nothing to do.
    pub(super) fn frame(&mut self, k: usize, window: &Window) -> Result<Vec<Point>, AnimateError> {
        let walked = window.frame(k);
        let from = &walked.positions;
        if self.radius == 0 || !walked.row.reached {
            return Ok(from.clone());
        }
        let (first, last) = (k.saturating_sub(self.radius), k + self.radius);
        self.local.retain(|frame, _| *frame >= first);
        for (frame, walked) in window.frames(first, last).filter(|(_, w)| w.row.reached) {
            if !self.local.contains_key(&frame) {
                let (maps, target) = self.target(frame)?;
                self.local.insert(frame, maps.local(&target, &walked.positions));
            }
        }
        let mean = self.mean(k);
        let corrections = mean.iter().zip(&self.local[&k]).map(|(to, own)| to - own);
        let largest = corrections.map(|c| c.norm_squared()).fold(0.0, Real::max);
        if largest < STILL * STILL {
            return Ok(from.clone());
        }
        let (maps, target) = self.target(k)?;
        let to = maps.displaced(&target, &mean);
        self.walker.approach(from, &to, &target, &mut Silent)?;
        // A fold that is entered on another side than in the walked frame is no improvement.
        let body = self.walker.layer(&to, 0).len();
        let left = self.walker.positions().iter().zip(&to).skip(body);
        if left.map(|(a, b)| (a - b).norm_squared()).fold(0.0, Real::max) > largest {
            return Ok(from.clone());
        }
        Ok(self.walker.positions().to_vec())
    }

    /// Mean displacement of the window around frame `k`.
    fn mean(&self, k: usize) -> Vec<Vector> {
        let mut sum = vec![Vector::zeros(); self.walker.rest().len()];
        let mut whole = 0.0;
        for (frame, local) in &self.local {
            let weight = (self.radius + 1 - frame.abs_diff(k)) as Real;
            whole += weight;
            sum.iter_mut().zip(local).for_each(|(sum, u)| *sum += u * weight);
        }
        // The window holds frame `k`, whose weight is positive.
        sum.iter_mut().for_each(|sum| *sum /= whole);
        sum
    }

    /// The maps of a frame, and what displacements are counted from.
    fn target(&self, frame: usize) -> Result<(PoseMaps, Vec<Point>), AnimateError> {
        let maps = self.movement.maps(frame)?;
        let target = maps.posed(self.walker.rest());
        Ok((maps, target))
    }
}
