//! Errors as text on stderr, and as JSON.

mod each_once;

use self::each_once::EachOnce;
use miette::{MietteHandlerOpts, Report};
use serde::Serialize;
use std::error::Error;
use std::io::{IsTerminal, Write};

/// Decides once how reports are drawn: with lines and colours on a terminal, unwrapped ASCII
/// elsewhere, so that logs can be searched for file names.
pub(crate) fn install() {
    let terminal = std::io::stderr().is_terminal();
    let installed = miette::set_hook(Box::new(move |_| {
        let options =
            MietteHandlerOpts::new().terminal_links(false).break_words(false).force_graphical(true);
        Box::new(EachOnce(if terminal {
            options.build()
        } else {
            options.unicode(false).color(false).wrap_lines(false).build()
        }))
    }));
    drop(installed); // Fails only where a hook stands already; then that one draws.
}

/// An error and its causes in one text.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct ErrorChain(String);

impl ErrorChain {
    pub(crate) fn new(error: &dyn std::error::Error) -> Self {
        Self(chain(error))
    }
}

/// An error with its causes, each once.
pub fn chain(error: &dyn Error) -> String {
    causes(error).into_iter().fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}

/// The causes of an error, from the nearest to the first, but for those that are in messages before:
/// some repeat what they are caused by.
fn causes(error: &dyn Error) -> Vec<String> {
    let (mut said, mut causes) = (error.to_string(), Vec::new());
    let mut cause = error.source();
    while let Some(error) = cause {
        let more = error.to_string();
        if !said.contains(&more) {
            said = format!("{said}: {more}");
            causes.push(more);
        }
        cause = error.source();
    }
    causes
}

/// Draws an error on stderr.
pub(crate) fn show(report: &Report) {
    note(&format!("{report:?}"));
}

/// Prints a line on stderr. A closed stderr is not an error.
pub(crate) fn note(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// An error in `--json` output.
#[derive(Serialize)]
pub(crate) struct ErrorJson {
    /// Stable name of the kind of error.
    code: Option<String>,
    message: String,
    /// From the nearest to the first.
    causes: Vec<String>,
    help: Option<String>,
    /// Where in a text file, if it is known.
    at: Option<Place>,
}

/// A place in a text file, as editors count.
#[derive(Serialize)]
struct Place {
    file: Option<String>,
    line: usize,
    column: usize,
}

impl Place {
    fn of(report: &Report) -> Option<Self> {
        let label = report.labels()?.next()?;
        let text = report.source_code()?.read_span(label.inner(), 0, 0).ok()?;
        let file = text.name().map(str::to_owned);
        Some(Self { file, line: text.line() + 1, column: text.column() + 1 })
    }
}

impl ErrorJson {
    pub(crate) fn new(report: &Report) -> Self {
        Self {
            code: report.code().map(|c| c.to_string()),
            message: report.to_string(),
            causes: causes(report.as_ref()),
            help: report.help().map(|h| h.to_string()),
            at: Place::of(report),
        }
    }
}
