//! Where a field binds.

use crate::aabb::Aabb;
use crate::math::{Point, Real};
use crate::parameter::ParameterError;
use crate::pointers::through_pointers;

/// A part of space: where a field binds.
pub trait Mask: Sync {
    /// Whether the field binds in `p`.
    fn binds(&self, p: &Point) -> bool;

    /// A box outside which the field does not bind; `None` if unknown.
    fn bounds(&self) -> Option<Aabb>;

    /// A lower bound on the distance from `p` to where the field binds, in metres; 0 if unknown.
    fn distance(&self, _p: &Point) -> Real {
        0.0
    }
}

through_pointers!(Mask {
    fn binds(&self, p: &Point) -> bool;
    fn bounds(&self) -> Option<Aabb>;
    fn distance(&self, p: &Point) -> Real;
});

/// The paper's mask: a closed axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxMask {
    aabb: Aabb,
}

impl BoxMask {
    /// The mask of the box round the inner garment. With the empty box the field binds nowhere.
    ///
    /// # Errors
    ///
    /// A corner is NaN.
    pub fn new(aabb: Aabb) -> Result<Self, ParameterError> {
        for x in aabb.min.iter().chain(aabb.max.iter()) {
            ParameterError::check("aabb", *x, !x.is_nan(), "a number in each coordinate (m)")?;
        }
        Ok(Self { aabb })
    }
}

impl Mask for BoxMask {
    fn binds(&self, p: &Point) -> bool {
        self.aabb.contains(p)
    }
    fn bounds(&self) -> Option<Aabb> {
        Some(self.aabb)
    }
    fn distance(&self, p: &Point) -> Real {
        self.aabb.distance_squared(p).sqrt()
    }
}

/// The same for several inner garments: the union of their boxes.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct BoxesMask {
    boxes: Vec<BoxMask>,
}

impl BoxesMask {
    /// The mask of the boxes round the inner garments. Without boxes the field binds nowhere.
    ///
    /// # Errors
    ///
    /// A corner is NaN.
    pub fn new(boxes: impl IntoIterator<Item = Aabb>) -> Result<Self, ParameterError> {
        Ok(Self { boxes: boxes.into_iter().map(BoxMask::new).collect::<Result<_, _>>()? })
    }
}

impl Mask for BoxesMask {
    fn binds(&self, p: &Point) -> bool {
        self.boxes.iter().any(|mask| mask.binds(p))
    }
    fn bounds(&self) -> Option<Aabb> {
        Some(self.boxes.iter().fold(Aabb::EMPTY, |all, mask| all.merged(&mask.aabb)))
    }
    fn distance(&self, p: &Point) -> Real {
        self.boxes.iter().map(|mask| mask.distance(p)).fold(Real::INFINITY, Real::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_boxes_bind_in_each_of_them() {
        let cube = |x: Real| {
            let center = Point::new(x, 0.0, 0.0);
            Aabb { min: center, max: center }.inflated(0.5)
        };
        let mask = BoxesMask::new([cube(0.0), cube(3.0)]).unwrap();
        let at = |x: Real| Point::new(x, 0.1, 0.0);
        assert_eq!([0.0, 3.2, 1.0, 9.0].map(|x| mask.binds(&at(x))), [true, true, false, false]);
        assert_eq!([0.0, 1.0, 2.25].map(|x| mask.distance(&at(x))), [0.0, 0.5, 0.25]);
        assert_eq!(mask.bounds(), Some(cube(0.0).merged(&cube(3.0))));
        let none = BoxesMask::new([]).unwrap();
        assert_eq!((none.binds(&at(0.0)), none.distance(&at(0.0))), (false, Real::INFINITY));
        assert!(BoxesMask::new([cube(0.0), cube(Real::NAN)]).is_err());
    }

    #[test]
    fn invalid_masks_are_rejected() {
        let aabb = Aabb { min: Point::new(0.0, Real::NAN, 0.0), max: Point::new(1.0, 1.0, 1.0) };
        assert!(BoxMask::new(aabb).unwrap_err().to_string().contains("NaN"));
    }
}
