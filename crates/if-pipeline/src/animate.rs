//! Outfits that follow motions, every frame proven.
//!
//! [`animate()`] takes a clean [`SkinnedOutfit`] and a [`Motion`] through all frames; [`follow()`] does
//! so for any [`Movement`], such as that of a body which is given in every frame. A run of frames begins
//! from the rest pose, as does a frame after a cut, each later one from the last clean state, carried by the skinning
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
mod moving_outfit;
mod noticed;
mod outfit;
mod parts;
mod report;
mod shots;
mod smoother;
#[cfg(test)]
mod tests;
mod windows;
mod work;
mod workers;

pub use animator::{AnimateParams, Animator};
pub use bound::BoundOutfit;
pub use continuous::{IntervalReport, NamedCrossing, between_frames};
pub use error::AnimateError;
pub use frames::Frames;
pub use if_outfit::report::{PinchReport, PinchedGarment};
pub use movement::Movement;
pub use moving_outfit::MovingOutfit;
pub use noticed::{Noticed, WeightsLeftOut};
pub use outfit::{SkinFault, SkinnedOutfit};
pub use report::{AnimationReport, FrameReport, NamedPair, NamedVertex, Spread};

use if_body::Motion;
use if_core::monitor::Monitor;
use if_mesh::atomic::{FolderShare, FolderWriter};
use std::ops::Range;
use std::path::Path;
use std::time::Instant;
use work::Work;

/// All frames of a motion.
#[derive(Debug)]
pub struct Animation {
    /// A row for each frame, and what they have in common.
    pub report: AnimationReport,
    /// The positions of each frame.
    pub frames: Frames,
}

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
/// [`AnimateError`]: an outfit whose layers intersect, parameters out of range, a folder that cannot be
/// written or in which another process keeps frames, or the monitor cancelled.
pub fn follow(
    movement: Movement<'_>,
    params: &AnimateParams,
    folder: &Path,
    monitor: &mut dyn Monitor,
) -> Result<Animation, AnimateError> {
    let start = Instant::now();
    // What frames were computed from is removed at the end: nobody else may need it.
    let _writer = FolderWriter::open(folder)
        .map_err(|source| AnimateError::Io { path: folder.into(), source })?
        .ok_or_else(|| AnimateError::Busy { path: folder.into() })?;
    let work = Work::open(movement, params, folder)?;
    let new = work.frames(0..movement.frames(), monitor)?;
    let working = start.elapsed().as_secs_f64();
    let (rows, cuts) = (work.rows(monitor)?, work.cuts());
    let frames = work.finished(rows)?;
    let kept = frames.len() - new;
    let seconds = (working / new.max(1) as f64, start.elapsed().as_secs_f64());
    let report = AnimationReport::new(frames.rows(), movement.frames_per_second(), kept, seconds);
    Ok(Animation { report: AnimationReport { cuts, ..report }, frames })
}

/// The frames `part` of a movement alone, in `folder`: what one of several machines does of a long motion.
/// [`follow()`] keeps them, once the folder holds those of all machines. Returns how many were not there
/// yet.
///
/// # Errors
///
/// As [`follow()`]; other parts may be computed in the folder at once.
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
    // Who collects all frames removes what parts need.
    let _share = FolderShare::open(folder)
        .map_err(|source| AnimateError::Io { path: folder.into(), source })?
        .ok_or_else(|| AnimateError::Busy { path: folder.into() })?;
    Work::open(movement, params, folder)?.frames(part, monitor)
}
