//! Angle-weighted pseudo-normals of faces, edges and vertices, and the boundary of a surface.

use if_core::closest::{Closest, Feature};
use if_core::edges::Edges;
use if_core::math::{Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use rayon::prelude::*;

/// For every feature on which a nearest point can lie, the normal that separates inside from outside
/// of a closed surface.
///
/// # Source
///
/// Bærentzen and Aanæs 2005, *Signed distance computation using the angle weighted pseudonormal*.
#[derive(Clone, Debug)]
pub struct PseudoNormals {
    faces: Vec<Vector>,
    edges: Vec<Vector>,
    vertices: Vec<Vector>,
    triangles: Vec<[u32; 3]>,
    edge_of: Vec<[u32; 3]>,
    boundary_edge: Vec<bool>,
    boundary_vertex: Vec<bool>,
}

impl PseudoNormals {
    /// Computes all normals of `mesh`.
    pub fn new(mesh: &TriMesh, edges: &Edges) -> Self {
        let boundary_edge = edges.valence.iter().map(|v| *v == 1).collect();
        let mut this = Self {
            faces: Vec::new(),
            edges: Vec::new(),
            vertices: Vec::new(),
            triangles: mesh.triangles().to_vec(),
            edge_of: edges.of_triangle.clone(),
            boundary_edge,
            boundary_vertex: edges.boundary_vertices(mesh.vertices().len()),
        };
        this.update(mesh);
        this
    }

    /// Follows moved vertices of the same triangles.
    pub fn update(&mut self, mesh: &TriMesh) {
        self.faces = (0..mesh.triangles().len())
            .into_par_iter()
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                unit_or_zero(&if_core::math::area_vector(a, b, c))
            })
            .collect();
        self.edges.clear();
        self.edges.resize(self.boundary_edge.len(), Vector::zeros());
        for (t, e) in self.edge_of.iter().enumerate() {
            for k in e {
                self.edges[*k as usize] += self.faces[t];
            }
        }
        self.vertices = mesh.vertex_normals();
        if self.edges.contains(&Vector::zeros()) {
            self.complete_edges();
        }
    }

    /// Gives an edge between two triangles without area the side of its ends.
    fn complete_edges(&mut self) {
        for (t, e) in self.edge_of.iter().enumerate() {
            for k in 0..3 {
                let edge = &mut self.edges[e[k] as usize];
                if *edge == Vector::zeros() {
                    let [from, to] = [k, (k + 1) % 3].map(|k| self.triangles[t][k] as usize);
                    *edge = self.vertices[from] + self.vertices[to];
                }
            }
        }
    }

    /// Unit normal of triangle `t`; zero if it is degenerate.
    #[inline]
    pub fn face(&self, t: u32) -> &Vector {
        &self.faces[t as usize]
    }

    /// Unit normal of vertex `v`.
    #[inline]
    pub fn vertex(&self, v: u32) -> &Vector {
        &self.vertices[v as usize]
    }

    /// The pseudo-normal at a nearest point, not of unit length on an edge.
    #[inline]
    pub fn at(&self, c: &Closest) -> Vector {
        let t = c.triangle as usize;
        match c.feature {
            Feature::Face => self.faces[t],
            Feature::Edge(k) => self.edges[self.edge_of[t][k as usize] as usize],
            Feature::Vertex(k) => self.vertices[self.triangles[t][k as usize] as usize],
        }
    }

    /// Whether a nearest point lies on the boundary of the surface, beyond which there is no side.
    #[inline]
    pub fn is_boundary(&self, c: &Closest) -> bool {
        let t = c.triangle as usize;
        match c.feature {
            Feature::Face => false,
            Feature::Edge(k) => self.boundary_edge[self.edge_of[t][k as usize] as usize],
            Feature::Vertex(k) => self.boundary_vertex[self.triangles[t][k as usize] as usize],
        }
    }

    /// +1 if `p` lies on the outer side of its nearest point `c`, −1 on the inner side, 0 on the
    /// surface.
    #[inline]
    pub fn side(&self, p: &if_core::math::Point, c: &Closest) -> Real {
        let s = (p - c.point).dot(&self.at(c));
        if s > 0.0 {
            1.0
        } else if s < 0.0 {
            -1.0
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Bvh;
    use if_core::closest::ClosestPoint;
    use if_core::math::Point;

    #[test]
    fn sides_of_a_thin_wedge_are_right_where_face_normals_would_fail() {
        // A tetrahedron with a sharp tip: beyond the tip, each face alone would err.
        let v = vec![
            Point::new(0.0, 0.0, 0.0),
            Point::new(1.0, 0.1, 0.0),
            Point::new(1.0, -0.1, 0.1),
            Point::new(1.0, -0.1, -0.1),
        ];
        let mesh = TriMesh::new(v, vec![[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]]).unwrap();
        assert!(mesh.signed_volume() > 0.0);
        let normals = PseudoNormals::new(&mesh, &Edges::new(&mesh));
        let bvh = Bvh::new(&mesh);
        for (p, expected) in [
            (Point::new(-0.5, 0.2, 0.1), 1.0),
            (Point::new(-0.1, -0.3, 0.0), 1.0),
            (Point::new(0.9, 0.0, 0.0), -1.0),
            (Point::new(0.2, 0.0, 0.0), -1.0),
            (Point::new(1.1, 0.0, 0.0), 1.0),
            (Point::new(0.0, 0.0, 0.0), 0.0),
        ] {
            let c = bvh.closest(&p, Real::INFINITY).unwrap();
            assert_eq!(normals.side(&p, &c), expected, "{p}");
            assert!(!normals.is_boundary(&c));
        }
    }

    #[test]
    fn the_rim_of_a_sheet_is_its_boundary() {
        let v = vec![Point::origin(), Point::new(1.0, 0.0, 0.0), Point::new(0.0, 1.0, 0.0)];
        let mesh = TriMesh::new(v, vec![[0, 1, 2]]).unwrap();
        let normals = PseudoNormals::new(&mesh, &Edges::new(&mesh));
        let bvh = Bvh::new(&mesh);
        let at = |x, y, z| bvh.closest(&Point::new(x, y, z), Real::INFINITY).unwrap();
        assert!(!normals.is_boundary(&at(0.2, 0.2, 0.5)));
        assert!(
            normals.is_boundary(&at(0.5, -1.0, 0.5)) && normals.is_boundary(&at(-1.0, -1.0, 0.0))
        );
    }
}
