//! Points on the zero set of a field, spread about evenly.

use crate::error::TargetError;
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// Cells along the longest side at first, and times they are halved: the last are 1/128 of it.
const FIRST: Real = 16.0;
const HALVINGS: usize = 3;
/// Candidates of one round.
const ROUND: usize = 1 << 13;
/// Newton steps. Of a distance one is enough but where another part of the surface is nearer.
const STEPS: usize = 6;
/// Most candidates for each point wanted.
const PATIENCE: usize = 20;

/// `n` points on the surface within `bounds`.
///
/// Cells that cannot hold the surface by the field's Lipschitz bound are dropped, and halved; from
/// a random point of a remaining cell, Newton steps lead to the surface. A point is taken
/// where they end on it, no farther than two cells away.
pub(super) fn points(
    target: &(impl SignedDistance + ?Sized),
    bounds: &Aabb,
    n: usize,
    random: &mut Pcg64Mcg,
) -> Result<Vec<Point>, TargetError> {
    let (cells, edge) = cells(target, bounds)?;
    let touching = 1e-4 * edge;
    let nothing = FieldSample { distance: 0.0, gradient: Vector::zeros() };
    let mut out = Vec::with_capacity(n);
    let mut tried = 0;
    while out.len() < n && tried < PATIENCE * n + ROUND && !cells.is_empty() {
        let starts: Vec<Point> = (0..ROUND.min(n))
            .map(|_| {
                let cell = cells[random.random_range(0..cells.len())];
                cell + Vector::new(random.random(), random.random(), random.random()) * edge
            })
            .collect();
        tried += starts.len();
        // Newton steps of all candidates together, until they are on the surface.
        let mut at = starts.clone();
        let mut open: Vec<usize> = (0..at.len()).collect();
        let mut arrived = vec![false; at.len()];
        for _ in 0..=STEPS {
            let current: Vec<Point> = open.iter().map(|k| at[*k]).collect();
            let mut samples = vec![nothing; current.len()];
            target.samples(&current, &mut samples);
            let mut next = Vec::new();
            for (k, s) in open.iter().zip(&samples) {
                if !s.distance.is_finite() {
                    return Err(TargetError::NotFinite { point: at[*k], sample: *s });
                }
                let steepness = s.gradient.norm_squared();
                if s.distance.abs() <= touching {
                    arrived[*k] = true;
                } else if steepness > 1e-12 {
                    at[*k] -= s.gradient * (s.distance / steepness);
                    next.push(*k);
                }
            }
            open = next;
        }
        // A candidate that travelled far would make the density uneven.
        for k in 0..at.len() {
            if arrived[k] && (at[k] - starts[k]).norm() <= 2.0 * edge && out.len() < n {
                out.push(at[k]);
            }
        }
    }
    if out.len() < n {
        return Err(TargetError::NoSurface { found: out.len(), wanted: n });
    }
    Ok(out)
}

/// Lower corners of the cells that may hold the surface, and their edge.
fn cells(
    target: &(impl SignedDistance + ?Sized),
    bounds: &Aabb,
) -> Result<(Vec<Point>, Real), TargetError> {
    let mut edge = bounds.size().amax() / FIRST;
    // One more cell on each side, for a flat box or a surface on its border.
    let low = bounds.min - Vector::repeat(edge);
    let counts = [0, 1, 2].map(|k| (bounds.size()[k] / edge).ceil() as usize + 2);
    let mut cells = Vec::new();
    for z in 0..counts[2] {
        for y in 0..counts[1] {
            for x in 0..counts[0] {
                let border = [x, y, z].iter().zip(counts).any(|(i, n)| *i == 0 || i + 1 == n);
                cells.push((low + Vector::new(x as Real, y as Real, z as Real) * edge, border));
            }
        }
    }
    // Keep the cells that can hold the surface, then halve them.
    let lipschitz = if target.lipschitz().is_finite() { target.lipschitz() } else { 1.0 };
    for halving in 0..=HALVINGS {
        let middles: Vec<Point> =
            cells.iter().map(|(c, _)| c + Vector::repeat(0.5 * edge)).collect();
        let mut values = vec![0.0; middles.len()];
        target.distances(&middles, &mut values);
        let farthest = lipschitz * 0.5 * edge * (3.0 as Real).sqrt();
        let mut kept = Vec::new();
        for ((cell, border), (middle, value)) in cells.iter().zip(middles.iter().zip(&values)) {
            if !value.is_finite() {
                return Err(TargetError::NotFinite {
                    point: *middle,
                    sample: target.sample(middle),
                });
            }
            if halving == 0 && *border && *value < 0.0 && !bounds.contains(middle) {
                return Err(TargetError::InsideOut { point: *middle, distance: *value });
            }
            if value.abs() <= farthest {
                kept.push(*cell);
            }
        }
        if halving == HALVINGS {
            return Ok((kept, edge));
        }
        edge *= 0.5;
        let corner = |k: usize| {
            Vector::new((k & 1) as Real, (k >> 1 & 1) as Real, (k >> 2 & 1) as Real) * edge
        };
        cells = kept.iter().flat_map(|c| (0..8).map(move |k| (*c + corner(k), false))).collect();
    }
    Ok((Vec::new(), edge))
}
