//! `ifg`: layered outfits made intersection-free, from the command line.
//!
//! [`cli`] holds the commands; each command's file holds its arguments and what it does. The other
//! files are shared by several commands.

// Commands.
mod check;
mod clean;
mod cli;
mod cut;
mod demo;
mod extract;
mod fit;
mod fix;
mod reconstruct;
mod synth;
mod wardrobe;
// Arguments and inputs.
mod companions;
mod inputs;
mod load;
mod outfit_file;
mod values;
// Work and output.
mod cancel;
mod end;
mod errors;
mod file_record;
mod not_kept;
mod order;
mod outputs;
mod pictures;
mod print;
mod progress;
mod receipt;
mod report_output;
mod report_page;
mod resolve_outfit;
mod staging;
mod table;
mod target;

use clap::Parser;
use cli::Cli;
use end::End;
use miette::{IntoDiagnostic, Report};
use std::process::ExitCode;

fn main() -> ExitCode {
    errors::install();
    let end = run(&Cli::parse()).unwrap_or_else(|error| {
        errors::show(&error);
        End::Unusable
    });
    end.into()
}

fn run(cli: &Cli) -> Result<End, Report> {
    let threads = cli.threads.map_or(0, usize::from); // 0 is all cores
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().into_diagnostic()?;
    if cli.verbose {
        progress::log_instead()?;
    }
    cancel::listen();
    cli.command.run()
}
