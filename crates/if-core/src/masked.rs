//! Masked fields (Appendix C): a collision field that binds only near the garment it is for.

mod mask;

pub use mask::{BoxMask, BoxesMask, Mask, NearMask};

use crate::aabb::Aabb;
use crate::field::{FieldSample, SignedDistance};
use crate::math::{Point, Real, Vector};

/// A field that binds only where the weight of its mask is above zero.
///
/// ```text
/// φₘ = φ + fade · (1/w − 1)
/// ```
///
/// So weight 1 gives the field itself, bit for bit; as the weight falls the surface draws back,
/// without a step in value or gradient; and where the weight is 0 the distance is +∞ and the
/// gradient zero, which is *no constraint*: farther than any clearance, and with no direction to
/// push in.
///
/// `lipschitz()` is +∞: from outside the mask to its inside the value jumps. But a point can meet
/// a surface only by entering the mask, and only where the field itself has one:
/// [`free_radius`](SignedDistance::free_radius) is the distance to the mask outside of it, and the
/// field's own inside.
///
/// # Source
///
/// Appendix C of the supplement masks with boxes, [`BoxMask`] and [`BoxesMask`]. [`NearMask`] and
/// the fading are ours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Masked<F, M> {
    /// The field that is masked.
    pub field: F,
    /// Where it binds.
    pub mask: M,
}

impl<F: SignedDistance, M: Mask> Masked<F, M> {
    /// How strongly the field binds in `p`: 1 in full, 0 not at all.
    pub fn weight(&self, p: &Point) -> Real {
        self.mask.weight(p).0
    }

    fn faded(&self, sample: FieldSample, (w, slope): (Real, Vector)) -> FieldSample {
        // NaN stays NaN, so that the caller can detect it.
        if w >= 1.0 || sample.distance.is_nan() {
            return sample;
        }
        let fade = self.mask.fade();
        let distance = sample.distance + fade * (1.0 / w - 1.0);
        let gradient = sample.gradient - slope * (fade / (w * w));
        // The quotients overflow just inside the outer radius.
        if distance.is_finite() && gradient.iter().all(|g| g.is_finite()) {
            FieldSample { distance, gradient }
        } else {
            UNBOUND
        }
    }

    /// Calls `call` once with all points of weight above zero: a network sees one batch.
    fn batched<T: Clone>(
        &self,
        points: &[Point],
        unbound: T,
        call: impl Fn(&[Point], &[(Real, Vector)]) -> Vec<T>,
    ) -> Vec<T> {
        use rayon::prelude::*;
        let weights: Vec<(Real, Vector)> =
            points.par_iter().with_min_len(64).map(|p| self.mask.weight(p)).collect();
        let bound: Vec<usize> = (0..points.len()).filter(|&k| weights[k].0 > 0.0).collect();
        let mut all = vec![unbound; points.len()];
        if bound.is_empty() {
            return all;
        }
        let inside: Vec<Point> = bound.iter().map(|&k| points[k]).collect();
        let weights: Vec<(Real, Vector)> = bound.iter().map(|&k| weights[k]).collect();
        for (k, value) in bound.into_iter().zip(call(&inside, &weights)) {
            all[k] = value;
        }
        all
    }
}

/// No constraint.
const UNBOUND: FieldSample =
    FieldSample { distance: Real::INFINITY, gradient: Vector::new(0.0, 0.0, 0.0) };

impl<F: SignedDistance, M: Mask> SignedDistance for Masked<F, M> {
    fn distance(&self, p: &Point) -> Real {
        match self.mask.weight(p) {
            (w, _) if w <= 0.0 => Real::INFINITY,
            (w, _) if w >= 1.0 => self.field.distance(p),
            weight => self.faded(self.field.sample(p), weight).distance,
        }
    }

    fn sample(&self, p: &Point) -> FieldSample {
        match self.mask.weight(p) {
            (w, _) if w <= 0.0 => UNBOUND,
            weight => self.faded(self.field.sample(p), weight),
        }
    }

    fn distances(&self, points: &[Point], out: &mut [Real]) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        out.copy_from_slice(&self.batched(points, Real::INFINITY, |inside, weights| {
            if weights.iter().all(|w| w.0 >= 1.0) {
                let mut values = vec![0.0; inside.len()];
                self.field.distances(inside, &mut values);
                return values;
            }
            let mut samples = vec![UNBOUND; inside.len()];
            self.field.samples(inside, &mut samples);
            samples.iter().zip(weights).map(|(s, w)| self.faded(*s, *w).distance).collect()
        }));
    }

    fn samples(&self, points: &[Point], out: &mut [FieldSample]) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        out.copy_from_slice(&self.batched(points, UNBOUND, |inside, weights| {
            let mut samples = vec![UNBOUND; inside.len()];
            self.field.samples(inside, &mut samples);
            samples.iter().zip(weights).map(|(s, w)| self.faded(*s, *w)).collect()
        }));
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
        let weight = self.weight(p);
        if weight <= 0.0 {
            return self.mask.distance(p);
        }
        // Without the fading, which is 0 where the weight is 1. φₘ ≥ φ everywhere.
        let fading = if weight < 1.0 { self.mask.fade() * (1.0 / weight - 1.0) } else { 0.0 };
        self.field.free_radius(p, distance - fading, clearance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closest::{Closest, ClosestPoint, Feature};
    use crate::random::SplitMix64;
    use crate::shapes::{Cylinder, Sphere};

    /// The nearest point of a ball's surface, as a garment.
    struct Ball(Sphere);
    impl ClosestPoint for Ball {
        fn closest(&self, p: &Point, max_distance: Real) -> Option<Closest> {
            let sample = self.0.sample(p);
            let distance = sample.distance.abs();
            let point = p - sample.gradient * sample.distance;
            let place = Closest {
                point,
                distance,
                triangle: 0,
                barycentric: [1.0, 0.0, 0.0],
                feature: Feature::Vertex(0),
            };
            (distance <= max_distance).then_some(place)
        }
    }

    const BODY: Cylinder =
        Cylinder { center: Point::new(0.0, 0.0, 0.0), radius: 0.5, half_height: 1.0 };

    fn near() -> Masked<Cylinder, NearMask<Ball>> {
        let garment = Ball(Sphere { center: Point::origin(), radius: 0.6 });
        Masked { field: BODY, mask: NearMask::new(garment, 0.05, 0.25).unwrap() }
    }

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
        assert_eq!((field.weight(&inside), field.weight(&outside)), (1.0, 0.0));
        assert_eq!(field.bounds().unwrap().max, Point::new(0.5, 0.2, 0.5));
        let nothing = Masked { field: BODY, mask: BoxMask::new(Aabb::EMPTY).unwrap() };
        assert_eq!(nothing.distance(&Point::origin()), Real::INFINITY);
    }

    #[test]
    fn the_ramp_falls_from_one_to_zero_without_a_step() {
        let field = near();
        let at = |d: Real| Point::new(0.0, 0.0, 0.6 - d);
        assert_eq!(field.weight(&at(0.04)), 1.0);
        assert_eq!(field.sample(&at(0.04)), BODY.sample(&at(0.04)));
        approx::assert_relative_eq!(field.weight(&at(0.15)), 0.5, epsilon = 1e-12);
        assert_eq!(field.weight(&at(0.26)), 0.0);
        let mut last = field.distance(&at(0.05));
        for k in 1..2000 {
            let next = field.distance(&at(0.05 + 0.19 * f64::from(k) / 2000.0));
            let body = BODY.distance(&at(0.05 + 0.19 * f64::from(k) / 2000.0));
            assert!(next >= body && next >= last - 1e-4, "the surface only draws back");
            last = next;
        }
        assert!(last > 1.0, "and is gone at the outer radius");
        // Value and slope start smoothly at the inner radius.
        let h = 1e-6;
        approx::assert_relative_eq!(
            field.distance(&at(0.05 + h)),
            BODY.distance(&at(0.05 + h)),
            epsilon = 1e-9
        );
        approx::assert_relative_eq!(
            field.sample(&at(0.05 + h)).gradient,
            BODY.sample(&at(0.05)).gradient,
            epsilon = 1e-3
        );
    }

    #[test]
    fn within_its_free_radius_no_point_is_below_the_clearance() {
        let fields: [&dyn SignedDistance; 2] = [&boxed(), &near()];
        for (field, most) in fields.into_iter().zip([1.0, 0.4]) {
            let (mut random, mut positive) = (SplitMix64::new(7), [0; 2]);
            let mut next = move || random.unit() * 2.0 - 1.0;
            for _ in 0..2000 {
                let p = Point::new(next(), next(), next());
                let distance = field.distance(&p);
                let radius = field.free_radius(&p, distance, 0.01);
                assert!(radius <= most, "{radius} at {p}");
                positive[usize::from(distance.is_finite())] += usize::from(radius > 0.0);
                for _ in 0..20 {
                    let step = Vector::new(next(), next(), next());
                    let to = p + step * (0.999 * radius.max(0.0) / step.norm());
                    assert!(radius <= 0.0 || field.distance(&to) >= 0.01, "{p} to {to}");
                }
            }
            assert!(positive.iter().all(|n| *n > 50), "{positive:?}");
        }
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
        let Masked { mask, .. } = near();
        let field = Masked { field: Nothing, mask };
        let mut faded = 0;
        for k in 0..200 {
            let p = Point::new(0.0, 0.0, 0.6 - 0.002 * Real::from(k));
            let weight = field.weight(&p);
            assert_eq!(field.distance(&p).is_nan(), weight > 0.0, "{p}");
            assert_eq!(field.sample(&p).distance.is_nan(), weight > 0.0, "{p}");
            faded += u32::from(weight > 0.0 && weight < 1.0);
        }
        assert!(faded > 3);
    }

    #[test]
    fn masked_fields_conform() {
        use crate::conformance::{FieldTolerances, check_signed_distance};
        let mut random = SplitMix64::new(5);
        let mut next = move || random.unit() * 2.4 - 1.2;
        let points: Vec<Point> = (0..800).map(|_| Point::new(next(), next(), next())).collect();
        check_signed_distance(&boxed(), &points, &FieldTolerances::default()).unwrap();
        // Towards the outer radius the field is arbitrarily steep.
        let tolerances =
            FieldTolerances { kink: 1.0, kinks: 0.3, gradient: 1e-2, ..FieldTolerances::default() };
        check_signed_distance(&near(), &points, &tolerances).unwrap();
    }
}
