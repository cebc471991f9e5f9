//! Weights in space: where a field binds.

use crate::aabb::Aabb;
use crate::closest::ClosestPoint;
use crate::math::{Point, Real, Vector};
use crate::parameter::ParameterError;
use crate::pointers::through_pointers;

/// A weight in space: where a field binds, and how strongly.
pub trait Mask: Sync {
    /// Weight in [0, 1] and its gradient in 1/m: 1 where the field binds in full, 0 where it does
    /// not.
    fn weight(&self, p: &Point) -> (Real, Vector);

    /// Length over which a field fades with the weight, in metres. See [`Masked`](super::Masked).
    fn fade(&self) -> Real;

    /// A box outside which the weight is 0; `None` if unknown.
    fn bounds(&self) -> Option<Aabb>;

    /// A lower bound on the distance from `p` to where the weight is above 0, in metres; 0 if
    /// unknown.
    fn distance(&self, _p: &Point) -> Real {
        0.0
    }
}

through_pointers!(Mask {
    fn weight(&self, p: &Point) -> (Real, Vector);
    fn fade(&self) -> Real;
    fn bounds(&self) -> Option<Aabb>;
    fn distance(&self, p: &Point) -> Real;
});

/// The paper's mask: weight 1 in a closed axis-aligned box, 0 outside.
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
    fn weight(&self, p: &Point) -> (Real, Vector) {
        (if self.aabb.contains(p) { 1.0 } else { 0.0 }, Vector::zeros())
    }
    fn fade(&self) -> Real {
        0.0
    }
    fn bounds(&self) -> Option<Aabb> {
        Some(self.aabb)
    }
    fn distance(&self, p: &Point) -> Real {
        self.aabb.distance_squared(p).sqrt()
    }
}

/// The same for several inner garments: weight 1 in any of their boxes, 0 outside of all.
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
    fn weight(&self, p: &Point) -> (Real, Vector) {
        let is_in_one = self.boxes.iter().any(|mask| mask.aabb.contains(p));
        (if is_in_one { 1.0 } else { 0.0 }, Vector::zeros())
    }
    fn fade(&self) -> Real {
        0.0
    }
    fn bounds(&self) -> Option<Aabb> {
        Some(self.boxes.iter().fold(Aabb::EMPTY, |all, mask| all.merged(&mask.aabb)))
    }
    fn distance(&self, p: &Point) -> Real {
        self.boxes.iter().map(|mask| mask.distance(p)).fold(Real::INFINITY, Real::min)
    }
}

/// A mask by the distance d to a garment, without a step at hems and cuffs:
///
/// ```text
/// w = 1 − t² (3 − 2t),   t = clamp((d − inner) / (outer − inner), 0, 1)
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearMask<C> {
    garment: C,
    inner: Real,
    outer: Real,
}

impl<C: ClosestPoint> NearMask<C> {
    /// Weight 1 up to `inner` metres from the `garment`, 0 from `outer` metres on.
    ///
    /// # Errors
    ///
    /// Unless `0 ≤ inner < outer`, both finite.
    pub fn new(garment: C, inner: Real, outer: Real) -> Result<Self, ParameterError> {
        ParameterError::check_not_negative("inner", inner)?;
        let ok = outer > inner && outer.is_finite();
        ParameterError::check("outer", outer, ok, "finite and larger than `inner` (m)")?;
        Ok(Self { garment, inner, outer })
    }
}

impl<C: ClosestPoint> Mask for NearMask<C> {
    fn weight(&self, p: &Point) -> (Real, Vector) {
        let Some(near) = self.garment.closest(p, self.outer) else { return (0.0, Vector::zeros()) };
        if near.distance <= self.inner {
            return (1.0, Vector::zeros());
        }
        let width = self.outer - self.inner;
        let t = ((near.distance - self.inner) / width).min(1.0);
        let slope = -6.0 * t * (1.0 - t) / width;
        // The distance is above `inner`, hence above zero.
        (1.0 - t * t * (3.0 - 2.0 * t), (p - near.point) * (slope / near.distance))
    }
    fn fade(&self) -> Real {
        self.outer - self.inner
    }
    fn bounds(&self) -> Option<Aabb> {
        None
    }
    fn distance(&self, p: &Point) -> Real {
        // The search is bounded, and so is what it can promise.
        let near = self.garment.closest(p, 2.0 * self.outer);
        near.map_or(self.outer, |near| (near.distance - self.outer).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closest::Closest;

    /// A garment without points.
    #[derive(Debug)]
    struct Empty;
    impl ClosestPoint for Empty {
        fn closest(&self, _: &Point, _: Real) -> Option<Closest> {
            None
        }
    }

    #[test]
    fn several_boxes_bind_in_each_of_them() {
        let cube = |x: Real| {
            let center = Point::new(x, 0.0, 0.0);
            Aabb { min: center, max: center }.inflated(0.5)
        };
        let mask = BoxesMask::new([cube(0.0), cube(3.0)]).unwrap();
        let at = |x: Real| Point::new(x, 0.1, 0.0);
        assert_eq!([0.0, 3.2, 1.0, 9.0].map(|x| mask.weight(&at(x)).0), [1.0, 1.0, 0.0, 0.0]);
        assert_eq!([0.0, 1.0, 2.25].map(|x| mask.distance(&at(x))), [0.0, 0.5, 0.25]);
        assert_eq!(mask.bounds(), Some(cube(0.0).merged(&cube(3.0))));
        let none = BoxesMask::new([]).unwrap();
        assert_eq!((none.weight(&at(0.0)).0, none.distance(&at(0.0))), (0.0, Real::INFINITY));
        assert!(BoxesMask::new([cube(0.0), cube(Real::NAN)]).is_err());
    }

    #[test]
    fn invalid_masks_are_rejected() {
        for (inner, outer, name) in [
            (0.2, 0.1, "outer"),
            (0.1, 0.1, "outer"),
            (-0.1, 0.1, "inner"),
            (0.0, Real::INFINITY, "outer"),
            (Real::NAN, 1.0, "inner"),
            (0.0, Real::NAN, "outer"),
        ] {
            let error = NearMask::new(Empty, inner, outer).unwrap_err();
            assert_eq!(error.name, name, "{inner} {outer}");
        }
        let aabb = Aabb { min: Point::new(0.0, Real::NAN, 0.0), max: Point::new(1.0, 1.0, 1.0) };
        assert!(BoxMask::new(aabb).unwrap_err().to_string().contains("NaN"));
    }
}
