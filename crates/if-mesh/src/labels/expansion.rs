//! Labels of least energy by minimum cuts: the alternative to
//! [`smooth_labels`](super::smooth_labels) for short borders instead of smooth fields.
//!
//! ```text
//! E(f) = Σ_v A_v (d_v − votes_v(f_v)) + λ Σ_edges |dual edge| [f_a ≠ f_b]
//! ```
//!
//! with areas A and all votes d of a vertex: votes times square metres against λ times the length
//! of borders. For two labels one cut finds the least energy exactly. For more, each label in turn
//! expands over vertices of all others by one cut, until no expansion reduces the energy, which is
//! then at most twice the least one. Unseen surface has no cost, and gets the label with the
//! shortest border; a component of the mesh without any votes stays undecided.
//!
//! # Source
//!
//! Boykov, Veksler and Zabih 2001 (expansion moves); Kolmogorov and Zabih 2004 (the graph of a
//! move); Dinic 1970.

mod flow;

use super::error::LabelError;
use super::laplacian::{dual_weights, vertex_areas};
use super::scores::LabelScores;
use super::votes::LabelVotes;
use flow::Flow;
use if_core::edges::Edges;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_core::monitor::{Monitor, Progress};
use if_core::parameter::ParameterError;

/// Parameters of [`expand_labels`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpandParams {
    /// λ, in metres: a spot with one wrong vote is corrected if it is narrower than about 4 λ.
    pub border: Real,
    /// Maximum number of rounds over all labels.
    pub rounds: usize,
}

impl Default for ExpandParams {
    /// 5 mm; no known input takes 10 rounds.
    fn default() -> Self {
        Self { border: 0.005, rounds: 10 }
    }
}

/// Result of [`expand_labels`].
#[derive(Clone, Debug, PartialEq)]
pub struct Expanded {
    /// The label of each vertex.
    pub labels: Vec<u8>,
    /// Their energy, in votes times square metres.
    pub energy: Real,
    /// Rounds done.
    pub rounds: usize,
}

impl Expanded {
    /// Scores of 1 for the label of each vertex, for [`cut`](super::cut()), which then cuts edges at
    /// their midpoints.
    pub fn scores(&self, labels: usize) -> LabelScores {
        LabelScores { labels, scores: LabelVotes::from_labels(&self.labels, labels).weights }
    }
}

/// Energies are scaled to integers: the largest cost becomes this, so that sums over a million
/// vertices fit.
const SCALE: Real = 1e9;

/// Finds labels of least energy, starting from those with most votes.
///
/// The monitor receives the stage `expand`, a step for each expansion.
///
/// # Errors
///
/// [`LabelError`]: votes of another mesh, negative or not finite; a parameter out of range; or
/// cancelled.
pub fn expand_labels(
    mesh: &TriMesh,
    votes: &LabelVotes,
    params: &ExpandParams,
    monitor: &mut dyn Monitor,
) -> Result<Expanded, LabelError> {
    votes.check(mesh.vertices().len())?;
    let border = params.border;
    let valid = border.is_finite() && border >= 0.0;
    ParameterError::check("border", border, valid, "finite and not negative (m)")?;
    let problem = Problem::new(mesh, votes, params.border);
    let mut labels: Vec<u8> = (0..votes.vertices()).map(|v| votes.winner(v)).collect();
    let mut energy = problem.energy(&labels);
    for round in 0..params.rounds {
        let before = energy;
        for alpha in 1..votes.labels {
            let done = round * (votes.labels - 1) + alpha - 1;
            monitor.report(&Progress { done, ..Progress::stage("expand") })?;
            let moved = problem.expansion(&labels, alpha as u8);
            let reached = problem.energy(&moved);
            if reached < energy {
                (labels, energy) = (moved, reached);
            }
        }
        if energy == before {
            return Ok(Expanded { labels, energy: problem.value(energy), rounds: round + 1 });
        }
    }
    Ok(Expanded { labels, energy: problem.value(energy), rounds: params.rounds })
}

/// Costs as integers: sums do not depend on their order, and cuts terminate.
struct Problem {
    labels: usize,
    /// Cost of each vertex and label.
    cost: Vec<i64>,
    edges: Vec<([u32; 2], i64)>,
    /// Integers per vote times square metre.
    scale: Real,
}

impl Problem {
    fn new(mesh: &TriMesh, votes: &LabelVotes, border: Real) -> Self {
        let areas = vertex_areas(mesh);
        let edges = Edges::new(mesh);
        let costs: Vec<Real> = (0..votes.vertices())
            .flat_map(|v| {
                let all: Real = votes.of(v).iter().sum();
                let area = areas[v];
                votes.of(v).iter().map(move |w| area * (all - w))
            })
            .collect();
        let length = |(e, w): (usize, Real)| {
            let [a, b] = edges.vertices[e].map(|v| mesh.vertices()[v as usize]);
            border * w * (b - a).norm()
        };
        let lengths: Vec<Real> =
            dual_weights(mesh, &edges).into_iter().enumerate().map(length).collect();
        let largest = costs.iter().chain(&lengths).copied().fold(0.0, Real::max);
        let scale = if largest > 0.0 { SCALE / largest } else { 1.0 };
        let whole = |x: Real| (x * scale).round() as i64;
        Self {
            labels: votes.labels,
            cost: costs.into_iter().map(whole).collect(),
            edges: edges.vertices.iter().copied().zip(lengths.into_iter().map(whole)).collect(),
            scale,
        }
    }

    fn value(&self, energy: i64) -> Real {
        energy as Real / self.scale
    }

    fn energy(&self, labels: &[u8]) -> i64 {
        let data: i64 = labels
            .iter()
            .enumerate()
            .map(|(v, l)| self.cost[v * self.labels + usize::from(*l)])
            .sum();
        let cut =
            self.edges.iter().filter(|([a, b], _)| labels[*a as usize] != labels[*b as usize]);
        data + cut.map(|(_, w)| w).sum::<i64>()
    }

    /// The best labels that differ from `labels` only in vertices changed to `alpha`.
    fn expansion(&self, labels: &[u8], alpha: u8) -> Vec<u8> {
        let n = labels.len();
        // Cost of alpha minus that of the present label: nodes on the source's side keep their label.
        let cost = |v: usize, l: u8| self.cost[v * self.labels + usize::from(l)];
        let mut lead: Vec<i64> = (0..n).map(|v| cost(v, alpha) - cost(v, labels[v])).collect();
        let mut arcs: Vec<([u32; 2], i64)> = Vec::with_capacity(self.edges.len());
        for &([a, b], w) in &self.edges {
            let (p, q) = (a as usize, b as usize);
            let price = |differ: bool| if differ { w } else { 0 };
            // Costs if neither takes alpha, only b, only a. If both do, there is none.
            let (none, second, first) = (
                price(labels[p] != labels[q]),
                price(labels[p] != alpha),
                price(alpha != labels[q]),
            );
            lead[p] += first - none;
            lead[q] -= first;
            // Paid if a keeps its label and b takes alpha.
            arcs.push(([a, b], second + first - none));
        }
        let mut flow = Flow::new(n, &arcs, &lead);
        flow.run();
        let takes = flow.sink_side();
        labels.iter().zip(takes).map(|(l, takes)| if takes { alpha } else { *l }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::cut::{CutParams, cut};
    use super::super::votes::UNDECIDED;
    use super::*;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::{icosphere, tube};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    fn random_votes(n: usize, labels: usize, rng: &mut Pcg64Mcg) -> LabelVotes {
        let weight =
            |at: usize| if at.is_multiple_of(labels) { 0.0 } else { rng.random_range(0.0..2.0) };
        LabelVotes { labels, weights: (0..n * labels).map(weight).collect() }
    }

    /// The least energy of all labellings, by trying them.
    fn least(problem: &Problem, n: usize, labels: usize) -> i64 {
        let known = labels - 1;
        let labelling = |mut code: usize| -> Vec<u8> {
            let digit = |_| {
                let l = 1 + (code % known) as u8;
                code /= known;
                l
            };
            (0..n).map(digit).collect()
        };
        (0..known.pow(n as u32)).map(|code| problem.energy(&labelling(code))).min().unwrap()
    }

    #[test]
    fn two_labels_reach_the_least_energy_and_more_labels_stay_within_twice_it() {
        let mesh = icosphere(0.1, 0);
        let mut rng = Pcg64Mcg::seed_from_u64(11);
        for (border, labels) in [(0.0, 3), (0.002, 3), (0.01, 3), (0.02, 3), (0.2, 3), (0.02, 4)] {
            let votes = random_votes(12, labels, &mut rng);
            let problem = Problem::new(&mesh, &votes, border);
            let found = expand_labels(
                &mesh,
                &votes,
                &ExpandParams { border, ..Default::default() },
                &mut Silent,
            )
            .unwrap();
            let (got, wanted) = (problem.energy(&found.labels), least(&problem, 12, labels));
            assert!(
                got >= wanted && (got == wanted || (labels > 3 && got <= 2 * wanted)),
                "{labels}: {got} for {wanted}"
            );
            // No further expansion reduces the energy.
            for alpha in 1..labels as u8 {
                assert!(problem.energy(&problem.expansion(&found.labels, alpha)) >= got);
            }
        }
    }

    #[test]
    fn wrong_spots_vanish_and_the_border_stays() {
        let mesh = tube(0.1, 1.0, 32, 40, true);
        let truth: Vec<u8> = mesh.vertices().iter().map(|p| 1 + u8::from(p.y > 0.51)).collect();
        let noisy: Vec<u8> =
            truth.iter().enumerate().map(|(v, l)| if v % 9 == 4 { 3 - l } else { *l }).collect();
        let votes = LabelVotes::from_labels(&noisy, 3);
        let found = expand_labels(
            &mesh,
            &votes,
            &ExpandParams { border: 0.02, ..Default::default() },
            &mut Silent,
        )
        .unwrap();
        let wrong = found.labels.iter().zip(&truth).filter(|(a, b)| a != b).count();
        assert!(wrong <= 4, "{wrong} of {}", truth.len());
        let pieces = cut(&mesh, &found.scores(3), &CutParams::default()).unwrap();
        let loops = |k: usize| Edges::new(&pieces[k].mesh).boundary_loops(&pieces[k].mesh).len();
        assert_eq!((pieces.len(), loops(0), loops(1)), (2, 1, 1));
    }

    #[test]
    fn unseen_surface_is_filled_in_and_components_without_votes_stay_undecided() {
        let (a, b) = (icosphere(0.2, 2), icosphere(0.1, 0));
        let n = a.vertices().len();
        let triangles = a
            .triangles()
            .iter()
            .copied()
            .chain(b.triangles().iter().map(|t| t.map(|v| v + n as u32)))
            .collect();
        let mesh = TriMesh::new([a.vertices(), b.vertices()].concat(), triangles).unwrap();
        let of: Vec<u8> = (0..mesh.vertices().len())
            .map(|v| if v < n && v % 3 > 0 { 1 } else { UNDECIDED })
            .collect();
        let votes = LabelVotes::from_labels(&of, 3);
        let expand = |votes: &LabelVotes, params: &ExpandParams| {
            expand_labels(&mesh, votes, params, &mut Silent)
        };
        let found = expand(&votes, &ExpandParams::default()).unwrap();
        assert!(
            found.labels[..n].iter().all(|l| *l == 1)
                && found.labels[n..].iter().all(|l| *l == UNDECIDED)
        );
        assert_eq!(found.energy, 0.0);
        let bad = ExpandParams { border: Real::NAN, ..Default::default() };
        let LabelError::Parameter(error) = expand(&votes, &bad).unwrap_err() else {
            panic!("another error")
        };
        assert_eq!(error.name, "border");
        let few = LabelVotes::from_labels(&of[1..], 3);
        assert!(expand(&few, &ExpandParams::default()).is_err());
    }
}
