//! Long work, without the interpreter's lock, and with Ctrl-C.
//!
//! ```text
//! calling thread                        threads of the work
//!   waits without the lock     ◄──────   progress, if a callback listens
//!   every POLL: signals
//!   callback(progress)         ──────►   goes on, or is cancelled
//!   returns                    ◄──────   result
//! ```
//!
//! The work never touches the interpreter. After Ctrl-C or an exception of the callback it is
//! cancelled; if it does not end within [`GRACE`], because it is between two reports, it ends later
//! by itself, and its result is dropped.

use if_core::math::Real;
use if_core::monitor::{Cancelled, Monitor, Progress};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Time between two looks for signals.
const POLL: Duration = Duration::from_millis(50);
/// How long a cancelled call waits for its work to end.
const GRACE: Duration = Duration::from_millis(150);

/// What the work sends to the calling thread.
enum Message<T> {
    Progress(Report),
    Done(thread::Result<T>),
}

/// An owned [`Progress`].
struct Report {
    stage: &'static str,
    item: String,
    done: usize,
    total: Option<usize>,
    measures: BTreeMap<&'static str, Real>,
}

/// Runs `work` on `threads` threads (all cores if `None`) and returns its result. `progress` is
/// called with stage, item, done, total and measures of each report.
///
/// The threads are those of this call alone: those of an earlier one would not exist in a forked
/// process.
///
/// # Errors
///
/// `KeyboardInterrupt`, the exception of `progress`, or threads that cannot be started.
///
/// # Panics
///
/// If the work panics.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&mut (dyn Monitor + Send)) -> T + Send + 'static,
) -> PyResult<T> {
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0)) // 0 is all cores
        .thread_name(|k| format!("ifgarments-{k}"))
        .build()
        .map_err(|e| PyRuntimeError::new_err(format!("cannot start threads: {e}")))?;
    let cancelled = Arc::new(AtomicBool::new(false));
    let (to_caller, mut messages) = channel();
    let (go_on, may_go_on) = channel();
    let listener = progress.is_some().then(|| (to_caller.clone(), may_go_on));
    let mut monitor = Remote { cancelled: Arc::clone(&cancelled), listener };
    pool.spawn(move || {
        let result = catch_unwind(AssertUnwindSafe(|| work(&mut monitor)));
        let _ = to_caller.send(Message::Done(result)); // Nobody waits for it after GRACE.
    });
    let interrupted = loop {
        let report = match receive(py, &mut messages, POLL) {
            Some(Message::Done(result)) => {
                return Ok(result.unwrap_or_else(|panic| resume_unwind(panic)));
            }
            Some(Message::Progress(report)) => Some(report),
            None => None,
        };
        if let Err(error) = py.check_signals() {
            break error;
        }
        let Some((report, callback)) = report.zip(progress) else { continue };
        let Report { stage, item, done, total, measures } = report;
        if let Err(error) = callback.call1((stage, item, done, total, measures)) {
            break error;
        }
        let _ = go_on.send(()); // The work has ended if nobody receives it.
    };
    cancelled.store(true, Ordering::Relaxed);
    drop(go_on);
    let end = Instant::now() + GRACE;
    while let Some(left) = end.checked_duration_since(Instant::now()) {
        if let Some(Message::Done(_)) = receive(py, &mut messages, left) {
            break;
        }
    }
    Err(interrupted)
}

/// The next message, if one comes in time.
fn receive<T: Send>(
    py: Python<'_>,
    messages: &mut Receiver<Message<T>>,
    time: Duration,
) -> Option<Message<T>> {
    match py.detach(move || messages.recv_timeout(time)) {
        Ok(message) => Some(message),
        Err(RecvTimeoutError::Timeout) => None,
        Err(RecvTimeoutError::Disconnected) => unreachable!("the last message is the result"),
    }
}

/// Reports to the calling thread.
struct Remote<T> {
    cancelled: Arc<AtomicBool>,
    /// Where progress goes, and the answers; `None` if there is no callback.
    listener: Option<(Sender<Message<T>>, Receiver<()>)>,
}

impl<T> Monitor for Remote<T> {
    fn report(&mut self, progress: &Progress<'_>) -> Result<(), Cancelled> {
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(Cancelled);
        }
        let Some((to_caller, may_go_on)) = &self.listener else { return Ok(()) };
        let report = Report {
            stage: progress.stage,
            item: progress.item.to_owned(),
            done: progress.done,
            total: progress.total,
            measures: progress.measures.iter().copied().collect(),
        };
        to_caller.send(Message::Progress(report)).map_err(|_| Cancelled)?;
        may_go_on.recv().map_err(|_| Cancelled)
    }
}
