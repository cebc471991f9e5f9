//! The layer below a garment, as the air constraint sees it.

use if_core::closest::{Closest, ClosestPoint, Feature};
use if_core::edges::{Edges, NONE};
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;

/// The layer below: a mesh at rest, its nearest points, and the normals of its faces, edges and
/// vertices.
#[derive(Clone)]
pub struct InnerSurface<'a> {
    mesh: &'a TriMesh,
    closest: &'a dyn ClosestPoint,
    edges: Edges,
    /// For each vertex whether it lies on the border.
    border: Vec<bool>,
    faces: Vec<Vector>,
    vertices: Vec<Vector>,
}

impl std::fmt::Debug for InnerSurface<'_> {
    /// Numbers only: a search structure has no `Debug`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("InnerSurface").field("triangles", &self.faces.len()).finish_non_exhaustive()
    }
}

impl<'a> InnerSurface<'a> {
    /// `closest` must return nearest points of `mesh`.
    pub fn new(mesh: &'a TriMesh, closest: &'a dyn ClosestPoint) -> Self {
        let edges = Edges::new(mesh);
        Self {
            mesh,
            closest,
            border: edges.boundary_vertices(mesh.vertices().len()),
            edges,
            faces: mesh.face_normals(),
            vertices: mesh.vertex_normals(),
        }
    }

    /// The mesh.
    pub fn mesh(&self) -> &TriMesh {
        self.mesh
    }

    /// The nearest point, at most `max_distance` metres away.
    pub fn closest(&self, p: &Point, max_distance: Real) -> Option<Closest> {
        self.closest.closest(p, max_distance)
    }

    /// The outward unit normal at a nearest point: of the face, the mean of an edge's two faces, or
    /// the angle-weighted one of a vertex [Bærentzen and Aanæs 2005]. Zero where there is none.
    ///
    /// # Panics
    ///
    /// If `at` is not a nearest point of this mesh.
    pub fn normal(&self, at: &Closest) -> Vector {
        let t = at.triangle as usize;
        match at.feature {
            Feature::Face => self.faces[t],
            Feature::Edge(k) => {
                let [s, u] = self.edges.triangles[self.edges.of_triangle[t][k as usize] as usize];
                let second = if u == NONE { Vector::zeros() } else { self.faces[u as usize] };
                unit_or_zero(&(self.faces[s as usize] + second))
            }
            Feature::Vertex(k) => self.vertices[self.mesh.triangles()[t][k as usize] as usize],
        }
    }
}

impl InnerSurface<'_> {
    /// Whether `p`, whose nearest point is `at`, lies beyond the border of the surface: that point
    /// is on the border, and `p` is not straight above or below it.
    pub(crate) fn is_beyond_border(&self, at: &Closest, p: &Point) -> bool {
        let t = at.triangle as usize;
        let on_border = match at.feature {
            Feature::Face => false,
            Feature::Edge(k) => {
                self.edges.triangles[self.edges.of_triangle[t][k as usize] as usize][1] == NONE
            }
            Feature::Vertex(k) => self.border[self.mesh.triangles()[t][k as usize] as usize],
        };
        let (d, normal) = (p - at.point, self.normal(at));
        let slide = (d - normal * normal.dot(&d)).norm();
        let [a, b, c] = self.mesh.corners(t);
        let edge = (b - a).norm().max((c - b).norm()).max((a - c).norm());
        on_border && slide > STRAIGHT * edge
    }
}

/// A point whose offset from the border has a tangential part of at most this share of an edge is
/// above the border. Rounding is 1e-13 of an edge; ten times more or less changes nothing visible.
const STRAIGHT: Real = 1e-6;

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use if_core::closest::closest_on_triangle;
    use if_core::math::barycentric_point;

    /// The slow twin of an index: all triangles.
    pub(crate) struct All(pub(crate) TriMesh);
    impl ClosestPoint for All {
        fn closest(&self, p: &Point, max_distance: Real) -> Option<Closest> {
            let mut best: Option<Closest> = None;
            for t in 0..self.0.triangles().len() {
                let c = self.0.corners(t);
                let (barycentric, feature) = closest_on_triangle(p, c[0], c[1], c[2]);
                let point = barycentric_point(c, barycentric);
                let distance = (p - point).norm();
                if distance <= best.map_or(max_distance, |b| b.distance) {
                    best =
                        Some(Closest { point, distance, triangle: t as u32, barycentric, feature });
                }
            }
            best
        }
    }

    #[test]
    fn normals_at_edges_and_vertices_lie_between_those_of_their_faces() {
        let mesh = if_core::shapes::meshes::cuboid(Vector::repeat(1.0));
        let all = All(mesh);
        let inner = InnerSurface::new(&all.0, &all);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (p, n) in [
            (Point::new(2.0, 0.1, 0.2), Vector::x()),
            (Point::new(2.0, 2.0, 0.2), Vector::new(half, half, 0.0)),
            (Point::new(2.0, 2.0, 2.0), Vector::repeat(1.0 / 3.0f64.sqrt())),
        ] {
            let at = all.closest(&p, 10.0).unwrap();
            assert_relative_eq!(inner.normal(&at), n, epsilon = 1e-12);
        }
    }
}
