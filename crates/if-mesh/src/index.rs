//! A bounding volume hierarchy over the triangles of a mesh: nearest points, boxes, segments, and
//! pairs of triangles of two meshes whose boxes overlap.
//!
//! Nodes are stored depth first, so that a left child follows its parent; the corners of the
//! triangles are copied in leaf order, so that a leaf reads contiguous memory. Splits are at the
//! median of the longest side of the centroids' box, ties broken by triangle index: the tree, and
//! with it every result, depends on the mesh alone. [`Bvh::refit`] follows moved vertices without a
//! rebuild.

mod build;
mod closest;
mod moving_pairs;
mod nearby;
mod nearest_pairs;
mod pairs;
mod segment;
#[cfg(test)]
mod tests;

pub use closest::distance_bound;
pub use moving_pairs::MovingPair;
pub use nearby::Nearby;
pub(crate) use nearest_pairs::NearPair;
pub use segment::Hit;

use build::{FORK, Item, build, node_count, rank, refit};
use if_core::aabb::Aabb;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use rayon::prelude::*;

/// Upper bound on the depth of a tree over 2³² triangles, as splits are at the median.
const STACK: usize = 32;

#[derive(Clone, Copy, Debug)]
struct Node {
    aabb: Aabb,
    /// A leaf's first triangle in leaf order, or an inner node's right child.
    at: u32,
    /// Triangles of a leaf; zero for an inner node.
    count: u32,
}

/// A bounding volume hierarchy over the triangles of a mesh.
///
/// It owns a copy of the corners that it was built from or last refitted to.
///
/// # Examples
///
/// ```
/// use if_core::{closest::ClosestPoint, math::Point, shapes::meshes};
/// let tree = if_mesh::index::Bvh::new(&meshes::icosphere(1.0, 4));
/// let nearest = tree.closest(&Point::new(0.0, 0.0, 3.0), 10.0).expect("within 10 m");
/// assert!((nearest.distance - 2.0).abs() < 1e-2);
/// ```
#[derive(Clone, Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Triangle of the mesh, in leaf order.
    order: Vec<u32>,
    /// Vertex indices in leaf order.
    indices: Vec<[u32; 3]>,
    /// Corners in leaf order.
    corners: Vec<[Point; 3]>,
}

/// The content of a node of a [`Bvh`].
pub(crate) enum Branch<'a> {
    /// Two nodes.
    Inner(u32, u32),
    /// The corners of some triangles.
    Leaf(&'a [[Point; 3]]),
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

    /// Follows moved vertices, in linear time. The tree keeps its shape: results are exact, but slow
    /// after motions that are large compared with the mesh.
    ///
    /// # Panics
    ///
    /// If there are fewer positions than the mesh had vertices, or one is not finite: boxes leave NaN
    /// out, so that pairs of its triangles would be lost.
    pub fn refit(&mut self, positions: &[Point]) {
        // Without branches, so that it vectorises.
        let finite = positions.iter().flat_map(|p| p.iter()).fold(true, |ok, x| ok & x.is_finite());
        assert!(finite, "all positions must be finite; check them before a refit");
        if !self.is_empty() {
            refit(positions, &self.indices, &mut self.corners, &mut self.nodes);
        }
    }

    /// Number of nodes. Children have larger numbers than their parents; node 0 holds all.
    pub(crate) fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// The content of a node, for callers that store more per node than its box.
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

    /// Whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// The box of all triangles; [`Aabb::EMPTY`] if there are none.
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
}

#[inline]
fn corner_box(c: &[Point; 3]) -> Aabb {
    Aabb { min: c[0], max: c[0] }.grown_to(&c[1]).grown_to(&c[2])
}
