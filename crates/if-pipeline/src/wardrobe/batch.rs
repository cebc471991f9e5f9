//! Many combinations: several at once, each written once, going on where a killed run stopped.
//!
//! ```text
//! OUT/
//!   results/KEY/                one folder a combination: super::matching
//!   summary.json                states and figures, in the order of the list: the same bytes in each run
//!   summary.csv, report.html    the same with seconds
//! ```

use super::combination::Combination;
use super::dresser::Dresser;
use super::matching::{
    self, Fault, MatchParams, MatchResult, State, finished, folder_name, request, run_into,
};
use super::{WardrobeError, pages};
use if_core::monitor::Progress;
use if_mesh::atomic;
use if_mesh::whole_folder::Writer;
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::fmt::Write as _;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

const RESULTS: &str = "results";
const SUMMARY: &str = "summary.json";
const CSV: &str = "summary.csv";
const REPORT: &str = "report.html";

/// How a batch runs. None of it changes a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BatchParams {
    /// Combinations at once, each of which takes the memory of its meshes and fields: some 100 MiB.
    pub at_once: usize,
    /// Do again what is done.
    pub again: bool,
}

impl Default for BatchParams {
    fn default() -> Self {
        Self { at_once: 1, again: false }
    }
}

/// What happens during a batch. The index is that of the combination in the list.
#[derive(Debug)]
pub enum Event<'a> {
    /// A combination is being done.
    Working(usize, &'a Progress<'a>),
    /// One is done; true where it was before.
    Done(usize, &'a Entry, bool),
}

/// What became of a combination.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The combination.
    pub combination: Combination,
    /// How it ended.
    pub state: State,
    /// What was wrong.
    pub error: Option<Fault>,
    /// Its folder, below `results`; empty where it has none.
    pub folder: String,
    /// Intersecting pairs before and after.
    pub pairs: [usize; 2],
    /// Vertices on a wrong side before and after.
    pub inside: [usize; 2],
    /// The farthest that a vertex was moved by resolving, in metres.
    pub moved: f64,
    /// The most that an edge was strained by resolving.
    pub strain: f64,
    /// Seconds that it took; not in `summary.json`.
    #[serde(skip)]
    pub seconds: Option<f64>,
}

/// What became of a batch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BatchSummary {
    /// Without intersections.
    pub clean: usize,
    /// With some left.
    pub remaining: usize,
    /// With an error.
    pub failed: usize,
    /// In the order of the list.
    pub entries: Vec<Entry>,
}

impl std::fmt::Display for BatchSummary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { clean, remaining, failed, entries } = self;
        let share = 100.0 * *clean as f64 / entries.len().max(1) as f64;
        write!(
            f,
            "{} combinations: {clean} clean ({share:.1} %), {remaining} with intersections left, {failed} failed",
            entries.len()
        )
    }
}

/// Does all combinations, and writes `summary.json`, `summary.csv` and `report.html` when the last
/// is done. An error of one is recorded, and does not stop the others. Nothing comes back where it
/// was cancelled: what is done stays, and the next run goes on from there.
///
/// # Errors
///
/// Parameters out of range, another process that writes into `out`, or what the system says about
/// it: a disk that is full stops all.
pub fn run(
    out: &Path,
    dresser: &Dresser,
    combinations: &[Combination],
    params: &MatchParams,
    batch: &BatchParams,
    watch: &(dyn Fn(&Event) -> ControlFlow<()> + Sync),
) -> Result<Option<BatchSummary>, WardrobeError> {
    params.validate()?;
    let path = out.join(RESULTS);
    let opened = Writer::open(&path)
        .map_err(|source| WardrobeError::Folder { path: path.clone(), source })?;
    let results = opened.ok_or(WardrobeError::Busy { path })?;
    let next = AtomicUsize::new(0);
    let cancelled = AtomicBool::new(false);
    let stopped: Mutex<Option<WardrobeError>> = Mutex::new(None);
    let entries: Mutex<Vec<Option<Entry>>> = Mutex::new(vec![None; combinations.len()]);
    let work = || {
        while !cancelled.load(Ordering::SeqCst) {
            let index = next.fetch_add(1, Ordering::SeqCst);
            let Some(combination) = combinations.get(index) else { break };
            let mut monitor = |progress: &Progress<'_>| {
                if cancelled.load(Ordering::SeqCst)
                    || watch(&Event::Working(index, progress)).is_break()
                {
                    cancelled.store(true, Ordering::SeqCst);
                    return ControlFlow::Break(());
                }
                ControlFlow::Continue(())
            };
            let one =
                || run_into(&results, dresser, combination, params, batch.again, &mut monitor);
            let outcome = catch_unwind(AssertUnwindSafe(one)).unwrap_or_else(|panic| {
                Err(WardrobeError::Panic { message: said(panic.as_ref()) })
            });
            let (entry, before) = match outcome {
                Ok((result, before)) => (entry(&result, results.parent()), before),
                Err(WardrobeError::Cancelled(_)) => {
                    cancelled.store(true, Ordering::SeqCst);
                    break;
                }
                Err(error) if error.is_passing() => {
                    *stopped.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    cancelled.store(true, Ordering::SeqCst);
                    break;
                }
                Err(error) => (failure(combination, &error), false),
            };
            if watch(&Event::Done(index, &entry, before)).is_break() {
                cancelled.store(true, Ordering::SeqCst);
            }
            entries.lock().unwrap_or_else(PoisonError::into_inner)[index] = Some(entry);
        }
    };
    let at_once = batch.at_once.min(combinations.len());
    if at_once <= 1 {
        work();
    } else {
        std::thread::scope(|scope| (0..at_once).for_each(|_| drop(scope.spawn(work))));
    }
    if let Some(error) = stopped.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(error);
    }
    let entries = entries.into_inner().unwrap_or_else(PoisonError::into_inner);
    let Some(entries) = entries.into_iter().collect::<Option<Vec<Entry>>>() else {
        return Ok(None);
    };
    let count = |state| entries.iter().filter(|e| e.state == state).count();
    let summary = BatchSummary {
        clean: count(State::Clean),
        remaining: count(State::Remaining),
        failed: count(State::Failed),
        entries,
    };
    write_summary(out, &summary)?;
    Ok(Some(summary))
}

/// How many of the combinations are done.
///
/// # Errors
///
/// A body or garment that the wardrobe does not have.
pub fn done(
    out: &Path,
    dresser: &Dresser,
    combinations: &[Combination],
    params: &MatchParams,
) -> Result<usize, WardrobeError> {
    let mut count = 0;
    for combination in combinations {
        let (key, _) = request(dresser.wardrobe(), combination, params)?;
        count += usize::from(finished(&out.join(RESULTS).join(folder_name(&key)), &key).is_some());
    }
    Ok(count)
}

fn entry(result: &MatchResult, results: &Path) -> Entry {
    let folder = folder_name(&result.key).to_owned();
    let report = result.report.as_ref();
    let largest = |of: fn(&if_outfit::report::LayerReport) -> f64| {
        report.map_or(0.0, |r| r.layers.iter().map(of).fold(0.0, f64::max))
    };
    Entry {
        combination: result.combination.clone(),
        state: result.state,
        error: result.error.clone(),
        pairs: report.map_or([0; 2], |r| [r.before.total_pairs(), r.after.total_pairs()]),
        inside: report.map_or([0; 2], |r| [r.before.total_inside(), r.after.total_inside()]),
        moved: largest(|l| l.moved.max),
        strain: largest(|l| l.strain.max),
        seconds: matching::timings(&results.join(&folder)).map(|t| t.total),
        folder,
    }
}

fn failure(combination: &Combination, error: &WardrobeError) -> Entry {
    Entry {
        combination: combination.clone(),
        state: State::Failed,
        error: Some(Fault { kind: error.kind().into(), message: error.to_string() }),
        folder: String::new(),
        pairs: [0; 2],
        inside: [0; 2],
        moved: 0.0,
        strain: 0.0,
        seconds: None,
    }
}

/// What a panic said.
fn said(panic: &(dyn Any + Send)) -> String {
    let text = panic
        .downcast_ref::<&str>()
        .map(ToString::to_string)
        .or_else(|| panic.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "it did not say why".into())
}

/// A field of a table, in quotes where it needs them (RFC 4180): names that no garment has may hold
/// anything.
fn csv_field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

fn write_summary(out: &Path, summary: &BatchSummary) -> Result<(), WardrobeError> {
    let write = |name: &str, bytes: &[u8]| {
        let path = out.join(name);
        atomic::write(&path, |file| file.write_all(bytes))
            .map_err(|source| WardrobeError::Folder { path, source })
    };
    let mut json = serde_json::to_vec_pretty(summary)
        .map_err(|e| WardrobeError::Json { message: e.to_string() })?;
    json.push(b'\n');
    write(SUMMARY, &json)?;
    let mut csv = String::from(
        "combination,state,error,pairs_before,pairs_after,inside_before,inside_after,moved_max_mm,strain_max_percent,seconds,folder\n",
    );
    for e in &summary.entries {
        let error = e.error.as_ref().map_or("", |f| f.kind.as_str());
        let seconds = e.seconds.map_or(String::new(), |s| format!("{s:.3}"));
        let state = format!("{:?}", e.state).to_lowercase();
        let ([p0, p1], [i0, i1]) = (e.pairs, e.inside);
        let (moved, strain) = (e.moved * 1e3, e.strain * 1e2);
        let combination = csv_field(&e.combination.to_string());
        // Writing to a string cannot fail.
        let _ = writeln!(
            csv,
            "{combination},{state},{error},{p0},{p1},{i0},{i1},{moved:.2},{strain:.2},{seconds},{}",
            e.folder
        );
    }
    write(CSV, csv.as_bytes())?;
    let picture =
        |entry: &Entry| std::fs::read(out.join(RESULTS).join(&entry.folder).join("after.png")).ok();
    write(REPORT, pages::batch(summary, picture).as_bytes())
}
