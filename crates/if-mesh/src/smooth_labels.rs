//! Votes made smooth over the surface, so that every vertex gets a label and hems become lines.
//!
//! For each label one field s over the surface that minimises
//!
//! ```text
//! ∫ d (s − votes/d)² + ℓ² |∇s|²        d: all votes of a vertex
//! (M D + ℓ² L) s = M votes             M: areas of vertices, L: Laplacian by cotangents, not below a floor
//! ```
//!
//! The matrix is symmetric and positive, and an M-matrix: s lies between 0 and 1 and, as the rows
//! of L sum to zero, the fields of all labels sum to 1. What no frame saw is filled in
//! harmonically; a piece of the mesh of which nothing was seen at all stays at zero, undecided.

use crate::votes::{LabelVotes, UNDECIDED, winner};
use if_core::edges::Edges;
use if_core::math::{Point, Real, area_vector};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// How smooth.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SmoothLabelParams {
    /// ℓ, in metres: how far one vote reaches. Where there are n votes everywhere it is ℓ/√n.
    pub length: Real,
    /// The solve ends where the residual is this share of the right-hand side.
    pub tolerance: Real,
    /// And fails after as many steps.
    pub max_steps: usize,
}

impl Default for SmoothLabelParams {
    /// 30 mm: the least wrong vertices over the scans and sequences of `docs/labels.md`.
    fn default() -> Self {
        Self { length: 0.03, tolerance: 1e-6, max_steps: 5000 }
    }
}

/// A field over the vertices for each label.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelScores {
    /// Number of labels, [`UNDECIDED`] among them.
    pub labels: usize,
    /// `scores[v · labels + label]`, from 0 to 1; zero for [`UNDECIDED`].
    pub scores: Vec<Real>,
}

impl LabelScores {
    /// The scores of a vertex, one for each label.
    ///
    /// # Panics
    ///
    /// If `vertex` is out of range.
    pub fn of(&self, vertex: usize) -> &[Real] {
        &self.scores[vertex * self.labels..(vertex + 1) * self.labels]
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.scores.len() / self.labels.max(1)
    }

    /// The label of each vertex: that of the highest score, the smaller one of equals;
    /// [`UNDECIDED`] without any.
    pub fn winners(&self) -> Vec<u8> {
        (0..self.vertices()).map(|v| winner(self.of(v))).collect()
    }
}

impl SmoothLabelParams {
    /// Whether all numbers make sense.
    ///
    /// # Errors
    ///
    /// The first that does not.
    pub fn validate(&self) -> Result<(), SmoothLabelError> {
        for (name, value) in [("length", self.length), ("tolerance", self.tolerance)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(SmoothLabelError::Param { name, value });
            }
        }
        Ok(())
    }
}

/// Why votes cannot be made smooth.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SmoothLabelError {
    /// Votes for another mesh.
    #[error("there are votes for {got} vertices, but the mesh has {expected}")]
    Vertices {
        /// Vertices with votes.
        got: usize,
        /// Vertices of the mesh.
        expected: usize,
    },
    /// A number of votes that is negative or not finite.
    #[error(
        "vertex {vertex} has {value} votes for label {label}; votes must be finite and not negative"
    )]
    Votes {
        /// The vertex.
        vertex: usize,
        /// The label.
        label: usize,
        /// The votes.
        value: Real,
    },
    /// A parameter out of range.
    #[error("parameter `{name}` is {value}; it must be finite and not negative")]
    Param {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: Real,
    },
    /// The solver did not get there.
    #[error(
        "label {label}: the residual is still {residual:.1e} after {steps} steps; allow more, or a larger tolerance"
    )]
    NotConverged {
        /// The label.
        label: usize,
        /// Steps done.
        steps: usize,
        /// The residual, as a share of the right-hand side.
        residual: Real,
    },
    /// The caller broke.
    #[error("the smoothing of the labels was cancelled")]
    Cancelled,
}

/// Solves for the smooth fields.
///
/// # Errors
///
/// Votes that do not fit or are no numbers, and a solve that does not converge.
pub fn smooth_labels(
    mesh: &TriMesh,
    votes: &LabelVotes,
    params: &SmoothLabelParams,
) -> Result<LabelScores, SmoothLabelError> {
    smooth_labels_watched(mesh, votes, params, &|_| ControlFlow::Continue(()))
}

/// A step of the solve, for progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SolveStep {
    /// The label.
    pub label: usize,
    /// Steps done, of [`SmoothLabelParams::max_steps`] at most.
    pub step: usize,
}

/// [`smooth_labels`], telling `watch` before each step of each label's solve. Labels are solved at the same time, each on some thread. `Break` ends
/// all of them.
///
/// # Errors
///
/// As [`smooth_labels`], and [`SmoothLabelError::Cancelled`].
pub fn smooth_labels_watched(
    mesh: &TriMesh,
    votes: &LabelVotes,
    params: &SmoothLabelParams,
    watch: &(dyn Fn(&SolveStep) -> ControlFlow<()> + Sync),
) -> Result<LabelScores, SmoothLabelError> {
    let n = mesh.vertices().len();
    votes.check(n)?;
    let k = votes.labels;
    params.validate()?;
    let areas = vertex_areas(mesh);
    let matrix = Matrix::new(mesh, votes, &areas, params.length);
    let fields: Vec<Result<Vec<Real>, SmoothLabelError>> = (1..k)
        .into_par_iter()
        .map(|label| {
            let right: Vec<Real> = (0..n).map(|v| areas[v] * votes.of(v)[label]).collect();
            let solved = matrix.solve(&right, params.tolerance, params.max_steps, &|step| {
                watch(&SolveStep { label, step })
            });
            solved.map_err(|fault| match fault {
                Unsolved::Slow { steps, residual } => {
                    SmoothLabelError::NotConverged { label, steps, residual }
                }
                Unsolved::Cancelled => SmoothLabelError::Cancelled,
            })
        })
        .collect();
    let mut scores = vec![0.0; n * k];
    // Of several that fail the first label is told, whichever was done first.
    for (label, field) in fields.into_iter().enumerate() {
        for (v, s) in field?.iter().enumerate() {
            // The tolerance of the solve lets a value leave its range by as much.
            scores[v * k + label + 1] = s.clamp(0.0, 1.0);
        }
    }
    debug_assert!(scores.iter().step_by(k).all(|s| *s == 0.0), "{UNDECIDED} has no score");
    Ok(LabelScores { labels: k, scores })
}

impl LabelVotes {
    /// Whether these are votes for so many vertices.
    pub(crate) fn check(&self, vertices: usize) -> Result<(), SmoothLabelError> {
        if self.vertices() != vertices {
            return Err(SmoothLabelError::Vertices { got: self.vertices(), expected: vertices });
        }
        match self.weights.iter().position(|w| !(w.is_finite() && *w >= 0.0)) {
            None => Ok(()),
            Some(at) => {
                let (vertex, label) = (at / self.labels, at % self.labels);
                Err(SmoothLabelError::Votes { vertex, label, value: self.weights[at] })
            }
        }
    }
}

/// A third of the area of the triangles round each vertex.
pub(crate) fn vertex_areas(mesh: &TriMesh) -> Vec<Real> {
    let mut areas = vec![0.0; mesh.vertices().len()];
    for (t, tri) in mesh.triangles().iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        let third = area_vector(a, b, c).norm() / 6.0;
        tri.iter().for_each(|v| areas[*v as usize] += third);
    }
    areas
}

/// Least weight of an edge; that of an edge between equilateral triangles is 0.58. Obtuse triangles
/// have negative cotangents, which would let fields leave their range; ten times less would nearly
/// cut slivers off, ten times more would make everything the graph's Laplacian.
const FLOOR: Real = 0.05;
/// And the largest: a needle's cotangent is unbounded, and would tie its short side together before
/// all else anyway.
const CEILING: Real = 50.0;

/// The cotangent of the angle at `at`; zero in a degenerate triangle.
fn cotangent(at: &Point, a: &Point, b: &Point) -> Real {
    let (u, v) = (a - at, b - at);
    let sine = u.cross(&v).norm();
    if sine > 0.0 { u.dot(&v) / sine } else { 0.0 }
}

/// For each edge the length of its dual edge as a share of its own: half the sum of the cotangents
/// opposite, between
/// [`FLOOR`] and [`CEILING`].
pub(crate) fn dual_weights(mesh: &TriMesh, edges: &Edges) -> Vec<Real> {
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

/// Why there is no solution.
enum Unsolved {
    /// Not after so many steps.
    Slow { steps: usize, residual: Real },
    /// The caller broke.
    Cancelled,
}

/// A symmetric matrix in compressed rows, the diagonal apart.
struct Matrix {
    entries: Rows<(u32, Real)>,
    diagonal: Vec<Real>,
}

impl Matrix {
    fn new(mesh: &TriMesh, votes: &LabelVotes, areas: &[Real], length: Real) -> Self {
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
        Self { entries, diagonal }
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

    /// Conjugate gradients, preconditioned by the diagonal, from zero. Pieces without votes have no
    /// right-hand side and stay at zero.
    fn solve(
        &self,
        right: &[Real],
        tolerance: Real,
        max_steps: usize,
        watch: &dyn Fn(usize) -> ControlFlow<()>,
    ) -> Result<Vec<Real>, Unsolved> {
        let dot = |a: &[Real], b: &[Real]| a.iter().zip(b).map(|(x, y)| x * y).sum::<Real>();
        let mut x = vec![0.0; right.len()];
        let size = dot(right, right).sqrt();
        if size == 0.0 {
            return Ok(x);
        }
        let inverse: Vec<Real> =
            self.diagonal.iter().map(|d| if *d > 0.0 { 1.0 / d } else { 0.0 }).collect();
        let mut r = right.to_vec();
        let mut z: Vec<Real> = r.iter().zip(&inverse).map(|(r, i)| r * i).collect();
        let mut p = z.clone();
        let mut q = vec![0.0; right.len()];
        let mut rz = dot(&r, &z);
        for step in 0..=max_steps {
            let residual = dot(&r, &r).sqrt() / size;
            if residual <= tolerance {
                return Ok(x);
            }
            if watch(step).is_break() {
                return Err(Unsolved::Cancelled);
            }
            self.product(&p, &mut q);
            let curvature = dot(&p, &q);
            if step == max_steps || curvature <= 0.0 {
                return Err(Unsolved::Slow { steps: step, residual });
            }
            let alpha = rz / curvature;
            for v in 0..x.len() {
                x[v] += alpha * p[v];
                r[v] -= alpha * q[v];
                z[v] = r[v] * inverse[v];
            }
            let next = dot(&r, &z);
            let beta = next / rz;
            rz = next;
            p.iter_mut().zip(&z).for_each(|(p, z)| *p = z + beta * *p);
        }
        unreachable!("the last step returns")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes::{icosphere, tube};

    fn exact(params: Real) -> SmoothLabelParams {
        SmoothLabelParams { length: params, tolerance: 1e-12, ..SmoothLabelParams::default() }
    }

    #[test]
    fn the_solve_agrees_with_a_dense_factorisation() {
        let mesh = icosphere(0.3, 2);
        let n = mesh.vertices().len();
        let of: Vec<u8> = (0..n).map(|v| (v * 7 % 4) as u8).collect();
        let votes = LabelVotes::from_labels(&of, 4);
        let scores = smooth_labels(&mesh, &votes, &exact(0.05)).unwrap();
        let areas = vertex_areas(&mesh);
        let matrix = Matrix::new(&mesh, &votes, &areas, 0.05);
        let mut dense = nalgebra::DMatrix::zeros(n, n);
        for v in 0..n {
            dense[(v, v)] = matrix.diagonal[v];
            matrix.entries.of(v).iter().for_each(|(w, a)| dense[(v, *w as usize)] = *a);
        }
        assert_eq!(dense, dense.transpose());
        let factor = nalgebra::Cholesky::new(dense).expect("the matrix is positive");
        for label in 1..4 {
            let right = nalgebra::DVector::from_fn(n, |v, _| areas[v] * votes.of(v)[label]);
            let wanted = factor.solve(&right);
            for v in 0..n {
                assert!(
                    (scores.of(v)[label] - wanted[v]).abs() < 1e-9,
                    "{} {}",
                    scores.of(v)[label],
                    wanted[v]
                );
            }
        }
        // All fields sum to one.
        for v in 0..n {
            assert!((scores.of(v).iter().sum::<Real>() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn between_two_votes_a_tube_is_filled_in_linearly() {
        // Votes for 1 below and for 2 above, none between: harmonic, so linear in the height.
        let mesh = tube(0.1, 1.0, 16, 20, false);
        let of: Vec<u8> = mesh
            .vertices()
            .iter()
            .map(|p| if p.y < 0.21 { 1 } else { 2 * u8::from(p.y > 0.79) })
            .collect();
        let mut votes = LabelVotes::from_labels(&of, 3);
        votes.weights.iter_mut().for_each(|w| *w *= 1e6); // votes that hold
        let scores = smooth_labels(&mesh, &votes, &exact(0.01)).unwrap();
        for (v, p) in mesh.vertices().iter().enumerate() {
            let wanted = ((p.y - 0.2) / 0.6).clamp(0.0, 1.0);
            // 20 rings: the one at 0.2 votes, and so does the one at 0.8.
            assert!(
                (scores.of(v)[2] - wanted).abs() < 1e-4,
                "y = {}: {} for {wanted}",
                p.y,
                scores.of(v)[2]
            );
        }
    }

    #[test]
    fn a_wrong_vertex_among_right_ones_is_outvoted_and_a_piece_without_votes_stays_undecided() {
        let (a, b) = (icosphere(0.2, 3), icosphere(0.1, 1));
        let n = a.vertices().len();
        let vertices = [a.vertices(), b.vertices()].concat();
        let triangles = a
            .triangles()
            .iter()
            .copied()
            .chain(b.triangles().iter().map(|t| t.map(|v| v + n as u32)))
            .collect();
        let mesh = TriMesh::new(vertices, triangles).unwrap();
        let of: Vec<u8> = (0..mesh.vertices().len())
            .map(|v| {
                if v >= n {
                    0
                } else if v % 9 == 0 {
                    2
                } else {
                    1
                }
            })
            .collect();
        let scores = smooth_labels(&mesh, &LabelVotes::from_labels(&of, 3), &exact(0.1)).unwrap();
        let winners = scores.winners();
        assert!(
            winners[..n].iter().all(|l| *l == 1) && winners[n..].iter().all(|l| *l == UNDECIDED)
        );
    }

    #[test]
    fn without_length_votes_stay_what_they_are_and_faults_are_named() {
        let mesh = icosphere(0.2, 1);
        let of: Vec<u8> = (0..mesh.vertices().len()).map(|v| 1 + (v % 3) as u8).collect();
        let votes = LabelVotes::from_labels(&of, 4);
        assert_eq!(smooth_labels(&mesh, &votes, &exact(0.0)).unwrap().winners(), of);
        let mut bad = votes.clone();
        bad.weights[6] = Real::NAN;
        let error = smooth_labels(&mesh, &bad, &exact(0.1)).unwrap_err();
        assert!(matches!(error, SmoothLabelError::Votes { vertex: 1, label: 2, .. }), "{error}");
        let few = LabelVotes::from_labels(&of[1..], 4);
        assert!(matches!(
            smooth_labels(&mesh, &few, &exact(0.1)),
            Err(SmoothLabelError::Vertices { .. })
        ));
        assert!(matches!(
            smooth_labels(&mesh, &votes, &exact(-1.0)),
            Err(SmoothLabelError::Param { name: "length", .. })
        ));
        let hurried = SmoothLabelParams { max_steps: 1, ..exact(0.3) };
        assert!(matches!(
            smooth_labels(&mesh, &votes, &hurried),
            Err(SmoothLabelError::NotConverged { steps: 1, .. })
        ));
        let broken = smooth_labels_watched(&mesh, &votes, &exact(0.3), &|at| match at {
            SolveStep { label: 2, step: 3 } => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        });
        assert_eq!(broken.unwrap_err(), SmoothLabelError::Cancelled);
        let empty = LabelVotes { labels: 3, weights: vec![] };
        assert_eq!(
            smooth_labels(&TriMesh::default(), &empty, &exact(0.1)).unwrap().scores,
            Vec::<Real>::new()
        );
    }
}
