//! Vertices that cannot be pressed in below a layer above without intersections are released.

use super::Repair;
use crate::progress::GarmentProgress;
use crate::workpiece::{SettleError, Workpiece};
use std::ops::ControlFlow;

/// Stops pressing in the vertices of what remains during repairs: the layers below have priority.
pub(crate) struct TuckRelease;

impl Repair for TuckRelease {
    fn apply(
        &mut self,
        work: &mut Workpiece<'_>,
        _: &mut GarmentProgress<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        if work.is_repairing() && !work.remaining.is_clean() {
            let vertices = work.remaining_vertices();
            work.counts.released_vertices += work.contacts.release(&vertices);
        }
        Ok(ControlFlow::Continue(()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::tests::{apply, under_a_tight_band};

    #[test]
    fn vertices_without_room_below_a_layer_above_stay_outside_the_body() {
        under_a_tight_band(|work| {
            let x = work.cloth.x.clone();
            let pressed = work.contacts.sticking_out(&x).len();
            assert!(pressed > 100, "{pressed}");
            work.verify();
            assert!(!work.remaining.is_clean());
            work.round = work.scene.params.effort.settle_rounds;
            apply(&mut TuckRelease, work);
            let released = work.counts.released_vertices;
            assert!(released > 0);
            assert_eq!(released, work.remaining_vertices().len());
            assert!(work.contacts.sticking_out(&x).len() < pressed);
        });
    }
}
