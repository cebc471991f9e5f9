//! The cotangent Laplacian of a mesh, and the solver of its linear systems.

use super::votes::LabelVotes;
use if_core::edges::Edges;
use if_core::math::{Point, Real, area_vector};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;

/// A third of the area of the triangles around each vertex.
pub(super) fn vertex_areas(mesh: &TriMesh) -> Vec<Real> {
    let mut areas = vec![0.0; mesh.vertices().len()];
    for (t, tri) in mesh.triangles().iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        let third = area_vector(a, b, c).norm() / 6.0;
        tri.iter().for_each(|v| areas[*v as usize] += third);
    }
    areas
}

/// Least weight of an edge; between equilateral triangles it is 0.58. Obtuse triangles have negative
/// cotangents, with which fields would leave their range. A value ten times smaller would nearly
/// disconnect slivers, one ten times larger would result in the graph Laplacian.
const FLOOR: Real = 0.05;
/// Largest weight of an edge: the cotangents of needles are unbounded.
const CEILING: Real = 50.0;

/// The cotangent of the angle at `at`; zero in a degenerate triangle.
fn cotangent(at: &Point, a: &Point, b: &Point) -> Real {
    let (u, v) = (a - at, b - at);
    let sine = u.cross(&v).norm();
    if sine > 0.0 { u.dot(&v) / sine } else { 0.0 }
}

/// Cotangent weights: for each edge the length of its dual edge over its own, which is half the sum
/// of the opposite cotangents, between [`FLOOR`] and [`CEILING`].
pub(super) fn dual_weights(mesh: &TriMesh, edges: &Edges) -> Vec<Real> {
    let mut weights = vec![0.0; edges.len()];
    for (t, of) in edges.of_triangle.iter().enumerate() {
        let corners = mesh.corners(t);
        for k in 0..3 {
            // The edge from corner k to k + 1 lies opposite corner k + 2.
            weights[of[k] as usize] +=
                0.5 * cotangent(corners[(k + 2) % 3], corners[k], corners[(k + 1) % 3]);
        }
    }
    weights.iter().map(|w| w.clamp(FLOOR, CEILING)).collect()
}

/// A symmetric matrix in compressed rows, the diagonal apart.
pub(super) struct Matrix {
    pub(super) entries: Rows<(u32, Real)>,
    pub(super) diagonal: Vec<Real>,
    /// Inverse of the diagonal, zero for zero: the preconditioner.
    inverse: Vec<Real>,
}

impl Matrix {
    /// M D + ℓ² L, with ℓ = `length`.
    pub(super) fn new(mesh: &TriMesh, votes: &LabelVotes, areas: &[Real], length: Real) -> Self {
        let n = mesh.vertices().len();
        let edges = Edges::new(mesh);
        let weights = dual_weights(mesh, &edges);
        let mut diagonal: Vec<Real> =
            (0..n).map(|v| areas[v] * votes.of(v).iter().sum::<Real>()).collect();
        let links =
            edges.vertices.iter().zip(&weights).map(|(ends, w)| (*ends, length * length * w));
        for ([a, b], w) in links.clone() {
            diagonal[a as usize] += w;
            diagonal[b as usize] += w;
        }
        let entries = Rows::new(n, links.flat_map(|([a, b], w)| [(a, (b, -w)), (b, (a, -w))]));
        let inverse = diagonal.iter().map(|d| if *d > 0.0 { 1.0 / d } else { 0.0 }).collect();
        Self { entries, diagonal, inverse }
    }

    fn product(&self, x: &[Real], out: &mut [Real]) {
        for (v, out) in out.iter_mut().enumerate() {
            *out = self
                .entries
                .of(v)
                .iter()
                .fold(self.diagonal[v] * x[v], |sum, (w, a)| sum + a * x[*w as usize]);
        }
    }
}

/// A solve that does not converge.
pub(super) struct NotConverged {
    pub(super) steps: usize,
    /// Share of the right-hand side.
    pub(super) residual: Real,
}

/// Conjugate gradients, preconditioned by the diagonal, from zero. Components of the mesh without
/// votes have no right-hand side and stay at zero.
pub(super) struct ConjugateGradients<'a> {
    matrix: &'a Matrix,
    /// Norm of the right-hand side.
    size: Real,
    /// The solution.
    x: Vec<Real>,
    /// Residual, preconditioned residual, direction, and the matrix times the direction.
    r: Vec<Real>,
    z: Vec<Real>,
    p: Vec<Real>,
    q: Vec<Real>,
    rz: Real,
    steps: usize,
}

impl<'a> ConjugateGradients<'a> {
    pub(super) fn new(matrix: &'a Matrix, right: Vec<Real>) -> Self {
        let size = dot(&right, &right).sqrt();
        let z: Vec<Real> = right.iter().zip(&matrix.inverse).map(|(r, i)| r * i).collect();
        Self {
            matrix,
            size,
            x: vec![0.0; right.len()],
            rz: dot(&right, &z),
            p: z.clone(),
            q: vec![0.0; right.len()],
            r: right,
            z,
            steps: 0,
        }
    }

    /// Makes at most `count` steps. Returns whether the residual is at most `tolerance` times the
    /// right-hand side.
    ///
    /// # Errors
    ///
    /// After `max_steps` in all, or if the matrix is not positive along a direction.
    pub(super) fn advance(
        &mut self,
        count: usize,
        tolerance: Real,
        max_steps: usize,
    ) -> Result<bool, NotConverged> {
        if self.size == 0.0 {
            return Ok(true);
        }
        for _ in 0..count {
            let residual = dot(&self.r, &self.r).sqrt() / self.size;
            if residual <= tolerance {
                return Ok(true);
            }
            self.matrix.product(&self.p, &mut self.q);
            let curvature = dot(&self.p, &self.q);
            if self.steps == max_steps || curvature <= 0.0 {
                return Err(NotConverged { steps: self.steps, residual });
            }
            let alpha = self.rz / curvature;
            for v in 0..self.x.len() {
                self.x[v] += alpha * self.p[v];
                self.r[v] -= alpha * self.q[v];
                self.z[v] = self.r[v] * self.matrix.inverse[v];
            }
            let next = dot(&self.r, &self.z);
            let beta = next / self.rz;
            self.rz = next;
            self.p.iter_mut().zip(&self.z).for_each(|(p, z)| *p = z + beta * *p);
            self.steps += 1;
        }
        Ok(false)
    }

    pub(super) fn solution(&self) -> &[Real] {
        &self.x
    }
}

fn dot(a: &[Real], b: &[Real]) -> Real {
    a.iter().zip(b).map(|(x, y)| x * y).sum::<Real>()
}
