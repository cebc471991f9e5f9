//! What untangling may cost: cloth that is torn out of shape is worse than own pairs, which are named.

use super::REACHES;
use super::patch::{Outcome, Patch};
use if_core::math::{Point, Real};
use if_mesh::measure::{displacement, strain_of};

/// Share of the limits that a patch may cost in which pairs are left.
const PARTLY: Real = 0.25;

impl Patch<'_> {
    /// Whether `outcome` costs little enough: no vertex moved further from `start` than the largest
    /// neighbourhood reaches (three times [`repair_influence`](crate::EffortParams::repair_influence)), and no more
    /// than one in a hundred of the edges that can move is strained by more than
    /// [`untangle_strain`](crate::EffortParams::untangle_strain), unless that was so at `start`. Where pairs are left,
    /// [`PARTLY`] of that.
    ///
    /// Most own pairs of the test data come apart at a tenth of either; those of a long skirt at 60 mm and 40 %. Sheets
    /// that cross in spikes do so only where edges shrink to nothing: 55 to 92 %.
    pub(super) fn is_affordable(&self, start: &[Point], outcome: &Outcome) -> bool {
        let effort = &self.params.effort;
        let share = if outcome.pairs.is_empty() { 1.0 } else { PARTLY };
        let is_moving = |edge: &&[u32; 2]| edge.iter().any(|v| self.is_free(*v));
        let edges: Vec<[u32; 2]> = self.edges.vertices.iter().filter(is_moving).copied().collect();
        let strain = |x: &[Point]| strain_of(&edges, self.mesh.vertices(), x).p99;
        let moved = displacement(start, &outcome.positions).max;
        let (before, now) = (strain(start), strain(&outcome.positions));
        tracing::debug!(pairs = outcome.pairs.len(), moved, before, now, "cost of a patch");
        let farthest = REACHES.into_iter().fold(0.0, Real::max) * effort.repair_influence;
        moved <= share * farthest && now <= (share * effort.untangle_strain).max(before)
    }
}
