//! The least displacement from the target that keeps all contacts: dual Gauss–Seidel.

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
/// Violation of a contact, as a share of its gap, at which a solve ends. Verification decides; ten
/// times less takes a third more sweeps and changes nothing.
const TOLERANCE: Real = 0.1;
/// Distance beyond its gap, in metres, at which a contact is visited, until the next selection.
const AWAKE: Real = 5e-4;
/// Residual of an edge, in metres, below which it is not visited. With ten times more the
/// displacement of frames differs by what counts as jitter.
const RESIDUAL: Real = 1e-5;
/// Least violation that counts, in metres.
const NEGLIGIBLE: Real = 5e-6;
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
    let weight = |c: &Contact| {
        (0..4).map(|k| c.coefficients[k].powi(2) * w[c.vertices[k] as usize]).sum::<Real>()
    };
    let weights: Vec<Real> = contacts.iter().map(weight).collect();
    // Each multiplier counts once, also where two contacts have the same vertices.
    let mut known = std::mem::take(&mut start.contacts);
    let mut forces: Vec<Real> =
        contacts.iter().map(|c| known.remove(&c.vertices).unwrap_or(0.0)).collect();
    for (contact, force) in contacts.iter().zip(&forces) {
        push(x, w, contact, *force);
    }
    let mut solved = Solved { sweeps: 0, violation: Real::INFINITY };
    let (mut values, mut active, mut moving) = (Vec::new(), Vec::new(), Vec::new());
    while solved.sweeps < most {
        if solved.sweeps.is_multiple_of(CHECK) {
            evaluate(contacts, x, &mut values);
            let (violation, is_met) = violation((contacts, &values), &weights);
            solved.violation = violation;
            select_contacts((contacts, &values), &forces, &mut active);
            select_edges(scene, target, &start.edges, x, &mut moving);
            if is_met && moving.is_empty() {
                break;
            }
        }
        smooth(scene, (target, w), &moving, &mut start.edges, x);
        sweep(contacts, &active, (&weights, RELAXATION), &mut forces, w, x);
        solved.sweeps += 1;
    }
    for _ in 0..LAST {
        sweep(contacts, &active, (&weights, 1.0), &mut forces, w, x);
    }
    evaluate(contacts, x, &mut values);
    solved.violation = violation((contacts, &values), &weights).0;
    start.contacts = contacts
        .iter()
        .zip(&forces)
        .filter(|(_, force)| **force > 0.0)
        .map(|(contact, force)| (contact.vertices, *force))
        .collect();
    solved
}

/// The values of contacts at `x`.
fn evaluate(contacts: &[Contact], x: &[Point], values: &mut Vec<Real>) {
    values.clear();
    values.extend(contacts.iter().map(|contact| contact.value(x)));
}

/// Largest violation of contacts that can move, of which these are the values, and whether all are
/// negligible.
fn violation((contacts, values): (&[Contact], &[Real]), weights: &[Real]) -> (Real, bool) {
    let all = contacts.iter().zip(values).zip(weights);
    let movable = all.filter(|(_, weight)| **weight > 0.0);
    movable.fold((0.0, true), |(largest, is_met), ((contact, value), _)| {
        let short = contact.gap - value;
        (short.max(largest), is_met && short <= (TOLERANCE * contact.gap).max(NEGLIGIBLE))
    })
}

fn push(x: &mut [Point], w: &[Real], contact: &Contact, force: Real) {
    if force != 0.0 {
        for k in 0..4 {
            let v = contact.vertices[k] as usize;
            x[v] += contact.normal * (contact.coefficients[k] * w[v] * force);
        }
    }
}

/// Selects the contacts that the next sweeps visit: those that are met by less than `AWAKE` or push.
fn select_contacts(
    (contacts, values): (&[Contact], &[Real]),
    forces: &[Real],
    active: &mut Vec<u32>,
) {
    active.clear();
    for (k, ((contact, value), force)) in (0u32..).zip(contacts.iter().zip(values).zip(forces)) {
        if *force > 0.0 || *value < contact.gap + AWAKE {
            active.push(k);
        }
    }
}

/// Selects the edges that the next sweeps visit: those with a residual.
fn select_edges(
    scene: &Scene,
    target: &[Point],
    multipliers: &[Vector],
    x: &[Point],
    moving: &mut Vec<u32>,
) {
    let displaced: Vec<Vector> = x.iter().zip(target).map(|(x, target)| x - target).collect();
    moving.clear();
    let edges = scene.edges.iter().zip(&scene.compliance).zip(multipliers);
    for (k, ((edge, compliance), multiplier)) in (0u32..).zip(edges) {
        let [i, j] = edge.map(|v| displaced[v as usize]);
        let residual = i - j + *multiplier * *compliance;
        if residual.norm_squared() > RESIDUAL * RESIDUAL {
            moving.push(k);
        }
    }
}

/// One sweep over some contacts, with multipliers that stay non-negative.
fn sweep(
    contacts: &[Contact],
    active: &[u32],
    (weights, relaxation): (&[Real], Real),
    forces: &mut [Real],
    w: &[Real],
    x: &mut [Point],
) {
    for k in active.iter().map(|k| *k as usize) {
        let (contact, weight) = (&contacts[k], weights[k]);
        let short = contact.gap - contact.value(x);
        if weight <= 0.0 || (short <= 0.0 && forces[k] == 0.0) {
            continue;
        }
        let to = (forces[k] + relaxation * short / weight).max(0.0);
        push(x, w, contact, to - forces[k]);
        forces[k] = to;
    }
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
