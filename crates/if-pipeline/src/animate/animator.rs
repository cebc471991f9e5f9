//! Frame after frame.

use super::error::AnimateError;
use super::outfit::SkinnedOutfit;
use super::report::{FrameReport, Spread, Yielding};
use if_body::{Motion, Pose};
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Monitor;
use if_core::parameter::ParameterError;
use if_mesh::Bvh;
use if_mesh::intersections::own_pairs;
use if_mesh::measure::strain;
use if_outfit::motion::{WalkParams, Walked, Walker};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Parameters of [`animate`](super::animate()).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AnimateParams {
    /// Largest turn of a joint in one step, in radians. Frames that differ by more take several.
    pub turn: Real,
    /// Displacement of the body, in metres, above which a frame is reached from the rest pose as
    /// well, and the better of the two kept.
    pub body_limit: Real,
    /// Parameters of the walk.
    pub walk: WalkParams,
}

impl Default for AnimateParams {
    fn default() -> Self {
        Self { turn: 0.1, body_limit: 0.015, walk: WalkParams::default() }
    }
}

impl AnimateParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range or NaN.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let ok = self.turn >= 1e-3 && self.turn <= 1.0;
        ParameterError::check("turn", self.turn, ok, "from 0.001 to 1 (radians)")?;
        let ok = self.body_limit > 0.0 && self.body_limit <= 1.0;
        ParameterError::check("body_limit", self.body_limit, ok, "above 0 and at most 1 m")?;
        self.walk.validate()
    }
}

/// Displacement of the body above which it counts as yielding, in metres.
const YIELDS: Real = 1e-3;

/// An outfit on its way through a motion.
#[derive(Debug)]
pub struct Animator<'a> {
    outfit: &'a SkinnedOutfit,
    motion: &'a Motion,
    params: AnimateParams,
    /// The clean outfit, before layers were moved apart.
    rest: Vec<Point>,
    walker: Walker,
    /// The pose of the walker's state.
    pub(super) pose: Pose,
    /// The next frame.
    frame: usize,
    /// Local displacements of the frame before.
    previous: Option<Vec<Vector>>,
}

impl<'a> Animator<'a> {
    /// An outfit before the first frame of a motion.
    ///
    /// # Errors
    ///
    /// An outfit that is invalid or not clean, parameters out of range, or poses of another skeleton.
    pub fn new(
        outfit: &'a SkinnedOutfit,
        motion: &'a Motion,
        params: AnimateParams,
    ) -> Result<Self, AnimateError> {
        params.validate()?;
        for (frame, pose) in motion.poses.iter().enumerate() {
            let fault = |source| AnimateError::Pose { frame, source };
            outfit.skeleton.transforms(pose).map_err(fault)?;
        }
        let walker = Walker::new(&outfit.outfit, params.walk)?;
        Ok(Self {
            rest: outfit.positions(),
            pose: Pose::rest(outfit.skeleton.len()),
            frame: 0,
            previous: None,
            outfit,
            motion,
            params,
            walker,
        })
    }

    /// The walker.
    pub(super) fn walker(&self) -> &Walker {
        &self.walker
    }

    /// Goes to the state of a walker at `pose`, after a frame with these positions was done.
    pub(super) fn resume(
        &mut self,
        frame: usize,
        pose: Pose,
        snapshot: &[u8],
        positions: &[Point],
    ) -> bool {
        let skinned = self.skinned(&self.rest, &self.motion.poses[frame]);
        let Ok(previous) = self.walker.local_displacements(&skinned, positions) else {
            return false;
        };
        if pose.rotations.len() != self.pose.rotations.len()
            || self.walker.restore(snapshot).is_err()
        {
            return false;
        }
        self.previous = Some(previous);
        self.pose = pose;
        self.frame = frame + 1;
        true
    }

    fn skinned(&self, points: &[Point], pose: &Pose) -> Vec<Point> {
        self.outfit.posed(points, pose).expect("poses were checked against the skeleton")
    }

    /// Walks to the pose of the next frame, and returns the positions of all layers with its row.
    ///
    /// # Errors
    ///
    /// The monitor cancelled.
    ///
    /// # Panics
    ///
    /// If all frames are done.
    pub fn next_frame(
        &mut self,
        monitor: &mut dyn Monitor,
    ) -> Result<(Vec<Point>, FrameReport), AnimateError> {
        let start = Instant::now();
        let pose = &self.motion.poses[self.frame];
        let mut restarted = self.frame == 0;
        if restarted {
            self.restart(pose)?;
        }
        let mut walked = self.walk(pose, monitor)?;
        if !restarted && (walked.reached < 1.0 || self.body_moved(pose) > self.params.body_limit) {
            // Limbs that pass one another, or a fold that was entered on the wrong side: the way
            // from the rest pose is another one.
            let (snapshot, so_far) = (self.walker.snapshot(), self.pose.clone());
            let moved = self.body_moved(pose);
            self.restart(pose)?;
            let again = self.walk(pose, monitor)?;
            let better = (again.reached, -self.body_moved(pose)) > (walked.reached, -moved);
            if better {
                (walked, restarted) = (again, true);
            } else {
                self.walker.restore(&snapshot).expect("a snapshot of this walker");
                self.pose = so_far;
            }
        }
        let reached = walked.reached >= 1.0;
        let positions = if reached {
            self.walker.positions().to_vec()
        } else {
            self.walker.carried(&self.skinned(self.walker.rest(), pose))?
        };
        let mut row = self.measure(pose, &positions)?;
        (row.frame, row.reached, row.restarted) = (self.frame, reached, restarted);
        (row.steps, row.halved, row.solves) = (walked.steps, walked.halved, walked.solves);
        row.seconds = start.elapsed().as_secs_f64();
        self.frame += 1;
        Ok((positions, row))
    }

    /// Largest displacement of the body from the skinned one.
    fn body_moved(&self, pose: &Pose) -> Real {
        let skinned = self.skinned(&self.rest, pose);
        let [a, b] = [&skinned[..], self.walker.positions()].map(|x| self.walker.layer(x, 0));
        a.iter().zip(b).map(|(a, b)| (b - a).norm_squared()).fold(0.0, Real::max).sqrt()
    }

    /// Goes to the rest pose, with the roots where `pose` has them.
    fn restart(&mut self, pose: &Pose) -> Result<(), AnimateError> {
        let mut rest = Pose::rest(pose.rotations.len());
        rest.root_translation = pose.root_translation;
        for (k, joint) in self.outfit.skeleton.joints().iter().enumerate() {
            if joint.parent.is_none() {
                rest.rotations[k] = pose.rotations[k];
            }
        }
        self.walker.restart(self.skinned(self.walker.rest(), &rest))?;
        self.pose = rest;
        Ok(())
    }

    fn walk(&mut self, pose: &Pose, monitor: &mut dyn Monitor) -> Result<Walked, AnimateError> {
        let from = self.pose.clone();
        let steps = (from.largest_turn(pose) / self.params.turn).ceil().max(1.0) as usize;
        let rest = self.walker.rest().to_vec();
        let outfit = self.outfit;
        let path = |share: Real| {
            outfit.posed(&rest, &from.toward(pose, share)).expect("poses of one skeleton")
        };
        let walked = self.walker.walk(steps, &path, monitor)?;
        self.pose = from.toward(pose, walked.reached);
        Ok(walked)
    }

    /// The row of a frame, but for how it was reached.
    fn measure(&mut self, pose: &Pose, positions: &[Point]) -> Result<FrameReport, AnimateError> {
        let skinned = self.skinned(&self.rest, pose);
        let found = self.walker.prove(positions)?;
        let (body_own, own) = found.own_pairs.split_first().map_or((0, &[][..]), |(b, o)| (*b, o));
        let local = self.walker.local_displacements(&skinned, positions)?;
        let change = |before: &Vec<Vector>| {
            Spread::of(before.iter().zip(&local).map(|(a, b)| (b - a).norm()).collect())
        };
        let jitter = self.previous.as_ref().map(change).unwrap_or_default();
        self.previous = Some(local);
        let garments = self.walker.layer(&skinned, 0).len();
        let moved = skinned[garments..].iter().zip(&positions[garments..]);
        let strains = |x: &[Point]| {
            let of = |(k, garment): (usize, &if_outfit::Layer)| {
                strain(&garment.mesh, self.walker.layer(x, k + 1)).p99
            };
            self.outfit.outfit.garments.iter().enumerate().map(of).fold(0.0, Real::max)
        };
        Ok(FrameReport {
            pairs_before: self.walker.pairs(&skinned)?,
            pairs: found.pairs,
            inside: found.inside,
            own_pairs: own.iter().sum(),
            body_own_pairs: body_own,
            new_own_pairs: found.new_own_pairs,
            moved: Spread::of(moved.map(|(a, b)| (b - a).norm()).collect()),
            body: self.yielding(&skinned, positions),
            strain_p99: strains(positions),
            strain_p99_skinned: strains(&skinned),
            jitter,
            ..FrameReport::default()
        })
    }

    fn yielding(&self, skinned: &[Point], positions: &[Point]) -> Yielding {
        let rest = &self.outfit.outfit.body.mesh;
        let [skinned, now] = [skinned, positions].map(|x| self.walker.layer(x, 0));
        let mesh = rest.with_vertices(skinned.to_vec()).expect("skinned positions are finite");
        let met = own_pairs(&mesh, &Bvh::new(&mesh));
        let moved: Vec<Real> = skinned.iter().zip(now).map(|(a, b)| (b - a).norm()).collect();
        let mut corners: Vec<u32> = met
            .iter()
            .flat_map(|p| [p.a, p.b])
            .flat_map(|t| mesh.triangles()[t as usize])
            .collect();
        corners.sort_unstable();
        corners.dedup();
        let (mut area, mut whole) = (0.0, 0.0);
        for (t, corners) in mesh.triangles().iter().enumerate() {
            let [a, b, c] = mesh.corners(t);
            let size = if_core::math::area_vector(a, b, c).norm();
            let yields = corners.iter().filter(|v| moved[**v as usize] > YIELDS).count();
            area += size * yields as Real / 3.0;
            whole += size;
        }
        let distance = |v: usize| {
            let to = |c: &u32| (skinned[*c as usize] - skinned[v]).norm_squared();
            corners.iter().map(to).fold(Real::INFINITY, Real::min).sqrt()
        };
        let yielding = (0..moved.len()).filter(|v| moved[*v] > YIELDS && !corners.is_empty());
        Yielding {
            own_pairs_before: met.len(),
            reach: yielding.map(distance).reduce(Real::max),
            area: if whole > 0.0 { area / whole } else { 0.0 },
            moved: Spread::of(moved),
        }
    }
}
