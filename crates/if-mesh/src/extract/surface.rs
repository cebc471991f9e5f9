//! Crossings of the surface with the lattice: edges, their vertices, and the triangles between them,
//! 64 cells at a time.

use crate::extract::cases::CASES;
use crate::extract::rows::{Bits, NodeWord, Rows, Scratch, WORD, below, each_bit};
use if_core::math::Real;
use rayon::prelude::*;

/// The lattice edges with ends of both signs: one vertex each.
///
/// Vertices are numbered by the lower node of their edge, in the order of the lattice, then by the
/// edge's axis. The numbering depends on the signs alone, and not on which other nodes are known.
pub(super) struct Crossings<'a> {
    rows: &'a Rows<NodeWord>,
    /// One for each word of nodes.
    words: Vec<Crossed>,
    /// Number of vertices.
    pub(super) count: usize,
}

/// The crossed edges that go up from 64 nodes, as bits for each axis.
#[derive(Clone, Copy, Default)]
struct Crossed {
    axes: [u64; 3],
    /// Index of the first vertex.
    first: u32,
}

impl Crossed {
    #[inline]
    fn vertex(&self, bit: u32, axis: u8) -> u32 {
        let mask = below(bit);
        let before: u32 = self.axes.iter().map(|a| (a & mask).count_ones()).sum();
        let here: u32 = self.axes[..usize::from(axis)].iter().map(|a| (a >> bit & 1) as u32).sum();
        self.first + before + here
    }
}

/// A crossed edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Edge {
    /// Its lower node.
    pub(super) node: [u32; 3],
    /// 0, 1 or 2 for x, y or z.
    pub(super) axis: u8,
    /// The field at the lower and the upper node.
    pub(super) values: [Real; 2],
}

/// Moves along a row's words in step with another row.
struct Follow<'a> {
    row: &'a [NodeWord],
    first: usize,
    at: usize,
}

impl<'a> Follow<'a> {
    fn new(rows: &'a Rows<NodeWord>, y: u32, z: u32) -> Self {
        let (row, first) = rows.row(y, z);
        Self { row, first, at: 0 }
    }

    /// The word at `x` and its index. `x` must not decrease.
    #[inline]
    fn to(&mut self, x: u32) -> Option<(&'a NodeWord, usize)> {
        while self.row.get(self.at)?.x < x {
            self.at += 1;
        }
        let word = &self.row[self.at];
        (word.x == x).then_some((word, self.first + self.at))
    }

    /// The word after the one that `to` returned, if it has the next 64 nodes.
    #[inline]
    fn next(&self, x: u32) -> Option<(&'a NodeWord, usize)> {
        let word = self.row.get(self.at + 1)?;
        (word.x == x + 1).then_some((word, self.first + self.at + 1))
    }
}

/// A word shifted down by one place, with the first bit of the next one.
#[inline]
fn shifted(word: u64, next: u64) -> u64 {
    word >> 1 | next << (WORD - 1)
}

impl<'a> Crossings<'a> {
    pub(super) fn of(rows: &'a Rows<NodeWord>) -> Self {
        let planes: Vec<Vec<Crossed>> = (0..rows.size[2])
            .into_par_iter()
            .map(|z| {
                let mut out = Vec::with_capacity(rows.planes(z..z + 1).len());
                for y in 0..rows.size[1] {
                    let row = rows.row(y, z).0;
                    let mut up = [Follow::new(rows, y + 1, z), Follow::new(rows, y, z + 1)];
                    for (k, w) in row.iter().enumerate() {
                        let next = row.get(k + 1).filter(|n| n.x == w.x + 1);
                        let (known, inside) = next.map_or((0, 0), |n| (n.known, n.inside));
                        let along = (w.inside ^ shifted(w.inside, inside))
                            & w.known
                            & shifted(w.known, known);
                        let [y, z] = up.each_mut().map(|up| {
                            up.to(w.x).map_or(0, |u| (w.inside ^ u.0.inside) & w.known & u.0.known)
                        });
                        out.push(Crossed { axes: [along, y, z], first: 0 });
                    }
                }
                out
            })
            .collect();
        let mut words = planes.concat();
        let mut count = 0;
        for w in &mut words {
            w.first = count as u32;
            count += w.axes.iter().map(|a| a.count_ones() as usize).sum::<usize>();
        }
        Self { rows, words, count }
    }

    /// The crossed edges in the order of their vertices. `value` returns a value of the field by its
    /// index.
    pub(super) fn edges(&self, value: impl Fn(usize) -> Real + Sync) -> Vec<Edge> {
        let rows = self.rows;
        let planes: Vec<Vec<Edge>> = (0..rows.size[2])
            .into_par_iter()
            .map(|z| {
                let mut out = Vec::new();
                for y in 0..rows.size[1] {
                    let (row, first) = rows.row(y, z);
                    let mut up = [Follow::new(rows, y + 1, z), Follow::new(rows, y, z + 1)];
                    for (k, w) in row.iter().enumerate() {
                        let axes = self.words[first + k].axes;
                        let any = axes[0] | axes[1] | axes[2];
                        if any == 0 {
                            continue;
                        }
                        let next = row.get(k + 1).filter(|n| n.x == w.x + 1);
                        let above = up.each_mut().map(|up| up.to(w.x).map(|u| u.0));
                        each_bit(any, |bit| {
                            let low = value(w.value(bit));
                            let along = || {
                                if bit + 1 < WORD {
                                    Some(w.value(bit + 1))
                                } else {
                                    next.map(|n| n.value(0))
                                }
                            };
                            let ends = [
                                along(),
                                above[0].map(|u| u.value(bit)),
                                above[1].map(|u| u.value(bit)),
                            ];
                            for (axis, end) in
                                ends.into_iter().enumerate().filter(|e| axes[e.0] >> bit & 1 == 1)
                            {
                                let high = end.map_or(low, &value);
                                out.push(Edge {
                                    node: [w.x * WORD + bit, y, z],
                                    axis: axis as u8,
                                    values: [low, high],
                                });
                            }
                        });
                    }
                }
                out
            })
            .collect();
        planes.concat()
    }

    /// Triangles of all cells whose eight corners are known, in the order of the lattice.
    pub(super) fn triangles(&self) -> Vec<[u32; 3]> {
        let planes: Vec<Vec<[u32; 3]>> = (0..self.rows.size[2].saturating_sub(1))
            .into_par_iter()
            .map(|z| {
                let mut out = Vec::new();
                (0..self.rows.size[1].saturating_sub(1))
                    .for_each(|y| self.triangles_of_row(y, z, &mut out));
                out
            })
            .collect();
        planes.concat()
    }

    fn triangles_of_row(&self, y: u32, z: u32, out: &mut Vec<[u32; 3]>) {
        let cases = &*CASES;
        let row = self.rows.row(y, z).0;
        let mut four = [0, 1, 2, 3].map(|r| Follow::new(self.rows, y + (r & 1), z + (r >> 1)));
        for w in row {
            // Bits of the nodes of each row, and of the nodes one further along x.
            let (mut low, mut high, mut known) = ([0; 4], [0; 4], u64::MAX);
            let mut numbers = [[0; 2]; 4];
            for (r, follow) in four.iter_mut().enumerate() {
                let Some((here, at)) = follow.to(w.x) else {
                    known = 0;
                    continue;
                };
                let next = follow.next(w.x);
                let (next_known, next_inside) = next.map_or((0, 0), |n| (n.0.known, n.0.inside));
                (low[r], high[r]) = (here.inside, shifted(here.inside, next_inside));
                known &= here.known & shifted(here.known, next_known);
                numbers[r] = [at, next.map_or(at, |n| n.1)];
            }
            let any = low.iter().chain(&high).fold(0, |any, bits| any | bits);
            let all = low.iter().chain(&high).fold(u64::MAX, |all, bits| all & bits);
            each_bit(any & !all & known, |bit| {
                let case = (0..4).fold(0, |case, r| {
                    case | ((low[r] >> bit & 1) | (high[r] >> bit & 1) << 1) << (2 * r)
                });
                let vertex = |edge: u8| {
                    let (corner, axis) = (edge / 3, edge % 3);
                    let bit = bit + u32::from(corner & 1);
                    let number = numbers[usize::from(corner >> 1)][(bit / WORD) as usize];
                    self.words[number].vertex(bit % WORD, axis)
                };
                out.extend(cases[case as usize].iter().map(|t| t.map(vertex)));
            });
        }
    }

    /// The cells around crossed edges.
    pub(super) fn cells(&self) -> Rows<Bits> {
        let size = self.rows.size.map(|s| s.saturating_sub(1));
        let words = size[0].div_ceil(WORD) as usize;
        Rows::build(size, |y, z, out| {
            let node_rows = [0, 1, 2, 3].map(|r| self.rows.row(y + (r & 1), z + (r >> 1)));
            if node_rows.iter().all(|r| r.0.is_empty()) {
                return;
            }
            let mut scratch = Scratch::new(words);
            for (r, (row, first)) in node_rows.into_iter().enumerate() {
                for (k, w) in row.iter().enumerate() {
                    let axes = self.words[first + k].axes;
                    // Edges along y are shared by the cells beside them in x and z, but not in y;
                    // along z likewise.
                    let beside = if r & 1 == 0 { axes[1] } else { 0 }
                        | if r >> 1 == 0 { axes[2] } else { 0 };
                    scratch.or(w.x, axes[0] | beside);
                    scratch.or_down(w.x, beside);
                }
            }
            scratch.cut(size[0]);
            scratch.push_into(out);
        })
    }

    /// Number of crossed edges in the border of the lattice, beyond which the surface continues.
    pub(super) fn on_border(&self) -> usize {
        let last = self.rows.size.map(|s| s - 1);
        let on = |k: usize, c: u32| c == 0 || c == last[k];
        let mut count = 0;
        for z in 0..self.rows.size[2] {
            for y in 0..self.rows.size[1] {
                let (row, first) = self.rows.row(y, z);
                for (k, w) in row.iter().enumerate() {
                    let axes = self.words[first + k].axes;
                    let mut ends = 0;
                    for x in [0, last[0]] {
                        ends |= if x / WORD == w.x { 1 << (x % WORD) } else { 0 };
                    }
                    let keep = |all: bool, bits: u64| if all { bits } else { bits & ends };
                    let along = if on(1, y) || on(2, z) { axes[0] } else { 0 };
                    let found = [along, keep(on(2, z), axes[1]), keep(on(1, y), axes[2])];
                    count += found.iter().map(|b| b.count_ones() as usize).sum::<usize>();
                }
            }
        }
        count
    }

    /// Consecutive vertices on a line of the lattice, one or two edges apart: candidates for near
    /// sheets.
    pub(super) fn neighbours_on_lines(&self) -> Vec<[u32; 2]> {
        let rows = self.rows;
        let crossed = |w: Option<usize>, axis: usize| w.map_or(0, |w| self.words[w].axes[axis]);
        let planes: Vec<Vec<[u32; 2]>> = (0..rows.size[2])
            .into_par_iter()
            .map(|z| {
                let mut out = Vec::new();
                for y in 0..rows.size[1] {
                    let (row, first) = rows.row(y, z);
                    for (k, w) in row.iter().enumerate() {
                        let here = &self.words[first + k];
                        for axis in 0..3 {
                            for apart in 1..=2u32 {
                                let there = match axis {
                                    0 => None,
                                    1 => rows.find(w.x, y + apart, z),
                                    _ => rows.find(w.x, y, z + apart),
                                };
                                let next = row
                                    .get(k + 1)
                                    .filter(|n| n.x == w.x + 1)
                                    .map(|_| first + k + 1);
                                let other = if axis == 0 {
                                    here.axes[0] >> apart | crossed(next, 0) << (WORD - apart)
                                } else {
                                    crossed(there, axis)
                                };
                                each_bit(here.axes[axis] & other, |bit| {
                                    let second = if axis > 0 {
                                        there.map(|w| self.words[w].vertex(bit, axis as u8))
                                    } else if bit + apart < WORD {
                                        Some(here.vertex(bit + apart, 0))
                                    } else {
                                        next.map(|w| self.words[w].vertex(bit + apart - WORD, 0))
                                    };
                                    out.extend(second.map(|v| [here.vertex(bit, axis as u8), v]));
                                });
                            }
                        }
                    }
                }
                out
            })
            .collect();
        planes.concat()
    }
}
