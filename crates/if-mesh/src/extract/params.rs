//! Parameters of an extraction.

use if_core::aabb::Aabb;
use if_core::math::Real;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// Parameters of [`crate::extract::extract`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExtractParams {
    /// The box in which the surface lies; `None` uses the field's bounds. The lattice covers it, and
    /// at most one cell more on each side.
    pub region: Option<Aabb>,
    /// Size of the cells.
    pub resolution: Resolution,
    /// Position of the lattice: node (0, 0, 0) is this many cells below the lower corner of the
    /// region, from 0 to 1. Layers that are extracted on one lattice touch in degenerate ways: use
    /// [`layer_phase`] for each.
    pub phase: [Real; 3],
    /// Where the field is evaluated.
    pub sampling: Sampling,
    /// Bound on the field's slope.
    pub slope: Slope,
    /// Maximum error of the field's values, in metres: boxes are kept accordingly. Values of
    /// networks in single precision are off by about 1e-6 of their largest.
    pub noise: Real,
    /// Whether vertices take a secant step along their edge: one evaluation each.
    pub secant: bool,
    /// Newton steps that then move the vertices onto the surface: one evaluation with gradient each.
    pub newton: usize,
    /// Rounds of relaxation along the surface, which remove slivers: one evaluation with gradient
    /// for each vertex and round. 3 to 5 are enough.
    pub relax: usize,
    /// Number of vertices, and of triangle centres, at which the error is measured: one evaluation
    /// with gradient each.
    pub check: usize,
    /// Random seed for these.
    pub seed: u64,
    /// Maximum memory, in bytes, without that of the field: checked before it is allocated.
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

/// Size of the cells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Resolution {
    /// Side of the cells, in metres: about the mean edge length that comes out.
    Cell(Real),
    /// Cells along the longest side of the region.
    Cells(u32),
    /// As small as an error requires.
    Accuracy {
        /// Maximum distance of triangles from the surface, in metres.
        error: Real,
        /// Minimum side of the cells, in metres: bounds the cost where a field has creases or is
        /// rough.
        finest: Real,
    },
}

/// Where the field is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Sampling {
    /// Where the bound on the slope allows a zero.
    Sparse,
    /// At every node: slow, for comparison.
    Dense,
}

/// Bound on |∇φ|.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Slope {
    /// [`SignedDistance::lipschitz`](if_core::field::SignedDistance::lipschitz) of the field.
    Field,
    /// This value.
    Given(Real),
    /// The largest gradient at random points, times a factor: for networks, whose provable bounds
    /// are too large to be useful.
    Sampled {
        /// Number of points, uniform in the region.
        points: usize,
        /// Safety factor; 1.5 is usual.
        factor: Real,
        /// Random seed.
        seed: u64,
    },
}

/// The phase of the lattice for layer `layer` of an outfit: those of the first thousand layers
/// differ by a twentieth of a cell or more, so that extracted layers do not touch in degenerate ways.
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

impl ExtractParams {
    /// Checks the ranges that do not depend on a field.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = ParameterError::check;
        let length = |x: Real| x > 0.0 && x.is_finite();
        match self.resolution {
            Resolution::Cell(cell) => {
                check("cell", cell, length(cell), "positive and finite (m)")?;
            }
            Resolution::Cells(cells) => {
                check("cells", cells.into(), cells > 0, "at least 1")?;
            }
            Resolution::Accuracy { error, finest } => {
                check("error", error, length(error), "positive and finite (m)")?;
                check("finest", finest, length(finest), "positive and finite (m)")?;
                let points = self.check as Real;
                check("check", points, self.check > 0, "at least 1 for a requested accuracy")?;
            }
        }
        for (axis, phase) in self.phase.into_iter().enumerate() {
            check("phase", phase, (0.0..=1.0).contains(&phase), "from 0 to 1 (cells)")
                .map_err(|error| error.at(axis))?;
        }
        let noise = self.noise;
        check("noise", noise, noise >= 0.0 && noise.is_finite(), "at least 0 and finite (m)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_of_layers_differ() {
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
