//! Smoothing of votes over the surface, so that every vertex gets a label and borders become lines.
//!
//! For each label one field s over the surface minimises
//!
//! ```text
//! ∫ d (s − votes/d)² + ℓ² |∇s|²        d: all votes of a vertex
//! (M D + ℓ² L) s = M votes             M: areas of vertices, L: cotangent Laplacian with bounded weights
//! ```
//!
//! The matrix is symmetric, positive and an M-matrix: s lies between 0 and 1 and, as the rows of L
//! sum to zero, the fields of all labels sum to 1. Unseen surface is filled in harmonically; a
//! component of the mesh without any votes stays at zero, undecided.

use super::error::LabelError;
use super::laplacian::{ConjugateGradients, Matrix, NotConverged, vertex_areas};
use super::scores::LabelScores;
use super::votes::{LabelVotes, UNDECIDED};
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_core::monitor::{Monitor, Progress};
use if_core::parameter::ParameterError;
use rayon::prelude::*;

/// Parameters of [`smooth_labels`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SmoothLabelParams {
    /// ℓ, in metres: the range of one vote. With n votes everywhere it is ℓ/√n.
    pub length: Real,
    /// The solver stops when the residual is this share of the right-hand side.
    pub tolerance: Real,
    /// The solver fails after this many steps.
    pub max_steps: usize,
}

impl Default for SmoothLabelParams {
    /// 30 mm: the least wrong vertices over the scans and sequences of `docs/evidence/surfaces.md`.
    fn default() -> Self {
        Self { length: 0.03, tolerance: 1e-6, max_steps: 5000 }
    }
}

impl SmoothLabelParams {
    /// Checks that all parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for (name, x) in [("length", self.length), ("tolerance", self.tolerance)] {
            let valid = x.is_finite() && x >= 0.0;
            ParameterError::check(name, x, valid, "finite and not negative")?;
        }
        Ok(())
    }
}

/// Steps of all labels' solvers between two reports.
const STEPS: usize = 16;

/// Solves for the smooth scores of all labels, in parallel.
///
/// The monitor receives the stage `smooth` with the steps done, of
/// [`max_steps`](SmoothLabelParams::max_steps) at most.
///
/// # Errors
///
/// [`LabelError`]: votes of another mesh, negative or not finite; a parameter out of range; a solver
/// that does not converge; or cancelled.
pub fn smooth_labels(
    mesh: &TriMesh,
    votes: &LabelVotes,
    params: &SmoothLabelParams,
    monitor: &mut dyn Monitor,
) -> Result<LabelScores, LabelError> {
    let n = mesh.vertices().len();
    votes.check(n)?;
    let k = votes.labels;
    params.validate()?;
    let areas = vertex_areas(mesh);
    let matrix = Matrix::new(mesh, votes, &areas, params.length);
    let mut solvers: Vec<ConjugateGradients<'_>> = (1..k)
        .into_par_iter()
        .map(|label| {
            let right = (0..n).map(|v| areas[v] * votes.of(v)[label]).collect();
            ConjugateGradients::new(&matrix, right)
        })
        .collect();
    // All labels advance by some steps in parallel; then the monitor may cancel.
    for done in (0..).step_by(STEPS) {
        monitor.report(&Progress { done, ..Progress::stage("smooth") })?;
        let states: Vec<Result<bool, NotConverged>> = solvers
            .par_iter_mut()
            .map(|solver| solver.advance(STEPS, params.tolerance, params.max_steps))
            .collect();
        let mut converged = true;
        for (label, state) in (1..).zip(states) {
            converged &= state.map_err(|NotConverged { steps, residual }| {
                LabelError::NotConverged { label, steps, residual }
            })?;
        }
        if converged {
            break;
        }
    }
    let mut scores = vec![0.0; n * k];
    for (label, solver) in (1..).zip(&solvers) {
        for (v, s) in solver.solution().iter().enumerate() {
            // The tolerance lets a value leave its range slightly.
            scores[v * k + label] = s.clamp(0.0, 1.0);
        }
    }
    debug_assert!(scores.iter().step_by(k).all(|s| *s == 0.0), "{UNDECIDED} has no score");
    Ok(LabelScores { labels: k, scores })
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::monitor::{Cancelled, Silent};
    use if_core::shapes::meshes::{icosphere, tube};
    use std::ops::ControlFlow;

    fn exact(params: Real) -> SmoothLabelParams {
        SmoothLabelParams { length: params, tolerance: 1e-12, ..SmoothLabelParams::default() }
    }

    #[test]
    fn the_solution_agrees_with_a_dense_factorisation() {
        let mesh = icosphere(0.3, 2);
        let n = mesh.vertices().len();
        let of: Vec<u8> = (0..n).map(|v| (v * 7 % 4) as u8).collect();
        let votes = LabelVotes::from_labels(&of, 4);
        let scores = smooth_labels(&mesh, &votes, &exact(0.05), &mut Silent).unwrap();
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
    fn between_two_votes_the_scores_on_a_tube_are_linear() {
        // Votes for 1 below and for 2 above, none between: harmonic, so linear in the height.
        let mesh = tube(0.1, 1.0, 16, 20, false);
        let of: Vec<u8> = mesh
            .vertices()
            .iter()
            .map(|p| if p.y < 0.21 { 1 } else { 2 * u8::from(p.y > 0.79) })
            .collect();
        let mut votes = LabelVotes::from_labels(&of, 3);
        votes.weights.iter_mut().for_each(|w| *w *= 1e6); // votes that hold
        let scores = smooth_labels(&mesh, &votes, &exact(0.01), &mut Silent).unwrap();
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
    fn single_wrong_votes_are_corrected_and_components_without_votes_stay_undecided() {
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
        let votes = LabelVotes::from_labels(&of, 3);
        let scores = smooth_labels(&mesh, &votes, &exact(0.1), &mut Silent).unwrap();
        let winners = scores.winners();
        assert!(
            winners[..n].iter().all(|l| *l == 1) && winners[n..].iter().all(|l| *l == UNDECIDED)
        );
    }

    #[test]
    fn without_smoothing_the_votes_decide_and_errors_are_specific() {
        let mesh = icosphere(0.2, 1);
        let of: Vec<u8> = (0..mesh.vertices().len()).map(|v| 1 + (v % 3) as u8).collect();
        let votes = LabelVotes::from_labels(&of, 4);
        let error = |votes: &LabelVotes, params: &SmoothLabelParams| {
            smooth_labels(&mesh, votes, params, &mut Silent).unwrap_err()
        };
        let scores = smooth_labels(&mesh, &votes, &exact(0.0), &mut Silent).unwrap();
        assert_eq!(scores.winners(), of);
        let mut bad = votes.clone();
        bad.weights[6] = Real::NAN;
        assert!(matches!(
            error(&bad, &exact(0.1)),
            LabelError::Value { values: "votes", vertex: 1, label: 2, .. }
        ));
        let few = LabelVotes::from_labels(&of[1..], 4);
        assert!(matches!(error(&few, &exact(0.1)), LabelError::Vertices { .. }));
        let LabelError::Parameter(range) = error(&votes, &exact(-1.0)) else { panic!("another") };
        assert_eq!(range.name, "length");
        let hurried = SmoothLabelParams { max_steps: 1, ..exact(0.3) };
        assert!(matches!(error(&votes, &hurried), LabelError::NotConverged { steps: 1, .. }));
        let empty = LabelVotes { labels: 3, weights: vec![] };
        let none = smooth_labels(&TriMesh::default(), &empty, &exact(0.1), &mut Silent).unwrap();
        assert_eq!(none.scores, Vec::<Real>::new());
    }

    #[test]
    fn a_monitor_sees_the_steps_and_can_cancel() {
        let mesh = icosphere(0.2, 3);
        let of: Vec<u8> = (0..mesh.vertices().len()).map(|v| 1 + (v % 3) as u8).collect();
        let votes = LabelVotes::from_labels(&of, 4);
        let mut seen = Vec::new();
        let cancelled = smooth_labels(&mesh, &votes, &exact(0.3), &mut |p: &Progress<'_>| {
            seen.push(p.done);
            if p.done > STEPS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(cancelled, Err(LabelError::Cancelled(Cancelled)));
        assert_eq!(seen, [0, STEPS, 2 * STEPS]);
    }
}
