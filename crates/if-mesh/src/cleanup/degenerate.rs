//! Triangles without area, and triangles that stand twice.

use super::twins::{NONE, Twins, ends, next, previous};
use super::work::Work;
use crate::validate::is_flat;
use if_core::math::Real;
use rayon::prelude::*;
use serde::Serialize;

/// What became of degenerate triangles.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize)]
pub struct DegenerateReport {
    /// Triangles with the same three vertices as one before them, dropped.
    pub doubled: usize,
    /// Edges without length, whose ends became one vertex.
    pub collapsed: usize,
    /// Triangles without area whose longest edge was turned, so that they take part of their
    /// neighbour.
    pub turned: usize,
    /// Triangles without area that could only be dropped.
    pub dropped: usize,
}

/// The shortest edge of a triangle without area over its longest, up to which its ends are one
/// place. A needle has 1e-12; a triangle with its three corners spread along a line has more.
const NEEDLE: Real = 1e-9;
/// Rounds, at most. Real meshes need one or two; what is left then is dropped.
const ROUNDS: usize = 6;

/// Removes triangles that stand twice, and those without area: needles by making one vertex of the
/// two ends of their short edge, the others by turning their longest edge, as far as that can be
/// done. Returns the twins of what is left, too.
pub(super) fn mend(work: &mut Work) -> (DegenerateReport, Twins) {
    let (doubled, mut twins) = drop_doubles(work);
    let mut report = DegenerateReport { doubled, ..DegenerateReport::default() };
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
        let (doubled, again) = drop_doubles(work);
        report.doubled += doubled;
        twins = again;
    }
    (report, twins)
}

impl Work {
    fn is_flat(&self, t: usize) -> bool {
        is_flat(self.triangles[t].map(|v| &self.points[v as usize]))
    }
}

/// Mends what can be mended without touching a triangle twice; says how many triangles were.
fn step(work: &mut Work, flat: &[u32], report: &mut DegenerateReport) -> usize {
    let twins = Twins::new(work.points.len(), &work.triangles);
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
        let (h, twin) = (sides[2], twins.of[sides[2] as usize]);
        if twin == NONE {
            dropped.push(t); // the rim takes the two shorter sides
            corners.iter().for_each(|v| touched[*v as usize] = true);
            report.dropped += 1;
            changed += 1;
            continue;
        }
        // t = (a, b, c) with c between a and b; across (b, a) lies (b, a, d). They become (c, d, b)
        // and (d, c, a).
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
        report.turned += 1;
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

/// Keeps the first of triangles with the same three vertices, whichever way they wind. How many
/// went, and the twins of the others.
fn drop_doubles(work: &mut Work) -> (usize, Twins) {
    let twins = Twins::new(work.points.len(), &work.triangles);
    let crowd = twins.crowded.iter().flatten().chain(twins.against.iter().flatten()).map(|h| h / 3);
    let folded = (0..work.triangles.len() as u32).filter(|&t| {
        let side = |k: u32| twins.of[(3 * t + k) as usize];
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
        return (0, twins);
    }
    work.remove(&doubles);
    (doubles.len(), Twins::new(work.points.len(), &work.triangles))
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

    fn work(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Work {
        Work::new(
            &TriMesh::new(points.iter().map(|p| Point::from(*p)).collect(), triangles.to_vec())
                .unwrap(),
        )
    }

    #[test]
    fn a_cap_takes_part_of_its_neighbour() {
        // c lies on the edge (a, b) of the triangle (b, a, d).
        let mut w = work(
            &[[0., 0., 0.], [2., 0., 0.], [1., 0., 0.], [1., -1., 0.]],
            &[[0, 1, 2], [1, 0, 3]],
        );
        let (report, twins) = mend(&mut w);
        assert_eq!(twins.of, Twins::new(w.points.len(), &w.triangles).of);
        assert_eq!(report, DegenerateReport { turned: 1, ..Default::default() });
        assert_eq!(w.triangles, [[2, 3, 1], [3, 2, 0]]);
        assert_eq!(w.area(0) + w.area(1), 1.0, "the neighbour's area");
    }

    #[test]
    fn needles_collapse_and_doubles_go() {
        let mut w = work(
            &[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 1., 0.], [1., 1., 0.]],
            &[[0, 1, 2], [0, 2, 3], [1, 4, 3], [2, 1, 3], [1, 0, 2]],
        );
        let (report, twins) = mend(&mut w);
        assert_eq!(twins.of, Twins::new(w.points.len(), &w.triangles).of);
        assert_eq!((report.doubled, report.collapsed, report.dropped), (1, 1, 0));
        assert_eq!(w.triangles, [[0, 1, 2], [1, 4, 2]]);
    }

    #[test]
    fn what_has_no_area_at_all_goes() {
        let mut w = work(
            &[[0., 0., 0.], [1., 0., 0.], [2., 0., 0.], [3., 0., 0.]],
            &[[0, 1, 2], [1, 3, 2], [0, 2, 3]],
        );
        mend(&mut w);
        assert!(w.triangles.is_empty());
        let mut w = work(&[[1., 1., 1.]; 3], &[[0, 1, 2]]);
        mend(&mut w);
        assert!(w.triangles.is_empty());
    }
}
