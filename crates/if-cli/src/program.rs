//! The program from its arguments to its exit code.

use crate::cli::{Cli, Command};
use crate::end::End;
use crate::{cancel, errors, progress};
use clap::Parser;
use miette::{IntoDiagnostic, Report};
use std::ffi::OsString;

/// The exit code of arguments that cannot be used.
const USAGE: u8 = 2;

/// Runs `ifg` with `args`, the program's name first, and returns its exit code.
///
/// It prints, sizes the global thread pool and listens to Ctrl-C: it is to be called once, by a
/// program that does nothing else.
pub fn run(args: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(answer) => {
            let _ = answer.print(); // A closed stdout is not an error.
            return u8::try_from(answer.exit_code()).unwrap_or(USAGE);
        }
    };
    errors::install();
    let end = command(&cli).unwrap_or_else(|error| {
        errors::show(&error);
        End::of_error(&error)
    });
    end.code()
}

fn command(cli: &Cli) -> Result<End, Report> {
    let threads = cli.threads.map_or(0, usize::from); // 0 is all cores
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().into_diagnostic()?;
    if cli.verbose {
        progress::log_instead()?;
    }
    cancel::listen(matches!(cli.command, Command::Check(_))); // It writes nothing.
    cli.command.run()
}
