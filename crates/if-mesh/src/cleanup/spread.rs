//! The move of a boundary carried into the surface.

use super::Step;
use super::boundary::SmoothParams;
use super::project::newton;
use super::twins::{NONE, Twins, ends, previous};
use super::watch::{Cancelled, Watch};
use super::work::Work;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};

/// The moves of a loop are spread at least over so many times their mean: where triangles are small
/// beside the teeth of a loop, a few rings would be pressed together.
const DEPTH: Real = 3.0;
/// Rings, at most, if that is above what is asked for.
const MOST_RINGS: usize = 12;

/// Carries moves into the surface; made once for all rounds.
pub(super) struct Spread<'a> {
    twins: &'a Twins,
    /// For each vertex a half-edge that leaves it.
    leaving: &'a [u32],
    /// Vertices that take part as seeds only.
    fixed: &'a [bool],
    /// 0 for seeds, [`NONE`] where the move does not reach.
    ring_of: Vec<u32>,
    moves: Vec<Vector>,
}

impl<'a> Spread<'a> {
    pub(super) fn new(twins: &'a Twins, leaving: &'a [u32], fixed: &'a [bool]) -> Self {
        let vertices = leaving.len();
        Self {
            twins,
            leaving,
            fixed,
            ring_of: vec![NONE; vertices],
            moves: vec![Vector::zeros(); vertices],
        }
    }

    /// Gives the vertices of `rings` rings round `seeds` the mean move of the ring before them,
    /// less and less of it. All vertices that were given one, seeds included.
    pub(super) fn spread(
        &mut self,
        work: &Work,
        target: &mut [Point],
        seeds: &[u32],
        rings: usize,
    ) -> Vec<u32> {
        let (twins, leaving, fixed) = (self.twins, self.leaving, self.fixed);
        let (mut far, mut edge) = (0.0, 0.0);
        for &v in seeds {
            far += (target[v as usize] - work.points[v as usize]).norm();
            edge += work.edge_length_at(twins, leaving[v as usize]);
        }
        let rings = if edge > 0.0 {
            ((DEPTH * far / edge).ceil() as usize).clamp(rings, MOST_RINGS.max(rings))
        } else {
            rings
        };
        for &v in seeds {
            self.ring_of[v as usize] = 0;
            self.moves[v as usize] = target[v as usize] - work.points[v as usize];
        }
        let mut all = seeds.to_vec();
        let mut last = 0;
        let mut near = Vec::new();
        for ring in 1..=rings as u32 {
            let mut found: Vec<u32> = Vec::new();
            for v in &all[last..] {
                neighbours_into(work, twins, leaving[*v as usize], &mut near);
                for &u in &near {
                    if self.ring_of[u as usize] == NONE && !fixed[u as usize] {
                        self.ring_of[u as usize] = ring;
                        found.push(u);
                    }
                }
            }
            found.sort_unstable();
            let share = 1.0 - Real::from(ring) / (rings as Real + 1.0);
            for &v in &found {
                neighbours_into(work, twins, leaving[v as usize], &mut near);
                near.retain(|u| self.ring_of[*u as usize] == ring - 1);
                let sum = near.iter().map(|u| self.moves[*u as usize]).sum::<Vector>();
                let d = sum / near.len().max(1) as Real;
                self.moves[v as usize] = d;
                target[v as usize] = work.points[v as usize] + d * share;
            }
            last = all.len();
            all.extend(found);
        }
        all.iter().for_each(|v| self.ring_of[*v as usize] = NONE);
        all
    }
}

/// Laplacian smoothing of the vertices that are not `fixed`, from where `target` has them.
pub(super) fn surface(
    work: &Work,
    twins: &Twins,
    leaving: &[u32],
    target: &mut [Point],
    fixed: &[bool],
    params: &SmoothParams,
    watch: &mut Watch<'_>,
) -> Result<(), Cancelled> {
    let mut near = Vec::new();
    for _ in 0..params.surface_passes {
        watch.at(Step::Boundary)?;
        let old = target.to_vec();
        for v in (0..target.len()).filter(|v| !fixed[*v] && leaving[*v] != NONE) {
            neighbours_into(work, twins, leaving[v], &mut near);
            let mean = near.iter().fold(Vector::zeros(), |s, u| s + old[*u as usize].coords)
                / near.len().max(1) as Real;
            target[v] = old[v] + (Point::from(mean) - old[v]) * params.lambda;
        }
    }
    Ok(())
}

/// The vertices that an edge joins to the one that half-edge `h` leaves.
pub(super) fn neighbours(work: &Work, twins: &Twins, h: u32) -> Vec<u32> {
    let mut near = Vec::with_capacity(8);
    neighbours_into(work, twins, h, &mut near);
    near
}

/// [`neighbours`] into a buffer.
fn neighbours_into(work: &Work, twins: &Twins, h: u32, near: &mut Vec<u32>) {
    near.clear();
    if h != NONE {
        twins.around(h, |g| {
            near.push(ends(&work.triangles, g)[1]);
            if twins.of[previous(g) as usize] == NONE {
                near.push(ends(&work.triangles, previous(g))[0]);
            }
        });
    }
}

/// Takes moved vertices, which are among `moving`, back to φ = 0.
pub(super) fn back(work: &Work, field: &dyn SignedDistance, target: &mut [Point], moving: &[u32]) {
    for &v in moving {
        let p = &mut target[v as usize];
        let move_length = (*p - work.points[v as usize]).norm();
        if move_length > 0.0
            && let Some(step) = newton(&field.sample(p), move_length)
        {
            *p += step;
        }
    }
}
