//! Masked fields (Appendix C): a collision field that binds only near the garment it is for.

mod mask;

pub use mask::{BoxMask, BoxesMask, Mask};

use crate::aabb::Aabb;
use crate::field::{FieldSample, SignedDistance};
use crate::math::{Point, Real, Vector};

/// A field that binds only where its mask does: there it is the field itself, bit for bit; elsewhere
/// the distance is +∞ and the gradient zero, which is *no constraint*: farther than any clearance, and
/// with no direction to push in.
///
/// `lipschitz()` is +∞: from outside the mask to its inside the value jumps. But a point can meet
/// a surface only by entering the mask, and only where the field itself has one:
/// [`free_radius`](SignedDistance::free_radius) is the distance to the mask outside of it, and the
/// field's own inside.
///
/// # Source
///
/// Appendix C of the supplement masks with boxes, [`BoxMask`] and [`BoxesMask`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Masked<F, M> {
    /// The field that is masked.
    pub field: F,
    /// Where it binds.
    pub mask: M,
}

impl<F: SignedDistance, M: Mask> Masked<F, M> {
    /// Calls `call` once with all points in which the field binds: a network sees one batch.
    fn batched<T: Clone>(
        &self,
        points: &[Point],
        out: &mut [T],
        unbound: T,
        call: impl Fn(&[Point], &mut [T]),
    ) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        let binding: Vec<usize> =
            (0..points.len()).filter(|&k| self.mask.binds(&points[k])).collect();
        out.fill(unbound.clone());
        if binding.is_empty() {
            return;
        }
        let inside: Vec<Point> = binding.iter().map(|&k| points[k]).collect();
        let mut values = vec![unbound; inside.len()];
        call(&inside, &mut values);
        for (k, value) in binding.into_iter().zip(values) {
            out[k] = value;
        }
    }
}

/// No constraint.
const UNBOUND: FieldSample =
    FieldSample { distance: Real::INFINITY, gradient: Vector::new(0.0, 0.0, 0.0) };

impl<F: SignedDistance, M: Mask> SignedDistance for Masked<F, M> {
    fn distance(&self, p: &Point) -> Real {
        if self.mask.binds(p) { self.field.distance(p) } else { Real::INFINITY }
    }

    fn sample(&self, p: &Point) -> FieldSample {
        if self.mask.binds(p) { self.field.sample(p) } else { UNBOUND }
    }

    fn distances(&self, points: &[Point], out: &mut [Real]) {
        self.batched(points, out, Real::INFINITY, |inside, values| {
            self.field.distances(inside, values);
        });
    }

    fn samples(&self, points: &[Point], out: &mut [FieldSample]) {
        self.batched(points, out, UNBOUND, |inside, values| self.field.samples(inside, values));
    }

    fn bounds(&self) -> Option<Aabb> {
        match (self.field.bounds(), self.mask.bounds()) {
            (Some(a), Some(b)) => Some(Aabb { min: a.min.sup(&b.min), max: a.max.inf(&b.max) }),
            (a, b) => a.or(b),
        }
    }

    fn lipschitz(&self) -> Real {
        Real::INFINITY
    }

    fn free_radius(&self, p: &Point, distance: Real, clearance: Real) -> Real {
        if self.mask.binds(p) {
            self.field.free_radius(p, distance, clearance)
        } else {
            self.mask.distance(p)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;
    use crate::shapes::Cylinder;

    const BODY: Cylinder =
        Cylinder { center: Point::new(0.0, 0.0, 0.0), radius: 0.5, half_height: 1.0 };

    fn boxed() -> Masked<Cylinder, BoxMask> {
        let aabb = Aabb { min: Point::new(-1.0, -0.2, -1.0), max: Point::new(1.0, 0.2, 1.0) };
        Masked { field: BODY, mask: BoxMask::new(aabb).unwrap() }
    }

    #[test]
    fn inside_the_box_the_field_is_itself_and_outside_there_is_no_constraint() {
        let field = boxed();
        let (inside, outside) = (Point::new(0.1, 0.2, 0.3), Point::new(0.1, 0.2f64.next_up(), 0.3));
        assert_eq!(field.sample(&inside), BODY.sample(&inside));
        assert_eq!(
            field.sample(&outside),
            FieldSample { distance: Real::INFINITY, gradient: Vector::zeros() }
        );
        assert_eq!([inside, outside].map(|p| field.mask.binds(&p)), [true, false]);
        assert_eq!(field.bounds().unwrap().max, Point::new(0.5, 0.2, 0.5));
        let nothing = Masked { field: BODY, mask: BoxMask::new(Aabb::EMPTY).unwrap() };
        assert_eq!(nothing.distance(&Point::origin()), Real::INFINITY);
    }

    #[test]
    fn within_its_free_radius_no_point_is_below_the_clearance() {
        let field = boxed();
        let (mut random, mut positive) = (SplitMix64::new(7), [0; 2]);
        let mut next = move || random.unit() * 2.0 - 1.0;
        for _ in 0..2000 {
            let p = Point::new(next(), next(), next());
            let distance = field.distance(&p);
            let radius = field.free_radius(&p, distance, 0.01);
            assert!(radius <= 1.0, "{radius} at {p}");
            positive[usize::from(distance.is_finite())] += usize::from(radius > 0.0);
            for _ in 0..20 {
                let step = Vector::new(next(), next(), next());
                let to = p + step * (0.999 * radius.max(0.0) / step.norm());
                assert!(radius <= 0.0 || field.distance(&to) >= 0.01, "{p} to {to}");
            }
        }
        assert!(positive.iter().all(|n| *n > 50), "{positive:?}");
    }

    /// A field that is not a number.
    struct Nothing;
    impl SignedDistance for Nothing {
        fn distance(&self, _: &Point) -> Real {
            Real::NAN
        }
        fn sample(&self, _: &Point) -> FieldSample {
            FieldSample { distance: Real::NAN, gradient: Vector::repeat(Real::NAN) }
        }
        fn bounds(&self) -> Option<Aabb> {
            None
        }
        fn lipschitz(&self) -> Real {
            1.0
        }
    }

    #[test]
    fn nan_is_not_replaced_by_no_constraint() {
        let Masked { mask, .. } = boxed();
        let field = Masked { field: Nothing, mask };
        let points: Vec<Point> =
            (0..200).map(|k| Point::new(0.0, 0.0, 0.01 * Real::from(k))).collect();
        let (mut distances, mut samples) = (vec![0.0; 200], vec![UNBOUND; 200]);
        field.distances(&points, &mut distances);
        field.samples(&points, &mut samples);
        for (p, (distance, sample)) in points.iter().zip(distances.iter().zip(&samples)) {
            let binds = field.mask.binds(p);
            let found = [field.distance(p), field.sample(p).distance, *distance, sample.distance];
            assert!(found.iter().all(|d| d.is_nan() == binds), "{p} {found:?}");
        }
    }

    #[test]
    fn masked_fields_conform() {
        use crate::conformance::{FieldTolerances, check_signed_distance};
        let mut random = SplitMix64::new(5);
        let mut next = move || random.unit() * 2.4 - 1.2;
        let points: Vec<Point> = (0..800).map(|_| Point::new(next(), next(), next())).collect();
        check_signed_distance(&boxed(), &points, &FieldTolerances::default()).unwrap();
    }
}
