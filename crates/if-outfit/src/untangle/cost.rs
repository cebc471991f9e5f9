//! What untangling may cost: cloth that is torn out of shape is worse than own pairs, which are named.

use super::patch::{Outcome, Patch};
use if_core::math::{Point, Real};
use if_mesh::measure::{displacement, strain_of};

/// Share of the limits that a patch may cost in which pairs are left.
const PARTLY: Real = 0.25;

impl Patch<'_> {
    /// Whether `outcome` costs little enough: no vertex moved further from `start` than
    /// [`repair_influence`](crate::EffortParams::repair_influence), and no more than one in a hundred of the edges
    /// that can move is strained by more than [`ease_strain`](crate::EffortParams::ease_strain), unless that was so
    /// at `start`. Where pairs are left, [`PARTLY`] of that.
    ///
    /// Own pairs of the test data come apart at a tenth of either. Sheets that cross in spikes, or in a fold
    /// longer than the limit, do so only where edges shrink to nothing.
    pub(super) fn is_affordable(&self, start: &[Point], outcome: &Outcome) -> bool {
        let effort = &self.params.effort;
        let share = if outcome.pairs.is_empty() { 1.0 } else { PARTLY };
        let is_moving = |edge: &&[u32; 2]| edge.iter().any(|v| self.is_free(*v));
        let edges: Vec<[u32; 2]> = self.edges.vertices.iter().filter(is_moving).copied().collect();
        let strain = |x: &[Point]| strain_of(&edges, self.mesh.vertices(), x).p99;
        let moved = displacement(start, &outcome.positions).max;
        let (before, now) = (strain(start), strain(&outcome.positions));
        tracing::debug!(pairs = outcome.pairs.len(), moved, before, now, "cost of a patch");
        moved <= share * effort.repair_influence && now <= (share * effort.ease_strain).max(before)
    }
}
