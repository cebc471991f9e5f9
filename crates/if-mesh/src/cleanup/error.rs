//! Errors of the clean-up.

use if_core::math::Real;
use if_core::monitor::Cancelled;
use if_core::parameter::ParameterError;

/// Why a mesh was not cleaned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum CleanupError {
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The attributes belong to another mesh.
    #[error(
        "attributes of {attributes} vertices for a mesh of {vertices}; give those of this mesh, or `VertexAttributes::none`"
    )]
    Attributes { attributes: usize, vertices: usize },
    /// Areas of the mesh, or their squares, are beyond the range of numbers.
    #[error("the mesh measures {metres:e} m; scale it to between 1e-70 and 1e70 m")]
    Size { metres: Real },
    /// The monitor cancelled the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
