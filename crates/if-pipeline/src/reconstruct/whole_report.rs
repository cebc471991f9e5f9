//! A whole reconstruction in numbers.

use super::garments::Garment;
use super::motion::{MotionNetworkReport, MotionReport};
use super::phi::PhiReport;
use super::report::SurfaceReport;
use crate::asset::LayerHint;
use if_core::math::Real;
use serde::{Deserialize, Serialize};

/// What became of the label images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LabelReport {
    /// Frames whose pixels voted.
    pub frames_cast: usize,
    /// Frames left out because they show nothing of the mesh.
    pub frames_empty: usize,
    /// Frames left out because all they show had votes enough.
    pub frames_covered: usize,
    /// Pixels that saw the mesh in the frames that voted.
    pub pixels: usize,
    /// Of these, left out near an edge.
    pub near_edge: usize,
    /// Of these, left out as background, or as seeing a back.
    pub mute: usize,
}

/// A garment in numbers.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct GarmentReport {
    /// What the capture calls it.
    pub name: String,
    /// Vertices of its mesh.
    pub vertices: usize,
    /// Triangles of its mesh.
    pub triangles: usize,
    /// In square metres.
    pub area: Real,
    /// Loops that stay open: neck, cuffs, hem.
    pub openings: usize,
    /// As many as a garment of its class has at most, where its name tells the class.
    pub most_openings: Option<usize>,
    /// Holes that were filled.
    pub filled: usize,
    /// Holes that could not be filled.
    pub holes_left: usize,
    /// Isolated pieces that were dropped.
    pub dropped: usize,
}

impl GarmentReport {
    pub(super) fn of(garment: &Garment) -> Self {
        let clean = &garment.cleanup;
        Self {
            name: garment.name.clone(),
            vertices: garment.mesh.vertices().len(),
            triangles: garment.mesh.triangles().len(),
            area: garment.mesh.area(),
            openings: clean.holes.openings.len(),
            most_openings: LayerHint::of_name(&garment.name).class.most_openings(),
            filled: clean.holes.filled.len(),
            holes_left: clean.holes.left.len(),
            dropped: clean.components.dropped.len(),
        }
    }
}

/// What each step took, in seconds of the clock.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Seconds {
    /// Reading, and fitting the surface.
    pub surface: Real,
    /// Extracting the canonical mesh, and baking φ.
    pub extract: Real,
    /// Solving the motion of single frames.
    #[serde(default)]
    pub motion: Real,
    /// Fitting that motion as a network.
    #[serde(default)]
    pub motion_network: Real,
    /// Fitting φ as a network.
    pub phi: Real,
    /// Votes, cuts and cleaning.
    pub garments: Real,
}

/// How a capture was reconstructed.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ReconstructReport {
    /// How the surface was found.
    pub surface: SurfaceReport,
    /// Vertices of the canonical mesh.
    pub vertices: usize,
    /// Triangles of the canonical mesh.
    pub triangles: usize,
    /// What became of the label images.
    pub labels: LabelReport,
    /// How the motion of single frames was found, where it was asked for.
    #[serde(default)]
    pub motion: Option<MotionReport>,
    /// Errors of that motion's network, where one was asked for.
    #[serde(default)]
    pub motion_network: Option<MotionNetworkReport>,
    /// Errors of φ's network, where one was asked for.
    pub phi: Option<PhiReport>,
    /// The garments.
    pub garments: Vec<GarmentReport>,
    /// Garments of which nothing was seen.
    pub missing: Vec<String>,
    /// What it took.
    pub seconds: Seconds,
}
