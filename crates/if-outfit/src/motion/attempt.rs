//! A step of a walk that was tried.

use super::equilibrium::Multipliers;
use if_core::math::Point;
use if_mesh::index::Bvh;
use std::collections::BTreeMap;

/// Pairs of triangles that intersected in solves of the last steps: how often, and for how many
/// steps more they are held apart.
pub(super) type Met = BTreeMap<[u32; 2], (u32, u32)>;

/// A step that was tried.
pub(super) struct Attempt {
    pub(super) x: Vec<Point>,
    pub(super) tree: Bvh,
    /// Pairs that are not tolerated.
    pub(super) pairs: Vec<[u32; 2]>,
    pub(super) multipliers: Multipliers,
    pub(super) met: Met,
    pub(super) solves: usize,
    pub(super) sweeps: usize,
    pub(super) contacts: usize,
    /// Whether the body was held where it is far from its own overlaps.
    pub(super) is_local: bool,
}
