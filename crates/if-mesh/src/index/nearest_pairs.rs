//! The nearest pair of triangles of two trees, or of one.

use super::{Bvh, corner_box};
use if_core::distance::{DistanceBounds, are_apart, triangle_distance};
use if_core::math::{Point, Real};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Boxes are compared with the limit times this: rounding of a sum of squares never prunes the
/// nearest pair. At 1 it does; larger values test more pairs.
const WIDER: Real = 1.0 + 1e-9;

/// Pairs of nodes from which the search goes on in parallel.
const TASKS: usize = 256;

/// A pair of triangles with its distance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearPair {
    pub(crate) bounds: DistanceBounds,
    /// Triangle of the one and of the other tree.
    pub(crate) triangles: [u32; 2],
}

impl Bvh {
    /// The nearest pair of a triangle here and one of `other` with bounds that hold for all pairs.
    /// Of equally near pairs the first by index. `None` if there is no pair.
    pub(crate) fn nearest_pair(&self, other: &Bvh) -> Option<NearPair> {
        Search::new(self, other, false).run()
    }

    /// The same for two triangles of this tree that share no corner, by index or by position.
    pub(crate) fn nearest_own_pair(&self) -> Option<NearPair> {
        Search::new(self, self, true).run()
    }
}

struct Search<'a> {
    here: &'a Bvh,
    there: &'a Bvh,
    /// Of a tree against itself.
    own: bool,
    /// The bits of the least upper bound so far. Those of positive numbers are ordered as these.
    limit: AtomicU64,
}

impl<'a> Search<'a> {
    fn new(here: &'a Bvh, there: &'a Bvh, own: bool) -> Self {
        Self { here, there, own, limit: AtomicU64::new(Real::INFINITY.to_bits()) }
    }

    fn limit(&self) -> Real {
        Real::from_bits(self.limit.load(Ordering::Relaxed))
    }

    /// A pair that is left out at a larger limit is left out at a smaller one. So all pairs that the
    /// final limit lets through have been measured, whatever the order was, and these alone count.
    fn run(&self) -> Option<NearPair> {
        if self.here.is_empty() || self.there.is_empty() {
            return None;
        }
        let mut front = vec![(0u32, 0u32)];
        while front.len() < TASKS {
            let mut next = Vec::with_capacity(2 * front.len());
            let mut is_open = false;
            for &(a, b) in &front {
                let was_opened = self.open(a, b, &mut |a, b| next.push((a, b)));
                if !was_opened {
                    next.push((a, b));
                }
                is_open |= was_opened;
            }
            front = next;
            if !is_open {
                break;
            }
        }
        // The nearest first: they lower the limit for the others.
        front.sort_by(|a, b| self.gap_squared(*a).total_cmp(&self.gap_squared(*b)));
        let measured: Vec<Vec<(NearPair, [u32; 2])>> =
            front.par_iter().map(|pair| self.search(*pair)).collect();
        let limit = self.limit();
        let counts =
            |(_, [i, j]): &&(NearPair, [u32; 2])| !self.is_pruned(*i as usize, *j as usize, limit);
        let all = measured.iter().flatten().filter(counts).map(|(pair, _)| *pair);
        all.reduce(|a, b| {
            let key = |p: &NearPair| (p.bounds.upper, p.triangles);
            let nearest = if key(&b) < key(&a) { b } else { a };
            let lower = a.bounds.lower.min(b.bounds.lower);
            NearPair { bounds: DistanceBounds { lower, ..nearest.bounds }, ..nearest }
        })
    }

    /// The pairs below two nodes that may be the nearest, with their places in leaf order.
    fn search(&self, pair: (u32, u32)) -> Vec<(NearPair, [u32; 2])> {
        let mut found = Vec::new();
        let mut stack = vec![(self.gap_squared(pair), pair)];
        while let Some((gap_squared, (a, b))) = stack.pop() {
            let limit = self.limit();
            if gap_squared > limit * limit * WIDER {
                continue;
            }
            let first = stack.len();
            let was_opened =
                self.open(a, b, &mut |a, b| stack.push((self.gap_squared((a, b)), (a, b))));
            if was_opened {
                // The nearest is taken first.
                stack[first..].sort_by(|a, b| b.0.total_cmp(&a.0));
            } else {
                self.measure(a, b, &mut found);
            }
        }
        found
    }

    /// Measures the pairs of two leaves.
    fn measure(&self, a: u32, b: u32, found: &mut Vec<(NearPair, [u32; 2])>) {
        let (na, nb) = (&self.here.nodes[a as usize], &self.there.nodes[b as usize]);
        for i in na.at as usize..(na.at + na.count) as usize {
            let first = if self.own && a == b { i + 1 } else { nb.at as usize };
            for j in first..(nb.at + nb.count) as usize {
                if self.own && share(&self.here.indices[i], &self.here.indices[j])
                    || self.is_pruned(i, j, self.limit())
                {
                    continue;
                }
                let (mut ti, mut tj) = (self.here.order[i], self.there.order[j]);
                let [mut ci, mut cj] = self.corners(i, j);
                // The same bits whichever of the two comes first in the tree.
                if self.own && tj < ti {
                    (ti, tj, ci, cj) = (tj, ti, cj, ci);
                }
                let bounds = triangle_distance(ci.each_ref(), cj.each_ref());
                if self.own && bounds.upper <= 0.0 && share(ci, cj) {
                    continue;
                }
                self.limit.fetch_min(bounds.upper.to_bits(), Ordering::Relaxed);
                if bounds.lower <= self.limit() {
                    found.push((NearPair { bounds, triangles: [ti, tj] }, [i as u32, j as u32]));
                }
            }
        }
    }

    /// Whether boxes or planes show that two triangles, by their places in leaf order, are farther
    /// apart than `limit`.
    fn is_pruned(&self, i: usize, j: usize, limit: Real) -> bool {
        let [ci, cj] = self.corners(i, j);
        corner_box(ci).gap_squared(&corner_box(cj)) > limit * limit * WIDER
            || are_apart(ci.each_ref(), cj.each_ref(), limit)
    }

    fn corners(&self, i: usize, j: usize) -> [&'a [Point; 3]; 2] {
        [&self.here.corners[i], &self.there.corners[j]]
    }

    fn gap_squared(&self, (a, b): (u32, u32)) -> Real {
        self.here.nodes[a as usize].aabb.gap_squared(&self.there.nodes[b as usize].aabb)
    }

    /// Replaces a pair of nodes by pairs of children, the larger node opened; a node paired with
    /// itself by each pair once. False, and nothing pushed, for two leaves.
    fn open(&self, a: u32, b: u32, push: &mut dyn FnMut(u32, u32)) -> bool {
        let (na, nb) = (&self.here.nodes[a as usize], &self.there.nodes[b as usize]);
        if na.count > 0 && nb.count > 0 {
            return false;
        }
        if self.own && a == b {
            let (left, right) = (a + 1, na.at);
            push(left, left);
            push(left, right);
            push(right, right);
            return true;
        }
        let extent = |b: &super::Node| b.aabb.size().norm_squared();
        if nb.count > 0 || (na.count == 0 && extent(na) >= extent(nb)) {
            push(a + 1, b);
            push(na.at, b);
        } else {
            push(a, b + 1);
            push(a, nb.at);
        }
        true
    }
}

/// Whether the two have a corner in common.
#[inline]
fn share<T: PartialEq>(a: &[T; 3], b: &[T; 3]) -> bool {
    a.iter().any(|corner| b.contains(corner))
}
