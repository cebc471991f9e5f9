//! The report of the refinement of poses.

use crate::reconstruct::quality::Residual;
use if_core::math::Real;
use serde::{Deserialize, Serialize};

/// A round: a fit of the surface, then of the poses.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PoseRound {
    /// Root of the mean square distance of silhouettes from the masks' borders before the last step,
    /// in millimetres.
    pub silhouette_mm: Real,
    /// Root of the mean square difference of normals before the last step, in degrees, without
    /// outliers.
    pub normal_degrees: Real,
    /// Root of the mean square turn of all joints in the last step, in degrees.
    pub turn_degrees: Real,
    /// Root of the mean square shift of the roots in the last step, in millimetres.
    pub shift_mm: Real,
    /// Share of the vertices that lay on the template.
    pub tied: Real,
}

/// How far a joint was corrected.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct JointCorrection {
    /// The joint.
    pub name: String,
    /// Root of the mean square angle between its given and refined rotations, in degrees.
    pub turn_degrees: Real,
    /// Mean distance between its given and refined positions, in millimetres.
    pub moved_mm: Real,
    /// Largest such distance, in millimetres.
    pub moved_most_mm: Real,
}

/// Report of [`refine_poses`](super::refine_poses).
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PoseReport {
    /// The assumed error of rotations, in degrees.
    pub degrees: Real,
    /// The assumed error of the root's position, in millimetres.
    pub translation_mm: Real,
    /// The angle by which the camera was turned, in degrees; 0 if it was left as it is.
    pub camera_degrees: Real,
    /// By what its focal lengths were multiplied; 1 if they were left as they are.
    pub camera_zoom: Real,
    /// Frames whose images were not used; their poses follow from their neighbours'.
    pub unused: Vec<usize>,
    /// Residual of the frames that the surface did not see; `None` if there were too few frames.
    pub held_out: Option<Residual>,
    /// All rounds.
    pub rounds: Vec<PoseRound>,
    /// The joints.
    pub joints: Vec<JointCorrection>,
}
