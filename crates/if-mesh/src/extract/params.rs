//! What is asked of an extraction.

use crate::extract::progress::{Stage, Watch};
use crate::measure::SplitMix64;
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use serde::{Deserialize, Serialize};

/// How a surface is extracted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExtractParams {
    /// The box in which the surface lies; by default the field's bounds. The lattice covers it, and
    /// at most one cell more on each side.
    pub region: Option<Aabb>,
    /// How fine.
    pub resolution: Resolution,
    /// Where the lattice lies: node (0, 0, 0) is this many cells below the lower corner of the
    /// region, from 0 to 1. Layers that are extracted on one lattice touch in degenerate ways: give
    /// each its [`layer_phase`].
    pub phase: [Real; 3],
    /// Where the field is evaluated.
    pub sampling: Sampling,
    /// What bounds the field's slope.
    pub slope: Slope,
    /// The field's values may be off by this much, in metres: boxes are kept accordingly. Values of
    /// networks in single precision are off by about 1e-6 of their largest.
    pub noise: Real,
    /// Whether vertices take a secant step along their edge: one evaluation each.
    pub secant: bool,
    /// Newton steps that then carry the vertices onto the surface: one evaluation with gradient
    /// each.
    pub newton: usize,
    /// Rounds of relaxation along the surface, which make slivers into triangles: one evaluation
    /// with gradient for each vertex and round. 3 to 5 are enough.
    pub relax: usize,
    /// Vertices and triangle centres at which the error is measured, each: one evaluation with
    /// gradient.
    pub check: usize,
    /// Chooses these.
    pub seed: u64,
    /// Memory that extracting may take, in bytes, without what the field takes itself: told before
    /// it is taken.
    pub memory: usize,
}

impl Default for ExtractParams {
    /// Cells of 1 cm, secant and one Newton step, no relaxation, 4 GiB.
    fn default() -> Self {
        Self {
            region: None,
            resolution: Resolution::Cell(0.01),
            phase: [0.5; 3],
            sampling: Sampling::Sparse,
            slope: Slope::Field,
            noise: 0.0,
            secant: true,
            newton: 1,
            relax: 0,
            check: 500,
            seed: 0,
            memory: 4 << 30,
        }
    }
}

/// How fine a surface is extracted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Resolution {
    /// Side of the cells, in metres: about the mean edge length that comes out.
    Cell(Real),
    /// Cells along the longest side of the region.
    Cells(u32),
    /// As fine as is needed for an error, and not finer.
    Accuracy {
        /// Distance of triangles from the surface, in metres.
        error: Real,
        /// The smallest cell to try, in metres: bounds the cost where a field has creases, or is
        /// rough.
        finest: Real,
    },
}

/// Where the field is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Sampling {
    /// Where the field can vanish by its slope.
    Sparse,
    /// At every node: the slow twin.
    Dense,
}

/// What bounds |∇φ|.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Slope {
    /// What the field says ([`SignedDistance::lipschitz`]).
    Field,
    /// This.
    Given(Real),
    /// The largest gradient at points chosen by a seed, times a factor: for networks, whose
    /// provable bounds are useless.
    Sampled {
        /// Points, uniform in the region.
        points: usize,
        /// 1.5 is usual.
        factor: Real,
        /// Chooses the points.
        seed: u64,
    },
}

impl Slope {
    /// The bound for a field.
    pub(super) fn of(
        &self,
        field: &dyn SignedDistance,
        region: &Aabb,
        watch: &mut Watch,
    ) -> Result<Real, ExtractError> {
        let slope = match *self {
            Self::Field => field.lipschitz(),
            Self::Given(slope) => slope,
            Self::Sampled { points, factor, seed } => {
                // A place and a sample each.
                let bytes = points.saturating_mul(size_of::<Point>() + size_of::<FieldSample>());
                if bytes > watch.memory {
                    return Err(ExtractError::TooManyPoints { points, bytes, limit: watch.memory });
                }
                let mut random = SplitMix64(seed);
                let size = region.size();
                let places: Vec<Point> = (0..points)
                    .map(|_| {
                        region.min
                            + Vector::new(random.unit(), random.unit(), random.unit())
                                .component_mul(&size)
                    })
                    .collect();
                let mut samples =
                    vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; points];
                field.samples(&places, &mut samples);
                watch.evaluated(Stage::Check, points)?;
                factor * samples.iter().map(|s| s.gradient.norm()).fold(0.0, Real::max)
            }
        };
        if slope.is_nan() || slope <= 0.0 { Err(ExtractError::Slope { slope }) } else { Ok(slope) }
    }
}

/// The lattice's place for layer `k` of an outfit: no two of the first thousand layers are nearer
/// than a twentieth of a cell, so that extracted layers do not touch in degenerate ways.
///
/// # Source
///
/// The additive sequence of the plastic number's three-dimensional kin: the powers of 1 / g with g⁴
/// = g + 1.
pub fn layer_phase(layer: usize) -> [Real; 3] {
    const G: Real = 1.220_744_084_605_759_5;
    let n = layer as Real;
    [1, 2, 3].map(|k| (0.5 + n * G.powi(-k)).fract())
}

/// Why there is no surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExtractError {
    /// The cell is not a length.
    #[error("the cell is {cell} m; it must be above zero and finite")]
    Cell {
        /// What was given.
        cell: Real,
    },
    /// No cells at all.
    #[error("0 cells along the longest side; at least one is needed")]
    NoCells,
    /// The accuracy is not a length.
    #[error(
        "an error of {error} m with cells of at least {finest} m; both must be above zero and finite"
    )]
    Accuracy {
        /// What was given.
        error: Real,
        /// What was given.
        finest: Real,
    },
    /// The phase is not a part of a cell.
    #[error("phase {axis} is {phase}; it must lie between 0 and 1 cells")]
    Phase {
        /// 0, 1 or 2 for x, y or z.
        axis: usize,
        /// What was given.
        phase: Real,
    },
    /// The noise is no length.
    #[error("a noise of {noise} m; it must be zero or more, and finite")]
    Noise {
        /// What was given.
        noise: Real,
    },
    /// Nothing bounds the field's slope.
    #[error(
        "the field's slope is bounded by {slope}; give a bound above zero (1 for a distance), or Slope::Sampled"
    )]
    Slope {
        /// What was given, said or found.
        slope: Real,
    },
    /// Nobody says where the surface is.
    #[error("the field has no bounds; give the region in which the surface lies")]
    NoRegion,
    /// The region is empty or endless.
    #[error("the region {region:?} is empty or not finite; give the box in which the surface lies")]
    Region {
        /// What was given.
        region: Aabb,
    },
    /// An accuracy that nothing measures.
    #[error(
        "an accuracy is asked for, and no points at which it is measured; give `check` at least 1, or the cells"
    )]
    Unchecked,
    /// More cells than can be counted.
    #[error(
        "a region of {size} m in cells of {cell} m has too many cells along one side; at most 32,768 are possible"
    )]
    TooFine {
        /// Longest side of the region, in metres.
        size: Real,
        /// The cell, in metres.
        cell: Real,
    },
    /// More nodes or vertices than can be counted.
    #[error(
        "{nodes} nodes of the lattice would be needed, more than 32 bits count; take larger cells"
    )]
    TooManyNodes {
        /// How many.
        nodes: usize,
    },
    /// More memory than allowed.
    #[error(
        "cells of {cell} m would take {bytes} bytes, {limit} are allowed; take larger cells, a smaller region, or more memory \
         (`ExtractParams::memory`); a field whose slope is bounded tightly keeps fewer cells"
    )]
    TooLarge {
        /// What the next part would take, with what is held.
        bytes: usize,
        /// What is allowed.
        limit: usize,
        /// Side of the cells, in metres.
        cell: Real,
    },
    /// The points that bound the slope take more memory than allowed.
    #[error(
        "the slope at {points} points would take {bytes} bytes, {limit} are allowed; sample fewer"
    )]
    TooManyPoints {
        /// What was given.
        points: usize,
        /// What they would take.
        bytes: usize,
        /// What is allowed.
        limit: usize,
    },
    /// The field has no value.
    #[error("the field is not a number at {point}")]
    NotANumber {
        /// Where.
        point: Point,
    },
    /// The watcher asked to stop.
    #[error("stopped after {evaluations} evaluations of the field")]
    Cancelled {
        /// How far it was.
        evaluations: usize,
    },
}

impl ExtractParams {
    /// Checks what can be checked without a field.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of its range or NaN.
    pub fn validate(&self) -> Result<(), ExtractError> {
        let length = |x: Real| x > 0.0 && x.is_finite();
        match self.resolution {
            Resolution::Cell(cell) if !length(cell) => return Err(ExtractError::Cell { cell }),
            Resolution::Cells(0) => return Err(ExtractError::NoCells),
            Resolution::Accuracy { error, finest } if !(length(error) && length(finest)) => {
                return Err(ExtractError::Accuracy { error, finest });
            }
            Resolution::Accuracy { .. } if self.check == 0 => return Err(ExtractError::Unchecked),
            _ => {}
        }
        if let Some(axis) = (0..3).find(|k| !(0.0..=1.0).contains(&self.phase[*k])) {
            return Err(ExtractError::Phase { axis, phase: self.phase[axis] });
        }
        if !(self.noise >= 0.0 && self.noise.is_finite()) {
            return Err(ExtractError::Noise { noise: self.noise });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_have_phases_of_their_own() {
        let phases: Vec<[Real; 3]> = (0..1000).map(layer_phase).collect();
        assert_eq!(phases[0], [0.5; 3]);
        let apart = |a: Real, b: Real| (a - b).abs().min(1.0 - (a - b).abs());
        for (i, a) in phases.iter().enumerate() {
            assert!(a.iter().all(|x| (0.0..1.0).contains(x)));
            for b in &phases[..i] {
                assert!((0..3).any(|k| apart(a[k], b[k]) > 0.05), "{a:?} {b:?}");
            }
        }
    }
}
