//! Intersections that a change adds, found without looking at the whole mesh.

use crate::index::Bvh;
use crate::intersections::own_pairs;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;

/// Cells along each side of the box round the suspects. A garment of 1 m has cells of 3 cm, a few holes wide; more
/// make the marking dear, fewer let more of the mesh through.
const CELLS: usize = 32;

/// Pairs of triangles that meet beyond their common corners and of which one at least is in `suspects`, ascending.
///
/// The triangles that cannot meet a suspect are left out by a coarse grid; the others go through the exact test.
pub(super) fn meeting(points: &[Point], triangles: &[[u32; 3]], suspects: &[u32]) -> Vec<[u32; 2]> {
    meeting_among(points, triangles, suspects, &near(points, triangles, suspects, 0.0))
}

/// Triangles whose boxes come within `margin` of one of `suspects`, in metres, and some more; ascending, suspects included.
pub(super) fn near(points: &[Point], triangles: &[[u32; 3]], suspects: &[u32], margin: Real) -> Vec<u32> {
    if suspects.is_empty() {
        return Vec::new();
    }
    let aabb = |t: u32| Aabb::from_points(triangles[t as usize].iter().map(|v| &points[*v as usize]));
    let region = suspects.iter().fold(Aabb::EMPTY, |b, &t| b.merged(&aabb(t))).inflated(margin);
    let size = region.size();
    let cell = |p: &Point, axis: usize| {
        let x = (p[axis] - region.min[axis]) / size[axis].max(f64::MIN_POSITIVE) * CELLS as f64;
        (x as usize).min(CELLS - 1) // negative ones become 0
    };
    let cells = |b: &Aabb| {
        let range = |axis: usize| cell(&b.min, axis)..=cell(&b.max, axis);
        let (y, z) = (range(1), range(2));
        range(0).flat_map(move |i| {
            let z = z.clone();
            y.clone().flat_map(move |j| z.clone().map(move |k| (i * CELLS + j) * CELLS + k))
        })
    };
    let mut marked = vec![false; CELLS * CELLS * CELLS];
    let mut is_suspect = vec![false; triangles.len()];
    for &t in suspects {
        is_suspect[t as usize] = true;
        cells(&aabb(t).inflated(margin)).for_each(|c| marked[c] = true);
    }
    (0..triangles.len() as u32)
        .filter(|&t| {
            let b = aabb(t);
            is_suspect[t as usize] || (b.overlaps(&region) && cells(&b).any(|c| marked[c]))
        })
        .collect()
}

/// [`meeting`] where only the triangles `near`, ascending, can meet a suspect.
pub(super) fn meeting_among(points: &[Point], triangles: &[[u32; 3]], suspects: &[u32], near: &[u32]) -> Vec<[u32; 2]> {
    let mut used: Vec<u32> = near.iter().flat_map(|t| triangles[*t as usize]).collect();
    used.sort_unstable();
    used.dedup();
    let name = |v: u32| used.binary_search(&v).map_or(0, |k| k as u32);
    let part_points = used.iter().map(|v| points[*v as usize]).collect();
    let part: Vec<[u32; 3]> = near.iter().map(|t| triangles[*t as usize].map(name)).collect();
    let is_suspect: Vec<bool> = near.iter().map(|t| suspects.binary_search(t).is_ok()).collect();
    let part = TriMesh::new(part_points, part).expect("a part of a mesh is a mesh");
    let found = own_pairs(&part, &Bvh::new(&part));
    let of_suspects = found.iter().filter(|p| is_suspect[p.a as usize] || is_suspect[p.b as usize]);
    let mut pairs: Vec<[u32; 2]> = of_suspects.map(|p| [near[p.a as usize], near[p.b as usize]]).collect();
    pairs.sort_unstable();
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::shapes::meshes::icosphere;

    #[test]
    fn the_grid_leaves_no_pair_out() {
        let (a, b) = (icosphere(0.3, 2), icosphere(0.2, 2));
        let mut points = a.vertices().to_vec();
        let base = points.len() as u32;
        points.extend(b.vertices().iter().map(|p| p + Vector::new(0.21, 0.05, 0.02)));
        let mut triangles = a.triangles().to_vec();
        triangles.extend(b.triangles().iter().map(|t| t.map(|v| v + base)));
        let mesh = TriMesh::new(points.clone(), triangles.clone()).unwrap();
        let all: Vec<[u32; 2]> = own_pairs(&mesh, &Bvh::new(&mesh)).iter().map(|p| [p.a, p.b]).collect();
        assert!(all.len() > 20);
        let everyone: Vec<u32> = (0..triangles.len() as u32).collect();
        assert_eq!(meeting(&points, &triangles, &everyone), all);
        let some: Vec<u32> = (0..triangles.len() as u32).filter(|t| t % 7 == 0).collect();
        let of_some: Vec<[u32; 2]> = all.iter().filter(|p| p[0] % 7 == 0 || p[1] % 7 == 0).copied().collect();
        assert_eq!(meeting(&points, &triangles, &some), of_some);
        assert!(meeting(&points, &triangles, &[]).is_empty());
    }
}
