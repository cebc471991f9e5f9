//! Bounds on the strain of edges.

use crate::constraint::{Constraint, Residual};
use crate::edge_set::EdgeSet;
use if_core::math::{Point, Real};
use if_core::parameter::ParameterError;

/// Keeps each edge's length within `[min ℓ, max ℓ]`, rigidly. Visited colour by colour, like the
/// stretch.
///
/// ```text
/// C = clamp(|pᵢ − pⱼ|, min ℓ, max ℓ) − |pᵢ − pⱼ|        Δpᵢ = wᵢ/(wᵢ + wⱼ) C (pᵢ − pⱼ)/|pᵢ − pⱼ|
/// ```
///
/// An edge whose ends coincide, or are both pinned, is skipped.
///
/// # Source
///
/// [Provot 1995], without his order of propagation.
#[derive(Clone, Debug)]
pub struct StrainLimit {
    edges: EdgeSet,
    min: Real,
    max: Real,
}

impl StrainLimit {
    /// Limits on `edges`: lengths between `min` and `max` times the rest length. `max` may be
    /// infinite.
    ///
    /// # Errors
    ///
    /// Unless `0 ≤ min ≤ 1 ≤ max`.
    pub fn new(edges: EdgeSet, min: Real, max: Real) -> Result<Self, ParameterError> {
        let low = (0.0..=1.0).contains(&min);
        ParameterError::check("min", min, low, "0 to 1 (times the rest length)")?;
        ParameterError::check("max", max, max >= 1.0, "at least 1 (times the rest length)")?;
        Ok(Self { edges, min, max })
    }

    /// The same limits on the edges with an end that can move ([`EdgeSet::movable`]).
    ///
    /// # Panics
    ///
    /// If there are fewer inverse masses than particles named.
    pub fn movable(&self, inverse_masses: &[Real]) -> Self {
        Self { edges: self.edges.movable(inverse_masses), ..*self }
    }

    /// The edges, in the order of visiting.
    pub fn edges(&self) -> &EdgeSet {
        &self.edges
    }
}

impl Constraint for StrainLimit {
    fn begin_substep(
        &mut self,
        _previous: &[Point],
        _positions: &[Point],
        _inverse_masses: &[Real],
        _h: Real,
    ) {
    }

    /// # Panics
    ///
    /// If the slices are shorter than the edges' vertex count.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], _h: Real) -> Residual {
        let mut residual = Residual { count: self.edges.len(), ..Residual::default() };
        for k in 0..self.edges.len() {
            let (i, j) = (self.edges.a[k] as usize, self.edges.b[k] as usize);
            let d = positions[i] - positions[j];
            let length = d.norm();
            let rest = self.edges.rest[k];
            let c = if length > self.max * rest {
                self.max * rest - length
            } else if length < self.min * rest {
                self.min * rest - length
            } else {
                continue;
            };
            residual.max = residual.max.max(c.abs());
            residual.sum_squares += c * c;
            residual.active += 1;
            let (wi, wj) = (inverse_masses[i], inverse_masses[j]);
            if length > 0.0 && wi + wj > 0.0 {
                let push = d * (c / (length * (wi + wj)));
                positions[i] += push * wi;
                positions[j] -= push * wj;
            }
        }
        residual
    }

    fn is_idle(&self) -> bool {
        self.edges.is_empty() || (self.min == 0.0 && self.max == Real::INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn limited(length: Real, w: [Real; 2]) -> Real {
        let edges = EdgeSet::new(&[[0, 1]], &[1.0], 2).unwrap();
        let mut p = vec![Point::origin(), Point::new(0.0, length, 0.0)];
        StrainLimit::new(edges, 0.9, 1.1).unwrap().project(&mut p, &w, 1.0);
        (p[1] - p[0]).norm()
    }

    #[test]
    fn a_length_beyond_its_bounds_returns_to_the_nearer_one() {
        for (length, expected) in [(2.0, 1.1), (0.3, 0.9), (1.05, 1.05), (0.0, 0.0)] {
            assert_relative_eq!(limited(length, [1.0, 3.0]), expected, epsilon = 1e-15);
            assert_eq!(limited(length, [0.0; 2]), length);
        }
    }

    #[test]
    fn invalid_bounds_are_refused() {
        for (min, max) in [(1.1, 1.2), (0.5, 0.9), (-0.1, 1.0), (Real::NAN, 1.0), (0.0, Real::NAN)]
        {
            assert!(StrainLimit::new(EdgeSet::default(), min, max).is_err());
        }
        assert!(StrainLimit::new(EdgeSet::default(), 0.0, Real::INFINITY).unwrap().is_idle());
    }
}
