//! Intersections that a change of the mesh adds, without a pass over the whole mesh.

use super::broad_phase::{Bounded, BroadPhase};
use super::disjoint::{certainly_disjoint, neighbours_certainly_disjoint};
use super::spatial_hash::{SmallBox, SpatialHash, retain_from};
use if_core::aabb::Aabb;
use if_core::intersect::{is_degenerate, triangles_sharing};
use if_core::math::{Point, Real};
use rayon::prelude::*;

/// Side of a cell over the mean side of the changed triangles' boxes: a triangle lies in two to four
/// cells, and a cell holds few.
const CELL: Real = 1.5;
/// Changed triangles per task: each takes a microsecond.
const TASK: usize = 512;

/// Pairs of triangles, ascending, that intersect beyond their common corners and of which at least
/// one is in `changed`.
pub(super) fn intersecting_pairs(
    points: &[Point],
    triangles: &[[u32; 3]],
    changed: &[u32],
    broad_phase: &mut BroadPhase,
) -> Vec<[u32; 2]> {
    IntersectionQuery::new(points, triangles, changed, points, false, broad_phase)
        .pairs(points, triangles, changed)
}

/// The triangles that some changed ones can intersect while their corners move between two
/// positions: built once, queried at several positions.
pub(super) struct IntersectionQuery {
    /// The triangles that a changed one can intersect, changed ones included, ascending.
    near: Vec<u32>,
    /// Boxes around all their positions, relative to `origin`: in single precision the boxes of a mesh far
    /// from the origin of its coordinates would be as large as their cells, or larger than the mesh.
    hash: SpatialHash,
    origin: Point,
}

impl IntersectionQuery {
    /// For `changed` triangles, ascending, whose corners stay between `points` and `target`, up to
    /// rounding, to `single_precision` if so. All other triangles stay as they are in `points`.
    pub(super) fn new(
        points: &[Point],
        triangles: &[[u32; 3]],
        changed: &[u32],
        target: &[Point],
        single_precision: bool,
        broad_phase: &mut BroadPhase,
    ) -> Self {
        let epsilon = if single_precision { f32::EPSILON.into() } else { 2.0 * Real::EPSILON };
        let bounded = |t: &u32| {
            let corners = triangles[*t as usize];
            let b = bounds(corners.map(|v| &points[v as usize]))
                .merged(&bounds(corners.map(|v| &target[v as usize])));
            let rounding = b.min.coords.amax().max(b.max.coords.amax()) * epsilon;
            (*t, b.inflated(rounding))
        };
        let bounded: Vec<Bounded> = changed.iter().map(bounded).collect();
        Self::with_bounds(points, triangles, &bounded, broad_phase)
    }

    /// For changed triangles, ascending, each with a box that bounds all its positions. All other
    /// triangles stay as they are in `points`.
    pub(super) fn with_bounds(
        points: &[Point],
        triangles: &[[u32; 3]],
        changed: &[Bounded],
        broad_phase: &mut BroadPhase,
    ) -> Self {
        if changed.is_empty() {
            let (near, hash) = (Vec::new(), SpatialHash::default());
            return Self { near, hash, origin: Point::origin() };
        }
        let region = changed.iter().fold(Aabb::EMPTY, |b, s| b.merged(&s.1));
        let origin = region.min;
        let near = broad_phase.candidates(points, triangles, changed);
        let mut next = changed.iter().peekable();
        let boxes: Vec<SmallBox> = near
            .iter()
            .map(|t| match next.next_if(|s| s.0 == *t) {
                Some((_, b)) => SmallBox::round(b, &origin),
                None => {
                    let corners = triangles[*t as usize].map(|v| &points[v as usize]);
                    SmallBox::round(&bounds(corners), &origin)
                }
            })
            .collect();
        let side = changed.iter().map(|s| s.1.size().max()).sum::<Real>() / changed.len() as Real;
        let hash = SpatialHash::new(&region.size(), CELL * side, &boxes);
        Self { near, hash, origin }
    }

    /// Pairs of triangles, ascending, that intersect at `points` beyond their common corners and of
    /// which at least one is in `changed`: ascending, and some of those that the query was built
    /// for.
    pub(super) fn pairs(
        &self,
        points: &[Point],
        triangles: &[[u32; 3]],
        changed: &[u32],
    ) -> Vec<[u32; 2]> {
        let mut is_changed = vec![false; self.near.len()];
        let indices: Vec<u32> = changed
            .iter()
            .filter_map(|t| self.near.binary_search(t).ok())
            .map(|k| k as u32)
            .collect();
        indices.iter().for_each(|k| is_changed[*k as usize] = true);
        let pairs_of = |indices: &[u32]| {
            let mut found = Vec::new();
            let mut others = Vec::new();
            for &k in indices {
                let t = self.near[k as usize];
                let a = triangles[t as usize];
                let corners =
                    [&points[a[0] as usize], &points[a[1] as usize], &points[a[2] as usize]];
                others.clear();
                self.hash.query(&SmallBox::round(&bounds(corners), &self.origin), &mut others);
                // A pair of two changed triangles is found from the smaller one.
                retain_from(&mut others, 0, |other| {
                    (other > k) | ((other < k) & !is_changed[other as usize])
                });
                for &other in &others {
                    let u = self.near[other as usize];
                    if intersect(points, a, triangles[u as usize]) {
                        found.push([t.min(u), t.max(u)]);
                    }
                }
            }
            found
        };
        let mut pairs: Vec<[u32; 2]> = if indices.len() <= TASK {
            pairs_of(&indices)
        } else {
            indices.par_chunks(TASK).map(pairs_of).collect::<Vec<_>>().concat()
        };
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }
}

/// Whether two triangles intersect at `points` beyond their common corners.
pub(super) fn pair_intersects(points: &[Point], triangles: &[[u32; 3]], [t, u]: [u32; 2]) -> bool {
    intersect(points, triangles[t as usize], triangles[u as usize])
}

/// Bounding box of a triangle.
pub(super) fn bounds(t: [&Point; 3]) -> Aabb {
    Aabb { min: t[0].inf(t[1]).inf(t[2]), max: t[0].sup(t[1]).sup(t[2]) }
}

/// Whether triangles intersect beyond their common corners, as
/// [`own_pairs`](crate::intersections::own_pairs) defines it: corners at the same position are
/// common, and triangles without area intersect nothing.
fn intersect(points: &[Point], ia: [u32; 3], ib: [u32; 3]) -> bool {
    let a = [&points[ia[0] as usize], &points[ia[1] as usize], &points[ia[2] as usize]];
    let b = [&points[ib[0] as usize], &points[ib[1] as usize], &points[ib[2] as usize]];
    // Most are neighbours that continue each other as a surface does.
    if neighbours_certainly_disjoint(a, ia, b, ib) {
        return false;
    }
    if !bounds(a).overlaps(&bounds(b)) {
        return false;
    }
    // Corner i of a is corner common[i] of b, by position.
    let mut common = [None; 3];
    for (p, c) in a.iter().zip(&mut common) {
        for (j, q) in b.iter().enumerate() {
            if p.x == q.x && p.y == q.y && p.z == q.z {
                *c = Some(j);
                break;
            }
        }
    }
    if certainly_disjoint(a, b, common) {
        return false;
    }
    // The exact test knows common corners by equal numbers.
    let mut names = [3, 4, 5];
    common.iter().zip(0..).for_each(|(j, i)| j.iter().for_each(|j| names[*j] = i));
    triangles_sharing(a, [0, 1, 2], b, names).is_some() && !is_degenerate(a) && !is_degenerate(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Bvh;
    use crate::intersections::own_pairs;
    use if_core::math::Vector;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::icosphere;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn the_spatial_hash_misses_no_pair() {
        let (a, b) = (icosphere(0.3, 2), icosphere(0.2, 2));
        let mut points = a.vertices().to_vec();
        let base = points.len() as u32;
        points.extend(b.vertices().iter().map(|p| p + Vector::new(0.21, 0.05, 0.02)));
        let mut triangles = a.triangles().to_vec();
        triangles.extend(b.triangles().iter().map(|t| t.map(|v| v + base)));
        let mesh = TriMesh::new(points.clone(), triangles.clone()).unwrap();
        let all: Vec<[u32; 2]> =
            own_pairs(&mesh, &Bvh::new(&mesh)).iter().map(|p| [p.a, p.b]).collect();
        assert!(all.len() > 20);
        let everyone: Vec<u32> = (0..triangles.len() as u32).collect();
        assert_eq!(
            intersecting_pairs(&points, &triangles, &everyone, &mut BroadPhase::default()),
            all
        );
        let some: Vec<u32> = (0..triangles.len() as u32).filter(|t| t % 7 == 0).collect();
        let of_some: Vec<[u32; 2]> =
            all.iter().filter(|p| p[0] % 7 == 0 || p[1] % 7 == 0).copied().collect();
        assert_eq!(
            intersecting_pairs(&points, &triangles, &some, &mut BroadPhase::default()),
            of_some
        );
        assert!(
            intersecting_pairs(&points, &triangles, &[], &mut BroadPhase::default()).is_empty()
        );
    }

    #[test]
    fn far_from_the_origin_no_more_candidates_are_found() {
        let ball = icosphere(0.3, 3);
        let all: Vec<u32> = (0..ball.triangles().len() as u32).collect();
        let candidates = |offset: Vector| {
            let points: Vec<Point> = ball.vertices().iter().map(|p| p + offset).collect();
            let (triangles, mut broad_phase) = (ball.triangles(), BroadPhase::default());
            let query =
                IntersectionQuery::new(&points, triangles, &all, &points, false, &mut broad_phase);
            let mut found = Vec::new();
            for t in triangles {
                let corners = bounds(t.map(|v| &points[v as usize]));
                query.hash.query(&SmallBox::round(&corners, &query.origin), &mut found);
            }
            found.len()
        };
        let (near, far) =
            (candidates(Vector::zeros()), candidates(Vector::new(4.5e5, 5.2e6, 100.0)));
        assert!(far < near + near / 20, "{near}, {far}");
    }

    #[test]
    fn on_random_soups_the_pairs_equal_those_of_the_tree_while_corners_move() {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        for round in 0..60 {
            let n = 30 + 10 * (round % 5);
            // Few large triangles among small ones, corners on a lattice, in one plane, all at one
            // place.
            let mut points: Vec<Point> = (0..n)
                .map(|k| {
                    let size = if k % 7 == 0 { 1.0 } else { 0.1 };
                    let mut p = [0.0; 3].map(|_: Real| 0.5 + size * (rng.random::<Real>() - 0.5));
                    if round % 4 == 1 {
                        p = p.map(|x| (x * 16.0).round() / 16.0);
                    }
                    if round % 4 == 2 {
                        p[2] = 0.25;
                    }
                    Point::from(if round == 7 { [0.3; 3] } else { p })
                })
                .collect();
            let triangles: Vec<[u32; 3]> = (0..2 * n)
                .map(|_| {
                    let a = rng.random_range(0..n as u32);
                    let step = rng.random_range(1..4);
                    [a, (a + step) % n as u32, (a + step + 1) % n as u32]
                })
                .collect();
            let changed: Vec<u32> = (0..triangles.len() as u32).filter(|t| t % 3 == 0).collect();
            let mut target = points.clone();
            for v in changed.iter().flat_map(|t| triangles[*t as usize]).filter(|v| v % 2 == 0) {
                target[v as usize] += Vector::new(0.03, -0.02, 0.01);
            }
            // Every triangle with a corner that moves counts as changed.
            let moves = |v: &u32| points[*v as usize] != target[*v as usize];
            let changed: Vec<u32> = (0..triangles.len() as u32)
                .filter(|t| t % 3 == 0 || triangles[*t as usize].iter().any(moves))
                .collect();
            let query = IntersectionQuery::new(
                &points,
                &triangles,
                &changed,
                &target,
                false,
                &mut BroadPhase::default(),
            );
            let start = points.clone();
            for share in [0.0, 0.37, 1.0] {
                points = start.iter().zip(&target).map(|(p, q)| p + (q - p) * share).collect();
                let mesh = TriMesh::new(points.clone(), triangles.clone()).unwrap();
                let mut all: Vec<[u32; 2]> =
                    own_pairs(&mesh, &Bvh::new(&mesh)).iter().map(|p| [p.a, p.b]).collect();
                all.retain(|p| p.iter().any(|t| changed.binary_search(t).is_ok()));
                assert_eq!(
                    query.pairs(&points, &triangles, &changed),
                    all,
                    "round {round}, share {share}"
                );
                let some: Vec<u32> = changed.iter().copied().filter(|t| t % 2 == 0).collect();
                all.retain(|p| p.iter().any(|t| some.binary_search(t).is_ok()));
                assert_eq!(
                    query.pairs(&points, &triangles, &some),
                    all,
                    "round {round}, share {share}"
                );
            }
        }
    }
}
