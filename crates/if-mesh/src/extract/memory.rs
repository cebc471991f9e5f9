//! Estimates of the memory of each step, checked before it is allocated: a system without memory
//! ends the program.
//!
//! The estimates include what an extraction holds at once and copies while parts are joined, but
//! not the memory of the field itself.

use crate::extract::rows::{Bits, NodeWord, Rows, Word};

/// Bytes for each row along x of a set: its first word, and its last while planes are joined.
const ROW: usize = 8;
/// Bytes for each plane of a set: its two vectors, until planes are joined.
const PLANE: usize = 48;
/// Copies of a word while a set is built: in its plane, and joined to the others.
const TWICE: usize = 2;
/// Bytes for a point that is evaluated: number and position, in a plane and joined, both in vectors
/// that grow by doubling, and the value.
const EVALUATED: usize = 120;
/// Bytes for a vertex: its edge (32), two triangles (24), position (24), value (8), and the tree that finds intersecting
/// triangles, also while it is built; or samples (32) and the copies of planes (up to 72) before there are.
const VERTEX: usize = 590;
/// Bytes for a vertex that is relaxed: mesh, its copy, samples, three edges and six corners in
/// tables, normals and positions; or both meshes, edges, tree and fans.
const RELAXED: usize = 680;

/// Bytes of the rows of a set with `size` places along each axis while it is built.
fn rows(size: [u32; 3]) -> usize {
    let plane = (size[1] as usize).saturating_mul(ROW).saturating_add(PLANE);
    plane.saturating_mul(size[2] as usize)
}

/// Bytes of `count` words of a set while it is built.
fn words<T: Word>(count: usize) -> usize {
    count.saturating_mul(size_of::<T>() * TWICE)
}

/// The children of `cells`, `finer` along each axis: at most eight words for one.
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

/// The corners of `cells`: at most eight words for one, and at most all nodes.
pub(super) fn corners(cells: &Rows<Bits>) -> usize {
    let nodes = cells.size.map(|s| s + 1);
    let most = (cells.words().len().saturating_mul(8)).min(full(nodes) / size_of::<Bits>());
    words::<Bits>(most).saturating_add(rows(nodes))
}

/// The values at `places`, of which at most `at_once` are evaluated at once.
pub(super) fn nodes(places: &Rows<Bits>, count: usize, at_once: usize) -> usize {
    let words = words::<NodeWord>(places.words().len()).saturating_add(rows(places.size));
    words.saturating_add(count.saturating_mul(8)).saturating_add(at_once.saturating_mul(EVALUATED))
}

/// Crossed edges beside the words of `nodes`, and the cells around them.
pub(super) fn crossings(nodes: &Rows<NodeWord>) -> usize {
    nodes
        .words()
        .len()
        .saturating_mul((32 + size_of::<Bits>()) * TWICE)
        .saturating_add(rows(nodes.size).saturating_mul(2))
}

/// A mesh of `vertices` vertices.
pub(super) fn mesh(vertices: usize, relaxed: bool) -> usize {
    vertices.saturating_mul(if relaxed { RELAXED } else { VERTEX })
}
