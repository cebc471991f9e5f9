//! `ifg`: layered outfits made intersection-free, from the command line.

mod announce;
mod args;
mod cancel;
mod check;
mod clean;
mod companions;
mod cut;
mod demo;
mod end;
mod errors;
mod extract;
mod fit;
mod fix;
mod hash;
mod left;
mod load;
mod outfit_file;
mod outputs;
mod pictures;
mod print;
mod progress;
mod receipt;
mod reconstruct;
mod resolve_outfit;
mod staging;
mod synth;
mod table;
mod target;
mod wardrobe;

use args::{CaptureCommand, Cli, Command};
use clap::Parser;
use end::End;
use miette::{IntoDiagnostic, Report};
use std::io::IsTerminal;
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
        progress::hide();
        let stderr = std::io::stderr;
        let events = tracing_subscriber::fmt()
            .with_max_level(tracing::Level::DEBUG)
            .with_target(false)
            .with_writer(stderr);
        let events = events
            .with_ansi(stderr().is_terminal())
            .with_timer(tracing_subscriber::fmt::time::uptime());
        events.try_init().map_err(|e| miette::miette!("{e}"))?;
    }
    cancel::listen();
    match &cli.command {
        Command::Demo(args) => demo::run(args),
        Command::Fit(args) => fit::run(args),
        Command::Fix(args) => fix::run(args),
        Command::Check(args) => check::run(args),
        Command::Clean(args) => clean::run(args),
        Command::Cut(args) => cut::run(args),
        Command::Capture(CaptureCommand::Synth(args)) => synth::run(args),
        Command::Extract(args) => extract::run(args),
        Command::Wardrobe(args) => wardrobe::run(args),
        Command::Reconstruct(args) => reconstruct::run(args),
    }
}
