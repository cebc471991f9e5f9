//! Displacements of tangled neighbourhoods are smoothed, and what is then inside a layer is lifted
//! out together with its neighbours.
//!
//! Next to a fold, neighbours can be led out to different sides of it. No local step brings them
//! together again: the edges between them cross the layer. Displacements that are smooth keep
//! neighbours on one side, and contacts and cloth settle from there.

use super::{Repair, is_clear};
use crate::progress::GarmentProgress;
use crate::workpiece::{Scene, SettleError, Workpiece};
use if_core::geodesic::Neighbours;
use if_core::math::{Point, Real, Vector};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::ops::ControlFlow;

/// Edge strain beyond which a neighbourhood counts as tangled.
const TANGLED: Real = 0.5;
/// In the first rounds tangled neighbourhoods are smoothed at once.
const EARLY: usize = 12;
/// A clean garment is smoothed again while its rms strain falls below this share of what it was.
const WORTHWHILE: Real = 0.9;
/// How far along the surface from a tangled vertex displacements are smoothed, in metres: a fold
/// or two.
const RADIUS: Real = 0.03;
/// Times that displacements are averaged: over 3 cm of the test data's meshes nothing of a tangle
/// is left.
const SMOOTHINGS: usize = 40;
/// Maximum number of steps that a vertex is lifted.
const LIFTS: u32 = 40;
/// Times that lifts are averaged.
const LIFT_SMOOTHINGS: usize = 10;

/// Smooths the displacements around what is strained too far, or still remains after the cloth has
/// yielded. Breaks if a clean garment no longer gains by it.
pub(crate) struct Smoothing {
    /// Rms strain when a clean garment was last smoothed.
    relaxed_from: Real,
}

impl Default for Smoothing {
    fn default() -> Self {
        Self { relaxed_from: Real::INFINITY }
    }
}

impl Repair for Smoothing {
    fn apply(
        &mut self,
        work: &mut Workpiece<'_>,
        _: &mut GarmentProgress<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        if work.is_yielding {
            return Ok(ControlFlow::Continue(()));
        }
        let repairing = work.is_repairing();
        let tangled = work.strain.max > TANGLED;
        let is_clean = work.remaining.is_clean();
        if is_clean && repairing && tangled && work.strain.rms > WORTHWHILE * self.relaxed_from {
            return Ok(ControlFlow::Break(()));
        }
        let applies = if is_clean {
            repairing && tangled
        } else {
            tangled && work.round < EARLY || work.has_yielded
        };
        if applies {
            if is_clean {
                self.relaxed_from = work.strain.rms;
                work.clean_rounds = 0;
            }
            let mut vertices = work.remaining_vertices();
            if tangled {
                vertices.extend(work.cloth.strained(0.5 * TANGLED));
            }
            smooth_near(work, &vertices);
            work.tree.refit(&work.cloth.x);
            work.counts.smoothings += 1;
        }
        Ok(ControlFlow::Continue(()))
    }
}

/// Smooths the displacements near `tangled` vertices, and lifts what is then inside.
fn smooth_near(work: &mut Workpiece<'_>, tangled: &BTreeSet<u32>) {
    let scene = work.scene;
    let Workpiece { cloth, contacts, .. } = work;
    let rest = scene.garment.mesh.vertices();
    let near = cloth.neighbours.distances(tangled.iter().copied(), RADIUS);
    let free = |v: &u32| near[*v as usize].is_finite() && cloth.ever_free[*v as usize];
    let chosen: Vec<u32> = (0..cloth.x.len() as u32).filter(free).collect();
    // Displacements first, then positions.
    let mut to: Vec<Vector> = cloth.x.iter().zip(rest).map(|(a, b)| a - b).collect();
    smooth(&mut to, &chosen, &cloth.neighbours);
    to.iter_mut().zip(rest).for_each(|(d, r)| *d += r.coords);
    lift(&mut to, &chosen, &cloth.neighbours, scene);
    let mut most: Real = 0.0;
    for v in chosen.into_iter().map(|v| v as usize) {
        most = most.max((to[v] - cloth.x[v].coords).norm());
        cloth.x[v] = Point::from(to[v]);
        contacts.reset(v);
    }
    contacts.moved(most);
}

/// Replaces the value of each of the `chosen` by the mean of its neighbours, repeatedly.
fn smooth(values: &mut [Vector], chosen: &[u32], neighbours: &Neighbours) {
    for _ in 0..SMOOTHINGS {
        for &v in chosen {
            let around = neighbours.of(v);
            if !around.is_empty() {
                let sum: Vector = around.iter().map(|(u, _)| values[*u as usize]).sum();
                values[v as usize] = sum / around.len() as Real;
            }
        }
    }
}

/// Lifts the `chosen` of the positions `at` in steps along the coarse way out, until they are the
/// clearance outside all layers; neighbours are lifted along.
fn lift(at: &mut [Vector], chosen: &[u32], neighbours: &Neighbours, scene: Scene<'_>) {
    let (clearance, step) = (scene.params.goal.clearance, scene.params.effort.contact_step);
    let lifts: Vec<(Vector, Real)> = chosen
        .par_iter()
        .with_min_len(32)
        .map(|v| {
            let p = Point::from(at[*v as usize]);
            let Some(out) = scene.outward.direction(&p) else { return (Vector::zeros(), 0.0) };
            let lift = (0..LIFTS)
                .map(|k| Real::from(k) * step)
                .find(|t| is_clear(&(p + out * *t), scene.below, clearance));
            (out, lift.unwrap_or(0.0))
        })
        .collect();
    let mut needed = vec![0.0; at.len()];
    chosen.iter().zip(&lifts).for_each(|(v, (_, t))| needed[*v as usize] = *t);
    // A vertex is lifted as far as it needs, and as its neighbours on average.
    let mut lifted = needed.clone();
    for _ in 0..LIFT_SMOOTHINGS {
        for &v in chosen {
            let around = neighbours.of(v);
            let sum: Real = around.iter().map(|(u, _)| lifted[*u as usize]).sum();
            lifted[v as usize] = needed[v as usize].max(sum / around.len().max(1) as Real);
        }
    }
    chosen
        .iter()
        .zip(&lifts)
        .for_each(|(v, (out, _))| at[*v as usize] += out * lifted[*v as usize]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::tests::{apply, unchanged, with_band};
    use if_core::math::Vector;

    #[test]
    fn neighbours_on_different_sides_come_back_together() {
        with_band(0.305, unchanged, |work| {
            // Every other vertex near one of them is thrown 5 cm up, the rest 5 cm down.
            let middle = work.cloth.x.len() / 2;
            let centre = work.cloth.x[middle];
            work.cloth.ever_free.fill(true);
            let mut to = work.cloth.x.clone();
            let near = |p: &Point| (p - centre).norm() < 0.03;
            for (k, p) in to.iter_mut().enumerate().filter(|(_, p)| near(p)) {
                *p += Vector::y() * if k % 2 == 0 { 0.05 } else { -0.05 };
            }
            work.go_to(&to);
            work.verify();
            work.rank(1.0);
            let before = work.strain.max;
            assert!(before > TANGLED && !work.remaining.is_clean());
            apply(&mut Smoothing::default(), work);
            work.verify();
            work.rank(1.0);
            assert_eq!(work.counts.smoothings, 1);
            assert!(work.strain.max < 0.2 * before, "{before} -> {}", work.strain.max);
            assert!(work.remaining.inside.is_empty());
        });
    }
}
