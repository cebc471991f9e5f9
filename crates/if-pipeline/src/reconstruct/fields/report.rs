//! The report of the training of φ and d.

use if_core::math::Real;
use serde::{Deserialize, Serialize};

/// What became of the rays of some steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Rays {
    /// Rays on which a point of the surface was found, and whose normal was used.
    pub used: usize,
    /// Rejected: they graze the surface, where a small change moves their point far, or meet it
    /// from inside.
    pub grazing: usize,
    /// Rejected: Newton's method did not find a point.
    pub lost: usize,
    /// Rejected: the normal contradicts the surface's, as where another part of the body is visible.
    pub contradicting: usize,
}

/// Means over the steps from one rasterisation to the next.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FieldsRound {
    /// Steps done when it ended.
    pub steps: u64,
    /// Mean angle between the surface's normals and the observed ones, in degrees.
    pub normal_degrees: Real,
    /// Root of the mean square distance of silhouettes from the masks' borders, in millimetres.
    pub silhouette_mm: Real,
    /// Mean of | |∇φ| − 1 | near the surface.
    pub eikonal: Real,
    /// Root of the mean square of d, in millimetres.
    pub motion_mm: Real,
    /// Root of the mean square of d's mean over the frames, in millimetres.
    pub mean_motion_mm: Real,
    /// Rays.
    pub rays: Rays,
    /// Wall-clock seconds.
    pub seconds: Real,
}

impl FieldsRound {
    /// Whether all measures are numbers: JSON cannot hold others.
    pub(super) fn is_finite(&self) -> bool {
        let Self { normal_degrees, silhouette_mm, eikonal, motion_mm, mean_motion_mm, .. } = self;
        [normal_degrees, silhouette_mm, eikonal, motion_mm, mean_motion_mm]
            .iter()
            .all(|x| x.is_finite())
    }
}

/// Report of the training of φ and d.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FieldsReport {
    /// Parameters of φ.
    pub phi_parameters: usize,
    /// Parameters of d, embeddings included.
    pub deformation_parameters: usize,
    /// Mean error of φ before the first step, against the surface of the start, in millimetres.
    pub start_mm: Real,
    /// All rounds.
    pub rounds: Vec<FieldsRound>,
}
