//! Axis-aligned boxes.

use crate::math::{Point, Real, Vector, larger, smaller};
use serde::{Deserialize, Serialize};

/// An axis-aligned box, closed: touching boxes overlap. The empty box has `min = +∞`, `max = −∞`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: Point,
    /// Largest coordinates.
    pub max: Point,
}

impl Aabb {
    /// The box that contains nothing, and is the neutral element of [`Aabb::merged`].
    pub const EMPTY: Aabb = Aabb {
        min: Point::new(Real::INFINITY, Real::INFINITY, Real::INFINITY),
        max: Point::new(Real::NEG_INFINITY, Real::NEG_INFINITY, Real::NEG_INFINITY),
    };

    /// The smallest box around `points`; [`Aabb::EMPTY`] without points.
    pub fn from_points<'a>(points: impl IntoIterator<Item = &'a Point>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| b.grown_to(p))
    }

    /// This box, enlarged to contain `p`.
    #[inline]
    pub fn grown_to(&self, p: &Point) -> Self {
        self.merged(&Self { min: *p, max: *p })
    }

    /// The smallest box around both.
    #[inline]
    pub fn merged(&self, other: &Self) -> Self {
        let mut both = *other;
        for k in 0..3 {
            both.min[k] = smaller(self.min[k], other.min[k]);
            both.max[k] = larger(self.max[k], other.max[k]);
        }
        both
    }

    /// This box with `margin` added on all six sides, in metres.
    #[inline]
    pub fn inflated(&self, margin: Real) -> Self {
        let m = Vector::repeat(margin);
        Self { min: self.min - m, max: self.max + m }
    }

    /// Whether the box contains no point at all.
    #[inline]
    pub fn is_empty(&self) -> bool {
        !(self.min.x <= self.max.x && self.min.y <= self.max.y && self.min.z <= self.max.z)
    }

    /// Whether `p` lies inside or on the border.
    #[inline]
    pub fn contains(&self, p: &Point) -> bool {
        (0..3).all(|k| self.min[k] <= p[k] && p[k] <= self.max[k])
    }

    /// Whether the two boxes share a point.
    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| self.min[k] <= other.max[k] && other.min[k] <= self.max[k])
    }

    /// Squared distance from `p` to the box, zero inside, in square metres.
    #[inline]
    pub fn distance_squared(&self, p: &Point) -> Real {
        let mut sum = 0.0;
        for k in 0..3 {
            let d = larger(larger(self.min[k] - p[k], p[k] - self.max[k]), 0.0);
            sum += d * d;
        }
        sum
    }

    /// Squared distance of the two boxes, zero if they overlap, in square metres.
    #[inline]
    pub fn gap_squared(&self, other: &Self) -> Real {
        let mut sum = 0.0;
        for k in 0..3 {
            let d = larger(larger(self.min[k] - other.max[k], other.min[k] - self.max[k]), 0.0);
            sum += d * d;
        }
        sum
    }

    /// Lengths of the sides, zero for the empty box.
    #[inline]
    pub fn size(&self) -> Vector {
        if self.is_empty() { Vector::zeros() } else { self.max - self.min }
    }

    /// Length of the diagonal, zero for the empty box.
    #[inline]
    pub fn diagonal(&self) -> Real {
        self.size().norm()
    }

    /// The centre of the box. Meaningless for the empty box.
    #[inline]
    pub fn center(&self) -> Point {
        nalgebra::center(&self.min, &self.max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_empty_box_is_neutral_and_touches_nothing() {
        let b = Aabb::from_points(&[Point::new(0.0, 1.0, 2.0), Point::new(3.0, 0.0, 2.0)]);
        assert_eq!(Aabb::EMPTY.merged(&b), b);
        assert!(Aabb::EMPTY.is_empty() && !b.is_empty());
        assert!(!Aabb::EMPTY.overlaps(&b) && !Aabb::EMPTY.contains(&b.min));
        assert_eq!(Aabb::EMPTY.diagonal(), 0.0);
    }

    #[test]
    fn distance_is_zero_inside_and_euclidean_at_a_corner() {
        let b = Aabb { min: Point::origin(), max: Point::new(1.0, 1.0, 1.0) };
        assert_eq!(b.distance_squared(&Point::new(0.5, 1.0, 0.0)), 0.0);
        assert_eq!(b.distance_squared(&Point::new(2.0, 3.0, -2.0)), 1.0 + 4.0 + 4.0);
        assert!(b.overlaps(&Aabb { min: b.max, max: b.max }));
    }
}
