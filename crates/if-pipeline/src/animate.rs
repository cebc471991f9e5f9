//! Outfits that follow motions, every frame proven.
//!
//! [`animate()`] takes a clean [`SkinnedOutfit`] and a [`Motion`] through all frames; [`follow()`] does
//! so for any [`Movement`], such as that of a body which is given in every frame. Each begins from
//! the last clean state, carried by the skinning ([`if_outfit::motion`]). A second pass, a few frames
//! behind, smooths displacements over time, and verifies each frame exactly. Frames go to a folder as they are done, so that a run that was stopped goes on where it ended.

mod animator;
mod bound;
mod continuous;
mod error;
mod finisher;
mod frames;
mod local;
mod measure;
mod movement;
mod outfit;
mod report;
mod smoother;
#[cfg(test)]
mod tests;
mod window;

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
use if_core::monitor::{Monitor, Progress};
use smoother::Smoother;
use std::path::Path;
use std::time::Instant;
use window::Window;

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
pub fn follow(
    movement: Movement<'_>,
    params: &AnimateParams,
    folder: &Path,
    monitor: &mut dyn Monitor,
) -> Result<Animation, AnimateError> {
    let start = Instant::now();
    let radius = params.smoothed_frames(movement.frames_per_second());
    let mut frames = Frames::open(folder, movement, params)?;
    let mut animator = Animator::new(movement, *params)?;
    let mut finisher = Finisher::new(movement, animator.walker().clone(), (radius, params.depth()));
    let total = movement.frames();
    frames.keep(total);
    let kept = frames.len();
    finisher.resume(kept, |frame| frames.positions(frame))?;
    let mut window = Window::open(&folder.join(WALKED), movement, params)?;
    let reach = Smoother::reach(radius);
    window.resume(kept.saturating_sub(reach), &mut animator);
    let last_needed = |k: usize| (k + reach).min(total.saturating_sub(1));
    let working = Instant::now();
    let mut begun = working;
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
        while window.next() <= last_needed(k) {
            let (positions, row) = animator.next_frame(monitor)?;
            window.push(positions, row, &animator)?;
        }
        // The frame that the next one needs is walked to while this one is finished.
        let (mut finished, mut walked) = (None, Ok(None));
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| finished = Some(finisher.frame(k, &window)));
            if k + 1 < total && window.next() <= last_needed(k + 1) {
                walked = animator.next_frame(monitor).map(Some);
            }
        });
        let (positions, mut row) = finished.expect("the scope waits for its tasks")?;
        row.seconds = begun.elapsed().as_secs_f64();
        begun = Instant::now();
        frames.push(&positions, row)?;
        if let Some((positions, row)) = walked? {
            window.push(positions, row, &animator)?;
        }
        window.forget(k + 1, (k + 1).saturating_sub(reach))?;
    }
    let seconds = start.elapsed().as_secs_f64();
    let report = AnimationReport::new(frames.rows(), movement.frames_per_second(), kept, seconds);
    Ok(Animation { report, frames })
}
