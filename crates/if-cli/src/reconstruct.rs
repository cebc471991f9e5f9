//! `ifg reconstruct`: a capture becomes garments of a wardrobe.

mod claim;
mod finished;
mod names;
mod pace;
mod page;
mod state;
mod summary;
mod taken;
mod writing;
mod written;

use crate::cancel;
use crate::end::End;
use crate::errors::{self, ErrorChain};
use crate::output_error::OutputError;
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::values::{above_zero, pose_sigma};
use claim::{Claim, Running};
use clap::Args;
use finished::Request;
use if_body::{TemplateBody, check_upright};
use if_core::monitor::Progress;
use if_mesh::atomic::{FolderWriter, PATIENCE};
use if_mesh::baked::BakeParams;
use if_neural::deform::DeformParams;
use if_outfit::digest;
use if_pipeline::asset::Provenance;
use if_pipeline::capture::{Capture, CaptureError, PoseSigma};
use if_pipeline::reconstruct::{
    FieldsParams, MotionNetworkParams, MotionParams, PhiNetwork, PhiParams, PoseParams,
    ReconstructError, ReconstructParams, reconstruct,
};
use if_pipeline::wardrobe::{CLOTHED, Wardrobe, WardrobeError};
use miette::{Diagnostic, Report};
use pace::{Pace, described};
use serde::Serialize;
use state::State;
use std::error::Error;
use std::fs;
use std::io;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;
use summary::{summary, warnings};
use taken::Names;
use writing::{BodyPaths, write_assets, write_clothed};

#[derive(Args, Debug, Clone, Serialize)]
pub(crate) struct ReconstructArgs {
    /// The capture: a folder as docs/reference/capture.md specifies it.
    #[arg(value_name = "CAPTURE")]
    #[serde(skip)]
    pub(crate) capture: PathBuf,
    /// The template body: a folder with body_clean.ply, or body.ply, and skeleton.json.
    #[arg(long, value_name = "DIR")]
    #[serde(skip)]
    pub(crate) body: PathBuf,
    /// The wardrobe that gets the body and the garments; the clothed person and a report go to
    /// clothed/CAPTURE in it. A run that was stopped goes on from its last round.
    #[arg(short, long, value_name = "WARDROBE")]
    #[serde(skip)]
    pub(crate) out: PathBuf,
    /// Use the first frame and each N-th after it. 24 to 50 frames of a turn are enough.
    #[arg(long, value_name = "N", default_value = "1")]
    pub(crate) every: NonZeroUsize,
    /// Put before each garment's name; by default the name of the capture's folder and an
    /// underscore.
    #[arg(long, value_name = "TEXT")]
    pub(crate) prefix: Option<String>,
    /// Name of the body in the wardrobe; by default that of its folder. Where another body has it, a
    /// number is appended, and a body that is there already keeps its name: the output states it.
    #[arg(long, value_name = "NAME")]
    pub(crate) body_name: Option<String>,
    /// Replace what was made of this capture before its meta.json was changed. Without this that is
    /// an error: it may be another person's. Nothing of another folder is ever replaced.
    #[arg(long)]
    #[serde(skip)]
    pub(crate) replace: bool,
    /// Side of the cells of the canonical mesh, with a unit; 8mm by default.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero)]
    pub(crate) cell: Option<f64>,
    /// How the clothed person is found: `surface` solves for a displacement of the template; `fields`
    /// goes on from there and trains φ and the motion of all frames as networks on the pictures, by
    /// implicit differentiation. They are written beside the clothed person.
    #[arg(long, value_name = "ROUTE", default_value = "surface")]
    pub(crate) route: Route,
    /// φ with --route fields: `grid`, or `mlp`, the paper's network, which takes longer.
    #[arg(long, value_name = "NETWORK", default_value = "grid")]
    pub(crate) phi: PhiOf,
    /// Steps of the training with --route fields.
    #[arg(long, value_name = "STEPS")]
    pub(crate) fields_steps: Option<u64>,
    /// Bake φ of the clothed person round each garment, as `phi.baked` beside it.
    #[arg(long)]
    pub(crate) bake: bool,
    /// Steps of a fit of φ as a network, which each garment gets as `phi.safetensors`; 0, as by
    /// default, leaves it out. With --route fields that fit is the start of the training, and each
    /// garment gets the trained φ.
    #[arg(long, value_name = "STEPS", default_value_t = 0)]
    pub(crate) phi_steps: u64,
    /// Write the canonical mesh in each frame, too: posed, and moved as the pictures show it.
    #[arg(long)]
    pub(crate) frames: bool,
    /// Where the motion of single frames comes from: `solved` from the pictures, or `none`, the pose
    /// alone. With --route fields it is that of the trained network, which starts there. Only with
    /// --frames.
    #[arg(long, value_name = "HOW", requires = "frames", default_value = "solved")]
    pub(crate) motion: MotionFrom,
    /// Steps of a fit of that motion as a network with an embedding for each frame,
    /// `deformation.safetensors` beside the frames' folder; 0, as by default, leaves it out. Not with
    /// --route fields, which has that network.
    #[arg(long, value_name = "STEPS", requires = "frames", default_value_t = 0)]
    pub(crate) motion_steps: u64,
    /// How far the poses are off, such as 3,9: root-mean-square angle of a joint in degrees, and
    /// standard deviation of the root along each axis in millimetres; 0,0 takes them as exact. By
    /// default what meta.json states, and 3,9 if it states nothing.
    #[arg(long, value_name = "DEG,MM", value_parser = pose_sigma)]
    pub(crate) pose_noise: Option<PoseSigma>,
    /// Reconstruct what is finished again. Without this a capture is skipped whose garments are in the
    /// wardrobe as the same program made them of the same files with the same options.
    #[arg(long)]
    #[serde(skip)]
    pub(crate) again: bool,
    /// Exit with code 1 after a warning: frames are not used, or frames or joints do not match their
    /// images, axes of normals are flipped, there are none, or most contradict the surface, a garment could not be
    /// made, no frame sees a third of it, or the edge of the picture cuts it. Everything is written all
    /// the same.
    #[arg(long)]
    #[serde(skip)]
    pub(crate) strict: bool,
    /// Print the report as JSON on stdout, and no summary.
    #[arg(long)]
    #[serde(skip)]
    pub(crate) json: bool,
}

/// How the clothed person is found.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Route {
    Surface,
    Fields,
}

/// The network of φ.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum PhiOf {
    Grid,
    Mlp,
}

/// Where the motion of single frames comes from.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum MotionFrom {
    Solved,
    None,
}

/// What a clothed person was made of, in its folder.
const PROVENANCE: &str = "provenance.json";

/// Why nothing was reconstructed.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{context}")]
#[diagnostic(code(ifg::reconstruct), help("{help}"))]
struct Fault {
    context: String,
    help: &'static str,
    source: ErrorChain,
}

fn fault<E: Error + 'static>(
    context: impl Into<String>,
    help: &'static str,
) -> impl FnOnce(E) -> Fault {
    let context = context.into();
    move |error| Fault { context, help, source: ErrorChain::new(&error) }
}

/// A grid of φ of 3 MB a garment: off by 0.07 mm on average near it. The default takes 10 MB and is off
/// by 0.05 mm (docs/evidence/reconstruction.md).
fn small_bake() -> BakeParams {
    BakeParams { accuracy: 2e-3, reach: 0.01, band: 0.03, ..BakeParams::default() }
}

/// What garments are made of.
fn provenance(args: &ReconstructArgs) -> Provenance {
    // The same words may name another folder elsewhere.
    let path = args.capture.canonicalize().unwrap_or_else(|_| args.capture.clone());
    Provenance {
        source: path.display().to_string(),
        sha256: meta_of(args),
        tool: format!("ifg reconstruct {}", env!("CARGO_PKG_VERSION")),
        licence: Vec::new(),
    }
}

/// The content of the capture's description.
fn meta_of(args: &ReconstructArgs) -> Option<String> {
    digest::of_file(&args.capture.join("meta.json")).ok().map(|c| c.sha256)
}

/// Runs the command.
pub(crate) fn run(args: &ReconstructArgs) -> Result<End, Report> {
    let params = parameters(args)?;
    let name = names::last_name(&args.capture, "capture");
    let line = Line::new(&name, 0, 1);
    line.message("reading");
    let capture = Capture::open(&args.capture).map_err(fault(
        format!("cannot read capture `{}`", args.capture.display()),
        "captures are specified in docs/reference/capture.md",
    ))?;
    let capture = capture.every(args.every);
    let template = TemplateBody::read(&args.body).map_err(fault(
        format!("cannot read template body `{}`", args.body.display()),
        "give a folder with body_clean.ply (or body.ply) and skeleton.json; see docs/reference/capture.md",
    ))?;
    check_upright(&template.mesh, Some(&template.skeleton)).map_err(fault(
        format!("template body `{}` cannot be used", args.body.display()),
        "rotate its files, and the capture",
    ))?;
    let usual = format!("{name}_");
    let prefix = args.prefix.as_ref().unwrap_or(&usual);
    let names = names::assets(&capture, prefix)
        .map_err(fault("cannot name the garments", "give --prefix another text"))?;
    let writing = |what: &str| format!("cannot write {what} into `{}`", args.out.display());
    const ROOM: &str = "make room there, or give --out another folder that you may write to";
    fs::create_dir_all(&args.out).map_err(fault(writing("anything"), ROOM))?;
    let own_prefix = (*prefix != usual).then(|| names::fitting(prefix));
    let state = State::of(&args.out, &name, own_prefix.as_deref());
    let made_of = provenance(args);
    let clothed = args.out.join(CLOTHED);
    let claim = Claim {
        clothed: name.clone(),
        source: made_of.source.clone(),
        state: PathBuf::from(state.path().file_name().unwrap_or_default()),
        garments: names.clone(),
    };
    // Held until everything is written.
    let running = Running::claim(&args.out, &claim)
        .map_err(fault(writing("anything"), ROOM))?
        .ok_or_else(|| OutputError::Busy { path: clothed.join(&name) })?;
    state.remove_partial();
    // A wardrobe that cannot be read is told of before the work, not after it.
    let wardrobe = Wardrobe::open(&args.out).map_err(fault(
        format!("cannot open wardrobe `{}`", args.out.display()),
        "formats are specified in docs/reference/wardrobe.md",
    ))?;
    let taken = Names {
        capture: &args.capture,
        made_of: &made_of,
        clothed: &name,
        garments: &names,
        replace: args.replace,
    };
    taken.refuse_taken(&wardrobe)?;
    drop(wardrobe);
    let paths = BodyPaths::of(&args.body, args.body_name.as_deref());
    Wardrobe::check_body(&paths.body()).map_err(fault(
        format!("template body `{}` cannot be added to a wardrobe", args.body.display()),
        "look at its files; docs/reference/capture.md specifies them",
    ))?;
    let request = Request::new(args, (&capture, &made_of), paths.files())
        .map_err(fault("cannot read what is to be reconstructed", "look at the files named"))?;
    if !args.again
        && let Some(finished) = request.finished(&args.out, &name)
    {
        state.remove();
        drop((running, line));
        finished.tell(&name, args)?;
        return Ok(end(args, &finished.warnings));
    }
    let start = Instant::now();
    let mut pace = Pace::new();
    let mut monitor = |p: &Progress| {
        let (text, is_due) = (described(p, pace.seconds_left(p)), pace.is_due());
        line.message(&text);
        if is_due {
            tracing::debug!("{name}: {text}");
        }
        if cancel::is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let found = state.with(
        |path| reconstruct(&capture, &template, &params, Some(path), &mut monitor),
        |note| line.aside(|| errors::note(note)),
    );
    let found = match found {
        Ok(found) => found,
        Err(ReconstructError::Cancelled(_)) => {
            drop(line);
            errors::note("cancelled; the same command goes on from what is done");
            return Ok(End::Cancelled);
        }
        Err(error) => {
            let help = help(&error);
            return Err(fault(format!("cannot reconstruct `{}`", args.capture.display()), help)(
                error,
            )
            .into());
        }
    };
    let seconds = start.elapsed().as_secs_f64();
    line.message("writing");
    let network = match (&found.fields, &found.phi) {
        (Some(fields), _) if args.phi_steps > 0 => Some(fields.phi_bytes()),
        (_, phi) => phi.as_ref().map(PhiNetwork::to_bytes),
    };
    let network = network.transpose().map_err(fault(writing("φ"), ROOM))?;
    let finished = (&capture, &found, &made_of);
    let writer = FolderWriter::wait(&clothed, PATIENCE)
        .map_err(fault(writing("the clothed body"), ROOM))?
        .ok_or(OutputError::Busy { path: clothed })?;
    // Another process may have written there meanwhile.
    let wardrobe = Wardrobe::open(&args.out).map_err(fault(writing("assets"), ROOM))?;
    taken.refuse_taken(&wardrobe)?;
    let written = write_assets((wardrobe, &paths.body()), &names, finished, network.as_deref());
    let (mut written, earlier) = written.map_err(|error| match error {
        WardrobeError::Busy { path } => Report::from(OutputError::Busy { path }),
        error if error.kind() == "io" => fault(writing("assets"), ROOM)(error).into(),
        error => fault(writing("assets"), "look at what is named")(error).into(),
    })?;
    written.clothed = format!("{CLOTHED}/{name}");
    let warnings = warnings(&found.report);
    let record = |folder: &Path| request.record(folder, &args.out, &written, &warnings);
    write_clothed(args, (&writer, &name), finished, &template, record)
        .map_err(fault(writing("the clothed body"), ROOM))?;
    state.remove();
    drop((running, line));
    for name in earlier {
        errors::note(&format!(
            "garment `{name}` stays from an earlier reconstruction of this capture: this one has not made it. Remove its folder if it is of no use"
        ));
    }
    if args.json {
        print_json(&written.with(&found.report))?;
        warnings.iter().for_each(|text| errors::note(text));
    } else {
        print(&(summary(&name, &found.report, seconds) + &written.line(&args.out)))?;
    }
    Ok(end(args, &warnings))
}

/// How a run ends that made what it could.
fn end(args: &ReconstructArgs, warnings: &[String]) -> End {
    if args.strict && !warnings.is_empty() { End::NotClean } else { End::Clean }
}

/// What the options ask for.
fn parameters(args: &ReconstructArgs) -> Result<ReconstructParams, Fault> {
    const ONE_OF_THEM: &str = "leave one of them out";
    let refused = |what: &str, why, help| Err(fault(what, help)(io::Error::other(why)));
    if args.route == Route::Fields && args.motion_steps > 0 {
        let what =
            "--route fields trains the network of the motion, and --motion-steps fits another one";
        return refused(what, "one too many", ONE_OF_THEM);
    }
    if args.route == Route::Surface && (args.phi != PhiOf::Grid || args.fields_steps.is_some()) {
        let what =
            "--phi and --fields-steps are of a training, which --route surface does not have";
        return refused(what, "nothing to train", "add --route fields");
    }
    if args.motion_steps > 0 && args.motion != MotionFrom::Solved {
        let what = "--motion-steps fits a network to the motion that is solved, and --motion says that none is";
        return refused(what, "nothing to fit", ONE_OF_THEM);
    }
    let mut params = ReconstructParams::default();
    params.cell = args.cell.unwrap_or(params.cell);
    params.bake = args.bake.then(small_bake);
    let steps = args.phi_steps;
    params.phi = (steps > 0).then(|| PhiParams { steps, ..PhiParams::default() });
    params.fields = (args.route == Route::Fields).then(|| {
        let mut fields = match args.phi {
            PhiOf::Grid => FieldsParams::default(),
            PhiOf::Mlp => FieldsParams::mlp(),
        };
        fields.steps = args.fields_steps.unwrap_or(fields.steps);
        if steps > 0 {
            fields.phi.steps = steps;
        }
        fields
    });
    let solved = args.motion == MotionFrom::Solved && (args.frames || params.fields.is_some());
    params.motion = solved.then(MotionParams::default);
    params.motion_network = (args.motion_steps > 0).then(|| MotionNetworkParams {
        fit: DeformParams { steps: args.motion_steps, ..DeformParams::default() },
        ..MotionNetworkParams::default()
    });
    params.poses = args.pose_noise.map(PoseParams::of);
    params
        .validate()
        .map_err(fault("these options cannot be used", "see ifg reconstruct --help"))?;
    Ok(params)
}

/// What to do where nothing could be reconstructed.
fn help(error: &ReconstructError) -> &'static str {
    match error {
        ReconstructError::Checkpoint { .. } | ReconstructError::BrokenCheckpoint { .. } => {
            "what a stopped run has reached is the hidden file `.NAME.reconstruct.state` in --out; it can be removed"
        }
        ReconstructError::Capture(
            CaptureError::JointCount { .. } | CaptureError::JointName { .. },
        ) => "give --body the folder of the body that the poses are of",
        _ => "captures are specified in docs/reference/capture.md",
    }
}
