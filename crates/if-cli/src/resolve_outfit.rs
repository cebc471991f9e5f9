//! One outfit from its files to its output folder.

use crate::cancel;
use crate::end::End;
use crate::hash;
use crate::load::{self, Loaded};
use crate::outfit_file::{LayerSpec, OutfitSpec};
use crate::pictures;
use crate::progress::Line;
use crate::receipt::{self, Output, Request, Timings};
use crate::staging::{OutputError, Staging};
use if_pipeline::outfit::Outfit;
use if_pipeline::report::{PairReport, ResolveReport};
use if_pipeline::resolve::{ResolveError, Resolved, resolve};
use if_pipeline::verify::verify;
use miette::{Diagnostic, IntoDiagnostic, Report};
use std::io;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// How to write.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Options {
    pub(crate) in_place: bool,
    pub(crate) write_unproven: bool,
    /// Leave an outfit alone whose receipt says that it is done.
    pub(crate) resume: bool,
    pub(crate) pictures: bool,
}

/// How it went.
pub(crate) enum Outcome {
    /// It was done before, and nothing has changed since.
    Finished,
    /// The user asked to stop.
    Cancelled,
    /// It was resolved, as far as it went.
    Resolved(Box<Done>),
}

/// A resolved outfit.
pub(crate) struct Done {
    pub(crate) report: ResolveReport,
    /// What was written; nothing where intersections are left, unless asked for.
    pub(crate) outputs: Vec<Output>,
    /// What is left, where something is.
    pub(crate) left: Option<Left>,
    pub(crate) seconds: f64,
}

impl Done {
    pub(crate) fn end(&self) -> End {
        if self.left.is_none() { End::Clean } else { End::NotClean }
    }
}

/// Intersections that could not be removed.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("outfit `{outfit}` is not free of intersections; the worst is left between `{outer}` and `{inner}` below it")]
#[diagnostic(
    code(ifg::unresolved),
    help("triangle pairs left there (inner, outer): {}; --write-unproven writes what was reached", list(triangles))
)]
pub(crate) struct Left {
    outfit: String,
    outer: String,
    inner: String,
    triangles: Vec<[u32; 2]>,
}

/// Parameters that `resolve` refuses.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("outfit `{outfit}` cannot be resolved")]
#[diagnostic(code(ifg::parameter), help("look at [params] in the outfit file, --clearance and --set"))]
struct Refused {
    outfit: String,
    source: ResolveError,
}

fn list(triangles: &[[u32; 2]]) -> String {
    /// More pairs than these say nothing more to a person.
    const SHOWN: usize = 8;
    let pairs: Vec<String> = triangles.iter().take(SHOWN).map(|[a, b]| format!("({a}, {b})")).collect();
    if triangles.is_empty() { "none, only vertices on a wrong side".into() } else { pairs.join(" ") }
}

/// Faults that can be seen before anything is read: two outputs of one name, an output over an
/// input, something in the way.
fn check_outputs(spec: &OutfitSpec, out: &Path, options: Options) -> Result<(), OutputError> {
    for (k, layer) in spec.garments.iter().enumerate() {
        let same = |other: &&LayerSpec| other.file_name.eq_ignore_ascii_case(&layer.file_name);
        if let Some(first) = spec.garments[..k].iter().find(same) {
            return Err(OutputError::SameName {
                first: first.written.clone(),
                second: layer.written.clone(),
                name: layer.file_name.clone(),
            });
        }
    }
    for name in output_names(spec, options.pictures) {
        let path = out.join(&name);
        let Ok(target) = path.canonicalize() else { continue };
        if !target.is_file() {
            return Err(OutputError::InTheWay { path });
        }
        let is_target = |input: &&LayerSpec| input.path.canonicalize().is_ok_and(|p| p == target);
        let garment = spec.garments.iter().find(is_target).filter(|_| !options.in_place);
        if let Some(input) = Some(&spec.body).filter(is_target).or(garment) {
            return Err(OutputError::OverInput { path, written: input.written.clone() });
        }
    }
    Ok(())
}

/// The files that a finished outfit has, without its receipt.
fn output_names(spec: &OutfitSpec, pictures: bool) -> Vec<String> {
    let drawn = if pictures { &[pictures::BEFORE, pictures::AFTER][..] } else { &[] };
    spec.garments.iter().map(|l| l.file_name.clone()).chain(drawn.iter().map(ToString::to_string)).collect()
}

/// Reads, resolves, verifies and writes one outfit.
pub(crate) fn run(spec: &OutfitSpec, out: &Path, options: Options, line: &Line) -> Result<Outcome, Report> {
    let start = Instant::now();
    let mut timings = Timings::default();
    check_outputs(spec, out, options)?;
    line.say("reading");
    let request = Request::new(spec, load::contents(spec)?);
    if options.resume && request.is_finished(out, &output_names(spec, options.pictures)) {
        return Ok(Outcome::Finished);
    }
    let loaded = load::load(spec)?;
    let staging = Staging::open(out)?;
    timings.read = start.elapsed().as_secs_f64();

    let mut watch = |progress: &if_pipeline::resolve::Progress| {
        line.show(progress);
        if cancel::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let (mut resolved, mut left) = match resolve(&loaded.outfit, &spec.params, &mut watch) {
        Ok(resolved) => (resolved, None),
        Err(ResolveError::Cancelled { .. }) => return Ok(Outcome::Cancelled),
        Err(ResolveError::Remaining { outer, inner, triangles, result }) => {
            let left = Left { outfit: spec.name.clone(), outer, inner, triangles };
            (*result, Some(left))
        }
        Err(source) => return Err(Refused { outfit: spec.name.clone(), source }.into()),
    };
    timings.resolve = resolved.report.seconds;
    if spec.scale != 1.0 {
        prove_as_written(spec, &loaded, &mut resolved, &mut left)?;
    }
    if cancel::asked() {
        return Ok(Outcome::Cancelled);
    }
    if left.is_some() && !options.write_unproven {
        let seconds = start.elapsed().as_secs_f64();
        return Ok(Outcome::Resolved(Box::new(Done { report: resolved.report, outputs: vec![], left, seconds })));
    }

    line.say("writing");
    let writing = Instant::now();
    let mut outputs = write_garments(spec, &loaded, &resolved.outfit, &request, &staging, out)?;
    timings.write = writing.elapsed().as_secs_f64();
    if options.pictures {
        line.say("drawing");
        let drawing = Instant::now();
        for (name, outfit) in [(pictures::BEFORE, &loaded.outfit), (pictures::AFTER, &resolved.outfit)] {
            pictures::draw(outfit, &staging.path(name)).map_err(|source| OutputError::File { path: out.join(name), source })?;
            outputs.push(output(name, None, &staging, out)?);
        }
        timings.pictures = drawing.elapsed().as_secs_f64();
    }
    timings.total = start.elapsed().as_secs_f64();
    let state = if left.is_some() { "remaining" } else { "clean" };
    let text = receipt::text(&spec.name, state, &request, &resolved.report, &outputs, &timings).into_diagnostic()?;
    let path = out.join(receipt::FILE);
    std::fs::write(staging.path(receipt::FILE), text).map_err(|source| OutputError::File { path, source })?;
    if cancel::asked() {
        return Ok(Outcome::Cancelled);
    }
    // The receipt comes last: where it is, all is.
    let names: Vec<&str> = outputs.iter().map(|o| o.file.as_str()).chain([receipt::FILE]).collect();
    staging.commit(&names)?;
    let seconds = start.elapsed().as_secs_f64();
    Ok(Outcome::Resolved(Box::new(Done { report: resolved.report, outputs, left, seconds })))
}

/// Where the files are not in metres, what will be written is not quite what was resolved: it is
/// verified once more as a reader of the files will see it.
fn prove_as_written(
    spec: &OutfitSpec,
    loaded: &Loaded,
    resolved: &mut Resolved,
    left: &mut Option<Left>,
) -> Result<(), Report> {
    resolved.outfit = loaded.as_written(&resolved.outfit).into_diagnostic()?;
    resolved.report.after = verify(&resolved.outfit).into_diagnostic()?;
    let bad = |p: &&PairReport| p.pairs.total() + p.vertices_inside > 0;
    let worst = resolved.report.after.pairs.iter().filter(bad).max_by_key(|p| p.pairs.total());
    if let Some(worst) = worst.filter(|_| left.is_none()) {
        let (outer, inner) = (worst.outer.clone(), worst.inner.clone());
        *left = Some(Left { outfit: spec.name.clone(), outer, inner, triangles: vec![] });
    }
    Ok(())
}

/// Writes all garments into the staging folder: copies of those that did not move.
fn write_garments(
    spec: &OutfitSpec,
    loaded: &Loaded,
    outfit: &Outfit,
    request: &Request,
    staging: &Staging,
    out: &Path,
) -> Result<Vec<Output>, Report> {
    let mut outputs = Vec::with_capacity(spec.garments.len() + 2);
    for (k, layer) in spec.garments.iter().enumerate() {
        let (name, path) = (&layer.file_name, staging.path(&layer.file_name));
        let fault = |source| OutputError::File { path: out.join(name), source };
        let unchanged = loaded.is_unchanged(k, outfit);
        if unchanged {
            let bytes = std::fs::read(&layer.path).map_err(|source| changed(layer, source))?;
            std::fs::write(&path, bytes).map_err(fault)?;
        } else {
            loaded.write(k, outfit, &path).map_err(|source| OutputError::Mesh { path: out.join(name), source })?;
        }
        let written = output(name, Some(unchanged), staging, out)?;
        // The inputs' first entry is the body.
        if unchanged && written.content != request.inputs[k + 1].content {
            return Err(changed(layer, io::Error::other("it is not what was read at the start")).into());
        }
        outputs.push(written);
    }
    Ok(outputs)
}

fn changed(layer: &LayerSpec, source: io::Error) -> OutputError {
    OutputError::InputChanged { path: layer.path.clone(), source }
}

fn output(name: &str, unchanged: Option<bool>, staging: &Staging, out: &Path) -> Result<Output, OutputError> {
    let content = hash::content(&staging.path(name)).map_err(|source| OutputError::File { path: out.join(name), source })?;
    Ok(Output { file: name.to_owned(), content, unchanged })
}
