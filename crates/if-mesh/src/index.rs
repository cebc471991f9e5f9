//! A bounding volume hierarchy over the triangles of a mesh: nearest points, boxes, segments, and
//! pairs of triangles of two meshes whose boxes overlap.
//!
//! Nodes are stored depth first, so that a left child follows its parent; the corners of the
//! triangles are copied in leaf order, so that a leaf reads one stretch of memory. Splits are at
//! the median of the longest side of the centroids' box, ties broken by triangle index: the tree,
//! and with it every answer, depends on the mesh alone. [`Bvh::refit`] follows moved vertices
//! without a rebuild.

use if_core::aabb::Aabb;
use if_core::closest::{Closest, ClosestPoint, Feature, closest_on_triangle};
use if_core::math::{Point, Real, barycentric_point};
use if_core::mesh::TriMesh;
use rayon::prelude::*;

/// Triangles in a leaf at most. 4 was fastest of 2, 4 and 8 on the garments of the test data.
const LEAF: usize = 4;
/// Depth that no tree over 2³² triangles exceeds, as splits are at the median.
const STACK: usize = 64;

#[derive(Clone, Copy, Debug)]
struct Node {
    aabb: Aabb,
    /// A leaf's first triangle in leaf order, or an inner node's right child.
    at: u32,
    /// Triangles of a leaf; zero for an inner node.
    count: u32,
}

/// The hierarchy. It owns a copy of the corners it was built from or last refitted to.
#[derive(Clone, Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Triangle of the mesh for each place in leaf order.
    order: Vec<u32>,
    /// Vertex indices in leaf order.
    indices: Vec<[u32; 3]>,
    /// Corners in leaf order.
    corners: Vec<[Point; 3]>,
}

/// What a node of a [`Bvh`] holds.
pub(crate) enum Branch<'a> {
    /// Two nodes.
    Inner(u32, u32),
    /// The corners of some triangles.
    Leaf(&'a [[Point; 3]]),
}

/// Where a segment meets a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The triangle.
    pub triangle: u32,
    /// Place along the segment, from 0 to 1.
    pub parameter: Real,
}

impl Bvh {
    /// Builds the hierarchy, in O(n log n).
    pub fn new(mesh: &TriMesh) -> Self {
        let n = mesh.triangles().len();
        let middle = |t: usize| {
            let [a, b, c] = mesh.corners(t);
            let middle = (a.coords + b.coords + c.coords) / 3.0;
            Item { place: [middle.x, middle.y, middle.z].map(rank), triangle: t as u32 }
        };
        let mut items: Vec<Item> = (0..n).into_par_iter().with_min_len(FORK).map(middle).collect();
        let mut nodes = vec![
            Node { aabb: Aabb::EMPTY, at: 0, count: 0 };
            if n > 0 { node_count(n) } else { 0 }
        ];
        let mut corners = vec![[Point::origin(); 3]; n];
        if n > 0 {
            build(mesh, &mut items, &mut corners, &mut nodes, 0, 0);
        }
        let order: Vec<u32> = items.iter().map(|i| i.triangle).collect();
        let indices = order.iter().map(|&t| mesh.triangles()[t as usize]).collect();
        Self { nodes, order, indices, corners }
    }

    /// Follows moved vertices, in linear time. The tree's shape stays: answers are exact, but slow
    /// after motions that are large against the mesh.
    ///
    /// # Panics
    ///
    /// If there are fewer positions than the mesh had vertices.
    pub fn refit(&mut self, positions: &[Point]) {
        for (corners, tri) in self.corners.iter_mut().zip(&self.indices) {
            *corners = tri.map(|v| positions[v as usize]);
        }
        for n in (0..self.nodes.len()).rev() {
            let node = self.nodes[n];
            self.nodes[n].aabb = if node.count > 0 {
                let first = node.at as usize;
                self.corners[first..first + node.count as usize]
                    .iter()
                    .flatten()
                    .fold(Aabb::EMPTY, |b, p| b.grown_to(p))
            } else {
                self.nodes[n + 1].aabb.merged(&self.nodes[node.at as usize].aabb)
            };
        }
    }

    /// Number of nodes. Children have larger numbers than their parents; node 0 holds all.
    pub(crate) fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// What a node holds: for those who keep more with a node than its box.
    pub(crate) fn branch(&self, node: u32) -> Branch<'_> {
        let n = &self.nodes[node as usize];
        if n.count > 0 {
            Branch::Leaf(&self.corners[n.at as usize..(n.at + n.count) as usize])
        } else {
            Branch::Inner(node + 1, n.at)
        }
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// The box round all triangles; [`Aabb::EMPTY`] where there are none.
    pub fn aabb(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |n| n.aabb)
    }

    /// Calls `visit` with every triangle whose box overlaps `region`, in a fixed order.
    pub fn overlapping(&self, region: &Aabb, mut visit: impl FnMut(u32)) {
        self.overlapping_corners(region, |t, _| visit(t));
    }

    /// The same with the corners of each triangle.
    pub(crate) fn overlapping_corners(
        &self,
        region: &Aabb,
        mut visit: impl FnMut(u32, &[Point; 3]),
    ) {
        let mut n = 0;
        let mut stack = [0u32; STACK];
        let mut top = 0;
        if self.nodes.is_empty() {
            return;
        }
        loop {
            let node = &self.nodes[n];
            if node.aabb.overlaps(region) {
                if node.count == 0 {
                    stack[top] = node.at;
                    top += 1;
                    n += 1;
                    continue;
                }
                for k in node.at as usize..(node.at + node.count) as usize {
                    if corner_box(&self.corners[k]).overlaps(region) {
                        visit(self.order[k], &self.corners[k]);
                    }
                }
            }
            if top == 0 {
                return;
            }
            top -= 1;
            n = stack[top] as usize;
        }
    }

    /// The first place where the segment from `from` to `to` meets a triangle for which `accept`
    /// holds. In floating point: a segment that grazes an edge may miss both triangles there.
    pub fn first_hit(
        &self,
        from: &Point,
        to: &Point,
        mut accept: impl FnMut(u32) -> bool,
    ) -> Option<Hit> {
        let direction = to - from;
        let mut best: Option<Hit> = None;
        let mut stack = vec![0u32];
        if self.nodes.is_empty() {
            return None;
        }
        while let Some(n) = stack.pop() {
            let node = &self.nodes[n as usize];
            let limit = best.map_or(1.0, |h| h.parameter);
            if !segment_meets_box(from, &direction, limit, &node.aabb) {
                continue;
            }
            if node.count == 0 {
                stack.push(node.at);
                stack.push(n + 1);
                continue;
            }
            for k in node.at as usize..(node.at + node.count) as usize {
                let limit = best.map_or(1.0, |h| h.parameter);
                if let Some(parameter) = segment_meets_triangle(from, &direction, &self.corners[k])
                    && parameter <= limit
                    && best.is_none_or(|h| parameter < h.parameter)
                    && accept(self.order[k])
                {
                    best = Some(Hit { triangle: self.order[k], parameter });
                }
            }
        }
        best
    }

    /// Pairs (triangle here, triangle of `other`) whose boxes overlap and for which `keep` gives a
    /// value, in a fixed order whatever the number of threads.
    pub fn overlapping_pairs<T: Send>(
        &self,
        other: &Bvh,
        keep: impl Fn(u32, &[Point; 3], u32, &[Point; 3]) -> Option<T> + Sync,
    ) -> Vec<T> {
        self.near_pairs(other, |i, ti, j, tj| {
            if corner_box(ti).overlaps(&corner_box(tj)) { keep(i, ti, j, tj) } else { None }
        })
    }

    /// The same of pairs whose boxes overlap or are apart by the rounding to single precision: for
    /// tests of triangles that need no boxes to be right, and say no in the time in which the exact
    /// boxes would be compared.
    pub(crate) fn near_pairs<T: Send>(
        &self,
        other: &Bvh,
        keep: impl Fn(u32, &[Point; 3], u32, &[Point; 3]) -> Option<T> + Sync,
    ) -> Vec<T> {
        if !self.aabb().overlaps(&other.aabb()) {
            return Vec::new();
        }
        let (here, there) = rayon::join(|| Rough::new(self), || Rough::new(other));
        self.search_pairs(other, &here, &there, false, keep)
    }

    /// Pairs of two triangles of this tree whose boxes overlap, or are apart by the rounding to
    /// single precision, and for which `keep` gives a value, each pair once, in a fixed order
    /// whatever the number of threads.
    pub(crate) fn own_near_pairs<T: Send>(
        &self,
        keep: impl Fn(u32, &[Point; 3], u32, &[Point; 3]) -> Option<T> + Sync,
    ) -> Vec<T> {
        if self.is_empty() {
            return Vec::new();
        }
        let rough = Rough::new(self);
        self.search_pairs(self, &rough, &rough, true, keep)
    }

    /// The search of both; `own` is that of a tree with itself.
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
                // What is on the stack overlaps: `open` saw to that.
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

/// A box in single precision, rounded outwards. The fourth numbers always overlap: four numbers are
/// compared at once, without a branch that could be foretold badly.
#[derive(Clone, Copy)]
struct RoughBox {
    min: [f32; 4],
    max: [f32; 4],
}

impl RoughBox {
    fn new(b: &Aabb) -> Self {
        let (l, h) = (b.min.map(below), b.max.map(above));
        Self { min: [l.x, l.y, l.z, 0.0], max: [h.x, h.y, h.z, 0.0] }
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
fn below(x: Real) -> f32 {
    let f = x as f32;
    // Infinite less infinite is no number, of which the minimum takes the other.
    (f - f.abs() * ULP - f32::MIN_POSITIVE).min(f32::MAX)
}

/// A number in single precision above `x`, by two units in the last place at most.
#[inline]
fn above(x: Real) -> f32 {
    -below(-x)
}

/// What the search for pairs visits most, packed: half the bytes of the exact boxes. Made anew for
/// each search, which takes a hundredth of its time.
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
    fn new(tree: &Bvh) -> Self {
        let link =
            |n: &Node| Link { at: n.at, count: n.count, extent: n.aabb.size().norm_squared() };
        Self {
            nodes: tree.nodes.iter().map(|n| RoughBox::new(&n.aabb)).collect(),
            links: tree.nodes.iter().map(link).collect(),
            triangles: tree.corners.iter().map(|c| RoughBox::new(&corner_box(c))).collect(),
        }
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
        push(left, left);
        if self.nodes[left as usize].meets(&self.nodes[right as usize]) {
            push(left, right);
        }
        push(right, right);
        true
    }
}

impl ClosestPoint for Bvh {
    fn closest(&self, p: &Point, max_distance: Real) -> Option<Closest> {
        if max_distance.is_nan() || max_distance < 0.0 {
            return None;
        }
        let mut limit = max_distance * max_distance;
        let mut best: Option<(usize, [Real; 3], Feature, Point)> = None;
        let mut stack = [(0u32, 0.0); STACK];
        let mut top = 0;
        let mut n = 0u32;
        if self.nodes.is_empty() || self.nodes[0].aabb.distance_squared(p) > limit {
            return None;
        }
        loop {
            let node = &self.nodes[n as usize];
            if node.count == 0 {
                let (left, right) = (n + 1, node.at);
                let dl = self.nodes[left as usize].aabb.distance_squared(p);
                let dr = self.nodes[right as usize].aabb.distance_squared(p);
                let (near, dn, far, df) =
                    if dl <= dr { (left, dl, right, dr) } else { (right, dr, left, dl) };
                if df <= limit {
                    stack[top] = (far, df);
                    top += 1;
                }
                if dn <= limit {
                    n = near;
                    continue;
                }
            } else {
                for k in node.at as usize..(node.at + node.count) as usize {
                    // Of most triangles their box says enough. (Within rounding it decides which of
                    // two equally near ones is named.)
                    if corner_box(&self.corners[k]).distance_squared(p) > limit * (1.0 + 1e-12) {
                        continue;
                    }
                    let [a, b, c] = &self.corners[k];
                    let (w, feature) = closest_on_triangle(p, a, b, c);
                    let q = barycentric_point([a, b, c], w);
                    let d = (p - q).norm_squared();
                    if d < limit || (d == limit && best.is_none()) {
                        limit = d;
                        best = Some((k, w, feature, q));
                    }
                }
            }
            loop {
                if top == 0 {
                    return best.map(|(k, barycentric, feature, point)| Closest {
                        point,
                        distance: limit.sqrt(),
                        triangle: self.order[k],
                        barycentric,
                        feature,
                    });
                }
                top -= 1;
                if stack[top].1 < limit || (best.is_none() && stack[top].1 <= limit) {
                    n = stack[top].0;
                    break;
                }
            }
        }
    }
}

/// Nodes of a tree over `n` triangles, which its splits at the median fix.
fn node_count(n: usize) -> usize {
    if n <= LEAF { 1 } else { 1 + node_count(n / 2) + node_count(n - n / 2) }
}

/// Subtrees of more triangles than this are built by two tasks: 2048 take about 0.2 ms, a task some
/// µs.
const FORK: usize = 2048;

/// A triangle to be put in its place.
struct Item {
    /// Ranks of the centroid's coordinates.
    place: [i64; 3],
    triangle: u32,
}

/// An integer that is larger for a larger number, as [`Real::total_cmp`] has it.
#[inline]
fn rank(x: Real) -> i64 {
    let bits = x.to_bits() as i64;
    bits ^ (i64::MAX & (bits >> 63))
}

/// The number of a [`rank`].
#[inline]
fn of_rank(r: i64) -> Real {
    Real::from_bits((r ^ (i64::MAX & (r >> 63))) as u64)
}

/// The axis along which the centroids extend the furthest, the first of equal ones.
fn longest_side(items: &[Item]) -> usize {
    let (mut low, mut high) = ([i64::MAX; 3], [i64::MIN; 3]);
    for item in items {
        for k in 0..3 {
            low[k] = low[k].min(item.place[k]);
            high[k] = high[k].max(item.place[k]);
        }
    }
    let side = [0, 1, 2].map(|k| of_rank(high[k]) - of_rank(low[k]));
    Point::from(side).coords.imax()
}

/// Moves the first `middle` items along an axis before the others, ties broken by triangle index.
fn split<const AXIS: usize>(items: &mut [Item], middle: usize) {
    items.select_nth_unstable_by(middle, |a, b| {
        let (x, y) = (a.place[AXIS], b.place[AXIS]);
        if x == y { a.triangle.cmp(&b.triangle) } else { x.cmp(&y) }
    });
}

/// Builds the tree over `items` into `nodes`, whose first is node `here` of the whole, and copies
/// their corners in leaf order; `first` is the place of the first item. Returns the box.
fn build(
    mesh: &TriMesh,
    items: &mut [Item],
    corners: &mut [[Point; 3]],
    nodes: &mut [Node],
    here: u32,
    first: u32,
) -> Aabb {
    if items.len() <= LEAF {
        let mut aabb = Aabb::EMPTY;
        for (c, item) in corners.iter_mut().zip(items.iter()) {
            *c = mesh.corners(item.triangle as usize).map(|p| *p);
            aabb = aabb.merged(&corner_box(c));
        }
        nodes[0] = Node { aabb, at: first, count: items.len() as u32 };
        return aabb;
    }
    let middle = items.len() / 2;
    match longest_side(items) {
        0 => split::<0>(items, middle),
        1 => split::<1>(items, middle),
        _ => split::<2>(items, middle),
    }
    // The order inside the halves is the algorithm's own, but the same for the same input.
    let fork = items.len() > FORK;
    let (left, right) = items.split_at_mut(middle);
    let (left_corners, right_corners) = corners.split_at_mut(middle);
    let (node, below) = nodes.split_at_mut(1);
    let (left_nodes, right_nodes) = below.split_at_mut(node_count(middle));
    let child = here + 1 + left_nodes.len() as u32;
    let mut build_left = || build(mesh, left, left_corners, left_nodes, here + 1, first);
    let mut build_right =
        || build(mesh, right, right_corners, right_nodes, child, first + middle as u32);
    let (a, b) =
        if fork { rayon::join(build_left, build_right) } else { (build_left(), build_right()) };
    let aabb = a.merged(&b);
    node[0] = Node { aabb, at: child, count: 0 };
    aabb
}

#[inline]
fn corner_box(c: &[Point; 3]) -> Aabb {
    Aabb { min: c[0].inf(&c[1]).inf(&c[2]), max: c[0].sup(&c[1]).sup(&c[2]) }
}

fn segment_meets_box(
    from: &Point,
    direction: &if_core::math::Vector,
    limit: Real,
    b: &Aabb,
) -> bool {
    let (mut t0, mut t1) = (0.0, limit);
    for k in 0..3 {
        if direction[k] == 0.0 {
            if from[k] < b.min[k] || from[k] > b.max[k] {
                return false;
            }
            continue;
        }
        let inverse = 1.0 / direction[k];
        let (u, v) = ((b.min[k] - from[k]) * inverse, (b.max[k] - from[k]) * inverse);
        t0 = Real::max(t0, u.min(v));
        t1 = Real::min(t1, u.max(v));
    }
    t0 <= t1
}

/// Möller and Trumbore 1997, both sides.
fn segment_meets_triangle(
    from: &Point,
    direction: &if_core::math::Vector,
    [a, b, c]: &[Point; 3],
) -> Option<Real> {
    let (e1, e2) = (b - a, c - a);
    let h = direction.cross(&e2);
    let det = e1.dot(&h);
    if det == 0.0 {
        return None;
    }
    let inverse = 1.0 / det;
    let s = from - a;
    let u = s.dot(&h) * inverse;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let q = s.cross(&e1);
    let v = direction.dot(&q) * inverse;
    if v < 0.0 || u + v > 1.0 {
        return None;
    }
    let t = e2.dot(&q) * inverse;
    (0.0..=1.0).contains(&t).then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_nearer_than_a_negative_distance() {
        let tree = Bvh::new(&if_core::shapes::meshes::icosphere(1.0, 1));
        let p = Point::new(1.5, 0.0, 0.0);
        assert!(tree.closest(&p, 1.0).is_some() && tree.closest(&p, 0.1).is_none());
        for limit in [-1.0, -1e-300, Real::NEG_INFINITY, Real::NAN] {
            assert_eq!(tree.closest(&p, limit), None, "{limit}");
        }
        assert!(
            tree.closest(&tree.corners[0][0], 0.0).is_some(),
            "what lies on it is at distance zero"
        );
    }

    /// A bumpy sheet with some far and some degenerate triangles.
    fn sheet(n: u32) -> TriMesh {
        let mut v = Vec::new();
        let mut t = Vec::new();
        for y in 0..=n {
            for x in 0..=n {
                let (x, y) = (f64::from(x) / f64::from(n), f64::from(y) / f64::from(n));
                v.push(Point::new(x, y, 0.1 * (9.0 * x).sin() * (7.0 * y).cos()));
            }
        }
        for y in 0..n {
            for x in 0..n {
                let a = y * (n + 1) + x;
                t.push([a, a + 1, a + n + 2]);
                t.push([a, a + n + 2, a + n + 1]);
            }
        }
        let k = v.len() as u32;
        v.extend([Point::new(9.0, 9.0, 9.0); 3]);
        t.push([k, k + 1, k + 2]);
        TriMesh::new(v, t).unwrap()
    }

    fn points(n: u64) -> Vec<Point> {
        let mut state = 7u64;
        let mut next = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64 * 1.6 - 0.3
        };
        (0..n).map(|_| Point::new(next(), next(), next() * 0.4)).collect()
    }

    #[test]
    fn nearest_points_agree_with_all_triangles() {
        let mesh = sheet(12);
        let bvh = Bvh::new(&mesh);
        for p in points(500) {
            let all = (0..mesh.triangles().len())
                .map(|t| {
                    let c = mesh.corners(t);
                    (barycentric_point(c, closest_on_triangle(&p, c[0], c[1], c[2]).0) - p).norm()
                })
                .fold(Real::INFINITY, Real::min);
            let got = bvh.closest(&p, Real::INFINITY).unwrap();
            approx::assert_relative_eq!(got.distance, all, epsilon = 1e-14);
            approx::assert_relative_eq!((got.point - p).norm(), all, epsilon = 1e-14);
            assert!(bvh.closest(&p, all * 0.999).is_none());
            assert!(bvh.closest(&p, all * 1.001 + 1e-12).is_some());
        }
    }

    #[test]
    fn a_refitted_tree_answers_as_a_new_one() {
        let mesh = sheet(10);
        let moved = mesh
            .with_vertices(
                mesh.vertices().iter().map(|p| Point::new(p.z, p.x * 2.0, p.y + p.x)).collect(),
            )
            .unwrap();
        let mut refitted = Bvh::new(&mesh);
        refitted.refit(moved.vertices());
        let fresh = Bvh::new(&moved);
        for p in points(200) {
            let (a, b) = (refitted.closest(&p, 1.0), fresh.closest(&p, 1.0));
            assert_eq!(a.map(|c| c.distance), b.map(|c| c.distance));
        }
    }

    #[test]
    fn boxes_pairs_and_segments_agree_with_all_triangles() {
        let mesh = sheet(9);
        let bvh = Bvh::new(&mesh);
        let region = Aabb { min: Point::new(0.2, 0.1, -0.02), max: Point::new(0.4, 0.35, 0.05) };
        let mut got = Vec::new();
        bvh.overlapping(&region, |t| got.push(t));
        got.sort_unstable();
        let all: Vec<u32> = (0..mesh.triangles().len() as u32)
            .filter(|&t| Aabb::from_points(mesh.corners(t as usize)).overlaps(&region))
            .collect();
        assert_eq!(got, all);

        let other = mesh
            .with_vertices(
                mesh.vertices().iter().map(|p| Point::new(p.x + 0.03, p.y - 0.02, -p.z)).collect(),
            )
            .unwrap();
        let other_bvh = Bvh::new(&other);
        let mut pairs = bvh.overlapping_pairs(&other_bvh, |a, _, b, _| Some((a, b)));
        pairs.sort_unstable();
        let mut all = Vec::new();
        for a in 0..mesh.triangles().len() {
            for b in 0..other.triangles().len() {
                if Aabb::from_points(mesh.corners(a)).overlaps(&Aabb::from_points(other.corners(b)))
                {
                    all.push((a as u32, b as u32));
                }
            }
        }
        assert_eq!(pairs, all);

        let hit = bvh
            .first_hit(&Point::new(0.52, 0.53, 1.0), &Point::new(0.52, 0.53, -1.0), |_| true)
            .unwrap();
        let z = 1.0 - 2.0 * hit.parameter;
        let [a, b, c] = mesh.corners(hit.triangle as usize);
        let n = if_core::math::area_vector(a, b, c);
        approx::assert_relative_eq!(n.dot(&(Point::new(0.52, 0.53, z) - a)), 0.0, epsilon = 1e-12);
        assert!(
            bvh.first_hit(&Point::new(0.5, 0.5, 1.0), &Point::new(0.5, 0.5, 0.5), |_| true)
                .is_none()
        );
    }

    #[test]
    fn rough_numbers_lie_closely_on_their_sides_and_ranks_in_order() {
        let tiny = [0.0, 5e-324, 1e-310, 1e-45, 1.5e-45, 1e-38, 1.2e-38];
        let large = [3.4028234e38, 3.4028236e38, 1e39, Real::MAX, Real::INFINITY];
        let middle = points(300).into_iter().flat_map(|p| {
            [p.x, p.y * 1e-3, p.z * 1e9, f64::from(p.x as f32), f64::from((p.y as f32).next_up())]
        });
        let all: Vec<Real> =
            tiny.into_iter().chain(large).chain(middle).flat_map(|x| [x, -x]).collect();
        for &x in &all {
            let (l, h) = (f64::from(below(x)), f64::from(above(x)));
            assert!(l <= x && x <= h, "{l} {x} {h}");
            if x.abs() < 1e38 {
                assert!(h - l <= 5.0 * f64::from(f32::EPSILON) * x.abs() + 5e-38, "{l} {x} {h}");
            }
            assert_eq!(of_rank(rank(x)).to_bits(), x.to_bits());
        }
        for (x, y) in all.iter().zip(&all[1..]) {
            assert_eq!(rank(*x).cmp(&rank(*y)), x.total_cmp(y));
        }
    }

    #[test]
    fn an_empty_mesh_has_no_answers() {
        let bvh = Bvh::new(&TriMesh::default());
        assert!(bvh.is_empty() && bvh.closest(&Point::origin(), Real::INFINITY).is_none());
        bvh.overlapping(&Aabb { min: Point::origin(), max: Point::origin() }, |_| {
            panic!("nothing to visit")
        });
        assert!(bvh.overlapping_pairs(&bvh, |a, _, b, _| Some((a, b))).is_empty());
    }
}
