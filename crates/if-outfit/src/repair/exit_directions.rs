//! Vertices that stay inside a layer are led out another way.

use super::Repair;
use crate::contacts::Exit;
use crate::progress::GarmentProgress;
use crate::workpiece::{SettleError, Workpiece};
use std::ops::ControlFlow;

/// After so many findings the next way is tried.
const PATIENCE: u32 = 4;

/// Leads each vertex inside out step by step, then in leaps along the nearest way, then in leaps
/// along the coarse way out, and again from the beginning.
pub(crate) struct ExitDirections;

impl Repair for ExitDirections {
    fn apply(
        &mut self,
        work: &mut Workpiece<'_>,
        _: &mut GarmentProgress<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        let Workpiece { contacts, remaining, counts, .. } = work;
        contacts.search.forget(&remaining.inside);
        contacts.exits.fill(Exit::Steps);
        for v in &remaining.inside {
            let times = &mut contacts.times_inside[*v as usize];
            *times += 1;
            let exit = match *times / PATIENCE % 3 {
                0 => Exit::Steps,
                1 => Exit::Nearest,
                _ => Exit::Outward,
            };
            counts.exit_directions += usize::from(exit != Exit::Steps);
            contacts.exits[*v as usize] = exit;
        }
        Ok(ControlFlow::Continue(()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::tests::{apply, unchanged, with_band};

    #[test]
    fn a_vertex_that_stays_inside_tries_all_ways_in_turn() {
        with_band(0.29, unchanged, |work| {
            work.verify();
            let v = work.remaining.inside[0] as usize;
            let exits: Vec<Exit> = (0..12)
                .map(|_| {
                    apply(&mut ExitDirections, work);
                    work.contacts.exits[v]
                })
                .collect();
            assert_eq!(exits[..3], [Exit::Steps; 3]);
            assert_eq!(exits[3..7], [Exit::Nearest; 4]);
            assert_eq!(exits[7..11], [Exit::Outward; 4]);
            assert_eq!(exits[11], Exit::Steps);
            assert_eq!(work.counts.exit_directions, 8 * work.remaining.inside.len());
        });
    }
}
