//! `ifg capture synth`: the project's own capture, for trying the whole chain.

use crate::cancel;
use crate::end::End;
use crate::output_error::{OutputError, advice, has_no_room};
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::table::count;
use crate::values::{above_zero, pose_sigma, shape_noise};
use clap::{Args, ValueEnum};
use if_body::mannequin::Garment;
use if_core::monitor::Progress;
use if_pipeline::capture::synth::{ShapeNoise, SynthError, SynthParams, SynthReport, synth};
use if_pipeline::capture::{CaptureError, PictureError, PoseSigma};
use miette::{Diagnostic, Report};
use serde_json::json;
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Args, Debug, Clone)]
pub(crate) struct SynthArgs {
    /// Output folder. It must not exist.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// What the mannequin wears, with commas; trousers, T-shirt and jacket by default.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "GARMENTS")]
    pub(crate) garments: Vec<Worn>,
    /// Pictures of one full turn.
    #[arg(long, value_name = "N", default_value_t = 24)]
    pub(crate) frames: usize,
    /// Pixels on each side.
    #[arg(long, value_name = "PIXELS", default_value_t = 256)]
    pub(crate) size: usize,
    /// How badly labels and masks are seen, from 0 to 1.
    #[arg(long, value_name = "NOISE", default_value_t = 0.3)]
    pub(crate) noise: f64,
    /// The same for the labels alone.
    #[arg(long, value_name = "NOISE")]
    pub(crate) label_noise: Option<f64>,
    /// The same for the masks alone.
    #[arg(long, value_name = "NOISE")]
    pub(crate) mask_noise: Option<f64>,
    /// How far clothes move by themselves, with a unit, such as 1cm; each frame as it is goes to
    /// truth/ then.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero)]
    pub(crate) nonrigid: Option<f64>,
    /// How far the poses are off, such as 3,9: root-mean-square angle of a joint in degrees, and
    /// standard deviation of the root along each axis in millimetres.
    #[arg(long, value_name = "DEG,MM", value_parser = pose_sigma, default_value = "0,0")]
    pub(crate) pose_noise: PoseSigma,
    /// Frames within which errors of poses correlate; 0 makes each frame's independent.
    #[arg(long, value_name = "FRAMES", default_value_t = 0.0)]
    pub(crate) pose_correlation: f64,
    /// Constant error of the camera's orientation: standard deviation of its turn about each axis, in
    /// degrees.
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    pub(crate) camera_noise: f64,
    /// How far the template's shape is off, such as 3,20: standard deviation of the length of bones
    /// in percent, and circumference in millimetres.
    #[arg(long, value_name = "PERCENT,MM", value_parser = shape_noise, default_value = "0,0")]
    pub(crate) shape_noise: ShapeNoise,
    /// Root-mean-square angle in degrees by which normals are off, smoothly.
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    pub(crate) normal_noise: f64,
    /// Random seed of the noise and the motion.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Print the report as JSON on stdout, and no table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// What the mannequin can wear.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Worn {
    Trousers,
    Tshirt,
    Skirt,
    Jacket,
    Coat,
}

impl From<Worn> for Garment {
    fn from(worn: Worn) -> Self {
        match worn {
            Worn::Trousers => Self::Trousers,
            Worn::Tshirt => Self::Tshirt,
            Worn::Skirt => Self::Skirt,
            Worn::Jacket => Self::Jacket,
            Worn::Coat => Self::Coat,
        }
    }
}

/// Why there is no capture.
#[derive(Debug, thiserror::Error, Diagnostic)]
enum SynthFault {
    #[error("no capture was written")]
    #[diagnostic(code(ifg::input::params), help("look at the options"))]
    Params { source: SynthError },
    #[error("no capture was written")]
    #[diagnostic(code(ifg::output::folder), help("{}", help(source)))]
    Write { source: SynthError },
}

/// What to do where no capture could be written.
fn help(error: &SynthError) -> &'static str {
    match error {
        SynthError::Capture(
            CaptureError::Io { source, .. }
            | CaptureError::Picture { source: PictureError::Io(source), .. },
        ) if has_no_room(source) => advice(source),
        _ => "give --out the name of a folder that does not exist, where you may write",
    }
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
        pose_noise: args.pose_noise,
        pose_correlation: args.pose_correlation,
        camera_noise: args.camera_noise,
        shape_noise: args.shape_noise,
        normal_noise: args.normal_noise,
        seed: args.seed,
        ..SynthParams::default()
    };
    if !args.garments.is_empty() {
        params.garments = args.garments.iter().map(|g| (*g).into()).collect();
    }
    let line = Line::new("capture", 0, 1);
    line.message("making the scene");
    let mut progress = |p: &Progress| {
        line.message(&format!("frame {} of {}", p.done + 1, args.frames));
        if cancel::is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let report = match synth(&params, &args.out, &mut progress) {
        Ok(report) => report,
        Err(SynthError::Cancelled(_)) => {
            drop(line);
            return Ok(cancel::end(args.out.display()));
        }
        Err(source @ SynthError::Parameter(_)) => {
            return Err(SynthFault::Params { source }.into());
        }
        Err(source @ SynthError::Capture(CaptureError::BadName { .. })) => {
            return Err(SynthFault::Params { source }.into());
        }
        Err(SynthError::Capture(CaptureError::Busy { path })) => {
            return Err(OutputError::Busy { path }.into());
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
