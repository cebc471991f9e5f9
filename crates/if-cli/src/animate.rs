//! `ifg animate`: a clean outfit follows a motion, every frame proven.

mod faults;
mod files;
mod gltf;
mod meshes;
mod page;
mod pictures;
mod source;
mod summary;

use self::faults::{AnimateFault, LessClean, NotClean, NotCleanBetween};
use self::files::{Names, Stale};
use self::meshes::Meshes;
use self::source::Source;
pub(crate) use self::source::SourceArgs;
use crate::cancel;
use crate::end::End;
use crate::errors;
use crate::inputs::{InputArgs, Order, ParamArgs, PinchArg, given_twice};
use crate::load::{self, LoadError};
use crate::order;
use crate::outfit_file::{OutfitSpec, outfits};
use crate::output_error::OutputError;
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::receipt;
use crate::shard::Shard;
use crate::staging::Staging;
use crate::values::{above_zero, assignment};
use clap::Args;
use if_mesh::point_cache::{PointCacheError, PointCacheWriter};
use if_outfit::files::FilesError;
use if_outfit::outfit::Outfit;
use if_outfit::resolve::ResolveError;
use if_outfit::{Pinch, Split, with_parameter};
use if_pipeline::animate::{
    AnimateError, AnimateParams, Animation, Frames, IntervalReport, between_frames, follow,
    follow_part,
};
use miette::{IntoDiagnostic, Report};
use serde_json::{Value, json};
use std::fs::File;
use std::io::{self, BufWriter};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args, Debug, Clone)]
#[command(mut_arg("scale", |scale| scale.hide(true)))] // refused: frames are in metres
pub(crate) struct AnimateArgs {
    #[command(flatten)]
    pub(crate) input: InputArgs,
    #[command(flatten)]
    pub(crate) params: ParamArgs,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    /// What happens where the body meets itself or leaves no room for the cloth between, as in armpits
    /// and groin.
    #[arg(long, value_enum, default_value = "yield")]
    pub(crate) pinch: PinchArg,
    /// The farthest that a body may yield, with a unit, such as 15mm. Where more would be needed, the
    /// frame has a pinch, which is named.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero, default_value = "10cm", allow_hyphen_values = true)]
    pub(crate) body_depth: f64,
    /// Any other parameter of the motion, such as smoothing=0.2; docs/animate.md lists them. May be
    /// given more than once.
    #[arg(long, value_name = "KEY=VALUE", value_parser = assignment)]
    pub(crate) motion_set: Vec<(String, toml::Value)>,
    /// Output folder.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Compute one part of the frames alone: the I-th of N machines that write into the same folder. The
    /// same command without --shard then keeps what all did, and writes the rest.
    #[arg(long, value_name = "I/N", conflicts_with_all = ["continuous", "meshes", "gltf"])]
    pub(crate) shard: Option<Shard>,
    /// Examine the ways between frames, too: whether anything passes through anything while all
    /// vertices move from one frame to the next in straight lines.
    #[arg(long)]
    pub(crate) continuous: bool,
    /// Write a mesh for each layer and frame as well, the body included, with all attributes of its
    /// file.
    #[arg(long)]
    pub(crate) meshes: bool,
    /// Write motion.glb as well, one file with all layers and frames for browsers, engines and
    /// Blender.
    #[arg(long)]
    pub(crate) gltf: bool,
    /// Do not draw motion.png and strip.png, nor write report.html.
    #[arg(long)]
    pub(crate) no_pictures: bool,
}

/// The folder of frames that are done, in the output folder.
const FRAMES: &str = "frames";
/// The folder of meshes of single frames, in the output folder.
const MESHES: &str = "meshes";
const REPORT: &str = "report.json";

/// What to do with an outfit.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    pub(crate) source: SourceArgs,
    pub(crate) params: AnimateParams,
    /// Output folder.
    pub(crate) out: PathBuf,
    pub(crate) shard: Option<Shard>,
    pub(crate) continuous: bool,
    pub(crate) meshes: bool,
    pub(crate) gltf: bool,
    pub(crate) pictures: bool,
    pub(crate) json: bool,
    pub(crate) strict: bool,
}

/// Runs the command.
pub(crate) fn run(args: &AnimateArgs) -> Result<End, Report> {
    let options = Options {
        source: args.source.clone(),
        params: params(args)?,
        out: args.out.clone(),
        shard: args.shard,
        continuous: args.continuous,
        meshes: args.meshes,
        gltf: args.gltf,
        pictures: !args.no_pictures,
        json: args.input.json,
        strict: args.input.strict,
    };
    animated(&one_outfit(args)?, &options)
}

/// Animates an outfit.
pub(crate) fn animated(spec: &OutfitSpec, args: &Options) -> Result<End, Report> {
    let mut line = &Line::new(&spec.name, 0, 1);
    line.message("reading");
    let files = load::load(spec).map_err(faults::of_files)?;
    // Weights that are missing, and frames that do not fit, are found before the outfit is resolved.
    let source = Source::read(&args.source, spec, &files)?;
    let planned = Names::new(spec, args, source.frames())?;
    if spec.params.goal.split != Split::Never {
        return Err(AnimateFault::Split.into());
    }
    if spec.params.goal.pinch != Pinch::Keep {
        return Err(AnimateFault::Pinch.into());
    }
    let moved = match files.resolve(&spec.params, &mut line) {
        Ok(resolved) => source.moved(resolved.outfit, &files)?,
        Err(FilesError::Resolve(ResolveError::Cancelled { .. })) => {
            return Ok(cancel::end(args.out.display()));
        }
        Err(FilesError::Unresolved { unresolved, .. }) => {
            let error = AnimateFault::NotClean { outfit: spec.name.clone(), unresolved };
            errors::show(&error.into());
            return Ok(End::NotClean);
        }
        Err(error) => return Err(LoadError::new(spec, error).into()),
    };
    let movement = moved.movement();
    if args.gltf {
        // Before the frames are computed, not after.
        gltf::check(movement.outfit(), (movement.frames(), movement.frames_per_second()))
            .map_err(|source| AnimateFault::Gltf { source })?;
    }
    let params = args.params;
    let folder = args.out.join(FRAMES);
    let stopped = |source| match source {
        AnimateError::Cancelled(_) => {
            errors::note(&format!(
                "cancelled; `{}` holds the frames that are done, and the same command goes on",
                folder.display()
            ));
            Ok(End::Cancelled)
        }
        AnimateError::Busy { path } => Err(OutputError::Busy { path }.into()),
        AnimateError::Far { frame, distance } => {
            let source = AnimateError::Far { frame: args.source.number(frame), distance };
            Err(AnimateFault::Animate { source }.into())
        }
        source => Err(AnimateFault::Animate { source }.into()),
    };
    let mut monitor = line;
    if let Some(shard) = args.shard {
        let part = shard.range(movement.frames());
        return match follow_part(movement, &params, part.clone(), &folder, &mut monitor) {
            Ok(new) => part_is_done(args, (&folder, part, movement.frames()), new),
            Err(error) => stopped(error),
        };
    }
    let staging = Staging::open(&args.out)?;
    let mut animation = match follow(movement, &params, &folder, &mut monitor) {
        Ok(animation) => animation,
        Err(error) => return stopped(error),
    };
    // What is said about frames is said of their numbers in the motion.
    let number = |frame| args.source.number(frame);
    animation.report.frames.iter_mut().for_each(|row| row.frame = number(row.frame));
    animation.report.cuts.iter_mut().for_each(|frame| *frame = number(*frame));
    line.message("writing");
    let mut names = planned.caches.clone();
    let mut rounded = Vec::new();
    let written = write_caches(&names, movement.outfit(), &animation.frames, (&staging, args))
        .and_then(|()| {
            if args.gltf {
                let rate = movement.frames_per_second();
                let outfit = (movement.outfit(), files.files());
                let folders = (&staging, args.out.as_path());
                names.push(gltf::write(outfit, (&animation.frames, rate), folders)?);
            }
            let frames = (&animation.frames, &planned.meshes[..]);
            let meshes =
                Meshes { spec, files: &files, outfit: movement.outfit(), walk: &params.walk };
            let (written, less_clean) = meshes.write(frames, (&staging, args))?;
            names.extend(written);
            rounded = less_clean.into_iter().map(number).collect();
            Ok(())
        });
    match written {
        Err(_) if cancel::is_requested() => return Ok(cancel::end(args.out.display())),
        written => written?,
    }
    let start = Instant::now();
    let mut between = match args.continuous {
        false => None,
        true => match between_frames(movement.outfit(), &animation.frames, &mut monitor) {
            Ok(between) => Some(between),
            // What was written above stays.
            Err(AnimateError::Cancelled(_)) => None,
            Err(source) => return Err(AnimateFault::Animate { source }.into()),
        },
    };
    let is_cancelled = args.continuous && between.is_none();
    let between_seconds = between.as_ref().map(|_| start.elapsed().as_secs_f64());
    between.iter_mut().flatten().for_each(|row| row.frame = number(row.frame));
    if args.pictures && !is_cancelled {
        line.message("drawing");
        let folders = (&staging, args.out.as_path());
        names.extend(pictures::draw(movement, &animation, folders)?);
        names.push(page::write(
            &spec.title(),
            movement.outfit(),
            (&animation, between.as_deref()),
            folders,
        )?);
    }
    let noticed = moved.noticed();
    let mut report = json!({
        "outfit": spec.name,
        "motion": args.source.motion.display().to_string(),
        "every": args.source.every,
        "frames": args.source.frames,
        "tool": receipt::tool(),
        "request": animation.frames.request(),
        "params": params,
        "outputs": names,
        "report": animation.report,
        "between_frames": between,
        "between_seconds": between_seconds,
        "meshes_less_clean": rounded,
    });
    if let (Value::Object(report), Value::Object(noticed)) = (&mut report, json!(noticed)) {
        report.extend(noticed);
    }
    let text = serde_json::to_string_pretty(&report).into_diagnostic()? + "\n";
    std::fs::write(staging.path(REPORT), text)
        .map_err(|source| OutputError::File { path: args.out.join(REPORT), source })?;
    names.push(REPORT.into());
    let stale = Stale::of(spec, args, &names);
    staging.commit(&names)?;
    stale.remove()?;
    if args.json {
        print_json(&report)?;
    } else {
        let head = spec.title();
        let found = (&animation.report, between.as_deref().zip(between_seconds));
        print(&format!("{head}\n\n{}", summary::text(found, &noticed, &args.out, &names)))?;
    }
    if is_cancelled {
        errors::note("cancelled; the ways between frames were not examined, and nothing is drawn");
        return Ok(End::Cancelled);
    }
    Ok(end(&animation, between.as_deref(), rounded, args.strict))
}

/// The parameters of the motion.
fn params(args: &AnimateArgs) -> Result<AnimateParams, AnimateFault> {
    if let Some(name) = given_twice(&args.motion_set, &["pinch", "body_depth"]) {
        return Err(AnimateFault::Twice { name: name.to_owned() });
    }
    let (pinch, body_depth) = (args.pinch.into(), args.body_depth);
    let params = AnimateParams { pinch, body_depth, ..AnimateParams::default() };
    let params = args
        .motion_set
        .iter()
        .try_fold(params, |params, (name, value)| with_parameter(&params, name, value))?;
    params.validate()?;
    Ok(params)
}

/// The outfit that is named, in metres and in order.
fn one_outfit(args: &AnimateArgs) -> Result<OutfitSpec, Report> {
    let mut specs = outfits(&args.input, &args.params);
    if specs.len() != 1 {
        return Err(AnimateFault::Count { count: specs.len() }.into());
    }
    let spec = specs.remove(0)?;
    if spec.scale != 1.0 {
        return Err(AnimateFault::Scale { scale: spec.scale }.into());
    }
    match args.input.order {
        Order::Given => Ok(spec),
        Order::Auto => order::ordered(&spec),
    }
}

/// Says what of the frames is done.
fn part_is_done(
    args: &Options,
    (folder, part, frames): (&Path, Range<usize>, usize),
    new: usize,
) -> Result<End, Report> {
    let numbers: Vec<usize> = part.map(|frame| args.source.number(frame)).collect();
    if args.json {
        print_json(&json!({"frames": numbers, "new": new, "folder": folder}))?;
    } else {
        let which = match numbers[..] {
            [] => "no frame".to_owned(),
            [one] => format!("frame {one}"),
            [first, .., last] => format!("frames {first} to {last}"),
        };
        print(&format!(
            "{} of {frames}: {which}, {new} of them new, in {}\nThe same command without --shard keeps the frames of all parts.\n",
            numbers.len(),
            folder.display()
        ))?;
    }
    Ok(End::Clean)
}

/// Writes a point cache for each layer.
fn write_caches(
    names: &[String],
    outfit: &Outfit,
    frames: &Frames,
    (staging, args): (&Staging, &Options),
) -> Result<(), Report> {
    let fault = |name: &str, error: PointCacheError| OutputError::File {
        path: args.out.join(name),
        source: io::Error::other(error),
    };
    let mut caches = Vec::new();
    for (name, layer) in names.iter().zip(outfit.layers()) {
        let file = File::create(staging.path(name))
            .map_err(|source| OutputError::File { path: args.out.join(name), source })?;
        let points = layer.mesh.vertices().len();
        let numbers = [args.source.number(0), args.source.every.get()];
        let cache = PointCacheWriter::numbered(BufWriter::new(file), points, frames.len(), numbers);
        caches.push(cache.map_err(|e| fault(name, e))?);
    }
    for frame in 0..frames.len() {
        let layers = frames.layers(frame).map_err(|source| AnimateFault::Animate { source })?;
        for ((cache, layer), name) in caches.iter_mut().zip(&layers).zip(names) {
            cache.frame(layer).map_err(|e| fault(name, e))?;
        }
    }
    for (cache, name) in caches.into_iter().zip(names) {
        cache.finish().map_err(|e| fault(name, e))?;
    }
    Ok(())
}

/// How the command ends; frames that are not clean are named, and with `strict` intervals.
fn end(
    animation: &Animation,
    between: Option<&[IntervalReport]>,
    rounded: Vec<usize>,
    strict: bool,
) -> End {
    let frames = &animation.report.frames;
    let is_good = |row: &if_pipeline::animate::FrameReport| {
        if strict { row.is_clean_everywhere() } else { row.is_clean() }
    };
    let bad: Vec<usize> = frames.iter().filter(|f| !is_good(f)).map(|f| f.frame).collect();
    let crossed = between.unwrap_or_default().iter().filter(|i| strict && !i.is_clean());
    let crossed: Vec<usize> = crossed.map(|i| i.frame).collect();
    let is_clean = bad.is_empty() && crossed.is_empty() && rounded.is_empty();
    if !rounded.is_empty() {
        errors::show(&LessClean { frames: rounded }.into());
    }
    if !bad.is_empty() {
        errors::show(&NotClean { bad, frames: frames.len(), strict }.into());
    }
    if !crossed.is_empty() {
        errors::show(&NotCleanBetween { crossed, intervals: frames.len() - 1 }.into());
    }
    if is_clean { End::Clean } else { End::NotClean }
}
