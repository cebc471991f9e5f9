//! A floating-point filter before the exact intersection test: pairs of triangles that certainly do
//! not intersect.
//!
//! The exact test costs a microsecond where two triangles lie in one plane, as those of a flat
//! cloth or of a subdivided mesh do. Most of these pairs have a separating axis: a direction along
//! which one lies before the other by more than the rounding error.

use if_core::math::{Point, Real, Vector};

/// The rounding error of a scalar product of two differences is below 2e-15 of the product of their
/// lengths. A margin ten times larger sends a few more pairs to the exact test; one ten thousand
/// times smaller would be wrong.
const MARGIN: Real = 1e-13;

/// Whether triangles `a` and `b` certainly share no point beyond their common corners: `common[i]`
/// is the corner of `b` that is corner i of `a`. `false` leaves the pair to the exact test.
pub(super) fn certainly_disjoint(
    a: [&Point; 3],
    b: [&Point; 3],
    common: [Option<usize>; 3],
) -> bool {
    match common.iter().flatten().count() {
        0 => separated_by_axis(a, b),
        1 => {
            let i = common.iter().position(Option::is_some).unwrap_or(0);
            let j = common[i].unwrap_or(0);
            separated_beyond_corner(
                a[i],
                [a[(i + 1) % 3], a[(i + 2) % 3]],
                [b[(j + 1) % 3], b[(j + 2) % 3]],
            )
        }
        2 => {
            // Corner i of a is not common; the edge runs from i + 1 to i + 2 in a.
            let i = common.iter().position(Option::is_none).unwrap_or(0);
            match (common[(i + 1) % 3], common[(i + 2) % 3]) {
                // In b it runs the other way: from j, which is a's i + 2, to j + 1.
                (Some(k), Some(j)) if k == (j + 1) % 3 => not_folded(a, b),
                _ => false,
            }
        }
        _ => false,
    }
}

/// Whether triangles with common vertices, by their numbers, certainly share no point beyond them.
/// `false` leaves the pair to the exact test; so for triangles without common vertices.
#[inline]
pub(super) fn neighbours_certainly_disjoint(
    a: [&Point; 3],
    ia: [u32; 3],
    b: [&Point; 3],
    ib: [u32; 3],
) -> bool {
    // Bit 3i + j: corner i of the one is corner j of the other.
    let mut common = 0u32;
    for (i, v) in ia.iter().enumerate() {
        for (j, w) in ib.iter().enumerate() {
            common |= u32::from(v == w) << (3 * i + j);
        }
    }
    if common == 0 {
        return false;
    }
    let place = |bits: u32| PLACES[bits.trailing_zeros() as usize % 9];
    let [i, j] = place(common);
    let more = common & (common - 1);
    if more == 0 {
        let (pa, pb) = (
            [a[NEXT[i]] - a[i], a[PREVIOUS[i]] - a[i]],
            [b[NEXT[j]] - a[i], b[PREVIOUS[j]] - a[i]],
        );
        return separates((pb[0] + pb[1]) - (pa[0] + pa[1]), pa, pb)
            || separates(across_gap(&pa, &pb), pa, pb);
    }
    if more & (more - 1) != 0 {
        return false;
    }
    // One runs through the edge forwards, the other backwards.
    let [i2, j2] = place(more);
    (NEXT[i] == i2) == (NEXT[j2] == j) && not_folded(a, b)
}

const NEXT: [usize; 3] = [1, 2, 0];
const PREVIOUS: [usize; 3] = [2, 0, 1];
/// i and j of 3i + j.
const PLACES: [[usize; 2]; 9] =
    [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2], [2, 0], [2, 1], [2, 2]];

/// Whether one of some directions is a separating axis: between the centres, the normals, and the
/// perpendiculars of the edges in each plane.
fn separated_by_axis(a: [&Point; 3], b: [&Point; 3]) -> bool {
    let o = a[0];
    let (pa, pb) = (a.map(|p| p - o), b.map(|p| p - o));
    let size = pa.iter().chain(&pb).map(Vector::norm_squared).fold(0.0, Real::max).sqrt();
    let separates = |d: Vector| {
        let margin = MARGIN * size * d.norm();
        let range = |p: &[Vector; 3]| {
            let [x, y, z] = [d.dot(&p[0]), d.dot(&p[1]), d.dot(&p[2])];
            (x.min(y).min(z), x.max(y).max(z))
        };
        let ((a0, a1), (b0, b1)) = (range(&pa), range(&pb));
        b0 - a1 > margin || a0 - b1 > margin
    };
    if separates((pb[0] + pb[1] + pb[2]) - (pa[0] + pa[1] + pa[2])) {
        return true;
    }
    [&pa, &pb].into_iter().any(|p| {
        let edges = [p[1] - p[0], p[2] - p[1], p[0] - p[2]];
        let normal = edges[0].cross(&edges[1]);
        separates(normal) || edges.iter().any(|e| separates(e.cross(&normal)))
    })
}

/// Whether a plane through the common corner `o` separates the rest of two triangles.
fn separated_beyond_corner(o: &Point, a: [&Point; 2], b: [&Point; 2]) -> bool {
    let (pa, pb) = ([a[0] - o, a[1] - o], [b[0] - o, b[1] - o]);
    let unit = |v: &Vector| v / v.norm().max(Real::MIN_POSITIVE);
    let d = (unit(&pb[0]) + unit(&pb[1])) - (unit(&pa[0]) + unit(&pa[1]));
    let margin = |v: &Vector| MARGIN * d.norm() * v.norm();
    pa.iter().all(|v| d.dot(v) < -margin(v)) && pb.iter().all(|v| d.dot(v) > margin(v))
}

/// The direction across the gap between the two closest sides at the common corner, one of each
/// triangle.
fn across_gap(pa: &[Vector; 2], pb: &[Vector; 2]) -> Vector {
    let unit = |v: &Vector| v * v.norm_squared().max(Real::MIN_POSITIVE).sqrt().recip();
    let (ua, ub) = (pa.map(|v| unit(&v)), pb.map(|v| unit(&v)));
    let (mut nearest, mut d) = (Real::NEG_INFINITY, Vector::zeros());
    for a in &ua {
        for b in &ub {
            let along = a.dot(b);
            if along > nearest {
                (nearest, d) = (along, b - a);
            }
        }
    }
    d
}

/// Whether the plane with normal `d` through the common corner separates the rest of two triangles.
/// Comparing squares saves the roots.
fn separates(d: Vector, pa: [Vector; 2], pb: [Vector; 2]) -> bool {
    let least = MARGIN * MARGIN * d.norm_squared();
    let beyond = |along: Real, v: &Vector| along > 0.0 && along * along > least * v.norm_squared();
    beyond(-d.dot(&pa[0]), &pa[0])
        && beyond(-d.dot(&pa[1]), &pa[1])
        && beyond(d.dot(&pb[0]), &pb[0])
        && beyond(d.dot(&pb[1]), &pb[1])
}

/// Whether neighbours at an edge, consistently oriented, are not folded onto each other: they
/// intersect beyond the edge only if they lie in one plane with opposite normals.
fn not_folded(a: [&Point; 3], b: [&Point; 3]) -> bool {
    let (ua, va, ub, vb) = (a[1] - a[0], a[2] - a[0], b[1] - b[0], b[2] - b[0]);
    let along = ua.cross(&va).dot(&ub.cross(&vb));
    let sizes = (ua.norm_squared() * va.norm_squared()) * (ub.norm_squared() * vb.norm_squared());
    along > 0.0 && along * along > MARGIN * MARGIN * sizes
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::intersect::triangles_sharing;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn certainly_disjoint_triangles_do_not_intersect() {
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        let mut found = [[0usize; 2]; 3]; // disjoint pairs by common corners, and whether the filter found them
        let mut found_by_number = 0;
        for round in 0..60_000 {
            // On a coarse lattice, nearly on one, or anywhere; in a plane every other time.
            let mut point = || {
                let mut p = [0.0; 3].map(|_: Real| rng.random::<Real>() * 4.0);
                if round % 3 < 2 {
                    p = p.map(Real::floor);
                }
                if round % 3 == 1 {
                    p = p.map(|x| x * 0.1 + 7.3);
                }
                if round % 2 == 0 {
                    p[2] = p[0] + 2.0 * p[1];
                }
                Point::from(p)
            };
            let points: Vec<Point> = (0..6).map(|_| point()).collect();
            let shared = round / 3 % 3;
            let ib = [[3, 4, 5], [4, 0, 5], [1, 0, 5]][shared];
            let (a, b) = ([0, 1, 2].map(|k: usize| &points[k]), ib.map(|k: usize| &points[k]));
            let common = [0, 1, 2].map(|i| ib.iter().position(|v| *v == i));
            let meets = triangles_sharing(a, [0, 1, 2], b, ib.map(|v| v as u32)).is_some();
            let apart = certainly_disjoint(a, b, common);
            assert!(!(apart && meets), "{a:?} {b:?}");
            let by_number = neighbours_certainly_disjoint(a, [0, 1, 2], b, ib.map(|v| v as u32));
            assert!(!by_number || (!meets && shared > 0), "{a:?} {b:?}");
            found_by_number += usize::from(by_number);
            found[shared][usize::from(apart)] += usize::from(!meets);
        }
        // The filter finds at least a quarter of the disjoint pairs; of neighbours in a mesh, nearly
        // all.
        assert!(found.iter().all(|[no, yes]| 3 * yes > *no), "{found:?}");
        assert!(found_by_number > 5_000, "{found_by_number}");
    }
}
