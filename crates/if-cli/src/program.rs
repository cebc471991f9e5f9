//! The program from its arguments to its exit code.

use crate::cli::{Cli, Command};
use crate::end::End;
use crate::{cancel, errors, progress};
use clap::Parser;
use miette::{IntoDiagnostic, Report};
use std::ffi::OsString;
#[cfg(unix)]
use std::sync::Arc;

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
    survive_size_limits();
    let end = command(&cli).unwrap_or_else(|error| {
        errors::show(&error);
        End::of_error(&error)
    });
    end.code()
}

/// Makes a write beyond the limit of file sizes (`ulimit -f`) an error like that of a full disk, where
/// the system would end the program without a word.
fn survive_size_limits() {
    // Any handler has that effect; nobody reads the flag. If it fails, all is as the system has it.
    #[cfg(unix)]
    drop(signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default()));
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
