//! Broad phase of the intersection queries: the triangles near the boundary, kept between queries.
//!
//! All changes of the clean-up happen near boundary loops. A coarse grid marks that region once;
//! queries inside it then visit the triangles of the region instead of the whole mesh.

use super::occupancy_grid::{CellBox, OccupancyGrid, merged};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
use rayon::prelude::*;

/// A triangle with a box that bounds all its possible positions.
pub(super) type Bounded = (u32, Aabb);

/// Margin of the region around the boxes it is made for, in mean sides of these boxes: loops move
/// by one or two, and what is smoothed with them lies within three rings, rarely twelve. A smaller
/// margin rebuilds the region more often, a larger one visits more triangles; the results are the
/// same.
const MARGIN: Real = 4.0;

/// Minimum number of points or triangles per task.
const TASK: usize = 1 << 13;

/// A superset of the triangles that overlap a region of space.
#[derive(Clone, Debug, Default)]
pub(super) struct BroadPhase {
    region: Option<OccupancyGrid>,
    /// Triangles below `indexed`, ascending, each with all cells that it has overlapped since the
    /// region was built.
    near: Vec<(u32, CellBox)>,
    /// Triangles from here on were added later, and all count as near.
    indexed: u32,
}

impl BroadPhase {
    /// Whether no region was built yet.
    pub(super) fn is_empty(&self) -> bool {
        self.region.is_none()
    }

    /// A superset, ascending, of the triangles that can intersect one of `bounded`, which is
    /// ascending too. From now on the triangles of `bounded` may be anywhere in their boxes; all
    /// others stay where they are. Rebuilds the region if a box leaves it.
    pub(super) fn candidates(
        &mut self,
        points: &[Point],
        triangles: &[[u32; 3]],
        bounded: &[Bounded],
    ) -> Vec<u32> {
        if let Some(region) = &self.region {
            let boxes: Vec<CellBox> = bounded.iter().map(|b| region.cells_of(&b.1)).collect();
            if boxes.iter().all(|b| region.contains(*b)) {
                let queried = region.with(boxes.iter().copied());
                let mut next = bounded.iter().zip(boxes).peekable();
                let mut found = Vec::new();
                for (t, cells) in &mut self.near {
                    if let Some((_, moved)) = next.next_if(|n| n.0.0 == *t) {
                        *cells = merged(*cells, moved);
                        found.push(*t);
                    } else if queried.overlaps(*cells) {
                        found.push(*t);
                    }
                }
                found.extend(self.indexed..triangles.len() as u32);
                return found;
            }
        }
        self.rebuild(points, triangles, bounded);
        self.candidates(points, triangles, bounded)
    }

    /// Builds the region anew, around `bounded`.
    pub(super) fn rebuild(
        &mut self,
        points: &[Point],
        triangles: &[[u32; 3]],
        bounded: &[Bounded],
    ) {
        let side =
            bounded.iter().map(|b| b.1.size().max()).sum::<Real>() / bounded.len().max(1) as Real;
        let wide: Vec<Aabb> = bounded.iter().map(|b| b.1.inflated(MARGIN * side)).collect();
        let region = OccupancyGrid::new(&wide);
        let (cell_of, is_inside): (Vec<[u8; 3]>, Vec<bool>) = points
            .par_iter()
            .with_min_len(TASK)
            .map(|p| {
                let cell = region.cell(p);
                (cell, region.overlaps([cell, cell]))
            })
            .unzip();
        let overlapping = |(k, t): (usize, &[u32; 3])| {
            let [a, b, c] = t.map(|v| cell_of[v as usize]);
            // Most triangles lie within one cell: its corner's cell settles them.
            let within_one = a == b && b == c;
            let cells = if within_one { [a, a] } else { merged([a, a], merged([b, b], [c, c])) };
            (is_inside[t[0] as usize] || (!within_one && region.overlaps(cells)))
                .then_some((k as u32, cells))
        };
        self.near =
            triangles.par_iter().with_min_len(TASK).enumerate().filter_map(overlapping).collect();
        self.indexed = triangles.len() as u32;
        self.region = Some(region);
    }

    /// Follows the removal of triangles `gone`, ascending; those behind them move up.
    pub(super) fn remove(&mut self, gone: &[u32]) {
        let mut before = 0;
        self.near.retain_mut(|(t, _)| {
            while before < gone.len() && gone[before] < *t {
                before += 1;
            }
            let stays = gone.get(before) != Some(t);
            *t -= before as u32;
            stays
        });
        self.indexed -= gone.partition_point(|t| *t < self.indexed) as u32;
    }

    /// Follows a truncation to the first `triangles`.
    pub(super) fn truncate(&mut self, triangles: usize) {
        self.indexed = self.indexed.min(triangles as u32);
        self.near.truncate(self.near.partition_point(|n| n.0 < self.indexed));
    }
}

#[cfg(test)]
mod tests {
    use super::super::intersection_query::bounds;
    use super::*;
    use if_core::shapes::meshes::icosphere;

    #[test]
    fn no_overlapping_triangle_is_missed_after_removals_and_additions() {
        let ball = icosphere(0.3, 3);
        let (points, mut triangles) = (ball.vertices().to_vec(), ball.triangles().to_vec());
        let place = |triangles: &[[u32; 3]], t: u32| {
            (t, bounds(triangles[t as usize].map(|v| &points[v as usize])))
        };
        let overlapping = |triangles: &[[u32; 3]], places: &[(u32, Aabb)]| -> Vec<u32> {
            let all = 0..triangles.len() as u32;
            all.filter(|t| places.iter().any(|p| p.1.overlaps(&place(triangles, *t).1))).collect()
        };
        let mut broad_phase = BroadPhase::default();
        let mut rebuilds = 0;
        for round in 0..12u32 {
            let places: Vec<(u32, Aabb)> =
                [5 + round, 6 + round, 700].iter().map(|t| place(&triangles, *t)).collect();
            let region = broad_phase.region.clone();
            let found = broad_phase.candidates(&points, &triangles, &places);
            rebuilds += u32::from(
                region.is_none_or(|r| !places.iter().all(|p| r.contains(r.cells_of(&p.1)))),
            );
            assert!(found.is_sorted_by(|a, b| a < b) && found.len() < triangles.len());
            let wanted = overlapping(&triangles, &places);
            assert!(
                wanted.len() > 20 && wanted.iter().all(|t| found.binary_search(t).is_ok()),
                "round {round}"
            );
            // Remove triangles, near and far; append them again, and in some rounds drop the last.
            let gone = [round, 40 + round, 300 + 5 * round, 701];
            let lost: Vec<[u32; 3]> = gone.iter().map(|t| triangles[*t as usize]).collect();
            let mut k = 0..;
            triangles.retain(|_| k.next().is_some_and(|k| !gone.contains(&k)));
            broad_phase.remove(&gone);
            triangles.extend(&lost);
            if round % 3 == 0 {
                let n = triangles.len() - 1;
                broad_phase.candidates(&points, &triangles, &places);
                triangles.truncate(n);
                broad_phase.truncate(n);
            }
        }
        assert!((1..12).contains(&rebuilds), "{rebuilds}");
    }
}
