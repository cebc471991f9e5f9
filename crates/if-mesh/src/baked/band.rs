//! The bricks of level 0 that may hold a point of the band.

use super::blend::{BRICK, Node, SIDE, local};
use super::bricks::Bricks;
use super::directory::{INSIDE, OUTSIDE, SPLIT};
use super::error::BakeError;
use super::params::BakeParams;
use super::samples::MAX_COORDINATE;
use crate::grid::GridSize;
use if_core::aabb::Aabb;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real};
use if_core::monitor::{Monitor, Progress};

/// The box in which the zero set lies.
pub(super) fn region(source: &dyn SignedDistance, params: &BakeParams) -> Result<Aabb, BakeError> {
    let region = params.region.or_else(|| source.bounds()).ok_or(BakeError::Unbounded)?;
    if region.is_empty() || !region.min.iter().chain(region.max.iter()).all(|x| x.is_finite()) {
        return Err(BakeError::Region { region });
    }
    Ok(region)
}

/// The bricks that may hold a point of the band: all others are excluded by the Lipschitz bound.
pub(super) fn band_bricks(
    source: &dyn SignedDistance,
    region: &Aabb,
    params: &BakeParams,
    monitor: &mut dyn Monitor,
) -> Result<Bricks, BakeError> {
    let lipschitz = source.lipschitz();
    if lipschitz.is_nan() || lipschitz <= 0.0 {
        return Err(BakeError::Slope { lipschitz });
    }
    let side = SIDE as Real * params.cell;
    let domain = region.inflated(params.band + params.cell);
    let counts = domain.size().map(|s| (s / side).ceil().max(1.0));
    let too_large = |bytes: Real| BakeError::TooLarge {
        bytes: bytes as usize,
        limit: params.memory,
        cell: params.cell,
        lipschitz,
    };
    // 12 bytes a place: the entry, and the value in the middle while bricks are excluded.
    let places = counts.x * counts.y * counts.z;
    if places * 12.0 > params.memory as Real
        || places >= Real::from(SPLIT)
        || counts.max() * SIDE as Real >= MAX_COORDINATE as Real
    {
        return Err(too_large(places * 12.0));
    }
    let size = [counts.x as usize, counts.y as usize, counts.z as usize];
    let places = size[0] * size[1] * size[2];
    let origin = domain.center() - counts * (0.5 * side);
    let middle = |at: usize| {
        let b = GridSize(size).coordinates(at);
        Point::from([0, 1, 2].map(|k| origin[k] + (b[k] as Real + 0.5) * side))
    };
    let reach = 0.5 * side * 3.0f64.sqrt();
    let mut directory = vec![OUTSIDE; places];
    let mut kept = Vec::new();
    const BATCH: usize = 1 << 16;
    let mut values = vec![0.0; BATCH.min(places)];
    for first in (0..places).step_by(BATCH) {
        let middles: Vec<Point> = (first..(first + BATCH).min(places)).map(middle).collect();
        source.distances(&middles, &mut values[..middles.len()]);
        let done = first + middles.len();
        monitor.report(&Progress { done, total: Some(places), ..Progress::stage("band") })?;
        for (k, value) in values[..middles.len()].iter().enumerate() {
            if !value.is_finite() {
                return Err(BakeError::NotFinite {
                    point: middles[k],
                    sample: source.sample(&middles[k]),
                });
            }
            if *value > lipschitz * (reach + params.band) {
                continue;
            }
            if -*value > lipschitz * (reach + params.depth) {
                directory[first + k] = INSIDE;
            } else {
                kept.push((first + k) as u32);
            }
        }
    }
    // The grid, and the samples at its nodes.
    let bytes = (kept.len() * 3 * BRICK * size_of::<Node>()) as Real;
    if bytes > params.memory as Real {
        return Err(too_large(bytes));
    }
    Ok(Bricks::new(origin, params.cell, size, directory, &kept))
}

/// Checks the border of the bricks: inside the grid a missing brick is on the same side as the
/// border, and at the end of the grid all is outside.
pub(super) fn check_border(bricks: &Bricks) -> Result<(), BakeError> {
    for (slot, value) in bricks.nodes.iter().enumerate() {
        let (distance, brick) = (Real::from(value[0]), slot / BRICK);
        let point = || bricks.at(0, bricks.node(brick, slot % BRICK));
        let (place, local) = (bricks.places[brick].at.map(|b| b as usize), local(slot % BRICK));
        for k in 0..3 {
            let (end, next) = match local[k] {
                0 => (place[k] == 0, place[k].wrapping_sub(1)),
                SIDE => (place[k] + 1 == bricks.size[k], place[k] + 1),
                _ => continue,
            };
            if end {
                if distance < 0.0 {
                    return Err(BakeError::Leaves { point: point(), distance });
                }
                continue;
            }
            let mut to = place;
            to[k] = next;
            let entry = bricks.roots[bricks.root_index(to)];
            if (entry == OUTSIDE && distance < 0.0) || (entry == INSIDE && distance > 0.0) {
                return Err(BakeError::Steep { point: point(), distance });
            }
        }
    }
    for (at, entry) in bricks.roots.iter().enumerate() {
        let b = GridSize(bricks.size).coordinates(at);
        if *entry == INSIDE && (0..3).any(|k| b[k] == 0 || b[k] + 1 == bricks.size[k]) {
            let point = bricks.at(0, b.map(|k| (k * SIDE) as u32));
            return Err(BakeError::Leaves { point, distance: Real::NEG_INFINITY });
        }
    }
    Ok(())
}
