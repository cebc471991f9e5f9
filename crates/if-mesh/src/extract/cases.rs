//! The 256 cases of a cube, derived from one rule for its faces.
//!
//! Corner `c` of the cube has the coordinates `(c & 1, c >> 1 & 1, c >> 2 & 1)`. An edge is named
//! by its lower corner and its axis, as `3 · corner + axis`.

use std::sync::LazyLock;

/// For each set of inside corners (bit `c` for corner `c`) the triangles of the surface, each as
/// three edges of the cube, counter-clockwise seen from outside.
pub(super) static CASES: LazyLock<Vec<Vec<[u8; 3]>>> =
    LazyLock::new(|| (0..=255).map(triangles).collect());

/// The corners of the six sides, counter-clockwise seen from outside the cube.
const SIDES: [[u8; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// No edge.
const NONE: u8 = u8::MAX;

/// The number of the edge between two neighbouring corners.
fn edge(a: u8, b: u8) -> u8 {
    3 * a.min(b) + (a ^ b).trailing_zeros() as u8
}

/// Whether two edges lie on one side of the cube. A diagonal between them would lie in that side,
/// where the neighbouring cube may draw the same one: four triangles would meet there.
fn share_a_side(a: u8, b: u8) -> bool {
    let on = |e: u8, side: &[u8; 4]| (0..4).any(|k| edge(side[k], side[(k + 1) % 4]) == e);
    SIDES.iter().any(|side| on(a, side) && on(b, side))
}

fn triangles(inside: u8) -> Vec<[u8; 3]> {
    // On each side, each run of inside corners is cut off by one segment, from the edge where the
    // walk round the side enters the run to the edge where it leaves. Two opposite inside corners
    // are two runs: this is the one rule for ambiguous sides, and as it looks at nothing but the
    // side, the cube beyond draws the same segments.
    let is_in = |c: u8| inside >> c & 1 == 1;
    let mut next = [NONE; 24];
    for side in &SIDES {
        for start in 0..4 {
            let (before, first) = (side[(start + 3) % 4], side[start]);
            if is_in(first) && !is_in(before) {
                let mut last = start;
                while is_in(side[(last + 1) % 4]) {
                    last = (last + 1) % 4;
                }
                next[edge(before, first) as usize] = edge(side[last], side[(last + 1) % 4]);
            }
        }
    }
    // The segments chain up to closed loops.
    let mut out = Vec::new();
    for start in 0..24 {
        let mut cycle = Vec::new();
        let mut at = start;
        while next[at] != NONE {
            cycle.push(at as u8);
            at = std::mem::replace(&mut next[at], NONE) as usize;
        }
        if cycle.len() >= 3 {
            fill(&cycle, 0, cycle.len() - 1, &mut out);
        }
    }
    out
}

/// The longest loop, of which long diagonals let triangles cross where vertices lie near the ends of
/// their edges.
const LONGEST: usize = 7;

/// Diagonals in sides of the cube, and the sum of squared lengths of all.
type Cost = (usize, usize);

/// Fills the part `from ..= to` of a loop, closed by the diagonal between its ends, with as few
/// diagonals in sides of the cube as can be, and in the longest loops with short ones.
fn fill(cycle: &[u8], from: usize, to: usize, out: &mut Vec<[u8; 3]>) -> Cost {
    if to - from < 2 {
        return (0, 0);
    }
    let diagonal = |i: usize, j: usize| {
        if j - i == 1 {
            return (0, 0);
        }
        let (a, b) = (cycle[i], cycle[j]);
        (usize::from(share_a_side(a, b)), if cycle.len() < LONGEST { 0 } else { apart(a, b) })
    };
    let mut best: Option<(Cost, Vec<[u8; 3]>)> = None;
    for middle in from + 1..to {
        let mut part = vec![[cycle[from], cycle[middle], cycle[to]]];
        let costs = [
            diagonal(from, middle),
            diagonal(middle, to),
            fill(cycle, from, middle, &mut part),
            fill(cycle, middle, to, &mut part),
        ];
        let cost = costs.iter().fold((0, 0), |sum, c| (sum.0 + c.0, sum.1 + c.1));
        if best.as_ref().is_none_or(|b| cost < b.0) {
            best = Some((cost, part));
        }
    }
    let (cost, part) = best.unwrap_or_default();
    out.extend(part);
    cost
}

/// Squared distance between the middles of two edges, in half edges.
fn apart(a: u8, b: u8) -> usize {
    let middle = |e: u8, k: u8| 2 * ((e / 3) >> k & 1) + u8::from(e % 3 == k);
    (0..3).map(|k| usize::from(middle(a, k).abs_diff(middle(b, k))).pow(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extract::polish::MARGIN;
    use if_core::intersect::triangles_sharing;
    use if_core::math::{Point, Real};
    use if_core::random::SplitMix64;
    use std::collections::BTreeMap;

    #[test]
    fn one_corner_is_cut_off_by_one_triangle_that_faces_away_from_it() {
        assert!(CASES[0].is_empty() && CASES[255].is_empty());
        let mut corner = CASES[1][0];
        corner.sort_unstable();
        assert_eq!((CASES[1].len(), corner), (1, [0, 1, 2]));
        let first = CASES[1][0].iter().position(|e| *e == 0).unwrap();
        assert_eq!(
            [0, 1, 2].map(|k| CASES[1][0][(first + k) % 3]),
            [0, 1, 2],
            "x, y, z: counter-clockwise from (1, 1, 1)"
        );
    }

    #[test]
    fn every_case_uses_exactly_the_crossed_edges_and_no_diagonal_lies_in_a_side() {
        for (case, triangles) in CASES.iter().enumerate() {
            let mut sides = BTreeMap::new();
            for t in triangles {
                for k in 0..3 {
                    *sides.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
                }
            }
            assert!(
                sides.values().all(|n| *n == 1),
                "case {case}: an edge of two triangles in one direction"
            );
            for &(a, b) in sides.keys() {
                if sides.contains_key(&(b, a)) {
                    assert!(!share_a_side(a, b), "case {case}: diagonal {a} {b} in a side");
                } else {
                    assert!(share_a_side(a, b), "case {case}: border {a} {b} within the cube");
                }
            }
            for corner in 0..8u8 {
                for axis in (0..3).filter(|axis| corner >> axis & 1 == 0) {
                    let crossed = (case >> corner & 1) != (case >> (corner | 1 << axis) & 1);
                    let used = triangles.iter().flatten().any(|e| *e == 3 * corner + axis);
                    assert_eq!(crossed, used, "case {case}: edge of corner {corner} along {axis}");
                }
            }
        }
    }

    #[test]
    fn no_triangles_of_a_case_cross_wherever_the_vertices_lie_on_their_edges() {
        let place = |e: u8, t: Real| {
            let corner = e / 3;
            let mut p = Point::from([0, 1, 2].map(|k| Real::from(corner >> k & 1)));
            p[usize::from(e % 3)] += t;
            p
        };
        let mut random = SplitMix64::new(3);
        for (case, triangles) in CASES.iter().enumerate() {
            for round in 0..200 {
                let points: Vec<Point> = (0..24)
                    .map(|e| {
                        let t = random.unit();
                        let end = if t < 0.5 { MARGIN } else { 1.0 - MARGIN };
                        place(e, if round % 2 == 0 { end } else { t })
                    })
                    .collect();
                let corners = |t: &[u8; 3]| t.map(|e| &points[usize::from(e)]);
                for (k, a) in triangles.iter().enumerate() {
                    for b in &triangles[..k] {
                        let (ia, ib) = (a.map(u32::from), b.map(u32::from));
                        let contact = triangles_sharing(corners(a), ia, corners(b), ib);
                        assert!(!contact.is_some(), "case {case}: {a:?} and {b:?} {points:?}");
                    }
                }
            }
        }
    }
}
