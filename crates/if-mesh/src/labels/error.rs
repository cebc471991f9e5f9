//! The error of votes, smoothing and cuts.

use if_core::math::Real;
use if_core::monitor::Cancelled;
use if_core::parameter::ParameterError;

/// Errors of votes on labels, their smoothing, and cuts along them.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum LabelError {
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The monitor cancelled the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The positions of a frame belong to another mesh.
    #[error(
        "the frame has {got} positions for a mesh of {expected} vertices; all frames must have the vertices of the mesh"
    )]
    Positions { got: usize, expected: usize },
    /// A label image has another size than the camera.
    #[error(
        "the label image has {got} pixels, but the camera has {expected}; give one label per pixel"
    )]
    Pixels { got: usize, expected: usize },
    /// A label of an image is out of range.
    #[error(
        "the pixel in column {column}, row {row} has the label {label}, but there are only {labels} labels (0 is background)"
    )]
    Label { column: usize, row: usize, label: u8, labels: usize },
    /// Votes or scores belong to another mesh.
    #[error(
        "there are {values} for {got} vertices, but the mesh has {expected}; give those of this mesh"
    )]
    Vertices { values: &'static str, got: usize, expected: usize },
    /// There are no labels, or more than a `u8` can name.
    #[error("there are {values} for {labels} labels; give those of 1 to 256 labels")]
    Labels { values: &'static str, labels: usize },
    /// Not one number for each vertex and label.
    #[error(
        "there are {got} {values} for {vertices} vertices and {labels} labels; give one for each of both"
    )]
    Count { values: &'static str, got: usize, vertices: usize, labels: usize },
    /// A number of votes is negative or not finite, or a score is not finite.
    #[error("vertex {vertex} has {value} {values} for label {label}; {range}")]
    Value { values: &'static str, vertex: usize, label: usize, value: Real, range: &'static str },
    /// The solver did not converge.
    #[error(
        "label {label}: the residual is still {residual:.1e} after {steps} steps; allow more, or a larger tolerance"
    )]
    NotConverged { label: usize, steps: usize, residual: Real },
}
