//! `ifg animate`: a clean outfit follows a motion, every frame proven.

mod page;
mod pictures;
mod summary;

use crate::cancel;
use crate::end::End;
use crate::errors::{self, ErrorChain};
use crate::inputs::{InputArgs, Order, ParamArgs};
use crate::load::{self, LoadError};
use crate::order;
use crate::outfit_file::{LayerSpec, OutfitSpec, outfits};
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::receipt;
use crate::report_output;
use crate::staging::{OutputError, Staging};
use clap::Args;
use if_body::{Motion, MotionError, Skeleton, SkeletonError};
use if_core::math::Point;
use if_core::monitor::{Cancelled, Monitor, Progress};
use if_mesh::file::{MeshFile, WriteError};
use if_mesh::point_cache::{PointCacheError, PointCacheWriter};
use if_outfit::files::{FilesError, OutfitFiles};
use if_outfit::outfit::Outfit;
use if_outfit::resolve::ResolveError;
use if_outfit::unresolved::Unresolved;
use if_pipeline::animate::{
    AnimateError, AnimateParams, Animation, Frames, SkinFault, SkinnedOutfit, animate,
};
use miette::{Diagnostic, IntoDiagnostic, Report};
use serde_json::json;
use std::fs::File;
use std::io::{self, BufWriter};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

#[derive(Args, Debug, Clone)]
pub(crate) struct AnimateArgs {
    #[command(flatten)]
    pub(crate) input: InputArgs,
    #[command(flatten)]
    pub(crate) params: ParamArgs,
    /// The motion: a pose for each frame (.json, docs/animate.md; .bvh).
    #[arg(long, value_name = "FILE")]
    pub(crate) motion: PathBuf,
    /// The skeleton; by default `skeleton.json` beside the body.
    #[arg(long, value_name = "FILE")]
    pub(crate) skeleton: Option<PathBuf>,
    /// Output folder.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Take every N-th frame of the motion only.
    #[arg(long, value_name = "N", default_value = "1")]
    pub(crate) every: NonZeroUsize,
    /// Write a mesh for each garment and frame as well, with all attributes of its file.
    #[arg(long)]
    pub(crate) meshes: bool,
    /// Do not draw motion.png and strip.png, nor write report.html.
    #[arg(long)]
    pub(crate) no_pictures: bool,
}

/// An outfit cannot be animated.
#[derive(Debug, thiserror::Error, Diagnostic)]
enum AnimateFault {
    #[error("{count} outfits are given, and one can be animated at a time")]
    #[diagnostic(
        code(ifg::arguments::one_outfit),
        help("give one outfit file, or --body and garments")
    )]
    Count { count: usize },
    #[error("the outfit is scaled by {scale}, and frames are in metres")]
    #[diagnostic(
        code(ifg::animate::scale),
        help("convert body, garments and skeleton to metres first, and leave out --scale")
    )]
    Scale { scale: f64 },
    #[error("`{}` cannot be used", path.display())]
    #[diagnostic(
        code(ifg::input::skeleton),
        help(
            "give the skeleton of the body with --skeleton; docs/reference/capture.md specifies it"
        )
    )]
    Skeleton { path: PathBuf, source: SkeletonError },
    #[error("`{}` cannot be used", path.display())]
    #[diagnostic(code(ifg::input::motion), help("docs/animate.md specifies motions"))]
    Motion { path: PathBuf, source: MotionError },
    #[error("the outfit has no valid skinning weights")]
    #[diagnostic(
        code(ifg::input::skin),
        help(
            "the body needs the vertex properties j0 to j3 and w0 to w3 (PLY); garments without them follow the body"
        )
    )]
    Skin { source: SkinFault },
    #[error("outfit `{outfit}` is not clean at rest: {unresolved}")]
    #[diagnostic(
        code(ifg::unresolved),
        help("resolve it with `ifg fix` first, with other parameters or without a layer")
    )]
    NotClean { outfit: String, unresolved: Box<Unresolved> },
    #[error("the outfit cannot be animated")]
    #[diagnostic(code(ifg::animate), help("look at the layer, frame or file that is named"))]
    Animate { source: AnimateError },
}

/// Frames that are not clean, or not clean everywhere with --strict.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{} of {frames} frames are not clean{}: {}", bad.len(), if *strict { " everywhere" } else { "" }, listed(bad))]
#[diagnostic(
    code(ifg::animate::not_clean),
    help("report.json names what is left in each; they were written as far as they came")
)]
struct NotClean {
    bad: Vec<usize>,
    frames: usize,
    strict: bool,
}

fn listed(frames: &[usize]) -> String {
    /// More frames than these do not help a person.
    const SHOWN: usize = 12;
    let shown: Vec<String> = frames.iter().take(SHOWN).map(usize::to_string).collect();
    let more = if frames.len() > SHOWN { ", ..." } else { "" };
    format!("{}{more}", shown.join(", "))
}

/// The folder of frames that are done, in the output folder.
const FRAMES: &str = "frames";
/// The folder of meshes of single frames, in the output folder.
const MESHES: &str = "meshes";
const REPORT: &str = "report.json";

/// Runs the command.
pub(crate) fn run(args: &AnimateArgs) -> Result<End, Report> {
    let spec = one_outfit(args)?;
    let mut line = &Line::new(&spec.name, 0, 1);
    line.message("reading");
    let files = load::load(&spec)?;
    let (skeleton, motion) = read_motion(args, &spec)?;
    let skin = |outfit: Outfit| {
        SkinnedOutfit::from_files(outfit, skeleton.clone(), files.files())
            .map_err(|source| AnimateFault::Skin { source })
    };
    // Weights that are missing are found before the outfit is resolved.
    skin(files.outfit().clone())?;
    let skinned = match files.resolve(&spec.params, &mut line) {
        Ok(resolved) => skin(resolved.outfit)?,
        Err(FilesError::Resolve(ResolveError::Cancelled { .. })) => {
            return Ok(cancel::end(args.out.display()));
        }
        Err(FilesError::Unresolved { unresolved, .. }) => {
            let (outfit, unresolved) = (spec.name.clone(), Box::new(unresolved));
            let error = AnimateFault::NotClean { outfit, unresolved };
            errors::show(&error.into());
            return Ok(End::NotClean);
        }
        Err(error) => return Err(LoadError::new(&spec.name, error).into()),
    };
    let staging = Staging::open(&args.out)?;
    let mut monitor = Frame(line);
    let params = AnimateParams::default();
    let folder = args.out.join(FRAMES);
    let animation = match animate(&skinned, &motion, &params, &folder, &mut monitor) {
        Ok(animation) => animation,
        Err(AnimateError::Cancelled(_)) => {
            errors::note(&format!(
                "cancelled; `{}` holds the frames that are done, and the same command goes on",
                folder.display()
            ));
            return Ok(End::Cancelled);
        }
        Err(source) => return Err(AnimateFault::Animate { source }.into()),
    };
    line.message("writing");
    let mut names = write_caches(&spec, &skinned.outfit, &animation.frames, (&staging, args))?;
    if args.meshes {
        write_meshes(&spec, &skinned.outfit, &files, &animation.frames, args)?;
    }
    if !args.no_pictures {
        line.message("drawing");
        let folders = (&staging, args.out.as_path());
        names.extend(pictures::draw(&skinned, &motion, &animation, folders)?);
        names.push(page::write(&report_output::title(&spec), &skinned, &animation, folders)?);
    }
    let report = json!({
        "outfit": spec.name,
        "motion": args.motion.display().to_string(),
        "every": args.every,
        "tool": receipt::tool(),
        "request": animation.frames.request(),
        "params": params,
        "weights_from_body": skinned.without_weights,
        "joints_not_in_motion": motion.unmatched,
        "outputs": names,
        "report": animation.report,
    });
    let text = serde_json::to_string_pretty(&report).into_diagnostic()? + "\n";
    std::fs::write(staging.path(REPORT), text)
        .map_err(|source| OutputError::File { path: args.out.join(REPORT), source })?;
    names.push(REPORT.into());
    staging.commit(&names)?;
    if args.input.json {
        print_json(&report)?;
    } else {
        let notes = (&skinned.without_weights[..], &motion.unmatched[..]);
        let head = report_output::title(&spec);
        print(&format!("{head}{}", summary::text(&animation.report, notes, &args.out, &names)))?;
    }
    Ok(end(&animation, args.input.strict))
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

fn read_motion(args: &AnimateArgs, spec: &OutfitSpec) -> Result<(Skeleton, Motion), AnimateFault> {
    let path = args.skeleton.clone();
    let path = path.unwrap_or_else(|| spec.body.path.with_file_name("skeleton.json"));
    let skeleton = Skeleton::read_path(&path)
        .map_err(|source| AnimateFault::Skeleton { path: path.clone(), source })?;
    let motion = Motion::read_path(&args.motion, &skeleton)
        .map_err(|source| AnimateFault::Motion { path: args.motion.clone(), source })?;
    Ok((skeleton, motion.every(args.every.get())))
}

/// Shows frames on the line; walks within a frame can be cancelled, and are not shown.
struct Frame<'a>(&'a Line);

impl Monitor for Frame<'_> {
    fn report(&mut self, progress: &Progress<'_>) -> Result<(), Cancelled> {
        if progress.stage == "walk" { cancel::check() } else { self.0.report(progress) }
    }
}

/// Writes a point cache for each layer, and returns their names.
fn write_caches(
    spec: &OutfitSpec,
    outfit: &Outfit,
    frames: &Frames,
    (staging, args): (&Staging, &AnimateArgs),
) -> Result<Vec<String>, Report> {
    let mut names: Vec<String> = Vec::new();
    let mut caches = Vec::new();
    let fault = |name: &str, error: PointCacheError| OutputError::File {
        path: args.out.join(name),
        source: io::Error::other(error),
    };
    for (layer, mesh) in spec.layers().zip(outfit.layers()) {
        let name = format!("{}.pc2", layer.file_stem());
        if names.iter().any(|n| n.eq_ignore_ascii_case(&name)) {
            let (first, second) = (name.clone(), layer.written.clone());
            return Err(OutputError::SameName { first, second, name }.into());
        }
        let path = staging.path(&name);
        let file = File::create(&path)
            .map_err(|source| OutputError::File { path: args.out.join(&name), source })?;
        let points = mesh.mesh.vertices().len();
        let cache = PointCacheWriter::new(BufWriter::new(file), points, frames.len());
        caches.push((cache.map_err(|e| fault(&name, e))?, points));
        names.push(name);
    }
    for frame in 0..frames.len() {
        let all = frames.positions(frame).map_err(|source| AnimateFault::Animate { source })?;
        let mut rest = &all[..];
        for ((cache, points), name) in caches.iter_mut().zip(&names) {
            let (layer, others) = rest.split_at(*points);
            cache.frame(layer).map_err(|e| fault(name, e))?;
            rest = others;
        }
    }
    for ((cache, _), name) in caches.into_iter().zip(&names) {
        cache.finish().map_err(|e| fault(name, e))?;
    }
    Ok(names)
}

/// Writes each garment of each frame with the attributes of its file.
fn write_meshes(
    spec: &OutfitSpec,
    outfit: &Outfit,
    files: &OutfitFiles,
    frames: &Frames,
    args: &AnimateArgs,
) -> Result<(), Report> {
    for frame in 0..frames.len() {
        let folder = args.out.join(MESHES).join(format!("{frame:06}"));
        std::fs::create_dir_all(&folder)
            .map_err(|source| OutputError::Folder { path: folder.clone(), source })?;
        let all = frames.positions(frame).map_err(|source| AnimateFault::Animate { source })?;
        let mut rest = &all[..];
        let mut by_file: Vec<(&LayerSpec, Vec<LayerInFile<'_>>)> = Vec::new();
        for ((layer, mesh), file) in spec.layers().zip(outfit.layers()).zip(files.files()) {
            let (positions, others) = rest.split_at(mesh.mesh.vertices().len());
            rest = others;
            match by_file.iter_mut().find(|(first, _)| layer.is_in_file_of(first)) {
                Some((_, layers)) => layers.push((file, positions)),
                None => by_file.push((layer, vec![(file, positions)])),
            }
        }
        for (layer, layers) in by_file {
            write_meshes_of_file(&layers, &folder.join(&layer.file_name))?;
        }
        cancel::check().into_diagnostic()?;
    }
    Ok(())
}

/// A layer of a file, and its positions in a frame.
type LayerInFile<'a> = (&'a MeshFile, &'a [Point]);

fn write_meshes_of_file(layers: &[LayerInFile<'_>], path: &Path) -> Result<(), OutputError> {
    MeshFile::write_layers(layers, path).map_err(|error| match error {
        WriteError::Io { path, source } => OutputError::File { path, source },
        other => OutputError::Mesh { path: path.into(), source: ErrorChain::new(&other) },
    })
}

/// How the command ends; frames that are not clean are named.
fn end(animation: &Animation, strict: bool) -> End {
    let frames = &animation.report.frames;
    let is_good = |row: &if_pipeline::animate::FrameReport| {
        if strict { row.is_clean_everywhere() } else { row.is_clean() }
    };
    let bad: Vec<usize> = frames.iter().filter(|f| !is_good(f)).map(|f| f.frame).collect();
    if bad.is_empty() {
        return End::Clean;
    }
    errors::show(&NotClean { bad, frames: frames.len(), strict }.into());
    End::NotClean
}
