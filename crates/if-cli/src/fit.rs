//! `ifg fit`: a neural signed distance field from a mesh.

use crate::args::{FitArgs, NetworkName};
use crate::cancel;
use crate::end::End;
use crate::errors::{self, Told};
use crate::load::reading_advice;
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::staging::OutputError;
use crate::table;
use crate::target::{Input, Target};
use comfy_table::Cell;
use if_core::mesh::{MeshError, TriMesh};
use if_mesh::file::MeshFile;
use if_neural::files::{WeightNorm, read_checkpoint, write_checkpoint, write_network};
use if_neural::fit::{Ended, Fit, FitError, FitParams, FitProgress, FitReport};
use if_neural::network::{Network, NetworkConfig};
use if_neural::sampling::{SamplingParams, TrainingSet};
use if_pipeline::fitting::{MeshTarget, MeshTargetError, Take};
use miette::{Diagnostic, Report};
use serde_json::json;
use std::fs::File;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Seconds where nothing else says when to stop, and where only an accuracy does.
const SECONDS: [f64; 2] = [60.0, 600.0];
/// Least time that is left for steps when reading and sampling took long.
const LEAST: f64 = 0.5;
/// Seconds from one checkpoint to the next.
const STORE_EVERY: f64 = 60.0;

#[derive(Debug, thiserror::Error, Diagnostic)]
enum FitFault {
    #[error("cannot read the mesh")]
    #[diagnostic(code(ifg::input::mesh), help("{}", advice))]
    Mesh { advice: &'static str, source: Told },
    #[error("`{}` cannot be scaled by {scale}", path.display())]
    #[diagnostic(code(ifg::input::scale), help("look at --scale"))]
    Scale { path: PathBuf, scale: f64, source: MeshError },
    #[error("`{}` cannot be fitted", path.display())]
    #[diagnostic(code(ifg::fit::target), help("{}", target_advice(source)))]
    Target { path: PathBuf, source: MeshTargetError },
    #[error("cannot go on with `{}`", path.display())]
    #[diagnostic(code(ifg::fit::resume), help("give --resume a file that --checkpoint wrote"))]
    Resume { path: PathBuf, source: Told },
    #[error("`{}` is a fit of something else than `{}`", path.display(), mesh.display())]
    #[diagnostic(code(ifg::fit::resume), help("give the mesh, --points and --scale that the fit began with"))]
    OtherMesh { path: PathBuf, mesh: PathBuf },
    #[error("`{}` is in the way: it is not a checkpoint", path.display())]
    #[diagnostic(code(ifg::fit::checkpoint), help("give --checkpoint another name, or move it away"))]
    NoCheckpoint { path: PathBuf, source: Told },
    #[error("--checkpoint and --out are both `{}`", path.display())]
    #[diagnostic(code(ifg::fit::checkpoint), help("give --checkpoint another name"))]
    SamePlace { path: PathBuf },
    #[error("cannot fit `{}`", path.display())]
    #[diagnostic(code(ifg::fit::run), help("the mesh may be in other units than metres: look at --scale"))]
    Fit { path: PathBuf, source: Told },
}

fn target_advice(error: &MeshTargetError) -> &'static str {
    match error {
        MeshTargetError::Sides(_) => "turn the triangles round in a mesh editor; --points would need their normals too",
        MeshTargetError::Field(_) => "give a mesh with triangles",
        _ => "give a mesh whose triangles are counter-clockwise seen from outside",
    }
}

/// Runs the command.
pub(crate) fn run(args: &FitArgs) -> Result<End, Report> {
    let start = Instant::now();
    let (target, checkpoint) = targets(args)?;
    let line = Line::new("", 0, 1);
    line.say("reading");
    let mesh = mesh(args)?;
    let path = || args.mesh.clone();
    let take = if args.points { Take::Points } else { Take::Either };
    let taken = MeshTarget::new(&mesh, take).map_err(|source| FitFault::Target { path: path(), source })?;
    line.say("sampling");
    let Begun { set, mut network, mut fit } = match &args.resume {
        Some(file) => resumed(args, file, &taken)?,
        None => begun(args, &taken, start)?,
    };
    let mut report = run_storing(&mut fit, &mut network, &set, &line, checkpoint.as_ref(), STORE_EVERY).map_err(|e| match e {
        Stopped::Fit(e) => Report::from(FitFault::Fit { path: path(), source: Told::new(&e) }),
        Stopped::Output(e) => e.into(),
    })?;
    if report.ended == Ended::Cancelled {
        fit.keep_best(&mut network);
        report.error = set.held_out.error(&set.frame, |p, o| if_neural::field::Samples32::samples32(&network, p, o));
    }
    line.say("writing");
    target.put(|file| write_network(file, &network, &set.frame, WeightNorm::Kept))?;
    drop(line);
    if let (Ended::Cancelled, Some(file)) = (report.ended, &args.checkpoint) {
        errors::note(&format!("cancelled; --resume {} goes on with it", file.display()));
    }
    say(args, &taken, fit.params(), &report, start.elapsed().as_secs_f64())
}

/// The network to write, and where to store the fit.
fn targets(args: &FitArgs) -> Result<(Target, Option<Target>), Report> {
    let read = |path, in_place| Input { path, in_place };
    let resume = |in_place| args.resume.as_deref().map(|path| read(path, in_place));
    let inputs = |in_place| [read(&args.mesh, None)].into_iter().chain(resume(in_place)).collect::<Vec<_>>();
    let target = Target::open(&args.out, "safetensors", &[], &inputs(None))?;
    let Some(path) = &args.checkpoint else { return Ok((target, None)) };
    let whole = |path: &Path| {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        folder.canonicalize().ok().zip(path.file_name().map(ToOwned::to_owned))
    };
    if whole(path).is_some_and(|p| whole(&args.out) == Some(p)) {
        return Err(FitFault::SamePlace { path: path.clone() }.into());
    }
    let checkpoint = Target::open(path, "safetensors", &[], &inputs(Some(true)))?;
    // A network is not lost for a slip of the pen.
    if let Ok(file) = File::open(path)
        && let Err(e) = read_checkpoint(file)
    {
        return Err(FitFault::NoCheckpoint { path: path.clone(), source: Told::new(&e) }.into());
    }
    Ok((target, Some(checkpoint)))
}

/// What a fit works with.
struct Begun {
    set: TrainingSet,
    network: Network,
    fit: Fit,
}

/// A fit at its beginning.
fn begun(args: &FitArgs, taken: &MeshTarget, start: Instant) -> Result<Begun, FitFault> {
    let told = |e: &dyn std::error::Error| FitFault::Fit { path: args.mesh.clone(), source: Told::new(e) };
    let config = match args.network {
        NetworkName::Grid => NetworkConfig::grid(),
        NetworkName::Fast => NetworkConfig::fast(),
        NetworkName::Paper => NetworkConfig::paper(),
    };
    let (set, network) = taken.target().begin(&config, &sampling(args.seed)).map_err(|e| told(&e))?;
    let seconds = match (args.seconds, args.steps, args.accuracy) {
        (Some(seconds), _, _) => Some(seconds),
        (None, None, None) => Some(SECONDS[0]),
        (None, None, Some(_)) => Some(SECONDS[1]),
        (None, Some(_), _) => None,
    };
    let prepared = start.elapsed().as_secs_f64();
    let params = FitParams {
        steps: args.steps,
        seconds: seconds.map(|s| (s - prepared).max(LEAST)),
        accuracy: args.accuracy,
        loss: taken.target().loss(),
        seed: args.seed,
        ..config.fit_params()
    };
    Ok(Begun { set, network, fit: Fit::new(params).map_err(|e| told(&e))? })
}

/// A fit where it was stored.
fn resumed(args: &FitArgs, path: &Path, taken: &MeshTarget) -> Result<Begun, FitFault> {
    let read = |e: &dyn std::error::Error| FitFault::Resume { path: path.into(), source: Told::new(e) };
    let file = File::open(path).map_err(|e| read(&e))?;
    let (fit, network, frame) = read_checkpoint(file).map_err(|e| read(&e))?;
    let set = taken.target().training_set(&sampling(fit.params().seed));
    let set = set.map_err(|e| FitFault::Fit { path: args.mesh.clone(), source: Told::new(&e) })?;
    if frame != set.frame || fit.params().loss != taken.target().loss() {
        return Err(FitFault::OtherMesh { path: path.into(), mesh: args.mesh.clone() });
    }
    Ok(Begun { set, network, fit })
}

fn sampling(seed: u64) -> SamplingParams {
    SamplingParams { seed, ..SamplingParams::default() }
}

/// Why a fit that is stored on its way ended.
#[derive(Debug)]
enum Stopped {
    Fit(FitError),
    Output(OutputError),
}

/// Runs a fit to its end, or until the user cancels. Where there is a place to store it, it is stored there after each `every` seconds, and when
/// it is cancelled.
fn run_storing(
    fit: &mut Fit,
    network: &mut Network,
    set: &TrainingSet,
    line: &Line,
    checkpoint: Option<&Target>,
    every: f64,
) -> Result<FitReport, Stopped> {
    let check_every = fit.params().check_every;
    loop {
        let start = Instant::now();
        let mut watch = |p: &FitProgress| {
            if p.step.is_multiple_of(5) {
                let (done, error) = (100.0 * p.done, p.error.mean * 1e3);
                line.say(&format!("step {}, {done:.0} %, error {error:.3} mm", p.step));
            }
            // Right after a check a fit goes on as if nothing had been.
            let is_due = checkpoint.is_some() && p.step.is_multiple_of(check_every) && start.elapsed().as_secs_f64() >= every;
            if is_due || cancel::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let report = fit.run(network, set, &mut watch).map_err(Stopped::Fit)?;
        let Some(place) = checkpoint.filter(|_| report.ended == Ended::Cancelled) else { return Ok(report) };
        line.say("storing");
        place.put(|file| write_checkpoint(file, fit, network, &set.frame)).map_err(Stopped::Output)?;
        if cancel::asked() {
            return Ok(report);
        }
    }
}

fn mesh(args: &FitArgs) -> Result<TriMesh, FitFault> {
    let file = MeshFile::read(&args.mesh).map_err(|e| FitFault::Mesh { advice: reading_advice(&e), source: Told::new(&e) })?;
    let Some(scale) = args.scale else { return Ok(file.mesh().clone()) };
    let scaled = file.mesh().with_vertices(file.mesh().vertices().iter().map(|p| p * scale).collect());
    scaled.map_err(|source| FitFault::Scale { path: args.mesh.clone(), scale, source })
}

fn say(args: &FitArgs, taken: &MeshTarget, params: &FitParams, report: &FitReport, seconds: f64) -> Result<End, Report> {
    let missed = params.accuracy.is_some_and(|a| report.error.mean > a);
    let out = args.out.display().to_string();
    if args.json {
        print_json(&json!({"out": out, "state": report.ended, "report": report, "seconds": seconds}))?;
    } else {
        let (what, judge) = match taken {
            MeshTarget::Field(_) => ("its field", "points beside the surface and on it that no step saw"),
            MeshTarget::Points(_) => ("its vertices as points", "vertices that no step saw, with their noise"),
        };
        let mut text = format!("{}: fitted to {what}\n\n", args.mesh.display());
        text += &errors_of(report);
        text += &format!("\nErrors are at {} {judge}.\n", report.error.points);
        let (ended, steps) = (ended(report.ended), report.steps);
        text += &format!("{steps} steps, {ended}, {seconds:.1} s\nWrote {out}\n");
        print(&text)?;
    }
    Ok(match report.ended {
        Ended::Cancelled => End::Cancelled,
        _ if missed => {
            errors::note("the accuracy was not reached; the network was written all the same");
            End::NotClean
        }
        _ => End::Clean,
    })
}

fn ended(ended: Ended) -> String {
    match ended {
        Ended::Cancelled => "cancelled, the best state so far was kept".to_owned(),
        other => other.to_string(),
    }
}

fn errors_of(report: &FitReport) -> String {
    let header = ["mean mm", "p99 mm", "max mm", "on the surface mm", "| |grad| - 1 |", "normals deg"];
    let mut table = table::new_table(&header, 0, false);
    let e = &report.error;
    let mm = |metres: f64| Cell::new(format!("{:.3}", metres * 1e3));
    let row = [mm(e.mean), mm(e.p99), mm(e.max), mm(e.surface)];
    let rest = [Cell::new(format!("{:.4}", e.eikonal)), Cell::new(format!("{:.2}", e.normal_degrees))];
    table.add_row(row.into_iter().chain(rest));
    format!("{}\n", table.trim_fmt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;
    use if_core::shapes::Sphere;
    use if_neural::accuracy::FieldError;
    use if_neural::grid::GridConfig;
    use if_neural::target::Target as Field;
    use if_neural::trainable::TrainableField;

    #[test]
    fn the_table_fits_100_columns_and_is_plain() {
        let error =
            FieldError { mean: 2e-4, p99: 1.9e-3, max: 0.0123, surface: 1e-4, eikonal: 0.04, normal_degrees: 3.9, points: 9 };
        let report = FitReport { ended: Ended::Time, steps: 9, kept: 9, samples: 99, seconds: 1.0, error };
        let text = errors_of(&report);
        assert!(text.contains("0.200") && text.contains("12.300"), "{text}");
        assert!(text.lines().all(|l| l.is_ascii() && l.len() <= 100), "{text}");
    }

    #[test]
    fn a_fit_that_is_stored_on_its_way_ends_with_the_same_bits_and_so_does_one_that_goes_on_from_there() {
        let ball = Sphere { center: Point::new(0.0, 1.0, 0.0), radius: 0.3 };
        let few = SamplingParams { near: 1000, far: 100, held_out: 200, ..SamplingParams::default() };
        let config = NetworkConfig::Grid(GridConfig { coarsest: 8, finest: 16, levels: 2, ..GridConfig::default() });
        let (set, first) = Field::Field(&ball).begin(&config, &few).unwrap();
        let begin = || {
            let params = FitParams { batch: 64, steps: Some(10), seconds: None, check_every: 4, ..config.fit_params() };
            (Fit::new(params).unwrap(), first.clone())
        };
        let (mut fit, mut whole) = begin();
        fit.run(&mut whole, &set, &mut |_| ControlFlow::Continue(())).unwrap();
        let (mut fit, mut stored) = begin();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fit.safetensors");
        let place = Target::open(&path, "safetensors", &[], &[]).unwrap();
        let line = Line::new("", 0, 1);
        let report = run_storing(&mut fit, &mut stored, &set, &line, Some(&place), 0.0).unwrap();
        assert_eq!((report.ended, report.steps), (Ended::Steps, 10));
        assert!(stored.parameters() == whole.parameters());
        let (mut fit, mut later, frame) = read_checkpoint(File::open(&path).unwrap()).unwrap();
        assert_eq!((fit.steps(), frame), (8, set.frame));
        run_storing(&mut fit, &mut later, &set, &line, None, 0.0).unwrap();
        assert!(later.parameters() == whole.parameters());
    }
}
