//! Pairs of triangles whose boxes overlap, of two trees or of one.

use super::{Bvh, Node, corner_box};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
use rayon::prelude::*;

impl Bvh {
    /// The values that `keep` returns for pairs (triangle here, triangle of `other`) whose boxes
    /// overlap, in an order that does not depend on the number of threads.
    pub fn overlapping_pairs<T: Send>(
        &self,
        other: &Bvh,
        keep: impl Fn(u32, &[Point; 3], u32, &[Point; 3]) -> Option<T> + Sync,
    ) -> Vec<T> {
        self.near_pairs(other, |i, ti, j, tj| {
            if corner_box(ti).overlaps(&corner_box(tj)) { keep(i, ti, j, tj) } else { None }
        })
    }

    /// The same for pairs whose boxes overlap, or are apart by less than the rounding to single
    /// precision: for tests that are exact without boxes, and reject a pair as fast as a comparison
    /// of exact boxes.
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
        self.search_pairs(other, &here, &there, false, keep)
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
        self.search_pairs(self, &rough, &rough, true, keep)
    }

    /// The values that `keep` returns for pairs of two triangles of this tree, of which at least one
    /// `is_searched`, whose boxes are nearer than `distance` along each axis: each pair once, in an
    /// order that does not depend on the number of threads. What is not searched costs nothing.
    pub fn own_pairs_within<T: Send>(
        &self,
        distance: Real,
        is_searched: impl Fn(u32) -> bool,
        keep: impl Fn(u32, &[Point; 3], u32, &[Point; 3]) -> Option<T> + Sync,
    ) -> Vec<T> {
        if self.is_empty() {
            return Vec::new();
        }
        let rough = Rough::new(self, 0.5 * distance, is_searched);
        self.search_pairs(self, &rough, &rough, true, keep)
    }

    /// The search of both; `own` searches a tree against itself.
    fn search_pairs<T: Send>(
        &self,
        other: &Bvh,
        here: &Rough,
        there: &Rough,
        own: bool,
        keep: impl Fn(u32, &[Point; 3], u32, &[Point; 3]) -> Option<T> + Sync,
    ) -> Vec<T> {
        let open = |a: u32, b: u32, push: &mut dyn FnMut(u32, u32)| {
            if own && a == b {
                here.open_with_itself(a, push)
            } else {
                here.open(there, a, b, push)
            }
        };
        // Open the upper levels breadth first until there is work for many tasks, then go deep.
        let mut front = vec![(0u32, 0u32)];
        while front.len() < 256 {
            let before = front.len();
            let mut opened_any = false;
            let mut next = Vec::with_capacity(2 * before);
            for &(a, b) in &front {
                let opened = open(a, b, &mut |a, b| next.push((a, b)));
                if !opened {
                    next.push((a, b));
                }
                opened_any |= opened;
            }
            front = next;
            if !opened_any || front.is_empty() {
                break;
            }
        }
        let parts: Vec<Vec<T>> = front
            .par_iter()
            .map(|&(a, b)| {
                let mut found = Vec::new();
                let mut stack = vec![(a, b)];
                // All pairs on the stack overlap: `open` pushes no others.
                while let Some((a, b)) = stack.pop() {
                    if open(a, b, &mut |a, b| stack.push((a, b))) {
                        continue;
                    }
                    let (na, nb) = (&here.links[a as usize], &there.links[b as usize]);
                    let box_b = &there.nodes[b as usize];
                    for i in na.at as usize..(na.at + na.count) as usize {
                        let box_i = &here.triangles[i];
                        if !box_i.meets(box_b) {
                            continue;
                        }
                        let first = if own && a == b { i + 1 } else { nb.at as usize };
                        for j in first..(nb.at + nb.count) as usize {
                            if box_i.meets(&there.triangles[j])
                                && let Some(value) = keep(
                                    self.order[i],
                                    &self.corners[i],
                                    other.order[j],
                                    &other.corners[j],
                                )
                            {
                                found.push(value);
                            }
                        }
                    }
                }
                found
            })
            .collect();
        parts.into_iter().flatten().collect()
    }
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

/// The nodes of a tree as the search for pairs needs them, packed in half the bytes of the exact
/// boxes. Built for each search.
struct Rough {
    nodes: Vec<RoughBox>,
    links: Vec<Link>,
    /// In leaf order.
    triangles: Vec<RoughBox>,
}

/// A node without its box.
struct Link {
    at: u32,
    count: u32,
    /// Squared diagonal of the box.
    extent: Real,
}

impl Rough {
    /// With boxes that are larger by `margin` on each side.
    fn new(tree: &Bvh, margin: Real, is_searched: impl Fn(u32) -> bool) -> Self {
        let link =
            |n: &Node| Link { at: n.at, count: n.count, extent: n.aabb.size().norm_squared() };
        let wide = |(c, t): (&[Point; 3], &u32)| {
            RoughBox::new(&corner_box(c).inflated(margin), is_searched(*t))
        };
        let triangles: Vec<RoughBox> = tree.corners.iter().zip(&tree.order).map(wide).collect();
        // Rounding keeps order: a node's box is that of its parts. Children come after their parents.
        let mut nodes = vec![RoughBox::EMPTY; tree.nodes.len()];
        for (k, n) in tree.nodes.iter().enumerate().rev() {
            let at = n.at as usize;
            nodes[k] = if n.count > 0 {
                let parts = triangles[at..at + n.count as usize].iter();
                parts.fold(RoughBox::EMPTY, |all, part| all.union(part))
            } else {
                nodes[k + 1].union(&nodes[at])
            };
        }
        Self { nodes, links: tree.nodes.iter().map(link).collect(), triangles }
    }

    /// Replaces a pair of overlapping nodes by its overlapping children, the larger node opened.
    /// False, and nothing pushed, for two leaves.
    #[inline]
    fn open(&self, other: &Rough, a: u32, b: u32, push: &mut dyn FnMut(u32, u32)) -> bool {
        let (na, nb) = (&self.links[a as usize], &other.links[b as usize]);
        if na.count > 0 && nb.count > 0 {
            return false;
        }
        let open_a = nb.count > 0 || (na.count == 0 && na.extent >= nb.extent);
        let pairs = if open_a { [(a + 1, b), (na.at, b)] } else { [(a, b + 1), (a, nb.at)] };
        for (x, y) in pairs {
            if self.nodes[x as usize].meets(&other.nodes[y as usize]) {
                push(x, y);
            }
        }
        true
    }

    /// Replaces a node paired with itself by the pairs of its children, each pair once. False, and
    /// nothing pushed, for a leaf.
    #[inline]
    fn open_with_itself(&self, n: u32, push: &mut dyn FnMut(u32, u32)) -> bool {
        let link = &self.links[n as usize];
        if link.count > 0 {
            return false;
        }
        let (left, right) = (n + 1, link.at);
        for (x, y) in [(left, left), (left, right), (right, right)] {
            if self.nodes[x as usize].meets(&self.nodes[y as usize]) {
                push(x, y);
            }
        }
        true
    }
}
