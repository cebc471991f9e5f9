//! Ways out for what the solver cannot untie: displacements are smoothed, and what is then inside a
//! layer is lifted out together with its neighbours; or single vertices are led straight out.
//!
//! Next to a fold, neighbours can be led out to different sides of it. No local step brings them
//! together again: the edges between them cross the layer. Displacements that are smooth keep
//! neighbours on one side, and contacts and cloth settle from there.

use crate::geodesic::Neighbours;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_mesh::outward::Outward;
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;

/// Times that displacements are averaged: over 3 cm of the test data's meshes nothing of a tangle
/// is left.
const SMOOTHINGS: usize = 40;
/// Steps that a vertex is lifted at most.
const LIFTS: u32 = 40;
/// Times that lifts are averaged.
const LIFT_SMOOTHINGS: usize = 10;
/// Steps that a vertex is led straight out at most.
const LEADS: u32 = 40;

/// Replaces the value of each of the `chosen` by the mean of its neighbours, again and again.
pub(crate) fn smooth(values: &mut [Vector], chosen: &[u32], neighbours: &Neighbours) {
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

/// Lifts the `chosen` of the positions `at` by steps of `step` metres, the way out on the scale of
/// centimetres, until they are `clearance` metres outside all layers; neighbours are lifted along.
pub(crate) fn lift(
    at: &mut [Vector],
    chosen: &[u32],
    neighbours: &Neighbours,
    below: &[&ClosedLayer],
    outward: &Outward,
    clearance: Real,
    step: Real,
) {
    let lifts: Vec<(Vector, Real)> = chosen
        .par_iter()
        .with_min_len(32)
        .map(|v| {
            let p = Point::from(at[*v as usize]);
            let Some(out) = outward.direction(&p) else { return (Vector::zeros(), 0.0) };
            let lift = (0..LIFTS)
                .map(|k| Real::from(k) * step)
                .find(|t| is_clear(&(p + out * *t), below, clearance));
            (out, lift.unwrap_or(0.0))
        })
        .collect();
    let mut needed = vec![0.0; at.len()];
    chosen.iter().zip(&lifts).for_each(|(v, (_, t))| needed[*v as usize] = *t);
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

/// Where vertex `p` with neighbours `around` comes out of all layers, `part` metres outside, on the
/// shortest of some straight ways; `None` where none leads out.
pub(crate) fn lead_out(
    p: &Point,
    around: &[Point],
    below: &[&ClosedLayer],
    outward: &Outward,
    part: Real,
    step: Real,
) -> Option<Point> {
    let nearest = below
        .iter()
        .filter_map(|l| l.sided(p, part))
        .filter(|s| s.distance < 0.0)
        .map(|s| s.normal);
    let middle = around.iter().map(|q| q - p).sum::<Vector>();
    let ways: Vec<Vector> =
        outward.direction(p).into_iter().chain(nearest).chain([unit_or_zero(&middle)]).collect();
    (1..LEADS).find_map(|k| {
        let far = Real::from(k) * step;
        ways.iter().map(|w| p + w * far).find(|q| is_clear(q, below, part))
    })
}

fn is_clear(p: &Point, below: &[&ClosedLayer], gap: Real) -> bool {
    below.iter().all(|l| l.sided(p, gap).is_none_or(|s| s.distance >= gap))
}
