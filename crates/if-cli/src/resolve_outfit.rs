//! One outfit from its files to its output folder.

use crate::buffers::Buffers;
use crate::cancel;
use crate::companions::Companions;
use crate::load::{self, LoadError};
use crate::outcome::{Done, Outcome, UnresolvedOutfit};
use crate::outfit_file::OutfitSpec;
use crate::output_error::OutputError;
use crate::outputs;
use crate::peak_memory::peak_memory;
use crate::phases::Recorder;
use crate::pictures;
use crate::progress::Line;
use crate::receipt::{self, Receipt, Request, Timings};
use crate::report_page;
use crate::shared_body::SharedBody;
use crate::staging::Staging;
use if_outfit::files::FilesError;
use if_outfit::outfit::Outfit;
use if_outfit::report::ResolveReport;
use if_outfit::resolve::ResolveError;
use if_render::Intersections;
use miette::{IntoDiagnostic, Report};
use std::path::Path;
use std::time::Instant;
use tracing::trace_span;

/// How to write.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Options {
    /// Outputs may replace inputs.
    pub(crate) in_place: bool,
    /// Write even where intersections are left.
    pub(crate) write_unproven: bool,
    /// Skip an outfit whose receipt shows that it is done.
    pub(crate) resume: bool,
    /// Draw it before and after.
    pub(crate) pictures: bool,
    /// Record where the time goes.
    pub(crate) phases: bool,
}

/// Reads, resolves, verifies and writes one outfit.
pub(crate) fn run(
    spec: &OutfitSpec,
    out: &Path,
    options: Options,
    (bodies, mut line): (&mut SharedBody, &Line),
) -> Result<Outcome, Report> {
    let start = Instant::now();
    let recorder = options.phases.then(Recorder::listen);
    let names = outputs::names(spec, options.pictures);
    outputs::check(spec, out, &outputs::possible(spec, &names), options.in_place)?;
    line.message("reading");
    let reading = trace_span!("reading").entered();
    let files = load::load(spec)?;
    let buffers = Buffers::find(spec, files.files(), &names, (out, options.in_place))?;
    let taken: Vec<String> = names.iter().chain(buffers.names()).cloned().collect();
    let companions = Companions::find(spec, files.files(), (out, &taken))?;
    let named = buffers.inputs.iter().cloned().chain(companions.inputs());
    let request = Request::new(spec, files.files(), named);
    if let Some(state) = options.resume.then(|| request.finished(out, &names)).flatten() {
        return Ok(Outcome::Finished(state));
    }
    drop(reading);
    let staging = Staging::open(out)?;
    let mut timings = Timings { read: start.elapsed().as_secs_f64(), ..Default::default() };

    let resolving = trace_span!("resolving").entered();
    let files = bodies.with_body(spec, files);
    let (resolved, unresolved) = match files.resolve(&spec.params, &mut line) {
        Ok(resolved) => (resolved, None),
        Err(FilesError::Unresolved { unresolved, result }) => {
            (*result, Some(UnresolvedOutfit::new(&spec.name, unresolved, options.write_unproven)))
        }
        Err(FilesError::Resolve(ResolveError::Cancelled { .. })) => return Ok(Outcome::Cancelled),
        Err(error) => return Err(LoadError::new(spec, error).into()),
    };
    drop(resolving);
    if cancel::is_requested() {
        return Ok(Outcome::Cancelled);
    }
    timings.resolve = start.elapsed().as_secs_f64() - timings.read;

    let report = resolved.report.clone();
    let mut notes = report.notes(&files.outfit().body.name);
    notes.extend(files.notes());
    notes.extend(pinch_note(&report));
    let outputs = vec![];
    let mut done =
        Done { notes, report, outputs, unresolved, seconds: 0.0, phases: None, peak_memory: None };
    if done.unresolved.is_none() || options.write_unproven {
        line.message("writing");
        let writing = trace_span!("writing").entered();
        done.outputs = outputs::write_garments(spec, &files, &resolved, (&staging, out))?;
        done.outputs.extend(buffers.describe((&staging, out))?);
        let body_is_written = done.report.drawn_back.is_some();
        done.outputs.extend(companions.write(body_is_written, (&staging, out))?);
        done.notes.extend(companions.notes(body_is_written));
        drop(writing);
        timings.write = start.elapsed().as_secs_f64() - timings.read - timings.resolve;
        if options.pictures {
            line.message("drawing");
            let _phase = trace_span!("drawing").entered();
            let outfits = [files.outfit(), &resolved.outfit];
            draw(spec, outfits, (&staging, out), &mut done)?;
        }
        done.phases = recorder.as_ref().map(Recorder::phases);
        done.peak_memory = peak_memory();
        timings.total = start.elapsed().as_secs_f64();
        timings.pictures = timings.total - timings.read - timings.resolve - timings.write;
        write_receipt(spec, &request, &done, &timings, (&staging, out))?;
        if cancel::is_requested() {
            return Ok(Outcome::Cancelled);
        }
        // The receipt comes last: where it is, all is.
        let names: Vec<&str> =
            done.outputs.iter().map(|o| o.file.as_str()).chain([receipt::FILE]).collect();
        staging.commit(&names)?;
    }
    done.phases = recorder.as_ref().map(Recorder::phases);
    done.peak_memory = peak_memory();
    done.seconds = start.elapsed().as_secs_f64();
    Ok(Outcome::Resolved(Box::new(done)))
}

/// What lies in pinches or may come from them, or how far the body was drawn back for it.
fn pinch_note(report: &ResolveReport) -> Option<String> {
    if let Some(drawn) = &report.drawn_back {
        let reach = drawn.extent.reach.map_or(String::new(), |reach| {
            format!(", at most {:.0} mm from where it meets itself or leaves no room", 1e3 * reach)
        });
        return Some(format!(
            "the body was drawn back by at most {:.1} mm, {:.1} % of its area by more than 1 mm{reach}; its own pairs near \
             garments {} -> {}",
            1e3 * drawn.moved.max,
            1e2 * drawn.extent.area,
            drawn.own_pairs_before,
            drawn.own_pairs_after
        ));
    }
    let Some(pinch) = &report.pinch else {
        let (own, body) = (report.new_own_pairs(), report.after.body_own_pairs);
        return (own > 0 && body > 0).then(|| {
            format!(
                "garments intersect themselves in {own} new pairs of triangles, over a body that does so in {body}; \
                 --pinch yield draws it back there"
            )
        });
    };
    let named = pinch.garments.iter().map(|g| format!("`{}` {} faces", g.name, g.faces.len()));
    Some(format!(
        "{} of the pairs left lie where the body meets itself or leaves no room ({}); --pinch yield draws it back there",
        pinch.pairs,
        named.collect::<Vec<_>>().join(", ")
    ))
}

fn write_receipt(
    spec: &OutfitSpec,
    request: &Request,
    done: &Done,
    timings: &Timings,
    (staging, out): (&Staging, &Path),
) -> Result<(), Report> {
    let receipt = Receipt {
        outfit: &spec.name,
        state: done.state(),
        request,
        outputs: &done.outputs,
        notes: &done.notes,
        report: &done.report,
        timings,
        phases: done.phases.as_ref(),
        peak_memory: done.peak_memory,
    };
    let path = out.join(receipt::FILE);
    std::fs::write(staging.path(receipt::FILE), receipt.text().into_diagnostic()?)
        .map_err(|source| OutputError::File { path, source })?;
    Ok(())
}

/// Draws the outfit before and after, and writes its page.
fn draw(
    spec: &OutfitSpec,
    outfits: [&Outfit; 2],
    (staging, out): (&Staging, &Path),
    done: &mut Done,
) -> Result<(), OutputError> {
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(staging.path(name), bytes)
            .map_err(|source| OutputError::File { path: out.join(name), source })?;
        staging.describe(name, out)
    };
    let names = [pictures::BEFORE, pictures::AFTER];
    let found = outfits.map(|outfit| {
        Intersections::between(&outfit.layers().map(|layer| &layer.mesh).collect::<Vec<_>>())
    });
    let [before, after] = &found;
    let ((before_png, after_png), page) = rayon::join(
        || rayon::join(|| pictures::draw(before), || pictures::draw(after)),
        || report_page::page(spec, (outfits, [before, after]), done),
    );
    let mut pngs = Vec::new();
    for (name, png) in names.into_iter().zip([before_png, after_png]) {
        let png = png.map_err(|source| OutputError::File { path: out.join(name), source })?;
        done.outputs.push(write(name, &png)?);
        pngs.push(png);
    }
    let page = report_page::html(page, &pngs);
    done.outputs.push(write(outputs::PAGE, page.as_bytes())?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_outfit::report::{LayerReport, OwnPairs, PinchReport, Verification};

    #[test]
    fn new_own_pairs_over_a_body_that_meets_itself_name_what_mends_them() {
        let report = |new, body_own_pairs| {
            let mut layer = LayerReport::default();
            layer.own_pairs = OwnPairs::new(0, new, new);
            let mut after = Verification::default();
            after.body_own_pairs = body_own_pairs;
            let mut report = ResolveReport::default();
            (report.layers, report.after) = (vec![layer], after);
            report
        };
        let note = pinch_note(&report(3, 40)).unwrap();
        for part in ["in 3 new pairs", "in 40;", "--pinch yield"] {
            assert!(note.contains(part), "{note}");
        }
        assert_eq!(pinch_note(&report(0, 40)), None, "nothing is new");
        assert_eq!(pinch_note(&report(3, 0)), None, "the body is not the cause");
        let mut pinched = report(3, 40);
        pinched.pinch = Some(PinchReport::default());
        assert!(pinch_note(&pinched).unwrap().starts_with("0 of the pairs left"));
    }
}
