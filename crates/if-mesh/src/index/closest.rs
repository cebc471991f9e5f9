//! Nearest points.

use super::{Bvh, STACK, corner_box};
use if_core::closest::{Closest, ClosestPoint, Feature, closest_on_triangle};
use if_core::math::{Point, Real, barycentric_point};

/// Upper bound of the distance of `p` from the triangle with these corners, in metres.
///
/// The slack exceeds the rounding of distances and of coordinates: a search for the nearest triangle
/// within the bound, of a mesh that has this one, finds the same as one without bound.
pub fn distance_bound(p: &Point, [a, b, c]: [&Point; 3]) -> Real {
    let (w, _) = closest_on_triangle(p, a, b, c);
    let distance = (p - barycentric_point([a, b, c], w)).norm();
    distance * (1.0 + 1e-9)
        + 1e-12 * (p.coords.amax() + a.coords.amax() + b.coords.amax() + c.coords.amax())
}

impl Bvh {
    /// The children `left` and `right` of a node in the order in which searches for the point nearest
    /// to `p` visit them, each with its squared distance.
    #[inline(always)]
    pub(super) fn children(&self, p: &Point, [left, right]: [u32; 2]) -> [(u32, Real); 2] {
        let with_distance = |n: u32| (n, self.nodes[n as usize].aabb.distance_squared(p));
        let (left, right) = (with_distance(left), with_distance(right));
        if left.1 <= right.1 { [left, right] } else { [right, left] }
    }
}

impl ClosestPoint for Bvh {
    fn closest(&self, p: &Point, max_distance: Real) -> Option<Closest> {
        if max_distance.is_nan() || max_distance < 0.0 {
            return None;
        }
        let mut limit = max_distance * max_distance;
        let mut best: Option<(usize, [Real; 3], Feature, Point)> = None;
        let mut stack = [(0u32, 0.0); STACK];
        let mut top = 0;
        let mut n = 0u32;
        if self.nodes.is_empty() || self.nodes[0].aabb.distance_squared(p) > limit {
            return None;
        }
        loop {
            let node = &self.nodes[n as usize];
            if node.count == 0 {
                // The nearer child first; the other waits on the stack.
                let [(near, dn), (far, df)] = self.children(p, [n + 1, node.at]);
                if df <= limit {
                    stack[top] = (far, df);
                    top += 1;
                }
                if dn <= limit {
                    n = near;
                    continue;
                }
            } else {
                for k in node.at as usize..(node.at + node.count) as usize {
                    // The box rules out most triangles. (Within rounding it decides which of two
                    // equally near ones is returned.)
                    if corner_box(&self.corners[k]).distance_squared(p) > limit * (1.0 + 1e-12) {
                        continue;
                    }
                    let [a, b, c] = &self.corners[k];
                    let (w, feature) = closest_on_triangle(p, a, b, c);
                    let q = barycentric_point([a, b, c], w);
                    let d = (p - q).norm_squared();
                    if d < limit || (d == limit && best.is_none()) {
                        limit = d;
                        best = Some((k, w, feature, q));
                    }
                }
            }
            loop {
                if top == 0 {
                    return best.map(|(k, barycentric, feature, point)| Closest {
                        point,
                        distance: limit.sqrt(),
                        triangle: self.order[k],
                        barycentric,
                        feature,
                    });
                }
                top -= 1;
                if stack[top].1 < limit || (best.is_none() && stack[top].1 <= limit) {
                    n = stack[top].0;
                    break;
                }
            }
        }
    }
}
