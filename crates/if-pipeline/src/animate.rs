//! Outfits that follow motions, every frame proven.
//!
//! [`animate()`] takes a clean [`SkinnedOutfit`] and a [`Motion`] through all frames. Each begins from
//! the last clean state, carried by the skinning ([`if_outfit::motion`]). A second pass, a few frames
//! behind, smooths displacements over time, and verifies each frame exactly. Frames go to a folder as they are done, so that a run that was stopped goes on where it ended.

mod animator;
mod error;
mod frames;
mod measure;
mod outfit;
mod report;
mod smoother;
#[cfg(test)]
mod tests;

pub use animator::{AnimateParams, Animator};
pub use error::AnimateError;
pub use frames::Frames;
pub use outfit::{SkinFault, SkinnedOutfit};
pub use report::{AnimationReport, FrameReport, Spread};

use if_body::Motion;
use if_core::monitor::{Monitor, Progress};
use measure::Measurer;
use smoother::Smoother;
use std::path::Path;
use std::time::Instant;

/// All frames of a motion.
#[derive(Debug)]
pub struct Animation {
    /// A row for each frame, and what they have in common.
    pub report: AnimationReport,
    /// The positions of each frame.
    pub frames: Frames,
}

/// The folder of frames before smoothing, within that of frames.
const WALKED: &str = "walked";

/// Moves an outfit through all frames of a motion, and keeps them in `folder`, which is created.
///
/// Frames that `folder` holds from the same outfit, motion and parameters, by digest, are kept; the
/// others follow with the same bits as in one run. `monitor` receives the stage `"frame"`, with the
/// measure `"seconds_left"` from the second frame on, and `"walk"` within each.
///
/// A frame that cannot be made clean is no error: its row says so, and it holds the last clean state
/// carried to its pose.
///
/// # Errors
///
/// [`AnimateError`]: an outfit that is not clean, parameters out of range, a folder that cannot be
/// written, or the monitor cancelled.
pub fn animate(
    outfit: &SkinnedOutfit,
    motion: &Motion,
    params: &AnimateParams,
    folder: &Path,
    monitor: &mut dyn Monitor,
) -> Result<Animation, AnimateError> {
    let start = Instant::now();
    let mut walked = Frames::open(&folder.join(WALKED), outfit, motion, params)?;
    let mut frames = Frames::open(folder, outfit, motion, params)?;
    let mut animator = Animator::new(outfit, motion, *params)?;
    let radius = params.smoothed_frames(motion);
    let mut smoother = Smoother::new(outfit, motion, animator.walker().clone(), radius);
    let mut measurer = Measurer::new(outfit);
    walked.resume(&mut animator)?;
    let total = motion.poses.len();
    frames.keep(total);
    let kept = frames.len();
    measurer.resume(animator.walker(), motion, kept, |frame| frames.positions(frame))?;
    let working = Instant::now();
    for k in kept..total {
        let done = k - kept;
        let left = working.elapsed().as_secs_f64() / done.max(1) as f64 * (total - k) as f64;
        let measures = [("seconds_left", left)];
        monitor.report(&Progress {
            done: k,
            total: Some(total),
            measures: if done > 0 { &measures } else { &[] },
            ..Progress::stage("frame")
        })?;
        while walked.len() <= smoother.last_needed(k) {
            let (positions, row) = animator.next_frame(monitor)?;
            walked.push(&positions, row)?;
            walked.push_state(&animator)?;
        }
        let begun = Instant::now();
        let walker = animator.walker();
        let raw = &walked.rows()[k];
        let mut positions = smoother.frame(k, &walked, monitor)?;
        let before = walked.positions(k)?;
        let mut found = measurer.verify(walker, &positions)?;
        let mut smoothed = positions != before;
        if smoothed && !found.is_clean() {
            // Contacts keep layers apart, and not vertices on their sides.
            let unsmoothed = measurer.verify(walker, &before)?;
            if unsmoothed.is_clean() {
                (positions, found, smoothed) = (before, unsmoothed, false);
            }
        }
        let mut row = FrameReport {
            pairs: found.pairs,
            inside: found.inside,
            own_pairs: found.own_pairs,
            body_own_pairs: found.body_own_pairs,
            new_own_pairs: found.new_own_pairs,
            smoothed,
            ..raw.clone()
        };
        measurer.measure(walker, &motion.poses[k], &positions, &mut row)?;
        row.seconds += begun.elapsed().as_secs_f64();
        frames.push(&positions, row)?;
    }
    let seconds = start.elapsed().as_secs_f64();
    let report = AnimationReport::new(frames.rows(), motion.frames_per_second, kept, seconds);
    Ok(Animation { report, frames })
}
