//! How to bake, and why a field cannot be baked.

use crate::extract::ExtractError;
use if_core::aabb::Aabb;
use if_core::field::FieldSample;
use if_core::math::{Point, Real};
use serde::{Deserialize, Serialize};

/// When to replace the values of the source by distances to its zero set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Redistance {
    /// Where the gradient of the source is not of unit length: scaled, warped or learned fields.
    #[default]
    WhenNeeded,
    /// Always: also for fields such as unions, whose gradient is of unit length everywhere but
    /// whose inside is no distance.
    Always,
    /// Never: the source is a distance, or at least never above it, with a gradient of at most unit
    /// length.
    Never,
}

/// Cells can be halved so often: to 47 µm from 12 mm.
pub(super) const MAX_LEVELS: u32 = 8;

/// How to bake. Infinite lengths are written as the word `infinite`: JSON has no such number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BakeParams {
    /// Edge of the largest cells, in metres. The error falls with its third to fourth power where
    /// the field is smooth, and with its first at creases.
    pub cell: Real,
    /// How far a value may be from the field, in metres, at points no farther than `reach` from the
    /// surface: cells are halved where it is more. Infinite leaves all cells as they are.
    #[serde(with = "length_or_word")]
    pub accuracy: Real,
    /// How far from the surface `accuracy` is asked for, in metres. What lies deeper or farther
    /// keeps the largest cells.
    pub reach: Real,
    /// How often cells may be halved. Where a field jumps no cell is small enough.
    pub levels: u32,
    /// How far outside the surface values are kept, in metres: a cell at least.
    pub band: Real,
    /// How far inside, in metres. Infinite keeps all of the inside, which for a body takes less
    /// room than the band.
    #[serde(with = "length_or_word")]
    pub depth: Real,
    /// Where the zero set lies; `None` takes the source's `bounds()`.
    pub region: Option<Aabb>,
    /// When to re-distance.
    pub redistance: Redistance,
    /// Memory that baking may take, in bytes. Cells are not halved any more where that would take
    /// more.
    pub memory: usize,
}

impl Default for BakeParams {
    /// For a body of 2 m: 1 mm within 2 cm of the surface, with cells of 12 mm, at fingers and
    /// folds down to 1.5 mm (`docs/fitting.md`).
    fn default() -> Self {
        Self {
            cell: 0.012,
            accuracy: 1e-3,
            reach: 0.02,
            levels: 3,
            band: 0.05,
            depth: Real::INFINITY,
            region: None,
            redistance: Redistance::WhenNeeded,
            memory: 2 << 30,
        }
    }
}

/// A length, or the word `infinite`.
mod length_or_word {
    use if_core::math::Real;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    #[serde(untagged)]
    enum Written {
        Length(Real),
        Word(Word),
    }

    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Word {
        Infinite,
    }

    pub(super) fn serialize<S: Serializer>(length: &Real, to: S) -> Result<S::Ok, S::Error> {
        let written = if *length == Real::INFINITY {
            Written::Word(Word::Infinite)
        } else {
            Written::Length(*length)
        };
        written.serialize(to)
    }

    pub(super) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Real, D::Error> {
        Ok(match Written::deserialize(from)? {
            Written::Length(length) => length,
            Written::Word(Word::Infinite) => Real::INFINITY,
        })
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
    /// The accuracy is not reached.
    #[error(
        "with cells down to {cell} m the error is still up to {bound} m, not {accuracy} m; ask for less, for a smaller reach, or give more memory"
    )]
    Inaccurate {
        /// What was asked for, in metres.
        accuracy: Real,
        /// The bound that was reached, in metres.
        bound: Real,
        /// The smallest cells, in metres.
        cell: Real,
    },
    /// The zero set is not found, from which distances are measured.
    #[error("the zero set cannot be extracted: {0}")]
    Surface(ExtractError),
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
        for (name, value) in [("accuracy", self.accuracy), ("reach", self.reach)] {
            if value.is_nan() || value <= 0.0 {
                return fault(name, value, "a length above zero, in metres");
            }
        }
        if self.levels > MAX_LEVELS {
            return fault("levels", Real::from(self.levels), "at most 8");
        }
        // Where a surface crosses an edge of the grid, an end of it is nearer than a cell: a
        // narrower band loses the surface.
        if self.band < self.cell {
            return fault("band", self.band, "at least a cell; take smaller cells or a wider band");
        }
        if self.depth.is_nan() || self.depth <= 0.0 {
            return fault("depth", self.depth, "a length above zero, in metres, or infinity");
        }
        Ok(())
    }
}
