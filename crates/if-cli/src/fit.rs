//! `ifg fit`: a neural signed distance field from a mesh.

use crate::cancel;
use crate::end::End;
use crate::errors::{self, ErrorChain};
use crate::load::reading_advice;
use crate::not_kept;
use crate::print::{note_lines, print, print_json};
use crate::progress::Line;
use crate::table;
use crate::target::{Input, Target};
use crate::values::{above_zero, positive};
use clap::{Args, ValueEnum};
use comfy_table::Cell;
use if_core::mesh::{MeshError, TriMesh};
use if_core::monitor::Progress;
use if_mesh::file::MeshFile;
use if_mesh::regular_file;
use if_mesh::validate::{Fault, faults};
use if_neural::FitError;
use if_neural::files::{WeightNorm, read_checkpoint, write_checkpoint, write_network};
use if_neural::fit::{Ended, Fit, FitParams, FitReport};
use if_neural::network::{Network, NetworkConfig};
use if_neural::sampling::{SamplingParams, TrainingSet};
use if_pipeline::fitting::{MeshTarget, MeshTargetError, Take};
use miette::{Diagnostic, Report};
use serde_json::json;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args, Debug, Clone)]
pub(crate) struct FitArgs {
    /// The mesh (.ply, .obj, .glb, .vrm, .gltf), in metres, wound outwards. Of an open mesh, such as a scan, the
    /// vertices are fitted as points with normals: noise is averaged and holes are closed.
    #[arg(value_name = "MESH")]
    pub(crate) mesh: PathBuf,
    /// Where to write the network (.safetensors).
    #[arg(short, long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Time for the whole fit; 60 where neither steps nor an accuracy are given, 600 with an
    /// accuracy.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) seconds: Option<f64>,
    /// Stop as soon as the mean error near the surface is at most this: 0.5mm, 0.0005m; metres
    /// without unit.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero, allow_hyphen_values = true)]
    pub(crate) accuracy: Option<f64>,
    /// Stop after so many steps; the same steps give the same bits, on any number of threads.
    #[arg(long, value_name = "N", conflicts_with = "seconds")]
    pub(crate) steps: Option<u64>,
    /// Which network.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) network: NetworkName,
    /// Fit the vertices as points even where the mesh is closed.
    #[arg(long)]
    pub(crate) points: bool,
    /// Factor from the units of the file to metres; the network is in metres.
    #[arg(long, value_name = "FACTOR", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) scale: Option<f64>,
    /// Seed of sampling and first values.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Store the fit here (.safetensors) once a minute and on Ctrl-C, so that --resume can go on
    /// with it.
    #[arg(long, value_name = "FILE")]
    pub(crate) checkpoint: Option<PathBuf>,
    /// Go on with the fit that --checkpoint stored: the same mesh, --points and --scale must be
    /// given; network, seed and limits are those of the fit.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["seconds", "accuracy", "steps", "network", "seed"])]
    pub(crate) resume: Option<PathBuf>,
    /// Print the report as JSON on stdout, and no table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Networks of `fit`.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum NetworkName {
    /// Features on grids with a small network: the most accurate in a given time.
    #[default]
    Grid,
    /// The network of Appendix E, 256 wide.
    Fast,
    /// The network of Appendix E, 512 wide.
    Paper,
}

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
    Mesh { advice: &'static str, source: ErrorChain },
    #[error("`{}` cannot be scaled by {scale}", path.display())]
    #[diagnostic(code(ifg::input::scale), help("look at --scale"))]
    Scale { path: PathBuf, scale: f64, source: MeshError },
    #[error("`{}` cannot be fitted", path.display())]
    #[diagnostic(code(ifg::fit::target), help("{}", target_advice(source)))]
    Target { path: PathBuf, source: MeshTargetError },
    #[error("cannot go on with `{}`", path.display())]
    #[diagnostic(code(ifg::fit::resume), help("give --resume a file that --checkpoint wrote"))]
    Resume { path: PathBuf, source: ErrorChain },
    #[error("`{}` is a fit of something else than `{}`", path.display(), mesh.display())]
    #[diagnostic(
        code(ifg::fit::resume),
        help("give the mesh, --points and --scale that the fit began with")
    )]
    OtherMesh { path: PathBuf, mesh: PathBuf },
    #[error("`{}` is in the way: it is not a checkpoint", path.display())]
    #[diagnostic(
        code(ifg::fit::checkpoint),
        help("give --checkpoint another name, or move it away")
    )]
    NoCheckpoint { path: PathBuf, source: ErrorChain },
    #[error("--checkpoint and --out are both `{}`", path.display())]
    #[diagnostic(code(ifg::fit::checkpoint), help("give --checkpoint another name"))]
    SamePlace { path: PathBuf },
    #[error("cannot fit `{}`", path.display())]
    #[diagnostic(
        code(ifg::fit::run),
        help("the mesh may be in other units than metres: look at --scale")
    )]
    Fit { path: PathBuf, source: ErrorChain },
}

fn target_advice(error: &MeshTargetError) -> &'static str {
    match error {
        MeshTargetError::Sides(_) => {
            "turn the triangles round in a mesh editor; --points would need their normals too"
        }
        MeshTargetError::Field(_) | MeshTargetError::NoTriangles => "give a mesh with triangles",
        _ => "give a mesh whose triangles are counter-clockwise seen from outside",
    }
}

/// Runs the command.
pub(crate) fn run(args: &FitArgs) -> Result<End, Report> {
    let start = Instant::now();
    let (target, checkpoint) = targets(args)?;
    let line = Line::new("", 0, 1);
    line.message("reading");
    let mesh = mesh(args)?;
    let doubts = doubts(&mesh);
    let path = || args.mesh.clone();
    let take = if args.points { Take::Points } else { Take::Either };
    let taken =
        MeshTarget::new(&mesh, take).map_err(|source| FitFault::Target { path: path(), source })?;
    line.message("sampling");
    let Begun { set, mut network, mut fit } = match &args.resume {
        Some(file) => resumed(args, file, &taken)?,
        None => begun(args, &taken, start)?,
    };
    // What stands at --out may be better than a network that has learned nothing yet.
    if cancel::is_requested() {
        drop(line);
        errors::note(&format!(
            "cancelled before the first step; `{}` was not written",
            args.out.display()
        ));
        return Ok(End::Cancelled);
    }
    let params = *fit.params();
    tracing::debug!(from = fit.steps(), "fitting begins");
    let ran = run_storing(&mut fit, &mut network, &set, &line, checkpoint.as_ref(), STORE_EVERY);
    let Ran { report, lost } =
        ran.map_err(|e| FitFault::Fit { path: path(), source: ErrorChain::new(&e) })?;
    // The checkpoint has the last state, the network the best.
    let report = report.unwrap_or_else(|| fit.finish(&mut network, &set));
    line.message("writing");
    target.put(|file| write_network(file, &network, &set.frame, WeightNorm::Kept))?;
    drop(line);
    if let (Ended::Cancelled, Some(file)) = (report.ended, &args.checkpoint) {
        errors::note(&match lost {
            true => format!(
                "cancelled; `{}` was not written, so that nothing goes on from here",
                file.display()
            ),
            false => format!("cancelled; --resume {} goes on with it", file.display()),
        });
    }
    let end = say(args, (&taken, doubts), &params, &report, start.elapsed().as_secs_f64())?;
    Ok(if lost { End::Unusable } else { end })
}

/// The network to write, and where to store the fit.
fn targets(args: &FitArgs) -> Result<(Target, Option<Target>), Report> {
    let read = |path, in_place| Input { path, in_place };
    let resume = |in_place| args.resume.as_deref().map(|path| read(path, in_place));
    let inputs =
        |in_place| [read(&args.mesh, None)].into_iter().chain(resume(in_place)).collect::<Vec<_>>();
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
    if let Ok(file) = regular_file::open(path)
        && let Err(e) = read_checkpoint(file)
    {
        return Err(
            FitFault::NoCheckpoint { path: path.clone(), source: ErrorChain::new(&e) }.into()
        );
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
    let told = |e: &dyn std::error::Error| FitFault::Fit {
        path: args.mesh.clone(),
        source: ErrorChain::new(e),
    };
    let config = match args.network {
        NetworkName::Grid => NetworkConfig::grid(),
        NetworkName::Fast => NetworkConfig::fast(),
        NetworkName::Paper => NetworkConfig::paper(),
    };
    let (set, network) =
        taken.target().begin(&config, &sampling(args.seed)).map_err(|e| told(&e))?;
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
    let read = |e: &dyn std::error::Error| FitFault::Resume {
        path: path.into(),
        source: ErrorChain::new(e),
    };
    let file = regular_file::open(path).map_err(|e| read(&e))?;
    let (fit, network, frame) = read_checkpoint(file).map_err(|e| read(&e))?;
    let set = taken.target().training_set(&sampling(fit.params().seed));
    let set =
        set.map_err(|e| FitFault::Fit { path: args.mesh.clone(), source: ErrorChain::new(&e) })?;
    if frame != set.frame || fit.params().loss != taken.target().loss() || !fit.matches(&set) {
        return Err(FitFault::OtherMesh { path: path.into(), mesh: args.mesh.clone() });
    }
    Ok(Begun { set, network, fit })
}

fn sampling(seed: u64) -> SamplingParams {
    SamplingParams { seed, ..SamplingParams::default() }
}

/// How a fit that is stored on its way went.
#[derive(Debug)]
struct Ran {
    /// `None` if the user cancelled it.
    report: Option<FitReport>,
    /// Whether the user cancelled it and it could not be stored, which was told.
    lost: bool,
}

/// Runs a fit to its end, or until the user cancels. Where there is a place to store it, it is
/// stored there after each `every` seconds, and when it is cancelled. Where that fails it is told,
/// and the fit goes on.
fn run_storing(
    fit: &mut Fit,
    network: &mut Network,
    set: &TrainingSet,
    line: &Line,
    checkpoint: Option<&Target>,
    every: f64,
) -> Result<Ran, FitError> {
    let check_every = fit.params().check_every;
    // A disk that stays full is told once.
    let mut is_told = false;
    loop {
        let start = Instant::now();
        let mut watch = |p: &Progress<'_>| {
            if p.done.is_multiple_of(5) {
                let measure = |name, unit| unit * p.measure(name).unwrap_or_default();
                let (share, error) = (measure("share", 100.0), measure("error", 1e3));
                line.message(&format!("step {}, {share:.0} %, error {error:.3} mm", p.done));
            }
            // Right after a check a fit goes on as if nothing had been.
            let is_due = checkpoint.is_some()
                && (p.done as u64).is_multiple_of(check_every)
                && start.elapsed().as_secs_f64() >= every;
            if is_due || cancel::is_requested() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let report = match fit.run(network, set, &mut watch) {
            Err(FitError::Cancelled(_)) => None,
            result => Some(result?),
        };
        let Some(place) = checkpoint.filter(|_| report.is_none()) else {
            return Ok(Ran { report, lost: false });
        };
        let is_last = cancel::is_requested();
        line.message("storing");
        let stored = place.put(|file| write_checkpoint(file, fit, network, &set.frame));
        let lost = stored.is_err();
        if let Err(error) = stored
            && (is_last || !is_told)
        {
            line.aside(|| {
                errors::show(&error.into());
                if !is_last {
                    errors::note("the fit goes on, and storing it is tried again");
                }
            });
        }
        is_told = lost;
        if is_last {
            return Ok(Ran { report, lost });
        }
    }
}

fn mesh(args: &FitArgs) -> Result<TriMesh, FitFault> {
    let file = MeshFile::read(&args.mesh)
        .map_err(|e| FitFault::Mesh { advice: reading_advice(&e), source: ErrorChain::new(&e) })?;
    let Some(scale) = args.scale else { return Ok(file.mesh().clone()) };
    file.mesh().scaled(scale).map_err(|source| FitFault::Scale {
        path: args.mesh.clone(),
        scale,
        source,
    })
}

/// What of the mesh makes the field another one than was meant, perhaps.
fn doubts(mesh: &TriMesh) -> Vec<String> {
    let matters = |fault: &Fault| matches!(fault, Fault::Winding { .. } | Fault::Units { .. });
    faults(mesh).iter().filter(|f| matters(f)).map(|f| format!("the input: {f}")).collect()
}

fn say(
    args: &FitArgs,
    (taken, doubts): (&MeshTarget, Vec<String>),
    params: &FitParams,
    report: &FitReport,
    seconds: f64,
) -> Result<End, Report> {
    let out = args.out.display().to_string();
    let assumed = match taken {
        MeshTarget::Field(field) => not_kept::assumed(field),
        MeshTarget::Points(_) => Vec::new(),
    };
    let notes: Vec<String> = doubts.into_iter().chain(assumed).collect();
    if args.json {
        print_json(
            &json!({"out": out, "state": report.ended, "report": report, "notes": notes, "seconds": seconds}),
        )?;
    } else {
        let (what, judge) = match taken {
            MeshTarget::Field(_) => {
                ("its field", "points beside the surface and on it that no step saw")
            }
            MeshTarget::Points(_) => (
                "its vertices as points",
                "points beside vertices that no step saw, with their noise",
            ),
        };
        let mut text = format!("{}: fitted to {what}\n\n", args.mesh.display());
        text += &errors_of(report);
        text += &format!("\nErrors are at {} {judge}.\n", report.error.points);
        text += &note_lines(&notes);
        let (ended, steps) = (ended(report.ended), report.steps);
        let kept = match report.kept {
            kept if kept == steps => String::new(),
            0 => ", none of them kept: the first values are better".to_owned(),
            kept => format!(", those after step {kept} are not kept"),
        };
        text += &format!("{steps} steps, {ended}{kept}, {seconds:.1} s\nWrote {out}\n");
        print(&text)?;
    }
    let (end, note) = judged(params, report);
    if let Some(note) = note {
        errors::note(note);
    }
    Ok(end)
}

/// How the command ends, and what to say of it.
fn judged(params: &FitParams, report: &FitReport) -> (End, Option<&'static str>) {
    match report.ended {
        Ended::Cancelled => (End::Cancelled, None),
        Ended::Diverged => {
            let note = "the fit diverged; the best state before was written. Look at --scale, or try another --seed";
            (End::NotClean, Some(note))
        }
        _ if params.accuracy.is_some_and(|a| report.error.mean > a) => (
            End::NotClean,
            Some("the accuracy was not reached; the network was written all the same"),
        ),
        _ => (End::Clean, None),
    }
}

fn ended(ended: Ended) -> String {
    match ended {
        Ended::Cancelled => "cancelled, the best state so far was kept".to_owned(),
        other => other.to_string(),
    }
}

fn errors_of(report: &FitReport) -> String {
    let header =
        ["mean mm", "p99 mm", "max mm", "on the surface mm", "| |grad| - 1 |", "normals deg"];
    let mut table = table::new_table(&header, 0, false);
    let e = &report.error;
    let mm = |metres: f64| Cell::new(format!("{:.3}", metres * 1e3));
    let row = [mm(e.mean), mm(e.p99), mm(e.max), mm(e.surface)];
    let rest =
        [Cell::new(format!("{:.4}", e.eikonal)), Cell::new(format!("{:.2}", e.normal_degrees))];
    table.add_row(row.into_iter().chain(rest));
    format!("{}\n", table.trim_fmt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;
    use if_core::monitor::Silent;
    use if_core::shapes::{Sphere, Torus};
    use if_neural::grid::GridConfig;
    use if_neural::schedule::Schedule;
    use if_neural::target::Target as Field;
    use if_neural::trainable::TrainableField;

    fn report(ended: Ended) -> FitReport {
        let error = json!({
            "mean": 2e-4, "p99": 1.9e-3, "max": 0.0123, "surface": 1e-4,
            "eikonal": 0.04, "normal_degrees": 3.9, "points": 9,
        });
        serde_json::from_value(json!({
            "ended": ended, "steps": 9, "kept": 9, "samples": 99, "seconds": 1.0, "error": error,
        }))
        .unwrap()
    }

    #[test]
    fn winding_and_units_are_doubted() {
        let ball = |radius| if_core::shapes::meshes::icosphere(radius, 1);
        assert_eq!(doubts(&ball(0.8)), Vec::<String>::new());
        let [units] = &doubts(&ball(80.0))[..] else { panic!("one doubt") };
        assert!(units.contains("likely centimetres"), "{units}");
        let whole = ball(0.8);
        let turn =
            |(k, [a, b, c]): (usize, &[u32; 3])| if k < 9 { [*a, *c, *b] } else { [*a, *b, *c] };
        let mixed = whole.triangles().iter().enumerate().map(turn).collect();
        let mixed = TriMesh::new(whole.vertices().to_vec(), mixed).unwrap();
        let [winding] = &doubts(&mixed)[..] else { panic!("one doubt") };
        assert!(winding.contains("opposite orientations"), "{winding}");
    }

    #[test]
    fn the_table_fits_100_columns_and_is_plain() {
        let text = errors_of(&report(Ended::Time));
        assert!(text.contains("0.200") && text.contains("12.300"), "{text}");
        assert!(text.lines().all(|l| l.is_ascii() && l.len() <= 100), "{text}");
    }

    #[test]
    fn a_fit_that_diverged_or_missed_its_accuracy_is_not_clean() {
        let of = |ended, accuracy| {
            judged(&FitParams { accuracy, ..FitParams::default() }, &report(ended))
        };
        assert_eq!(of(Ended::Steps, None), (End::Clean, None));
        assert_eq!(of(Ended::Accuracy, Some(2e-4)), (End::Clean, None));
        assert_eq!(of(Ended::Cancelled, Some(1e-4)), (End::Cancelled, None));
        for (ended, accuracy, word) in
            [(Ended::Time, Some(1e-4), "not reached"), (Ended::Diverged, None, "diverged")]
        {
            let (end, note) = of(ended, accuracy);
            assert!(end == End::NotClean && note.unwrap().contains(word), "{note:?}");
        }
    }

    #[test]
    fn a_fit_that_is_cancelled_before_its_first_check_keeps_what_it_has_learned() {
        let ring = Torus { center: Point::new(1.0, 2.0, 3.0), major: 0.5, minor: 0.2 };
        let few =
            SamplingParams { near: 2000, far: 200, held_out: 400, ..SamplingParams::default() };
        let set = Field::Field(&ring).training_set(&few).unwrap();
        let config = NetworkConfig::Grid(GridConfig {
            coarsest: 8,
            finest: 24,
            levels: 3,
            ..GridConfig::default()
        });
        let mut network = Network::new(&config, 1).unwrap();
        let schedule = Schedule { rate: 0.02, warmup: 0, ..Schedule::default() };
        let params = FitParams {
            batch: 256,
            steps: Some(200),
            seconds: None,
            check_every: 25,
            schedule,
            ..config.fit_params()
        };
        let mut fit = Fit::new(params).unwrap();
        let mut first = 0.0;
        let mut stop = |p: &Progress<'_>| {
            first = p.measure("error").unwrap();
            if p.done == 20 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let stopped = fit.run(&mut network, &set, &mut stop);
        assert!(matches!(stopped, Err(FitError::Cancelled(_))));
        let last = network.clone();
        let report = fit.clone().finish(&mut network, &set);
        let last_error = report.error.mean;
        assert_eq!((report.ended, report.steps, report.kept), (Ended::Cancelled, 20, 20));
        assert!(
            report.error.mean < first && network.parameters() == last.parameters(),
            "{report:?} {first}"
        );
        // A last state that is worse than the first one is not kept.
        network.parameters_mut().iter_mut().for_each(|p| *p += 1.0);
        let report = fit.finish(&mut network, &set);
        assert!(report.kept == 0 && report.error.mean > last_error, "{report:?}");
        assert!(network.parameters() == Network::new(&config, 1).unwrap().parameters());
    }

    #[test]
    fn a_fit_that_is_stored_on_its_way_ends_with_the_same_bits_and_so_does_one_that_goes_on_from_there()
     {
        let ball = Sphere { center: Point::new(0.0, 1.0, 0.0), radius: 0.3 };
        let few =
            SamplingParams { near: 1000, far: 100, held_out: 200, ..SamplingParams::default() };
        let config = NetworkConfig::Grid(GridConfig {
            coarsest: 8,
            finest: 16,
            levels: 2,
            ..GridConfig::default()
        });
        let (set, first) = Field::Field(&ball).begin(&config, &few).unwrap();
        let begin = || {
            let params = FitParams {
                batch: 64,
                steps: Some(10),
                seconds: None,
                check_every: 4,
                ..config.fit_params()
            };
            (Fit::new(params).unwrap(), first.clone())
        };
        let (mut fit, mut whole) = begin();
        fit.run(&mut whole, &set, &mut Silent).unwrap();
        let (mut fit, mut stored) = begin();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fit.safetensors");
        let place = Target::open(&path, "safetensors", &[], &[]).unwrap();
        let line = Line::new("", 0, 1);
        let Ran { report, lost } =
            run_storing(&mut fit, &mut stored, &set, &line, Some(&place), 0.0).unwrap();
        let report = report.unwrap();
        assert_eq!((report.ended, report.steps, lost), (Ended::Steps, 10, false));
        assert!(stored.parameters() == whole.parameters());
        let (mut fit, mut later, frame) =
            read_checkpoint(std::fs::File::open(&path).unwrap()).unwrap();
        assert_eq!((fit.steps(), frame), (8, set.frame));
        run_storing(&mut fit, &mut later, &set, &line, None, 0.0).unwrap();
        assert!(later.parameters() == whole.parameters());
        // One that cannot be stored goes on all the same, and leaves no half of a file.
        let (mut fit, mut unstored) = begin();
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        let Ran { report, lost } =
            run_storing(&mut fit, &mut unstored, &set, &line, Some(&place), 0.0).unwrap();
        let report = report.unwrap();
        assert_eq!((report.ended, report.steps, lost), (Ended::Steps, 10, false));
        assert!(unstored.parameters() == whole.parameters() && !place.staged(0).exists());
    }
}
