//! Where layers intersect: found once, for pictures and for the lines of a page.

use if_core::intersect::segment_triangle;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{TrianglePair, own_pairs, pairs_between};

/// The pairs of triangles of different layers that intersect.
///
/// [`preview`](crate::preview) and [`Viewer`](crate::Viewer) look for them themselves; who draws both
/// needs to look only once.
#[derive(Debug)]
pub struct Intersections<'a> {
    meshes: Vec<&'a TriMesh>,
    trees: Vec<Bvh>,
    between: Vec<([usize; 2], Vec<TrianglePair>)>,
}

impl<'a> Intersections<'a> {
    /// Looks for the pairs of `layers`.
    pub fn between(layers: &[&'a TriMesh]) -> Self {
        let trees: Vec<Bvh> = layers.iter().map(|mesh| Bvh::new(mesh)).collect();
        let between = pairs_between(&trees);
        Self { meshes: layers.to_vec(), trees, between }
    }

    /// The layers.
    pub(crate) fn layers(&self) -> &[&'a TriMesh] {
        &self.meshes
    }

    /// The triangles of each layer that intersect another layer, in ascending order.
    pub(crate) fn triangles(&self) -> Vec<Vec<u32>> {
        let mut found = vec![Vec::new(); self.meshes.len()];
        for ([a, b], pairs) in &self.between {
            found[*a].extend(pairs.iter().map(|pair| pair.a));
            found[*b].extend(pairs.iter().map(|pair| pair.b));
        }
        for triangles in &mut found {
            triangles.sort_unstable();
            triangles.dedup();
        }
        found
    }

    /// The line in which each pair of triangles of different layers meets. Pairs that only touch, or lie
    /// in one plane, have none.
    pub(crate) fn lines(&self) -> Vec<[Point; 2]> {
        let of = |([a, b], pairs): &([usize; 2], Vec<TrianglePair>)| {
            lines([self.meshes[*a], self.meshes[*b]], pairs)
        };
        self.between.iter().flat_map(of).collect()
    }

    /// The same for pairs of one layer.
    pub(crate) fn own_lines(&self, layer: usize) -> Vec<[Point; 2]> {
        let mesh = self.meshes[layer];
        lines([mesh; 2], &own_pairs(mesh, &self.trees[layer]))
    }
}

fn lines([a, b]: [&TriMesh; 2], pairs: &[TrianglePair]) -> Vec<[Point; 2]> {
    let of = |pair: &TrianglePair| line(a.corners(pair.a as usize), b.corners(pair.b as usize));
    pairs.iter().filter_map(of).collect()
}

/// The ends are where an edge of one triangle passes through the other.
fn line(a: [&Point; 3], b: [&Point; 3]) -> Option<[Point; 2]> {
    let mut ends = Vec::with_capacity(2);
    for (edges, other) in [(a, b), (b, a)] {
        for k in 0..3 {
            let (p, q) = (edges[k], edges[(k + 1) % 3]);
            if let Some(passage) = segment_triangle(p, q, other) {
                ends.push(p + (q - p) * passage.parameter);
            }
        }
    }
    // More than two, if they meet in a corner or edge: the two that are farthest apart.
    let first = *ends.first()?;
    let from = farthest(&ends, &first);
    let to = farthest(&ends, &from);
    (from != to).then_some([from, to])
}

fn farthest(points: &[Point], from: &Point) -> Point {
    let distance = |p: &&Point| (*p - from).norm_squared();
    let found = points.iter().max_by(|p, q| distance(p).total_cmp(&distance(q)));
    *found.unwrap_or(from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_crossing_triangles_meet_in_a_line() {
        let p = |x: f64, y: f64, z: f64| Point::new(x, y, z);
        let flat = [p(0.0, 0.0, 0.0), p(4.0, 0.0, 0.0), p(0.0, 4.0, 0.0)];
        let upright = [p(1.0, 1.0, -1.0), p(1.0, 1.0, 1.0), p(9.0, 1.0, 0.0)];
        let [from, to] = line(flat.each_ref(), upright.each_ref()).unwrap();
        let mut ends = [from.x, to.x];
        ends.sort_by(f64::total_cmp);
        approx::assert_relative_eq!(ends[0], 1.0, epsilon = 1e-12);
        approx::assert_relative_eq!(ends[1], 3.0, epsilon = 1e-12);
        assert!((from.y - 1.0).abs() < 1e-12 && from.z.abs() < 1e-12);
        // A corner that only touches has no line.
        let touching = [p(1.0, 1.0, 0.0), p(1.0, 1.0, 1.0), p(2.0, 1.0, 1.0)];
        assert!(line(flat.each_ref(), touching.each_ref()).is_none());
    }
}
