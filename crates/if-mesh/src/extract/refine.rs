//! Which cells may hold a piece of the surface, found level by level.

use crate::extract::budget::Budget;
use crate::extract::cover::Balls;
use crate::extract::error::ExtractError;
use crate::extract::lattice::{Lattice, Level};
use crate::extract::memory;
use crate::extract::nodes::Nodes;
use crate::extract::rows::{Bits, NodeWord, Rows, Scratch, WORD, each_bit};
use crate::extract::slope::Bound;
use crate::extract::surface::Crossings;
use if_core::field::SignedDistance;
use if_core::math::Real;
use rayon::prelude::*;

/// Number of halvings of a child box in the test whether balls cover it together. 2 needs 3 to 6 %
/// fewer evaluations than 1 on the fields of `docs/evidence`; 3 needs 1 % fewer again, and the test
/// takes four times as long.
const DEPTH: u32 = 2;

/// The cells that were not dropped, and the field at their corners.
pub(super) struct Refined {
    pub(super) cells: Rows<Bits>,
    pub(super) nodes: Nodes,
    /// Cells that were dropped although the surface passes through them, and were restored.
    pub(super) restored: usize,
    /// The final bound on |∇φ|.
    pub(super) slope: Real,
}

/// Factor above its bound from which on a field counts as steeper. Rounding is 1e-10 of a cell's
/// length; a field that is steeper by a thousandth can hide a thousandth of a cell at most.
const STEEPER: Real = 1.001;
/// The next bound is this factor above the steepest slope that was found.
const MARGIN: Real = 1.25;

/// Halves boxes down to cells, each level a batch.
///
/// A node's value excludes zeros in the ball of radius (|φ| − noise) / L around it. A box is dropped
/// if balls around the corners of its parent cover it: nothing in it is evaluated any more. Corners
/// are shared by all boxes and all levels.
///
/// If L is too small this can drop boxes through which the surface passes. Neighbouring nodes whose
/// values differ by more than L allows reveal it: then refinement restarts with a larger L. And
/// cells at edges with ends of both signs are restored, until all of them are present, so that the
/// surface has no holes.
pub(super) fn refine(
    field: &dyn SignedDistance,
    lattice: &Lattice,
    bound: &Bound,
    budget: &mut Budget,
) -> Result<Refined, ExtractError> {
    let mut bound = *bound;
    loop {
        match levels(field, lattice, &bound, budget)? {
            Ok((cells, nodes)) => {
                return complete(
                    field,
                    lattice,
                    Refined { cells, nodes, restored: 0, slope: bound.slope },
                    budget,
                );
            }
            // The loop terminates, as an infinite slope bounds every field.
            Err(seen) => bound.slope = MARGIN * seen,
        }
    }
}

/// Cells and nodes of the last level; or the slope that was found, if it exceeds the bound.
fn levels(
    field: &dyn SignedDistance,
    lattice: &Lattice,
    bound: &Bound,
    budget: &mut Budget,
) -> Result<Result<(Rows<Bits>, Nodes), Real>, ExtractError> {
    let mut level = Level::first(lattice);
    let mut cells = Rows::full(level.boxes);
    let mut nodes =
        Nodes::evaluate(field, lattice, &level, &cells, |_| None, cells.bytes(), budget)?;
    loop {
        let seen = nodes.steepest(lattice, &level, bound.noise);
        if seen > STEEPER * bound.slope {
            return Ok(Err(seen));
        }
        if level.step == 1 {
            return Ok(Ok((cells, nodes)));
        }
        let finer = Level::new(lattice, level.step / 2);
        budget.room(
            cells.bytes() + nodes.bytes(),
            memory::children(&cells, finer.boxes, size_of::<Quad>()),
        )?;
        cells = children(lattice, &level, &finer, &cells, &nodes, bound);
        let known = |node| nodes.get(finer.in_coarser(&level, node)?);
        nodes = Nodes::evaluate(
            field,
            lattice,
            &finer,
            &cells,
            known,
            cells.bytes() + nodes.bytes(),
            budget,
        )?;
        level = finer;
    }
}

/// All cells: slow, for comparison.
pub(super) fn dense(
    field: &dyn SignedDistance,
    lattice: &Lattice,
    bound: &Bound,
    budget: &mut Budget,
) -> Result<Refined, ExtractError> {
    let level = Level::new(lattice, 1);
    let all = level
        .boxes
        .iter()
        .try_fold(1usize, |all, boxes| all.checked_mul(*boxes as usize + 1))
        .unwrap_or(usize::MAX);
    if u32::try_from(all).is_err() {
        return Err(ExtractError::TooManyNodes { nodes: all });
    }
    // The cells, and a value for each node.
    budget.room(all.saturating_mul(size_of::<Real>()), memory::full(level.boxes))?;
    let cells = Rows::full(level.boxes);
    let nodes = Nodes::evaluate(field, lattice, &level, &cells, |_| None, cells.bytes(), budget)?;
    Ok(Refined { cells, nodes, restored: 0, slope: bound.slope })
}

/// The children of `cells` that are not covered by balls around the corners of their parents.
fn children(
    lattice: &Lattice,
    level: &Level,
    finer: &Level,
    cells: &Rows<Bits>,
    nodes: &Nodes,
    bound: &Bound,
) -> Rows<Bits> {
    let reach = 1.0 / (bound.slope * lattice.cell);
    let words = finer.boxes[0].div_ceil(WORD) as usize;
    // Rows (2 y, 2 z), (2 y + 1, 2 z), … of the children of one row: made together, by the row of
    // the parents.
    let made: Rows<Quad> = Rows::build([1, level.boxes[1], level.boxes[2]], |y, z, out| {
        let mut scratch = [0, 1, 2, 3].map(|_| Scratch::new(words));
        let mut any = false;
        for word in cells.row(y, z).0 {
            let corners = Corners::of(nodes, word.x, y, z);
            each_bit(word.bits, |bit| {
                let parent = [word.x * WORD + bit, y, z];
                let radii = corners.values(nodes, bit).map(|v| (v.abs() - bound.noise) * reach);
                let at = |node| level.finest(lattice, node).map(Real::from);
                let centres = [0, 1, 2, 3, 4, 5, 6, 7]
                    .map(|c| at([parent[0] + (c & 1), y + (c >> 1 & 1), z + (c >> 2)]));
                let balls = Balls::new(centres, radii);
                for c in 0..8u32 {
                    let child = [0, 1, 2].map(|k| 2 * parent[k] + (c >> k & 1));
                    if (0..3).any(|k| child[k] >= finer.boxes[k]) {
                        continue;
                    }
                    let lo = finer.finest(lattice, child).map(Real::from);
                    let hi = finer.finest(lattice, child.map(|x| x + 1)).map(Real::from);
                    if !balls.cover(lo, hi, DEPTH) {
                        scratch[(c >> 1) as usize].or(child[0] / WORD, 1 << (child[0] % WORD));
                        any = true;
                    }
                }
            });
        }
        if any {
            for (row, s) in scratch.iter().enumerate() {
                let mut bits = Vec::new();
                s.push_into(&mut bits);
                out.extend(bits.iter().map(|b| Quad { row: row as u32, bits: *b }));
            }
        }
    });
    Rows::build(finer.boxes, |y, z, out| {
        let row = y % 2 + 2 * (z % 2);
        out.extend(made.row(y / 2, z / 2).0.iter().filter(|q| q.row == row).map(|q| q.bits));
    })
}

/// A word of one of the four rows of children.
#[derive(Clone, Copy)]
struct Quad {
    row: u32,
    bits: Bits,
}

impl crate::extract::rows::Word for Quad {
    fn x(&self) -> u32 {
        self.bits.x
    }
}

/// The words of the nodes of 64 cells: four rows, this word and the next.
pub(super) struct Corners([[Option<NodeWord>; 2]; 4]);

impl Corners {
    pub(super) fn of(nodes: &Nodes, x: u32, y: u32, z: u32) -> Self {
        let words = nodes.rows.words();
        Self([0, 1, 2, 3].map(|row| {
            let (y, z) = (y + (row & 1), z + (row >> 1));
            let first = nodes.rows.find(x, y, z);
            let next = nodes.rows.find(x + 1, y, z);
            [first.map(|w| words[w]), next.map(|w| words[w])]
        }))
    }

    /// The values at the corners of cell `bit`, corner `c` at (c & 1, c >> 1 & 1, c >> 2). NaN
    /// where one is not known.
    pub(super) fn values(&self, nodes: &Nodes, bit: u32) -> [Real; 8] {
        [0, 1, 2, 3, 4, 5, 6, 7].map(|c| {
            let bit = bit + (c & 1);
            let word = self.0[(c >> 1) as usize][(bit / WORD) as usize];
            word.filter(|w| w.known >> (bit % WORD) & 1 == 1)
                .map_or(Real::NAN, |w| nodes.values[w.value(bit % WORD)])
        })
    }
}

/// Takes back cells round edges whose ends have both signs.
fn complete(
    field: &dyn SignedDistance,
    lattice: &Lattice,
    mut refined: Refined,
    budget: &mut Budget,
) -> Result<Refined, ExtractError> {
    let level = Level::new(lattice, 1);
    loop {
        let held = refined.cells.bytes() + refined.nodes.bytes();
        budget.room(held, memory::crossings(&refined.nodes.rows))?;
        let missing = Crossings::of(&refined.nodes.rows).cells().minus(&refined.cells);
        let count = missing.count();
        if count == 0 {
            return Ok(refined);
        }
        let cells = refined.cells.union(&missing);
        let before = &refined.nodes;
        let nodes = Nodes::evaluate(
            field,
            lattice,
            &level,
            &cells,
            |node| before.get(node),
            held + cells.bytes(),
            budget,
        )?;
        refined = Refined { cells, nodes, restored: refined.restored + count, ..refined };
    }
}

/// Cells without a change of sign, in themselves or in a cell that touches them, which the values
/// at their corners do not clear: something smaller than a cell may hide there.
pub(super) fn unresolved(
    lattice: &Lattice,
    noise: Real,
    refined: &Refined,
    crossed: &Rows<Bits>,
) -> usize {
    let doubtful = refined.cells.minus(&crossed.dilated());
    let reach = 1.0 / (refined.slope * lattice.cell);
    (0..doubtful.size[2])
        .into_par_iter()
        .map(|z| {
            let mut count = 0;
            for y in 0..doubtful.size[1] {
                for word in doubtful.row(y, z).0 {
                    let corners = Corners::of(&refined.nodes, word.x, y, z);
                    each_bit(word.bits, |bit| {
                        let radii =
                            corners.values(&refined.nodes, bit).map(|v| (v.abs() - noise) * reach);
                        let unit = [0, 1, 2, 3, 4, 5, 6, 7]
                            .map(|c| [0, 1, 2].map(|k| Real::from(c >> k & 1u32)));
                        count += usize::from(!Balls::new(unit, radii).cover(
                            [0.0; 3],
                            [1.0; 3],
                            DEPTH + 1,
                        ));
                    });
                }
            }
            count
        })
        .sum()
}
