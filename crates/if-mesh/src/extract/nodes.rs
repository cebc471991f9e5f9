//! The nodes of a level that are needed, and the values of the field there.

use crate::extract::budget::Budget;
use crate::extract::error::ExtractError;
use crate::extract::lattice::{Lattice, Level};
use crate::extract::memory;
use crate::extract::rows::{Bits, NodeWord, Rows, WORD, each_bit};
use if_core::field::SignedDistance;
use if_core::math::{Point, Real};
use rayon::prelude::*;

/// Maximum points in one call of the field, rounded up to whole planes: 24 MB of points. Levels of
/// surfaces up to a million nodes are one call.
const BATCH: usize = 1 << 20;

/// Nodes with values, in the order of the lattice: x fastest, z slowest.
pub(super) struct Nodes {
    pub(super) rows: Rows<NodeWord>,
    pub(super) values: Vec<Real>,
}

impl Nodes {
    /// Bytes of all nodes.
    pub(super) fn bytes(&self) -> usize {
        self.rows.bytes() + self.values.len() * size_of::<Real>()
    }

    /// The value at a node, if it is known.
    pub(super) fn get(&self, [x, y, z]: [u32; 3]) -> Option<Real> {
        let word = self.rows.words()[self.rows.find(x / WORD, y, z)?];
        let bit = x % WORD;
        (word.known >> bit & 1 == 1).then(|| self.values[word.value(bit)])
    }

    /// The steepest slope between known neighbours along an axis, less `noise` in their values.
    pub(super) fn steepest(&self, lattice: &Lattice, level: &Level, noise: Real) -> Real {
        let last = self.rows.size.map(|s| s.saturating_sub(1));
        (0..self.rows.size[2])
            .into_par_iter()
            .map(|z| {
                let mut most: Real = 0.0;
                for y in 0..self.rows.size[1] {
                    for w in self.rows.row(y, z).0 {
                        each_bit(w.known, |bit| {
                            let node = [w.x * WORD + bit, y, z];
                            let here = self.values[w.value(bit)];
                            for axis in (0..3).filter(|k| node[*k] < last[*k]) {
                                let mut up = node;
                                up[axis] += 1;
                                if let Some(there) = self.get(up) {
                                    let cells = level.finest(lattice, up)[axis]
                                        - level.finest(lattice, node)[axis];
                                    let length = Real::from(cells) * lattice.cell;
                                    most = most.max(((there - here).abs() - 2.0 * noise) / length);
                                }
                            }
                        });
                    }
                }
                most
            })
            .reduce(|| 0.0, Real::max)
    }

    /// Evaluates the field at the corners of `cells` of a level, except those for which `known`
    /// returns a value. The caller holds `held` bytes beside them.
    pub(super) fn evaluate(
        field: &dyn SignedDistance,
        lattice: &Lattice,
        level: &Level,
        cells: &Rows<Bits>,
        known: impl Fn([u32; 3]) -> Option<Real> + Sync,
        held: usize,
        budget: &mut Budget,
    ) -> Result<Self, ExtractError> {
        budget.room(held, memory::corners(cells))?;
        let places = cells.corners();
        let total = places.count();
        if u32::try_from(total).is_err() {
            return Err(ExtractError::TooManyNodes { nodes: total });
        }
        let of_plane = |z| -> usize {
            places.words()[places.planes(z..z + 1)]
                .iter()
                .map(|w| w.bits.count_ones() as usize)
                .sum()
        };
        let largest = (0..places.size[2]).map(of_plane).max().unwrap_or(0);
        budget.room(
            held + places.bytes(),
            memory::nodes(&places, total, largest.max(BATCH).min(total)),
        )?;
        // Values are evaluated in batches of whole planes.
        let mut rows = numbered(&places);
        drop(places);
        let mut values = vec![0.0; total];
        let mut z = 0;
        while z < rows.size[2] {
            let mut end = z + 1;
            let nodes = |z: std::ops::Range<u32>| -> usize {
                rows.words()[rows.planes(z)].iter().map(|w| w.known.count_ones() as usize).sum()
            };
            let mut count = nodes(z..end);
            while end < rows.size[2] {
                let next = nodes(end..end + 1);
                if count + next > BATCH {
                    break;
                }
                (count, end) = (count + next, end + 1);
            }
            evaluate_planes(field, lattice, level, &rows, z..end, &known, &mut values, budget)?;
            z = end;
        }
        // Signs, one bit a node.
        let all = &values;
        rows.words_mut().par_iter_mut().for_each(|w| {
            let mut at = w.base as usize;
            let mut inside = 0;
            each_bit(w.known, |bit| {
                inside |= u64::from(all[at] < 0.0) << bit;
                at += 1;
            });
            w.inside = inside;
        });
        Ok(Self { rows, values })
    }
}

/// The words of a set of nodes, with indices of their values.
fn numbered(places: &Rows<Bits>) -> Rows<NodeWord> {
    let mut rows = Rows::build(places.size, |y, z, out| {
        out.extend(places.row(y, z).0.iter().map(|w| NodeWord {
            x: w.x,
            base: 0,
            known: w.bits,
            inside: 0,
        }));
    });
    let mut base = 0;
    for w in rows.words_mut() {
        w.base = base;
        base += w.known.count_ones();
    }
    rows
}

/// Nodes of one plane: indices and values of the known ones, indices and positions of the others.
type PlaneNodes = (Vec<(u32, Real)>, Vec<u32>, Vec<Point>);

/// Evaluates the field at the nodes of `planes`.
fn evaluate_planes(
    field: &dyn SignedDistance,
    lattice: &Lattice,
    level: &Level,
    rows: &Rows<NodeWord>,
    planes: std::ops::Range<u32>,
    known: &(impl Fn([u32; 3]) -> Option<Real> + Sync),
    values: &mut [Real],
    budget: &mut Budget,
) -> Result<(), ExtractError> {
    let parts: Vec<PlaneNodes> = planes
        .into_par_iter()
        .map(|z| {
            let (mut had, mut missing, mut points) = (Vec::new(), Vec::new(), Vec::new());
            for y in 0..rows.size[1] {
                for w in rows.row(y, z).0 {
                    let mut at = w.base;
                    each_bit(w.known, |bit| {
                        let node = [w.x * WORD + bit, y, z];
                        match known(node) {
                            Some(value) => had.push((at, value)),
                            None => {
                                missing.push(at);
                                points.push(lattice.node(level.finest(lattice, node)));
                            }
                        }
                        at += 1;
                    });
                }
            }
            (had, missing, points)
        })
        .collect();
    let (mut missing, mut points) = (Vec::new(), Vec::new());
    for (had, m, p) in parts {
        had.iter().for_each(|(at, value)| values[*at as usize] = *value);
        missing.extend(m);
        points.extend(p);
    }
    let mut fresh = vec![0.0; points.len()];
    field.distances(&points, &mut fresh);
    if let Some(k) = fresh.iter().position(|v| v.is_nan()) {
        return Err(ExtractError::NotANumber { point: points[k] });
    }
    missing.iter().zip(&fresh).for_each(|(at, value)| values[*at as usize] = *value);
    Ok(budget.refined(level.step, points.len())?)
}
