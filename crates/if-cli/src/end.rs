//! How a command ends, and its exit code.

use crate::output_error::OutputError;
use if_outfit::Cleanness;
use if_outfit::report::Verification;
use miette::{Diagnostic, Report};

/// The exit code of a cancelled program.
pub(crate) const CANCELLED: u8 = 130;

/// The exit code where another process is at work, `EX_TEMPFAIL` of `sysexits.h`: try again.
pub(crate) const BUSY: u8 = 75;

/// How a command ended. Of a batch the worst counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum End {
    /// No intersections.
    Clean,
    /// Intersections found, or left.
    NotClean,
    /// An argument, an input or the output folder cannot be used.
    Unusable,
    /// Another process writes into the output folder: the same command may succeed later.
    Busy,
    /// The user cancelled.
    Cancelled,
}

impl End {
    /// How a command ends on an outfit in this state. With `strict` it must be clean everywhere.
    pub(crate) fn of(state: Cleanness, strict: bool) -> Self {
        let enough = if strict { Cleanness::Everywhere } else { Cleanness::BetweenLayers };
        if state >= enough { Self::Clean } else { Self::NotClean }
    }

    /// The exit code.
    pub(crate) fn code(self) -> u8 {
        match self {
            Self::Clean => 0,
            Self::NotClean => 1,
            Self::Unusable => 2,
            Self::Busy => BUSY,
            Self::Cancelled => CANCELLED,
        }
    }

    /// How a command ends with an error.
    pub(crate) fn of_error(error: &Report) -> Self {
        match error.downcast_ref() {
            Some(OutputError::Busy { .. }) => Self::Busy,
            _ => Self::Unusable,
        }
    }
}

/// With `--strict`: layers do not meet, but something intersects itself.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("outfit `{outfit}` is clean between layers, but not everywhere: {}", own_pairs(.own))]
#[diagnostic(
    code(ifg::not_everywhere),
    help(
        "see \"Garments that intersect themselves\" in docs/resolve-an-outfit.md; without --strict this is no error"
    )
)]
pub(crate) struct NotEverywhere {
    pub(crate) outfit: String,
    /// Names of layers, the body's first, and their own pairs; none of an outfit that was finished before.
    pub(crate) own: Vec<(String, usize)>,
}

impl NotEverywhere {
    /// `None` if `strict` is not given, or `found` is not the reason for which it fails. `names`
    /// are those of the body and of the garments.
    pub(crate) fn of<'a>(
        outfit: &str,
        names: impl Iterator<Item = &'a str>,
        found: &Verification,
        strict: bool,
    ) -> Option<Self> {
        let fails = strict && found.cleanness() == Cleanness::BetweenLayers;
        let counts = std::iter::once(found.body_own_pairs).chain(found.own_pairs.iter().copied());
        let own = names.map(str::to_owned).zip(counts).filter(|(_, n)| *n > 0).collect();
        fails.then(|| Self { outfit: outfit.to_owned(), own })
    }
}

/// `own pairs of `skirt`: 3, of `coat`: 2`.
fn own_pairs(own: &[(String, usize)]) -> String {
    if own.is_empty() {
        return "its receipt.json lists own pairs".into();
    }
    let parts: Vec<String> = own.iter().map(|(name, n)| format!("of `{name}`: {n}")).collect();
    format!("own pairs {}", parts.join(", "))
}
