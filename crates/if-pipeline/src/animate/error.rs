//! The error of animations.

use super::outfit::SkinFault;
use if_body::{PoseError, SequenceError};
use if_core::math::{Point, Real};
use if_core::monitor::Cancelled;
use if_core::parameter::ParameterError;
use if_outfit::motion::WalkError;
use std::io;
use std::path::PathBuf;

/// An outfit cannot follow a motion.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum AnimateError {
    /// Skinning weights are missing or invalid.
    #[error(transparent)]
    Skin(#[from] SkinFault),
    /// A pose does not belong to the skeleton.
    #[error("frame {frame} of the motion: {source}")]
    Pose { frame: usize, source: PoseError },
    /// The frames per second are none.
    #[error("the motion has {0} frames per second; give a number from 0.001 to 100,000")]
    Rate(Real),
    /// A frame lies so far from the origin that single precision is too coarse.
    #[error(
        "frame {frame} lies {distance:.0} m from the origin, where positions are stored in steps of 0.03 mm or more; is the motion in metres? Move it nearer to the origin"
    )]
    Far { frame: usize, distance: Real },
    /// A vertex that single precision cannot hold: one of no triangle.
    #[error("layer `{layer}`: vertex {vertex} is at {at:?}; remove it, as no triangle uses it")]
    Vertex { layer: String, vertex: usize, at: Point },
    /// The body of a frame cannot be read any more.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The outfit is invalid, or its layers intersect at rest.
    #[error(transparent)]
    Walk(WalkError),
    /// A file of a frame cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    /// There is no such frame.
    #[error("there is no frame {frame}: {frames} are done, from 0")]
    Frame { frame: usize, frames: usize },
    /// Another process moves an outfit there.
    #[error("{}: another process keeps frames there; wait for it, or take another folder", path.display())]
    Busy { path: PathBuf },
    /// A frame was removed or changed while it was in use.
    #[error("{}: the file was removed or changed since it was written; remove what is left of it and run again", path.display())]
    Changed { path: PathBuf },
    /// The system starts no more threads.
    #[error("no thread can be started: {source}")]
    Threads { source: io::Error },
    /// The monitor cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<WalkError> for AnimateError {
    fn from(error: WalkError) -> Self {
        match error {
            WalkError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            WalkError::Parameter(parameter) => Self::Parameter(parameter),
            error => Self::Walk(error),
        }
    }
}
