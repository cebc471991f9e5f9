//! How to bake, and why a field cannot be baked.

use if_core::aabb::Aabb;
use if_core::field::FieldSample;
use if_core::math::{Point, Real};

/// When to replace the values of the source by distances to its zero set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Redistance {
    /// Where the gradient of the source is not of unit length: scaled, warped or learned fields.
    #[default]
    WhenNeeded,
    /// Always: also for fields such as unions, whose gradient is of unit length everywhere but whose
    /// inside is no distance.
    Always,
    /// Never: the source is a distance, or at least never above it, with a gradient of at most unit length.
    Never,
}

/// How to bake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BakeParams {
    /// Edge of a cell, in metres. The error falls with its third to fourth power where the field is
    /// smooth, and with its first at creases.
    pub cell: Real,
    /// How far outside the surface values are kept, in metres: a cell at least.
    pub band: Real,
    /// How far inside, in metres. Infinite keeps all of the inside, which for a body takes less room than
    /// the band.
    pub depth: Real,
    /// Where the zero set lies; `None` takes the source's `bounds()`.
    pub region: Option<Aabb>,
    /// When to re-distance.
    pub redistance: Redistance,
    /// Memory that baking may take, in bytes.
    pub memory: usize,
}

impl Default for BakeParams {
    /// For a body of 2 m: 12 mm cells. What is narrower than that, such as fingers, can be off by a cell where the field is
    /// re-distanced (`docs/fitting.md`); [`Baked::error_bound_within`](super::Baked::error_bound_within) says so.
    fn default() -> Self {
        Self { cell: 0.012, band: 0.05, depth: Real::INFINITY, region: None, redistance: Redistance::WhenNeeded, memory: 2 << 30 }
    }
}

/// Why a field cannot be baked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// A parameter is out of range.
    #[error("{name} = {value}: {needs}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: Real,
        /// What it has to be.
        needs: &'static str,
    },
    /// Nobody says where the surface is.
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
        "baking would take {bytes} bytes, {limit} are allowed; take cells larger than {cell} m, a narrower band, or more memory (a \
         source whose lipschitz() is {lipschitz} keeps every brick that it cannot exclude)"
    )]
    TooLarge {
        /// What it would take.
        bytes: usize,
        /// What is allowed.
        limit: usize,
        /// Edge of a cell, in metres.
        cell: Real,
        /// Of the source.
        lipschitz: Real,
    },
    /// The source is not a number somewhere.
    #[error("the source is {} with gradient {} in {point}; it must be finite there (mask a field after baking it, not before)", sample.distance, sample.gradient)]
    NotFinite {
        /// Where.
        point: Point,
        /// What it is.
        sample: FieldSample,
    },
    /// No grid that was tried is accurate enough.
    #[error(
        "with cells of {cell} m the error is still at most {bound} m, not {accuracy} m; ask for less, or for a smaller reach"
    )]
    Inaccurate {
        /// What was asked for, in metres.
        accuracy: Real,
        /// The bound of the last grid, in metres.
        bound: Real,
        /// Its cells, in metres.
        cell: Real,
    },
    /// The source is steeper than its `lipschitz()`.
    #[error(
        "the source is {distance} in {point}, although its lipschitz() excludes the surface from there on; correct the bound"
    )]
    Steep {
        /// Where.
        point: Point,
        /// The distance there.
        distance: Real,
    },
    /// The source is negative at the border of the grid.
    #[error(
        "the source is {distance} in {point}, at the border of the region and its band: enlarge the region until all of the inside lies in it"
    )]
    Leaves {
        /// Where.
        point: Point,
        /// The distance there.
        distance: Real,
    },
}

impl BakeParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter out of range.
    pub fn validate(&self) -> Result<(), BakeError> {
        let fault = |name, value, needs| Err(BakeError::Parameter { name, value, needs });
        if !(self.cell > 0.0 && self.cell.is_finite()) {
            return fault("cell", self.cell, "a finite length above zero, in metres");
        }
        if !(self.band > 0.0 && self.band.is_finite()) {
            return fault("band", self.band, "a finite length above zero, in metres");
        }
        // Where a surface crosses an edge of the grid, an end of it is nearer than a cell: a narrower band loses the surface.
        if self.band < self.cell {
            return fault("band", self.band, "at least a cell; take smaller cells or a wider band");
        }
        if self.depth.is_nan() || self.depth <= 0.0 {
            return fault("depth", self.depth, "a length above zero, in metres, or infinity");
        }
        Ok(())
    }
}
