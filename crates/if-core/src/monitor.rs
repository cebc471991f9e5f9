//! Progress and cancelling, in one form for all long work.
//!
//! Functions that may run for more than a second take a `&mut dyn` [`Monitor`]. They call
//! [`Monitor::report`] between steps that take milliseconds on usual input and return their error's `Cancelled`
//! variant if it returns [`Cancelled`].
//!
//! # Examples
//!
//! A closure is a monitor, and [`Silent`] is one that shows nothing and never cancels:
//!
//! ```
//! use if_core::monitor::{Cancelled, Monitor, Progress, Silent};
//! use std::ops::ControlFlow;
//!
//! fn count(monitor: &mut dyn Monitor) -> Result<usize, Cancelled> {
//!     for done in 0..10 {
//!         monitor.report(&Progress { done, total: Some(10), ..Progress::stage("count") })?;
//!     }
//!     Ok(10)
//! }
//!
//! assert_eq!(count(&mut Silent), Ok(10));
//! let mut seen = 0;
//! let mut stop_at_3 = |p: &Progress| {
//!     seen += 1;
//!     if p.done == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
//! };
//! assert_eq!(count(&mut stop_at_3), Err(Cancelled));
//! assert_eq!(seen, 4);
//! ```

use crate::math::Real;
use std::ops::ControlFlow;

/// The state of long work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress<'a> {
    /// The stage of the work: a fixed lower-case word such as `"settle"`.
    pub stage: &'static str,
    /// The layer, file or outfit that is processed; empty if there is only one.
    pub item: &'a str,
    /// Steps done in this stage: rounds, samples, frames.
    pub done: usize,
    /// Steps of this stage, if known.
    pub total: Option<usize>,
    /// Named numbers of the current state: `("pairs", 12.0)`, `("loss", 3e-4)`.
    pub measures: &'a [(&'static str, Real)],
}

impl<'a> Progress<'a> {
    /// The beginning of a stage, without an item, a total or measures.
    pub fn stage(stage: &'static str) -> Self {
        Self { stage, item: "", done: 0, total: None, measures: &[] }
    }

    /// The value of the measure `name`, if it was reported.
    pub fn measure(&self, name: &str) -> Option<Real> {
        self.measures.iter().find(|(n, _)| *n == name).map(|(_, value)| *value)
    }

    /// The same progress of another item.
    pub fn of(self, item: &'a str) -> Self {
        Self { item, ..self }
    }
}

/// The work was cancelled by its [`Monitor`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// Receives progress, and may cancel.
///
/// Closures `FnMut(&Progress) -> ControlFlow<()>` are monitors: `Break` cancels.
pub trait Monitor {
    /// Receives progress.
    ///
    /// # Errors
    ///
    /// [`Cancelled`] stops the work. Further reports may follow before everything has stopped.
    fn report(&mut self, progress: &Progress<'_>) -> Result<(), Cancelled>;
}

impl<F: FnMut(&Progress<'_>) -> ControlFlow<()>> Monitor for F {
    fn report(&mut self, progress: &Progress<'_>) -> Result<(), Cancelled> {
        match self(progress) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Cancelled),
        }
    }
}

/// A monitor that shows nothing and never cancels.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Monitor for Silent {
    fn report(&mut self, _: &Progress<'_>) -> Result<(), Cancelled> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measures_are_found_by_name() {
        let measures = [("pairs", 3.0), ("inside", 0.0)];
        let progress = Progress { measures: &measures, ..Progress::stage("settle") }.of("coat");
        assert_eq!(
            (progress.item, progress.measure("pairs"), progress.measure("loss")),
            ("coat", Some(3.0), None)
        );
    }
}
