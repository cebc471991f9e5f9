//! From a source to a filled grid.

use super::accuracy;
use super::bricks::{BRICK, Bricks, INSIDE, OUTSIDE, SIDE, local};
use super::params::{BakeError, BakeParams, Redistance};
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};

/// The bricks that may hold a point of the band: all others are excluded by the Lipschitz bound.
pub(super) fn band_bricks(source: &(impl SignedDistance + ?Sized), params: &BakeParams) -> Result<Bricks, BakeError> {
    let region = params.region.or_else(|| source.bounds()).ok_or(BakeError::Unbounded)?;
    if region.is_empty() || !region.min.iter().chain(region.max.iter()).all(|x| x.is_finite()) {
        return Err(BakeError::Region { region });
    }
    let lipschitz = source.lipschitz();
    if lipschitz.is_nan() || lipschitz <= 0.0 {
        return Err(BakeError::Parameter { name: "lipschitz() of the source", value: lipschitz, needs: "a number above zero" });
    }
    let side = SIDE as Real * params.cell;
    let domain = region.inflated(params.band + params.cell);
    let counts = domain.size().map(|s| (s / side).ceil().max(1.0));
    let too_large =
        |bytes: Real| BakeError::TooLarge { bytes: bytes as usize, limit: params.memory, cell: params.cell, lipschitz };
    // 12 bytes a place: the directory, and the value in the middle while bricks are excluded.
    let places = counts.x * counts.y * counts.z;
    if places * 12.0 > params.memory as Real || places >= Real::from(INSIDE) {
        return Err(too_large(places * 12.0));
    }
    let size = [counts.x as usize, counts.y as usize, counts.z as usize];
    let places = size[0] * size[1] * size[2];
    let origin = domain.center() - counts * (0.5 * side);
    let middle = |at: usize| {
        let b = [at % size[0], at / size[0] % size[1], at / size[0] / size[1]];
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
        for (k, value) in values[..middles.len()].iter().enumerate() {
            if !value.is_finite() {
                return Err(BakeError::NotFinite { point: middles[k], sample: source.sample(&middles[k]) });
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
    // Re-distancing holds about four times the grid: raw and new values, nearest points, the queue.
    let factor = if params.redistance == Redistance::Never { 1.0 } else { 4.0 };
    let bytes = accuracy::bytes(kept.len(), places) as Real * factor;
    if bytes > params.memory as Real {
        return Err(too_large(bytes));
    }
    Ok(Bricks::new(origin, params.cell, size, directory, kept))
}

/// Asks the source once for every node.
pub(super) fn fill(bricks: &mut Bricks, source: &(impl SignedDistance + ?Sized)) -> Result<(), BakeError> {
    const BATCH: usize = 64;
    let nothing = FieldSample { distance: 0.0, gradient: Vector::zeros() };
    let (mut slots, mut points, mut samples) = (Vec::new(), Vec::new(), Vec::new());
    for first in (0..bricks.nodes.len()).step_by(BATCH * BRICK) {
        slots.clear();
        slots.extend((first..(first + BATCH * BRICK).min(bricks.nodes.len())).filter(|s| bricks.owns(*s)));
        points.clear();
        points.extend(slots.iter().map(|s| bricks.position(*s)));
        samples.resize(points.len(), nothing);
        source.samples(&points, &mut samples);
        for ((slot, point), sample) in slots.iter().zip(&points).zip(&samples) {
            let [x, y, z] = sample.gradient.into();
            let node = [sample.distance as f32, x as f32, y as f32, z as f32];
            if !node.iter().all(|v| v.is_finite()) {
                return Err(BakeError::NotFinite { point: *point, sample: *sample });
            }
            bricks.nodes[*slot] = node;
        }
    }
    bricks.spread();
    Ok(())
}

/// Where bricks end: inside the grid a missing brick is on the same side as the border, and at the end
/// of the grid all is outside.
pub(super) fn check_border(bricks: &Bricks) -> Result<(), BakeError> {
    for slot in 0..bricks.nodes.len() {
        let (distance, node) = (Real::from(bricks.nodes[slot][0]), bricks.node(slot));
        let (place, local) = (bricks.place((slot / BRICK) as u32), local(slot % BRICK));
        for k in 0..3 {
            let (end, next) = match local[k] {
                0 => (place[k] == 0, place[k].wrapping_sub(1)),
                SIDE => (place[k] + 1 == bricks.size[k], place[k] + 1),
                _ => continue,
            };
            if end {
                if distance < 0.0 {
                    return Err(BakeError::Leaves { point: bricks.at(node), distance });
                }
                continue;
            }
            let mut to = place;
            to[k] = next;
            let entry = bricks.directory[bricks.place_index(to)];
            if (entry == OUTSIDE && distance < 0.0) || (entry == INSIDE && distance > 0.0) {
                return Err(BakeError::Steep { point: bricks.at(node), distance });
            }
        }
    }
    for (at, entry) in bricks.directory.iter().enumerate() {
        let b = bricks.place_at(at);
        if *entry == INSIDE && (0..3).any(|k| b[k] == 0 || b[k] + 1 == bricks.size[k]) {
            return Err(BakeError::Leaves { point: bricks.at(b.map(|k| k * SIDE)), distance: Real::NEG_INFINITY });
        }
    }
    Ok(())
}
