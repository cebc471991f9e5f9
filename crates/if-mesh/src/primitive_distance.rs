//! The nearest two primitives of a mesh that share no vertex: what simulators with a barrier keep apart.
//!
//! Triangles that share a corner have such primitives, too: a vertex and the triangle across an edge, or
//! two edges that begin beside one another. In a sliver they are as near as it is thin.

use crate::least_distance::LeastDistance;
use crate::seams::weld_all;
use if_core::aabb::Aabb;
use if_core::distance::{DistanceBounds, triangle_distance};
use if_core::edges::VertexTriangles;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use serde::{Deserialize, Serialize};

/// Boxes are compared with the limit times this: rounding of a sum of squares never prunes the nearest
/// pair. At 1 it does; larger values measure more pairs.
const WIDER: Real = 1.0 + 1e-9;

/// The least distance of two primitives of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PrimitiveDistance {
    /// The distance of the nearest two, in metres.
    pub distance: Real,
    /// No two are nearer by more than this, in metres, with all rounding.
    pub error: Real,
    /// The nearest two, by vertices of the mesh.
    pub primitives: Primitives,
    /// Whether they belong to two triangles that share a corner: then one of these is thin, or folds over the
    /// other.
    pub are_neighbours: bool,
}

/// Two primitives that share no vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Primitives {
    /// A vertex, and the corners of a triangle.
    VertexTriangle(u32, [u32; 3]),
    /// The ends of two edges.
    Edges([u32; 2], [u32; 2]),
}

/// The least distance of a vertex and a triangle, or of two edges, that share no vertex, as in incremental
/// potential contact [Li et al. 2020]. Vertices at one position count as one.
///
/// `own` is the [`least_own_distance`](crate::least_distance::least_own_distance) of the mesh: that of
/// primitives whose triangles share no corner. `None` if there are no such two primitives, or two
/// triangles without a common corner intersect.
///
/// # Accuracy
///
/// [`PrimitiveDistance::error`] is computed, as that of [`LeastDistance`].
pub fn least_primitive_distance(
    mesh: &TriMesh,
    own: Option<&LeastDistance>,
) -> Option<PrimitiveDistance> {
    if own.is_some_and(|own| own.distance == 0.0) {
        return None;
    }
    let welded = weld_all(mesh);
    let welded = welded.as_ref().map_or(mesh, |welded| &welded.mesh);
    let mut search = Search {
        vertices: mesh.triangles(),
        triangles: welded.triangles(),
        x: welded.vertices(),
        lower: own.map_or(Real::INFINITY, |own| own.distance - own.error),
        limit: own.map_or(Real::INFINITY, |own| own.distance),
        nearest: None,
    };
    let fans = VertexTriangles::new(welded);
    for v in 0..welded.vertices().len() {
        let fan = fans.of(v);
        for (k, a) in fan.iter().enumerate() {
            fan[k + 1..].iter().for_each(|b| search.measure([*a, *b], v as u32));
        }
    }
    if let (None, Some(own)) = (search.nearest, own) {
        // The primitives of the nearest two triangles, which are measured again.
        search.limit = Real::INFINITY;
        search.measure_all(own.triangles);
        let primitives = search.nearest?;
        let LeastDistance { distance, error, .. } = *own;
        return Some(PrimitiveDistance { distance, error, primitives, are_neighbours: false });
    }
    let (distance, primitives) = (search.limit, search.nearest?);
    let error = distance - search.lower.min(distance);
    Some(PrimitiveDistance { distance, error, primitives, are_neighbours: true })
}

struct Search<'a> {
    /// For each triangle its vertices in the mesh.
    vertices: &'a [[u32; 3]],
    /// The same with one vertex for all at one position.
    triangles: &'a [[u32; 3]],
    x: &'a [Point],
    /// No two primitives so far are nearer.
    lower: Real,
    /// The distance of the nearest two.
    limit: Real,
    /// These.
    nearest: Option<Primitives>,
}

impl Search<'_> {
    /// Measures the primitives of two triangles in the fan of `v`; of two that share more corners, in that of
    /// the first of these.
    fn measure(&mut self, pair: [u32; 2], v: u32) {
        let [a, b] = pair.map(|t| self.triangles[t as usize]);
        if !a.iter().any(|w| *w < v && b.contains(w)) {
            self.measure_all(pair);
        }
    }

    /// Measures the primitives of two triangles that share no vertex.
    fn measure_all(&mut self, [i, j]: [u32; 2]) {
        for [i, j] in [[i, j], [j, i]] {
            let [a, b] = [i, j].map(|t| self.triangles[t as usize]);
            let corners = b.map(|v| self.x[v as usize]);
            for k in (0..3).filter(|k| !b.contains(&a[*k])) {
                let [of_i, of_j] = [i, j].map(|t| self.vertices[t as usize]);
                let primitives = Primitives::VertexTriangle(of_i[k], of_j);
                self.offer([[self.x[a[k] as usize]; 3], corners], primitives);
            }
        }
        let [a, b] = [i, j].map(|t| self.triangles[t as usize]);
        for k in 0..3 {
            let e = [a[k], a[(k + 1) % 3]];
            for m in 0..3 {
                let f = [b[m], b[(m + 1) % 3]];
                if !e.iter().any(|v| f.contains(v)) {
                    let ends = [e, f].map(|[p, q]| [p, q, q].map(|v| self.x[v as usize]));
                    let named = |t: u32, k: usize| {
                        let vertices = self.vertices[t as usize];
                        [vertices[k], vertices[(k + 1) % 3]]
                    };
                    self.offer(ends, Primitives::Edges(named(i, k), named(j, m)));
                }
            }
        }
    }

    /// Compares two primitives, each given as a triangle that may be a point or a line, with the nearest.
    fn offer(&mut self, [a, b]: [[Point; 3]; 2], primitives: Primitives) {
        let gap = Aabb::from_points(&a).gap_squared(&Aabb::from_points(&b));
        if gap > self.limit * self.limit * WIDER {
            return;
        }
        let DistanceBounds { lower, upper } = triangle_distance(a.each_ref(), b.each_ref());
        self.lower = self.lower.min(lower);
        if upper < self.limit {
            self.limit = upper;
            self.nearest = Some(primitives);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Bvh;
    use crate::least_distance::least_own_distance;
    use if_core::closest::closest_on_triangle;
    use if_core::edges::Edges;
    use if_core::math::barycentric_point;
    use if_core::random::SplitMix64;
    use if_core::shapes::meshes::icosphere;

    fn found(mesh: &TriMesh) -> Option<PrimitiveDistance> {
        least_primitive_distance(mesh, least_own_distance(&Bvh::new(mesh)).as_ref())
    }

    /// The slow twin: every vertex against every triangle, every edge against every edge.
    fn all(mesh: &TriMesh) -> Real {
        let (x, mut least) = (mesh.vertices(), Real::INFINITY);
        for t in mesh.triangles() {
            let [a, b, c] = t.map(|v| &x[v as usize]);
            for (_, p) in x.iter().enumerate().filter(|(v, _)| !t.contains(&(*v as u32))) {
                let weights = closest_on_triangle(p, a, b, c).0;
                least = least.min((barycentric_point([a, b, c], weights) - p).norm());
            }
        }
        let edges = Edges::new(mesh).vertices;
        for (k, e) in edges.iter().enumerate() {
            for f in edges[k + 1..].iter().filter(|f| !e.iter().any(|v| f.contains(v))) {
                let [a, b] = [e, f].map(|[p, q]| [p, q, q].map(|v| &x[*v as usize]));
                least = least.min(triangle_distance(a, b).upper);
            }
        }
        least
    }

    #[test]
    fn the_least_distance_is_that_of_all_primitives_without_a_common_vertex() {
        let mut slivers = 0;
        for seed in 0..12 {
            let mut random = SplitMix64::new(seed);
            let ball = icosphere(1.0, 2);
            let shake = if seed % 3 == 0 { 0.02 } else { 0.09 };
            let mut shaken = |p: &Point| {
                let by = [0; 3].map(|_| shake * (2.0 * random.unit() - 1.0));
                Point::new(p.x + by[0], p.y + by[1], 0.3 * p.z + by[2])
            };
            let mesh = ball.with_vertices(ball.vertices().iter().map(&mut shaken).collect());
            let mesh = mesh.unwrap();
            let Some(found) = found(&mesh) else { continue };
            let expected = all(&mesh);
            assert!((found.distance - expected).abs() < 1e-12, "{seed}: {found:?} {expected}");
            assert!(found.error < 1e-11 && found.error >= 0.0, "{found:?}");
            slivers += usize::from(found.are_neighbours);
        }
        assert!(slivers > 2 && slivers < 12, "{slivers}");
    }

    #[test]
    fn a_sliver_is_as_near_as_it_is_thin_and_is_named() {
        let p = |x: Real, y: Real| Point::new(x, y, 0.0);
        // The second triangle is 1e-8 high over the edge that it shares with the first.
        let x = vec![p(0.0, 0.0), p(1.0, 0.0), p(0.5, -1.0), p(0.4, 1e-8)];
        let mesh = TriMesh::new(x, vec![[0, 2, 1], [0, 1, 3]]).unwrap();
        assert_eq!(least_own_distance(&Bvh::new(&mesh)), None);
        let found = found(&mesh).unwrap();
        assert!((found.distance - 1e-8).abs() < 1e-14 && found.error < 1e-14, "{found:?}");
        // The height itself lies between the bounds.
        assert!((found.distance - found.error..=found.distance).contains(&1e-8), "{found:?}");
        assert!(found.are_neighbours);
        assert_eq!(found.primitives, Primitives::VertexTriangle(3, [0, 2, 1]));
    }

    #[test]
    fn doubled_vertices_along_a_seam_are_no_distance() {
        let p = |x: Real, y: Real| Point::new(x, y, 0.0);
        let x = vec![p(0., 0.), p(1., 0.), p(0., 1.), p(1., 0.), p(0., 1.), p(1., 1.)];
        let mesh = TriMesh::new(x, vec![[0, 1, 2], [3, 5, 4]]).unwrap();
        let found = found(&mesh).unwrap();
        // A corner over the seam.
        assert!((found.distance - Real::sqrt(0.5)).abs() < 1e-12, "{found:?}");
        let Primitives::VertexTriangle(vertex, _) = found.primitives else { panic!("{found:?}") };
        assert!([0, 5].contains(&vertex));
    }

    #[test]
    fn the_two_nearest_edges_are_named_by_their_vertices() {
        let p = |x: Real, y: Real, z: Real| Point::new(x, y, z);
        // An edge along x, and 0.1 over its middle one along y; the rest of both triangles leads
        // away. Each of the three edges comes first in its triangle once.
        let below = [p(-1., 0., 0.), p(1., 0., 0.), p(0., 0., -5.)];
        let above = [p(0., -1., 0.1), p(0., 1., 0.1), p(0., 0., 5.)];
        for first in 0..3 {
            for second in 0..3 {
                let turned = |k: usize| [0, 1, 2].map(|m| ((m + k) % 3) as u32);
                let triangles = vec![turned(first), turned(second).map(|v| v + 3)];
                let mesh = TriMesh::new([below, above].concat(), triangles).unwrap();
                let found = found(&mesh).unwrap();
                assert!((found.distance - 0.1).abs() < 1e-12, "{found:?}");
                assert_eq!(found.primitives, Primitives::Edges([0, 1], [3, 4]));
            }
        }
    }

    #[test]
    fn two_triangles_that_are_apart_are_named_and_those_that_intersect_are_not() {
        let p = |x: Real, y: Real, z: Real| Point::new(x, y, z);
        let with = |z: Real| {
            let x = vec![p(0., 0., 0.), p(1., 0., 0.), p(0., 1., 0.), p(0.2, 0.2, z)];
            let x = [x, vec![p(0.2, 0.2, 1.0), p(0.3, 0.2, 1.0)]].concat();
            found(&TriMesh::new(x, vec![[0, 1, 2], [3, 4, 5]]).unwrap())
        };
        let apart = with(0.25).unwrap();
        assert!((apart.distance - 0.25).abs() < 1e-14 && !apart.are_neighbours);
        assert_eq!(apart.primitives, Primitives::VertexTriangle(3, [0, 1, 2]));
        assert_eq!(with(-0.25), None);
    }
}
