//! Nearest points of queries that move little: of the few triangles near the last one, without a
//! search.

use super::{Bvh, STACK, corner_box};
use if_core::closest::{Closest, ClosestPoint, Feature, closest_on_triangle};
use if_core::math::{Point, Real, barycentric_point};

/// Maximum number of triangles that are kept: more than the six that meet at most vertices. With
/// fewer these would leave no room for others, and each motion would end in a search.
const KEPT: usize = 8;

/// Triangles are kept that are farther than the nearest one by less than this, in metres: a query may
/// move as far along the surface. Ten times more keeps triangles that are never nearest, and ten
/// times less is used up by one step of cloth.
const RESERVE: Real = 2e-3;

/// The triangles of a tree near a point. They answer queries near that point.
#[derive(Clone, Debug)]
pub struct Nearby {
    center: Point,
    /// All triangles nearer to `center` than this are kept, in metres.
    radius: Real,
    count: usize,
    /// Places of the triangles in leaf order, the nearest first.
    places: [u32; KEPT],
}

impl Default for Nearby {
    /// Answers no query.
    fn default() -> Self {
        Self { center: Point::origin(), radius: 0.0, count: 0, places: [0; KEPT] }
    }
}

/// The nearest triangle so far.
struct Best {
    place: u32,
    squared: Real,
    barycentric: [Real; 3],
    feature: Feature,
    point: Point,
}

impl Bvh {
    /// The same result as [`closest`](ClosestPoint::closest), without a search if `nearby` was filled
    /// by a query close to `p`. Else it searches, and fills `nearby` if `fill`: that takes longer,
    /// and pays if later queries are close to `p`. `bound` returns the distance of a triangle from
    /// `p` or more, such as infinity; a search begins with it.
    ///
    /// The tree must be the one that filled `nearby`, and not have been refitted since.
    pub fn closest_nearby(
        &self,
        p: &Point,
        max_distance: Real,
        bound: impl FnOnce() -> Real,
        (nearby, fill): (&mut Nearby, bool),
    ) -> Option<Closest> {
        if max_distance.is_nan() || max_distance < 0.0 {
            return None;
        }
        let sure = nearby.radius - (p - nearby.center).norm();
        match self.closest_of(p, max_distance, sure, nearby) {
            Ok(found) => found,
            Err(limit) => {
                let limit = max_distance.min(limit.unwrap_or_else(bound));
                if fill { self.search_nearby(p, limit, nearby) } else { self.closest(p, limit) }
            }
        }
    }

    /// The nearest point within `max_distance` of `p`, if it is on a triangle that is kept: all
    /// others are at least `sure` away. Else an error: a distance up to which to search, if one is
    /// known.
    fn closest_of(
        &self,
        p: &Point,
        max_distance: Real,
        sure: Real,
        nearby: &Nearby,
    ) -> Result<Option<Closest>, Option<Real>> {
        let best = if sure > 0.0 { self.nearest_of(p, nearby) } else { None };
        match best {
            Some(best) if best.squared.sqrt() < sure => {
                let is_near = best.squared <= max_distance * max_distance;
                Ok(is_near.then(|| self.found(&best)))
            }
            _ if max_distance < sure => Ok(None),
            // More by more than the rounding of a square root.
            Some(best) => Err(Some(best.squared.sqrt() * (1.0 + 1e-9))),
            None => Err(None),
        }
    }

    fn found(&self, best: &Best) -> Closest {
        Closest {
            point: best.point,
            distance: best.squared.sqrt(),
            triangle: self.order[best.place as usize],
            barycentric: best.barycentric,
            feature: best.feature,
        }
    }

    /// The nearest of those kept; of equally near ones the one that a search visits first.
    fn nearest_of(&self, p: &Point, nearby: &Nearby) -> Option<Best> {
        let mut best: Option<Best> = None;
        for &place in &nearby.places[..nearby.count] {
            let corners = &self.corners[place as usize];
            let limit = best.as_ref().map_or(Real::INFINITY, |b| b.squared);
            if corner_box(corners).distance_squared(p) > limit * (1.0 + 1e-12) {
                continue;
            }
            let candidate = measured(p, place, corners);
            if candidate.squared < limit
                || (candidate.squared == limit
                    && best.as_ref().is_some_and(|b| self.is_visited_before(p, place, b.place)))
            {
                best = Some(candidate);
            }
        }
        best
    }

    /// Whether a search for the point nearest to `p` visits the triangle at place `i` before that at
    /// `j`.
    fn is_visited_before(&self, p: &Point, i: u32, j: u32) -> bool {
        let (low, high) = (i.min(j), i.max(j));
        let (mut node, mut first, mut count) = (0u32, 0u32, self.order.len() as u32);
        while self.nodes[node as usize].count == 0 {
            let (left, right) = (node + 1, self.nodes[node as usize].at);
            // As `build` splits.
            let middle = first + count / 2;
            if high < middle {
                (node, count) = (left, count / 2);
            } else if low >= middle {
                (node, first, count) = (right, middle, count - count / 2);
            } else {
                let [(visited_first, _), _] = self.children(p, [left, right]);
                return (visited_first == left) == (i < j);
            }
        }
        i < j
    }

    /// As [`closest`](ClosestPoint::closest), in the same order; keeps what is near.
    fn search_nearby(&self, p: &Point, max_distance: Real, nearby: &mut Nearby) -> Option<Closest> {
        let largest = max_distance * max_distance;
        let mut best: Option<Best> = None;
        // Squared distances up to which triangles are kept.
        let widened = |distance: Real| (distance + RESERVE) * (distance + RESERVE);
        let mut limit = widened(max_distance);
        let mut kept = [(Real::INFINITY, 0u32); KEPT];
        let (mut count, mut dropped) = (0, Real::INFINITY);
        let mut stack = [(0u32, 0.0); STACK];
        let mut top = 0;
        if !self.nodes.is_empty() {
            stack[0] = (0, self.nodes[0].aabb.distance_squared(p));
            top = 1;
        }
        while top > 0 {
            top -= 1;
            let (mut n, distance) = stack[top];
            if distance > limit {
                continue;
            }
            loop {
                let node = &self.nodes[n as usize];
                if node.count > 0 {
                    break;
                }
                let [(near, dn), (far, df)] = self.children(p, [n + 1, node.at]);
                if df <= limit {
                    stack[top] = (far, df);
                    top += 1;
                }
                n = near;
                if dn > limit {
                    break;
                }
            }
            let node = &self.nodes[n as usize];
            for place in node.at..if node.count > 0 { node.at + node.count } else { node.at } {
                let corners = &self.corners[place as usize];
                if corner_box(corners).distance_squared(p) > limit * (1.0 + 1e-12) {
                    continue;
                }
                let found = measured(p, place, corners);
                if found.squared <= limit {
                    let at = kept[..count].partition_point(|k| k.0 <= found.squared);
                    if count == KEPT {
                        dropped = Real::min(dropped, kept[KEPT - 1].0.max(found.squared));
                    }
                    if at < KEPT {
                        count = (count + 1).min(KEPT);
                        kept[at..count].rotate_right(1);
                        kept[at] = (found.squared, place);
                    }
                }
                if found.squared <= largest
                    && best.as_ref().is_none_or(|b| found.squared < b.squared)
                {
                    limit = limit.min(widened(found.squared.sqrt()));
                    best = Some(found);
                }
            }
        }
        nearby.center = *p;
        // Less by more than the rounding of distances and of coordinates.
        nearby.radius =
            limit.min(dropped).sqrt() * (1.0 - 1e-9) - 1e-12 * (p.coords.amax() + self.extent());
        nearby.count = count;
        nearby.places = kept.map(|k| k.1);
        best.map(|best| self.found(&best))
    }

    /// The largest coordinate.
    fn extent(&self) -> Real {
        self.nodes.first().map_or(0.0, |n| n.aabb.min.coords.amax().max(n.aabb.max.coords.amax()))
    }
}

fn measured(p: &Point, place: u32, [a, b, c]: &[Point; 3]) -> Best {
    let (barycentric, feature) = closest_on_triangle(p, a, b, c);
    let point = barycentric_point([a, b, c], barycentric);
    Best { place, squared: (p - point).norm_squared(), barycentric, feature, point }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::{icosphere, tube};

    /// Points on walks of different steps near and far from a ball, each with its tree.
    fn agree(mesh: &TriMesh, size: Real, step: Real) -> (usize, usize) {
        let tree = Bvh::new(mesh);
        let (mut searches, mut found) = (0, 0);
        for walk in 0..40u32 {
            let noise = |k: u32, m: u32| Real::from((k * m + walk * 7919) % 1009) / 1009.0 - 0.5;
            let mut p = Point::from(Vector::new(noise(1, 91), noise(2, 57), noise(3, 23)) * size);
            let mut nearby = Nearby::default();
            for k in 0..60 {
                p += Vector::new(noise(k, 37), noise(k, 101), noise(k, 613)) * step;
                let reach = [0.0, 0.01, 0.3, Real::INFINITY][(k % 4) as usize];
                let (expected, filled) = (tree.closest(&p, reach), nearby.center);
                let bound = || expected.map_or(Real::INFINITY, |c| c.distance * (1.0 + 1e-9));
                let list = (&mut nearby, k % 5 != 0);
                assert_eq!(tree.closest_nearby(&p, reach, bound, list), expected, "{p}");
                searches += usize::from(nearby.center != filled);
                found += usize::from(expected.is_some());
            }
        }
        (searches, found)
    }

    #[test]
    fn a_walk_gives_what_searches_give() {
        for step in [1e-4, 2e-3, 0.1] {
            let (searches, found) = agree(&icosphere(0.2, 3), 0.5, step);
            assert!(found > 600 && (step > 0.01 || searches < 600), "{searches} {found}");
        }
    }

    #[test]
    fn equally_near_triangles_are_chosen_as_in_a_search() {
        // Corners and edges of a flat tube are nearest to many points; triangles come twice.
        let one = tube(0.1, 0.2, 6, 9, false);
        let twice = [one.triangles(), one.triangles()].concat();
        let mesh = TriMesh::new(one.vertices().to_vec(), twice).unwrap();
        for step in [0.0, 1e-4, 1e-3] {
            agree(&mesh, 0.4, step);
        }
        for v in one.vertices() {
            let (tree, mut nearby) = (Bvh::new(&mesh), Nearby::default());
            for k in 0..5 {
                let p = v + Vector::new(v.x, 0.0, v.z) * 0.01 * Real::from(k);
                let found = tree.closest_nearby(&p, 1.0, || Real::INFINITY, (&mut nearby, true));
                assert_eq!(found, tree.closest(&p, 1.0), "{p}");
            }
        }
    }

    #[test]
    fn many_triangles_in_one_place_are_searched() {
        let corners = [Point::origin(), Point::new(1e-3, 0.0, 0.0), Point::new(0.0, 1e-3, 0.0)];
        let mesh = TriMesh::new(corners.to_vec(), vec![[0, 1, 2]; 3 * KEPT]).unwrap();
        let (searches, _) = agree(&mesh, 0.01, 1e-4);
        assert!(searches > 0);
        let empty = TriMesh::new(Vec::new(), Vec::new()).unwrap();
        agree(&empty, 1.0, 0.1);
    }
}
