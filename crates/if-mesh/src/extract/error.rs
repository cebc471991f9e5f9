//! Why an extraction fails.

use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
use if_core::monitor::Cancelled;
use if_core::parameter::ParameterError;

/// Why [`crate::extract::extract`] fails.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExtractError {
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The bound on the field's slope is not positive.
    #[error(
        "the field's slope is bounded by {slope}; give a positive bound (1 for a distance), or use Slope::Sampled"
    )]
    Slope {
        /// The bound that was given, returned by the field, or sampled.
        slope: Real,
    },
    /// Neither the field nor the parameters bound the surface.
    #[error("the field has no bounds; give the region in which the surface lies")]
    NoRegion,
    /// The region is empty or infinite.
    #[error("the region {region:?} is empty or not finite; give the box in which the surface lies")]
    Region {
        /// The region.
        region: Aabb,
    },
    /// Too many cells along one side.
    #[error(
        "a region of {size} m in cells of {cell} m has too many cells along one side; at most 32,768 are possible"
    )]
    TooFine {
        /// Longest side of the region, in metres.
        size: Real,
        /// Side of the cells, in metres.
        cell: Real,
    },
    /// More nodes or vertices than 32 bits can number.
    #[error(
        "{nodes} nodes of the lattice are needed, more than 32 bits can number; use larger cells"
    )]
    TooManyNodes {
        /// Number of nodes or vertices.
        nodes: usize,
    },
    /// More memory than allowed.
    #[error(
        "cells of {cell} m need {bytes} bytes, {limit} are allowed; use larger cells, a smaller region, or more memory \
         (`ExtractParams::memory`); a field with a tight bound on its slope keeps fewer cells"
    )]
    TooLarge {
        /// Bytes that the next part needs, with those held.
        bytes: usize,
        /// Bytes allowed.
        limit: usize,
        /// Side of the cells, in metres.
        cell: Real,
    },
    /// The points that bound the slope need more memory than allowed.
    #[error("the slope at {points} points needs {bytes} bytes, {limit} are allowed; sample fewer")]
    TooManyPoints {
        /// Number of points.
        points: usize,
        /// Bytes needed.
        bytes: usize,
        /// Bytes allowed.
        limit: usize,
    },
    /// The field is NaN at a node.
    #[error("the field is not a number at {point}")]
    NotANumber {
        /// The position of the node.
        point: Point,
    },
    /// The monitor cancelled the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
