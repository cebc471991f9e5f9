//! Why baking fails.

use crate::extract::ExtractError;
use if_core::aabb::Aabb;
use if_core::field::FieldSample;
use if_core::math::{Point, Real};
use if_core::monitor::Cancelled;
use if_core::parameter::ParameterError;

/// Why a field cannot be baked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The bound on the source's slope is not positive.
    #[error("lipschitz() of the source is {lipschitz}; it must be positive")]
    Slope {
        /// The bound.
        lipschitz: Real,
    },
    /// Neither the source nor the parameters bound the surface.
    #[error("the source has no bounds(); give the region in which its zero set lies")]
    Unbounded,
    /// The region is empty or not finite.
    #[error("the region from {} to {} is empty or not finite", region.min, region.max)]
    Region {
        /// The region.
        region: Aabb,
    },
    /// More memory than allowed.
    #[error(
        "baking needs {bytes} bytes, {limit} are allowed; use cells larger than {cell} m, a narrower band, or more memory (a \
         source whose lipschitz() is {lipschitz} keeps every brick that it cannot exclude)"
    )]
    TooLarge {
        /// Bytes needed.
        bytes: usize,
        /// Bytes allowed.
        limit: usize,
        /// Edge of the largest cells, in metres.
        cell: Real,
        /// Bound on the source's slope.
        lipschitz: Real,
    },
    /// The source is not finite somewhere.
    #[error("the source is {:e} with gradient {:?} in {point:?}; it must be finite there (mask a field after baking it, not before)", sample.distance, sample.gradient.as_slice())]
    NotFinite {
        /// The point.
        point: Point,
        /// The sample there.
        sample: FieldSample,
    },
    /// The accuracy is not reached.
    #[error(
        "with cells down to {cell} m the error is still up to {bound} m, not {accuracy} m; give a larger accuracy, a smaller reach, or more memory"
    )]
    Inaccurate {
        /// The accuracy requested, in metres.
        accuracy: Real,
        /// The bound reached, in metres.
        bound: Real,
        /// Edge of the smallest cells, in metres.
        cell: Real,
    },
    /// The zero set, from which distances are measured, cannot be extracted.
    #[error("the zero set cannot be extracted: {0}")]
    Surface(ExtractError),
    /// The source is steeper than its `lipschitz()`.
    #[error(
        "the source is {distance} in {point}, although its lipschitz() excludes the surface from there on; correct the bound"
    )]
    Steep {
        /// The point.
        point: Point,
        /// The distance there.
        distance: Real,
    },
    /// The source is negative at the border of the grid.
    #[error(
        "the source is {distance} in {point}, at the border of the region and its band: enlarge the region until all of the inside lies in it"
    )]
    Leaves {
        /// The point.
        point: Point,
        /// The distance there.
        distance: Real,
    },
    /// The monitor cancelled the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
