//! What was found and done in each frame. Lengths are in metres, strains are fractions.

use if_core::math::Real;
use if_mesh::measure::percentile;
use if_outfit::report::PinchReport;
use serde::{Deserialize, Serialize};

/// Some values in short.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Spread {
    /// Their mean.
    pub mean: Real,
    /// 99 % are at most this.
    pub p99: Real,
    /// The largest.
    pub max: Real,
}

impl Spread {
    /// Of values that are not negative; all zero without values.
    pub fn of(mut values: Vec<Real>) -> Self {
        let mean = values.iter().sum::<Real>() / values.len().max(1) as Real;
        values.sort_unstable_by(Real::total_cmp);
        Self { mean, p99: percentile(&values, 99.0), max: percentile(&values, 100.0) }
    }
}

/// How the body of a frame yields.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Yielding {
    /// Intersecting triangle pairs of the skinned body with itself.
    pub own_pairs_before: usize,
    /// Displacement of its vertices from the skinned ones.
    pub moved: Spread,
    /// Area that is displaced by more than 1 mm, as a share of the surface.
    pub area: Real,
    /// Largest distance of a vertex that is displaced by more than 1 mm from a triangle where the
    /// skinned body meets itself, in metres, by corners; `None` if no vertex is displaced so far, or
    /// the body does not meet itself.
    pub reach: Option<Real>,
    /// Largest change of the displacement of a vertex since the frame before, in local frames, in metres; zero in
    /// the first frame, also after a cut.
    #[serde(default)]
    pub jitter: Real,
}

/// A vertex on the wrong side of a layer below.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct NamedVertex {
    /// The layer of the vertex.
    pub layer: String,
    /// The layer below.
    pub below: String,
    /// The vertex, in the order of the layer's file.
    pub vertex: u32,
    /// Where it is in the frame.
    pub place: [Real; 3],
}

/// Two triangles that intersect.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct NamedPair {
    /// The layers of both; the same one twice where it intersects itself.
    pub layers: [String; 2],
    /// The triangles there.
    pub triangles: [u32; 2],
}

/// One frame.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FrameReport {
    /// Its index in the motion, from 0.
    pub frame: usize,
    /// Whether the end of the walk to its pose was reached clean. If not, the frame holds the last
    /// clean state carried to its pose.
    pub reached: bool,
    /// Whether it was reached from the rest pose, and not from the frame before.
    pub restarted: bool,
    /// Intersecting triangle pairs of all layers, their own included, after skinning alone; without
    /// those of the rest pose.
    pub pairs_before: usize,
    /// Intersecting triangle pairs between layers.
    pub pairs: usize,
    /// Vertices on the wrong side of a layer below, once for each layer.
    pub inside: usize,
    /// Intersecting triangle pairs of garments with themselves.
    pub own_pairs: usize,
    /// Intersecting triangle pairs of the body with itself.
    pub body_own_pairs: usize,
    /// Own pairs of garments that the rest pose does not have.
    pub new_own_pairs: usize,
    /// Some of what makes the frame unclean: intersecting triangle pairs of layers, then own pairs that the
    /// rest pose does not have.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub first_pairs: Vec<NamedPair>,
    /// Some of the vertices on a wrong side.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub first_inside: Vec<NamedVertex>,
    /// Triangles of the body that may meet one another, such as those of fingers in a fist: no way to the
    /// pose was clean otherwise.
    #[serde(default)]
    pub let_go: usize,
    /// Displacement of the garments' vertices from the skinned ones.
    pub moved: Spread,
    /// How the body yields.
    pub body: Yielding,
    /// Strain of the garments' edges since the rest pose, 99 % below it; worst garment.
    pub strain_p99: Real,
    /// The same after skinning alone.
    pub strain_p99_skinned: Real,
    /// Change of the displacement of the garments' vertices since the frame before, in local frames;
    /// zero in the first frame, also after a cut.
    pub jitter: Spread,
    /// Change of that change, `|u_{f−2} − 2 u_{f−1} + u_f|`: what trembles, and not what follows the
    /// motion evenly. Zero in the first two frames, also after a cut.
    pub shake: Spread,
    /// What intersects the body in its pinches, counted here alone, if it is kept
    /// ([`AnimateParams::pinch`](super::AnimateParams::pinch)) or would have to yield by more than
    /// [`body_depth`](super::AnimateParams::body_depth); `None` if it yields as far as it has to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pinch: Option<PinchReport>,
    /// Whether the frame was moved towards the mean displacement of its neighbours.
    pub smoothed: bool,
    /// Accepted steps of the walk in which the body yields farther from its own overlaps than
    /// `body_reach`.
    pub wide: usize,
    /// Accepted steps of the walk.
    pub steps: usize,
    /// Steps that were halved.
    pub halved: usize,
    /// Solves of all steps.
    pub solves: usize,
    /// Seconds of the walk to it and of its end, without the mean of its neighbours and without writing.
    pub seconds: Real,
}

impl FrameReport {
    /// No intersecting pairs between layers, no vertex on a wrong side, no own pair of a garment that the
    /// rest pose does not have. What lies in pinches of a body that is kept does not count, nor do own
    /// pairs of the body.
    pub fn is_clean(&self) -> bool {
        self.pairs == 0 && self.inside == 0 && self.new_own_pairs == 0
    }

    /// No intersecting pair at all, and no vertex on a wrong side.
    pub fn is_clean_everywhere(&self) -> bool {
        let pinched = self.pinch.as_ref().map_or(0, |pinch| pinch.pairs + pinch.inside);
        self.is_clean() && self.own_pairs == 0 && self.body_own_pairs == 0 && pinched == 0
    }
}

/// All frames.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct AnimationReport {
    /// Frames that are clean.
    pub clean: usize,
    /// Frames that are clean everywhere.
    pub clean_everywhere: usize,
    /// Frames before which the pose or the place of the body jumps. They are reached from the rest pose, and nothing
    /// is smoothed across.
    #[serde(default)]
    pub cuts: Vec<usize>,
    /// Frames per second of the motion.
    pub frames_per_second: Real,
    /// Frames that an earlier run had done.
    pub kept: usize,
    /// Largest displacement of the body, in metres.
    pub body_max: Real,
    /// Largest jitter of the body, in metres.
    #[serde(default)]
    pub body_jitter: Real,
    /// Largest 99th percentile of the jitter of a frame, in metres.
    pub jitter_p99: Real,
    /// Largest jitter of a vertex, in metres.
    pub jitter_max: Real,
    /// Largest 99th percentile of the shake of a frame, in metres.
    pub shake_p99: Real,
    /// Largest distance from its own overlaps at which the body yields, in metres, of the frames in
    /// which it meets itself.
    pub body_reach: Real,
    /// Seconds of this run for each frame that was not kept, without [jitter](Self::jitter_p99).
    pub seconds_a_frame: Real,
    /// Seconds of this run.
    pub seconds: Real,
    /// A row for each frame.
    pub frames: Vec<FrameReport>,
}

impl AnimationReport {
    /// The report of frames with these rows.
    pub fn new(
        frames: &[FrameReport],
        frames_per_second: Real,
        kept: usize,
        (seconds_a_frame, seconds): (Real, Real),
    ) -> Self {
        let largest = |of: fn(&FrameReport) -> Real| frames.iter().map(of).fold(0.0, Real::max);
        Self {
            clean: frames.iter().filter(|f| f.is_clean()).count(),
            clean_everywhere: frames.iter().filter(|f| f.is_clean_everywhere()).count(),
            cuts: Vec::new(),
            frames_per_second,
            kept,
            body_max: largest(|f| f.body.moved.max),
            body_jitter: largest(|f| f.body.jitter),
            jitter_p99: largest(|f| f.jitter.p99),
            jitter_max: largest(|f| f.jitter.max),
            shake_p99: largest(|f| f.shake.p99),
            body_reach: largest(|f| f.body.reach.unwrap_or(0.0)),
            seconds_a_frame,
            seconds,
            frames: frames.to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_is_left_in_a_frame_is_not_clean_and_own_pairs_not_clean_everywhere() {
        let state = |set: fn(&mut FrameReport)| {
            let mut frame = FrameReport::default();
            set(&mut frame);
            (frame.is_clean(), frame.is_clean_everywhere())
        };
        assert_eq!(state(|_| ()), (true, true));
        assert_eq!(state(|frame| frame.pairs = 1), (false, false));
        assert_eq!(state(|frame| frame.inside = 1), (false, false));
        assert_eq!(state(|frame| frame.new_own_pairs = 1), (false, false));
        assert_eq!(state(|frame| frame.own_pairs = 1), (true, false));
        assert_eq!(state(|frame| frame.body_own_pairs = 1), (true, false));
        // A body that is kept has pinches, and what lies in them counts there alone.
        let pinch = |pairs, inside| {
            let mut frame = FrameReport::default();
            let mut pinch = PinchReport::default();
            (pinch.pairs, pinch.inside) = (pairs, inside);
            frame.pinch = Some(pinch);
            (frame.is_clean(), frame.is_clean_everywhere())
        };
        assert_eq!(pinch(0, 0), (true, true));
        assert_eq!(pinch(1, 0), (true, false));
        assert_eq!(pinch(0, 1), (true, false));
    }
}
