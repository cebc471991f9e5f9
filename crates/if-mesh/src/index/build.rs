//! Builds the tree.

use super::{Node, corner_box};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;

/// Maximum triangles in a leaf. 4 was fastest of 2, 4 and 8 on the garments of the test data.
pub(super) const LEAF: usize = 4;

/// Number of nodes of a tree over `n` triangles, which splits at the median determine.
pub(super) fn node_count(n: usize) -> usize {
    // After some levels of splits each part has `size` triangles or one more.
    let mut levels = 0;
    while n >> levels > LEAF {
        levels += 1;
    }
    let (parts, size) = (1 << levels, n >> levels);
    let larger = n - size * parts;
    // Parts of one more than a leaf holds are split once more.
    let leaves = if size == LEAF { parts + larger } else { parts };
    2 * leaves - 1
}

/// Subtrees of more triangles than this are built by two tasks: 2048 take about 0.2 ms, a task some
/// µs.
pub(super) const FORK: usize = 2048;

/// A triangle to be sorted into the tree.
pub(super) struct Item {
    /// Ranks of the centroid's coordinates.
    pub(super) place: [i64; 3],
    pub(super) triangle: u32,
}

/// An integer with the order of [`Real::total_cmp`].
#[inline]
pub(super) fn rank(x: Real) -> i64 {
    let bits = x.to_bits() as i64;
    bits ^ (i64::MAX & (bits >> 63))
}

/// The inverse of [`rank`].
#[inline]
pub(super) fn of_rank(r: i64) -> Real {
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

/// Builds the tree over `items` into `nodes`, the first of which is node `here` of the whole tree,
/// and copies their corners in leaf order; `first` is the position of the first item. Returns the
/// box.
pub(super) fn build(
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
    // The order inside the halves depends on the selection algorithm, and is deterministic.
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

/// Moves the triangles of a subtree, whose nodes are `nodes`, and returns its box.
pub(super) fn refit(
    positions: &[Point],
    indices: &[[u32; 3]],
    corners: &mut [[Point; 3]],
    nodes: &mut [Node],
) -> Aabb {
    let (node, below) = nodes.split_at_mut(1);
    if node[0].count > 0 {
        let mut aabb = Aabb::EMPTY;
        for (c, tri) in corners.iter_mut().zip(indices) {
            *c = tri.map(|v| positions[v as usize]);
            aabb = aabb.merged(&corner_box(c));
        }
        node[0].aabb = aabb;
        return aabb;
    }
    // As `build` splits.
    let middle = indices.len() / 2;
    let fork = indices.len() > FORK;
    let (left, right) = indices.split_at(middle);
    let (left_corners, right_corners) = corners.split_at_mut(middle);
    let (left_nodes, right_nodes) = below.split_at_mut(node_count(middle));
    let mut refit_left = || refit(positions, left, left_corners, left_nodes);
    let mut refit_right = || refit(positions, right, right_corners, right_nodes);
    let (a, b) =
        if fork { rayon::join(refit_left, refit_right) } else { (refit_left(), refit_right()) };
    node[0].aabb = a.merged(&b);
    node[0].aabb
}
