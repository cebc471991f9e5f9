//! Frames that are left out.

use crate::capture::Capture;
use if_core::math::Real;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;

/// Why a frame was skipped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "because")]
#[non_exhaustive]
pub enum Skipped {
    /// Its mask has almost no pixels.
    NoPerson {
        /// Its index in the capture.
        frame: usize,
        /// Pixels of the mask.
        pixels: usize,
    },
    /// Its mask fills the image.
    NoBorder {
        /// Its index in the capture.
        frame: usize,
    },
    /// Mask and posed template hardly overlap: pose or mask is wrong.
    Elsewhere {
        /// Its index in the capture.
        frame: usize,
        /// Intersection over union of mask and template.
        overlap: Real,
    },
}

impl Skipped {
    /// Its index in the capture; in a [`super::ReconstructReport`], and in errors, its number there.
    pub fn frame(&self) -> usize {
        match self {
            Self::NoPerson { frame, .. }
            | Self::NoBorder { frame }
            | Self::Elsewhere { frame, .. } => *frame,
        }
    }

    /// The indices of a capture's frames that are not among the skipped ones.
    pub(super) fn others(
        skipped: &[Self],
        capture: &Capture,
    ) -> impl Iterator<Item = usize> + use<> {
        let left_out: HashSet<usize> = skipped.iter().map(Self::frame).collect();
        (0..capture.len()).filter(move |frame| !left_out.contains(frame))
    }

    /// With the frame's number in the capture instead of its index.
    pub(super) fn numbered(mut self, capture: &Capture) -> Self {
        let (Self::NoPerson { frame, .. }
        | Self::NoBorder { frame }
        | Self::Elsewhere { frame, .. }) = &mut self;
        *frame = capture.number(*frame) as usize;
        self
    }
}

impl std::fmt::Display for Skipped {
    /// `frame 3 shows no person (12 pixels of its mask are 128 or more of 255)`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoPerson { frame, pixels } => {
                write!(
                    f,
                    "frame {frame} shows no person ({pixels} pixels of its mask are 128 or more of 255)"
                )
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
