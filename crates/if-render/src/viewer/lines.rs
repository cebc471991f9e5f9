//! The lines in which layers intersect.

use if_core::intersect::segment_triangle;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{TrianglePair, own_pairs, pairs_between};

/// The line in which each pair of intersecting triangles meets, of two layers or of one. Pairs that
/// only touch, or lie in one plane, have none.
pub(super) fn intersections(meshes: &[&TriMesh]) -> Vec<[Point; 2]> {
    let trees: Vec<Bvh> = meshes.iter().map(|mesh| Bvh::new(mesh)).collect();
    let own = meshes.iter().zip(&trees).enumerate();
    let own = own.map(|(k, (mesh, tree))| ([k, k], own_pairs(mesh, tree)));
    let found = pairs_between(&trees).into_iter().chain(own);
    let corners = |mesh: usize, triangle: u32| meshes[mesh].corners(triangle as usize);
    let line =
        |[a, b]: [usize; 2], pair: TrianglePair| line(corners(a, pair.a), corners(b, pair.b));
    found.flat_map(|(at, pairs)| pairs.into_iter().filter_map(move |pair| line(at, pair))).collect()
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
