//! Errors by family of functions: making a network, making a target, fitting.
//!
//! Reading files has [`ReadError`](crate::files::ReadError), and a network as a field
//! [`FieldError`](crate::field::FieldError).

use if_core::aabb::Aabb;
use if_core::field::FieldSample;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Cancelled;
use if_core::parameter::ParameterError;

/// A network cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// A size is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The number of parameters θ does not match the configuration.
    #[error("{got} parameters, but the configuration has {expected}; give both from one network")]
    Length {
        /// Parameters given.
        got: usize,
        /// Parameters of the configuration.
        expected: usize,
    },
    /// A parameter is NaN or infinite.
    #[error("parameter {index} is {value}; all must be finite: fit the network again")]
    NotFinite {
        /// Its index in θ.
        index: usize,
        /// Its value.
        value: f32,
    },
}

/// A target cannot be fitted: it is invalid, or no training points are found on it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TargetError {
    /// A sampling parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The network to begin with cannot be made.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The box of the target is empty, a point, or not finite.
    #[error("the box from {} to {} has no extent or is not finite; give a target of some size", aabb.min, aabb.max)]
    NoExtent {
        /// The box, in metres.
        aabb: Aabb,
    },
    /// The field has no bounds.
    #[error("the target has no bounds(); wrap it in a field that returns the box of its inside")]
    Unbounded,
    /// The field is NaN or infinite in its box.
    #[error(
        "the target is {} with gradient {} at {point}; it must be finite in its box. The field of \
         an open mesh is undefined where it has no side: close the mesh, or fit its vertices as \
         oriented points", sample.distance, sample.gradient
    )]
    NotFinite {
        /// Where, in metres.
        point: Point,
        /// The sample there.
        sample: FieldSample,
    },
    /// Too few points on the surface were found.
    #[error(
        "only {found} of {wanted} points on the surface were found in the box of the target: its \
         zero set there is empty or tiny"
    )]
    NoSurface {
        /// Points found.
        found: usize,
        /// Points wanted.
        wanted: usize,
    },
    /// The field is negative at the border of its box.
    #[error(
        "the target is {distance} m at the border of its box, {point}: the inside must be negative \
         and lie within the box. If it is the field of an inside-out mesh, turn all its triangles"
    )]
    InsideOut {
        /// Where, in metres.
        point: Point,
        /// The distance there, in metres.
        distance: Real,
    },
    /// Fewer oriented points than an estimate needs.
    #[error("{got} oriented points; give at least {needed}")]
    TooFewPoints {
        /// Points given.
        got: usize,
        /// Points needed.
        needed: usize,
    },
    /// The numbers of points and normals differ.
    #[error("{points} points but {normals} normals; give one normal for each point")]
    NormalCount {
        /// Points given.
        points: usize,
        /// Normals given.
        normals: usize,
    },
    /// A point is not finite, or its normal is not finite or zero.
    #[error(
        "point {index} at {point} has the normal {normal}: the point must be finite and the normal \
         finite and not zero; leave it out"
    )]
    NotOriented {
        /// Index of the point.
        index: usize,
        /// The point, in metres.
        point: Point,
        /// Its normal.
        normal: Vector,
    },
    /// The normals point inwards.
    #[error(
        "the normals point inwards (their mean component away from the centre is {along}); turn \
         them, or the triangles they come from"
    )]
    InwardNormals {
        /// Mean of n · (p − centre), divided by the diagonal of the box.
        along: Real,
    },
}

/// A network cannot be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The monitor cancelled the fit.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The network is NaN or infinite before the first step.
    #[error(
        "a parameter of the network, or its error at the held-out points, is not finite before the \
         first step; make the network anew"
    )]
    NotANumber,
    /// The fit began with a network of another size.
    #[error("the fit began with a network of {expected} parameters, this one has {got}")]
    Length {
        /// Parameters of the network that the fit began with.
        expected: usize,
        /// Parameters of this one.
        got: usize,
    },
    /// The fit began with another target.
    #[error(
        "the fit began with another target; give the training set that it began with, or begin a \
         new fit"
    )]
    Target,
    /// Too few points to fit a deformation to.
    #[error(
        "{got} canonical points; give at least {needed}, some of which are held out to measure at"
    )]
    TooFewPoints {
        /// Points given.
        got: usize,
        /// Points needed.
        needed: usize,
    },
    /// The number of frames differs from that of the network.
    #[error("{got} frames of positions, but the network has {expected}")]
    FrameCount {
        /// Frames given.
        got: usize,
        /// Frames of the network.
        expected: usize,
    },
    /// The number of positions in a frame differs from that of canonical points.
    #[error("frame {frame} has {got} positions for {expected} canonical points")]
    PointCount {
        /// Index of the frame.
        frame: usize,
        /// Positions given.
        got: usize,
        /// Canonical points.
        expected: usize,
    },
    /// A position is NaN or infinite, or too large for single precision in the network's cube.
    #[error("point {point} of {place} is not finite; leave it out of all frames")]
    NotFinite {
        /// Index of the point.
        point: usize,
        /// `frame 7`, or `the canonical points`.
        place: String,
    },
}
