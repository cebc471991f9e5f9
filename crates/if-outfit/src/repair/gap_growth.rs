//! The gap of vertices grows whose triangles intersect in vain again and again.

use super::Repair;
use crate::progress::GarmentProgress;
use crate::workpiece::{SettleError, Workpiece};
use if_core::math::Real;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// From so many findings on the gap of a triangle grows.
const PATIENCE: u32 = 4;
/// The largest gap, in metres.
const MAX_GAP: Real = 0.03;

/// Multiplies the gap of the vertices of a triangle by `gap_growth` at every finding after the
/// first [`PATIENCE`]: contacts of its vertices alone let a chord cut through a fine layer.
#[derive(Default)]
pub(crate) struct GapGrowth {
    /// For each triangle how often it was found intersecting.
    found: BTreeMap<u32, u32>,
}

impl Repair for GapGrowth {
    fn apply(
        &mut self,
        work: &mut Workpiece<'_>,
        _: &mut GarmentProgress<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        let triangles = work.scene.garment.mesh.triangles();
        for (_, pair) in &work.remaining.pairs {
            let found = self.found.entry(pair.b).or_insert(0);
            *found += 1;
            if *found > PATIENCE {
                for v in triangles[pair.b as usize] {
                    let gap = &mut work.contacts.gaps[v as usize];
                    *gap = (*gap * work.scene.params.effort.gap_growth).min(MAX_GAP);
                }
                work.counts.grown_gaps += 1;
            }
        }
        Ok(ControlFlow::Continue(()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::tests::{apply, unchanged, with_band};

    #[test]
    fn gaps_grow_after_some_findings_and_not_without_end() {
        with_band(0.299, unchanged, |work| {
            work.verify();
            let clearance = work.scene.params.goal.clearance;
            let mut growth = GapGrowth::default();
            let mut found = BTreeMap::new();
            for (_, pair) in &work.remaining.pairs {
                *found.entry(pair.b).or_insert(0) += 1;
            }
            // Each pair of a triangle is a finding, and those within the patience grow nothing.
            let beyond: u32 = found.values().map(|n: &u32| n.saturating_sub(PATIENCE)).sum();
            apply(&mut growth, work);
            assert!(!found.is_empty() && work.counts.grown_gaps == beyond as usize);
            (0..PATIENCE).for_each(|_| apply(&mut growth, work));
            assert!(work.counts.grown_gaps > beyond as usize);
            assert!(work.contacts.gaps.iter().any(|gap| *gap > clearance));
            (0..60).for_each(|_| apply(&mut growth, work));
            let largest = work.contacts.gaps.iter().copied().fold(0.0, Real::max);
            assert_eq!(largest, MAX_GAP);
        });
    }
}
