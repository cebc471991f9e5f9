//! A lattice of cubes, its nodes and its levels of refinement.

use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};

/// Maximum number of cells along an axis: nodes are numbered in 32 bits, and a table with one number
/// per row along x must fit into memory.
pub(super) const MAX_CELLS: Real = 32_768.0;

/// Boxes along the longest side with which refinement starts. They need 729 evaluations, a
/// five-hundredth of what follows at 256 cells, and show how steep the field is before any box is
/// dropped.
const FIRST: u32 = 8;

/// A lattice of cubes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lattice {
    /// Node (0, 0, 0).
    pub(crate) min: Point,
    /// Distance of neighbouring nodes, in metres.
    pub(crate) cell: Real,
    /// Cells along each axis; there is one node more.
    pub(crate) cells: [u32; 3],
}

impl Lattice {
    /// Position of a node.
    pub(crate) fn node(&self, node: [u32; 3]) -> Point {
        self.min + Vector::from(node.map(Real::from)) * self.cell
    }

    /// Number of all cells.
    pub(crate) fn volume(&self) -> Real {
        self.cells.iter().map(|c| Real::from(*c)).product()
    }

    /// The box it covers.
    pub(crate) fn aabb(&self) -> Aabb {
        Aabb { min: self.min, max: self.node(self.cells) }
    }
}

/// One level of refinement: boxes of `step`³ cells. The last box along an axis may be smaller, so
/// that no box leaves the lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Level {
    /// Cells along a box: a power of two.
    pub(super) step: u32,
    /// Boxes along each axis.
    pub(super) boxes: [u32; 3],
}

impl Level {
    pub(super) fn new(lattice: &Lattice, step: u32) -> Self {
        Self { step, boxes: lattice.cells.map(|c| c.div_ceil(step)) }
    }

    /// The level to start from: [`FIRST`] / 2 to [`FIRST`] boxes along the longest side, or single
    /// cells.
    pub(super) fn first(lattice: &Lattice) -> Self {
        let longest = lattice.cells.into_iter().max().unwrap_or(1);
        Self::new(lattice, (longest.next_power_of_two() / FIRST).max(1))
    }

    /// The node of the lattice at which a node of this level lies.
    pub(super) fn finest(&self, lattice: &Lattice, node: [u32; 3]) -> [u32; 3] {
        [0, 1, 2].map(|k| (node[k] * self.step).min(lattice.cells[k]))
    }

    /// The node of `coarser`, the level above, that lies in the same place, if there is one.
    pub(super) fn in_coarser(&self, coarser: &Self, node: [u32; 3]) -> Option<[u32; 3]> {
        let mut out = [0; 3];
        for k in 0..3 {
            out[k] = match node[k] {
                last if last == self.boxes[k] => coarser.boxes[k],
                even if even % 2 == 0 => even / 2,
                _ => return None,
            };
        }
        Some(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_of_a_level_are_found_in_the_level_above() {
        let lattice = Lattice { min: Point::origin(), cell: 0.5, cells: [11, 8, 3] };
        let coarse = Level::new(&lattice, 4);
        let fine = Level::new(&lattice, 2);
        assert_eq!((coarse.boxes, fine.boxes), ([3, 2, 1], [6, 4, 2]));
        assert_eq!((Level::first(&lattice).step, Level::first(&lattice).boxes), (2, [6, 4, 2]));
        for x in 0..=6 {
            for y in 0..=4 {
                for z in 0..=2 {
                    let found = fine.in_coarser(&coarse, [x, y, z]);
                    let here = fine.finest(&lattice, [x, y, z]);
                    if let Some(node) = found {
                        assert_eq!(coarse.finest(&lattice, node), here);
                    }
                    let on =
                        [0, 1, 2].map(|k| here[k].is_multiple_of(4) || here[k] == lattice.cells[k]);
                    assert_eq!(found.is_some(), on == [true; 3], "{x} {y} {z}");
                }
            }
        }
    }
}
