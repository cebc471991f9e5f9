//! The first pass: from the last clean state to the pose of the next frame.

use super::error::AnimateError;
use super::movement::{DISPLACED, Movement, Place};
use super::parts::Runs;
use super::report::FrameReport;
use super::shots::Shots;
use if_core::math::{Point, Real};
use if_core::monitor::Monitor;
use if_core::parameter::ParameterError;
use if_outfit::Pinch;
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
    /// well, and the better of the two kept; also where a vertex of a garment moves by more than 0.1 m.
    pub body_limit: Real,
    /// Seconds before and after each frame over which displacements are smoothed; 0 for no smoothing.
    /// Frames that lie farther apart than this, or than 0.2 s, are not smoothed.
    pub smoothing: Real,
    /// What happens where the body meets itself or leaves no room for the cloth between. If it is
    /// kept, it is as skinned in each frame, and [`FrameReport::pinch`] has what intersects there.
    pub pinch: Pinch,
    /// Largest displacement of a body that yields, in metres. Where it would have to yield by more,
    /// that is a pinch, and [`FrameReport::pinch`] has what intersects there.
    pub body_depth: Real,
    /// At most so many frames are reached one from another; then the outfit comes from the rest pose once
    /// more. Such runs of frames are computed side by side, on threads and machines.
    pub run: usize,
    /// Parameters of the walk.
    pub walk: WalkParams,
}

impl Default for AnimateParams {
    fn default() -> Self {
        Self {
            turn: 0.1,
            body_limit: 0.03,
            smoothing: 0.4,
            pinch: Pinch::Yield,
            body_depth: 0.1,
            run: 48,
            walk: WalkParams::default(),
        }
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
        let ok = self.body_depth > 0.0 && self.body_depth <= 1.0;
        ParameterError::check("body_depth", self.body_depth, ok, "above 0 and at most 1 m")?;
        let ok = (0.0..=1.0).contains(&self.smoothing);
        ParameterError::check("smoothing", self.smoothing, ok, "from 0 to 1 s")?;
        ParameterError::check("run", self.run as Real, self.run > 0, "1 or more")?;
        self.walk.validate()
    }

    /// Displacement that the body may have.
    pub(super) fn depth(&self) -> Real {
        if self.pinch == Pinch::Keep { 0.0 } else { self.body_depth }
    }

    /// Frames to each side over which displacements are smoothed.
    pub(super) fn smoothed_frames(&self, frames_per_second: Real) -> usize {
        // A whole number of frames stays one, whatever its product is rounded to. A rate is positive
        // and finite, and the cast saturates.
        let frames = |seconds: Real| (seconds * frames_per_second + 1e-6).floor() as usize;
        if frames(MOST_APART) == 0 { 0 } else { frames(self.smoothing).min(MOST_SMOOTHING) }
    }
}

/// Seconds between frames that have anything in common to smooth.
const MOST_APART: Real = 0.2;
/// Most frames of smoothing to each side. The window is held in memory.
const MOST_SMOOTHING: usize = 30;

/// An outfit on its way through a motion.
#[derive(Clone, Debug)]
pub struct Animator<'a> {
    movement: Movement<'a>,
    params: AnimateParams,
    /// The clean outfit, before layers were moved apart.
    rest: Vec<Point>,
    walker: Walker,
    shots: Shots,
    runs: Runs,
    /// Where the walker's target is.
    pub(super) place: Place,
    /// The next frame.
    frame: usize,
}

impl<'a> Animator<'a> {
    /// An outfit before the first frame of a motion.
    ///
    /// # Errors
    ///
    /// An outfit that is invalid or whose layers intersect, parameters out of range, or poses of another skeleton.
    pub fn new(movement: Movement<'a>, params: AnimateParams) -> Result<Self, AnimateError> {
        params.validate()?;
        movement.check()?;
        let (storage, shots) = movement.survey()?;
        let walker = Walker::new(movement.outfit(), params.walk)?.stored_as(storage);
        let (rest, place) = (movement.positions(), movement.rest());
        let runs = Runs::new(&shots, params.run);
        Ok(Self { movement, params, rest, walker, shots, runs, place, frame: 0 })
    }

    /// The runs of its frames.
    pub(super) fn runs(&self) -> &Runs {
        &self.runs
    }

    /// The frames between cuts.
    pub(super) fn shots(&self) -> &Shots {
        &self.shots
    }

    /// Goes on with the first frame of a run.
    pub(super) fn begin(&mut self, frame: usize) {
        self.frame = frame;
    }

    /// The walker.
    pub(super) fn walker(&self) -> &Walker {
        &self.walker
    }

    /// Goes to the state of a walker at `place`, after a frame was done.
    pub(super) fn resume(&mut self, frame: usize, place: Place, snapshot: &[u8]) -> bool {
        let fits = match (&place, &self.place) {
            (Place::Pose(a), Place::Pose(b)) => a.rotations.len() == b.rotations.len(),
            (Place::Body(a), Place::Body(b)) => a.len() == b.len(),
            _ => false,
        };
        if !fits || self.walker.restore(snapshot).is_err() {
            return false;
        }
        self.place = place;
        self.frame = frame + 1;
        true
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
        let mut restarted = self.runs.of(self.frame).start == self.frame;
        if restarted {
            self.restart()?;
        }
        let mut walked = self.walk(monitor)?;
        let excess = self.excess()?;
        if !restarted && (walked.reached < 1.0 || excess > 1.0) {
            // Limbs that pass one another, or a fold that was entered on the wrong side: the way
            // from the rest pose is another one.
            restarted = self.walk_from_rest(&mut walked, monitor)?;
        }
        if walked.unresolved.iter().any(|[a, b]| a.0 == 0 && b.0 == 0) {
            // The body meets itself, and that may be far from any garment.
            self.walker.set_letting_go(true);
            let found = self.walk_from_rest(&mut walked, monitor);
            self.walker.set_letting_go(false);
            restarted |= found?;
        }
        let reached = walked.reached >= 1.0;
        let positions = if reached {
            self.walker.positions().to_vec()
        } else {
            self.walker.carried(&self.movement.posed(self.frame, self.walker.rest())?)?
        };
        let row = FrameReport {
            frame: self.frame,
            reached,
            restarted,
            steps: walked.steps,
            halved: walked.halved,
            solves: walked.solves,
            wide: walked.wide,
            let_go: self.walker.triangles_let_go(),
            seconds: start.elapsed().as_secs_f64(),
            ..FrameReport::default()
        };
        self.frame += 1;
        Ok((positions, row))
    }

    /// Walks from the rest pose, and stays where that leads if it is better than what was `walked`.
    fn walk_from_rest(
        &mut self,
        walked: &mut Walked,
        monitor: &mut dyn Monitor,
    ) -> Result<bool, AnimateError> {
        let (snapshot, so_far, rank) =
            (self.walker.snapshot(), self.place.clone(), self.rank(walked)?);
        self.restart()?;
        let again = self.walk(monitor)?;
        let is_better = self.rank(&again)? > rank;
        if is_better {
            *walked = again;
        } else {
            self.walker.restore(&snapshot).expect("a snapshot of this walker");
            self.place = so_far;
        }
        Ok(is_better)
    }

    /// What of two ways to a frame is better: how far it came, fewer vertices inside of what they lie over,
    /// and less excess.
    fn rank(&self, walked: &Walked) -> Result<[Real; 3], AnimateError> {
        let is_there = walked.reached >= 1.0;
        let inside = if is_there { self.walker.prove(self.walker.positions())?.inside } else { 0 };
        Ok([walked.reached, -(inside as Real), -self.excess()?])
    }

    /// Largest displacement from where the next frame has them, of the body as a share of
    /// [`AnimateParams::body_limit`], or of garments as one of what frames are stored for: more than 1 is
    /// a fold that was entered on the wrong side, or a vertex that contacts threw out.
    fn excess(&self) -> Result<Real, AnimateError> {
        let posed = self.movement.posed(self.frame, &self.rest)?;
        let (now, skin) = (self.walker.positions(), self.walker.layer(&posed, 0).len());
        let largest = |a: &[Point], b: &[Point]| {
            let squared = a.iter().zip(b).map(|(a, b)| (b - a).norm_squared());
            squared.fold(0.0, Real::max).sqrt()
        };
        let body = largest(&posed[..skin], &now[..skin]) / self.params.body_limit;
        Ok(body.max(largest(&posed[skin..], &now[skin..]) / DISPLACED))
    }

    /// Goes to the rest pose, moved as a whole to where the next frame has it.
    fn restart(&mut self) -> Result<(), AnimateError> {
        let (place, target) = self.movement.rest_near(self.frame, self.walker.rest())?;
        self.walker.hold_all();
        self.walker.restart(target)?;
        self.place = place;
        Ok(())
    }

    fn walk(&mut self, monitor: &mut dyn Monitor) -> Result<Walked, AnimateError> {
        let way = self.movement.way(&self.place, self.frame, self.params.turn)?;
        let rest = self.walker.rest().to_vec();
        let walked = self.walker.walk(way.steps, &|share| (way.posed)(share, &rest), monitor)?;
        self.place = (way.place)(walked.reached);
        Ok(walked)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{motion, outfit};
    use super::*;
    use if_body::mannequin::rig;
    use if_core::math::Vector;
    use if_core::monitor::Silent;
    use if_core::nalgebra::UnitQuaternion;

    #[test]
    fn what_lies_far_from_where_its_frame_has_it_is_in_excess() {
        let (outfit, motion) = (outfit(), motion(1));
        let movement = Movement::poses(&outfit, &motion);
        let mut animator = Animator::new(movement, AnimateParams::default()).unwrap();
        let posed = movement.posed(0, &animator.rest).unwrap();
        let skin = outfit.outfit.body.mesh.vertices().len();
        let mut excess = |v: usize, by: Real| {
            let mut x = posed.clone();
            x[v] += Vector::x() * by;
            animator.walker.restart(x).unwrap();
            animator.excess().unwrap()
        };
        assert!(excess(0, 0.0) < 1e-3);
        // A body may move by 3 cm, and a garment by 10.
        for (v, by, expected) in [(0, 0.06, 2.0), (skin, 0.06, 0.6), (skin + 7, 0.3, 3.0)] {
            approx::assert_relative_eq!(excess(v, by), expected, epsilon = 1e-3);
        }
    }

    #[test]
    fn of_two_ways_the_one_with_fewer_vertices_inside_is_better() {
        let (outfit, motion) = (outfit(), motion(1));
        let movement = Movement::poses(&outfit, &motion);
        let mut animator = Animator::new(movement, AnimateParams::default()).unwrap();
        let rest = animator.rest.clone();
        let skin = outfit.outfit.body.mesh.vertices().len();
        // Thighs are within the trousers, and these within the thighs.
        let mut rank = |reached: Real, narrower: Real| {
            let mut x = rest.clone();
            for p in &mut x[skin..] {
                let middle = 0.09 * p.x.signum();
                (p.x, p.z) = (middle + narrower * (p.x - middle), narrower * p.z);
            }
            animator.walker.restart(x).unwrap();
            let mut walked = Walked::default();
            walked.reached = reached;
            animator.rank(&walked).unwrap()
        };
        let (clean, inside, stuck) = (rank(1.0, 1.0), rank(1.0, 0.5), rank(0.5, 1.0));
        assert!(clean[1] == 0.0 && inside[1] <= -10.0, "{clean:?} {inside:?}");
        assert!(clean > inside && inside > stuck);
    }

    #[test]
    fn a_step_that_is_stuck_takes_more_sweeps_and_solves() {
        let (outfit, mut motion) = (outfit(), motion(1));
        // The thigh meets the belly, with the trousers of both between.
        let thigh = rig::skeleton().names().position(|n| n == "left_thigh").unwrap();
        motion.poses[0].rotations[thigh] = UnitQuaternion::from_axis_angle(&Vector::x_axis(), -1.7);
        let mut params = AnimateParams::default();
        (params.walk.sweeps, params.walk.halvings) = (1, 0);
        let movement = Movement::poses(&outfit, &motion);
        let mut animator = Animator::new(movement, params).unwrap();
        let (positions, row) = animator.next_frame(&mut Silent).unwrap();
        assert!(row.reached && row.let_go == 0, "{row:?}");
        assert!(animator.walker().intersections(&positions).unwrap().is_empty());
    }
}
