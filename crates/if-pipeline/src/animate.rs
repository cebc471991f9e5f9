//! Outfits that follow motions, every frame proven.
//!
//! [`animate()`] takes a clean [`SkinnedOutfit`] and a [`Motion`] through all frames. Each begins from
//! the last clean state, carried by the skinning ([`if_outfit::motion`]), and is verified exactly.
//! Frames go to a folder as they are done, so that a run that was stopped goes on where it ended.

mod animator;
mod error;
mod frames;
mod outfit;
mod report;
#[cfg(test)]
mod tests;

pub use animator::{AnimateParams, Animator};
pub use error::AnimateError;
pub use frames::Frames;
pub use outfit::{SkinFault, SkinnedOutfit};
pub use report::{AnimationReport, FrameReport, Spread};

use if_body::Motion;
use if_core::monitor::{Monitor, Progress};
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
    let mut frames = Frames::open(folder, outfit, motion, params)?;
    let mut animator = Animator::new(outfit, motion, *params)?;
    frames.resume(&mut animator)?;
    let (kept, total) = (frames.len(), motion.poses.len());
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
        let (positions, row) = animator.next_frame(monitor)?;
        frames.push(&positions, row, &animator)?;
    }
    let seconds = start.elapsed().as_secs_f64();
    let report = AnimationReport::new(frames.rows(), motion.frames_per_second, kept, seconds);
    Ok(Animation { report, frames })
}
