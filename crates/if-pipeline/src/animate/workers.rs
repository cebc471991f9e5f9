//! Jobs on several threads, with progress and cancelling on the calling one.

use super::error::AnimateError;
use if_core::monitor::{Cancelled, Monitor, Progress};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Time between two questions whether to go on.
const ASKED: Duration = Duration::from_millis(50);

/// What a worker tells of its job, and whether it is to go on: a monitor of all that it calls.
pub(super) struct Ticket<'a> {
    stops: &'a AtomicBool,
    done: SyncSender<()>,
}

impl Ticket<'_> {
    /// Another frame is done. Waits until it is counted, so that who stops the jobs then gets no more than
    /// one frame of each that is under way.
    ///
    /// # Errors
    ///
    /// [`Cancelled`] if no more are to be done.
    pub(super) fn frame_is_done(&mut self) -> Result<(), Cancelled> {
        // The receiver lives as long as there are workers, unless a thread could not be started.
        let _ = self.done.send(());
        self.report(&Progress::stage("walk"))
    }
}

impl<'a> Ticket<'a> {
    /// Set when the work is to end.
    pub(super) fn stops(&self) -> &'a AtomicBool {
        self.stops
    }
}

impl Monitor for Ticket<'_> {
    fn report(&mut self, _: &Progress<'_>) -> Result<(), Cancelled> {
        if self.stops.load(Ordering::Relaxed) { Err(Cancelled) } else { Ok(()) }
    }
}

/// Does all `jobs`, at most so many at a time, on as many threads as the current pool has. Each worker has
/// its own pool, so that none waits for a task of another, nor for a thread that waits for it. `report`
/// receives how many frames are done, several times a second.
///
/// # Errors
///
/// That of the first job that failed, or that `report` cancels; the other jobs end early then.
pub(super) fn each<J: Send>(
    (jobs, at_a_time): (Vec<J>, usize),
    work: impl Fn(J, &mut Ticket<'_>) -> Result<(), AnimateError> + Sync,
    report: &mut dyn FnMut(usize) -> Result<(), Cancelled>,
) -> Result<(), AnimateError> {
    let threads = rayon::current_num_threads();
    let workers = threads.min(at_a_time).min(jobs.len());
    let stops = AtomicBool::new(false);
    let queue = Mutex::new(jobs.into_iter().enumerate().collect::<VecDeque<_>>());
    let failed = Mutex::new(None);
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
    let fail = |index: usize, error: AnimateError| {
        stops.store(true, Ordering::Relaxed);
        let mut first = failed.lock().unwrap_or_else(PoisonError::into_inner);
        // Others are cancelled because of it.
        let is_first = match &*first {
            None => true,
            Some((_, AnimateError::Cancelled(_))) => true,
            Some((known, _)) => index < *known && !matches!(error, AnimateError::Cancelled(_)),
        };
        if is_first {
            *first = Some((index, error));
        }
    };
    let (done, frames) = sync_channel(0);
    let unstarted = |source| {
        stops.store(true, Ordering::Relaxed);
        AnimateError::Threads { source }
    };
    std::thread::scope(|scope| {
        // Ends with this block: nobody waits for a receiver that does not listen.
        let frames = frames;
        for worker in 0..workers {
            // What is over goes to the first ones.
            let share = threads / workers + usize::from(worker < threads % workers);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(share).build();
            let pool = pool.map_err(|e| unstarted(std::io::Error::other(e)))?;
            let mut ticket = Ticket { stops: &stops, done: done.clone() };
            let (next, fail, work) = (&next, &fail, &work);
            let run = move || {
                while let Some((index, job)) = next() {
                    if let Err(error) = pool.install(|| work(job, &mut ticket)) {
                        fail(index, error);
                        break;
                    }
                }
            };
            std::thread::Builder::new().spawn_scoped(scope, run).map_err(unstarted)?;
        }
        drop(done);
        let mut count = 0;
        loop {
            match frames.recv_timeout(ASKED) {
                Ok(()) => count += 1,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok::<_, AnimateError>(()),
            }
            if report(count).is_err() {
                fail(usize::MAX, Cancelled.into());
            }
        }
    })?;
    match failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some((_, error)) => Err(error),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
    }

    #[test]
    fn every_job_is_done_once_on_any_number_of_threads() {
        for threads in [1, 2, 5] {
            let done = Mutex::new(Vec::new());
            let mut most = 0;
            in_pool(threads, || {
                let work = |job: usize, ticket: &mut Ticket<'_>| {
                    // A worker's own tasks do not need the pool that waits.
                    let (a, b) = rayon::join(|| job, || 10 * job);
                    done.lock().unwrap().push(a + b);
                    Ok(ticket.frame_is_done()?)
                };
                each(((0..7).collect(), 4), work, &mut |count| {
                    most = most.max(count);
                    Ok(())
                })
                .unwrap();
            });
            let mut done = done.into_inner().unwrap();
            done.sort_unstable();
            assert_eq!((done, most), ((0..7).map(|job| 11 * job).collect(), 7));
        }
        each((Vec::<()>::new(), 1), |(), _| unreachable!("no jobs"), &mut |_| Ok(())).unwrap();
    }

    #[test]
    fn the_first_error_wins_and_stops_the_others() {
        let work = |job: usize, ticket: &mut Ticket<'_>| {
            if job == 1 {
                return Err(AnimateError::Changed { path: PathBuf::from("a") });
            }
            loop {
                ticket.frame_is_done()?;
            }
        };
        let failed = in_pool(2, || each((vec![0, 1, 2], 9), work, &mut |_| Ok(())));
        assert!(matches!(failed, Err(AnimateError::Changed { .. })), "{failed:?}");
        let mut stop = |count| if count > 3 { Err(Cancelled) } else { Ok(()) };
        let endless = |_: usize, ticket: &mut Ticket<'_>| loop {
            ticket.frame_is_done()?;
        };
        let stopped = in_pool(2, || each((vec![0, 2], 9), endless, &mut stop));
        assert!(matches!(stopped, Err(AnimateError::Cancelled(_))), "{stopped:?}");
    }
}
