//! `ifg capture synth`: the project's own capture, for trying the whole chain.

use crate::args::SynthArgs;
use crate::cancel;
use crate::end::End;
use crate::errors;
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::table::count;
use if_core::monitor::Progress;
use if_pipeline::capture::CaptureError;
use if_pipeline::capture::synth::{SynthError, SynthParams, SynthReport, synth};
use miette::{Diagnostic, Report};
use serde_json::json;
use std::fmt::Write;
use std::ops::ControlFlow;
use std::time::Instant;

/// Why there is no capture.
#[derive(Debug, thiserror::Error, Diagnostic)]
enum SynthFault {
    #[error("no capture was written")]
    #[diagnostic(code(ifg::input::params), help("look at the options"))]
    Params { source: SynthError },
    #[error("no capture was written")]
    #[diagnostic(
        code(ifg::output::folder),
        help("give --out the name of a folder that does not exist, where you may write")
    )]
    Write { source: SynthError },
}

/// Runs the command.
pub(crate) fn run(args: &SynthArgs) -> Result<End, Report> {
    let start = Instant::now();
    let mut params = SynthParams {
        frames: args.frames,
        size: args.size,
        label_noise: args.label_noise.unwrap_or(args.noise),
        mask_noise: args.mask_noise.unwrap_or(args.noise),
        nonrigid: args.nonrigid.unwrap_or(0.0),
        seed: args.seed,
        ..SynthParams::default()
    };
    if !args.garments.is_empty() {
        params.garments = args.garments.iter().map(|g| (*g).into()).collect();
    }
    let line = Line::new("capture", 0, 1);
    line.say("making the scene");
    let mut progress = |p: &Progress| {
        line.say(&format!("frame {} of {}", p.done + 1, args.frames));
        if cancel::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let report = match synth(&params, &args.out, &mut progress) {
        Ok(report) => report,
        Err(SynthError::Cancelled(_)) => {
            drop(line);
            errors::note(&format!("cancelled; `{}` was not written", args.out.display()));
            return Ok(End::Cancelled);
        }
        Err(source @ SynthError::Parameter(_)) => {
            return Err(SynthFault::Params { source }.into());
        }
        Err(source @ SynthError::Capture(CaptureError::BadName { .. })) => {
            return Err(SynthFault::Params { source }.into());
        }
        Err(source) => return Err(SynthFault::Write { source }.into()),
    };
    drop(line);
    let seconds = start.elapsed().as_secs_f64();
    if args.json {
        print_json(
            &json!({"out": args.out.display().to_string(), "params": params, "report": report, "seconds": seconds}),
        )?;
    } else {
        print(&text(args, &report, seconds))?;
    }
    Ok(End::Clean)
}

fn text(args: &SynthArgs, report: &SynthReport, seconds: f64) -> String {
    let person: usize = report.pixels[1..].iter().sum();
    let percent = |n: usize| 100.0 * n as f64 / person.max(1) as f64;
    let mut text = format!("{:<14} {:>12} {:>8}\n", "label", "pixels", "%");
    for (name, pixels) in report.labels.iter().zip(&report.pixels).skip(1) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name:<14} {:>12} {:>8.2}", count(*pixels), percent(*pixels));
    }
    let _ = writeln!(
        text,
        "\nNoise: {} labels wrong ({:.2} % of the person's pixels), {} mask pixels wrong ({:.2} %)\n\
         Wrote {}: {} frames of {}x{}, the template in body/, truth in truth/; {seconds:.2} s",
        count(report.wrong_labels),
        percent(report.wrong_labels),
        count(report.wrong_mask),
        percent(report.wrong_mask),
        args.out.display(),
        report.frames,
        args.size,
        args.size
    );
    text
}
