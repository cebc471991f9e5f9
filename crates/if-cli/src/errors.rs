//! Errors as text on stderr, and as JSON.

use miette::{MietteHandlerOpts, Report};
use serde::Serialize;
use std::io::{IsTerminal, Write};

/// Decides once how reports are drawn: with lines and colours on a terminal, unwrapped ASCII
/// elsewhere, so that logs can be searched for file names.
pub(crate) fn install() {
    let terminal = std::io::stderr().is_terminal();
    let installed = miette::set_hook(Box::new(move |_| {
        let options =
            MietteHandlerOpts::new().terminal_links(false).break_words(false).force_graphical(true);
        Box::new(if terminal {
            options.build()
        } else {
            options.unicode(false).color(false).wrap_lines(false).build()
        })
    }));
    drop(installed); // Fails only where a hook stands already; then that one draws.
}

/// An error and its causes in one text. Some messages repeat those of their causes; drawn one below
/// the other, as miette does, the same words would appear twice.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct ErrorChain(String);

impl ErrorChain {
    pub(crate) fn new(error: &dyn std::error::Error) -> Self {
        Self(chain(error))
    }
}

/// An error with its causes, each once.
pub fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let more = error.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        cause = error.source();
    }
    text
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
            causes: report.chain().skip(1).map(ToString::to_string).collect(),
            help: report.help().map(|h| h.to_string()),
            at: Place::of(report),
        }
    }
}
