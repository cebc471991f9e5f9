//! Pairs of the garment's own triangles that newly intersect are held apart.

use super::{OWN_SEPARATION, Repair};
use crate::progress::GarmentProgress;
use crate::workpiece::{SettleError, Workpiece};
use std::collections::BTreeSet;
use std::ops::ControlFlow;

/// Holds the two triangles of each new own pair on the sides that they have in the input.
#[derive(Default)]
pub(crate) struct SelfSeparation {
    /// Pairs that are held apart.
    separated: BTreeSet<[u32; 2]>,
}

impl Repair for SelfSeparation {
    fn apply(
        &mut self,
        work: &mut Workpiece<'_>,
        _: &mut GarmentProgress<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        let mesh = &work.scene.garment.mesh;
        for pair in &work.remaining.new_own {
            if self.separated.insert(*pair) {
                let [a, b] = pair.map(|t| mesh.triangles()[t as usize]);
                work.contacts.self_separations.push(a, b, OWN_SEPARATION, mesh.vertices());
                work.counts.separated_own_pairs += 1;
            }
        }
        Ok(ControlFlow::Continue(()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::tests::{apply, unchanged, with_band};
    use if_core::math::{Point, Vector};

    #[test]
    fn sheets_that_pass_through_each_other_come_apart() {
        with_band(0.32, unchanged, |work| {
            // A vertex is pulled over the three rows above it, and one of these through its triangles.
            let at = |y: f64, x: &[Point]| {
                x.iter().position(|p| p.z.abs() < 1e-9 && p.x > 0.0 && (p.y - y).abs() < 1e-9)
            };
            let mut folded = work.cloth.x.clone();
            let [over, through] = [0.0, 0.06].map(|y| at(y, &folded).expect("rows of 2 cm"));
            folded[over] += Vector::new(0.01, 0.08, 0.0);
            folded[through] += Vector::new(0.03, 0.0, 0.0);
            work.cloth.ever_free.fill(true);
            work.cloth.inverse_masses.fill(1.0);
            work.go_to(&folded);
            work.verify();
            let found = work.remaining.new_own.len();
            assert!(found > 0, "the fold does not pass through");
            let mut separation = SelfSeparation::default();
            apply(&mut separation, work);
            apply(&mut separation, work);
            assert_eq!(work.counts.separated_own_pairs, found);
            assert!(!work.contacts.self_separations.is_empty());
        });
    }
}
