//! `ifg check`: looks at outfits and changes nothing.

use crate::announce::{self, Style};
use crate::args::{CheckArgs, ParamArgs};
use crate::cancel;
use crate::end::End;
use crate::load;
use crate::outfit_file::{OutfitSpec, SpecError, outfits};
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::table;
use if_outfit::verify::verify;
use miette::{IntoDiagnostic, Report};
use serde_json::json;
use std::time::Instant;

/// Runs the command. Errors of one outfit are shown, and do not stop the others.
pub(crate) fn run(args: &CheckArgs) -> Result<End, Report> {
    let specs = outfits(&args.input, &ParamArgs::default());
    let (n, json) = (specs.len(), args.input.json);
    let mut worst = End::Clean;
    for (k, spec) in specs.into_iter().enumerate() {
        if cancel::asked() {
            return Ok(End::Cancelled);
        }
        let file = args.input.files[k].display().to_string();
        let end = match one(spec, (k, n), json) {
            Ok(end) => end,
            Err(error) => {
                announce::failure(&file, &error, if json { Style::Json } else { Style::Tables })?
            }
        };
        worst = worst.max(end);
    }
    Ok(if cancel::asked() { End::Cancelled } else { worst })
}

/// Checks outfit `k` of `n`.
fn one(
    spec: Result<OutfitSpec, SpecError>,
    (k, n): (usize, usize),
    json: bool,
) -> Result<End, Report> {
    let start = Instant::now();
    let spec = spec?;
    let line = Line::new(&spec.name, k, n);
    line.say("reading");
    let loaded = load::load(&spec)?;
    line.say("verifying");
    let found = verify(&loaded.outfit).into_diagnostic()?;
    drop(line);
    let clean = found.is_clean();
    let verdict = if clean { "clean" } else { "not clean" };
    if json {
        print_json(
            &json!({"outfit": spec.name, "state": verdict, "notes": loaded.notes(), "report": found}),
        )?;
    } else {
        let garments: Vec<String> = spec.garments.iter().map(|l| l.name.clone()).collect();
        let mut text = announce::title(&spec);
        text += &table::checked(&found, &garments, table::coloured());
        text += &announce::notes(&loaded.notes());
        let (pairs, inside) =
            (table::count(found.total_pairs()), table::count(found.total_inside()));
        let seconds = start.elapsed().as_secs_f64();
        text += &format!(
            "{pairs} intersecting pairs, {inside} vertices inside: {verdict}, {seconds:.2} s\n"
        );
        print(&text)?;
    }
    Ok(if clean { End::Clean } else { End::NotClean })
}
