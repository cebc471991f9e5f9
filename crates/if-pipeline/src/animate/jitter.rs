//! How displacements change from frame to frame.

use super::error::AnimateError;
use super::frames::Frames;
use super::movement::Movement;
use super::report::{FrameReport, Spread};
use if_core::math::{Point, Real, Vector};

/// The rows of `frames`, which follow one another, with their [`jitter`](FrameReport::jitter), that of the body,
/// and their [`shake`](FrameReport::shake), counted anew from each of `cuts`. `rest` is the clean outfit, before layers
/// were moved apart.
pub(super) fn with_jitter(
    (movement, rest, cuts): (Movement<'_>, &[Point], &[usize]),
    stored: &Frames,
    frames: &[usize],
    mut each: impl FnMut(FrameReport) -> Result<(), AnimateError>,
) -> Result<(), AnimateError> {
    let first = frames.first().copied().unwrap_or(0);
    let body = movement.outfit().body.mesh.vertices().len();
    let before = first.saturating_sub(2)..first;
    // Local displacements in the two frames before, the last one first.
    let mut last: [Option<Vec<Vector>>; 2] = [None, None];
    for frame in before.chain(frames.iter().copied()) {
        if cuts.binary_search(&frame).is_ok() {
            last = [None, None];
        }
        let (mut row, positions) = stored.written(frame)?;
        let maps = movement.maps(frame)?;
        let local = maps.local(&maps.posed(rest), &positions);
        if let [Some(last), second] = &last {
            let mut change: Vec<Real> =
                last.iter().zip(&local).map(|(a, b)| (b - a).norm()).collect();
            row.jitter = Spread::of(change.split_off(body));
            row.body.jitter = change.into_iter().fold(0.0, Real::max);
            if let Some(second) = second {
                let three = second.iter().zip(last).zip(&local).skip(body);
                let turn = three.map(|((a, b), c)| (c - b * 2.0 + a).norm());
                row.shake = Spread::of(turn.collect());
            }
        }
        last = [Some(local), last[0].take()];
        if frame >= first {
            each(row)?;
        }
    }
    Ok(())
}
