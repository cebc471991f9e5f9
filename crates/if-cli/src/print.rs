//! Text on stdout.

use miette::{Diagnostic, IntoDiagnostic};
use std::io::{self, ErrorKind, Write};

/// What is printed cannot be written.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("cannot write the report to stdout")]
#[diagnostic(
    code(ifg::output::stdout),
    help("look at where stdout goes; what is in an output folder stays there")
)]
struct Unprinted {
    source: io::Error,
}

/// Prints text. A reader that has ended (`ifg check … | head`) is not an error.
pub(crate) fn print(text: &str) -> miette::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => Err(Unprinted { source }.into()),
        _ => Ok(()),
    }
}

/// Prints a value as one line of JSON.
pub(crate) fn print_json(value: &impl serde::Serialize) -> miette::Result<()> {
    print(&format!("{}\n", serde_json::to_string(value).into_diagnostic()?))
}

/// One line for each note.
pub(crate) fn note_lines(notes: &[String]) -> String {
    notes.iter().map(|note| format!("Note: {note}\n")).collect()
}
