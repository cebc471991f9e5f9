//! What a reconstruction used, left out and reached.

use if_core::math::Real;
use serde::{Deserialize, Serialize};

/// A frame that brings nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "because")]
#[non_exhaustive]
pub enum Skipped {
    /// Its mask is empty but for specks.
    NoPerson {
        /// Its place in the capture.
        frame: usize,
        /// Pixels of the mask.
        pixels: usize,
    },
    /// Its mask fills the picture.
    NoBorder {
        /// Its place in the capture.
        frame: usize,
    },
    /// The posed template lies elsewhere: the pose or the mask is another's.
    Elsewhere {
        /// Its place in the capture.
        frame: usize,
        /// Which part of their union the mask and the template share.
        overlap: Real,
    },
}

impl Skipped {
    /// Its place in the capture.
    pub fn frame(&self) -> usize {
        match self {
            Self::NoPerson { frame, .. }
            | Self::NoBorder { frame }
            | Self::Elsewhere { frame, .. } => *frame,
        }
    }
}

impl std::fmt::Display for Skipped {
    /// `frame 3 shows no person (its mask has 12 pixels)`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoPerson { frame, pixels } => {
                write!(f, "frame {frame} shows no person (its mask has {pixels} pixels)")
            }
            Self::NoBorder { frame } => write!(f, "the mask of frame {frame} fills the picture"),
            Self::Elsewhere { frame, overlap } => {
                let percent = overlap * 100.0;
                write!(
                    f,
                    "in frame {frame} the posed template lies elsewhere than the mask (they share {percent:.0} % of their union)"
                )
            }
        }
    }
}

/// What became of the pixels of all masks, in the last round.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Pixels {
    /// All of the masks of the frames that were used.
    pub person: usize,
    /// Left out: without a normal, or too near to the border of the mask.
    pub no_normal: usize,
    /// Left out: the surface is not there yet.
    pub off_surface: usize,
    /// Left out: the normal points elsewhere than the surface's, as where another part of the body
    /// was seen.
    pub contradicting: usize,
    /// Used.
    pub used: usize,
}

/// A round of looking and solving.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Round {
    /// Root of the mean square distance of the surface's silhouettes from the masks' borders before
    /// the round, in millimetres.
    pub silhouette_mm: Real,
    /// Mean angle between the surface's normals and those seen before the round, in degrees.
    pub normal_degrees: Real,
    /// Root of the mean square step of the vertices, in millimetres.
    pub step_mm: Real,
    /// Vertices that lay on a silhouette in some frame.
    pub rim_vertices: usize,
    /// Triangles with a normal.
    pub seen_triangles: usize,
}

/// What the inside of loose clothes adds to the template.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Filled {
    /// The garments that hang loose.
    pub garments: Vec<String>,
    /// The joints about which they hang.
    pub joints: Vec<String>,
    /// What is filled, in litres of canonical space.
    pub litres: Real,
    /// Of this, what frames see far beside the posed template.
    pub certain_litres: Real,
    /// Vertices of the surface that the fit starts from.
    pub vertices: usize,
}

/// What the fit of a surface starts from.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StartReport {
    /// Share of the masks' pixels that lie far beside the posed template.
    pub beside: Real,
    /// What was added to the template; `None` where it is as it is.
    pub filled: Option<Filled>,
}

/// How a surface was found.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SurfaceReport {
    /// Frames of the capture.
    pub frames: usize,
    /// Those left out.
    pub skipped: Vec<Skipped>,
    /// What the fit started from.
    #[serde(default)]
    pub start: StartReport,
    /// What became of the pixels.
    pub pixels: Pixels,
    /// All rounds.
    pub rounds: Vec<Round>,
}
