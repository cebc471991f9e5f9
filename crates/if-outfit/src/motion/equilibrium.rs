//! The least displacement from the target that keeps all contacts: dual Gauss–Seidel.

use super::active::{Contacts, Moves, select_edges};
use super::contact::Contact;
use super::scene::Scene;
use if_core::math::{Point, Real, Vector, turned};
use nalgebra::Matrix3;
use std::collections::HashMap;

/// Sweeps between two measurements of what is violated.
const CHECK: usize = 5;
/// Over-relaxation of multipliers. Projected sweeps converge between 0 and 2; 1.9 overshoots where
/// contacts change.
const RELAXATION: Real = 1.6;
/// Sweeps of contacts alone at the end of a solve.
const LAST: usize = 4;

/// Multipliers of the last solution, from which the next solve starts.
#[derive(Clone, Debug, Default)]
pub(super) struct Multipliers {
    /// One for each edge, in the frame of the solution.
    edges: Vec<Vector>,
    contacts: HashMap<[u32; 4], Real>,
}

/// A contact by its vertices, and its multiplier.
pub(super) type Force = ([u32; 4], Real);

impl Multipliers {
    /// Those that are not zero: of edges by index, and of contacts, sorted.
    pub(super) fn parts(&self) -> (Vec<(u32, Vector)>, Vec<Force>) {
        let edges = (0u32..).zip(&self.edges).filter(|(_, m)| **m != Vector::zeros());
        let mut contacts: Vec<_> = self.contacts.iter().map(|(c, force)| (*c, *force)).collect();
        contacts.sort_unstable_by_key(|(c, _)| *c);
        (edges.map(|(k, m)| (k, *m)).collect(), contacts)
    }

    /// The multipliers of all edges, and of some contacts.
    pub(super) fn from_parts(edges: Vec<Vector>, contacts: Vec<Force>) -> Self {
        Self { edges, contacts: contacts.into_iter().collect() }
    }

    /// The vertices of contacts that push.
    pub(super) fn pushed(&self) -> impl Iterator<Item = u32> {
        self.contacts.keys().flatten().copied()
    }

    /// Replaces the multipliers of contacts.
    pub(super) fn replace_forces(&mut self, contacts: HashMap<[u32; 4], Real>) {
        self.contacts = contacts;
    }

    /// Turns them along with the surface.
    pub(super) fn turn(&mut self, scene: &Scene, turns: &[Matrix3<Real>]) {
        for (multiplier, edge) in self.edges.iter_mut().zip(&scene.edges) {
            if *multiplier != Vector::zeros() {
                *multiplier = turned(&turns[edge[0] as usize], multiplier);
            }
        }
    }
}

/// The result of a solve.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solved {
    pub(super) sweeps: usize,
    /// Largest violation that is left, in metres.
    pub(super) violation: Real,
}

/// Finds positions `x` near `target`:
///
/// ```text
/// min ½ Σ mᵥ |uᵥ|² + ½ Σ k |uᵢ − uⱼ|²   with  u = x − target   and   n · Σ cᵢ xᵢ ≥ gap  for all contacts
/// ```
///
/// The dual is solved by sweeps over edges and contacts, as XPBD does with compliance 1 / k and 0
/// [Macklin et al. 2016]: `x = target + M⁻¹ Jᵀ λ` throughout.
///
/// `w` are inverse masses; zero holds a vertex at its target. Contacts that cannot all be met push
/// without bound.
pub(super) fn solve(
    scene: &Scene,
    (target, w): (&[Point], &[Real]),
    contacts: &[Contact],
    start: &mut Multipliers,
    (most, x): (usize, &mut Vec<Point>),
) -> Solved {
    x.clear();
    x.extend_from_slice(target);
    start.edges.resize(scene.edges.len(), Vector::zeros());
    for (multiplier, edge) in start.edges.iter().zip(&scene.edges) {
        if *multiplier != Vector::zeros() {
            let [i, j] = edge.map(|v| v as usize);
            x[i] += multiplier * w[i];
            x[j] -= multiplier * w[j];
        }
    }
    // Each multiplier counts once, also where two contacts have the same vertices.
    let mut known = std::mem::take(&mut start.contacts);
    let forces = contacts.iter().map(|c| known.remove(&c.vertices).unwrap_or(0.0)).collect();
    let mut contacts = Contacts::new(contacts, w, forces, x);
    let mut solved = Solved { sweeps: 0, violation: Real::INFINITY };
    let (mut moves, mut moving) = (Moves::default(), Vec::new());
    while solved.sweeps < most {
        if solved.sweeps.is_multiple_of(CHECK) {
            moves.update(x);
            let (violation, is_met) = contacts.select(&moves, x);
            solved.violation = violation;
            select_edges(scene, (x, target), &start.edges, &moves, &mut moving);
            if is_met && moving.is_empty() {
                break;
            }
        }
        smooth(scene, (target, w), &moving, &mut start.edges, x);
        contacts.sweep(RELAXATION, x);
        solved.sweeps += 1;
    }
    for _ in 0..LAST {
        contacts.sweep(1.0, x);
    }
    moves.update(x);
    solved.violation = contacts.select(&moves, x).0;
    start.contacts = contacts.forces().collect();
    solved
}

/// One sweep over some edges, whose ends are to be displaced alike.
fn smooth(
    scene: &Scene,
    (target, w): (&[Point], &[Real]),
    moving: &[u32],
    multipliers: &mut [Vector],
    x: &mut [Point],
) {
    for k in moving.iter().map(|k| *k as usize) {
        let [i, j] = scene.edges[k].map(|v| v as usize);
        let compliance = scene.compliance[k];
        if w[i] + w[j] <= 0.0 {
            multipliers[k] = Vector::zeros();
            continue;
        }
        let difference = (x[i] - target[i]) - (x[j] - target[j]);
        let step =
            -(difference + multipliers[k] * compliance) * (RELAXATION / (w[i] + w[j] + compliance));
        x[i] += step * w[i];
        x[j] -= step * w[j];
        multipliers[k] += step;
    }
}
