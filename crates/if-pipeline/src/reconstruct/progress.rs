//! Progress of the stages.

use if_core::math::Real;
use if_core::monitor::{Cancelled, Monitor, Progress};
use std::ops::ControlFlow;

/// Reports that `done` of `total` steps of a stage are finished, with a measure if there is one.
pub(super) fn report(
    monitor: &mut dyn Monitor,
    stage: &'static str,
    (done, total): (usize, usize),
    measure: Option<(&'static str, Real)>,
) -> Result<(), Cancelled> {
    let measures = measure.as_slice();
    monitor.report(&Progress { done, total: Some(total), measures, ..Progress::stage(stage) })
}

/// The result of a report, for closures that are monitors.
pub(super) fn control(result: Result<(), Cancelled>) -> ControlFlow<()> {
    match result {
        Ok(()) => ControlFlow::Continue(()),
        Err(Cancelled) => ControlFlow::Break(()),
    }
}
