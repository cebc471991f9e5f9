//! The second pass: displacements smoothed over time, each frame clean again.

use super::error::AnimateError;
use super::frames::Frames;
use super::local::PoseMaps;
use super::movement::Movement;
use super::report::FrameReport;
use super::windows::Windows;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Monitor;
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
/// weight, and a window ends at cuts. A frame in which contacts push the body farther than in all walked
/// frames of its window, and than a walk may, stays as it was. Means depend on the walked frames of a window
/// alone, and frames on the means of one, so that the bits do not depend on where a run was interrupted.
#[derive(Debug)]
pub(super) struct Smoother<'a> {
    movement: Movement<'a>,
    walker: Walker,
    windows: Windows<'a>,
    /// Displacements u of walked frames; none of one whose pose was not reached.
    walked: BTreeMap<usize, Option<Vec<Local>>>,
    /// Frames that went to the mean of their neighbours.
    means: BTreeMap<usize, Option<Mean>>,
}

/// A displacement in the frame of the rest pose, as many are kept: in single precision, in metres.
type Local = Vector3<f32>;

/// A frame that went to the mean of its neighbours, as far as contacts permit.
#[derive(Debug)]
struct Mean {
    positions: Vec<Point>,
    /// Whether it stayed where it was walked to.
    is_walked: bool,
    /// Whether the body meets itself there, as it was let go.
    is_let_go: bool,
    /// Its displacements v.
    local: Vec<Local>,
    /// What contacts added to the mean, v − ū.
    added: Vec<Local>,
    /// How far the body may be displaced, in metres.
    most: Real,
}

impl<'a> Smoother<'a> {
    /// `walker` is of this outfit.
    pub(super) fn new(movement: Movement<'a>, walker: Walker, windows: Windows<'a>) -> Self {
        Self { movement, walker, windows, walked: BTreeMap::new(), means: BTreeMap::new() }
    }

    /// The positions of frame `k`, the smoothest first, then others for want of a clean one; none if
    /// smoothing has nothing to do.
    pub(super) fn frame(
        &mut self,
        k: usize,
        [walked, means]: [&Frames; 2],
        monitor: &mut dyn Monitor,
    ) -> Result<Vec<Vec<Point>>, AnimateError> {
        if self.windows.radius == 0 {
            return Ok(Vec::new());
        }
        let window = self.windows.of(k);
        self.means.retain(|frame, _| *frame >= window.start);
        for frame in window {
            if !self.means.contains_key(&frame) {
                let mean = self.mean(frame, [walked, means])?;
                self.means.insert(frame, mean);
            }
        }
        let Some(Some(mean)) = self.means.get(&k) else { return Ok(Vec::new()) };
        let to = self.prepared(k, mean);
        let (from, moves) = (mean.positions.clone(), differ(&to, &mean.local));
        let (is_walked, is_let_go, most) = (mean.is_walked, mean.is_let_go, mean.most);
        let mut found = Vec::new();
        if moves {
            found.extend(self.approach(k, (&from, is_let_go), (&to, most), monitor)?);
        }
        if !is_walked {
            found.push(from);
        }
        Ok(found)
    }

    /// Frame `k` as it went to the mean of its neighbours; none if its own pose was not reached.
    fn mean(
        &mut self,
        k: usize,
        [walked, means]: [&Frames; 2],
    ) -> Result<Option<Mean>, AnimateError> {
        let (row, positions) = means.written(k)?;
        if !row.reached {
            return Ok(None);
        }
        self.read_window(k, walked)?;
        let Some(mean) = self.average(k) else { return Ok(None) };
        let (maps, target) = self.target(k)?;
        let local = maps.local(&target, &positions);
        let added = local.iter().zip(&mean).map(|(v, mean)| v - mean).collect();
        let (local, added) = (stored(local), stored(added));
        let (is_walked, is_let_go) = (!row.smoothed, row.let_go > 0);
        let most = self.most_of_body(k);
        Ok(Some(Mean { positions, is_walked, is_let_go, local, added, most }))
    }

    /// Frame `k` as near to the mean of its neighbours as contacts permit, and its row, which says
    /// whether it moved.
    pub(super) fn averaged(
        &mut self,
        k: usize,
        walked: &Frames,
        monitor: &mut dyn Monitor,
    ) -> Result<(Vec<Point>, FrameReport), AnimateError> {
        let (row, from) = walked.written(k)?;
        self.read_window(k, walked)?;
        let mut moved = None;
        if let (Some(mean), Some(own)) = (self.average(k), &self.walked[&k])
            && differ(&mean, own)
        {
            let most = self.most_of_body(k);
            moved = self.approach(k, (&from, row.let_go > 0), (&mean, most), monitor)?;
        }
        let row = FrameReport { smoothed: moved.is_some(), ..row };
        Ok((moved.unwrap_or(from), row))
    }

    /// Reads the walked frames around `k`, and forgets those before.
    fn read_window(&mut self, k: usize, walked: &Frames) -> Result<(), AnimateError> {
        let window = self.windows.of(k);
        self.walked.retain(|frame, _| *frame >= window.start);
        for frame in window {
            if !self.walked.contains_key(&frame) {
                let (row, positions) = walked.written(frame)?;
                let (maps, target) = self.target(frame)?;
                let local = row.reached.then(|| stored(maps.local(&target, &positions)));
                self.walked.insert(frame, local);
            }
        }
        Ok(())
    }

    /// Frame `k` from the clean positions `from`, in which the body may meet itself if it was let go,
    /// towards some displacements; none if it stays there, also where the body would be displaced by more than
    /// `most` metres.
    fn approach(
        &mut self,
        k: usize,
        (from, is_let_go): (&[Point], bool),
        (displacements, most): (&[Vector], Real),
        monitor: &mut dyn Monitor,
    ) -> Result<Option<Vec<Point>>, AnimateError> {
        if is_let_go {
            self.walker.let_go_as_in(from)?;
        } else {
            self.walker.hold_all();
        }
        let (maps, target) = self.target(k)?;
        let to = maps.displaced(&target, displacements);
        self.walker.approach(from, &to, &target, monitor)?;
        let now = self.walker.positions();
        let body = self.walker.layer(now, 0).iter().zip(&target);
        let is_near = body.map(|(a, b)| (a - b).norm()).all(|displaced| displaced <= most);
        Ok((is_near && now != from).then(|| now.to_vec()))
    }

    /// How far the body of frame `k` may be displaced, in metres: as far as in a walked frame of its window, or
    /// as in one that is reached without a second way.
    fn most_of_body(&self, k: usize) -> Real {
        let walked = self.walked.range(self.windows.of(k)).filter_map(|(_, local)| local.as_ref());
        let skin = self.movement.outfit().body.mesh.vertices().len();
        let body = walked.flat_map(|local| &local[..skin]);
        body.map(|u| Real::from(u.norm())).fold(self.windows.body_limit, Real::max)
    }

    fn weight(&self, k: usize, frame: usize) -> Real {
        1.0 - frame.abs_diff(k) as Real / (self.windows.radius + 1) as Real
    }

    /// Mean displacement ū of the window around frame `k`; none if its own pose was not reached.
    fn average(&self, k: usize) -> Option<Vec<Vector>> {
        self.walked.get(&k)?.as_ref()?;
        let mut sum = vec![Vector::zeros(); self.walker.rest().len()];
        let mut whole = 0.0;
        for (frame, local) in self.walked.range(self.windows.of(k)) {
            let Some(local) = local else { continue };
            let weight = self.weight(k, *frame);
            whole += weight;
            sum.iter_mut().zip(local).for_each(|(sum, u)| *sum += u.cast::<Real>() * weight);
        }
        // The window holds frame `k`, whose weight is positive.
        sum.iter_mut().for_each(|sum| *sum /= whole);
        Some(sum)
    }

    /// The mean of frame `k`, and the most of what contacts add to it and to those of its neighbours.
    fn prepared(&self, k: usize, mean: &Mean) -> Vec<Vector> {
        let mut sums = vec![(Vector::zeros(), 0.0); mean.local.len()];
        for (frame, other) in self.means.range(self.windows.of(k)) {
            let Some(other) = other else { continue };
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

#[cfg(test)]
mod tests {
    use super::super::shots::Shots;
    use super::super::tests::{motion, outfit};
    use super::*;
    use if_core::monitor::{Progress, Silent};
    use if_outfit::motion::WalkParams;
    use std::ops::ControlFlow;

    #[test]
    fn the_body_is_displaced_no_farther_than_in_walked_frames() {
        let (outfit, motion) = (outfit(), motion(3));
        let movement = Movement::poses(&outfit, &motion);
        let walker = Walker::new(&outfit.outfit, WalkParams::default()).unwrap();
        // A cut before the last frame.
        let shots = Shots::new(3, &[0.0, 9.0], 1.0 / 30.0);
        let windows = Windows { shots: &shots, radius: 2, body_limit: 0.03 };
        let mut smoother = Smoother::new(movement, walker, windows);
        let (body, all) = (outfit.outfit.body.mesh.vertices().len(), smoother.walker.rest().len());
        let frame = |v: usize, by: f32| {
            let mut local = vec![Local::zeros(); all];
            local[v].y = by;
            Some(local)
        };
        smoother.walked.insert(0, frame(body, 0.09));
        smoother.walked.insert(1, frame(body - 1, 0.01));
        smoother.walked.insert(2, frame(7, 0.05));
        let most = [0, 1, 2].map(|k| smoother.most_of_body(k));
        assert_eq!(
            most,
            [0.03, 0.03, 0.05_f32.into()],
            "garments do not count, nor do other shots"
        );
        // The crown is to rise by half a millimetre.
        let from = smoother.target(0).unwrap().1;
        let from: Vec<Point> = if_outfit::Storage::F32.round(&from);
        let skin = &outfit.outfit.body.mesh.vertices()[..body];
        let top = skin.iter().map(|p| p.y).fold(0.0, Real::max);
        let rises: Vec<Vector> = (0..all)
            .map(|v| Vector::y() * if v < body && skin[v].y > top - 0.1 { 5e-4 } else { 0.0 })
            .collect();
        let mut moved = |most, monitor: &mut dyn Monitor| {
            smoother.approach(0, (&from, false), (&rises, most), monitor)
        };
        assert!(moved(1e-3, &mut Silent).unwrap().is_some());
        assert!(moved(4e-4, &mut Silent).unwrap().is_none());
        let stopped = moved(1e-3, &mut |_: &Progress<'_>| ControlFlow::Break(()));
        assert!(matches!(stopped, Err(AnimateError::Cancelled(_))), "{stopped:?}");
    }
}
