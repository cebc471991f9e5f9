//! `ifg check`: verifies outfits and changes nothing.

use crate::end::{End, NotEverywhere};
use crate::errors;
use crate::inputs::{InputArgs, Order, ParamArgs};
use crate::load;
use crate::order;
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
    let mut worst = End::Clean;
    for (k, spec) in specs.into_iter().enumerate() {
        let name = report_output::name(&spec, &args.input.files[k]);
        let end = match one(spec, (k, n), &args.input) {
            Ok(end) => end,
            Err(error) => report_output::failure(
                &name,
                &error,
                if args.input.json { Style::Json } else { Style::Tables },
            )?,
        };
        worst = worst.max(end);
    }
    Ok(worst)
}

/// Checks outfit `k` of `n`.
fn one(
    spec: Result<OutfitSpec, SpecError>,
    (k, n): (usize, usize),
    input: &InputArgs,
) -> Result<End, Report> {
    let start = Instant::now();
    let InputArgs { json, strict, .. } = *input;
    let mut spec = spec?;
    let line = Line::new(&spec.name, k, n);
    line.message("reading");
    let mut files = load::load(&spec)?;
    let proposed = if input.order == Order::Auto { Some(order::proposed(&files)?) } else { None };
    if let Some(proposed) = proposed.as_ref().filter(|found| !found.order.is_sorted()) {
        spec = order::with_order(&spec, proposed);
        files = load::load(&spec)?;
    }
    line.message("verifying");
    let found = files.verify().into_diagnostic()?;
    drop(line);
    let mut notes = found.notes(&files.outfit().body.name);
    notes.extend(files.notes());
    let state = found.cleanness();
    if json {
        let mut answer =
            json!({"outfit": spec.name, "state": state, "notes": notes, "report": found});
        if let Some(proposed) = &proposed {
            answer["order"] = json!(proposed);
        }
        print_json(&answer)?;
    } else {
        let garments: Vec<String> = spec.garments.iter().map(|l| l.name.clone()).collect();
        let mut text = spec.title() + "\n\n";
        text += &table::checked(&found, &garments, table::coloured());
        text += &note_lines(&notes);
        text += &proposed.as_ref().map_or(String::new(), order::text);
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
