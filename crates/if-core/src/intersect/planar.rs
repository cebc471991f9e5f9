//! What two convex sets of at most three corners have in common, where they lie in one plane.

use super::Contact;
use super::predicates::{Point2, side_of_line, side_of_plane};
use crate::math::Point;
use std::cmp::Ordering;

/// The convex hull of one to three points, without points that add nothing: a triangle, the two
/// ends of a segment, or a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hull<'a> {
    points: [&'a Point; 3],
    len: usize,
}

impl<'a> Hull<'a> {
    pub(super) fn new(points: &[&'a Point]) -> Self {
        if let [a, b, c] = *points
            && axis_of([a, b, c]).is_some()
        {
            return Self { points: [a, b, c], len: 3 };
        }
        // Along a line the order of coordinates is the order of places.
        let low = points.iter().copied().min_by(|p, q| order(p, q)).expect("a hull has a point");
        let high = points.iter().copied().max_by(|p, q| order(p, q)).expect("a hull has a point");
        Self { points: [low, high, high], len: if low == high { 1 } else { 2 } }
    }

    /// 3, 2 or 1 for a triangle, a segment or a point.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// The ends of a segment.
    pub(super) fn ends(&self) -> (&'a Point, &'a Point) {
        (self.points[0], self.points[1])
    }
}

/// What the two have in common. Sets that span no common plane are [`Contact::Disjoint`]; of a
/// triangle and something else, the other must lie in its plane.
pub(super) fn contact(a: &Hull<'_>, b: &Hull<'_>) -> Contact {
    let plane = match (a.len, b.len) {
        (3, _) => a.points,
        (_, 3) => b.points,
        (2, 2) => {
            if side_of_plane(a.points[0], a.points[1], b.points[0], b.points[1]) != 0 {
                return Contact::Disjoint;
            }
            let first = [a.points[0], a.points[1], b.points[0]];
            if axis_of(first).is_some() { first } else { [a.points[0], a.points[1], b.points[1]] }
        }
        (2, _) => [a.points[0], a.points[1], b.points[0]],
        _ => [b.points[0], b.points[1], a.points[0]],
    };
    match axis_of(plane) {
        Some(axis) => separate(&Polygon::new(a, axis), &Polygon::new(b, axis)),
        None => on_line(a.ends(), b.ends()),
    }
}

/// `(e0, e1, a)` and `(e0, e1, b)` lie in one plane: what they have in common beyond the hull of
/// `e0` and `e1`.
pub(super) fn beyond_edge(e0: &Point, e1: &Point, a: &Point, b: &Point) -> Contact {
    match (axis_of([e0, e1, a]), axis_of([e0, e1, b])) {
        (Some(axis), Some(_)) => {
            let [e0, e1, a, b] = [e0, e1, a, b].map(|p| project(p, axis));
            if side_of_line(e0, e1, a) == side_of_line(e0, e1, b) {
                Contact::Coplanar
            } else {
                Contact::Disjoint
            }
        }
        (None, None) => {
            // Two segments. Off one line they meet in the edge, which is a point then.
            if axis_of([e0, a, b]).is_some() || axis_of([e1, a, b]).is_some() {
                return Contact::Disjoint;
            }
            let (a, b, edge) =
                (Hull::new(&[e0, e1, a]), Hull::new(&[e0, e1, b]), Hull::new(&[e0, e1]));
            let low = [a.points[0], b.points[0]].into_iter().max_by(|p, q| order(p, q));
            let high = [a.points[1], b.points[1]].into_iter().min_by(|p, q| order(p, q));
            if low == Some(edge.points[0]) && high == Some(edge.points[1]) {
                Contact::Disjoint
            } else {
                Contact::Coplanar
            }
        }
        // A segment on the line of a triangle's edge does not reach beyond it.
        _ => Contact::Disjoint,
    }
}

fn order(p: &Point, q: &Point) -> Ordering {
    let by = |k: usize| p[k].partial_cmp(&q[k]).unwrap_or(Ordering::Equal);
    by(0).then_with(|| by(1)).then_with(|| by(2))
}

/// An axis along which the triangle projects to one of non-zero area; `None` if it is degenerate.
fn axis_of([a, b, c]: [&Point; 3]) -> Option<usize> {
    let first = (b - a).cross(&(c - a)).iamax();
    (0..3)
        .map(|k| (first + k) % 3)
        .find(|&axis| side_of_line(project(a, axis), project(b, axis), project(c, axis)) != 0)
}

fn project(p: &Point, axis: usize) -> Point2 {
    [p[(axis + 1) % 3], p[(axis + 2) % 3]]
}

/// A convex polygon of one to three corners, counter-clockwise.
struct Polygon {
    corners: [Point2; 3],
    len: usize,
}

impl Polygon {
    fn new(hull: &Hull<'_>, axis: usize) -> Self {
        let mut corners = hull.points.map(|p| project(p, axis));
        if hull.len == 3 && side_of_line(corners[0], corners[1], corners[2]) < 0 {
            corners.swap(1, 2);
        }
        Self { corners, len: hull.len }
    }

    /// The largest sign of the other's corners seen from each edge: −1 separates strictly, 0
    /// weakly. A segment has an edge there and an edge back, a point none.
    fn worst(&self, other: &Polygon) -> i8 {
        let edges = if self.len == 1 { 0 } else { self.len };
        (0..edges)
            .map(|k| {
                let (from, to) = (self.corners[k], self.corners[(k + 1) % self.len]);
                other.corners[..other.len]
                    .iter()
                    .map(|p| side_of_line(from, to, *p))
                    .max()
                    .unwrap_or(1)
            })
            .min()
            .unwrap_or(1)
    }
}

/// Separating lines: the difference of two convex polygons is bounded by lines along their edges.
fn separate(a: &Polygon, b: &Polygon) -> Contact {
    match a.worst(b).min(b.worst(a)) {
        1 => Contact::Coplanar,
        0 => Contact::Touching,
        _ => Contact::Disjoint,
    }
}

/// Intervals on one line, by the order of coordinates.
fn on_line((a0, a1): (&Point, &Point), (b0, b1): (&Point, &Point)) -> Contact {
    match order(a0, b1).max(order(b0, a1)) {
        Ordering::Less => Contact::Coplanar,
        Ordering::Equal if a0 == a1 && b0 == b1 => Contact::Coplanar,
        Ordering::Equal => Contact::Touching,
        Ordering::Greater => Contact::Disjoint,
    }
}
