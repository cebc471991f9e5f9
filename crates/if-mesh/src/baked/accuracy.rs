//! The error of a baked field.

use super::blend::{BRICK, Node, blend, bumps, cells, corners};
use super::bricks::Bricks;
use super::params::BakeParams;
use if_core::aabb::Aabb;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::{Cancelled, Monitor, Progress};
use if_core::random::SplitMix64;
use rayon::prelude::*;

/// The bound is this times the largest error at the probed points.
pub(super) const SAFETY: Real = 1.5;
/// Distances from the surface, in shares of the reach, at which the statistics of errors are kept
/// apart.
const BINS: [Real; 8] = [0.0, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
/// Of each bin, cells with the largest curvature, and points in each.
const WORST: [usize; 2] = [2048, 8];
/// Of each bin, cells spread evenly, and points in each.
const EVEN: [usize; 2] = [4096, 2];

/// Least number of points in the cells of a bin with the largest curvature: of few cells each gets
/// more, because the largest error at a handful of points may be far below the largest of all.
const FEWEST: usize = 4096;

/// Upper bound on |∇φ| of the blend.
///
/// In a cell ∇φ is M + E: M is affine in each coordinate, so that |M| is largest in a corner, where
/// E is zero; and of E each component is at most a quarter of the bumps' differences along its axis
/// ([`blend`]).
pub(super) fn steepest(bricks: &Bricks) -> Real {
    (0..bricks.places.len())
        .into_par_iter()
        .map(|brick| {
            let inverse = 1.0 / bricks.cell_of(bricks.places[brick].level);
            let at = |k: usize| [k & 1, k >> 1 & 1, k >> 2 & 1].map(|b| b as Real);
            cells().map(|c| brick * BRICK + c).fold(0.0, |most: Real, slot| {
                let corners = (0..8)
                    .map(|k| blend(&bricks.nodes, slot, at(k), inverse).1.norm())
                    .fold(0.0, Real::max);
                most.max(corners + between(bumps(&bricks.nodes, slot)) * inverse)
            })
        })
        .reduce(|| 0.0, Real::max)
}

/// Upper bound on the part of a cell's gradient between the corners that its bumps add, times its edge. `bumps[a]`
/// are those of the four edges along axis `a`, the lower of the other two axes first.
fn between(bumps: [[f32; 4]; 3]) -> Real {
    let mut most = [0.0f32; 3];
    for (axis, b) in bumps.into_iter().enumerate() {
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        let (low, high) = (others[0].min(others[1]), others[0].max(others[1]));
        most[low] += (b[1] - b[0]).abs().max((b[3] - b[2]).abs());
        most[high] += (b[2] - b[0]).abs().max((b[3] - b[1]).abs());
    }
    0.25 * Vector::from(most.map(Real::from)).norm()
}

/// The largest errors, by distance from the surface.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Errors {
    /// The largest of each bin, in metres.
    pub(super) largest: [Real; BINS.len()],
    /// The length of which bins are shares, in metres.
    pub(super) reach: Real,
}

impl Errors {
    /// The largest error at points nearer than `distance` to the surface.
    pub(super) fn within(&self, distance: Real) -> Real {
        self.largest
            .iter()
            .zip(BINS)
            .filter(|(_, from)| from * self.reach < distance)
            .map(|(e, _)| *e)
            .fold(self.largest[0], Real::max)
    }
}

fn bin(reach: Real, distance: Real) -> usize {
    BINS.iter().rposition(|from| from * reach < distance.abs()).unwrap_or(0)
}

/// Whether an error counts at a point whose true distance is `truth`: it lies in the band, and no
/// farther from the surface than the reach and `more`, in metres.
pub(super) fn counts(truth: Real, more: Real, params: &BakeParams) -> bool {
    -params.depth <= truth && truth <= params.band && truth.abs() <= params.reach + more
}

/// Whether a cell may hold points where errors count.
pub(super) fn matters(nodes: &[Node], slot: usize, cell: Real, params: &BakeParams) -> bool {
    let values = corners(nodes, slot).map(|n| Real::from(n[0]));
    values.iter().any(|v| -params.depth <= *v && *v <= params.band)
        && values.iter().any(|v| v.abs() <= params.reach + 2.0 * cell)
}

/// Difference between the blend in a cell and the trilinear one, in metres: at creases of fields the
/// error is as large.
pub(super) fn bend(nodes: &[Node], slot: usize) -> Real {
    bumps(nodes, slot).into_iter().flatten().fold(0.0, |m, b| Real::max(m, Real::from(b.abs())))
        * 0.25
}

/// Adds the largest differences between the blend and the source at random points of the band in `core`: near
/// the surface, which are in bins below the reach, or else in the others. Returns the bricks,
/// ascending, in which they exceed `tolerance` within the reach.
pub(super) fn measure(
    errors: &mut Errors,
    bricks: &Bricks,
    source: &dyn SignedDistance,
    (params, core): (&BakeParams, &Aabb),
    (near, seed, tolerance): (bool, u64, Real),
    monitor: &mut dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let probes = probes(bricks, params, near, seed);
    let points: Vec<Point> = probes
        .iter()
        .map(|(b, c, u)| {
            let level = bricks.places[*b as usize].level;
            bricks.at(level, bricks.node(*b as usize, *c)) + u * bricks.cell_of(level)
        })
        .collect();
    let mut truth = vec![0.0; points.len()];
    source.distances(&points, &mut truth);
    monitor.report(&Progress { done: points.len(), ..Progress::stage("measure") })?;
    let mut off_in = Vec::new();
    for (((b, c, u), point), truth) in probes.iter().zip(&points).zip(truth) {
        if -params.depth <= truth && truth <= params.band && core.contains(point) {
            let value = blend(&bricks.nodes, *b as usize * BRICK + c, (*u).into(), 1.0).0;
            let off = (value - truth).abs();
            let at = &mut errors.largest[bin(params.reach, truth)];
            *at = at.max(off);
            if off > tolerance && counts(truth, 0.0, params) {
                off_in.push(*b);
            }
        }
    }
    off_in.sort_unstable();
    off_in.dedup();
    Ok(off_in)
}

/// Random points in the cells with the largest curvature, and in some of all others: brick, cell, and
/// position in it.
fn probes(
    bricks: &Bricks,
    params: &BakeParams,
    near: bool,
    seed: u64,
) -> Vec<(u32, usize, Vector)> {
    let leaves = bricks.leaves();
    let all: Vec<(usize, Real, u32, usize)> = leaves
        .par_iter()
        .flat_map_iter(|b| {
            cells().filter_map(move |c| {
                let slot = *b as usize * BRICK + c;
                let values = corners(&bricks.nodes, slot).map(|n| Real::from(n[0]));
                let nearest = values.into_iter().min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
                let wanted = values.iter().any(|v| -params.depth <= *v && *v <= params.band);
                wanted.then(|| (bin(params.reach, nearest), bend(&bricks.nodes, slot), *b, c))
            })
        })
        .collect();
    let mut points = Vec::new();
    let mut add = |b: u32, c: usize, count: usize| {
        let mut random =
            SplitMix64::new((u64::from(b) * BRICK as u64 + c as u64) * 0x1_0001 + seed);
        points.extend(
            (0..count).map(|_| (b, c, Vector::new(random.unit(), random.unit(), random.unit()))),
        );
    };
    for bin in (0..BINS.len()).filter(|b| (BINS[*b] < 1.0) == near) {
        let mut some: Vec<(Real, u32, usize)> =
            all.iter().filter(|c| c.0 == bin).map(|c| (c.1, c.2, c.3)).collect();
        let stride = some.len().div_ceil(EVEN[0]).max(1);
        some.iter()
            .skip(seed as usize % stride)
            .step_by(stride)
            .for_each(|(_, b, c)| add(*b, *c, EVEN[1]));
        let worst = WORST[0].min(some.len());
        if worst > 0 {
            some.select_nth_unstable_by(worst - 1, |a, b| {
                b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2)))
            });
            some.truncate(worst);
            some.sort_unstable_by_key(|c| (c.1, c.2));
            let points = WORST[1].max(FEWEST.div_ceil(worst));
            some.iter().for_each(|(_, b, c)| add(*b, *c, points));
        }
    }
    points
}
