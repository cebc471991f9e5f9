//! Reports how an outfit ended: tables for people, one line of a batch, or JSON.

use crate::cancel;
use crate::end::{End, NotEverywhere};
use crate::errors::{self, ErrorJson};
use crate::file_record::OutputFile;
use crate::outcome::{Done, Outcome};
use crate::outfit_file::{OutfitSpec, SpecError};
use crate::phase_table;
use crate::print::{note_lines, print, print_json};
use crate::receipt;
use crate::table;
use if_outfit::Cleanness;
use miette::Report;
use serde_json::json;
use std::path::Path;

/// How much to print.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Style {
    /// Tables.
    Tables,
    /// One line an outfit.
    Line,
    /// One line of JSON an outfit.
    Json,
}

/// Reports how one outfit ended.
pub(crate) fn outcome(
    spec: &OutfitSpec,
    out: &Path,
    outcome: Outcome,
    (style, strict): (Style, bool),
) -> Result<End, Report> {
    if style == Style::Json {
        print_outcome_json(&spec.name, out, &outcome)?;
    }
    let done = match outcome {
        Outcome::Cancelled => {
            return Ok(cancel::end(out.display()));
        }
        Outcome::Finished(state) => {
            if style != Style::Json {
                print(&format!(
                    "{}: finished before, {state}, skipped (--again does it again)\n",
                    spec.name
                ))?;
            }
            let end = End::of(state, strict);
            if strict && state == Cleanness::BetweenLayers {
                let (outfit, own) = (spec.name.clone(), Vec::new());
                errors::show(&NotEverywhere { outfit, own }.into());
            }
            return Ok(end);
        }
        Outcome::Resolved(done) => done,
    };
    if let Some(phases) = done.phases.as_ref().filter(|_| style != Style::Json) {
        print(&phase_table::phases(phases, done.peak_memory, table::coloured()))?;
    }
    match style {
        Style::Json => {}
        Style::Line => print(&in_one_line(&spec.name, out, &done))?,
        Style::Tables => print(&in_tables(spec, out, &done))?,
    }
    let end = End::of(done.state(), strict);
    let names = spec.layers().map(|layer| layer.name.as_str());
    let own = NotEverywhere::of(&spec.name, names, &done.report.after, strict);
    if let Some(unresolved) = done.unresolved {
        errors::show(&unresolved.into());
    } else if let Some(own) = own {
        errors::show(&own.into());
    }
    Ok(end)
}

/// What an outfit is called in JSON: by its file if that cannot be read.
pub(crate) fn name(spec: &Result<OutfitSpec, SpecError>, file: &Path) -> String {
    spec.as_ref().map_or_else(|_| file.display().to_string(), |spec| spec.name.clone())
}

/// Shows an error that concerns one outfit of possibly several.
pub(crate) fn failure(name: &str, error: &Report, style: Style) -> Result<End, Report> {
    if style == Style::Json {
        print_json(&json!({"outfit": name, "state": "failed", "error": ErrorJson::new(error)}))?;
    }
    errors::show(error);
    Ok(End::of_error(error))
}

fn in_tables(spec: &OutfitSpec, out: &Path, done: &Done) -> String {
    let skipped = table::skipped(&done.report.layers).map_or(String::new(), |line| line + "\n");
    let written = match done.outputs.as_slice() {
        [] => "Nothing written.\n".into(),
        outputs => {
            let names: Vec<String> = outputs.iter().map(named).collect();
            format!("Wrote {}: {}, {}\n", out.display(), names.join(", "), receipt::FILE)
        }
    };
    [
        spec.title() + "\n\n",
        table::resolved(&done.report, table::coloured()),
        skipped,
        note_lines(&done.notes),
        format!(
            "{}: {}, {:.2} s\n",
            table::totals(&done.report.before, &done.report.after),
            done.state(),
            done.seconds
        ),
        written,
    ]
    .concat()
}

fn named(output: &OutputFile) -> String {
    let note = if output.unchanged == Some(true) { " (unchanged)" } else { "" };
    format!("{}{note}", output.file)
}

fn in_one_line(name: &str, out: &Path, done: &Done) -> String {
    let moved = done.report.layers.iter().map(|l| l.moved.max).fold(0.0, f64::max);
    let written =
        if done.outputs.is_empty() { "nothing written".into() } else { out.display().to_string() };
    let totals = table::totals(&done.report.before, &done.report.after);
    let line = format!(
        "{name}: {totals}: {}, moved at most {:.1} mm, {:.2} s, {written}\n",
        done.state(),
        moved * 1e3,
        done.seconds
    );
    line + &note_lines(&done.notes)
}

fn print_outcome_json(name: &str, out: &Path, outcome: &Outcome) -> Result<(), Report> {
    let (state, cleanness, done) = match outcome {
        Outcome::Cancelled => (json!("cancelled"), None, None),
        Outcome::Finished(cleanness) => (json!("finished"), Some(*cleanness), None),
        Outcome::Resolved(done) => (json!(done.state()), Some(done.state()), Some(done)),
    };
    print_json(&json!({
        "outfit": name,
        "state": state,
        "cleanness": cleanness,
        "out": out.display().to_string(),
        "written": done.map_or(vec![], |d| d.outputs.iter().map(|o| o.file.as_str()).collect()),
        "notes": done.map_or(&[][..], |d| &d.notes),
        "report": done.map(|d| &d.report),
        "seconds": done.map(|d| d.seconds),
        "phases": done.map(|d| &d.phases),
        "peak_memory": done.map(|d| d.peak_memory),
    }))
}
