//! How far a baked field is from the true one.

use super::bricks::{BRICK, Bricks, Reading};
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use rayon::prelude::*;

/// Distances from the surface, in cells, at which the statistics of errors are kept apart.
const BINS: [Real; 6] = [0.0, 1.0, 2.0, 4.0, 8.0, 16.0];
/// Of each bin, cells looked at for their bad looks, and points in each.
const WORST: [usize; 2] = [512, 8];
/// Of each bin, cells spread evenly, and points in each.
const EVEN: [usize; 2] = [2048, 2];

/// The largest |∇φ| of the blend, at the corners and in the middle of all cells.
pub(super) fn steepest(bricks: &Bricks) -> Real {
    (0..bricks.places.len())
        .into_par_iter()
        .map(|brick| {
            Bricks::cells(brick)
                .flat_map(|slot| {
                    let corner = |k: usize| [k & 1, k >> 1 & 1, k >> 2 & 1].map(|b| b as Real);
                    (0..9).map(move |k| (slot, if k == 8 { [0.5; 3] } else { corner(k) }))
                })
                .map(|(slot, u)| bricks.blend(slot, u).1.norm())
                .fold(0.0, Real::max)
        })
        .reduce(|| 0.0, Real::max)
}

/// The largest errors, by distance from the surface.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Errors(pub(super) [Real; BINS.len()]);

impl Errors {
    /// The largest error at points no farther than `cells` from the surface.
    pub(super) fn within(&self, cells: Real) -> Real {
        self.0.iter().zip(BINS).filter(|(_, from)| *from <= cells).map(|(e, _)| *e).fold(0.0, Real::max)
    }
}

fn bin(bricks: &Bricks, distance: Real) -> usize {
    BINS.iter().rposition(|from| *from <= distance.abs() / bricks.cell).unwrap_or(0)
}

/// The largest differences between the blend and the truth at some fifty thousand points of the band:
/// the truth is the source itself, or, where it was re-distanced, the distance to its zero set.
pub(super) fn errors(
    bricks: &Bricks,
    source: &(impl SignedDistance + ?Sized),
    redistanced: bool,
    band: Real,
    depth: Real,
) -> Errors {
    let points = probes(bricks, band, depth);
    let mut samples = vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; points.len()];
    source.samples(&points, &mut samples);
    let mut truth: Vec<Option<Real>> = samples.iter().map(|s| Some(s.distance)).collect();
    if redistanced {
        truth = distances_to_zero_set(bricks, source, &points, &samples);
    }
    let mut errors = Errors::default();
    for (p, truth) in points.iter().zip(truth) {
        if let (Reading::Blend(value, _), Some(truth)) = (bricks.read(p), truth)
            && -depth <= truth
            && truth <= band
        {
            let at = &mut errors.0[bin(bricks, truth)];
            *at = at.max((value - truth).abs());
        }
    }
    errors
}

/// Points in the cells that look worst, and in some of all others.
fn probes(bricks: &Bricks, band: Real, depth: Real) -> Vec<Point> {
    let cells: Vec<(usize, f32, usize)> = (0..bricks.places.len())
        .into_par_iter()
        .flat_map_iter(|brick| {
            Bricks::cells(brick).filter_map(move |slot| {
                let values = bricks.corners(slot).map(|n| Real::from(n[0]));
                let nearest = values.into_iter().min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
                let wanted = values.iter().any(|v| -depth <= *v && *v <= band);
                wanted.then(|| (bin(bricks, nearest), suspicion(bricks, slot), slot))
            })
        })
        .collect();
    let mut points: Vec<Point> = Vec::new();
    let mut add = |slot: usize, count: usize| {
        let corner = bricks.position(slot);
        points.extend((0..count).map(|k| corner + offset(slot * 8 + k) * bricks.cell));
    };
    for b in 0..BINS.len() {
        let mut cells: Vec<(f32, usize)> = cells.iter().filter(|c| c.0 == b).map(|c| (c.1, c.2)).collect();
        let stride = cells.len().div_ceil(EVEN[0]).max(1);
        cells.iter().step_by(stride).for_each(|(_, slot)| add(*slot, EVEN[1]));
        let worst = WORST[0].min(cells.len());
        if worst > 0 {
            cells.select_nth_unstable_by(worst - 1, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            cells.truncate(worst);
            cells.sort_unstable_by_key(|c| c.1);
            cells.iter().for_each(|(_, slot)| add(*slot, WORST[1]));
        }
    }
    points
}

/// How unlike a quadratic the cell is, in metres: what the trapezoidal rule on its edges misses, and
/// what the gradient turns.
fn suspicion(bricks: &Bricks, slot: usize) -> f32 {
    let n = bricks.corners(slot);
    let h = bricks.cell as f32;
    let mut worst = 0.0f32;
    for axis in 0..3 {
        for k in (0..8).filter(|k| k >> axis & 1 == 0) {
            let (a, b) = (n[k], n[k | 1 << axis]);
            let missed = (b[0] - a[0] - 0.5 * h * (a[1 + axis] + b[1 + axis])).abs();
            let turned: f32 = (1..4).map(|i| (b[i] - a[i]).powi(2)).sum();
            worst = worst.max(missed + 0.125 * h * turned);
        }
    }
    worst
}

/// A place in the unit cell, the same for the same seed.
fn offset(seed: usize) -> Vector {
    let mut s = (seed as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d;
    let mut next = || {
        s = (s ^ (s >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (s >> 11) as Real / (1u64 << 53) as Real
    };
    Vector::new(next(), next(), next())
}

/// Distances of the points to the zero set of `source`, started at the nearest points of the cell's
/// corners; `None` where that does not settle.
fn distances_to_zero_set(
    bricks: &Bricks,
    source: &(impl SignedDistance + ?Sized),
    points: &[Point],
    samples: &[FieldSample],
) -> Vec<Option<Real>> {
    let mut feet: Vec<Point> = points.iter().map(|p| start(bricks, p)).collect();
    let mut best: Vec<Option<Real>> = vec![None; points.len()];
    let mut here = samples.to_vec();
    for step in 0..24 {
        source.samples(&feet, &mut here);
        for k in 0..points.len() {
            let gradient = here[k].gradient;
            let steepness = gradient.norm_squared();
            if steepness <= 0.0 {
                continue;
            }
            let down = gradient * (here[k].distance / steepness);
            feet[k] -= down * (bricks.cell / down.norm().max(bricks.cell));
            let arm = points[k] - feet[k];
            // A foot on the zero set, though not yet the nearest, bounds the distance.
            if down.norm() < 1e-6 * bricks.cell {
                best[k] = Some(best[k].map_or(arm.norm(), |b: Real| b.min(arm.norm())));
            }
            // Half steps: whole ones swing where the surface bends more than its distance. They end in
            // time for the last steps to come down.
            if step < 20 {
                let along = arm - gradient * (gradient.dot(&arm) / steepness);
                feet[k] += along * (0.5 * bricks.cell / along.norm().max(bricks.cell));
            }
        }
    }
    samples.iter().zip(best).map(|(s, b)| b.map(|d| d.copysign(s.distance))).collect()
}

fn start(bricks: &Bricks, p: &Point) -> Point {
    let q = [0, 1, 2].map(|k| ((p[k] - bricks.origin[k]) / bricks.cell).max(0.0) as usize);
    let feet = (0..8usize).filter_map(|k| {
        let slot = bricks.owner([q[0] + (k & 1), q[1] + (k >> 1 & 1), q[2] + (k >> 2 & 1)])?;
        let [v, x, y, z] = bricks.nodes[slot].map(Real::from);
        Some(bricks.position(slot) - Vector::new(x, y, z) * v)
    });
    feet.min_by(|a, b| (a - p).norm_squared().total_cmp(&(b - p).norm_squared())).unwrap_or(*p)
}

/// Bytes that the grid takes.
pub(super) fn bytes(bricks: usize, places: usize) -> usize {
    bricks * (BRICK * size_of::<super::bricks::Node>() + 4) + places * 4
}
