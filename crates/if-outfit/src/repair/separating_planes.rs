//! Intersecting triangles are separated by planes.

use super::{Repair, SEPARATION};
use crate::progress::GarmentProgress;
use crate::separating_plane::least_motion_plane;
use crate::workpiece::{SettleError, Workpiece};
use if_core::math::{Point, Real};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// Verifications over which triangles that intersected are held apart: released at once, they would
/// intersect again every other round.
const KEPT: u32 = 8;
/// A triangle that was found intersecting k times may move by k steps, up to this many.
const MAX_STEPS: u32 = 6;
/// Pairs per task: a plane takes some microseconds.
const TASK: usize = 8;

/// Moves each triangle that intersects a layer below beyond a plane between the two triangles: the
/// one with the least motion of those that lead outwards.
#[derive(Default)]
pub(crate) struct SeparatingPlanes {
    /// Pairs that intersected lately (layer below, its triangle, triangle), and for how many
    /// verifications they are still held apart.
    pairs: BTreeMap<(usize, u32, u32), u32>,
    /// For each triangle how often it was found intersecting.
    found: BTreeMap<u32, u32>,
}

impl Repair for SeparatingPlanes {
    fn apply(
        &mut self,
        work: &mut Workpiece<'_>,
        _: &mut GarmentProgress<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        self.pairs.retain(|_, left| {
            *left -= 1;
            *left > 0
        });
        for (layer, pair) in &work.remaining.pairs {
            let is_new = self.pairs.insert((*layer, pair.a, pair.b), KEPT).is_none();
            work.counts.separating_planes += usize::from(is_new);
            *self.found.entry(pair.b).or_insert(0) += 1;
        }
        self.set_planes(work);
        Ok(ControlFlow::Continue(()))
    }
}

impl SeparatingPlanes {
    fn set_planes(&self, work: &mut Workpiece<'_>) {
        let scene = work.scene;
        let x = &work.cloth.x;
        let planes = |&(layer, a, b): &(usize, u32, u32)| {
            let corners = scene.garment.mesh.triangles()[b as usize];
            let t = corners.map(|v| x[v as usize]);
            let middle = Point::from((t[0].coords + t[1].coords + t[2].coords) / 3.0);
            let layer = scene.below[layer];
            // In a fold the coarse way out is the right one; far from all it is unknown.
            let nearest = || layer.sided(&middle, Real::INFINITY).map(|s| s.normal);
            let out = scene.outward.direction(&middle).or_else(nearest)?;
            let (normal, level) = least_motion_plane(&t, &layer.corners(a), &out);
            let steps = Real::from(self.found[&b].min(MAX_STEPS));
            let step = scene.params.effort.separation_step * steps;
            Some(corners.map(|v| {
                let height = normal.dot(&x[v as usize].coords);
                let wanted = (level + SEPARATION).min(height + step);
                (v, normal, Point::from(normal * wanted))
            }))
        };
        let pairs: Vec<_> = self.pairs.keys().collect();
        let found: Vec<_> = pairs.into_par_iter().with_min_len(TASK).filter_map(planes).collect();
        work.contacts.separating = found.into_iter().flatten().collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::tests::{apply, unchanged, with_band};

    #[test]
    fn chords_that_cut_through_the_body_are_pushed_beyond_planes_and_kept_there() {
        // The corners of the band are outside the ball, and the middles of its edges inside.
        with_band(0.3001, unchanged, |work| {
            work.verify();
            let found = work.remaining.pairs.len();
            assert!(found > 0 && work.remaining.inside.is_empty());
            let mut planes = SeparatingPlanes::default();
            apply(&mut planes, work);
            assert_eq!(work.counts.separating_planes, found);
            assert_eq!(work.contacts.separating.len(), 3 * found);
            // Moved to their planes a few times, the triangles do not intersect any more.
            for _ in 0..MAX_STEPS {
                for (v, normal, point) in work.contacts.separating.clone() {
                    let x = &mut work.cloth.x[v as usize];
                    *x += normal * normal.dot(&(point - *x)).max(0.0);
                }
                work.tree.refit(&work.cloth.x);
                work.verify();
                apply(&mut planes, work);
            }
            assert_eq!(work.remaining.pairs.len(), 0);
            assert!(!work.contacts.separating.is_empty(), "they are still held apart");
            (0..KEPT).for_each(|_| apply(&mut planes, work));
            assert!(work.contacts.separating.is_empty());
        });
    }
}
