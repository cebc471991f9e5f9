//! The contract of [`SignedDistance`].

use crate::field::{FieldSample, SignedDistance};
use crate::math::{Point, Real, Vector};

/// Tolerances of [`check_signed_distance`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldTolerances {
    /// Step of the central differences, in metres.
    pub step: Real,
    /// Largest component of the gradient's error, a pure number. Central differences alone have
    /// about `step² / 6` times the third derivative, and 1e-16 / `step`.
    pub gradient: Real,
    /// Where second differences divided by `step` exceed this there is a kink, and gradients are
    /// not compared: one-sided slopes differ by that much.
    pub kink: Real,
    /// Share of points that may lie near a kink, from 0 to 1.
    pub kinks: Real,
    /// Rounding that a distance may carry beyond its Lipschitz bound, in metres.
    pub rounding: Real,
}

impl Default for FieldTolerances {
    /// For fields of the size of a person in `f64`.
    fn default() -> Self {
        Self { step: 1e-5, gradient: 1e-4, kink: 1e-2, kinks: 0.1, rounding: 1e-12 }
    }
}

/// Which part of the contract of [`SignedDistance`] is violated, and where.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FieldFault {
    /// NaN or −∞, or a gradient that is not finite.
    #[error(
        "point {index} {point}: the sample {sample:?} is not a number; return +∞ with a zero gradient for 'no constraint'"
    )]
    NotANumber {
        /// Index of the point.
        index: usize,
        /// The point.
        point: Point,
        /// The sample.
        sample: FieldSample,
    },
    /// Two methods return different values for the same point.
    #[error(
        "point {index} {point}: {call} gives {got:?}, but the call for one point gives {expected:?}; they must agree to the last bit"
    )]
    Disagreement {
        /// Index of the point.
        index: usize,
        /// The point.
        point: Point,
        /// The call.
        call: String,
        /// Its result.
        got: FieldSample,
        /// The result of `sample`.
        expected: FieldSample,
    },
    /// The gradient is not that of the value.
    #[error("point {index} {point}: gradient {got:?} where central differences give {expected:?}")]
    Gradient {
        /// Index of the point.
        index: usize,
        /// The point.
        point: Point,
        /// The result of `sample`.
        got: Vector,
        /// Central differences of `distance`.
        expected: Vector,
    },
    /// So many points are near kinks that the gradient is hardly tested.
    #[error(
        "{kinks} of {points} points lie near a kink: the gradient is hardly tested; choose other points or tolerances"
    )]
    Kinks {
        /// Points near a kink.
        kinks: usize,
        /// All points.
        points: usize,
    },
    /// The field is steeper than its `lipschitz()`.
    #[error(
        "|φ({from}) − φ({to})| = {difference} over {length} m is steeper than lipschitz() = {lipschitz}"
    )]
    Lipschitz {
        /// One end.
        from: Point,
        /// The other.
        to: Point,
        /// Difference of the distances.
        difference: Real,
        /// Length of the segment, in metres.
        length: Real,
        /// `lipschitz()` of the field.
        lipschitz: Real,
    },
    /// Not positive outside its bounds.
    #[error("φ({point}) = {distance} is not positive, but the point is outside bounds()")]
    Bounds {
        /// The point.
        point: Point,
        /// The distance there.
        distance: Real,
    },
}

/// Checks the contract of [`SignedDistance`] at `points` and near them.
///
/// - No value is NaN; +∞ is allowed, with a zero gradient.
/// - `distance`, `sample`, `distances` and `samples` agree bit for bit, for slices of several
///   lengths, on 1, 2 and 7 threads.
/// - The gradient is that of the value, away from kinks.
/// - The value obeys `lipschitz()` on segments between points and on short ones.
/// - The value is positive outside `bounds()`.
///
/// # Errors
///
/// The first violation.
///
/// # Panics
///
/// If rayon cannot start threads.
pub fn check_signed_distance(
    field: &(impl SignedDistance + ?Sized),
    points: &[Point],
    tolerances: &FieldTolerances,
) -> Result<(), FieldFault> {
    let expected: Vec<FieldSample> = points.iter().map(|p| field.sample(p)).collect();
    for (index, (point, sample)) in points.iter().zip(&expected).enumerate() {
        let number =
            sample.distance > Real::NEG_INFINITY && sample.gradient.iter().all(|g| g.is_finite());
        if !number || (sample.distance == Real::INFINITY && sample.gradient != Vector::zeros()) {
            return Err(FieldFault::NotANumber { index, point: *point, sample: *sample });
        }
    }
    check_calls(field, points, &expected)?;
    check_gradients(field, points, &expected, tolerances)?;
    check_lipschitz(field, points, &expected, tolerances)?;
    check_bounds(field, points, &expected)
}

fn same_bits(a: &FieldSample, b: &FieldSample) -> bool {
    a.distance.to_bits() == b.distance.to_bits()
        && a.gradient.iter().zip(&b.gradient).all(|(x, y)| x.to_bits() == y.to_bits())
}

fn check_calls(
    field: &(impl SignedDistance + ?Sized),
    points: &[Point],
    expected: &[FieldSample],
) -> Result<(), FieldFault> {
    let compare = |call: &str, at: usize, got: &[FieldSample]| match got
        .iter()
        .zip(&expected[at..])
        .position(|(g, e)| !same_bits(g, e))
    {
        Some(k) => Err(FieldFault::Disagreement {
            index: at + k,
            point: points[at + k],
            call: call.to_owned(),
            got: got[k],
            expected: expected[at + k],
        }),
        None => Ok(()),
    };
    // A value-only call is compared as a sample with the expected gradient.
    let as_samples = |values: &[Real], at: usize| -> Vec<FieldSample> {
        values
            .iter()
            .zip(&expected[at..])
            .map(|(v, e)| FieldSample { distance: *v, ..*e })
            .collect()
    };
    let scalars: Vec<Real> = points.iter().map(|p| field.distance(p)).collect();
    compare("distance", 0, &as_samples(&scalars, 0))?;
    let nothing = FieldSample { distance: Real::NAN, gradient: Vector::repeat(Real::NAN) };
    for threads in [1, 2, 7] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a test machine can start seven threads");
        for (at, length) in [(0, 0), (0, 1), (0, 7), (3, 64), (0, 257), (1, 600), (0, points.len())]
        {
            let at = at.min(points.len());
            let slice = &points[at..(at + length).min(points.len())];
            let mut values = vec![Real::NAN; slice.len()];
            let mut samples = vec![nothing; slice.len()];
            pool.install(|| {
                field.distances(slice, &mut values);
                field.samples(slice, &mut samples);
            });
            compare(
                &format!("distances of {} points on {threads} threads", slice.len()),
                at,
                &as_samples(&values, at),
            )?;
            compare(
                &format!("samples of {} points on {threads} threads", slice.len()),
                at,
                &samples,
            )?;
        }
    }
    Ok(())
}

fn check_gradients(
    field: &(impl SignedDistance + ?Sized),
    points: &[Point],
    expected: &[FieldSample],
    tolerances: &FieldTolerances,
) -> Result<(), FieldFault> {
    let h = tolerances.step;
    let mut kinks = 0;
    'points: for (index, (point, sample)) in points.iter().zip(expected).enumerate() {
        let (mut slope, mut worst) = (Vector::zeros(), 0.0);
        for k in 0..3 {
            let ends = [h, -h].map(|d| field.distance(&(point + Vector::ith(k, d))));
            let bend = (ends[0] + ends[1] - 2.0 * sample.distance) / h;
            // Also where one of the three is infinite.
            if bend.is_nan() || bend.abs() > tolerances.kink {
                kinks += usize::from(sample.distance.is_finite());
                continue 'points;
            }
            slope[k] = (ends[0] - ends[1]) / (2.0 * h);
            worst = Real::max(worst, bend.abs());
        }
        // A slight kink puts the differences off by half of what it bends.
        if (slope - sample.gradient).amax() > tolerances.gradient + worst {
            return Err(FieldFault::Gradient {
                index,
                point: *point,
                got: sample.gradient,
                expected: slope,
            });
        }
    }
    if kinks as Real > tolerances.kinks * points.len() as Real {
        return Err(FieldFault::Kinks { kinks, points: points.len() });
    }
    Ok(())
}

fn check_lipschitz(
    field: &(impl SignedDistance + ?Sized),
    points: &[Point],
    expected: &[FieldSample],
    tolerances: &FieldTolerances,
) -> Result<(), FieldFault> {
    let lipschitz = field.lipschitz();
    let check = |from: &Point, to: &Point, a: Real, b: Real| {
        let (difference, length) = ((a - b).abs(), (from - to).norm());
        // Without a bound, jumps to +∞ are allowed.
        if difference > lipschitz * length + tolerances.rounding && lipschitz < Real::INFINITY {
            return Err(FieldFault::Lipschitz {
                from: *from,
                to: *to,
                difference,
                length,
                lipschitz,
            });
        }
        Ok(())
    };
    let n = points.len();
    for i in 0..n {
        // To some point far from it in the list, and to two near it in space.
        let j = (i * 7 + n / 2) % n;
        check(&points[i], &points[j], expected[i].distance, expected[j].distance)?;
        for length in [1e-2, 1e-4] {
            let near = points[i] + (points[j] - points[i]) * length;
            check(&points[i], &near, expected[i].distance, field.distance(&near))?;
        }
    }
    Ok(())
}

fn check_bounds(
    field: &(impl SignedDistance + ?Sized),
    points: &[Point],
    expected: &[FieldSample],
) -> Result<(), FieldFault> {
    let Some(bounds) = field.bounds() else { return Ok(()) };
    let check = |point: &Point, distance: Real| {
        if bounds.contains(point) || distance > 0.0 {
            Ok(())
        } else {
            Err(FieldFault::Bounds { point: *point, distance })
        }
    };
    for (point, sample) in points.iter().zip(expected) {
        check(point, sample.distance)?;
    }
    if bounds.is_empty() {
        return Ok(());
    }
    // Just off each side of the box, below and beside the points. A finite field is evaluated
    // a millionth of its size away, so that rounding on the border does not count.
    let off = 1e-6 * bounds.diagonal().max(1e-6);
    for point in points.iter().filter(|p| p.iter().all(|x| x.is_finite())).take(512) {
        for k in 0..3 {
            for end in [bounds.min[k] - off, bounds.max[k] + off] {
                let mut q = *point;
                q[k] = end;
                check(&q, field.distance(&q))?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::points;
    use super::*;
    use crate::aabb::Aabb;
    use crate::shapes::{
        Capsule, Cuboid, Cylinder, Gyroid, Intersection, Offset, Plane, ScaledGradient, Sphere,
        Subtraction, Torus, Translated, Union,
    };

    #[test]
    fn all_analytic_shapes_conform() {
        let o = Point::origin();
        let ball = Sphere { center: Point::new(0.1, -0.2, 0.3), radius: 0.7 };
        let cuboid = Cuboid { center: o, half: Vector::new(0.3, 0.9, 0.5) };
        let torus = Torus { center: o, major: 0.8, minor: 0.25 };
        let tilted =
            Plane { point: Point::new(0.0, 0.1, 0.0), normal: Vector::new(0.48, 0.6, 0.64) };
        let fields: [&dyn SignedDistance; 13] = [
            &ball,
            &cuboid,
            &torus,
            &Capsule {
                from: Point::new(-0.5, 0.0, 0.2),
                to: Point::new(0.4, 0.6, 0.1),
                radius: 0.3,
            },
            &tilted,
            &Cylinder { center: o, radius: 0.5, half_height: 0.8 },
            &Gyroid { period: 0.9 },
            &Union(ball, torus),
            &Intersection(cuboid, tilted),
            &Subtraction(ball, cuboid),
            &Offset { field: torus, by: -0.1 },
            &Translated { field: cuboid, by: Vector::new(0.2, 0.1, -0.3) },
            &ScaledGradient { field: ball, factor: 2.0 },
        ];
        for (k, field) in fields.into_iter().enumerate() {
            if let Err(fault) =
                check_signed_distance(field, &points(700), &FieldTolerances::default())
            {
                panic!("field {k}: {fault}");
            }
        }
    }

    /// A ball that violates one part of the contract.
    struct Faulty(&'static str);
    impl SignedDistance for Faulty {
        fn distance(&self, p: &Point) -> Real {
            match self.0 {
                "nan" if p.x > 1.0 => Real::NAN,
                "steep" => 1.5 * (p.coords.norm() - 0.5),
                _ => p.coords.norm() - 0.5,
            }
        }
        fn sample(&self, p: &Point) -> FieldSample {
            let slope = if self.0 == "gradient" { 1.01 } else { 1.0 };
            let steep = if self.0 == "steep" { 1.5 } else { 1.0 };
            FieldSample {
                distance: self.distance(p),
                gradient: p.coords.normalize() * slope * steep,
            }
        }
        fn distances(&self, points: &[Point], out: &mut [Real]) {
            let error = if self.0 == "batch" && points.len() > 100 { Real::EPSILON } else { 0.0 };
            points.iter().zip(out).for_each(|(p, o)| *o = self.distance(p) * (1.0 + error));
        }
        fn bounds(&self) -> Option<Aabb> {
            let half = if self.0 == "bounds" { 0.4 } else { 0.5 };
            Some(Aabb { min: Point::origin(), max: Point::origin() }.inflated(half))
        }
        fn lipschitz(&self) -> Real {
            1.0
        }
    }

    #[test]
    fn each_violation_is_found_and_named() {
        let check =
            |kind| check_signed_distance(&Faulty(kind), &points(700), &FieldTolerances::default());
        assert_eq!(check("none"), Ok(()));
        assert!(matches!(check("nan"), Err(FieldFault::NotANumber { .. })));
        assert!(matches!(check("batch"), Err(FieldFault::Disagreement { .. })));
        assert!(matches!(check("gradient"), Err(FieldFault::Gradient { .. })));
        assert!(matches!(check("steep"), Err(FieldFault::Lipschitz { .. })));
        assert!(matches!(check("bounds"), Err(FieldFault::Bounds { .. })));
    }
}
