//! `ifg wardrobe batch`.

use super::opening::{Fault, open, report};
use super::results::{FieldsArg, end_of, match_params};
use crate::cancel;
use crate::end::End;
use crate::errors::{ErrorChain, note};
use crate::inputs::ParamArgs;
use crate::print::{print, print_json};
use crate::progress;
use crate::shard::Shard;
use clap::{ArgGroup, Args};
use if_body::AlignParams;
use if_mesh::regular_file;
use if_pipeline::wardrobe::batch::{self, BatchParams, Event, shard_folder};
use if_pipeline::wardrobe::combination::{Combination, Combinations, Order, RandomParams, random};
use if_pipeline::wardrobe::dresser::Dresser;
use if_pipeline::wardrobe::matching::MatchParams;
use if_pipeline::wardrobe::{Wardrobe, WardrobeError};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{Diagnostic, Report};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

#[derive(Args, Debug)]
#[command(group(ArgGroup::new("combinations").required(true).args(["list", "random"])))]
pub(crate) struct BatchArgs {
    /// The wardrobe's folder.
    #[arg(value_name = "WARDROBE")]
    pub(crate) root: PathBuf,
    /// Output folder; what is done there already is taken.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// A list of combinations (.toml or .json).
    #[arg(long, value_name = "FILE")]
    pub(crate) list: Option<PathBuf>,
    /// Draw this many combinations.
    #[arg(long, value_name = "N")]
    pub(crate) random: Option<usize>,
    /// For --random: the same seed draws the same.
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "list")]
    pub(crate) seed: u64,
    /// For --random: garments at least.
    #[arg(long, value_name = "N", default_value_t = 2, conflicts_with = "list")]
    pub(crate) least: usize,
    /// For --random: garments at most.
    #[arg(long, value_name = "N", default_value_t = 4, conflicts_with = "list")]
    pub(crate) most: usize,
    /// For --random: any order and any garments, also a coat below a T-shirt.
    #[arg(long, conflicts_with = "list")]
    pub(crate) any_order: bool,
    /// For --random: bodies, which take turns; all by default.
    #[arg(long, value_name = "NAME", conflicts_with = "list")]
    pub(crate) body: Vec<String>,
    #[command(flatten)]
    pub(crate) params: ParamArgs,
    /// What `--method paper` reads of the garments below the one that it settles.
    #[arg(long, value_enum)]
    pub(super) fields: Option<FieldsArg>,
    /// Combinations done at once. More than one takes more memory, and pays where single steps do
    /// not fill all cores.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) at_once: u16,
    /// Do only every N-th combination, beginning with the I-th: one part of a list for each of N
    /// machines. The same command without --shard then collects what all parts did.
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,
    /// Exit with 1 unless all results are clean everywhere: no garment meets itself, nor does the body.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Do everything again.
    #[arg(long)]
    pub(crate) again: bool,
    /// Do not write meshes.
    #[arg(long)]
    pub(crate) no_meshes: bool,
    /// Do not draw.
    #[arg(long)]
    pub(crate) no_pictures: bool,
    /// Print one JSON line for each combination.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Pixels.
const PICTURE_HEIGHT: u32 = 400;

/// A list that is of no use.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("cannot read the list `{}`", path.display())]
#[diagnostic(
    code(ifg::wardrobe::list),
    help("write [[outfit]] with body = \"NAME\" and garments = [\"INNER\", \"OUTER\"] for each")
)]
struct ListError {
    path: PathBuf,
    source: ErrorChain,
}

/// Runs the command.
pub(super) fn run(args: &BatchArgs) -> Result<End, Report> {
    let start = Instant::now();
    let wardrobe = open(&args.root)?;
    let all = combinations(&wardrobe, args)?;
    let (combinations, out) = match args.shard {
        Some(shard) => (shard.of(all), shard_folder(&args.out, &shard.name())),
        None => (all, args.out.clone()),
    };
    let height = if args.no_pictures { 0 } else { PICTURE_HEIGHT };
    let params =
        MatchParams { meshes: !args.no_meshes, ..match_params(&args.params, args.fields, height)? };
    let dresser = Dresser::new(&wardrobe, AlignParams::default());
    let bar = progress(combinations.len());
    // Why a line could not be printed: the first of several done at once.
    let unprinted: Mutex<Option<Report>> = Mutex::new(None);
    let watch = |event: &Event| {
        match event {
            Event::Working(index, progress) => {
                bar.set_message(format!(
                    "{}: {} {}",
                    combinations[*index], progress.item, progress.stage
                ));
            }
            Event::Done(_, entry, before) => {
                let told = || match (args.json, before) {
                    (true, _) => print_json(entry),
                    (false, true) => Ok(()),
                    (false, false) => {
                        let error = entry
                            .error
                            .as_ref()
                            .map_or(String::new(), |e| format!(", {}", e.message));
                        let seconds = entry.seconds.unwrap_or(0.0);
                        print(&format!(
                            "{}: {:?}, {seconds:.2} s, {}{error}\n",
                            entry.combination, entry.state, entry.folder
                        ))
                    }
                };
                let printed = bar.suspend(told);
                bar.inc(1);
                if let Err(error) = printed {
                    unprinted.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
                    return ControlFlow::Break(());
                }
            }
        }
        if cancel::is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let batch = BatchParams { at_once: usize::from(args.at_once), again: args.again };
    let done = batch::run(&out, &dresser, &combinations, &params, &batch, &watch);
    bar.finish_and_clear();
    let done = done.map_err(|e| report(format!("cannot go on in `{}`", out.display()), e))?;
    if let Some(error) = unprinted.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(error);
    }
    let Some(summary) = done else {
        note("cancelled; what is done stays, and the same command goes on from there");
        return Ok(End::Cancelled);
    };
    if !args.json {
        let memory = peak_memory().map_or(String::new(), |mib| format!(", at most {mib:.0} MiB"));
        print(&format!(
            "{summary}; {:.1} s{memory}\n{}\n",
            start.elapsed().as_secs_f64(),
            out.join("report.html").display()
        ))?;
    }
    Ok(summary
        .entries
        .iter()
        .map(|e| end_of(e.state, e.everywhere, args.strict))
        .max()
        .unwrap_or(End::Clean))
}

fn combinations(wardrobe: &Wardrobe, args: &BatchArgs) -> Result<Vec<Combination>, Report> {
    if let Some(path) = &args.list {
        return Ok(read(path)?.outfit);
    }
    let params = RandomParams {
        count: args.random.unwrap_or(0),
        seed: args.seed,
        least: args.least,
        most: args.most,
        order: if args.any_order { Order::Any } else { Order::Worn },
        bodies: args.body.clone(),
    };
    Ok(random(wardrobe, &params).map_err(|e| Fault::new("cannot draw combinations", &e))?)
}

fn read(path: &Path) -> Result<Combinations, ListError> {
    let fault = |error: &dyn std::error::Error| ListError {
        path: path.into(),
        source: ErrorChain::new(error),
    };
    let text = regular_file::read_to_string(path).map_err(|e| fault(&e))?;
    let list: Combinations = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) {
        // Some editors begin files with a byte order mark.
        serde_json::from_str(text.trim_start_matches('\u{feff}')).map_err(|e| fault(&e))
    } else {
        toml::from_str(&text).map_err(|e| fault(&e))
    }?;
    for (k, outfit) in list.outfit.iter().enumerate() {
        outfit.check_names().map_err(|e| fault(&NameError { outfit: k + 1, source: e }))?;
    }
    Ok(list)
}

/// A name in a list that can be none.
#[derive(Debug, thiserror::Error)]
#[error("outfit {outfit}")]
struct NameError {
    /// From 1.
    outfit: usize,
    source: WardrobeError,
}

/// A bar on stderr, where that is a terminal.
fn progress(combinations: usize) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(combinations as u64), progress::target());
    let style =
        ProgressStyle::with_template("{spinner} {elapsed:>3} {pos}/{len}, {eta} left  {wide_msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

/// The most memory that this process held, in MiB, where the system tells.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<f64>().ok()? / 1024.0)
}
