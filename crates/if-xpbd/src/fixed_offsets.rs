//! Pairs of particles that move together: edges so short that contacts cannot tell their ends
//! apart.

use crate::constraint::{Constraint, Residual, Stage};
use if_core::math::{Point, Real, Vector};

/// Pairs (a, b) that keep their offset o as a vector of the world: they only translate.
///
/// ```text
/// C = x_b − x_a − o        Δx_a = w_a C / (w_a + w_b),   Δx_b = −w_b C / (w_a + w_b)
/// ```
///
/// Pairs are visited in the order of pushing, once at the end of a substep ([`Stage::Final`]). One
/// that shares no particle with a later one has its offset exactly, but for rounding. A pair that
/// is pinned at both ends stays as it is.
///
/// # Source
///
/// Ours. A length constraint leaves the direction of a short edge free, and contacts of its two
/// ends with different faces turn it: triangles at doubled points of a scan then flip.
#[derive(Clone, Debug, Default)]
pub struct FixedOffsets {
    pairs: Vec<[u32; 2]>,
    offsets: Vec<Vector>,
}

impl FixedOffsets {
    /// The `pairs` with their offsets at `rest`.
    ///
    /// # Panics
    ///
    /// If a pair names a particle beyond `rest`.
    pub fn new(pairs: Vec<[u32; 2]>, rest: &[Point]) -> Self {
        let offsets = pairs.iter().map(|&[a, b]| rest[b as usize] - rest[a as usize]).collect();
        Self { pairs, offsets }
    }

    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Whether there are no pairs.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }
}

impl Constraint for FixedOffsets {
    fn begin_substep(&mut self, _: &[Point], _: &[Point], _: &[Real], _: Real) {}

    /// # Panics
    ///
    /// If a pair names a particle beyond the slices.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], _h: Real) -> Residual {
        let mut residual = Residual::default();
        for (&[a, b], offset) in self.pairs.iter().zip(&self.offsets) {
            let (a, b) = (a as usize, b as usize);
            let off = (positions[b] - positions[a]) - offset;
            residual.add(off.norm());
            let sum = inverse_masses[a] + inverse_masses[b];
            if sum > 0.0 {
                positions[a] += off * (inverse_masses[a] / sum);
                positions[b] -= off * (inverse_masses[b] / sum);
            }
        }
        residual
    }

    fn stage(&self) -> Stage {
        Stage::Final
    }

    fn is_idle(&self) -> bool {
        self.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn rest() -> Vec<Point> {
        vec![Point::origin(), Point::new(1e-4, 0.0, 2e-4), Point::new(1.0, 0.0, 0.0)]
    }

    #[test]
    fn a_turned_pair_gets_its_offset_back_and_momentum_is_kept() {
        for w in [[1.0, 1.0, 1.0], [1.0, 3.0, 1.0], [0.0, 2.0, 1.0]] {
            let mut group = FixedOffsets::new(vec![[0, 1]], &rest());
            let mut x = rest();
            x[1] = Point::new(-3e-4, 5e-4, 0.0);
            let before = x.clone();
            let residual = group.project(&mut x, &w, 1.0);
            assert_eq!((residual.count, residual.active), (1, 1));
            assert_relative_eq!(x[1] - x[0], rest()[1] - rest()[0], epsilon = 1e-18);
            let weight = |w: Real| if w > 0.0 { 1.0 / w } else { 0.0 };
            let moved: Vector = (0..3).map(|k| (x[k] - before[k]) * weight(w[k])).sum();
            assert!(w[0] == 0.0 || moved.norm() < 1e-18, "{moved}");
            assert!(w[0] > 0.0 || x[0] == before[0]);
            assert_eq!(x[2], before[2]);
        }
    }

    #[test]
    fn pairs_that_are_pinned_or_translated_stay_as_they_are() {
        let mut group = FixedOffsets::new(vec![[0, 1]], &rest());
        let mut x = rest();
        x[1].y = 1.0;
        let before = x.clone();
        assert_eq!(group.project(&mut x, &[0.0, 0.0, 1.0], 1.0).max, 1.0);
        assert_eq!(x, before);
        let mut x: Vec<Point> = rest().iter().map(|p| p + Vector::new(0.5, 0.25, 2.0)).collect();
        assert!(group.project(&mut x, &[1.0; 3], 1.0).max < 1e-15);
        assert!(FixedOffsets::default().is_idle() && !group.is_idle() && group.len() == 1);
    }
}
