//! Turns any field with the right zero set into the distance to that set.

use super::bricks::{BRICK, Bricks, NODES, Node, Reading, SIDE, local};
use if_core::math::{Point, Real, Vector, unit_or_zero};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A point is on the zero set when a Newton step moves it by less than this share of a cell. Ten times
/// more shows in the error (1e-5 of a cell is what the blend reaches), ten times less costs a step.
const SETTLED: Real = 1e-6;
/// It is the nearest when it would slide by less than this share of a cell. The slope errs by as much a
/// cell away, the distance by half its square.
const NEAREST: Real = 1e-4;
/// Steps towards the nearest point. Started at a neighbour's, nearly all settle in four.
const STEPS: usize = 16;
/// No node.
const NONE: u32 = u32::MAX;

/// Values and gradients of the true distance to the zero set of `raw`, for each of its nodes.
///
/// ```text
/// next to the zero set: start at the crossing of an edge, or at x − φ ∇φ / |∇φ|²
/// farther, nearest first: start at the nearest of the neighbours' points
/// refine:  p ← p + α t, t = (x − p) − n n·(x − p), then back to φ = 0 along n; halve α while it does not help
/// store:   ±|x − p| and ±(x − p) / |x − p|, with the sign of φ
/// ```
///
/// Nodes that no zero set reaches get `far` with the sign of φ, and no gradient.
pub(super) fn redistanced(raw: &Bricks, far: Real) -> Vec<Node> {
    let owners: Vec<usize> = (0..raw.nodes.len()).into_par_iter().filter(|s| raw.owns(*s)).collect();
    let mut nearest: Vec<Option<Point>> = owners.par_iter().map(|slot| seed(raw, *slot)).collect();
    carry_outwards(raw, &owners, &mut nearest);
    let values: Vec<Node> = owners
        .par_iter()
        .zip(&nearest)
        .map(|(slot, p)| stored(raw, *slot, p.map(|p| refined(raw, &raw.position(*slot), p)).as_ref(), far))
        .collect();
    let mut nodes = vec![[0.0; 4]; raw.nodes.len()];
    owners.iter().zip(values).for_each(|(slot, value)| nodes[*slot] = value);
    nodes
}

/// Gives every node the nearest of its neighbours' points, nearest nodes first.
fn carry_outwards(raw: &Bricks, owners: &[usize], nearest: &mut [Option<Point>]) {
    let mut id_of = vec![NONE; raw.nodes.len()];
    for (id, slot) in owners.iter().enumerate() {
        id_of[*slot] = id as u32;
    }
    // Distances are not negative: their bits sort as they do.
    let length = |id: usize, p: &Point| (raw.position(owners[id]) - p).norm().to_bits();
    let mut heap: BinaryHeap<Reverse<(u64, u32)>> = BinaryHeap::new();
    for (id, p) in nearest.iter().enumerate() {
        if let Some(p) = p {
            heap.push(Reverse((length(id, p), id as u32)));
        }
    }
    while let Some(Reverse((at, id))) = heap.pop() {
        let id = id as usize;
        // An entry that a nearer one has overtaken is void.
        let Some(p) = nearest[id].filter(|p| length(id, p) == at) else { continue };
        for slot in neighbours(raw, owners[id]) {
            let other = id_of[slot] as usize;
            let offered = length(other, &p);
            if nearest[other].is_none_or(|q| offered < length(other, &q)) {
                nearest[other] = Some(p);
                heap.push(Reverse((offered, other as u32)));
            }
        }
    }
}

/// The slots that speak for the up to six nodes next to that of `slot`.
fn neighbours(raw: &Bricks, slot: usize) -> impl Iterator<Item = usize> {
    let node = raw.node(slot);
    let inner = local(slot % BRICK).map(|l| 0 < l && l + 1 < SIDE);
    (0..6).filter_map(move |k| {
        let axis = k / 2;
        if inner == [true; 3] {
            let step = [1, NODES, NODES * NODES][axis];
            return Some(if k % 2 == 0 { slot + step } else { slot - step });
        }
        let mut to = node;
        to[axis] = if k % 2 == 0 { to[axis] + 1 } else { to[axis].checked_sub(1)? };
        raw.owner(to)
    })
}

fn stored(raw: &Bricks, slot: usize, nearest: Option<&Point>, far: Real) -> Node {
    let sign = if raw.nodes[slot][0] < 0.0 { -1.0 } else { 1.0 };
    let Some(p) = nearest else { return [(sign * far) as f32, 0.0, 0.0, 0.0] };
    let arm = raw.position(slot) - p;
    // On the surface itself the arm has no direction, but the field has.
    let gradient = match raw.read(p) {
        Reading::Blend(_, g) if arm.norm() < 1e-3 * raw.cell => unit_or_zero(&g),
        _ => unit_or_zero(&arm) * sign,
    };
    [(sign * arm.norm()) as f32, gradient.x as f32, gradient.y as f32, gradient.z as f32]
}

/// A point of the zero set near a node that lies next to it.
fn seed(raw: &Bricks, slot: usize) -> Option<Point> {
    let x = raw.position(slot);
    let [value, gx, gy, gz] = raw.nodes[slot].map(Real::from);
    let gradient = Vector::new(gx, gy, gz);
    let mut best: Option<(Real, Point)> = None;
    let mut offer = |p: Point| {
        let d = (x - p).norm();
        if best.is_none_or(|b| d < b.0) {
            best = Some((d, p));
        }
    };
    for other in neighbours(raw, slot) {
        let there = Real::from(raw.nodes[other][0]);
        if (value < 0.0) != (there < 0.0) {
            offer(x + (raw.position(other) - x) * (value / (value - there)));
        }
    }
    let steepness = gradient.norm_squared();
    // Half a cell's diagonal: a zero set that passes between the nodes.
    if steepness > 0.0 && value.abs() < 0.87 * raw.cell * steepness.sqrt() {
        offer(x - gradient * (value / steepness));
    }
    let p = on_surface(raw, best?.1)?;
    Some(refined(raw, &x, p))
}

/// Newton steps along the gradient to φ = 0; `None` if they leave the grid or do not settle.
fn on_surface(raw: &Bricks, mut p: Point) -> Option<Point> {
    for _ in 0..8 {
        let Reading::Blend(value, gradient) = raw.read(&p) else { return None };
        let steepness = gradient.norm_squared();
        if steepness <= 0.0 {
            return None;
        }
        let step = gradient * (value / steepness);
        p -= step * (raw.cell / step.norm()).min(1.0);
        if step.norm() < SETTLED * raw.cell {
            return Some(p);
        }
    }
    None
}

/// Slides `p` along the zero set to where it is nearest to `x`.
fn refined(raw: &Bricks, x: &Point, mut p: Point) -> Point {
    let mut share = 1.0;
    for _ in 0..STEPS {
        let Reading::Blend(_, gradient) = raw.read(&p) else { return p };
        let n = unit_or_zero(&gradient);
        let arm = x - p;
        let along = arm - n * n.dot(&arm);
        if along.norm() < NEAREST * raw.cell {
            return p;
        }
        let step = along * share;
        let step = step * (raw.cell / step.norm()).min(1.0);
        match on_surface(raw, p + step) {
            Some(q) if (x - q).norm() < arm.norm() => p = q,
            _ if share < 0.1 => return p,
            _ => share *= 0.5,
        }
    }
    p
}
