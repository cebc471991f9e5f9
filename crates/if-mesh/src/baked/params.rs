//! Parameters of baking.

use if_core::aabb::Aabb;
use if_core::math::Real;
use if_core::number_or_infinite;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// Whether to replace the values of the source by distances to its zero set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Redistance {
    /// If the gradient of the source is not of unit length: scaled, warped or learned fields.
    #[default]
    WhenNeeded,
    /// Always: also for fields such as unions, whose gradient is of unit length everywhere but
    /// whose inside is no distance.
    Always,
    /// Never: the source is a distance, or at least never above it, with a gradient of at most unit
    /// length.
    Never,
}

/// Maximum number of halvings of a cell: from 12 mm to 47 µm.
pub(super) const MAX_LEVELS: u32 = 8;

/// Parameters of [`Baked::new`](super::Baked::new). Infinite lengths are written as the word
/// `infinite`, as JSON has no such number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BakeParams {
    /// Edge of the largest cells, in metres. The error falls with its third to fourth power where
    /// the field is smooth, and with its first at creases.
    pub cell: Real,
    /// Maximum error, in metres, at points within `reach` of the surface: cells are halved where it
    /// is larger. Infinite halves no cells.
    #[serde(with = "number_or_infinite")]
    pub accuracy: Real,
    /// Distance from the surface up to which `accuracy` holds, in metres. Beyond it cells are the
    /// largest.
    pub reach: Real,
    /// Maximum number of halvings. Where a field jumps no cell is small enough.
    pub levels: u32,
    /// Distance outside the surface up to which values are stored, in metres: at least `cell`.
    pub band: Real,
    /// Distance inside, in metres. Infinite stores all of the inside, which for a body needs less
    /// memory than the band.
    #[serde(with = "number_or_infinite")]
    pub depth: Real,
    /// The box of the zero set; `None` uses the source's `bounds()`.
    pub region: Option<Aabb>,
    /// When to re-distance.
    pub redistance: Redistance,
    /// Maximum memory of baking, in bytes. Cells are not halved where that would exceed it.
    pub memory: usize,
}

impl Default for BakeParams {
    /// For a body of 2 m: 1 mm within 2 cm of the surface, with cells of 12 mm, at fingers and
    /// folds down to 1.5 mm (`docs/evidence/neural.md`).
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

impl BakeParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = ParameterError::check;
        for (name, value) in [("cell", self.cell), ("band", self.band)] {
            check(name, value, value > 0.0 && value.is_finite(), "positive and finite (m)")?;
        }
        for (name, value) in [("accuracy", self.accuracy), ("reach", self.reach)] {
            check(name, value, value > 0.0, "positive (m)")?;
        }
        check("levels", self.levels.into(), self.levels <= MAX_LEVELS, "at most 8")?;
        // Where a surface crosses an edge of the grid, an end of it is nearer than a cell: a
        // narrower band loses the surface.
        let (band, wide) = (self.band, self.band >= self.cell);
        check("band", band, wide, "at least `cell`; use smaller cells or a wider band")?;
        check("depth", self.depth, self.depth > 0.0, "positive or infinite (m)")
    }
}
