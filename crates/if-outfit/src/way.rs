//! Ways that vertices are led along instead of the nearest ones.

use if_core::math::{Point, Real, Vector};

/// The way of one vertex: along the unit vector `direction`, until it is beyond `point`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Way {
    pub(crate) vertex: u32,
    pub(crate) direction: Vector,
    pub(crate) point: Point,
}

impl Way {
    /// How far it still is from `p`, in metres; negative beyond its end.
    pub(crate) fn left(&self, p: &Point) -> Real {
        self.direction.dot(&(self.point - p))
    }
}
