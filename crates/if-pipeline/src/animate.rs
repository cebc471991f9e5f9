//! Outfits that follow motions, every frame proven.
//!
//! [`animate()`] takes a clean [`SkinnedOutfit`] and a [`Motion`] through all frames; [`follow()`] does
//! so for any [`Movement`], such as that of a body which is given in every frame. A run of frames begins
//! from the rest pose, each later one from the last clean state, carried by the skinning
//! ([`if_outfit::motion`]). A second pass smooths displacements over time, across runs too, and verifies
//! each frame exactly. Runs, and frames of the second pass, are computed side by side, on threads or, by
//! [`follow_part()`], on machines. All goes to a folder as it is done, so that what was stopped goes on
//! where it ended.

mod animator;
mod bound;
mod continuous;
mod error;
mod finisher;
mod frames;
mod jitter;
mod local;
mod measure;
mod movement;
mod outfit;
mod parts;
mod report;
mod smoother;
#[cfg(test)]
mod tests;
mod workers;

pub use animator::{AnimateParams, Animator};
pub use bound::BoundOutfit;
pub use continuous::{IntervalReport, NamedCrossing, between_frames};
pub use error::AnimateError;
pub use frames::Frames;
pub use if_outfit::report::{PinchReport, PinchedGarment};
pub use movement::Movement;
pub use outfit::{SkinFault, SkinnedOutfit};
pub use report::{AnimationReport, FrameReport, Spread};

use finisher::Finisher;
use if_body::Motion;
use if_core::monitor::{Cancelled, Monitor, Progress};
use jitter::with_jitter;
use parts::parts;
use smoother::{Smoother, window};
use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;
use workers::{Ticket, each};

/// All frames of a motion.
#[derive(Debug)]
pub struct Animation {
    /// A row for each frame, and what they have in common.
    pub report: AnimationReport,
    /// The positions of each frame.
    pub frames: Frames,
}

/// Folders within that of frames: of frames before smoothing, and of those that went to the mean of their
/// neighbours.
const WALKED: &str = "walked";
const MEANS: &str = "means";
/// Most vertices that workers hold together: some 10 GB.
const MOST_VERTICES: usize = 4_000_000;

/// Moves an outfit through all frames of a motion: [`follow()`] with its poses.
///
/// # Errors
///
/// As [`follow()`].
pub fn animate(
    outfit: &SkinnedOutfit,
    motion: &Motion,
    params: &AnimateParams,
    folder: &Path,
    monitor: &mut dyn Monitor,
) -> Result<Animation, AnimateError> {
    follow(Movement::poses(outfit, motion), params, folder, monitor)
}

/// Moves an outfit through all frames of a movement, and keeps them in `folder`, which is created.
///
/// Frames that `folder` holds from the same outfit, movement and parameters, by digest, are kept; the
/// others follow with the same bits as in one run, and on any number of threads. `monitor` receives the
/// stages `"walked"` and `"averaged"`, in which frames are walked to and go to the mean of their neighbours,
/// `"frame"`, in which they are finished and verified, and `"measured"`, all with the measure
/// `"seconds_left"` from the second frame on.
///
/// A frame that cannot be made clean is no error: its row says so, and it holds the last clean state
/// carried to its pose.
///
/// # Errors
///
/// [`AnimateError`]: an outfit that is not clean, parameters out of range, a folder that cannot be
/// written, or the monitor cancelled.
pub fn follow(
    movement: Movement<'_>,
    params: &AnimateParams,
    folder: &Path,
    monitor: &mut dyn Monitor,
) -> Result<Animation, AnimateError> {
    let start = Instant::now();
    let work = Work::open(movement, params, folder)?;
    let new = work.frames(0..movement.frames(), monitor)?;
    let working = start.elapsed().as_secs_f64();
    let rows = work.rows(monitor)?;
    for frame in 0..movement.frames() {
        work.walked.remove(frame)?;
        work.means.remove(frame)?;
    }
    let frames = work.finished.with_rows(rows);
    let kept = frames.len() - new;
    let seconds = (working / new.max(1) as f64, start.elapsed().as_secs_f64());
    let report = AnimationReport::new(frames.rows(), movement.frames_per_second(), kept, seconds);
    Ok(Animation { report, frames })
}

/// The frames `part` of a movement alone, in `folder`: what one of several machines does of a long motion.
/// [`follow()`] keeps them, once the folder holds those of all machines. Returns how many were not there
/// yet.
///
/// # Errors
///
/// As [`follow()`].
///
/// # Panics
///
/// If the movement has fewer frames.
pub fn follow_part(
    movement: Movement<'_>,
    params: &AnimateParams,
    part: Range<usize>,
    folder: &Path,
    monitor: &mut dyn Monitor,
) -> Result<usize, AnimateError> {
    assert!(part.end <= movement.frames(), "{part:?} of {} frames", movement.frames());
    Work::open(movement, params, folder)?.frames(part, monitor)
}

/// What there is to do for frames, and their files.
struct Work<'a> {
    movement: Movement<'a>,
    params: AnimateParams,
    /// Before the first frame.
    animator: Animator<'a>,
    walked: Frames,
    means: Frames,
    finished: Frames,
    /// Frames to each side over which displacements are smoothed.
    radius: usize,
}

impl<'a> Work<'a> {
    fn open(
        movement: Movement<'a>,
        params: &AnimateParams,
        folder: &Path,
    ) -> Result<Self, AnimateError> {
        let animator = Animator::new(movement, *params)?;
        let finished = Frames::open(folder, movement, params)?;
        let walked = Frames::open(&folder.join(WALKED), movement, params)?;
        let means = Frames::open(&folder.join(MEANS), movement, params)?;
        let radius = params.smoothed_frames(movement.frames_per_second());
        Ok(Self { movement, params: *params, animator, walked, means, finished, radius })
    }

    /// Computes those of some frames that are not there yet, and returns how many.
    fn frames(&self, part: Range<usize>, monitor: &mut dyn Monitor) -> Result<usize, AnimateError> {
        let missing: Vec<usize> =
            part.clone().filter(|frame| self.finished.stored(*frame).is_none()).collect();
        let means = if self.radius > 0 { self.near(&missing) } else { Vec::new() };
        let is_new = |frame: &usize| self.means.stored(*frame).is_none();
        let averaged: Vec<usize> = means.iter().copied().filter(is_new).collect();
        let walks = self.walks(&self.near(&self.near(&missing)));
        let workers = self.workers();
        let walk = |run, ticket: &mut Ticket<'_>| self.walk(run, ticket);
        let walking = walks.iter().map(Range::len).sum();
        each((walks, workers), walk, &mut counted(monitor, "walked", (0, walking)))?;
        let average = |frames: Vec<usize>, ticket: &mut Ticket<'_>| self.average(&frames, ticket);
        let before = means.len() - averaged.len();
        let mut report = counted(monitor, "averaged", (before, means.len()));
        each((parts(&averaged, workers), workers), average, &mut report)?;
        drop(report);
        let finish = |frames: Vec<usize>, ticket: &mut Ticket<'_>| self.finish(&frames, ticket);
        let mut report = counted(monitor, "frame", (part.len() - missing.len(), part.len()));
        each((parts(&missing, workers), workers), finish, &mut report)?;
        Ok(missing.len())
    }

    /// How many work at a time: each holds a walker and the frames over which it smooths.
    fn workers(&self) -> usize {
        let vertices = self.animator.walker().rest().len();
        rayon::current_num_threads().min(MOST_VERTICES / vertices.max(1)).max(1)
    }

    /// Some ascending frames and those around them over which displacements are smoothed.
    fn near(&self, frames: &[usize]) -> Vec<usize> {
        let mut near: Vec<usize> =
            frames.iter().flat_map(|k| window(self.movement, *k, self.radius)).collect();
        near.sort_unstable();
        near.dedup();
        near
    }

    /// What has to be walked to for `needed` frames, ascending: the rest of each run up to the last of them.
    fn walks(&self, needed: &[usize]) -> Vec<Range<usize>> {
        let rest = |run: Range<usize>| {
            let last = needed[..needed.partition_point(|k| *k < run.end)].last()?;
            let done = self.walked.state(run.start).map_or(run.start, |(frame, _)| frame + 1);
            let is_there = (run.start..done).all(|k| self.walked.stored(k).is_some());
            let first = if is_there { done } else { run.start };
            Some(first..last + 1).filter(|rest| *last >= run.start && !rest.is_empty())
        };
        self.animator.runs().all().filter_map(rest).collect()
    }

    /// Walks to some frames of a run, from its first one or what was done of it.
    fn walk(&self, frames: Range<usize>, ticket: &mut Ticket<'_>) -> Result<(), AnimateError> {
        let mut animator = self.animator.clone();
        let run = self.animator.runs().of(frames.start);
        let mut next = run.start;
        if frames.start > run.start
            && let Some((last, state)) = self.walked.state(run.start)
            && animator.resume(last, state.place, &state.snapshot)
        {
            next = last + 1;
        } else {
            animator.begin(run.start);
        }
        for frame in next..frames.end {
            let (positions, row) = animator.next_frame(ticket)?;
            self.walked.write(&positions, &row)?;
            self.walked.write_state((run.start, frame), &animator)?;
            ticket.frame_is_done()?;
        }
        Ok(())
    }

    /// Moves some frames, ascending, to the means of their neighbours.
    fn average(&self, frames: &[usize], ticket: &mut Ticket<'_>) -> Result<(), AnimateError> {
        let walker = self.animator.walker().clone();
        let mut smoother = Smoother::new(self.movement, walker, self.radius);
        for frame in frames {
            let (positions, row) = smoother.averaged(*frame, &self.walked)?;
            self.means.write(&positions, &row)?;
            ticket.frame_is_done()?;
        }
        Ok(())
    }

    /// Finishes some frames, ascending, that were walked to with all that they depend on.
    fn finish(&self, frames: &[usize], ticket: &mut Ticket<'_>) -> Result<(), AnimateError> {
        let walker = self.animator.walker().clone();
        let mut finisher = Finisher::new(self.movement, walker, (self.radius, self.params.depth()));
        for frame in frames {
            let (positions, row) = finisher.frame(*frame, [&self.walked, &self.means])?;
            self.finished.write(&positions, &row)?;
            ticket.frame_is_done()?;
        }
        Ok(())
    }

    /// The rows of all frames, which are finished.
    fn rows(&self, monitor: &mut dyn Monitor) -> Result<Vec<FrameReport>, AnimateError> {
        let all: Vec<usize> = (0..self.movement.frames()).collect();
        let rest = self.movement.positions();
        let rows = Mutex::new(Vec::with_capacity(all.len()));
        let measure = |frames: Vec<usize>, ticket: &mut Ticket<'_>| {
            with_jitter(self.movement, &rest, &self.finished, &frames, |row| {
                rows.lock().unwrap_or_else(PoisonError::into_inner).push(row);
                Ok(ticket.frame_is_done()?)
            })
        };
        let mut report = counted(monitor, "measured", (0, all.len()));
        let workers = self.workers();
        each((parts(&all, workers), workers), measure, &mut report)?;
        let mut rows = rows.into_inner().unwrap_or_else(PoisonError::into_inner);
        rows.sort_unstable_by_key(|row| row.frame);
        Ok(rows)
    }
}

/// Reports how many frames of a stage are done, of which there were some before, and how long the others take.
fn counted(
    monitor: &mut dyn Monitor,
    stage: &'static str,
    (before, total): (usize, usize),
) -> impl FnMut(usize) -> Result<(), Cancelled> {
    let start = Instant::now();
    move |count| {
        let done = before + count;
        let left = start.elapsed().as_secs_f64() / count.max(1) as f64 * (total - done) as f64;
        let measures = [("seconds_left", left)];
        monitor.report(&Progress {
            done,
            total: Some(total),
            measures: if count > 0 { &measures } else { &[] },
            ..Progress::stage(stage)
        })
    }
}
