//! What happens between stored frames.

use super::error::AnimateError;
use super::frames::Frames;
use if_core::math::Real;
use if_core::monitor::{Monitor, Progress};
use if_outfit::Outfit;
use if_outfit::motion::{Crossing, Crossings, WalkError};
use serde::{Deserialize, Serialize};

/// Crossings of an interval that are named.
const NAMED: usize = 8;

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
        }
    }

    /// Nothing passes through anything.
    pub fn is_clean(&self) -> bool {
        self.crossings == 0 && self.own_crossings == 0
    }
}

/// Examines the ways from each frame to the next as they are stored: an interval less than there are
/// frames. `monitor` receives the stage `"between frames"`.
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
    let mut found = Vec::with_capacity(total);
    let mut last = None;
    for frame in 0..total {
        monitor.report(&Progress {
            done: frame,
            total: Some(total),
            ..Progress::stage("between frames")
        })?;
        let from = last.take().map_or_else(|| frames.positions(frame), Ok)?;
        let to = frames.positions(frame + 1)?;
        found.push(IntervalReport::new(frame, search.between(&from, &to)?, outfit));
        last = Some(to);
    }
    Ok(found)
}
