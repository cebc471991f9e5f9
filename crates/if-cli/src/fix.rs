//! `ifg fix`: outfits from files, resolved into folders.

use crate::announce::{self, Style};
use crate::args::FixArgs;
use crate::cancel;
use crate::end::End;
use crate::outfit_file::outfits;
use crate::print::print;
use crate::progress::Line;
use crate::resolve_outfit::{self, Options};
use crate::staging::OutputError;
use miette::Report;
use std::path::PathBuf;
use std::time::Instant;

/// Runs the command. The error of one outfit is shown, and does not stop the others.
pub(crate) fn run(args: &FixArgs) -> Result<End, Report> {
    let start = Instant::now();
    let specs = outfits(&args.input, &args.params);
    let outs = out_folders(args)?;
    let n = outs.len();
    let style = match n {
        _ if args.input.json => Style::Json,
        1 => Style::Tables,
        _ => Style::Line,
    };
    let options = Options {
        in_place: args.in_place,
        write_unproven: args.write_unproven,
        resume: n > 1 && !args.again,
        pictures: !args.no_pictures,
    };
    let mut ends = Vec::with_capacity(n);
    for (k, (spec, out)) in specs.into_iter().zip(&outs).enumerate() {
        if cancel::asked() {
            ends.push(End::Cancelled);
            break;
        }
        let one = spec.map_err(Report::from).and_then(|spec| {
            let line = Line::new(&spec.name, k, n);
            let outcome = resolve_outfit::run(&spec, out, options, &line)?;
            drop(line);
            announce::outcome(&spec, out, outcome, style)
        });
        ends.push(match one {
            Ok(end) => end,
            Err(error) => {
                announce::failure(&args.input.files[k].display().to_string(), &error, style)?
            }
        });
    }
    if style == Style::Line {
        print(&summary(&ends, n, start.elapsed().as_secs_f64()))?;
    }
    Ok(ends.into_iter().max().unwrap_or(End::Clean))
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
    let folders: Vec<PathBuf> =
        files.iter().map(|f| parent.join(f.file_stem().unwrap_or(f.as_os_str()))).collect();
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

fn summary(ends: &[End], outfits: usize, seconds: f64) -> String {
    let of = |end: End| ends.iter().filter(|e| **e == end).count();
    let (clean, not_clean, unusable) = (of(End::Clean), of(End::NotClean), of(End::Unusable));
    let undone = outfits - clean - not_clean - unusable;
    format!(
        "{outfits} outfits: {clean} clean, {not_clean} with intersections left, {unusable} unusable, {undone} not done; \
         {seconds:.1} s\n"
    )
}
