//! What happens between stored frames.

use super::error::AnimateError;
use super::frames::Frames;
use super::work::counted;
use super::workers::{Ticket, each};
use if_core::math::Real;
use if_core::monitor::Monitor;
use if_outfit::Outfit;
use if_outfit::motion::{Crossing, Crossings, WalkError};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::atomic::Ordering;
use std::sync::{Mutex, PoisonError};

/// Crossings of an interval that are named.
const NAMED: usize = 8;
/// Most crossings of an interval that are searched for. A fast limb has hundreds; where a body turns round within an
/// interval all triangles meet, and to find 300,000 of them takes a minute.
const MOST: usize = 10_000;

/// What passes through what from one frame to the next, if all vertices move in straight lines.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct IntervalReport {
    /// The frame where it begins.
    pub frame: usize,
    /// Triangle pairs of two layers that meet on the way, and in neither frame.
    pub crossings: usize,
    /// The same of one layer, without triangles that have a corner in common.
    pub own_crossings: usize,
    /// The first in time, those of two layers before others.
    pub first: Vec<NamedCrossing>,
    /// The search ended at so many crossings of both kinds: there are more, and none of them is counted or named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub more_than: Option<usize>,
}

/// Two triangles that meet between two frames.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct NamedCrossing {
    /// The layers of both.
    pub layers: [String; 2],
    /// The triangles there.
    pub triangles: [u32; 2],
    /// The share of the way at which they meet.
    pub share: Real,
}

impl IntervalReport {
    fn new(frame: usize, mut found: Vec<Crossing>, outfit: &Outfit) -> Self {
        let crossings = found.iter().filter(|c| c.is_of_layers()).count();
        let own_crossings = found.len() - crossings;
        found.sort_by(|a, b| {
            b.is_of_layers().cmp(&a.is_of_layers()).then(a.share.total_cmp(&b.share))
        });
        let names: Vec<&str> = outfit.layers().map(|layer| layer.name.as_str()).collect();
        let named = |c: &Crossing| NamedCrossing {
            layers: c.triangles.map(|(layer, _)| names[layer].to_owned()),
            triangles: c.triangles.map(|(_, triangle)| triangle),
            share: c.share,
        };
        Self {
            frame,
            crossings,
            own_crossings,
            first: found.iter().take(NAMED).map(named).collect(),
            more_than: None,
        }
    }

    /// Nothing passes through anything.
    pub fn is_clean(&self) -> bool {
        self.crossings == 0 && self.own_crossings == 0 && self.more_than.is_none()
    }
}

/// Examines the ways from each frame to the next as they are stored: an interval less than there are
/// frames. Of an interval with more than 10,000 crossings it is only said that there are more. `monitor` receives
/// the stage `"between frames"`, and cancels within an interval as well.
///
/// # Errors
///
/// A frame that was changed, or the monitor cancelled.
pub fn between_frames(
    outfit: &Outfit,
    frames: &Frames,
    monitor: &mut dyn Monitor,
) -> Result<Vec<IntervalReport>, AnimateError> {
    let search = Crossings::new(outfit).map_err(WalkError::from)?;
    let total = frames.len().saturating_sub(1);
    let found = Mutex::new(Vec::with_capacity(total));
    // One job, whose searches are parallel; it is stopped within an interval as well.
    let examine = |intervals: Range<usize>, ticket: &mut Ticket<'_>| {
        let mut last = None;
        for frame in intervals {
            let from = last.take().map_or_else(|| frames.positions(frame), Ok)?;
            let to = frames.positions(frame + 1)?;
            let stops = || ticket.stops().load(Ordering::Relaxed);
            let report = match search.between_at_most(&from, &to, MOST, &stops)? {
                Some(found) => IntervalReport::new(frame, found, outfit),
                None => IntervalReport { frame, more_than: Some(MOST), ..Default::default() },
            };
            found.lock().unwrap_or_else(PoisonError::into_inner).push(report);
            last = Some(to);
            ticket.frame_is_done()?;
        }
        Ok(())
    };
    let all = 0..total;
    each((vec![all], 1), examine, &mut counted(monitor, "between frames", (0, total)))?;
    Ok(found.into_inner().unwrap_or_else(PoisonError::into_inner))
}
