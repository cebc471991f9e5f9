//! Pairs of triangles whose boxes overlap, of two trees or of one.

use super::build::LEAF;
use super::{Bvh, Node, corner_box};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
use rayon::prelude::*;

impl Bvh {
    /// The values that `keep` returns for pairs (triangle here, triangle of `other`) whose boxes
    /// overlap, or are apart by less than the rounding to single precision, in an order that does not
    /// depend on the number of threads: for tests that are exact without boxes, and reject a pair as
    /// fast as a comparison of exact boxes.
    pub(crate) fn near_pairs<T: Send>(
        &self,
        other: &Bvh,
        keep: impl Fn(u32, &[Point; 3], u32, &[Point; 3]) -> Option<T> + Sync,
    ) -> Vec<T> {
        if !self.aabb().overlaps(&other.aabb()) {
            return Vec::new();
        }
        let rough = |tree| Rough::new(tree, 0.0, all);
        let (here, there) = rayon::join(|| rough(self), || rough(other));
        self.search_pairs(other, &here, &there, false, kept(keep))
    }

    /// The same for pairs of two triangles of this tree, of which at least one `is_searched`, each pair
    /// once.
    pub(crate) fn own_near_pairs<T: Send>(
        &self,
        is_searched: impl Fn(u32) -> bool,
        keep: impl Fn(u32, &[Point; 3], u32, &[Point; 3]) -> Option<T> + Sync,
    ) -> Vec<T> {
        if self.is_empty() {
            return Vec::new();
        }
        let rough = Rough::new(self, 0.0, is_searched);
        self.search_pairs(self, &rough, &rough, true, kept(keep))
    }

    /// What `visit` appends for pairs of two triangles of this tree, of which at least one
    /// `is_searched`, whose boxes are nearer than `distance` along each axis: each pair once, in an
    /// order that does not depend on the number of threads. What is not searched costs nothing.
    pub fn own_pairs_within<T: Send>(
        &self,
        distance: Real,
        is_searched: impl Fn(u32) -> bool,
        visit: impl Fn(u32, &[Point; 3], u32, &[Point; 3], &mut Vec<T>) + Sync,
    ) -> Vec<T> {
        if self.is_empty() {
            return Vec::new();
        }
        let rough = Rough::new(self, 0.5 * distance, is_searched);
        self.search_pairs(self, &rough, &rough, true, visit)
    }

    /// The search of both; `own` searches a tree against itself.
    fn search_pairs<T: Send>(
        &self,
        other: &Bvh,
        here: &Rough,
        there: &Rough,
        own: bool,
        visit: impl Fn(u32, &[Point; 3], u32, &[Point; 3], &mut Vec<T>) + Sync,
    ) -> Vec<T> {
        // Open the upper levels breadth first until there is work for many tasks, then go deep.
        let mut front = vec![(0u32, 0u32)];
        while front.len() < 256 {
            let mut opened_any = false;
            let mut next = Vec::with_capacity(3 * front.len());
            for &(a, b) in &front {
                match here.open(there, (a, b), own) {
                    Some(parts) => {
                        opened_any = true;
                        next.extend(parts.into_iter().filter(|p| here.meet(there, *p)));
                    }
                    None => next.push((a, b)),
                }
            }
            front = next;
            if !opened_any || front.is_empty() {
                break;
            }
        }
        let parts: Vec<Vec<T>> = front
            .par_iter()
            .map(|&pair| {
                let mut found = Vec::new();
                here.search(there, pair, own, |near| {
                    for (i, j) in near.iter().map(|&(i, j)| (i as usize, j as usize)) {
                        let (ti, tj) = (&self.corners[i], &other.corners[j]);
                        visit(self.order[i], ti, other.order[j], tj, &mut found);
                    }
                });
                found
            })
            .collect();
        parts.into_iter().flatten().collect()
    }
}

/// Pairs of triangles that are collected before they are looked at closely: the loops that compare
/// boxes stay short.
const BATCH: usize = 256;
/// Most pairs of the triangles of two leaves.
const MOST_NEAR: usize = LEAF * LEAF;

/// A visit that appends what `keep` returns.
fn kept<T>(
    keep: impl Fn(u32, &[Point; 3], u32, &[Point; 3]) -> Option<T> + Sync,
) -> impl Fn(u32, &[Point; 3], u32, &[Point; 3], &mut Vec<T>) + Sync {
    move |i, ti, j, tj, found| found.extend(keep(i, ti, j, tj))
}

/// All triangles are searched.
fn all(_: u32) -> bool {
    true
}

/// A box in single precision, rounded outwards. Four numbers are compared at once, without a branch
/// that may be mispredicted. The fourth ones overlap unless neither box holds a triangle that is
/// searched.
#[derive(Clone, Copy)]
struct RoughBox {
    min: [f32; 4],
    max: [f32; 4],
}

impl RoughBox {
    /// The box of no points.
    const EMPTY: Self = Self { min: [f32::INFINITY; 4], max: [f32::NEG_INFINITY; 4] };

    fn new(b: &Aabb, is_searched: bool) -> Self {
        let (l, h) = (b.min.map(below), b.max.map(above));
        // An interval that is turned around overlaps those that hold it, and not itself.
        let [from, to] = if is_searched { [-2.0, 2.0] } else { [1.0, -1.0] };
        Self { min: [l.x, l.y, l.z, from], max: [h.x, h.y, h.z, to] }
    }

    /// The box of both.
    #[inline]
    fn union(&self, other: &Self) -> Self {
        let each = |k: usize| (self.min[k].min(other.min[k]), self.max[k].max(other.max[k]));
        let all = [each(0), each(1), each(2), each(3)];
        Self { min: all.map(|e| e.0), max: all.map(|e| e.1) }
    }

    #[inline]
    fn meets(&self, other: &Self) -> bool {
        (0..4).fold(true, |all, k| {
            all & (self.min[k] <= other.max[k]) & (other.min[k] <= self.max[k])
        })
    }
}

/// More than the share that rounding to single precision, and then in the line that uses this, can
/// take.
const ULP: f32 = f32::EPSILON;

/// A number in single precision below `x`, by two units in the last place at most and the smallest
/// normal number. (Four operations, of three numbers at once: `next_down` took a twentieth of a
/// search.)
#[inline]
pub(super) fn below(x: Real) -> f32 {
    let f = x as f32;
    // Infinity minus infinity is NaN, for which `min` returns its other argument.
    (f - f.abs() * ULP - f32::MIN_POSITIVE).min(f32::MAX)
}

/// A number in single precision above `x`, by two units in the last place at most.
#[inline]
pub(super) fn above(x: Real) -> f32 {
    -below(-x)
}

/// The nodes of a tree as the search for pairs needs them, packed in less than the bytes of the exact
/// boxes. Built for each search.
struct Rough {
    nodes: Vec<RoughNode>,
    /// In leaf order.
    triangles: Vec<RoughBox>,
}

/// A node with a rough box.
struct RoughNode {
    bounds: RoughBox,
    at: u32,
    count: u32,
    /// Squared diagonal of the exact box.
    extent: Real,
}

impl Rough {
    /// With boxes that are larger by `margin` on each side.
    fn new(tree: &Bvh, margin: Real, is_searched: impl Fn(u32) -> bool) -> Self {
        let node = |n: &Node| RoughNode {
            bounds: RoughBox::EMPTY,
            at: n.at,
            count: n.count,
            extent: n.aabb.size().norm_squared(),
        };
        let wide = |(c, t): (&[Point; 3], &u32)| {
            RoughBox::new(&corner_box(c).inflated(margin), is_searched(*t))
        };
        let triangles: Vec<RoughBox> = tree.corners.iter().zip(&tree.order).map(wide).collect();
        // Rounding keeps order: a node's box is that of its parts. Children come after their parents.
        let mut nodes: Vec<RoughNode> = tree.nodes.iter().map(node).collect();
        for k in (0..nodes.len()).rev() {
            let (at, count) = (nodes[k].at as usize, nodes[k].count as usize);
            nodes[k].bounds = if count > 0 {
                let parts = triangles[at..at + count].iter();
                parts.fold(RoughBox::EMPTY, |all, part| all.union(part))
            } else {
                nodes[k + 1].bounds.union(&nodes[at].bounds)
            };
        }
        Self { nodes, triangles }
    }

    /// Whether the boxes of two nodes meet.
    #[inline]
    fn meet(&self, other: &Rough, (a, b): (u32, u32)) -> bool {
        self.nodes[a as usize].bounds.meets(&other.nodes[b as usize].bounds)
    }

    /// What replaces a pair of nodes: the larger one opened, and of a tree's own node with itself each
    /// pair of children once. None for two leaves.
    fn open(&self, other: &Rough, (a, b): (u32, u32), own: bool) -> Option<Vec<(u32, u32)>> {
        let (na, nb) = (&self.nodes[a as usize], &other.nodes[b as usize]);
        if na.count > 0 && nb.count > 0 {
            None
        } else if own && a == b {
            Some(na.own_children(a).to_vec())
        } else {
            Some(na.children((a, b), nb).to_vec())
        }
    }

    /// Visits the triangles below a pair of nodes whose boxes meet, by their places in leaf order, in
    /// batches: the loops that compare boxes stay short, and what is compared counts without a branch
    /// that may be mispredicted.
    #[inline]
    fn search(
        &self,
        other: &Rough,
        pair: (u32, u32),
        own: bool,
        mut visit: impl FnMut(&[(u32, u32)]),
    ) {
        let (mut near, mut count) = ([(0, 0); BATCH + MOST_NEAR], 0);
        let (mut stack, mut top) = (vec![pair; 64], 1);
        // All pairs below `top` meet.
        while top > 0 {
            top -= 1;
            let (a, b) = stack[top];
            let (na, nb) = (&self.nodes[a as usize], &other.nodes[b as usize]);
            if top + 3 > stack.len() {
                stack.resize(2 * stack.len(), pair);
            }
            let mut push = |pair: (u32, u32)| {
                stack[top] = pair;
                top += usize::from(self.meet(other, pair));
            };
            if na.count > 0 && nb.count > 0 {
                count += self.near_triangles(other, [na, nb], own && a == b, &mut near[count..]);
                if count >= BATCH {
                    visit(&near[..count]);
                    count = 0;
                }
            } else if own && a == b {
                na.own_children(a).into_iter().for_each(&mut push);
            } else {
                na.children((a, b), nb).into_iter().for_each(&mut push);
            }
        }
        visit(&near[..count]);
    }

    /// Writes the places of the triangles of two leaves whose boxes overlap; of one leaf, each pair
    /// once. Returns how many there are.
    #[inline]
    fn near_triangles(
        &self,
        other: &Rough,
        [a, b]: [&RoughNode; 2],
        is_one: bool,
        near: &mut [(u32, u32)],
    ) -> usize {
        let there = &other.triangles[b.at as usize..(b.at + b.count) as usize];
        let mut count = 0;
        for (i, box_i) in (a.at..).zip(&self.triangles[a.at as usize..(a.at + a.count) as usize]) {
            let skipped = if is_one { i + 1 - b.at } else { 0 };
            for (j, box_j) in (b.at + skipped..).zip(&there[skipped as usize..]) {
                near[count] = (i, j);
                count += usize::from(box_i.meets(box_j));
            }
        }
        count
    }
}

impl RoughNode {
    /// The pairs that replace this node, at `a`, and another one, at `b`, that are not both leaves: the
    /// larger one opened.
    #[inline]
    fn children(&self, (a, b): (u32, u32), other: &Self) -> [(u32, u32); 2] {
        let opens = other.count > 0 || (self.count == 0 && self.extent >= other.extent);
        if opens { [(a + 1, b), (self.at, b)] } else { [(a, b + 1), (a, other.at)] }
    }

    /// The pairs of children that replace this node, at `a`, paired with itself.
    #[inline]
    fn own_children(&self, a: u32) -> [(u32, u32); 3] {
        let (left, right) = (a + 1, self.at);
        [(left, left), (left, right), (right, right)]
    }
}
