//! Intersections of segments with the mesh.

use super::{Bvh, STACK};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};

/// The intersection of a segment with a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The triangle.
    pub triangle: u32,
    /// Position along the segment, from 0 to 1.
    pub parameter: Real,
}

impl Bvh {
    /// The first intersection of the segment from `from` to `to` with a triangle for which `accept`
    /// returns true. In floating point: a segment that grazes an edge may miss both triangles there.
    pub fn first_hit(
        &self,
        from: &Point,
        to: &Point,
        mut accept: impl FnMut(u32) -> bool,
    ) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        self.each_hit(from, to, |hit| {
            if best.is_none_or(|h| hit.parameter < h.parameter) && accept(hit.triangle) {
                best = Some(hit);
            }
            best.map_or(1.0, |h| h.parameter)
        });
        best
    }

    /// Whether the segment from `from` to `to` meets a triangle. In floating point, as
    /// [`first_hit`](Self::first_hit).
    pub(crate) fn is_hit(&self, from: &Point, to: &Point) -> bool {
        let mut is_hit = false;
        self.each_hit(from, to, |_| {
            is_hit = true;
            NOTHING_MORE
        });
        is_hit
    }

    /// Calls `found` with hits, which returns up to which parameter others are of interest.
    fn each_hit(&self, from: &Point, to: &Point, mut found: impl FnMut(Hit) -> Real) {
        let (direction, mut limit) = (to - from, 1.0);
        let mut stack = [0u32; STACK];
        let mut top = usize::from(!self.nodes.is_empty());
        while top > 0 {
            top -= 1;
            let n = stack[top];
            let node = &self.nodes[n as usize];
            if !segment_meets_box(from, &direction, limit, &node.aabb) {
                continue;
            }
            if node.count == 0 {
                (stack[top], stack[top + 1]) = (node.at, n + 1);
                top += 2;
                continue;
            }
            for k in node.at as usize..(node.at + node.count) as usize {
                if let Some(parameter) = segment_meets_triangle(from, &direction, &self.corners[k])
                    && parameter <= limit
                {
                    limit = found(Hit { triangle: self.order[k], parameter });
                }
            }
        }
    }
}

/// No hit has a parameter up to this one.
const NOTHING_MORE: Real = -1.0;

fn segment_meets_box(from: &Point, direction: &Vector, limit: Real, b: &Aabb) -> bool {
    let (mut t0, mut t1) = (0.0, limit);
    for k in 0..3 {
        if direction[k] == 0.0 {
            if from[k] < b.min[k] || from[k] > b.max[k] {
                return false;
            }
            continue;
        }
        let inverse = 1.0 / direction[k];
        let (u, v) = ((b.min[k] - from[k]) * inverse, (b.max[k] - from[k]) * inverse);
        t0 = Real::max(t0, u.min(v));
        t1 = Real::min(t1, u.max(v));
    }
    t0 <= t1
}

/// Möller and Trumbore 1997, both sides.
fn segment_meets_triangle(
    from: &Point,
    direction: &Vector,
    [a, b, c]: &[Point; 3],
) -> Option<Real> {
    let (e1, e2) = (b - a, c - a);
    let h = direction.cross(&e2);
    let det = e1.dot(&h);
    if det == 0.0 {
        return None;
    }
    let inverse = 1.0 / det;
    let s = from - a;
    let u = s.dot(&h) * inverse;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let q = s.cross(&e1);
    let v = direction.dot(&q) * inverse;
    if v < 0.0 || u + v > 1.0 {
        return None;
    }
    let t = e2.dot(&q) * inverse;
    (0.0..=1.0).contains(&t).then_some(t)
}
