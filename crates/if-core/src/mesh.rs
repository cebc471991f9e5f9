//! Triangle meshes that are checked once, at construction.

mod parts;

pub use parts::{FinitePoints, Triangles};

use crate::aabb::Aabb;
use crate::math::{Point, Real, Vector, area_vector, unit_or_zero};
use rayon::prelude::*;

/// Minimum number of triangles of a task: they take about 30 µs, a task some µs.
const TASK: usize = 512;

/// Vertices and triangles. Every coordinate is finite, every index is in range, and the three
/// corners of a triangle are three different vertices. Nothing else is guaranteed: a mesh may be
/// open, of several pieces, non-manifold, or hold triangles of zero area.
///
/// # Examples
///
/// ```
/// use if_core::{math::Point, mesh::TriMesh};
/// let corner = TriMesh::new(
///     vec![Point::origin(), Point::new(1.0, 0.0, 0.0), Point::new(0.0, 1.0, 0.0)],
///     vec![[0, 1, 2]],
/// )?;
/// assert_eq!(corner.area(), 0.5);
/// # Ok::<(), if_core::mesh::MeshError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Default)]
pub struct TriMesh {
    vertices: Vec<Point>,
    triangles: Vec<[u32; 3]>,
}

/// Why vertices and triangles are not a valid mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex}: coordinate {} is {value}; every coordinate must be finite", ["x", "y", "z"][*axis])]
    NonFinite {
        /// Index of the vertex.
        vertex: usize,
        /// 0, 1 or 2 for x, y or z.
        axis: usize,
        /// The coordinate.
        value: Real,
    },
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {triangle}: corner {corner} names vertex {index}, but there are only {vertices} vertices (0 is the first)"
    )]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// 0, 1 or 2.
        corner: usize,
        /// The vertex it names.
        index: u32,
        /// How many there are.
        vertices: usize,
    },
    /// A triangle uses one vertex twice.
    #[error(
        "triangle {triangle} uses vertex {vertex} twice; drop it, or give it three different corners"
    )]
    RepeatedVertex {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex that it uses twice.
        vertex: u32,
    },
    /// More vertices than a 32-bit index can name.
    #[error("{vertices} vertices are more than 32-bit indices can name")]
    TooManyVertices {
        /// How many there are.
        vertices: usize,
    },
    /// New positions do not match the mesh they are for.
    #[error("{got} positions for a mesh of {expected} vertices")]
    VertexCount {
        /// Vertices of the mesh.
        expected: usize,
        /// Positions given.
        got: usize,
    },
}

impl TriMesh {
    /// Checks `vertices` (metres) and `triangles` (indices, counter-clockwise seen from outside),
    /// and keeps them.
    ///
    /// # Errors
    ///
    /// The first invalid entry, vertices before triangles.
    pub fn new(vertices: Vec<Point>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        let limit = parts::limit(&vertices)?;
        let vertices = FinitePoints::new(vertices)?;
        parts::check_triangles(&triangles, 0, limit)?;
        Ok(Self { vertices: vertices.into_vec(), triangles })
    }

    /// A mesh of parts that are checked already: nothing is checked twice.
    ///
    /// # Errors
    ///
    /// A triangle names a vertex that does not exist.
    pub fn from_parts(vertices: FinitePoints, triangles: Triangles) -> Result<Self, MeshError> {
        let limit = parts::limit(&vertices)?;
        triangles.check_below(limit)?;
        Ok(Self { vertices: vertices.into_vec(), triangles: triangles.into_vec() })
    }

    /// The same triangles with other positions.
    ///
    /// # Errors
    ///
    /// The number of positions is wrong, or a position is not finite.
    pub fn with_vertices(&self, vertices: Vec<Point>) -> Result<Self, MeshError> {
        self.check_positions(&vertices)?;
        Ok(Self { vertices, triangles: self.triangles.clone() })
    }

    /// Checks that there is one finite position for each vertex.
    ///
    /// # Errors
    ///
    /// As [`with_vertices`](Self::with_vertices).
    pub fn check_positions(&self, positions: &[Point]) -> Result<(), MeshError> {
        let (expected, got) = (self.vertices.len(), positions.len());
        if got != expected {
            return Err(MeshError::VertexCount { expected, got });
        }
        parts::check_finite(positions, 0)
    }

    /// The same mesh with all coordinates times `factor`: from other units to metres.
    ///
    /// # Errors
    ///
    /// A scaled coordinate is not finite.
    pub fn scaled(&self, factor: Real) -> Result<Self, MeshError> {
        self.with_vertices(self.vertices.iter().map(|p| p * factor).collect())
    }

    /// Positions, in metres.
    #[inline]
    pub fn vertices(&self) -> &[Point] {
        &self.vertices
    }

    /// Corner indices of each triangle.
    #[inline]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The corners of triangle `t`.
    ///
    /// # Panics
    ///
    /// If `t` is out of range.
    #[inline]
    pub fn corners(&self, t: usize) -> [&Point; 3] {
        let [a, b, c] = self.triangles[t];
        [&self.vertices[a as usize], &self.vertices[b as usize], &self.vertices[c as usize]]
    }

    /// The box around all vertices, used by a triangle or not.
    pub fn aabb(&self) -> Aabb {
        Aabb::from_points(&self.vertices)
    }

    /// The box around the vertices that a triangle uses.
    pub fn surface_aabb(&self) -> Aabb {
        Aabb::from_points(self.triangles.as_flattened().iter().map(|v| &self.vertices[*v as usize]))
    }

    /// The vertices that a triangle uses.
    pub fn surface_vertices(&self) -> impl Iterator<Item = &Point> {
        let used = self.used_vertices().into_iter();
        self.vertices.iter().zip(used).filter_map(|(p, is_used)| is_used.then_some(p))
    }

    /// For each vertex, whether a triangle uses it.
    pub fn used_vertices(&self) -> Vec<bool> {
        let mut used = vec![false; self.vertices.len()];
        self.triangles.as_flattened().iter().for_each(|v| used[*v as usize] = true);
        used
    }

    /// Which triangles are `marked`, or share a vertex with one that is.
    ///
    /// # Panics
    ///
    /// If there are fewer marks than triangles.
    pub fn with_neighbours(&self, marked: &[bool]) -> Vec<bool> {
        assert!(marked.len() >= self.triangles.len(), "a mark for each triangle");
        let mut at = vec![false; self.vertices.len()];
        for (corners, _) in self.triangles.iter().zip(marked).filter(|(_, marked)| **marked) {
            corners.iter().for_each(|v| at[*v as usize] = true);
        }
        self.triangles.iter().map(|corners| corners.iter().any(|v| at[*v as usize])).collect()
    }

    /// Sum of the triangles' areas, in square metres.
    pub fn area(&self) -> Real {
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                0.5 * area_vector(a, b, c).norm()
            })
            .sum()
    }

    /// Signed volume by the divergence theorem, in cubic metres. Meaningful for closed
    /// meshes only: positive where triangles wind counter-clockwise seen from outside.
    pub fn signed_volume(&self) -> Real {
        // A vertex of the surface: others may lie so far away that rounding would decide.
        let first = self.triangles.first().map(|t| self.vertices[t[0] as usize]);
        let o = first.unwrap_or_else(Point::origin);
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                (a - o).dot(&(b - o).cross(&(c - o))) / 6.0
            })
            .sum()
    }

    /// Mean length of the edges, in metres, where those between two triangles count twice; 0 without
    /// triangles.
    pub fn mean_edge(&self) -> Real {
        let mut sum = 0.0;
        for t in 0..self.triangles.len() {
            let [a, b, c] = self.corners(t);
            sum += (b - a).norm() + (c - b).norm() + (a - c).norm();
        }
        sum / (3 * self.triangles.len()).max(1) as Real
    }

    /// Unit normal of each triangle; zero for a degenerate one.
    pub fn face_normals(&self) -> Vec<Vector> {
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                unit_or_zero(&area_vector(a, b, c))
            })
            .collect()
    }

    /// Angle-weighted unit normal of each vertex; zero where no triangle gives one.
    ///
    /// # Source
    ///
    /// Bærentzen and Aanæs 2005: the weighting that makes the sign of the distance right.
    pub fn vertex_normals(&self) -> Vec<Vector> {
        let weighted = |t: usize| {
            let corners = self.corners(t);
            let n = unit_or_zero(&area_vector(corners[0], corners[1], corners[2]));
            [0, 1, 2].map(|k| {
                let u = unit_or_zero(&(corners[(k + 1) % 3] - corners[k]));
                let v = unit_or_zero(&(corners[(k + 2) % 3] - corners[k]));
                n * u.dot(&v).clamp(-1.0, 1.0).acos()
            })
        };
        let triangles = 0..self.triangles.len();
        let parts: Vec<_> = triangles.into_par_iter().with_min_len(TASK).map(weighted).collect();
        // Summed in the order of the triangles.
        let mut sums = vec![Vector::zeros(); self.vertices.len()];
        for (part, tri) in parts.iter().zip(&self.triangles) {
            (0..3).for_each(|k| sums[tri[k] as usize] += part[k]);
        }
        sums.iter().map(unit_or_zero).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Vec<Point> {
        vec![
            Point::origin(),
            Point::new(1.0, 0.0, 0.0),
            Point::new(1.0, 1.0, 0.0),
            Point::new(0.0, 1.0, 0.0),
        ]
    }

    #[test]
    fn errors_name_index_and_value() {
        let mut bad = square();
        bad[2].y = Real::NAN;
        assert!(matches!(
            TriMesh::new(bad, vec![]),
            Err(MeshError::NonFinite { vertex: 2, axis: 1, .. })
        ));
        assert_eq!(
            TriMesh::new(square(), vec![[0, 1, 2], [0, 2, 4]]),
            Err(MeshError::IndexOutOfRange { triangle: 1, corner: 2, index: 4, vertices: 4 })
        );
        assert_eq!(
            TriMesh::new(square(), vec![[0, 3, 3]]),
            Err(MeshError::RepeatedVertex { triangle: 0, vertex: 3 })
        );
        let mesh = TriMesh::new(square(), vec![[0, 1, 2]]).unwrap();
        assert_eq!(mesh.with_vertices(vec![]), Err(MeshError::VertexCount { expected: 4, got: 0 }));
        let text = TriMesh::new(square(), vec![[9, 1, 2]]).unwrap_err().to_string();
        assert!(text.contains("triangle 0") && text.contains('9') && text.contains('4'), "{text}");
    }

    #[test]
    fn normals_point_up_for_a_counter_clockwise_square() {
        let mesh = TriMesh::new(square(), vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        assert_eq!(mesh.area(), 1.0);
        for n in mesh.face_normals().iter().chain(&mesh.vertex_normals()) {
            approx::assert_relative_eq!(*n, Vector::z(), epsilon = 1e-15);
        }
    }

    #[test]
    fn an_empty_mesh_and_a_zero_area_triangle_are_meshes() {
        assert_eq!(TriMesh::new(vec![], vec![]).unwrap().area(), 0.0);
        let line = TriMesh::new(vec![Point::origin(); 3], vec![[0, 1, 2]]).unwrap();
        assert_eq!(line.vertex_normals(), vec![Vector::zeros(); 3]);
    }

    #[test]
    fn an_unused_vertex_far_away_changes_no_volume() {
        let ball = crate::shapes::meshes::icosphere(1.0, 2);
        let vertices = [&[Point::new(1e30, 1e30, 1e30)], ball.vertices()].concat();
        let triangles = ball.triangles().iter().map(|t| t.map(|v| v + 1)).collect();
        let with_stray = TriMesh::new(vertices, triangles).unwrap();
        assert_eq!(with_stray.signed_volume(), ball.signed_volume());
    }
}
