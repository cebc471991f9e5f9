//! Pairs of triangles that may meet while their corners move in straight lines.

use super::{Bvh, corner_box};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

/// Pairs of nodes from which the search goes on in parallel.
const TASKS: usize = 256;
/// Distance of boxes that counts as overlap, in metres: more than rounding of coordinates of a
/// hundred metres.
const SLACK: Real = 1e-12;

/// Two triangles of one mesh, by index, and their corners before and after a motion.
#[derive(Clone, Copy, Debug)]
pub struct MovingPair<'a> {
    /// The indices, in no order.
    pub triangles: [u32; 2],
    /// The corners of both before.
    pub start: [&'a [Point; 3]; 2],
    /// The corners of both after.
    pub end: [&'a [Point; 3]; 2],
}

impl Bvh {
    /// The values that `keep` returns for pairs of two triangles of this tree that may meet while
    /// each corner moves in a straight line, and all at the same time, from where it is here to where
    /// it is in `end`: each pair once, in an order that does not depend on the number of threads; `None` if
    /// `keep` breaks, which ends the search.
    ///
    /// What triangles have in common of their motions counts for nothing: a crowd that moves as a
    /// whole gives the pairs of one that stands.
    ///
    /// # Panics
    ///
    /// If `end` is not this tree after a [`refit`](Bvh::refit).
    pub fn own_pairs_in_motion<T: Send>(
        &self,
        end: &Bvh,
        keep: impl Fn(MovingPair<'_>) -> ControlFlow<(), Option<T>> + Sync,
    ) -> Option<Vec<T>> {
        assert!(self.order == end.order, "a tree of the same shape");
        if self.is_empty() {
            return Some(Vec::new());
        }
        let has_ended = AtomicBool::new(false);
        let search = Search::new(self, end);
        let mut front = vec![(0u32, 0u32)];
        while front.len() < TASKS {
            let mut next = Vec::with_capacity(2 * front.len());
            let mut is_open = false;
            for &pair in &front {
                let was_opened = search.open(pair, &mut |pair| next.push(pair));
                if !was_opened {
                    next.push(pair);
                }
                is_open |= was_opened;
            }
            front = next;
            if !is_open || front.is_empty() {
                break;
            }
        }
        let parts: Vec<Vec<T>> = front
            .par_iter()
            .map(|pair| {
                let (mut found, mut stack) = (Vec::new(), vec![*pair]);
                while let Some(pair) = stack.pop() {
                    if has_ended.load(Ordering::Relaxed) {
                        break;
                    }
                    if !search.open(pair, &mut |pair| stack.push(pair))
                        && search.leaves(pair, &keep, &mut found).is_break()
                    {
                        has_ended.store(true, Ordering::Relaxed);
                    }
                }
                found
            })
            .collect();
        (!has_ended.into_inner()).then(|| parts.into_iter().flatten().collect())
    }
}

/// A box of positions before, and of displacements.
#[derive(Clone, Copy)]
struct Moving {
    at: Aabb,
    by: Aabb,
}

impl Moving {
    fn new(start: &[Point; 3], end: &[Point; 3]) -> Self {
        let by = [0, 1, 2].map(|k| Point::from(end[k] - start[k]));
        Self { at: corner_box(start), by: corner_box(&by) }
    }

    fn merged(&self, other: &Self) -> Self {
        Self { at: self.at.merged(&other.at), by: self.by.merged(&other.by) }
    }

    /// Whether the boxes may overlap at some time from 0 to 1: the difference of positions is in the
    /// box of differences before, and moves by at most the differences of displacements.
    #[inline]
    fn may_meet(&self, other: &Self) -> bool {
        (0..3).all(|k| {
            let nearer = (self.by.min[k] - other.by.max[k]).min(0.0);
            let farther = (self.by.max[k] - other.by.min[k]).max(0.0);
            self.at.min[k] - other.at.max[k] + nearer <= SLACK
                && self.at.max[k] - other.at.min[k] + farther >= -SLACK
        })
    }
}

struct Search<'a> {
    start: &'a Bvh,
    end: &'a Bvh,
    nodes: Vec<Moving>,
    /// In leaf order.
    triangles: Vec<Moving>,
}

impl<'a> Search<'a> {
    fn new(start: &'a Bvh, end: &'a Bvh) -> Self {
        let both = start.corners.par_iter().zip(&end.corners).with_min_len(1024);
        let triangles: Vec<Moving> = both.map(|(s, e)| Moving::new(s, e)).collect();
        let none = Moving { at: Aabb::EMPTY, by: Aabb::EMPTY };
        let mut nodes = vec![none; start.nodes.len()];
        for n in (0..nodes.len()).rev() {
            let node = &start.nodes[n];
            nodes[n] = if node.count > 0 {
                let first = node.at as usize;
                triangles[first..first + node.count as usize]
                    .iter()
                    .fold(none, |all, one| all.merged(one))
            } else {
                nodes[n + 1].merged(&nodes[node.at as usize])
            };
        }
        Self { start, end, nodes, triangles }
    }

    /// Replaces a pair of nodes by the pairs of children that may meet, the larger node opened. False,
    /// and nothing pushed, for two leaves.
    fn open(&self, (a, b): (u32, u32), push: &mut dyn FnMut((u32, u32))) -> bool {
        let [na, nb] = [a, b].map(|n| &self.start.nodes[n as usize]);
        if na.count > 0 && nb.count > 0 {
            return false;
        }
        if a == b {
            push((a + 1, a + 1));
            push((na.at, na.at));
        }
        let extent = |n: u32| self.start.nodes[n as usize].aabb.size().norm_squared();
        let pairs = if a == b {
            [Some((a + 1, na.at)), None]
        } else if nb.count > 0 || (na.count == 0 && extent(a) >= extent(b)) {
            [Some((a + 1, b)), Some((na.at, b))]
        } else {
            [Some((a, b + 1)), Some((a, nb.at))]
        };
        for (x, y) in pairs.into_iter().flatten() {
            if self.nodes[x as usize].may_meet(&self.nodes[y as usize]) {
                push((x, y));
            }
        }
        true
    }

    /// Visits the pairs of triangles of two leaves, until `keep` breaks.
    fn leaves<T>(
        &self,
        (a, b): (u32, u32),
        keep: &impl Fn(MovingPair<'_>) -> ControlFlow<(), Option<T>>,
        found: &mut Vec<T>,
    ) -> ControlFlow<()> {
        let range = |n: u32| {
            let node = &self.start.nodes[n as usize];
            node.at as usize..(node.at + node.count) as usize
        };
        for i in range(a) {
            for j in range(b).filter(|j| a != b || i < *j) {
                if self.triangles[i].may_meet(&self.triangles[j]) {
                    found.extend(keep(MovingPair {
                        triangles: [i, j].map(|k| self.start.order[k]),
                        start: [i, j].map(|k| &self.start.corners[k]),
                        end: [i, j].map(|k| &self.end.corners[k]),
                    })?);
                }
            }
        }
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::shapes::meshes::icosphere;

    #[test]
    fn pairs_that_meet_on_the_way_are_found_and_common_motion_adds_none() {
        let mesh = icosphere(0.5, 3);
        let start = Bvh::new(&mesh);
        let moved = |by: &dyn Fn(&Point) -> Point| {
            let mut end = start.clone();
            end.refit(&mesh.vertices().iter().map(by).collect::<Vec<_>>());
            let found = start.own_pairs_in_motion(&end, |pair| {
                let [a, b] = pair.triangles;
                ControlFlow::Continue(Some([a.min(b), a.max(b)]))
            });
            let mut pairs = found.unwrap();
            pairs.sort_unstable();
            pairs
        };
        let still = moved(&|p| *p);
        let mut slow = Vec::new();
        for j in 0..mesh.triangles().len() {
            for i in 0..j {
                let [a, b] = [i, j].map(|t| Aabb::from_points(mesh.corners(t)));
                if a.inflated(1e-13).overlaps(&b) {
                    slow.push([i as u32, j as u32]);
                }
            }
        }
        slow.sort_unstable();
        assert_eq!(still, slow);
        // A metre to the side, all together.
        assert_eq!(moved(&|p| p + Vector::new(1.0, 0.25, 0.0)), still);
        // Turned inside out: every triangle passes the opposite one.
        let inside_out = moved(&|p| -p);
        let opposite = |t: usize| {
            let middle =
                |t: usize| mesh.corners(t).iter().fold(Vector::zeros(), |s, p| s + p.coords) / 3.0;
            let far = |u: usize| (middle(u) + middle(t)).norm();
            (0..mesh.triangles().len()).min_by(|a, b| far(*a).total_cmp(&far(*b))).unwrap()
        };
        for t in (0..mesh.triangles().len()).step_by(17) {
            let u = opposite(t);
            let pair = [t.min(u) as u32, t.max(u) as u32];
            assert!(inside_out.binary_search(&pair).is_ok(), "{pair:?}");
        }
    }
}
