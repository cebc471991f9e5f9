//! From metres to the cube [−1, 1]³ in which networks live, and back.

use crate::error::TargetError;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// `u = (x − center) · scale`: the only seam between metres in f64 and network units in f32.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// The centre of the cube, in metres.
    pub center: Point,
    /// Network units per metre.
    pub scale: Real,
}

impl Frame {
    /// Network units as they are.
    pub const UNIT: Frame = Frame { center: Point::new(0.0, 0.0, 0.0), scale: 1.0 };

    /// The frame in which `aabb`, with `margin` metres on each side, just fits into the cube.
    ///
    /// # Errors
    ///
    /// A box that is empty, a point, or not finite; a margin that is negative or not finite.
    pub fn around(aabb: &Aabb, margin: Real) -> Result<Self, TargetError> {
        ParameterError::check_not_negative("margin", margin)?;
        let half = 0.5 * aabb.size().amax() + margin;
        let frame = Self { center: aabb.center(), scale: 1.0 / half };
        if aabb.is_empty() || aabb.size().amax() <= 0.0 || frame.validate().is_err() {
            return Err(TargetError::NoExtent { aabb: *aabb });
        }
        Ok(frame)
    }

    /// Checks that all numbers are finite and the scale is above zero.
    ///
    /// # Errors
    ///
    /// The first number that is not.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for x in self.center.iter() {
            ParameterError::check("frame.center", *x, x.is_finite(), "finite (m)")?;
        }
        let scale = self.scale > 0.0 && self.scale.is_normal();
        ParameterError::check("frame.scale", self.scale, scale, "finite and above zero")
    }

    /// A point in network units.
    #[inline]
    pub fn to_unit(&self, p: &Point) -> [f32; 3] {
        [0, 1, 2].map(|k| ((p[k] - self.center[k]) * self.scale) as f32)
    }

    /// A point in metres.
    #[inline]
    pub fn to_metres(&self, u: &[f32; 3]) -> Point {
        self.center + Vector::from(u.map(Real::from)) / self.scale
    }

    /// The cube, in metres.
    pub fn aabb(&self) -> Aabb {
        let half = Vector::repeat(1.0 / self.scale);
        Aabb { min: self.center - half, max: self.center + half }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_and_its_margin_fill_the_cube() {
        let aabb = Aabb { min: Point::new(-0.5, 0.0, 1.0), max: Point::new(0.5, 1.6, 1.2) };
        let frame = Frame::around(&aabb, 0.2).unwrap();
        assert_eq!(frame.to_unit(&Point::new(0.0, 1.8, 1.1)), [0.0, 1.0, 0.0]);
        approx::assert_relative_eq!(
            frame.to_metres(&[0.0, -0.8, 0.0]),
            aabb.min + Vector::new(0.5, 0.0, 0.1),
            epsilon = 1e-7
        );
        approx::assert_relative_eq!(frame.aabb().size(), Vector::repeat(2.0), epsilon = 1e-12);
    }

    #[test]
    fn a_box_without_extent_has_no_frame() {
        let p = Point::new(1.0, 2.0, 3.0);
        for (aabb, margin) in [
            (Aabb::EMPTY, 0.1),
            (Aabb { min: p, max: p }, 0.1),
            (Aabb { min: p, max: Point::new(f64::INFINITY, 3.0, 4.0) }, 0.1),
            (Aabb { min: p, max: p + Vector::x() }, f64::NAN),
            (Aabb { min: p, max: p + Vector::x() }, -1.0),
        ] {
            assert!(Frame::around(&aabb, margin).is_err(), "{aabb:?} {margin}");
        }
    }
}
