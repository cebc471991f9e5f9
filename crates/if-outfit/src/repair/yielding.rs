//! Push-out rounds without cloth, for a garment that contacts and cloth do not bring out together.

use super::Repair;
use crate::progress::GarmentProgress;
use crate::workpiece::{SettleError, Workpiece};
use std::ops::ControlFlow;

/// After so many rounds of repair, and again after as many more, a garment that was never clean
/// yields.
const STALLED: usize = 15;
/// Rounds in which the cloth yields before what remains counts as tangled.
const ROUNDS: usize = 12;

/// Takes a garment that was never clean in [`STALLED`] repairs back to its best state. From there
/// the contacts alone move it for [`ROUNDS`] rounds: the cloth is stretched as far as necessary.
///
/// Returns [`SettleError::Stuck`] instead if the scene forbids yielding.
#[derive(Default)]
pub(crate) struct Yielding {
    /// Verifications until the cloth holds together again.
    left: usize,
}

impl Repair for Yielding {
    fn apply(
        &mut self,
        work: &mut Workpiece<'_>,
        _: &mut GarmentProgress<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        if work.is_repairing() && self.left == 0 {
            self.start_if_stalled(work)?;
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
    fn start_if_stalled(&mut self, work: &mut Workpiece<'_>) -> Result<(), SettleError> {
        let stalled = work.repair_rounds > 0 && work.repair_rounds.is_multiple_of(STALLED);
        let Some(best) = work.best.as_ref().filter(|best| stalled && !best.is_clean()) else {
            return Ok(());
        };
        // A garment that only meets itself gains nothing if the layers below give way.
        if !work.scene.may_yield && best.meets_others {
            return Err(SettleError::Stuck);
        }
        work.repair_rounds += 1;
        let positions = best.positions.clone();
        work.go_to(&positions);
        (_, work.remaining) = work.verified(positions);
        self.left = ROUNDS + 1;
        Ok(())
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
            // Where yielding is forbidden, that is an error.
            work.repair_rounds = STALLED;
            work.scene.may_yield = false;
            assert!(matches!(try_apply(&mut yielding, work), Err(SettleError::Stuck)));
        });
    }
}
