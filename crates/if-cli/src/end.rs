//! How a command ends, and its exit code.

use std::process::ExitCode;

/// The exit code of a cancelled program.
pub(crate) const CANCELLED: u8 = 130;

/// How a command ended. Of a batch the worst counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum End {
    /// No intersections.
    Clean,
    /// Intersections found, or left.
    NotClean,
    /// An argument, an input or the output folder cannot be used.
    Unusable,
    /// The user cancelled.
    Cancelled,
}

impl From<End> for ExitCode {
    fn from(end: End) -> Self {
        ExitCode::from(match end {
            End::Clean => 0,
            End::NotClean => 1,
            End::Unusable => 2,
            End::Cancelled => CANCELLED,
        })
    }
}
