//! Signed distance fields.

use crate::aabb::Aabb;
use crate::math::{Point, Real, Vector};
use crate::pointers::through_pointers;
use rayon::prelude::*;

/// Value and gradient of a field at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldSample {
    /// Distance, negative inside, in metres.
    pub distance: Real,
    /// ∇φ: of unit length for a true distance. Zero where the field has no gradient.
    pub gradient: Vector,
}

/// Points handed to one task of a batched call: large enough to hide the cost of forking.
const CHUNK: usize = 256;

/// A signed distance field φ, in metres: negative inside, positive outside.
///
/// The batched calls are provided; they run over fixed chunks in rayon's ambient pool and give the
/// same bits for any number of threads. Implementors with a cheaper batch override them;
/// `if_core::conformance` checks that the two agree.
///
/// Coordinates of points must be finite: callers check them once, and not every field at every query.
/// At other points results are unspecified (NaN, +∞, or the end of a band), and implementors may
/// `debug_assert!` that there are none.
pub trait SignedDistance: Sync {
    /// φ(p).
    fn distance(&self, p: &Point) -> Real;

    /// φ(p) and ∇φ(p).
    fn sample(&self, p: &Point) -> FieldSample;

    /// φ at all `points`.
    ///
    /// # Panics
    ///
    /// If `out` is not as long as `points`.
    fn distances(&self, points: &[Point], out: &mut [Real]) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        if points.len() <= CHUNK {
            points.iter().zip(out).for_each(|(p, o)| *o = self.distance(p));
            return;
        }
        points.par_chunks(CHUNK).zip(out.par_chunks_mut(CHUNK)).for_each(|(ps, os)| {
            ps.iter().zip(os).for_each(|(p, o)| *o = self.distance(p));
        });
    }

    /// φ and ∇φ at all `points`.
    ///
    /// # Panics
    ///
    /// If `out` is not as long as `points`.
    fn samples(&self, points: &[Point], out: &mut [FieldSample]) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        if points.len() <= CHUNK {
            points.iter().zip(out).for_each(|(p, o)| *o = self.sample(p));
            return;
        }
        points.par_chunks(CHUNK).zip(out.par_chunks_mut(CHUNK)).for_each(|(ps, os)| {
            ps.iter().zip(os).for_each(|(p, o)| *o = self.sample(p));
        });
    }

    /// A box outside which the field is positive, so that callers can skip it; `None` if unknown.
    fn bounds(&self) -> Option<Aabb>;

    /// A bound on |∇φ|: a point at distance φ may move φ / `lipschitz()` before its sign can
    /// change. It must be positive, or +∞ if unknown.
    fn lipschitz(&self) -> Real;

    /// How far `p` may move, in metres, before φ can be below `clearance`, where φ(p) is
    /// `distance`: (φ − clearance) / `lipschitz()`. At most 0 if that is unknown, as it is unless
    /// `lipschitz()` is positive and finite. Callers need not evaluate φ again on the way.
    fn free_radius(&self, _p: &Point, distance: Real, clearance: Real) -> Real {
        let lipschitz = self.lipschitz();
        let radius = (distance - clearance) / lipschitz;
        if lipschitz > 0.0 && radius.is_finite() { radius } else { 0.0 }
    }
}

through_pointers!(SignedDistance {
    fn distance(&self, p: &Point) -> Real;
    fn sample(&self, p: &Point) -> FieldSample;
    fn distances(&self, points: &[Point], out: &mut [Real]);
    fn samples(&self, points: &[Point], out: &mut [FieldSample]);
    fn bounds(&self) -> Option<Aabb>;
    fn lipschitz(&self) -> Real;
    fn free_radius(&self, p: &Point, distance: Real, clearance: Real) -> Real;
});

#[cfg(test)]
mod tests {
    use super::*;

    /// A field of distance −1 everywhere, with the given bound of its gradient.
    struct Bounded(Real);

    impl SignedDistance for Bounded {
        fn distance(&self, _: &Point) -> Real {
            -1.0
        }
        fn sample(&self, _: &Point) -> FieldSample {
            FieldSample { distance: -1.0, gradient: Vector::x() }
        }
        fn bounds(&self) -> Option<Aabb> {
            None
        }
        fn lipschitz(&self) -> Real {
            self.0
        }
    }

    #[test]
    fn an_invalid_lipschitz_bound_frees_no_point() {
        for bound in [-1.0, -0.0, 0.0, Real::NAN, Real::NEG_INFINITY, Real::INFINITY] {
            for distance in [-1.0, 0.0, 1.0, Real::NAN, Real::INFINITY] {
                let radius = Bounded(bound).free_radius(&Point::origin(), distance, 0.1);
                assert!(radius <= 0.0, "bound {bound}, distance {distance}: {radius}");
            }
        }
        assert_eq!(Bounded(2.0).free_radius(&Point::origin(), 1.1, 0.1), 0.5);
    }
}
