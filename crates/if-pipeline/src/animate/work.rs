//! What there is to do for the frames of a movement: walks, means, smoothing, measures, each on several
//! threads, and kept on disk.

use super::animator::{AnimateParams, Animator};
use super::error::AnimateError;
use super::finisher::Finisher;
use super::frames::Frames;
use super::jitter::with_jitter;
use super::movement::Movement;
use super::parts::parts;
use super::report::FrameReport;
use super::smoother::Smoother;
use super::windows::Windows;
use super::workers::{Ticket, each};
use if_core::monitor::{Cancelled, Monitor, Progress};
use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Folders within that of frames: of frames before smoothing, and of those that went to the mean of their
/// neighbours.
const WALKED: &str = "walked";
const MEANS: &str = "means";
/// Most vertices that workers hold together: some 10 GB.
const MOST_VERTICES: usize = 4_000_000;

/// What there is to do for frames, and their files.
pub(super) struct Work<'a> {
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
    pub(super) fn open(
        movement: Movement<'a>,
        params: &AnimateParams,
        folder: &Path,
    ) -> Result<Self, AnimateError> {
        let animator = Animator::new(movement, *params)?;
        let finished = Frames::open(folder, movement, params)?;
        let walked = finished.within(WALKED)?;
        let means = finished.within(MEANS)?;
        let radius = params.smoothed_frames(movement.frames_per_second());
        Ok(Self { movement, params: *params, animator, walked, means, finished, radius })
    }

    /// Computes those of some frames that are not there yet, and returns how many.
    pub(super) fn frames(
        &self,
        part: Range<usize>,
        monitor: &mut dyn Monitor,
    ) -> Result<usize, AnimateError> {
        let missing: Vec<usize> =
            part.clone().filter(|frame| self.finished.stored(*frame).is_none()).collect();
        let means = if self.radius > 0 { self.near(&missing) } else { Vec::new() };
        let is_new = |frame: &usize| self.means.stored(*frame).is_none();
        let averaged: Vec<usize> = means.iter().copied().filter(is_new).collect();
        let walks = self.walks(&self.near(&self.near(&missing)));
        let walking = walks.iter().map(Range::len).sum();
        let walk = |run, ticket: &mut Ticket<'_>| self.walk(run, ticket);
        each((walks, self.workers()), walk, &mut counted(monitor, "walked", (0, walking)))?;
        let stage = ("averaged", means.len());
        self.side_by_side(
            stage,
            &averaged,
            |frames, ticket| self.average(frames, ticket),
            monitor,
        )?;
        let stage = ("frame", part.len());
        self.side_by_side(stage, &missing, |frames, ticket| self.finish(frames, ticket), monitor)?;
        Ok(missing.len())
    }

    /// Does the work of a stage on parts of `frames`, which are left of `total` ones.
    fn side_by_side(
        &self,
        (stage, total): (&'static str, usize),
        frames: &[usize],
        work: impl Fn(&[usize], &mut Ticket<'_>) -> Result<(), AnimateError> + Sync,
        monitor: &mut dyn Monitor,
    ) -> Result<(), AnimateError> {
        let workers = self.workers();
        let part = |frames: Vec<usize>, ticket: &mut Ticket<'_>| work(&frames, ticket);
        let mut report = counted(monitor, stage, (total - frames.len(), total));
        each((parts(frames, workers), workers), part, &mut report)
    }

    /// How many work at a time: each holds a walker and the frames over which it smooths.
    fn workers(&self) -> usize {
        let vertices = self.animator.walker().rest().len();
        rayon::current_num_threads().min(MOST_VERTICES / vertices.max(1)).max(1)
    }

    /// The frames over which displacements are smoothed.
    fn windows(&self) -> Windows<'_> {
        let (shots, body_limit) = (self.animator.shots(), self.params.body_limit);
        Windows { shots, radius: self.radius, body_limit }
    }

    /// The frames after cuts.
    pub(super) fn cuts(&self) -> Vec<usize> {
        self.animator.shots().cuts().to_vec()
    }

    /// Some ascending frames and those around them over which displacements are smoothed.
    fn near(&self, frames: &[usize]) -> Vec<usize> {
        let mut near: Vec<usize> = frames.iter().flat_map(|k| self.windows().of(*k)).collect();
        near.sort_unstable();
        near.dedup();
        near
    }

    /// What has to be walked to for `needed` frames, ascending: the rest of each run up to the last of them.
    pub(super) fn walks(&self, needed: &[usize]) -> Vec<Range<usize>> {
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
        let mut smoother = Smoother::new(self.movement, walker, self.windows());
        for frame in frames {
            let (positions, row) = smoother.averaged(*frame, &self.walked, ticket)?;
            self.means.write(&positions, &row)?;
            ticket.frame_is_done()?;
        }
        Ok(())
    }

    /// Finishes some frames, ascending, that were walked to with all that they depend on.
    fn finish(&self, frames: &[usize], ticket: &mut Ticket<'_>) -> Result<(), AnimateError> {
        let walker = self.animator.walker().clone();
        let mut finisher =
            Finisher::new(self.movement, walker, self.windows(), self.params.depth());
        for frame in frames {
            let (positions, row) = finisher.frame(*frame, [&self.walked, &self.means], ticket)?;
            self.finished.write(&positions, &row)?;
            ticket.frame_is_done()?;
        }
        Ok(())
    }

    /// All frames, with their rows; what they were computed from is removed.
    pub(super) fn finished(self, rows: Vec<FrameReport>) -> Result<Frames, AnimateError> {
        for frame in 0..rows.len() {
            self.walked.remove(frame)?;
            self.means.remove(frame)?;
        }
        for frames in [&self.walked, &self.means, &self.finished] {
            frames.remove_partial()?;
        }
        Ok(self.finished.with_rows(rows))
    }

    /// The rows of all frames, which are finished.
    pub(super) fn rows(&self, monitor: &mut dyn Monitor) -> Result<Vec<FrameReport>, AnimateError> {
        let all: Vec<usize> = (0..self.movement.frames()).collect();
        let rest = self.movement.positions();
        let rows = Mutex::new(Vec::with_capacity(all.len()));
        let measure = |frames: &[usize], ticket: &mut Ticket<'_>| {
            let cuts = self.animator.shots().cuts();
            with_jitter((self.movement, &rest, cuts), &self.finished, frames, |row| {
                rows.lock().unwrap_or_else(PoisonError::into_inner).push(row);
                Ok(ticket.frame_is_done()?)
            })
        };
        self.side_by_side(("measured", all.len()), &all, measure, monitor)?;
        let mut rows = rows.into_inner().unwrap_or_else(PoisonError::into_inner);
        rows.sort_unstable_by_key(|row| row.frame);
        Ok(rows)
    }
}

/// Reports how many frames of a stage are done, of which there were some before, and how long the others take.
pub(super) fn counted(
    monitor: &mut dyn Monitor,
    stage: &'static str,
    (before, total): (usize, usize),
) -> impl FnMut(usize) -> Result<(), Cancelled> {
    let start = Instant::now();
    move |count| {
        let done = before + count;
        let left =
            start.elapsed().as_secs_f64() / count.max(1) as f64 * total.saturating_sub(done) as f64;
        let measures = [("seconds_left", left)];
        monitor.report(&Progress {
            done,
            total: Some(total),
            measures: if count > 0 { &measures } else { &[] },
            ..Progress::stage(stage)
        })
    }
}
