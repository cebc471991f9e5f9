//! `ifg fix`: outfits from files, resolved into folders.

use crate::args::FixArgs;
use crate::end::End;
use crate::errors::{self, ErrorJson};
use crate::outfit_file::{OutfitSpec, SpecError, outfits};
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::receipt::{self, Output};
use crate::resolve_outfit::{self, Done, Options, Outcome};
use crate::staging::OutputError;
use crate::table;
use miette::Report;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Runs the command. Errors of one outfit of a batch are shown, and do not stop the others.
pub(crate) fn run(args: &FixArgs) -> Result<End, Report> {
    let start = Instant::now();
    let specs = outfits(&args.input, &args.params);
    let outs = out_folders(args)?;
    let batch = specs.len() > 1;
    let options = Options {
        in_place: args.in_place,
        write_unproven: args.write_unproven,
        resume: batch && !args.again,
        pictures: !args.no_pictures,
    };
    let (mut ends, json) = (Vec::with_capacity(specs.len()), args.input.json);
    for (k, (spec, out)) in specs.into_iter().zip(&outs).enumerate() {
        let file = args.input.files[k].display().to_string();
        let end = match one(spec, out, options, (k, outs.len()), json) {
            Ok(end) => end,
            Err(error) => failed(&file, error, json)?,
        };
        ends.push(end);
        if end == End::Cancelled {
            break;
        }
    }
    if batch && !json {
        print(&summary(&ends, outs.len(), start.elapsed().as_secs_f64()))?;
    }
    Ok(ends.into_iter().max().unwrap_or(End::Clean))
}

/// Resolves outfit `k` of `n` and says how it went.
fn one(
    spec: Result<OutfitSpec, SpecError>,
    out: &Path,
    options: Options,
    (k, n): (usize, usize),
    json: bool,
) -> Result<End, Report> {
    let spec = spec?;
    let line = Line::new(&spec.name, k, n);
    let outcome = resolve_outfit::run(&spec, out, options, &line)?;
    drop(line);
    if json {
        return say_json(&spec.name, out, &outcome);
    }
    match outcome {
        Outcome::Cancelled => Ok(cancelled(&spec.name)),
        Outcome::Finished => {
            print(&format!("{}: finished before, skipped (--again does it again)\n", spec.name))?;
            Ok(End::Clean)
        }
        Outcome::Resolved(done) if n > 1 => {
            print(&in_one_line(&spec.name, out, &done))?;
            Ok(done.end())
        }
        Outcome::Resolved(done) => say(&spec, out, *done),
    }
}

/// Prints the tables of one outfit.
pub(crate) fn say(spec: &OutfitSpec, out: &Path, done: Done) -> Result<End, Report> {
    let end = done.end();
    let garments: Vec<&str> = spec.garments.iter().map(|l| l.name.as_str()).collect();
    let mut text = format!("{}: {} over {}\n\n", spec.name, garments.join(" < "), spec.body.name);
    text += &table::resolved(&done.report, table::coloured());
    text += &table::skipped(&done.report.layers).map_or(String::new(), |line| line + "\n");
    text += &format!("{}, {:.2} s\n", table::totals(&done.report.before, &done.report.after), done.seconds);
    if !done.outputs.is_empty() {
        let names: Vec<String> = done.outputs.iter().map(named).collect();
        text += &format!("Wrote {}: {}, {}\n", out.display(), names.join(", "), receipt::FILE);
    }
    print(&text)?;
    if let Some(left) = done.left {
        errors::show(&left.into());
    }
    Ok(end)
}

fn named(output: &Output) -> String {
    let note = if output.unchanged == Some(true) { " (unchanged)" } else { "" };
    format!("{}{note}", output.file)
}

fn in_one_line(name: &str, out: &Path, done: &Done) -> String {
    let moved = done.report.layers.iter().map(|l| l.moved.max).fold(0.0, f64::max);
    let written = if done.outputs.is_empty() { "nothing written".into() } else { out.display().to_string() };
    let totals = table::totals(&done.report.before, &done.report.after);
    format!("{name}: {totals}, moved at most {:.1} mm, {:.2} s, {written}\n", moved * 1e3, done.seconds)
}

fn say_json(name: &str, out: &Path, outcome: &Outcome) -> Result<End, Report> {
    let (state, end, done) = match outcome {
        Outcome::Cancelled => ("cancelled", cancelled(name), None),
        Outcome::Finished => ("finished", End::Clean, None),
        Outcome::Resolved(done) => (if done.left.is_some() { "remaining" } else { "clean" }, done.end(), Some(done)),
    };
    print_json(&json!({
        "outfit": name,
        "state": state,
        "out": out.display().to_string(),
        "written": done.map(|d| d.outputs.iter().map(|o| o.file.as_str()).collect::<Vec<_>>()),
        "report": done.map(|d| &d.report),
        "seconds": done.map(|d| d.seconds),
    }))?;
    Ok(end)
}

fn cancelled(name: &str) -> End {
    errors::note(&format!("cancelled; `{name}` was not written"));
    End::Cancelled
}

/// Shows the error of one outfit.
pub(crate) fn failed(file: &str, error: Report, json: bool) -> Result<End, Report> {
    if json {
        print_json(&json!({"outfit": file, "state": "failed", "error": ErrorJson::new(&error)}))?;
    }
    errors::show(&error);
    Ok(End::Unusable)
}

fn summary(ends: &[End], outfits: usize, seconds: f64) -> String {
    let of = |end: End| ends.iter().filter(|e| **e == end).count();
    format!(
        "{outfits} outfits: {} clean, {} with intersections left, {} unusable, {} not done; {seconds:.1} s\n",
        of(End::Clean),
        of(End::NotClean),
        of(End::Unusable),
        outfits - ends.iter().filter(|e| **e != End::Cancelled).count(),
    )
}

/// Where each outfit goes: `--out` for one, a folder in it for each of several.
fn out_folders(args: &FixArgs) -> Result<Vec<PathBuf>, OutputError> {
    let files = &args.input.files;
    if args.input.body.is_some() {
        return Ok(vec![args.out.clone().ok_or(OutputError::NoFolder)?]);
    }
    if let ([_], Some(out)) = (&files[..], &args.out) {
        return Ok(vec![out.clone()]);
    }
    let parent = args.out.clone().unwrap_or_else(|| "out".into());
    let folders: Vec<PathBuf> = files.iter().map(|f| parent.join(f.file_stem().unwrap_or(f.as_os_str()))).collect();
    for k in 1..folders.len() {
        let lower = |path: &PathBuf| path.to_string_lossy().to_lowercase();
        if let Some(first) = (0..k).find(|&j| lower(&folders[j]) == lower(&folders[k])) {
            return Err(OutputError::SameName {
                first: files[first].display().to_string(),
                second: files[k].display().to_string(),
                name: folders[k].display().to_string(),
            });
        }
    }
    Ok(folders)
}
