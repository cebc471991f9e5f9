//! One outfit from its files to its output folder.

use crate::cancel;
use crate::companions::Companions;
use crate::end::End;
use crate::left::Left;
use crate::load::{self, Loaded};
use crate::outfit_file::OutfitSpec;
use crate::outputs;
use crate::pictures;
use crate::progress::Line;
use crate::receipt::{self, Output, Request, Timings};
use crate::staging::{OutputError, Staging};
use if_core::monitor::Progress;
use if_outfit::outfit::Outfit;
use if_outfit::report::ResolveReport;
use if_outfit::resolve::{ResolveError, Resolved, resolve};
use if_outfit::verify::verify;
use miette::{Diagnostic, IntoDiagnostic, Report};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// How to write.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Options {
    /// Outputs may replace inputs.
    pub(crate) in_place: bool,
    /// Write even where intersections are left.
    pub(crate) write_unproven: bool,
    /// Leave an outfit alone whose receipt says that it is done.
    pub(crate) resume: bool,
    /// Draw it before and after.
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
    /// What a person should know about the inputs.
    pub(crate) notes: Vec<String>,
    pub(crate) report: ResolveReport,
    /// What was written; nothing where intersections are left, unless asked for.
    pub(crate) outputs: Vec<Output>,
    /// What is left, where something is.
    pub(crate) left: Option<Left>,
    /// Wall time, reading and writing included.
    pub(crate) seconds: f64,
}

impl Done {
    /// A word for receipts and JSON.
    pub(crate) fn state(&self) -> &'static str {
        if self.left.is_none() { receipt::CLEAN } else { "remaining" }
    }

    pub(crate) fn end(&self) -> End {
        if self.left.is_none() { End::Clean } else { End::NotClean }
    }
}

/// Parameters that `resolve` refuses.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("outfit `{outfit}` cannot be resolved")]
#[diagnostic(
    code(ifg::parameter),
    help("look at [params] in the outfit file, --clearance and --set")
)]
struct Refused {
    outfit: String,
    source: ResolveError,
}

/// Reads, resolves, verifies and writes one outfit.
pub(crate) fn run(
    spec: &OutfitSpec,
    out: &Path,
    options: Options,
    line: &Line,
) -> Result<Outcome, Report> {
    let start = Instant::now();
    let names = outputs::names(spec, options.pictures);
    outputs::check(spec, out, &names, options.in_place)?;
    line.say("reading");
    let mut loaded = load::load(spec)?;
    let companions = Companions::find(spec, &loaded.files, &names)?;
    let request = Request::new(spec, &loaded.files, &companions);
    if options.resume && request.is_finished(out, &names) {
        return Ok(Outcome::Finished);
    }
    let staging = Staging::open(out)?;
    let mut timings = Timings { read: start.elapsed().as_secs_f64(), ..Default::default() };

    let Some((resolved, left)) = resolve_and_prove(spec, &mut loaded, line)? else {
        return Ok(Outcome::Cancelled);
    };
    timings.resolve = start.elapsed().as_secs_f64() - timings.read;
    let (notes, report) = (loaded.notes(), resolved.report);
    let mut done = Done { notes, report, outputs: vec![], left, seconds: 0.0 };
    if done.left.is_none() || options.write_unproven {
        line.say("writing");
        done.outputs =
            outputs::write_garments(spec, &loaded, &resolved.positions, &request, (&staging, out))?;
        done.outputs.extend(companions.write((&staging, out))?);
        done.notes.extend(companions.missing);
        timings.write = start.elapsed().as_secs_f64() - timings.read - timings.resolve;
        if options.pictures {
            line.say("drawing");
            draw(&loaded.outfit, &resolved.outfit, (&staging, out), &mut done.outputs)?;
        }
        timings.total = start.elapsed().as_secs_f64();
        timings.pictures = timings.total - timings.read - timings.resolve - timings.write;
        let text = receipt::text(&spec.name, &request, &done, &timings).into_diagnostic()?;
        let path = out.join(receipt::FILE);
        std::fs::write(staging.path(receipt::FILE), text)
            .map_err(|source| OutputError::File { path, source })?;
        if cancel::asked() {
            return Ok(Outcome::Cancelled);
        }
        // The receipt comes last: where it is, all is.
        let names: Vec<&str> =
            done.outputs.iter().map(|o| o.file.as_str()).chain([receipt::FILE]).collect();
        staging.commit(&names)?;
    }
    done.seconds = start.elapsed().as_secs_f64();
    Ok(Outcome::Resolved(Box::new(done)))
}

/// A resolved outfit as it will be written.
struct AsWritten {
    /// In metres.
    outfit: Outfit,
    /// Of each garment, in the units of its file.
    positions: Vec<Vec<if_core::math::Point>>,
    report: ResolveReport,
}

/// Resolves an outfit, and makes sure that what will be written is proven; nothing if cancelled.
/// Garments whose triangles were split are split in `loaded` too.
fn resolve_and_prove(
    spec: &OutfitSpec,
    loaded: &mut Loaded,
    line: &Line,
) -> Result<Option<(AsWritten, Option<Left>)>, Report> {
    let mut watch = |progress: &Progress| {
        line.show(progress);
        if cancel::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let (Resolved { mut outfit, mut report, splits }, triangles) =
        match resolve(&loaded.outfit, &spec.params, &mut watch) {
            Ok(resolved) => (resolved, vec![]),
            Err(ResolveError::Remaining { triangles, result, .. }) => (*result, triangles),
            Err(ResolveError::Cancelled(_)) => return Ok(None),
            Err(source) => return Err(Refused { outfit: spec.name.clone(), source }.into()),
        };
    for (k, split) in splits.iter().enumerate() {
        if let Some(split) = split {
            loaded.split(spec, k, split)?;
        }
    }
    let positions = loaded.positions(&outfit);
    if spec.scale != 1.0 || splits.iter().any(Option::is_some) {
        // The files are not in metres, or hold vertices that splitting made, in one step where the
        // solver may have made them in several: what a reader of them gets may differ by roundings
        // from what was resolved. That is proven once more.
        outfit = loaded.outfit_of(&positions).into_diagnostic()?;
        report.after = verify(&outfit).into_diagnostic()?;
        for (layer, own) in report.layers.iter_mut().zip(&report.after.own_pairs) {
            layer.own_pairs[1] = *own;
        }
    }
    let left = Left::found(&spec.name, &report, triangles);
    Ok((!cancel::asked()).then_some((AsWritten { outfit, positions, report }, left)))
}

fn draw(
    before: &Outfit,
    after: &Outfit,
    (staging, out): (&Staging, &Path),
    outputs: &mut Vec<Output>,
) -> Result<(), OutputError> {
    for (name, outfit) in [(pictures::BEFORE, before), (pictures::AFTER, after)] {
        pictures::draw(outfit, &staging.path(name))
            .map_err(|source| OutputError::File { path: out.join(name), source })?;
        outputs.push(outputs::describe(name, staging, out)?);
    }
    Ok(())
}
