//! `ifg fix`: outfits from files, resolved into folders.

use crate::batch_inputs::BatchInputs;
use crate::cancel;
use crate::end::End;
use crate::inputs::{InputArgs, Order, ParamArgs, PinchArg, given_twice};
use crate::order;
use crate::outfit_file::{OutfitSpec, SpecError, outfits};
use crate::output_error::OutputError;
use crate::outputs;
use crate::print::print;
use crate::progress::Line;
use crate::report_output::{self, Style};
use crate::resolve_outfit::{self, Options};
use crate::shard::Shard;
use crate::shared_body::SharedBody;
use crate::table::counted;
use clap::Args;
use if_mesh::atomic::FileSet;
use miette::Report;
use std::collections::HashMap;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Args, Debug, Clone)]
pub(crate) struct FixArgs {
    #[command(flatten)]
    pub(crate) input: InputArgs,
    #[command(flatten)]
    pub(crate) params: ParamArgs,
    /// What happens where the body meets itself or leaves no room for the cloth between, as in the
    /// armpits and the groin of a posed body. By default as in the outfit file, or keep.
    #[arg(long, value_enum)]
    pub(crate) pinch: Option<PinchArg>,
    /// Output folder. Several outfits go into one folder each below it, named after their files.
    /// Default for outfit files: `out/NAME`; needed with --body.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Write each outfit into its own folder of --out, also a single one, and skip it if it is finished
    /// there: for parts of a list, as `xargs` and jobs of a cluster get them.
    #[arg(long, conflicts_with = "body")]
    pub(crate) each: bool,
    /// Allow outputs to replace the input files.
    #[arg(long)]
    pub(crate) in_place: bool,
    /// Write the result even if intersections remain (the exit code is 1 all the same).
    #[arg(long)]
    pub(crate) write_unproven: bool,
    /// In a batch, resolve finished outfits again.
    #[arg(long)]
    pub(crate) again: bool,
    /// Resolve only every N-th outfit, beginning with the I-th: one part of a list for each of N
    /// machines.
    #[arg(long, value_name = "I/N", conflicts_with = "body")]
    pub(crate) shard: Option<Shard>,
    /// Do not draw before.png and after.png, nor write report.html.
    #[arg(long)]
    pub(crate) no_pictures: bool,
    /// Print where the time went: a tree of phases, also in receipt.json.
    #[arg(long)]
    pub(crate) timings: bool,
}

/// Runs the command. The error of one outfit is shown, and does not stop the others.
pub(crate) fn run(args: &FixArgs) -> Result<End, Report> {
    let start = Instant::now();
    let outs = out_folders(args)?;
    let is_batch = args.each || outs.len() > 1;
    let all: Vec<_> =
        outfits(&args.input, &args.params).into_iter().zip(outs).enumerate().collect();
    let read = all.iter().filter_map(|(k, (spec, _))| Some((*k, spec.as_ref().ok()?)));
    let inputs = BatchInputs::of(read);
    let mut chosen = if let Some(shard) = args.shard { shard.of(all) } else { all };
    let n = chosen.len();
    let style = if args.input.json {
        Style::Json
    } else if is_batch {
        Style::Line
    } else {
        Style::Tables
    };
    let options = Options {
        in_place: args.in_place,
        write_unproven: args.write_unproven,
        resume: is_batch && !args.again,
        pictures: !args.no_pictures,
        phases: args.timings,
    };
    if options.resume {
        // One at which an earlier run was killed, as for want of memory, may be so again: the others
        // come before it.
        chosen.sort_by_key(|(_, (_, out))| FileSet::is_begun(out));
    }
    let mut ends = Vec::with_capacity(n);
    let specs = chosen.iter().filter_map(|(_, (spec, _))| spec.as_ref().ok());
    let mut bodies = SharedBody::of(specs);
    for (done, (k, (spec, out))) in chosen.into_iter().enumerate() {
        if cancel::is_requested() {
            ends.push(End::Cancelled);
            break;
        }
        let name = report_output::name(&spec, &args.input.files[k]);
        let one = spec.map_err(Report::from).and_then(|spec| {
            let line = Line::new(&spec.name, done, n);
            let spec = with_pinch(spec, args)?;
            let spec = match args.input.order {
                Order::Given => spec,
                Order::Auto => order::ordered(&spec)?,
            };
            let names = outputs::names(&spec, options.pictures);
            inputs.check(k, &out, &outputs::possible(&spec, &names))?;
            let outcome = resolve_outfit::run(&spec, &out, options, (&mut bodies, &line))?;
            drop(line);
            report_output::outcome(&spec, &out, outcome, (style, args.input.strict))
        });
        ends.push(match one {
            Ok(end) => end,
            Err(error) => report_output::failure(&name, &error, style)?,
        });
    }
    if style == Style::Line {
        print(&summary(&ends, n, start.elapsed().as_secs_f64()))?;
    }
    Ok(ends.into_iter().max().unwrap_or(End::Clean))
}

fn with_pinch(mut spec: OutfitSpec, args: &FixArgs) -> Result<OutfitSpec, SpecError> {
    if let Some(pinch) = args.pinch {
        if let Some(name) = given_twice(&args.params.set, &["pinch"]) {
            return Err(SpecError::Twice { name: name.to_owned() });
        }
        spec.params.goal.pinch = pinch.into();
    }
    Ok(spec)
}

/// Where each outfit goes: `--out` for one, a folder in it for each of several, or with --each.
fn out_folders(args: &FixArgs) -> Result<Vec<PathBuf>, OutputError> {
    let files = &args.input.files;
    if args.input.body.is_some() {
        return Ok(vec![args.out.clone().ok_or(OutputError::NoFolder)?]);
    }
    if let ([_], Some(out), false) = (&files[..], &args.out, args.each) {
        return Ok(vec![out.clone()]);
    }
    let parent = args.out.clone().unwrap_or_else(|| "out".into());
    let folders: Vec<PathBuf> =
        files.iter().map(|f| parent.join(f.file_stem().unwrap_or(f.as_os_str()))).collect();
    let mut seen = HashMap::new();
    for (k, folder) in folders.iter().enumerate() {
        if let Some(first) = seen.insert(folder.to_string_lossy().to_lowercase(), k) {
            return Err(OutputError::SameName {
                first: files[first].display().to_string(),
                second: files[k].display().to_string(),
                name: folder.display().to_string(),
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
        "{}: {clean} clean, {not_clean} not clean, {unusable} unusable, {undone} not done; \
         {seconds:.1} s\n",
        counted(outfits, "outfit")
    )
}
