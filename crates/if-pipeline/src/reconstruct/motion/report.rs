//! The motion of single frames, and its report.

use if_core::math::{Real, Vector};
use serde::{Deserialize, Serialize};

/// The motion d of each vertex of the fitted surface in each frame, relative to the pose.
#[derive(Clone, Debug)]
pub struct Motion {
    /// d of each vertex in each frame of the capture, in metres of canonical space: the posed
    /// vertices are LBS(x + d). Empty for frames in which d is zero.
    pub offsets: Vec<Vec<Vector>>,
    /// Report.
    pub report: MotionReport,
}

/// A round of gathering evidence and solving: means over the frames.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct MotionRound {
    /// Root of the mean square distance of the surface's silhouettes from the masks' borders before
    /// the round, in millimetres.
    pub silhouette_mm: Real,
    /// Mean angle between the surface's normals and those seen before the round, in degrees.
    pub normal_degrees: Real,
    /// Root of the mean square step of the vertices, in millimetres.
    pub step_mm: Real,
}

/// |d| in a frame, over the vertices of the fitted surface.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct FrameMotion {
    /// Its index in the capture; in a [`ReconstructReport`](crate::reconstruct::ReconstructReport) its
    /// number there.
    pub frame: usize,
    /// Whether it was solved; else it is interpolated between its neighbours in time.
    pub solved: bool,
    /// Mean, in millimetres.
    pub mean_mm: Real,
    /// Largest, in millimetres.
    pub max_mm: Real,
}

impl FrameMotion {
    pub(super) fn of(frame: usize, solved: bool, offsets: &[Vector]) -> Self {
        let lengths = offsets.iter().map(|d| 1e3 * d.norm());
        let mean_mm = lengths.clone().fold(0.0, |a, b| a + b) / offsets.len().max(1) as Real;
        Self { frame, solved, mean_mm, max_mm: lengths.fold(0.0, Real::max) }
    }
}

/// Report of the motion of single frames.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MotionReport {
    /// Number of solved frames.
    pub solved: usize,
    /// Indices of unusable frames, which are interpolated between their neighbours in time.
    pub skipped: Vec<usize>,
    /// Mean |d| over the vertices of the solved frames, in millimetres.
    pub mean_mm: Real,
    /// Largest |d|, in millimetres.
    pub max_mm: Real,
    /// All rounds.
    pub rounds: Vec<MotionRound>,
    /// All frames of the capture.
    pub frames: Vec<FrameMotion>,
}

impl MotionReport {
    pub(in crate::reconstruct) fn of(
        offsets: &[Vec<Vector>],
        solved: &[bool],
        rounds: Vec<MotionRound>,
    ) -> Self {
        let frames: Vec<FrameMotion> =
            (0..offsets.len()).map(|k| FrameMotion::of(k, solved[k], &offsets[k])).collect();
        let of_solved = || frames.iter().filter(|f| f.solved);
        let count = of_solved().count();
        Self {
            solved: count,
            skipped: frames.iter().filter(|f| !f.solved).map(|f| f.frame).collect(),
            mean_mm: of_solved().map(|f| f.mean_mm).fold(0.0, |a, b| a + b) / count.max(1) as Real,
            max_mm: of_solved().map(|f| f.max_mm).fold(0.0, Real::max),
            rounds,
            frames,
        }
    }
}
