//! How a command ends, and its exit code.

use crate::cancel;
use std::process::ExitCode;

/// How a command ended. Of a batch the worst counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum End {
    /// No intersections.
    Clean,
    /// Intersections found, or left.
    NotClean,
    /// An argument, an input or the output folder was of no use.
    Unusable,
    /// The user asked to stop.
    Cancelled,
}

impl From<End> for ExitCode {
    fn from(end: End) -> Self {
        ExitCode::from(match end {
            End::Clean => 0,
            End::NotClean => 1,
            End::Unusable => 2,
            End::Cancelled => cancel::CANCELLED,
        })
    }
}
