//! `ifg check`: verifies outfits and changes nothing.

use crate::cancel;
use crate::end::{End, NotEverywhere};
use crate::errors;
use crate::inputs::{InputArgs, ParamArgs};
use crate::load;
use crate::outfit_file::{OutfitSpec, SpecError, outfits};
use crate::print::{note_lines, print, print_json};
use crate::progress::Line;
use crate::report_output::{self, Style};
use crate::table;
use clap::Args;
use miette::{IntoDiagnostic, Report};
use serde_json::json;
use std::time::Instant;

#[derive(Args, Debug, Clone)]
pub(crate) struct CheckArgs {
    #[command(flatten)]
    pub(crate) input: InputArgs,
}

/// Runs the command. Errors of one outfit are shown, and do not stop the others.
pub(crate) fn run(args: &CheckArgs) -> Result<End, Report> {
    let specs = outfits(&args.input, &ParamArgs::default());
    let n = specs.len();
    let (json, strict) = (args.input.json, args.input.strict);
    let mut worst = End::Clean;
    for (k, spec) in specs.into_iter().enumerate() {
        if cancel::is_requested() {
            return Ok(End::Cancelled);
        }
        let file = args.input.files[k].display().to_string();
        let end = match one(spec, (k, n), json, strict) {
            Ok(end) => end,
            Err(error) => report_output::failure(
                &file,
                &error,
                if json { Style::Json } else { Style::Tables },
            )?,
        };
        worst = worst.max(end);
    }
    Ok(if cancel::is_requested() { End::Cancelled } else { worst })
}

/// Checks outfit `k` of `n`.
fn one(
    spec: Result<OutfitSpec, SpecError>,
    (k, n): (usize, usize),
    json: bool,
    strict: bool,
) -> Result<End, Report> {
    let start = Instant::now();
    let spec = spec?;
    let line = Line::new(&spec.name, k, n);
    line.message("reading");
    let files = load::load(&spec)?;
    line.message("verifying");
    let found = files.verify().into_diagnostic()?;
    drop(line);
    let state = found.cleanness();
    if json {
        print_json(
            &json!({"outfit": spec.name, "state": state, "notes": files.notes(), "report": found}),
        )?;
    } else {
        let garments: Vec<String> = spec.garments.iter().map(|l| l.name.clone()).collect();
        let mut text = report_output::title(&spec);
        text += &table::checked(&found, &garments, table::coloured());
        text += &note_lines(&files.notes());
        let (pairs, inside) =
            (table::count(found.total_pairs()), table::count(found.total_inside()));
        let seconds = start.elapsed().as_secs_f64();
        text += &format!(
            "{pairs} intersecting pairs, {inside} vertices inside: {state}, {seconds:.2} s\n"
        );
        print(&text)?;
    }
    let names = spec.layers().map(|layer| layer.name.as_str());
    if let Some(own) = NotEverywhere::of(&spec.name, names, &found, strict) {
        errors::show(&own.into());
    }
    Ok(End::of(state, strict))
}
