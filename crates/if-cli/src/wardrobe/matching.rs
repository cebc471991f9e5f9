//! `ifg wardrobe match`.

use super::args::MatchArgs;
use super::{Fault, end_of, match_params, open};
use crate::cancel;
use crate::end::End;
use crate::errors::note;
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::staging::OutputError;
use crate::table;
use if_pipeline::resolve::Progress;
use if_pipeline::wardrobe::combination::Combination;
use if_pipeline::wardrobe::dresser::Dresser;
use if_pipeline::wardrobe::matching::{MatchParams, MatchResult, run_into_folder};
use if_pipeline::whole_folder::Writer;
use miette::Report;
use std::ops::ControlFlow;
use std::path::Path;

/// Pixels.
const PICTURE_HEIGHT: u32 = 640;

/// Runs the command.
pub(super) fn run(args: &MatchArgs) -> Result<End, Report> {
    let wardrobe = open(&args.root)?;
    let params = MatchParams { body: true, unproven: args.write_unproven, ..match_params(&args.params, PICTURE_HEIGHT)? };
    let combination = Combination { body: args.body.clone(), garments: args.garments.clone() };
    let (parent, name) = parts(&args.out)?;
    let folder = |source| OutputError::Folder { path: parent.into(), source };
    let writer = Writer::open(parent).map_err(folder)?.ok_or_else(|| OutputError::Busy { path: parent.into() })?;
    let dresser = Dresser::new(&wardrobe, params.align);
    let line = Line::new(&combination.to_string(), 0, 1);
    line.say("aligning");
    let mut watch = |progress: &Progress| {
        line.show(progress);
        if cancel::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let done = run_into_folder((&writer, name), &dresser, &combination, &params, args.again, &mut watch);
    drop(line);
    let done = done.map_err(|e| Fault::new(format!("cannot match {combination}"), &e))?;
    let Some((result, before)) = done else {
        note(&format!("cancelled; `{}` was not written", args.out.display()));
        return Ok(End::Cancelled);
    };
    if args.json {
        print_json(&result)?;
    } else {
        print(&told(&result, &args.out, before))?;
    }
    if let Some(error) = &result.error {
        note(&format!("{}: {}", error.kind, error.message));
    }
    Ok(end_of(result.state))
}

/// The folder in which the output folder stands, and its name.
fn parts(out: &Path) -> Result<(&Path, &str), OutputError> {
    let name = out.file_name().and_then(|n| n.to_str()).ok_or_else(|| OutputError::InTheWay { path: out.into() })?;
    let parent = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if out.exists() && !out.join("result.json").exists() {
        // Some other folder of the user's: not to be replaced.
        return Err(OutputError::InTheWay { path: out.into() });
    }
    Ok((parent, name))
}

fn told(result: &MatchResult, out: &Path, before: bool) -> String {
    let mut text = format!("{}\n", result.combination);
    for (name, a) in result.combination.garments.iter().zip(&result.alignments) {
        text += &format!(
            "  {name}: {:?}, moved {:.1} mm on average, {:.1} % inside the body (own body {:.1} %)\n",
            a.method,
            a.moved.mean * 1e3,
            a.inside[1] * 1e2,
            a.inside[0] * 1e2
        );
    }
    if let Some(report) = &result.report {
        text += &format!("{}\n", table::pairs_before_after(&report.before, &report.after, table::coloured()));
        for l in &report.layers {
            let (moved, strain) = (l.moved.max * 1e3, l.strain.rms * 1e2);
            text += &format!(
                "  {}: moved {:.2} mm on average, {moved:.1} at most, strain {strain:.1} % rms\n",
                l.name,
                l.moved.mean * 1e3
            );
        }
        text += &format!("{}\n", table::totals(&report.before, &report.after));
    }
    let how = if before { "was there already" } else { "written" };
    text + &format!("{}: {how}\n", out.join("report.html").display())
}
