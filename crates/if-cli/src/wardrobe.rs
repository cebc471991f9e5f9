//! `ifg wardrobe`: a folder of bodies and garments, and outfits made from it.

mod add;
mod batch;
mod list;
mod matching;
mod opening;
mod results;

use crate::end::End;
use clap::{Args, Subcommand};
use miette::Report;

#[derive(Args, Debug)]
pub(crate) struct WardrobeArgs {
    #[command(subcommand)]
    pub(crate) command: WardrobeCommand,
}

#[derive(Subcommand, Debug)]
pub(crate) enum WardrobeCommand {
    /// Add a body, or garments that were made on it, or both; what is there under the same name is
    /// replaced.
    Add(add::AddArgs),
    /// List what is there.
    List(list::ListArgs),
    /// Put garments on a body, inner to outer, and make them intersection-free.
    Match(matching::MatchArgs),
    /// Do many combinations; a run that was stopped goes on where it was.
    Batch(batch::BatchArgs),
}

/// Runs the command.
pub(crate) fn run(args: &WardrobeArgs) -> Result<End, Report> {
    match &args.command {
        WardrobeCommand::Add(args) => add::run(args),
        WardrobeCommand::List(args) => list::run(args),
        WardrobeCommand::Match(args) => matching::run(args),
        WardrobeCommand::Batch(args) => batch::run(args),
    }
}
