//! `ifg fit`: a neural signed distance field from a mesh.

use crate::args::{FitArgs, NetworkName};
use crate::cancel;
use crate::end::End;
use crate::errors::{self, Told};
use crate::load::reading_advice;
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::table;
use crate::target::{Input, Target};
use comfy_table::Cell;
use if_core::mesh::{MeshError, TriMesh};
use if_mesh::file::MeshFile;
use if_neural::files::{WeightNorm, write_network};
use if_neural::fit::{Ended, Fit, FitParams, FitReport};
use if_neural::network::NetworkConfig;
use if_neural::sampling::SamplingParams;
use if_pipeline::fitting::{MeshTarget, MeshTargetError, Take};
use miette::{Diagnostic, Report};
use serde_json::json;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

/// Seconds where nothing else says when to stop, and where only an accuracy does.
const SECONDS: [f64; 2] = [60.0, 600.0];
/// Least time that is left for steps when reading and sampling took long.
const LEAST: f64 = 0.5;

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
    let target = Target::open(&args.out, "safetensors", &[], &[Input { path: &args.mesh, in_place: None }])?;
    let line = Line::new("", 0, 1);
    line.say("reading");
    let mesh = mesh(args)?;
    let path = || args.mesh.clone();
    let take = if args.points { Take::Points } else { Take::Either };
    let taken = MeshTarget::new(&mesh, take).map_err(|source| FitFault::Target { path: path(), source })?;
    let told = |e: &dyn std::error::Error| FitFault::Fit { path: path(), source: Told::new(e) };

    line.say("sampling");
    let config = match args.network {
        NetworkName::Grid => NetworkConfig::grid(),
        NetworkName::Fast => NetworkConfig::fast(),
        NetworkName::Paper => NetworkConfig::paper(),
    };
    let sampling = SamplingParams { seed: args.seed, ..SamplingParams::default() };
    let (set, mut network) = taken.target().begin(&config, &sampling).map_err(|e| told(&e))?;
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
    let mut fit = Fit::new(params).map_err(|e| told(&e))?;
    let mut report = fit
        .run(&mut network, &set, &mut |p| {
            if p.step.is_multiple_of(5) {
                let (done, error) = (100.0 * p.done, p.error.mean * 1e3);
                line.say(&format!("step {}, {done:.0} %, error {error:.3} mm", p.step));
            }
            if cancel::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
        .map_err(|e| told(&e))?;
    if report.ended == Ended::Cancelled {
        fit.keep_best(&mut network);
        report.error = set.held_out.error(&set.frame, |p, o| if_neural::field::Samples32::samples32(&network, p, o));
    }
    line.say("writing");
    target.put(|file| write_network(file, &network, &set.frame, WeightNorm::Kept))?;
    drop(line);
    say(args, &taken, &report, start.elapsed().as_secs_f64())
}

fn mesh(args: &FitArgs) -> Result<TriMesh, FitFault> {
    let file = MeshFile::read(&args.mesh).map_err(|e| FitFault::Mesh { advice: reading_advice(&e), source: Told::new(&e) })?;
    let Some(scale) = args.scale else { return Ok(file.mesh().clone()) };
    let scaled = file.mesh().with_vertices(file.mesh().vertices().iter().map(|p| p * scale).collect());
    scaled.map_err(|source| FitFault::Scale { path: args.mesh.clone(), scale, source })
}

fn say(args: &FitArgs, taken: &MeshTarget, report: &FitReport, seconds: f64) -> Result<End, Report> {
    let missed = args.accuracy.is_some_and(|a| report.error.mean > a) && report.ended != Ended::Accuracy;
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

fn ended(ended: Ended) -> &'static str {
    match ended {
        Ended::Steps => "all done",
        Ended::Time => "the time was over",
        Ended::Accuracy => "accuracy reached",
        Ended::Cancelled => "cancelled, the best state so far was kept",
        Ended::Diverged => "it diverged, the last good state was kept",
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
    use if_neural::accuracy::FieldError;

    #[test]
    fn the_table_fits_100_columns_and_is_plain() {
        let error =
            FieldError { mean: 2e-4, p99: 1.9e-3, max: 0.0123, surface: 1e-4, eikonal: 0.04, normal_degrees: 3.9, points: 9 };
        let report = FitReport { ended: Ended::Time, steps: 9, kept: 9, samples: 99, seconds: 1.0, error };
        let text = errors_of(&report);
        assert!(text.contains("0.200") && text.contains("12.300"), "{text}");
        assert!(text.lines().all(|l| l.is_ascii() && l.len() <= 100), "{text}");
    }
}
