//! The command line: all commands with their arguments.

use crate::end::End;
use crate::{animate, check, clean, cut, demo, extract, fit, fix, reconstruct, synth, wardrobe};
use clap::{Parser, Subcommand};
use miette::Report;

const EXIT_CODES: &str = "\
Exit codes:
  0    clean: no intersecting triangle pairs, no vertex on a wrong side, and after `fix` no new
       intersection of a garment with itself; with --strict no intersection at all
  1    not clean: `check` found intersections, `fix`, `demo`, `wardrobe` and `animate` could not
       remove all of them, `reconstruct --strict` warned of something, `fit` or `extract` did not
       reach its --accuracy, or `fit` diverged
  2    unusable: arguments, an input, or the output folder; the message names file and cause
  75   another process writes into the output folder: try again later
  130  cancelled by Ctrl-C or SIGTERM; nothing half-written is left

Formats of outfit.toml and receipt.json: docs/reference/outfit.md";

/// Makes layered garments intersection-free, and proves it.
#[derive(Parser, Debug)]
#[command(name = "ifg", version, after_help = EXIT_CODES, max_term_width = 100)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Number of threads; all cores by default. Results do not depend on it.
    #[arg(short = 'j', long, visible_alias = "jobs", global = true, value_name = "N",
          value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Log to stderr what is done, as the remaining intersections of each garment, or the stages of
    /// a reconstruction, instead of a line of progress.
    #[arg(short, long, global = true)]
    pub(crate) verbose: bool,
}

#[derive(Subcommand, Debug)]
pub(crate) enum Command {
    /// Resolve the built-in scene: a mannequin in several layers with deep overlaps.
    Demo(demo::DemoArgs),
    /// Resolve outfits: write each garment, free of intersections, under its own file name.
    Fix(fix::FixArgs),
    /// Move a clean outfit through a motion, free of intersections in every frame
    /// (docs/animate.md).
    Animate(animate::AnimateArgs),
    /// Verify outfits without changing anything; exit code 0 clean, 1 not clean.
    Check(check::CheckArgs),
    /// Captures: a person who turns before a camera (docs/reference/capture.md).
    #[command(subcommand)]
    Capture(CaptureCommand),
    /// Reconstruct a person and each garment from a capture of a turning video
    /// (docs/video-to-wardrobe.md).
    Reconstruct(reconstruct::ReconstructArgs),
    /// Keep bodies and garments in a folder, and combine them (docs/reference/wardrobe.md).
    Wardrobe(wardrobe::WardrobeArgs),
    /// Cut a labelled mesh (.ply) into one mesh for each label, along smooth lines.
    Cut(cut::CutArgs),
    /// Clean a garment that was cut out of a scan: isolated elements, holes, ragged boundary.
    Clean(clean::CleanArgs),
    /// Fit a neural signed distance field to a mesh, and write it as a safetensors file.
    Fit(fit::FitArgs),
    /// Extract the surface of a field as a mesh: remesh a closed mesh by its signed distance.
    Extract(extract::ExtractArgs),
}

/// What to do with captures.
#[derive(Subcommand, Debug)]
pub(crate) enum CaptureCommand {
    /// Render the built-in scene as a capture: masks, labels and normals with noise, template and
    /// truth.
    Synth(synth::SynthArgs),
}

impl Command {
    /// Runs the command.
    pub(crate) fn run(&self) -> Result<End, Report> {
        match self {
            Self::Demo(args) => demo::run(args),
            Self::Fit(args) => fit::run(args),
            Self::Fix(args) => fix::run(args),
            Self::Animate(args) => animate::run(args),
            Self::Check(args) => check::run(args),
            Self::Clean(args) => clean::run(args),
            Self::Cut(args) => cut::run(args),
            Self::Capture(CaptureCommand::Synth(args)) => synth::run(args),
            Self::Extract(args) => extract::run(args),
            Self::Wardrobe(args) => wardrobe::run(args),
            Self::Reconstruct(args) => reconstruct::run(args),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }
}
