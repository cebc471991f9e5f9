//! The part of a mesh that lies near its rims, so that what is done there need not look at all of
//! it.

use super::marks::{CellBox, Marks, merged};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
use rayon::prelude::*;

/// The vicinity reaches so many sides of the boxes it is made for beyond them: rims move by one or
/// two, and what is smoothed with them lies within three rings, seldom twelve. A smaller reach
/// finds it anew more often, a larger one holds more triangles; what is found is the same.
const REACH: Real = 4.0;

/// Points or triangles for a task, at least.
const TASK: usize = 1 << 13;

/// Triangles that reach into some cells of space: all that do, and perhaps others.
#[derive(Clone, Debug, Default)]
pub(super) struct Vicinity {
    marks: Option<Marks>,
    /// Triangles below `known`, ascending, each with the cells that it reached since this was
    /// found.
    near: Vec<(u32, CellBox)>,
    /// Triangles from here on were added since, and all belong to it.
    known: u32,
}

impl Vicinity {
    /// Whether it was never found.
    pub(super) fn is_unknown(&self) -> bool {
        self.marks.is_none()
    }

    /// All triangles, ascending, that can meet one of `places`, and perhaps others. Those of
    /// `places` themselves, ascending, may be anywhere in their boxes from now on; the others stay
    /// where they are.
    pub(super) fn of(
        &mut self,
        points: &[Point],
        triangles: &[[u32; 3]],
        places: &[(u32, Aabb)],
    ) -> Vec<u32> {
        if let Some(marks) = &self.marks {
            let boxes: Vec<CellBox> = places.iter().map(|p| marks.range(&p.1)).collect();
            if boxes.iter().all(|b| marks.hold(*b)) {
                let here = marks.with(boxes.iter().copied());
                let mut next = places.iter().zip(boxes).peekable();
                let mut found = Vec::new();
                for (t, b) in &mut self.near {
                    if let Some((_, place)) = next.next_if(|n| n.0.0 == *t) {
                        *b = merged(*b, place);
                        found.push(*t);
                    } else if here.touch(*b) {
                        found.push(*t);
                    }
                }
                found.extend(self.known..triangles.len() as u32);
                return found;
            }
        }
        self.find(points, triangles, places);
        self.of(points, triangles, places)
    }

    /// Finds the vicinity of `places` anew.
    pub(super) fn find(
        &mut self,
        points: &[Point],
        triangles: &[[u32; 3]],
        places: &[(u32, Aabb)],
    ) {
        let side =
            places.iter().map(|p| p.1.size().max()).sum::<Real>() / places.len().max(1) as Real;
        let wide: Vec<Aabb> = places.iter().map(|p| p.1.inflated(REACH * side)).collect();
        let marks = Marks::new(&wide);
        let (at, is_marked): (Vec<[u8; 3]>, Vec<bool>) = points
            .par_iter()
            .with_min_len(TASK)
            .map(|p| {
                let cell = marks.cell(p);
                (cell, marks.touch([cell, cell]))
            })
            .unzip();
        let reached = |(k, t): (usize, &[u32; 3])| {
            let [a, b, c] = t.map(|v| at[v as usize]);
            let within_one = a == b && b == c;
            let cells = if within_one { [a, a] } else { merged([a, a], merged([b, b], [c, c])) };
            (is_marked[t[0] as usize] || (!within_one && marks.touch(cells)))
                .then_some((k as u32, cells))
        };
        self.near =
            triangles.par_iter().with_min_len(TASK).enumerate().filter_map(reached).collect();
        self.known = triangles.len() as u32;
        self.marks = Some(marks);
    }

    /// Triangles `gone`, ascending, are no more, and those behind them have moved up.
    pub(super) fn without(&mut self, gone: &[u32]) {
        let mut before = 0;
        self.near.retain_mut(|(t, _)| {
            while before < gone.len() && gone[before] < *t {
                before += 1;
            }
            let stays = gone.get(before) != Some(t);
            *t -= before as u32;
            stays
        });
        self.known -= gone.partition_point(|t| *t < self.known) as u32;
    }

    /// Only the first `triangles` are left.
    pub(super) fn truncate(&mut self, triangles: usize) {
        self.known = self.known.min(triangles as u32);
        self.near.truncate(self.near.partition_point(|n| n.0 < self.known));
    }
}

#[cfg(test)]
mod tests {
    use super::super::guard::bounds;
    use super::*;
    use if_core::shapes::meshes::icosphere;

    #[test]
    fn all_that_reach_a_place_are_visited_whatever_went_and_came() {
        let ball = icosphere(0.3, 3);
        let (points, mut triangles) = (ball.vertices().to_vec(), ball.triangles().to_vec());
        let place = |triangles: &[[u32; 3]], t: u32| {
            (t, bounds(triangles[t as usize].map(|v| &points[v as usize])))
        };
        let reach = |triangles: &[[u32; 3]], places: &[(u32, Aabb)]| -> Vec<u32> {
            let all = 0..triangles.len() as u32;
            all.filter(|t| places.iter().any(|p| p.1.overlaps(&place(triangles, *t).1))).collect()
        };
        let mut vicinity = Vicinity::default();
        let mut finds = 0;
        for round in 0..12u32 {
            let places: Vec<(u32, Aabb)> =
                [5 + round, 6 + round, 700].iter().map(|t| place(&triangles, *t)).collect();
            let marked = vicinity.marks.clone();
            let found = vicinity.of(&points, &triangles, &places);
            finds +=
                u32::from(marked.is_none_or(|m| !places.iter().all(|p| m.hold(m.range(&p.1)))));
            assert!(found.is_sorted_by(|a, b| a < b) && found.len() < triangles.len());
            let wanted = reach(&triangles, &places);
            assert!(
                wanted.len() > 20 && wanted.iter().all(|t| found.binary_search(t).is_ok()),
                "round {round}"
            );
            // Some go, near and far; some come back at the end, and not all of these stay.
            let gone = [round, 40 + round, 300 + 5 * round, 701];
            let lost: Vec<[u32; 3]> = gone.iter().map(|t| triangles[*t as usize]).collect();
            let mut k = 0..;
            triangles.retain(|_| k.next().is_some_and(|k| !gone.contains(&k)));
            vicinity.without(&gone);
            triangles.extend(&lost);
            if round % 3 == 0 {
                let n = triangles.len() - 1;
                vicinity.of(&points, &triangles, &places);
                triangles.truncate(n);
                vicinity.truncate(n);
            }
        }
        assert!((1..12).contains(&finds), "{finds}");
    }
}
