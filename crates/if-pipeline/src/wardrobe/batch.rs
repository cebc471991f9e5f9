//! Batches: many combinations, in parallel, each written once; a stopped run can be resumed.
//!
//! ```text
//! OUT/
//!   results/KEY/                one folder a combination: super::matching
//!   shards/NAME/                the same for a part of the list, done by another process
//!   summary.json                states and figures, in the order of the list: the same bytes in each run
//!   summary.csv, report.html    the same with seconds
//! ```

use super::begun;
use super::combination::Combination;
use super::dresser::Dresser;
use super::error::WardrobeError;
use super::matching::{check, finished, is_finished, request, run_into};
use super::pages;
use super::result::{MatchParams, State};
use super::result_folder::{folder_name, is_result, read_timings};
pub use super::summary::{BatchSummary, Entry};
use if_core::monitor::Progress;
use if_mesh::atomic;
use if_mesh::atomic::FolderWriter;
use std::any::Any;
use std::fmt::Write as _;
use std::fs;
use std::io::{self, Write as _};
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

const RESULTS: &str = "results";
const SHARDS: &str = "shards";
const SUMMARY: &str = "summary.json";
const CSV: &str = "summary.csv";
const REPORT: &str = "report.html";

/// Parameters of a batch. They do not change results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BatchParams {
    /// Combinations in parallel. Each needs memory for its meshes and fields: about 100 MiB.
    pub at_once: usize,
    /// Repeat finished combinations.
    pub again: bool,
}

impl Default for BatchParams {
    fn default() -> Self {
        Self { at_once: 1, again: false }
    }
}

/// An event of a batch. The index is that of the combination in the list.
#[derive(Debug)]
pub enum Event<'a> {
    /// Progress of a combination.
    Working(usize, &'a Progress<'a>),
    /// A combination is finished; `true` if it already was.
    Done(usize, &'a Entry, bool),
}

/// Resolves all combinations, then writes `summary.json`, `summary.csv` and `report.html`. Errors of
/// single combinations are recorded and do not stop the others. `None` if cancelled: finished results
/// stay, and the next run continues.
///
/// A list may be done in parts, by several processes at once, each with a [`shard_folder`] for its
/// `out`. A run of the whole list then takes their results: the same files as by one process.
///
/// # Errors
///
/// Parameters out of range, another process that writes into `out`, or files that cannot be written:
/// a full disk stops the batch.
pub fn run(
    out: &Path,
    dresser: &Dresser,
    combinations: &[Combination],
    params: &MatchParams,
    batch: &BatchParams,
    watch: &(dyn Fn(&Event) -> ControlFlow<()> + Sync),
) -> Result<Option<BatchSummary>, WardrobeError> {
    check(dresser, params)?;
    dresser.wardrobe().keep_out(out)?;
    let path = out.join(RESULTS);
    let opened = FolderWriter::open(&path)
        .map_err(|source| WardrobeError::Folder { path: path.clone(), source })?;
    let results = opened.ok_or(WardrobeError::Busy { path })?;
    collect(out, &results)?;
    let whole = whole_of(out);
    let order = begun::order(out, combinations);
    let next = AtomicUsize::new(0);
    let cancelled = AtomicBool::new(false);
    let stopped: Mutex<Option<WardrobeError>> = Mutex::new(None);
    let entries: Mutex<Vec<Option<Entry>>> = Mutex::new(vec![None; combinations.len()]);
    let work = || {
        while !cancelled.load(Ordering::SeqCst) {
            let next = next.fetch_add(1, Ordering::SeqCst);
            let Some(index) = order.get(next).copied() else { break };
            let combination = &combinations[index];
            let mut monitor = |progress: &Progress<'_>| {
                if cancelled.load(Ordering::SeqCst)
                    || watch(&Event::Working(index, progress)).is_break()
                {
                    cancelled.store(true, Ordering::SeqCst);
                    return ControlFlow::Break(());
                }
                ControlFlow::Continue(())
            };
            let into = (out, &results, whole.as_deref());
            let one = || run_into(into, dresser, combination, params, batch.again, &mut monitor);
            let outcome = catch_unwind(AssertUnwindSafe(one)).unwrap_or_else(|panic| {
                Err(WardrobeError::Panic { message: panic_message(panic.as_ref()) })
            });
            let (entry, before) = match outcome {
                Ok((result, before)) => {
                    let folder = folder_name(&result.key).to_owned();
                    let timings = places(out).find_map(|place| read_timings(&place.join(&folder)));
                    (Entry::of(&result, folder, timings.map(|t| t.total)), before)
                }
                Err(WardrobeError::Cancelled(_)) => {
                    cancelled.store(true, Ordering::SeqCst);
                    break;
                }
                Err(error) if error.is_passing() => {
                    *stopped.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    cancelled.store(true, Ordering::SeqCst);
                    break;
                }
                Err(error) => (Entry::failure(combination, &error), false),
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
        // Pools of their own, within the caller's number of threads: forked processes have no global one.
        let share = rayon::current_num_threads().div_ceil(at_once);
        let pool = |_| rayon::ThreadPoolBuilder::new().num_threads(share).build();
        let pools: Vec<_> =
            (0..at_once).map(pool).collect::<Result<_, _>>().map_err(io::Error::other)?;
        let work = &work;
        std::thread::scope(|scope| {
            for pool in &pools {
                scope.spawn(move || pool.install(work));
            }
        });
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
    begun::clear(out);
    Ok(Some(summary))
}

/// Where a part of a batch into `out` is done. `name` is a name for a folder, different for each
/// part.
pub fn shard_folder(out: &Path, name: &str) -> PathBuf {
    out.join(SHARDS).join(name)
}

/// The results of the whole, if `out` is the folder of a part: what is done there need not be done again.
fn whole_of(out: &Path) -> Option<PathBuf> {
    let shards = out.parent().filter(|shards| shards.file_name() == Some(SHARDS.as_ref()))?;
    Some(shards.parent()?.join(RESULTS))
}

/// Where results may be: of this folder, and of the whole that it is a part of.
fn places(out: &Path) -> impl Iterator<Item = PathBuf> {
    std::iter::once(out.join(RESULTS)).chain(whole_of(out))
}

/// Moves the results of all parts to those of the whole. A finished result that is there already stays.
fn collect(out: &Path, results: &FolderWriter) -> Result<(), WardrobeError> {
    let fault = |path: &Path| {
        let path = path.to_path_buf();
        move |source| WardrobeError::Folder { path, source }
    };
    let shards = out.join(SHARDS);
    let names = atomic::names(&shards).map_err(fault(&shards))?;
    for shard in names.iter().map(|name| shards.join(name)) {
        let path = shard.join(RESULTS);
        if !path.is_dir() && !shard.join(SUMMARY).is_file() {
            continue; // not a part
        }
        let opened = FolderWriter::open(&path).map_err(fault(&path))?;
        let part = opened.ok_or_else(|| WardrobeError::Busy { path: path.clone() })?;
        for name in part.names().map_err(fault(&path))? {
            if !is_result(&path.join(&name)) {
                continue;
            }
            let target = results.parent().join(&name);
            let is_there = fs::symlink_metadata(&target).is_ok();
            if is_there && (is_finished(&target) || !is_finished(&path.join(&name))) {
                fs::remove_dir_all(path.join(&name)).map_err(fault(&path))?;
                continue;
            }
            if is_there {
                fs::remove_dir_all(&target).map_err(fault(&target))?;
            }
            fs::rename(path.join(&name), &target).map_err(fault(&target))?;
        }
        for own in [SUMMARY, CSV, REPORT] {
            let _ = fs::remove_file(shard.join(own)); // many are not there
        }
        drop(part);
        // Folders that hold anything of the user's stay.
        let _ = fs::remove_dir(&path);
        let _ = fs::remove_dir(&shard);
    }
    if !names.is_empty() {
        let _ = fs::remove_dir(&shards); // another part may have begun
    }
    Ok(())
}

/// The number of finished combinations.
///
/// # Errors
///
/// The wardrobe does not have a body or garment.
pub fn done(
    out: &Path,
    dresser: &Dresser,
    combinations: &[Combination],
    params: &MatchParams,
) -> Result<usize, WardrobeError> {
    let mut count = 0;
    for combination in combinations {
        let (key, _) = request(dresser, combination, params)?;
        let is_done = |place: PathBuf| finished(&place.join(folder_name(&key)), &key).is_some();
        count += usize::from(places(out).any(is_done));
    }
    Ok(count)
}

/// The message of a panic.
fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic
        .downcast_ref::<&str>()
        .map(ToString::to_string)
        .or_else(|| panic.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "no message".into())
}

/// A field of a CSV file, quoted if necessary (RFC 4180): invalid names may contain anything.
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
        atomic::write_file(&path, |file| file.write_all(bytes))
            .map_err(|source| WardrobeError::Folder { path, source })
    };
    let mut json = serde_json::to_vec_pretty(summary)
        .map_err(|e| WardrobeError::Json { message: e.to_string() })?;
    json.push(b'\n');
    write(SUMMARY, &json)?;
    let mut csv = String::from(
        "combination,state,error,pairs_before,pairs_after,inside_before,inside_after,own_pairs_at_rest,own_pairs_after,everywhere,alignment_strain_p99_percent,moved_max_mm,strain_max_percent,seconds,folder\n",
    );
    for e in &summary.entries {
        let error = e.error.as_ref().map_or("", |f| f.kind.as_str());
        let seconds = e.seconds.map_or(String::new(), |s| format!("{s:.3}"));
        let state = format!("{:?}", e.state).to_lowercase();
        let ([p0, p1], [i0, i1], [o0, o1]) = (e.pairs, e.inside, e.own_pairs);
        let (aligned, moved, strain) = (e.alignment_strain * 1e2, e.moved * 1e3, e.strain * 1e2);
        let combination = csv_field(&e.combination.to_string());
        // Writing to a string cannot fail.
        let _ = writeln!(
            csv,
            "{combination},{state},{error},{p0},{p1},{i0},{i1},{o0},{o1},{},{aligned:.2},{moved:.2},{strain:.2},{seconds},{}",
            e.everywhere, e.folder
        );
    }
    write(CSV, csv.as_bytes())?;
    let picture = |entry: &Entry| {
        places(out).find_map(|place| fs::read(place.join(&entry.folder).join("after.png")).ok())
    };
    write(REPORT, pages::batch(summary, picture).as_bytes())
}
