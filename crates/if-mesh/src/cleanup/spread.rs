//! The move of a boundary carried into the surface.

use super::boundary::SmoothParams;
use super::project::newton;
use super::twins::{NONE, Twins, ends, previous};
use super::work::Work;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};

/// The moves of a loop are spread at least over so many times their mean: where triangles are small beside the teeth of a
/// loop, a few rings would be pressed together.
const DEPTH: Real = 3.0;
/// Rings, at most, if that is above what is asked for.
const MOST_RINGS: usize = 12;

/// Gives the vertices of `rings` rings round `seeds` the mean move of the ring before them, less and less of it.
pub(super) fn spread(
    work: &Work,
    twins: &Twins,
    leaving: &[u32],
    target: &mut [Point],
    seeds: &[u32],
    fixed: &[bool],
    rings: usize,
) {
    let mut ring_of = vec![u32::MAX; work.points.len()];
    let (mut far, mut edge) = (0.0, 0.0);
    for &v in seeds {
        far += (target[v as usize] - work.points[v as usize]).norm();
        edge += work.edge_length_at(twins, leaving[v as usize]);
    }
    let rings = if edge > 0.0 { ((DEPTH * far / edge).ceil() as usize).clamp(rings, MOST_RINGS.max(rings)) } else { rings };
    seeds.iter().for_each(|v| ring_of[*v as usize] = 0);
    let mut whole: Vec<(u32, Vector)> = seeds.iter().map(|v| (*v, target[*v as usize] - work.points[*v as usize])).collect();
    let mut moves = vec![Vector::zeros(); work.points.len()];
    whole.iter().for_each(|(v, d)| moves[*v as usize] = *d);
    for ring in 1..=rings as u32 {
        let mut found: Vec<u32> = Vec::new();
        for (v, _) in &whole {
            for u in neighbours(work, twins, leaving[*v as usize]) {
                if ring_of[u as usize] == u32::MAX && !fixed[u as usize] {
                    ring_of[u as usize] = ring;
                    found.push(u);
                }
            }
        }
        found.sort_unstable();
        whole = found
            .iter()
            .map(|&v| {
                let near = neighbours(work, twins, leaving[v as usize]);
                let inner: Vec<Vector> =
                    near.iter().filter(|u| ring_of[**u as usize] == ring - 1).map(|u| moves[*u as usize]).collect();
                (v, inner.iter().sum::<Vector>() / inner.len().max(1) as Real)
            })
            .collect();
        let share = 1.0 - Real::from(ring) / (rings as Real + 1.0);
        for (v, d) in &whole {
            moves[*v as usize] = *d;
            target[*v as usize] = work.points[*v as usize] + d * share;
        }
    }
}

/// Laplacian smoothing of the vertices that are not `fixed`, from where `target` has them.
pub(super) fn surface(work: &Work, twins: &Twins, leaving: &[u32], target: &mut [Point], fixed: &[bool], params: &SmoothParams) {
    for _ in 0..params.surface_passes {
        let old = target.to_vec();
        for v in (0..target.len()).filter(|v| !fixed[*v] && leaving[*v] != NONE) {
            let near = neighbours(work, twins, leaving[v]);
            let mean = near.iter().fold(Vector::zeros(), |s, u| s + old[*u as usize].coords) / near.len().max(1) as Real;
            target[v] = old[v] + (Point::from(mean) - old[v]) * params.lambda;
        }
    }
}

/// The vertices that an edge joins to the one that half-edge `h` leaves.
pub(super) fn neighbours(work: &Work, twins: &Twins, h: u32) -> Vec<u32> {
    let mut near = Vec::with_capacity(8);
    if h != NONE {
        twins.around(h, |g| {
            near.push(ends(&work.triangles, g)[1]);
            if twins.of[previous(g) as usize] == NONE {
                near.push(ends(&work.triangles, previous(g))[0]);
            }
        });
    }
    near
}

/// Takes moved vertices back to φ = 0.
pub(super) fn back(work: &Work, field: &dyn SignedDistance, target: &mut [Point]) {
    for (v, p) in target.iter_mut().enumerate() {
        let move_length = (*p - work.points[v]).norm();
        if move_length > 0.0
            && let Some(step) = newton(&field.sample(p), move_length)
        {
            *p += step;
        }
    }
}
