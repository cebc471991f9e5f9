//! Whether to go on.

use super::Step;
use std::ops::ControlFlow;

/// Tells the caller where the work is, and hears whether to go on.
pub(super) struct Watch<'a>(pub(super) &'a mut dyn FnMut(Step) -> ControlFlow<()>);

/// The caller broke.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cancelled;

impl Watch<'_> {
    /// At this step, or still at it.
    pub(super) fn at(&mut self, step: Step) -> Result<(), Cancelled> {
        match (self.0)(step) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Cancelled),
        }
    }
}

/// What `work` does with nobody who could break.
pub(super) fn unwatched<T>(work: impl FnOnce(&mut Watch<'_>) -> Result<T, Cancelled>) -> T {
    work(&mut Watch(&mut |_| ControlFlow::Continue(()))).expect("nobody breaks")
}
