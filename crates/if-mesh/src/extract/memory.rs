//! How much memory comes next, told before it is taken: a system that has no more ends the program.
//!
//! Counted is what an extraction holds at once, copies while parts are joined included; not what
//! the field takes itself.

use crate::extract::ExtractError;
use crate::extract::nodes::NodeWord;
use crate::extract::progress::Watch;
use crate::extract::rows::{Bits, Rows, Word};

/// Of each row along x of a set of places: its first word, and its last while planes are joined.
const ROW: usize = 8;
/// Of a word while it is made: in its plane, and joined to the others.
const TWICE: usize = 2;
/// Of a point that the field is asked for: number and place, in a plane and joined, both in vectors
/// that grow by doubling, and the value.
const ASKED: usize = 120;
/// Of a vertex: its edge (32 bytes), two triangles (24), place (24), value (8) and sample (32), and
/// the copies of planes (up to 72) while no samples are there.
const VERTEX: usize = 136;
/// Of a vertex that is relaxed: mesh, its copy, samples, three edges and six corners in tables,
/// normals and places; or both meshes and the tree that finds triangles of them that meet.
const RELAXED: usize = 560;

/// Bytes of the rows of a set of so many places along each axis while it is made.
fn rows(size: [u32; 3]) -> usize {
    (size[1] as usize).saturating_mul(size[2] as usize).saturating_mul(ROW)
}

/// Bytes that `count` words of a set take while it is made.
fn words<T: Word>(count: usize) -> usize {
    count.saturating_mul(size_of::<T>() * TWICE)
}

/// The halves of `cells`, of which there are `finer` along each axis: at most eight words for one.
pub(super) fn children(cells: &Rows<Bits>, finer: [u32; 3], quad: usize) -> usize {
    let most = cells.words().len().saturating_mul(8);
    most.saturating_mul(quad * TWICE)
        .saturating_add(words::<Bits>(most))
        .saturating_add(rows(finer))
        .saturating_add(rows(cells.size))
}

/// All cells of a lattice, and the nodes at their corners.
pub(super) fn full(cells: [u32; 3]) -> usize {
    let count = (cells[0] as usize / 64 + 1)
        .saturating_mul(cells[1] as usize)
        .saturating_mul(cells[2] as usize);
    words::<Bits>(count).saturating_add(rows(cells))
}

/// The corners of `cells`: at most eight words for one, and no more than there are.
pub(super) fn corners(cells: &Rows<Bits>) -> usize {
    let nodes = cells.size.map(|s| s + 1);
    let most = (cells.words().len().saturating_mul(8)).min(full(nodes) / size_of::<Bits>());
    words::<Bits>(most).saturating_add(rows(nodes))
}

/// The values at `places`, of which at most `at_once` are asked for at once.
pub(super) fn nodes(places: &Rows<Bits>, count: usize, at_once: usize) -> usize {
    let words = words::<NodeWord>(places.words().len()).saturating_add(rows(places.size));
    words.saturating_add(count.saturating_mul(8)).saturating_add(at_once.saturating_mul(ASKED))
}

/// Crossed edges beside the words of `nodes`, and the cells round them.
pub(super) fn crossings(nodes: &Rows<NodeWord>) -> usize {
    nodes
        .words()
        .len()
        .saturating_mul((32 + size_of::<Bits>()) * TWICE)
        .saturating_add(rows(nodes.size).saturating_mul(2))
}

/// The mesh of so many vertices.
pub(super) fn mesh(vertices: usize, relaxed: bool) -> usize {
    vertices.saturating_mul(if relaxed { RELAXED } else { VERTEX })
}

impl Watch<'_> {
    /// Whether `held` bytes, and `more`, are allowed.
    pub(super) fn room(&self, held: usize, more: usize) -> Result<(), ExtractError> {
        let bytes = held.saturating_add(more);
        if bytes > self.memory {
            return Err(ExtractError::TooLarge { bytes, limit: self.memory, cell: self.cell });
        }
        Ok(())
    }
}
