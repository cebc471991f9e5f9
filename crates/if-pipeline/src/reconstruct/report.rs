//! The report of the surface.

use super::error::ReconstructError;
use super::quality::QualityReport;
use super::skipped::Skipped;
use crate::capture::Capture;
use if_core::math::{Point, Real};
use serde::{Deserialize, Serialize};

/// Counts of the pixels of all masks in the last round.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Pixels {
    /// All pixels of the masks of the used frames.
    pub person: usize,
    /// Skipped: without a normal, or too close to the border of the mask.
    pub no_normal: usize,
    /// Skipped: not on the current surface.
    pub off_surface: usize,
    /// Skipped: the normal contradicts the surface's, as where another part of the body is visible.
    pub contradicting: usize,
    /// Used.
    pub used: usize,
}

/// A round of gathering evidence and solving.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Round {
    /// Root of the mean square distance of the surface's silhouettes from the masks' borders before
    /// the round, in millimetres.
    pub silhouette_mm: Real,
    /// Mean angle between the surface's normals and the observed ones before the round, in degrees.
    pub normal_degrees: Real,
    /// Root of the mean square step of the vertices, in millimetres.
    pub step_mm: Real,
    /// Vertices that lay on a silhouette in some frame.
    pub rim_vertices: usize,
    /// Triangles with an observed normal.
    pub seen_triangles: usize,
}

/// The filled inside of loose clothes.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Filled {
    /// The loose garments.
    pub garments: Vec<String>,
    /// The joints around which they hang.
    pub joints: Vec<String>,
    /// Filled volume, in litres of canonical space.
    pub litres: Real,
    /// Volume that frames see far from the posed template, in litres.
    pub certain_litres: Real,
    /// Vertices of the surface with which the fit starts.
    pub vertices: usize,
}

/// Report of the start of the surface.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StartReport {
    /// Share of the masks' pixels that are far from the posed template.
    pub beside: Real,
    /// The inside of loose clothes, added to the template; `None` if nothing was added.
    pub filled: Option<Filled>,
}

/// Report of the surface.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SurfaceReport {
    /// Frames of the capture.
    pub frames: usize,
    /// Skipped frames.
    pub skipped: Vec<Skipped>,
    /// The start of the fit.
    #[serde(default)]
    pub start: StartReport,
    /// Correlation of observed normals with those of the posed template before the fit, on each axis of
    /// the camera: negative where that axis is flipped.
    #[serde(default)]
    pub normal_axes: [Real; 3],
    /// Counts of pixels.
    pub pixels: Pixels,
    /// All rounds.
    pub rounds: Vec<Round>,
    /// How well the surface explains the images.
    #[serde(default)]
    pub quality: QualityReport,
}

impl SurfaceReport {
    /// The error of a capture whose frames were all skipped.
    ///
    /// # Panics
    ///
    /// If no frame was skipped.
    pub(super) fn nothing_seen(self, capture: &Capture) -> ReconstructError {
        let first = self
            .skipped
            .into_iter()
            .min_by_key(Skipped::frame)
            .expect("a capture has frames, and all were skipped");
        let root = Point::from(capture.pose(first.frame()).root_translation);
        let depth = capture.camera().to_camera(&root).z;
        ReconstructError::NothingSeen { frames: self.frames, first: first.numbered(capture), depth }
    }
}
