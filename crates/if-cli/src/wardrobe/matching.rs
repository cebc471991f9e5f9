//! `ifg wardrobe match`.

use super::opening::{open, report};
use super::results::{FieldsArg, end_of, match_params};
use crate::cancel;
use crate::end::{End, NotEverywhere};
use crate::errors::{self, note};
use crate::inputs::ParamArgs;
use crate::output_error::OutputError;
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::table;
use clap::Args;
use if_body::AlignParams;
use if_outfit::Cleanness;
use if_pipeline::wardrobe::WardrobeError;
use if_pipeline::wardrobe::combination::Combination;
use if_pipeline::wardrobe::dresser::Dresser;
use if_pipeline::wardrobe::matching::{MatchParams, MatchResult, Placed, run_into_folder};
use miette::Report;
use std::path::{Path, PathBuf};

#[derive(Args, Debug)]
pub(crate) struct MatchArgs {
    /// The wardrobe's folder.
    #[arg(value_name = "WARDROBE")]
    pub(crate) root: PathBuf,
    /// Names of garments, innermost first.
    #[arg(value_name = "GARMENTS", required = true)]
    pub(crate) garments: Vec<String>,
    /// Name of the body.
    #[arg(long, value_name = "NAME")]
    pub(crate) body: String,
    /// Output folder; the files of a result that stands there are replaced by those of one that is
    /// no worse.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) params: ParamArgs,
    /// What `--method paper` reads of the garments below the one that it settles.
    #[arg(long, value_enum)]
    pub(super) fields: Option<FieldsArg>,
    /// Write the meshes even where intersections are left.
    #[arg(long)]
    pub(crate) write_unproven: bool,
    /// Exit with 1 unless the result is clean everywhere: no garment meets itself, nor does the body.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Do it again even if it is done.
    #[arg(long)]
    pub(crate) again: bool,
    /// Do not draw.
    #[arg(long)]
    pub(crate) no_pictures: bool,
    /// Print the result as JSON, and no tables.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Pixels.
const PICTURE_HEIGHT: u32 = 640;

/// Runs the command.
pub(super) fn run(args: &MatchArgs) -> Result<End, Report> {
    let wardrobe = open(&args.root)?;
    let height = if args.no_pictures { 0 } else { PICTURE_HEIGHT };
    let params = MatchParams {
        body: true,
        unproven: args.write_unproven,
        ..match_params(&args.params, args.fields, height)?
    };
    let combination = Combination { body: args.body.clone(), garments: args.garments.clone() };
    let dresser = Dresser::new(&wardrobe, AlignParams::default());
    let line = Line::new(&combination.to_string(), 0, 1);
    line.message("aligning");
    let done = run_into_folder(&args.out, &dresser, &combination, &params, args.again, &mut &line);
    drop(line);
    let (result, placed) = match done {
        Ok(done) => done,
        Err(WardrobeError::Cancelled(_)) => return Ok(cancel::end(args.out.display())),
        Err(error) => return Err(failure(&args.out, &combination, error)),
    };
    if args.json {
        print_json(&result)?;
    } else {
        print(&text(&result, &args.out, placed))?;
    }
    for line in result.notes() {
        note(&line);
    }
    if let Some(error) = &result.error {
        note(&format!("{}: {}", error.kind, error.message));
    }
    if placed == Placed::Nowhere {
        let out = args.out.display();
        note(&format!(
            "`{out}` holds a better result, and was left as it was; --out with another folder writes this one"
        ));
    }
    if let Some(report) = &result.report {
        let names = std::iter::once(&combination.body).chain(&combination.garments);
        let names = names.map(String::as_str);
        let outfit = combination.to_string();
        if let Some(own) = NotEverywhere::of(&outfit, names, &report.after, args.strict) {
            errors::show(&own.into());
        }
    }
    let everywhere = result.cleanness() == Some(Cleanness::Everywhere);
    Ok(end_of(result.state, everywhere, args.strict))
}

/// The error of a combination that was not resolved.
fn failure(out: &Path, combination: &Combination, error: WardrobeError) -> Report {
    match error {
        WardrobeError::Folder { path, source } if path.starts_with(out) => {
            OutputError::Folder { path: out.into(), source }.into()
        }
        WardrobeError::Io(source) => OutputError::Folder { path: out.into(), source }.into(),
        error => report(format!("cannot match {combination}"), error),
    }
}

fn text(result: &MatchResult, out: &Path, placed: Placed) -> String {
    let mut text = format!("{}\n", result.combination);
    for (name, a) in result.combination.garments.iter().zip(&result.alignments) {
        text += &format!(
            "  {name}: {:?}, moved {:.1} mm on average, strain {:.1} % rms, {:.1} % p99, {:.1} % inside the body (own body {:.1} %)\n",
            a.method,
            a.moved.mean * 1e3,
            a.strain.rms * 1e2,
            a.strain.p99 * 1e2,
            a.inside[1] * 1e2,
            a.inside[0] * 1e2
        );
    }
    for field in &result.fields {
        text += &format!("  {}: garments above read {}\n", field.garment, field.read);
    }
    if let Some(report) = &result.report {
        text += &format!(
            "{}\n",
            table::pairs_before_after(&report.before, &report.after, table::coloured())
        );
        for l in &report.layers {
            let (moved, strain) = (l.moved.max * 1e3, l.strain.rms * 1e2);
            text += &format!(
                "  {}: moved {:.2} mm on average, {moved:.1} at most, strain {strain:.1} % rms, own pairs {} -> {}\n",
                l.name,
                l.moved.mean * 1e3,
                l.own_pairs.before,
                l.own_pairs.after
            );
        }
        text += &format!("{}\n", table::totals(&report.before, &report.after));
    }
    let how = match placed {
        Placed::Before => "was there already",
        Placed::Written => "written",
        Placed::Nowhere => return text + "Nothing written.\n",
    };
    text + &format!("{}: {how}\n", out.join("report.html").display())
}
