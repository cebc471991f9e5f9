//! The error of all stages.

use super::skipped::Skipped;
use crate::capture::CaptureError;
use if_body::{PoseError, SkinError};
use if_core::math::Real;
use if_core::mesh::MeshError;
use if_core::monitor::Cancelled;
use if_core::parameter::ParameterError;
use if_mesh::attributes::AttributeError;
use if_mesh::baked::BakeError;
use if_mesh::cleanup::CleanupError;
use if_mesh::extract::ExtractError;
use if_mesh::labels::LabelError;
use if_mesh::ply::WriteError;
use if_mesh::sdf::SdfError;
use if_neural::{FieldError, FitError, NetworkError, TargetError};
use std::io;
use std::path::PathBuf;

/// A capture cannot be reconstructed: the error of [`reconstruct`](super::reconstruct) and of its
/// stages.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum ReconstructError {
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The monitor cancelled. Finished rounds of the surface are in the checkpoint.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The capture cannot be read, or does not match the skeleton.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The pose of a frame does not match the skeleton.
    #[error("frame {frame}: {source}")]
    Pose { frame: usize, source: PoseError },
    /// The skeleton does not match a grid of skinning weights.
    #[error(
        "the skeleton has {skeleton} joints, the grid of skinning weights {grid}; use one body"
    )]
    Joints { skeleton: usize, grid: usize },

    // The surface.
    /// The template body has no triangles.
    #[error("the template body has no triangles")]
    NoTemplate,
    /// The template's skinning weights do not match its mesh or skeleton.
    #[error("the template body: {0}")]
    TemplateSkin(#[from] SkinError),
    /// The template is not closed: neither is the surface that is fitted.
    #[error("the template body cannot be fitted: {0}; close its mesh")]
    TemplateInside(#[source] SdfError),
    /// The images of the capture need too much memory.
    #[error(
        "the images of {frames} frames need {bytes} bytes, {limit} are allowed; use each second or third of them (`every`), make images smaller, or allow more (`memory`)"
    )]
    Memory { frames: usize, bytes: u64, limit: u64 },
    /// No frame is usable.
    #[error("none of the {frames} frames can be used: {first}; {}", what_to_check(*depth))]
    NothingSeen {
        /// Number of frames.
        frames: usize,
        /// Why the first is not used.
        first: Skipped,
        /// How far its person's root stands before the camera, about, in metres.
        depth: Real,
    },
    /// The equations of a round of the surface have no finite solution.
    #[error(
        "round {round} of the surface has no finite solution; check the scale of normals and weights"
    )]
    SurfaceDiverged { round: usize },
    /// The equations of the poses have no finite solution.
    #[error(
        "the poses have no finite solution in round {round}; check the scale of the body, and the stated noise of poses"
    )]
    PosesDiverged { round: usize },
    /// A mesh has positions that are not finite, or a checkpoint is of another mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The checkpoint cannot be read or written.
    #[error("checkpoint {}: {source}", path.display())]
    Checkpoint { path: PathBuf, source: io::Error },
    /// The checkpoint is incomplete, or another kind of file.
    #[error("{} is not a complete checkpoint of a reconstruction; delete it to start again", path.display())]
    BrokenCheckpoint { path: PathBuf },

    // The canonical mesh and φ.
    /// A mesh cannot be extracted.
    #[error(transparent)]
    Extract(ExtractError),
    /// The fitted surface is not closed.
    #[error("the fitted surface has no inside: {0}")]
    Inside(#[source] SdfError),
    /// φ cannot be baked.
    #[error(transparent)]
    Bake(BakeError),

    // Networks of φ and of the motion.
    /// The surface or its field cannot be fitted.
    #[error(transparent)]
    Target(TargetError),
    /// The network cannot be made.
    #[error(transparent)]
    Network(NetworkError),
    /// The network cannot be fitted.
    #[error(transparent)]
    Fit(FitError),
    /// The training of φ and d diverged.
    #[error("φ and d diverged after {steps} steps; lower `phi_rate` and `deformation_rate`")]
    FieldsDiverged { steps: u64 },
    /// The trained φ is no field of a clothed person.
    #[error("the trained φ cannot be used: {0}; lower `phi_rate`, or use the surface alone")]
    Field(#[from] FieldError),

    // The motion of single frames.
    /// The equations of the motion have no finite solution.
    #[error(
        "the motion of the frames has no finite solution in round {round}; check the scale of normals and weights"
    )]
    MotionDiverged { round: usize },
    /// The fit of a network, of the motion or of φ, diverged.
    #[error("the fit of a network diverged after {steps} steps; lower its rate")]
    NetworkDiverged { steps: u64 },

    // Garments.
    /// A frame cannot vote.
    #[error("frame {frame}: {source}")]
    Vote { frame: usize, source: LabelError },
    /// Labels cannot be smoothed, or the mesh cannot be cut.
    #[error(transparent)]
    Labels(LabelError),
    /// A garment cannot be cleaned.
    #[error("garment `{name}`: {source}")]
    Cleanup { name: String, source: CleanupError },
    /// The skinning weights do not match the canonical mesh.
    #[error(transparent)]
    Attributes(#[from] AttributeError),
    /// The skinning weights of a cleaned garment are invalid.
    #[error("garment `{name}`: {source}")]
    GarmentSkin { name: String, source: SkinError },

    // Posed frames.
    /// The folder of the frames cannot be created.
    #[error("cannot create the folder {}: {source}", path.display())]
    FramesFolder { path: PathBuf, source: io::Error },
    /// A frame cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    FrameFile { path: PathBuf, source: Box<WriteError> },
}

impl From<ExtractError> for ReconstructError {
    fn from(error: ExtractError) -> Self {
        match error {
            ExtractError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            ExtractError::Parameter(parameter) => Self::Parameter(parameter),
            other => Self::Extract(other),
        }
    }
}

impl From<BakeError> for ReconstructError {
    fn from(error: BakeError) -> Self {
        match error {
            BakeError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            BakeError::Parameter(parameter) => Self::Parameter(parameter),
            other => Self::Bake(other),
        }
    }
}

impl From<LabelError> for ReconstructError {
    fn from(error: LabelError) -> Self {
        match error {
            LabelError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            LabelError::Parameter(parameter) => Self::Parameter(parameter),
            other => Self::Labels(other),
        }
    }
}

impl From<TargetError> for ReconstructError {
    fn from(error: TargetError) -> Self {
        match error {
            TargetError::Parameter(parameter) => Self::Parameter(parameter),
            other => Self::Target(other),
        }
    }
}

impl From<NetworkError> for ReconstructError {
    fn from(error: NetworkError) -> Self {
        match error {
            NetworkError::Parameter(parameter) => Self::Parameter(parameter),
            other => Self::Network(other),
        }
    }
}

impl From<FitError> for ReconstructError {
    fn from(error: FitError) -> Self {
        match error {
            FitError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            FitError::Parameter(parameter) => Self::Parameter(parameter),
            other => Self::Fit(other),
        }
    }
}

/// Distance from the camera, in metres, beyond which lengths are hardly in metres.
const FAR: Real = 100.0;

/// What may be wrong if no frame can be used.
fn what_to_check(depth: Real) -> String {
    match depth {
        d if d <= 0.0 => format!(
            "the person stands {:.1} m behind the camera: R and t lead to OpenCV's axes, x right, y down, z forward",
            -d
        ),
        d if d > FAR => {
            format!("the person stands {d:.0} m from the camera: are t and root_t in metres?")
        }
        _ => "check masks, poses and camera".into(),
    }
}
