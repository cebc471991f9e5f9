//! The second pass: displacements smoothed over time, each frame clean again.

use super::animator::skinned;
use super::error::AnimateError;
use super::frames::Frames;
use super::outfit::SkinnedOutfit;
use if_body::Motion;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Monitor;
use if_outfit::motion::Walker;
use std::collections::BTreeMap;

/// Correction of a frame, in metres, below which it stays as it is: a hundredth of the jitter that
/// can be seen. Ten times more leaves steps between frames that stay and frames that do not.
const STILL: Real = 1e-5;

/// Longest correction in one step, in metres: near the distance at which contacts are watched. Three
/// times more lets vertices of deep folds come out on another side.
const LONGEST: Real = 5e-3;
/// Most steps of one frame.
const MOST_STEPS: Real = 4.0;

/// Moves each frame towards the mean of its neighbours' displacements, as far as contacts permit.
///
/// ```text
/// ū_f = Σ w_d u_{f+d} / Σ w_d,   w_d = r + 1 − |d|,   |d| ≤ r,   in the frames of the rest pose
/// x_f → x_f + turned(ū_f − u_f)                                  (Walker::approach)
/// ```
///
/// Frames whose pose was not reached have no weight. A frame depends on the walked frames of its
/// window alone, so that the bits do not depend on where a run was interrupted.
#[derive(Debug)]
pub(super) struct Smoother<'a> {
    outfit: &'a SkinnedOutfit,
    motion: &'a Motion,
    walker: Walker,
    radius: usize,
    /// Local displacements of the walked frames of the window.
    window: BTreeMap<usize, Vec<Vector>>,
}

impl<'a> Smoother<'a> {
    /// `walker` is of this outfit.
    pub(super) fn new(
        outfit: &'a SkinnedOutfit,
        motion: &'a Motion,
        walker: Walker,
        radius: usize,
    ) -> Self {
        Self { outfit, motion, walker, radius, window: BTreeMap::new() }
    }

    /// The last frame on which frame `k` depends.
    pub(super) fn last_needed(&self, k: usize) -> usize {
        (k + self.radius).min(self.motion.poses.len().saturating_sub(1))
    }

    /// The positions of frame `k`; those of `walked` if smoothing has nothing to do.
    pub(super) fn frame(
        &mut self,
        k: usize,
        walked: &Frames,
        monitor: &mut dyn Monitor,
    ) -> Result<Vec<Point>, AnimateError> {
        let from = walked.positions(k)?;
        if self.radius == 0 || !walked.rows()[k].reached {
            return Ok(from);
        }
        let frames = k.saturating_sub(self.radius)..=self.last_needed(k);
        self.window.retain(|frame, _| frames.contains(frame));
        let is_reached = |frame: &usize| walked.rows()[*frame].reached;
        for frame in frames.filter(is_reached) {
            if !self.window.contains_key(&frame) {
                let positions = if frame == k { from.clone() } else { walked.positions(frame)? };
                let target = self.target(frame);
                let local = self.walker.local_displacements(&target, &positions)?;
                self.window.insert(frame, local);
            }
        }
        let correction = self.correction(k);
        let largest = correction.iter().map(Vector::norm_squared).fold(0.0, Real::max);
        if largest < STILL * STILL {
            return Ok(from);
        }
        let target = self.target(k);
        let to = self.walker.displaced(&target, &from, &correction)?;
        let steps = (largest.sqrt() / LONGEST).ceil().clamp(1.0, MOST_STEPS) as usize;
        self.walker.approach(&from, &to, (&target, steps), monitor)?;
        // A fold that is entered on another side than in the walked frame is no improvement.
        let farthest = |x: &[Point]| {
            x.iter().zip(&to).map(|(a, b)| (a - b).norm_squared()).fold(0.0, Real::max)
        };
        if farthest(self.walker.positions()) > largest {
            return Ok(from);
        }
        Ok(self.walker.positions().to_vec())
    }

    /// Mean displacement of the window less that of frame `k`.
    fn correction(&self, k: usize) -> Vec<Vector> {
        let mut sum = vec![Vector::zeros(); self.outfit.skin().len()];
        let mut whole = 0.0;
        for (frame, local) in &self.window {
            let weight = (self.radius + 1 - frame.abs_diff(k)) as Real;
            whole += weight;
            sum.iter_mut().zip(local).for_each(|(sum, u)| *sum += u * weight);
        }
        // The window holds frame `k`, whose weight is positive.
        sum.iter().zip(&self.window[&k]).map(|(sum, own)| sum / whole - own).collect()
    }

    /// What displacements are counted from.
    fn target(&self, frame: usize) -> Vec<Point> {
        skinned(self.outfit, self.walker.rest(), &self.motion.poses[frame])
    }
}
