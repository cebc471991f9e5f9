//! The first pass: from the last clean state to the pose of the next frame.

use super::error::AnimateError;
use super::outfit::SkinnedOutfit;
use super::report::FrameReport;
use if_body::{Motion, Pose};
use if_core::math::{Point, Real};
use if_core::monitor::Monitor;
use if_core::parameter::ParameterError;
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
    /// Seconds before and after each frame over which displacements are smoothed; 0 for no smoothing.
    /// Frames that lie farther apart are not smoothed.
    pub smoothing: Real,
    /// Parameters of the walk.
    pub walk: WalkParams,
}

impl Default for AnimateParams {
    fn default() -> Self {
        Self { turn: 0.1, body_limit: 0.03, smoothing: 0.2, walk: WalkParams::default() }
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
        let ok = (0.0..=1.0).contains(&self.smoothing);
        ParameterError::check("smoothing", self.smoothing, ok, "from 0 to 1 s")?;
        self.walk.validate()
    }

    /// Frames of `motion` to each side over which displacements are smoothed.
    pub(super) fn smoothed_frames(&self, motion: &Motion) -> usize {
        // A whole number of frames stays one, whatever its product is rounded to. A rate is positive
        // and finite, and the cast saturates.
        let frames = (self.smoothing * motion.frames_per_second + 1e-6).floor();
        (frames as usize).min(MOST_SMOOTHING)
    }
}

/// Most frames of smoothing to each side. The window is held in memory.
const MOST_SMOOTHING: usize = 30;

/// `points` in a pose that was checked against the skeleton.
pub(super) fn skinned(outfit: &SkinnedOutfit, points: &[Point], pose: &Pose) -> Vec<Point> {
    outfit.posed(points, pose).expect("poses were checked against the skeleton")
}

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

    /// Goes to the state of a walker at `pose`, after a frame was done.
    pub(super) fn resume(&mut self, frame: usize, pose: Pose, snapshot: &[u8]) -> bool {
        if pose.rotations.len() != self.pose.rotations.len()
            || self.walker.restore(snapshot).is_err()
        {
            return false;
        }
        self.pose = pose;
        self.frame = frame + 1;
        true
    }

    fn skinned(&self, points: &[Point], pose: &Pose) -> Vec<Point> {
        skinned(self.outfit, points, pose)
    }

    /// Walks to the pose of the next frame, and returns the positions of all layers and how they were
    /// reached. What a frame holds is measured when it is complete.
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
        let row = FrameReport {
            frame: self.frame,
            reached,
            restarted,
            steps: walked.steps,
            halved: walked.halved,
            solves: walked.solves,
            wide: walked.wide,
            seconds: start.elapsed().as_secs_f64(),
            ..FrameReport::default()
        };
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
}
