//! The second pass: displacements smoothed over time, each frame clean again.

use super::error::AnimateError;
use super::local::PoseMaps;
use super::movement::Movement;
use super::window::Window;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Silent;
use if_core::nalgebra::Vector3;
use if_outfit::motion::Walker;
use std::collections::BTreeMap;

/// Correction of a frame, in metres, below which it stays as it is: a hundredth of the jitter that
/// can be seen. Ten times more leaves steps between frames that stay and frames that do not.
const STILL: Real = 1e-5;
/// Power of lengths by which what contacts add to the frames of a window is weighted: near the
/// largest of them, and smooth where another one becomes the largest. With 4 it is less than that, and
/// frames jump there; with 16 they jump where it changes.
const SHARPNESS: i32 = 8;

/// Moves each frame towards the mean of its neighbours' displacements, as far as contacts permit, and
/// then, where contacts keep neighbours from theirs, on towards those.
///
/// ```text
/// ū_f = Σ w_d u_{f+d} / Σ w_d,   w_d = 1 − |d| / (r + 1),   |d| ≤ r,   in the frames of the rest pose
/// v_f = what contacts permit of ū_f, from u_f                            (Walker::approach)
/// x_f = what they permit of ū_f + max_d w_d (v_{f+d} − ū_{f+d}), from v_f
/// ```
///
/// The maximum is that of lengths, and smooth. So a frame in which layers come to meet is not the
/// first one that moves: those before it have made way. Frames whose pose was not reached have no
/// weight. A frame depends on the walked frames of its [`reach`](Self::reach) alone, so that the bits do
/// not depend on where a run was interrupted.
#[derive(Debug)]
pub(super) struct Smoother<'a> {
    movement: Movement<'a>,
    walker: Walker,
    radius: usize,
    /// Displacements u of walked frames.
    walked: BTreeMap<usize, Vec<Local>>,
    /// Frames that went to the mean of their neighbours.
    means: BTreeMap<usize, Mean>,
}

/// A displacement in the frame of the rest pose, as many are kept: in single precision, in metres.
type Local = Vector3<f32>;

/// A frame that went to the mean of its neighbours, as far as contacts permit.
#[derive(Debug)]
struct Mean {
    positions: Vec<Point>,
    /// Its displacements v.
    local: Vec<Local>,
    /// What contacts added to the mean, v − ū.
    added: Vec<Local>,
}

impl<'a> Smoother<'a> {
    /// `walker` is of this outfit.
    pub(super) fn new(movement: Movement<'a>, walker: Walker, radius: usize) -> Self {
        Self { movement, walker, radius, walked: BTreeMap::new(), means: BTreeMap::new() }
    }

    /// Walked frames to each side that a frame depends on: those of the means of its neighbours.
    pub(super) fn reach(radius: usize) -> usize {
        2 * radius
    }

    /// The positions of frame `k`, the smoothest first, then others for want of a clean one; none if
    /// smoothing has nothing to do.
    pub(super) fn frame(
        &mut self,
        k: usize,
        window: &Window,
    ) -> Result<Vec<Vec<Point>>, AnimateError> {
        if self.radius == 0 || !window.frame(k).row.reached {
            return Ok(Vec::new());
        }
        let (first, last) = (k.saturating_sub(self.radius), k + self.radius);
        self.means.retain(|frame, _| *frame >= first);
        for (frame, _) in window.frames(first, last).filter(|(_, w)| w.row.reached) {
            if !self.means.contains_key(&frame) {
                let mean = self.mean_of(frame, window)?;
                self.means.insert(frame, mean);
            }
        }
        let to = self.prepared(k);
        let mean = &self.means[&k];
        let (from, moves) = (mean.positions.clone(), differ(&to, &mean.local));
        let mut found = Vec::new();
        if moves && let Some(positions) = self.approach(k, &from, &to)? {
            found.push(positions);
        }
        if from != window.frame(k).positions {
            found.push(from);
        }
        Ok(found)
    }

    /// Frame `k` as near to the mean of its neighbours as contacts permit.
    fn mean_of(&mut self, k: usize, window: &Window) -> Result<Mean, AnimateError> {
        let (first, last) = (k.saturating_sub(self.radius), k + self.radius);
        self.walked.retain(|frame, _| *frame >= first);
        for (frame, walked) in window.frames(first, last).filter(|(_, w)| w.row.reached) {
            if !self.walked.contains_key(&frame) {
                let (maps, target) = self.target(frame)?;
                self.walked.insert(frame, stored(maps.local(&target, &walked.positions)));
            }
        }
        let mean = self.average(k);
        let from = &window.frame(k).positions;
        let approached =
            if differ(&mean, &self.walked[&k]) { self.approach(k, from, &mean)? } else { None };
        let positions = approached.unwrap_or_else(|| from.clone());
        let (maps, target) = self.target(k)?;
        let local = maps.local(&target, &positions);
        let added = local.iter().zip(&mean).map(|(v, mean)| v - mean).collect();
        Ok(Mean { positions, local: stored(local), added: stored(added) })
    }

    /// Frame `k` from the clean positions `from` towards some displacements, unless that is no
    /// improvement: a fold that is entered on another side than in `from`.
    fn approach(
        &mut self,
        k: usize,
        from: &[Point],
        displacements: &[Vector],
    ) -> Result<Option<Vec<Point>>, AnimateError> {
        let (maps, target) = self.target(k)?;
        let to = maps.displaced(&target, displacements);
        self.walker.approach(from, &to, &target, &mut Silent)?;
        let now = self.walker.positions();
        let body = self.walker.layer(now, 0).len();
        let largest = |x: &[Point], first: usize| {
            let squared = x[first..].iter().zip(&to[first..]).map(|(a, b)| (b - a).norm_squared());
            squared.fold(0.0, Real::max)
        };
        Ok((largest(now, body) <= largest(from, 0)).then(|| now.to_vec()))
    }

    fn weight(&self, k: usize, frame: usize) -> Real {
        1.0 - frame.abs_diff(k) as Real / (self.radius + 1) as Real
    }

    /// Mean displacement ū of the window around frame `k`.
    fn average(&self, k: usize) -> Vec<Vector> {
        let mut sum = vec![Vector::zeros(); self.walker.rest().len()];
        let mut whole = 0.0;
        for (frame, local) in self.walked.range(..=k + self.radius) {
            let weight = self.weight(k, *frame);
            whole += weight;
            sum.iter_mut().zip(local).for_each(|(sum, u)| *sum += u.cast::<Real>() * weight);
        }
        // The window holds frame `k`, whose weight is positive.
        sum.iter_mut().for_each(|sum| *sum /= whole);
        sum
    }

    /// The mean of frame `k`, and the most of what contacts add to it and to those of its neighbours.
    fn prepared(&self, k: usize) -> Vec<Vector> {
        let mean = &self.means[&k];
        let mut sums = vec![(Vector::zeros(), 0.0); mean.local.len()];
        for (frame, other) in &self.means {
            let weight = self.weight(k, *frame);
            for ((sum, whole), added) in sums.iter_mut().zip(&other.added) {
                let added = added.cast::<Real>() * weight;
                let share = added.norm().powi(SHARPNESS);
                *sum += added * share;
                *whole += share;
            }
        }
        let prepared = |((local, added), (sum, whole)): ((&Local, &Local), &(Vector, Real))| {
            let most = if *whole > 0.0 { sum / *whole } else { added.cast() };
            local.cast::<Real>() - added.cast::<Real>() + most
        };
        mean.local.iter().zip(&mean.added).zip(&sums).map(prepared).collect()
    }

    /// The maps of a frame, and what displacements are counted from.
    fn target(&self, frame: usize) -> Result<(PoseMaps, Vec<Point>), AnimateError> {
        let maps = self.movement.maps(frame)?;
        let target = maps.posed(self.walker.rest());
        Ok((maps, target))
    }
}

/// Displacements in single precision.
fn stored(displacements: Vec<Vector>) -> Vec<Local> {
    displacements.into_iter().map(|u| u.cast()).collect()
}

/// Whether some displacements differ by more than [`STILL`].
fn differ(a: &[Vector], b: &[Local]) -> bool {
    a.iter().zip(b).any(|(a, b)| (a - b.cast::<Real>()).norm_squared() >= STILL * STILL)
}
