//! What is done about a garment that contacts and cloth do not bring out together: push-out rounds
//! without cloth, then lifts of what it is caught with; and when it is given up.

use super::{Repair, patch_lift};
use crate::progress::GarmentProgress;
use crate::workpiece::{SettleError, Workpiece};
use if_core::math::Real;
use std::ops::ControlFlow;

/// After so many rounds of repair, and again after as many more, a garment that was never clean has
/// stalled.
const STALLED: usize = 15;
/// Rounds in which the cloth yields before what remains counts as tangled.
const ROUNDS: usize = 12;
/// The largest share of what remained at the last stall that is progress. The number fluctuates by
/// some percent from round to round.
const PROGRESS: Real = 0.8;

/// Takes a garment that stalled back to its best state. From there the contacts alone move it for
/// [`ROUNDS`] rounds: the cloth is stretched as far as necessary. From the second stall on what remains
/// is lifted instead ([`patch_lift`]), where that is possible. Breaks at the third stall, or at a later
/// one, if hardly less remains than at the stall before: more rounds would not help.
///
/// Returns [`SettleError::Stuck`] instead if the scene forbids yielding.
#[derive(Default)]
pub(crate) struct Yielding {
    /// Verifications until the cloth holds together again.
    left: usize,
    /// How often the garment stalled, and what remained then.
    stalls: usize,
    remaining: usize,
}

impl Repair for Yielding {
    fn apply(
        &mut self,
        work: &mut Workpiece<'_>,
        _: &mut GarmentProgress<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        if work.is_repairing() && self.left == 0 && self.start_if_stalled(work)?.is_break() {
            return Ok(ControlFlow::Break(()));
        }
        work.has_yielded = self.left == 1;
        self.left = if work.remaining.is_clean() { 0 } else { self.left.saturating_sub(1) };
        work.is_yielding = self.left > 0;
        if work.is_yielding {
            let vertices = work.remaining_vertices();
            work.cloth.hold_far_from(&vertices, work.scene.params.effort.repair_influence);
        }
        Ok(ControlFlow::Continue(()))
    }
}

impl Yielding {
    fn start_if_stalled(
        &mut self,
        work: &mut Workpiece<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        let stalled = work.repair_rounds > 0 && work.repair_rounds.is_multiple_of(STALLED);
        let Some(best) = work.best.as_ref().filter(|best| stalled && !best.is_clean()) else {
            return Ok(ControlFlow::Continue(()));
        };
        // A garment that only meets itself gains nothing if the layers below give way.
        if !work.scene.may_yield && best.meets_others {
            return Err(SettleError::Stuck);
        }
        let left = best.remaining();
        if self.stalls > 1 && left as Real > PROGRESS * self.remaining as Real {
            return Ok(ControlFlow::Break(()));
        }
        self.remaining = left;
        self.stalls += 1;
        work.repair_rounds += 1;
        let positions = best.positions.clone();
        work.go_to(&positions);
        (_, work.remaining) = work.verified(positions);
        tracing::debug!(garment = work.scene.garment.name, stalls = self.stalls, left, "stalled");
        if self.stalls > 1 && patch_lift::lift(work) {
            return Ok(ControlFlow::Continue(()));
        }
        self.left = ROUNDS + 1;
        Ok(ControlFlow::Continue(()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::tests::{apply, try_apply, unchanged, with_band};

    #[test]
    fn a_garment_that_is_never_clean_goes_back_to_its_best_state_and_yields() {
        with_band(0.29, unchanged, |work| {
            work.verify();
            let input = work.cloth.x.clone();
            assert!(!work.rank(1.0));
            // Worse than before.
            let sunk: Vec<_> = input.iter().map(|p| p * 0.97).collect();
            work.go_to(&sunk);
            work.verify();
            work.round = work.scene.params.effort.settle_rounds;
            work.repair_rounds = STALLED;
            let mut yielding = Yielding::default();
            apply(&mut yielding, work);
            assert!(work.is_yielding && work.cloth.x == input);
            let mut rounds = 0;
            while work.is_yielding {
                rounds += 1;
                apply(&mut yielding, work);
            }
            assert_eq!((rounds, work.has_yielded), (ROUNDS, true));
            assert_eq!(work.counts.patch_lifts, 0);
            // Where yielding is forbidden, that is an error.
            work.repair_rounds = STALLED;
            work.scene.may_yield = false;
            assert!(matches!(try_apply(&mut yielding, work), Err(SettleError::Stuck)));
        });
    }

    #[test]
    fn a_garment_of_which_as_much_remains_as_before_is_given_up() {
        for (before, is_given_up) in [(1.0, true), (2.0, false)] {
            with_band(0.29, unchanged, |work| {
                work.verify();
                assert!(!work.rank(1.0));
                work.round = work.scene.params.effort.settle_rounds;
                work.repair_rounds = 3 * STALLED;
                let remaining = (before * work.remaining.count() as Real) as usize;
                let mut yielding = Yielding { left: 0, stalls: 2, remaining };
                let flow = try_apply(&mut yielding, work);
                assert!(matches!(flow, Ok(flow) if flow.is_break() == is_given_up));
            });
        }
    }
}
