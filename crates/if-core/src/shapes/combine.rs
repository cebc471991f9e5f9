//! Fields made of fields.

use crate::aabb::Aabb;
use crate::field::{FieldSample, SignedDistance};
use crate::math::{Point, Real, Vector};

/// Points in either: `min(φ₀, φ₁)`. A true distance outside; inside a lower bound of the depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Union<A, B>(pub A, pub B);

/// Points in both: `max(φ₀, φ₁)`. A true distance inside; outside a lower bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection<A, B>(pub A, pub B);

/// Points in the first but not in the second: `max(φ₀, −φ₁)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subtraction<A, B>(pub A, pub B);

/// The surface moved outwards: `φ − by`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset<F> {
    /// What is offset.
    pub field: F,
    /// How far, in metres; negative moves inwards.
    pub by: Real,
}

/// The field moved as a whole: `φ(p − by)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Translated<F> {
    /// What is moved.
    pub field: F,
    /// Where to, in metres.
    pub by: Vector,
}

/// The same surface with all values, and so the gradient, multiplied: `factor · φ`. Imitates a
/// warped or badly trained field, for stress tests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaledGradient<F> {
    /// What is scaled.
    pub field: F,
    /// By how much, above zero.
    pub factor: Real,
}

impl<A: SignedDistance, B: SignedDistance> SignedDistance for Union<A, B> {
    fn distance(&self, p: &Point) -> Real {
        self.0.distance(p).min(self.1.distance(p))
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let (a, b) = (self.0.sample(p), self.1.sample(p));
        if b.distance < a.distance { b } else { a }
    }
    fn bounds(&self) -> Option<Aabb> {
        Some(self.0.bounds()?.merged(&self.1.bounds()?))
    }
    fn lipschitz(&self) -> Real {
        self.0.lipschitz().max(self.1.lipschitz())
    }
}

impl<A: SignedDistance, B: SignedDistance> SignedDistance for Intersection<A, B> {
    fn distance(&self, p: &Point) -> Real {
        self.0.distance(p).max(self.1.distance(p))
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let (a, b) = (self.0.sample(p), self.1.sample(p));
        if b.distance > a.distance { b } else { a }
    }
    fn bounds(&self) -> Option<Aabb> {
        match (self.0.bounds(), self.1.bounds()) {
            (Some(a), Some(b)) => Some(Aabb { min: a.min.sup(&b.min), max: a.max.inf(&b.max) }),
            (a, b) => a.or(b),
        }
    }
    fn lipschitz(&self) -> Real {
        self.0.lipschitz().max(self.1.lipschitz())
    }
}

impl<A: SignedDistance, B: SignedDistance> SignedDistance for Subtraction<A, B> {
    fn distance(&self, p: &Point) -> Real {
        self.0.distance(p).max(-self.1.distance(p))
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let (a, b) = (self.0.sample(p), self.1.sample(p));
        if -b.distance > a.distance {
            FieldSample { distance: -b.distance, gradient: -b.gradient }
        } else {
            a
        }
    }
    fn bounds(&self) -> Option<Aabb> {
        self.0.bounds()
    }
    fn lipschitz(&self) -> Real {
        self.0.lipschitz().max(self.1.lipschitz())
    }
}

impl<F: SignedDistance> SignedDistance for Offset<F> {
    fn distance(&self, p: &Point) -> Real {
        self.field.distance(p) - self.by
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let s = self.field.sample(p);
        FieldSample { distance: s.distance - self.by, ..s }
    }
    /// `None` for an offset outwards: a field that is no true distance may stay below `by`
    /// anywhere.
    fn bounds(&self) -> Option<Aabb> {
        if self.by > 0.0 { None } else { self.field.bounds() }
    }
    fn lipschitz(&self) -> Real {
        self.field.lipschitz()
    }
}

impl<F: SignedDistance> SignedDistance for Translated<F> {
    fn distance(&self, p: &Point) -> Real {
        self.field.distance(&(p - self.by))
    }
    fn sample(&self, p: &Point) -> FieldSample {
        self.field.sample(&(p - self.by))
    }
    fn bounds(&self) -> Option<Aabb> {
        self.field.bounds().map(|b| Aabb { min: b.min + self.by, max: b.max + self.by })
    }
    fn lipschitz(&self) -> Real {
        self.field.lipschitz()
    }
}

impl<F: SignedDistance> SignedDistance for ScaledGradient<F> {
    fn distance(&self, p: &Point) -> Real {
        self.field.distance(p) * self.factor
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let s = self.field.sample(p);
        FieldSample { distance: s.distance * self.factor, gradient: s.gradient * self.factor }
    }
    fn bounds(&self) -> Option<Aabb> {
        self.field.bounds()
    }
    fn lipschitz(&self) -> Real {
        self.field.lipschitz() * self.factor
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::Sphere;

    #[test]
    fn two_balls_combine_as_sets_do() {
        let a = Sphere { center: Point::origin(), radius: 1.0 };
        let b = Translated { field: a, by: Vector::x() };
        let lens = Point::new(0.5, 0.0, 0.0);
        let left = Point::new(-0.5, 0.0, 0.0);
        for (p, in_a, in_b) in
            [(lens, true, true), (left, true, false), (Point::new(1.5, 0.0, 0.0), false, true)]
        {
            assert_eq!(a.distance(&p) < 0.0, in_a);
            assert_eq!(b.distance(&p) < 0.0, in_b);
            assert_eq!(Union(a, b).distance(&p) < 0.0, in_a || in_b);
            assert_eq!(Intersection(a, b).distance(&p) < 0.0, in_a && in_b);
            assert_eq!(Subtraction(a, b).distance(&p) < 0.0, in_a && !in_b);
        }
        let bounds = Intersection(a, b).bounds().unwrap();
        assert_eq!((bounds.min.x, bounds.max.x), (0.0, 1.0));
        assert_eq!(Union(a, b).bounds().unwrap().max.x, 2.0);
    }

    #[test]
    fn an_offset_ball_is_a_larger_ball() {
        let p = Point::new(0.3, -2.0, 0.7);
        let small = Sphere { center: Point::origin(), radius: 1.0 };
        let large = Sphere { radius: 1.25, ..small };
        approx::assert_relative_eq!(
            Offset { field: small, by: 0.25 }.distance(&p),
            large.distance(&p),
            epsilon = 1e-15
        );
        assert_eq!(Offset { field: small, by: 0.25 }.bounds(), None);
        assert_eq!(ScaledGradient { field: small, factor: 2.0 }.sample(&p).gradient.norm(), 2.0);
    }
}
