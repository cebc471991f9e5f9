//! Triangles of zero area, and duplicate triangles.

use super::edit_mesh::EditMesh;
use super::half_edges::{HalfEdges, NONE, ends, next, previous};
use super::report::DegenerateReport;
use crate::validate::is_flat;
use if_core::math::Real;
use rayon::prelude::*;

/// Shortest over longest edge of a triangle of zero area up to which the short edge is collapsed. A
/// needle has 1e-12; a triangle with its three corners spread along a line has more.
const NEEDLE: Real = 1e-9;
/// Maximum number of rounds. Real meshes need one or two; what is left then is dropped.
const ROUNDS: usize = 6;

/// Removes duplicate triangles and those of zero area: needles by collapsing their short edge, the
/// others by flipping their longest edge, as far as possible. Also returns the half-edges of the result.
pub(super) fn remove_degenerate(work: &mut EditMesh) -> (DegenerateReport, HalfEdges) {
    let (duplicates, mut half_edges) = drop_duplicates(work);
    let mut report = DegenerateReport { duplicates, ..DegenerateReport::default() };
    for round in 0.. {
        let flat: Vec<u32> = (0..work.triangles.len())
            .into_par_iter()
            .with_min_len(1 << 13)
            .filter(|&t| work.is_flat(t))
            .map(|t| t as u32)
            .collect();
        if flat.is_empty() {
            break;
        }
        let changed = if round < ROUNDS { step(work, &flat, &mut report) } else { 0 };
        if changed == 0 {
            work.remove(&flat);
            report.dropped += flat.len();
        }
        let (duplicates, again) = drop_duplicates(work);
        report.duplicates += duplicates;
        half_edges = again;
    }
    (report, half_edges)
}

impl EditMesh {
    fn is_flat(&self, t: usize) -> bool {
        is_flat(self.triangles[t].map(|v| &self.points[v as usize]))
    }
}

/// Repairs flat triangles, none of whose vertices is used twice; returns how many.
fn step(work: &mut EditMesh, flat: &[u32], report: &mut DegenerateReport) -> usize {
    let half_edges = HalfEdges::new(work.points.len(), &work.triangles);
    let mut into: Vec<u32> = (0..work.points.len() as u32).collect();
    let mut touched = vec![false; work.points.len()];
    let mut dropped = Vec::new();
    let mut changed = 0;
    for &t in flat {
        let corners = work.triangles[t as usize];
        if corners.iter().any(|v| touched[*v as usize]) {
            continue;
        }
        let length = |h: u32| {
            let [a, b] = ends(&work.triangles, h).map(|v| work.points[v as usize]);
            (a - b).norm()
        };
        let mut sides = [3 * t, 3 * t + 1, 3 * t + 2];
        sides.sort_by(|a, b| length(*a).total_cmp(&length(*b)).then(a.cmp(b)));
        if length(sides[0]) <= NEEDLE * length(sides[2]) {
            let [a, b] = ends(&work.triangles, sides[0]);
            into[a.max(b) as usize] = a.min(b);
            corners.iter().for_each(|v| touched[*v as usize] = true);
            report.collapsed += 1;
            changed += 1;
            continue;
        }
        let (h, twin) = (sides[2], half_edges.twin[sides[2] as usize]);
        if twin == NONE {
            dropped.push(t); // the boundary now follows the two shorter sides
            corners.iter().for_each(|v| touched[*v as usize] = true);
            report.dropped += 1;
            changed += 1;
            continue;
        }
        // Flip: t = (a, b, c) has c between a and b, and its neighbour is (b, a, d). They become
        // (c, d, b) and (d, c, a).
        let [a, b] = ends(&work.triangles, h);
        let c = ends(&work.triangles, previous(h))[0];
        let d = ends(&work.triangles, previous(twin))[0];
        debug_assert_eq!(ends(&work.triangles, next(twin))[1], d);
        let other = twin / 3;
        if c == d || touched[d as usize] || flat.binary_search(&other).is_ok() {
            continue;
        }
        work.triangles[t as usize] = [c, d, b];
        work.triangles[other as usize] = [d, c, a];
        corners.iter().chain([&d]).for_each(|v| touched[*v as usize] = true);
        report.flipped += 1;
        changed += 1;
    }
    work.triangles.as_flattened_mut().iter_mut().for_each(|v| *v = into[*v as usize]);
    let mut k = 0..;
    work.triangles.retain(|t| {
        let keep = k.next().is_some_and(|k| dropped.binary_search(&k).is_err());
        keep && t[0] != t[1] && t[1] != t[2] && t[2] != t[0]
    });
    changed
}

/// Keeps the first of triangles with the same three vertices, in any orientation. Returns how many
/// were removed, and the half-edges of the others.
fn drop_duplicates(work: &mut EditMesh) -> (usize, HalfEdges) {
    let half_edges = HalfEdges::new(work.points.len(), &work.triangles);
    let crowd = half_edges
        .non_manifold
        .iter()
        .flatten()
        .chain(half_edges.inconsistent.iter().flatten())
        .map(|h| h / 3);
    let folded = (0..work.triangles.len() as u32).filter(|&t| {
        let side = |k: u32| half_edges.twin[(3 * t + k) as usize];
        side(0) != NONE
            && side(1) != NONE
            && side(0) / 3 == side(1) / 3
            && side(1) / 3 == side(2) / 3
    });
    let mut suspects: Vec<([u32; 3], u32)> =
        crowd.chain(folded).map(|t| (sorted(work.triangles[t as usize]), t)).collect();
    suspects.sort_unstable();
    suspects.dedup();
    let mut doubles: Vec<u32> =
        suspects.windows(2).filter(|w| w[0].0 == w[1].0).map(|w| w[1].1).collect();
    doubles.sort_unstable();
    if doubles.is_empty() {
        return (0, half_edges);
    }
    work.remove(&doubles);
    (doubles.len(), HalfEdges::new(work.points.len(), &work.triangles))
}

fn sorted(mut t: [u32; 3]) -> [u32; 3] {
    t.sort_unstable();
    t
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;
    use if_core::mesh::TriMesh;

    fn work(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> EditMesh {
        EditMesh::new(
            &TriMesh::new(points.iter().map(|p| Point::from(*p)).collect(), triangles.to_vec())
                .unwrap(),
        )
    }

    #[test]
    fn the_long_edge_of_a_cap_is_flipped() {
        // c lies on the edge (a, b) of the triangle (b, a, d).
        let mut w = work(
            &[[0., 0., 0.], [2., 0., 0.], [1., 0., 0.], [1., -1., 0.]],
            &[[0, 1, 2], [1, 0, 3]],
        );
        let (report, half_edges) = remove_degenerate(&mut w);
        assert_eq!(half_edges.twin, HalfEdges::new(w.points.len(), &w.triangles).twin);
        assert_eq!(report, DegenerateReport { flipped: 1, ..Default::default() });
        assert_eq!(w.triangles, [[2, 3, 1], [3, 2, 0]]);
        assert_eq!(w.area(0) + w.area(1), 1.0, "the neighbour's area");
    }

    #[test]
    fn needles_collapse_and_duplicates_are_removed() {
        let mut w = work(
            &[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 1., 0.], [1., 1., 0.]],
            &[[0, 1, 2], [0, 2, 3], [1, 4, 3], [2, 1, 3], [1, 0, 2]],
        );
        let (report, half_edges) = remove_degenerate(&mut w);
        assert_eq!(half_edges.twin, HalfEdges::new(w.points.len(), &w.triangles).twin);
        assert_eq!((report.duplicates, report.collapsed, report.dropped), (1, 1, 0));
        assert_eq!(w.triangles, [[0, 1, 2], [1, 4, 2]]);
    }

    #[test]
    fn surfaces_without_area_are_removed() {
        let mut w = work(
            &[[0., 0., 0.], [1., 0., 0.], [2., 0., 0.], [3., 0., 0.]],
            &[[0, 1, 2], [1, 3, 2], [0, 2, 3]],
        );
        remove_degenerate(&mut w);
        assert!(w.triangles.is_empty());
        let mut w = work(&[[1., 1., 1.]; 3], &[[0, 1, 2]]);
        remove_degenerate(&mut w);
        assert!(w.triangles.is_empty());
    }
}
