//! Solids whose signed distance has a closed form.

use crate::aabb::Aabb;
use crate::closest::closest_on_segment;
use crate::field::{FieldSample, SignedDistance};
use crate::math::{Point, Real, Vector, unit_or_zero};

/// A ball. The gradient is zero in its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre, in metres.
    pub center: Point,
    /// Radius, in metres.
    pub radius: Real,
}

/// A box with sides along the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// Centre, in metres.
    pub center: Point,
    /// Half the lengths of the sides, in metres.
    pub half: Vector,
}

/// A ring about the y axis through its centre. The gradient is zero on that axis' circle of radius
/// `major`; on the axis itself it is that towards +x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torus {
    /// Centre, in metres.
    pub center: Point,
    /// Distance of the tube's middle from the axis, in metres.
    pub major: Real,
    /// Radius of the tube, in metres.
    pub minor: Real,
}

/// All points within `radius` of a segment. The gradient is zero on the segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// One end of the segment, in metres.
    pub from: Point,
    /// Its other end.
    pub to: Point,
    /// Radius, in metres.
    pub radius: Real,
}

/// The half-space below a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Any point of the plane.
    pub point: Point,
    /// Its outward normal, of unit length.
    pub normal: Vector,
}

/// A cylinder about the y axis through its centre, with flat ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// Centre, in metres.
    pub center: Point,
    /// Radius, in metres.
    pub radius: Real,
    /// Half its height, in metres.
    pub half_height: Real,
}

/// An infinite labyrinth whose values are not true distances: |∇φ| lies between 0 and 1.
///
/// ```text
/// φ = (sin kx cos ky + sin ky cos kz + sin kz cos kx) / (√3 k),   k = 2π / period
/// ```
///
/// By Cauchy and Schwarz each component of k√3 ∇φ / k, such as cos kx cos ky − sin kz sin kx, has a
/// square of at most cos² ky + sin² kz, and these sum to 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gyroid {
    /// Length after which it repeats, in metres.
    pub period: Real,
}

impl SignedDistance for Sphere {
    fn distance(&self, p: &Point) -> Real {
        (p - self.center).norm() - self.radius
    }
    fn sample(&self, p: &Point) -> FieldSample {
        FieldSample { distance: self.distance(p), gradient: unit_or_zero(&(p - self.center)) }
    }
    fn bounds(&self) -> Option<Aabb> {
        Some(Aabb { min: self.center, max: self.center }.inflated(self.radius))
    }
    fn lipschitz(&self) -> Real {
        1.0
    }
}

impl SignedDistance for Cuboid {
    fn distance(&self, p: &Point) -> Real {
        let q = (p - self.center).abs() - self.half;
        q.sup(&Vector::zeros()).norm() + q.max().min(0.0)
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let d = p - self.center;
        let q = d.abs() - self.half;
        let distance = self.distance(p);
        let mut gradient = if q.max() > 0.0 {
            unit_or_zero(&q.sup(&Vector::zeros()))
        } else {
            // Inside, the nearest of the six sides.
            Vector::ith(q.imax(), 1.0)
        };
        for k in 0..3 {
            gradient[k] = gradient[k].copysign(gradient[k] * d[k]);
        }
        FieldSample { distance, gradient }
    }
    fn bounds(&self) -> Option<Aabb> {
        Some(Aabb { min: self.center - self.half, max: self.center + self.half })
    }
    fn lipschitz(&self) -> Real {
        1.0
    }
}

impl Torus {
    /// From the nearest point of the tube's middle to `p`.
    fn arm(&self, p: &Point) -> Vector {
        let d = p - self.center;
        let flat = unit_or_zero(&Vector::new(d.x, 0.0, d.z));
        // On the axis all points of the circle are equally near: take the one towards +x.
        let flat = if flat == Vector::zeros() { Vector::x() } else { flat };
        d - flat * self.major
    }
}

impl SignedDistance for Torus {
    fn distance(&self, p: &Point) -> Real {
        self.arm(p).norm() - self.minor
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let arm = self.arm(p);
        FieldSample { distance: arm.norm() - self.minor, gradient: unit_or_zero(&arm) }
    }
    fn bounds(&self) -> Option<Aabb> {
        let reach = Vector::new(self.major + self.minor, self.minor, self.major + self.minor);
        Some(Aabb { min: self.center - reach, max: self.center + reach })
    }
    fn lipschitz(&self) -> Real {
        1.0
    }
}

impl Capsule {
    fn arm(&self, p: &Point) -> Vector {
        p - (self.from + (self.to - self.from) * closest_on_segment(p, &self.from, &self.to))
    }
}

impl SignedDistance for Capsule {
    fn distance(&self, p: &Point) -> Real {
        self.arm(p).norm() - self.radius
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let arm = self.arm(p);
        FieldSample { distance: arm.norm() - self.radius, gradient: unit_or_zero(&arm) }
    }
    fn bounds(&self) -> Option<Aabb> {
        Some(Aabb::from_points([&self.from, &self.to]).inflated(self.radius))
    }
    fn lipschitz(&self) -> Real {
        1.0
    }
}

impl SignedDistance for Plane {
    fn distance(&self, p: &Point) -> Real {
        self.normal.dot(&(p - self.point))
    }
    fn sample(&self, p: &Point) -> FieldSample {
        FieldSample { distance: self.distance(p), gradient: self.normal }
    }
    fn bounds(&self) -> Option<Aabb> {
        None
    }
    fn lipschitz(&self) -> Real {
        1.0
    }
}

impl SignedDistance for Cylinder {
    fn distance(&self, p: &Point) -> Real {
        let d = p - self.center;
        let (side, end) = (d.x.hypot(d.z) - self.radius, d.y.abs() - self.half_height);
        side.max(0.0).hypot(end.max(0.0)) + side.max(end).min(0.0)
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let d = p - self.center;
        let (side, end) = (d.x.hypot(d.z) - self.radius, d.y.abs() - self.half_height);
        let out = unit_or_zero(&Vector::new(d.x, 0.0, d.z));
        let up = Vector::new(0.0, 1.0f64.copysign(d.y), 0.0);
        let gradient = if side > 0.0 && end > 0.0 {
            unit_or_zero(&(out * side + up * end))
        } else if side > end {
            out
        } else {
            up
        };
        FieldSample { distance: self.distance(p), gradient }
    }
    fn bounds(&self) -> Option<Aabb> {
        let reach = Vector::new(self.radius, self.half_height, self.radius);
        Some(Aabb { min: self.center - reach, max: self.center + reach })
    }
    fn lipschitz(&self) -> Real {
        1.0
    }
}

impl SignedDistance for Gyroid {
    fn distance(&self, p: &Point) -> Real {
        self.sample(p).distance
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let k = std::f64::consts::TAU / self.period;
        let ((sx, cx), (sy, cy), (sz, cz)) =
            ((k * p.x).sin_cos(), (k * p.y).sin_cos(), (k * p.z).sin_cos());
        let slope = 1.0 / 3.0f64.sqrt();
        FieldSample {
            distance: (sx * cy + sy * cz + sz * cx) * slope / k,
            gradient: Vector::new(cx * cy - sz * sx, cy * cz - sx * sy, cz * cx - sy * sz) * slope,
        }
    }
    fn bounds(&self) -> Option<Aabb> {
        None
    }
    fn lipschitz(&self) -> Real {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_school_geometry() {
        let o = Point::origin();
        let at = Point::new;
        let cuboid = Cuboid { center: o, half: Vector::new(1.0, 2.0, 3.0) };
        let torus = Torus { center: o, major: 2.0, minor: 0.5 };
        let cylinder = Cylinder { center: o, radius: 1.0, half_height: 2.0 };
        let capsule = Capsule { from: at(0.0, -1.0, 0.0), to: at(0.0, 1.0, 0.0), radius: 0.5 };
        let cases: [(&dyn SignedDistance, Point, Real); 14] = [
            (&Sphere { center: at(1.0, 0.0, 0.0), radius: 2.0 }, at(1.0, 3.0, 4.0), 3.0),
            (&cuboid, o, -1.0),
            (&cuboid, at(0.0, -1.75, 0.0), -0.25),
            (&cuboid, at(4.0, 6.0, 3.0), 5.0),
            (&cuboid, at(-1.0, -2.0, -3.0), 0.0),
            (&torus, at(0.0, 0.0, -2.0), -0.5),
            (&torus, o, 1.5),
            (&torus, at(2.0, 3.0, 0.0), 2.5),
            (&cylinder, at(4.0, 6.0, 0.0), 5.0),
            (&cylinder, at(0.0, 1.75, 0.0), -0.25),
            (&cylinder, at(0.0, 0.0, 0.5), -0.5),
            (&capsule, at(3.0, 5.0, 0.0), 4.5),
            (&capsule, at(0.25, 0.0, 0.0), -0.25),
            (&Plane { point: at(0.0, 1.0, 0.0), normal: Vector::y() }, at(9.0, 3.5, 9.0), 2.5),
        ];
        for (field, p, expected) in cases {
            approx::assert_relative_eq!(field.distance(&p), expected, epsilon = 1e-15);
        }
    }

    #[test]
    fn a_capsule_without_length_is_a_ball() {
        let c = Point::new(0.1, 0.2, 0.3);
        let p = Point::new(-1.0, 0.5, 2.0);
        let ball = Sphere { center: c, radius: 0.4 };
        assert_eq!(Capsule { from: c, to: c, radius: 0.4 }.sample(&p), ball.sample(&p));
    }
}
