//! Joins small cells to large ones without a gap.
//!
//! On the border to larger cells, nodes and edges of smaller ones take what the larger cell's blend
//! has there. On each side of a cell the blend is bilinear but for terms u (1 − u) that are linear
//! in the other coordinate; a part of the side has as many values and bumps as fix such a function.
//! So both blends agree on all of the border, and the field is continuous but for rounding.

use super::blend::{BRICK, NODES, Node, SIDE, blend, local};
use super::bricks::Bricks;
use super::directory::{INSIDE, Place, SPLIT};
use if_core::math::Real;
use rayon::prelude::*;

/// A larger brick beside a smaller one.
#[derive(Clone, Copy)]
struct Larger {
    brick: usize,
    place: Place,
}

/// Changes the nodes of small cells on the border to larger ones: the field has no gap then.
pub(super) fn join(bricks: &mut Bricks) {
    let leaves = bricks.leaves();
    let deepest = leaves.iter().map(|b| bricks.places[*b as usize].level).max().unwrap_or(0);
    // Larger cells first: what a border takes is final.
    for level in 1..=deepest {
        let changed: Vec<(u32, [Node; BRICK])> = leaves
            .par_iter()
            .filter(|b| bricks.places[**b as usize].level == level)
            .filter_map(|b| joined(bricks, *b as usize).map(|nodes| (*b, nodes)))
            .collect();
        for (brick, nodes) in changed {
            bricks.nodes[brick as usize * BRICK..(brick as usize + 1) * BRICK]
                .copy_from_slice(&nodes);
        }
    }
}

/// The nodes of a brick that has larger neighbours.
fn joined(bricks: &Bricks, brick: usize) -> Option<[Node; BRICK]> {
    let place = bricks.places[brick];
    let neighbours = larger_neighbours(bricks, &place);
    if neighbours.iter().all(Option::is_none) {
        return None;
    }
    let mut nodes = [[0.0; 4]; BRICK];
    nodes.copy_from_slice(&bricks.nodes[brick * BRICK..(brick + 1) * BRICK]);
    for (index, node) in nodes.iter_mut().enumerate() {
        let l = local(index);
        if l.iter().all(|l| 0 < *l && *l < SIDE) {
            continue;
        }
        let at = bricks.node(brick, index).map(Real::from);
        if let Some(larger) = largest(&neighbours, l, None) {
            let (slot, u, _) = within(&larger, &place, at);
            node[0] = blend(&bricks.nodes, slot, u, 1.0).0 as f32;
        }
        for axis in (0..3).filter(|a| l[*a] < SIDE) {
            if let Some(larger) = largest(&neighbours, l, Some(axis)) {
                let mut middle = at;
                middle[axis] += 0.5;
                node[axis + 1] = bump(bricks, &larger, &place, middle, axis);
            }
        }
    }
    Some(nodes)
}

/// The larger bricks round `place`: those one brick off by −1, 0 and 1 along x, then y, then z.
fn larger_neighbours(bricks: &Bricks, place: &Place) -> [Option<Larger>; 27] {
    let mut out = [None; 27];
    for (k, out) in out.iter_mut().enumerate() {
        let step = [k % 3, k / 3 % 3, k / 9];
        let at = [0, 1, 2].map(|a| i64::from(place.at[a]) + step[a] as i64 - 1);
        if (0..3).any(|a| at[a] < 0 || at[a] >= (bricks.size[a] as i64) << place.level) {
            continue;
        }
        let (entry, level) = bricks.entry(&Place { level: place.level, at: at.map(|a| a as u32) });
        if level < place.level && entry < SPLIT && entry < INSIDE {
            *out = Some(Larger { brick: entry as usize, place: bricks.places[entry as usize] });
        }
    }
    out
}

/// Of the bricks that touch a node, or the edge that leads from it along `axis`, the largest, if it
/// is larger than the node's own.
fn largest(
    neighbours: &[Option<Larger>; 27],
    l: [usize; 3],
    axis: Option<usize>,
) -> Option<Larger> {
    let reach = |k: usize| match l[k] {
        _ if axis == Some(k) => 1..=1,
        0 => 0..=1,
        SIDE => 1..=2,
        _ => 1..=1usize,
    };
    let mut found: Option<Larger> = None;
    for z in reach(2) {
        for y in reach(1) {
            for x in reach(0) {
                if let Some(n) = neighbours[(z * 3 + y) * 3 + x]
                    && found.is_none_or(|f| n.place.level < f.place.level)
                {
                    found = Some(n);
                }
            }
        }
    }
    found
}

/// The cell of `larger` that has the point `at`, given in nodes of the level of `place`; where in
/// it; and the ratio of the cells.
fn within(larger: &Larger, place: &Place, at: [Real; 3]) -> (usize, [Real; 3], Real) {
    let ratio = Real::from(1u32 << (place.level - larger.place.level));
    let (mut slot, mut u) = (larger.brick * BRICK, [0.0; 3]);
    for (k, stride) in [1, NODES, NODES * NODES].into_iter().enumerate() {
        let x = at[k] / ratio - Real::from(larger.place.at[k]) * SIDE as Real;
        let cell = (x.max(0.0) as usize).min(SIDE - 1);
        u[k] = x - cell as Real;
        slot += cell * stride;
    }
    (slot, u, ratio)
}

/// The bump of an edge along `axis` with the middle `at`: a bump goes with the square of the edge.
fn bump(bricks: &Bricks, larger: &Larger, place: &Place, at: [Real; 3], axis: usize) -> f32 {
    let (slot, u, ratio) = within(larger, place, at);
    let stride = [1, NODES, NODES * NODES];
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let get = |s: usize| Real::from(bricks.nodes[s][axis + 1]);
    let mix = |x: Real, y: Real, t: Real| x + (y - x) * t;
    let low = mix(get(slot), get(slot + stride[a]), u[a]);
    let high = mix(get(slot + stride[b]), get(slot + stride[a] + stride[b]), u[a]);
    (mix(low, high, u[b]) / (ratio * ratio)) as f32
}
