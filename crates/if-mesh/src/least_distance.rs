//! Least distances: of two meshes, and of a mesh to itself.

use crate::index::Bvh;
use if_core::math::Real;
use serde::{Deserialize, Serialize};

/// The least distance of two sets of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeastDistance {
    /// The distance of the nearest pair of triangles, in metres; exactly 0 if one intersects.
    pub distance: Real,
    /// No pair is nearer by more than this, in metres, with all rounding.
    pub error: Real,
    /// The nearest pair: triangle of the first mesh and of the second; of one mesh, the smaller
    /// index first.
    pub triangles: [u32; 2],
}

/// The least distance of a triangle of `a` and one of `b`; `None` if one of them has no triangles.
///
/// # Accuracy
///
/// [`if_core::distance::triangle_distance`] for each pair: [`LeastDistance::error`] is computed, and
/// below 1e-12 of the size of the triangles but for needles. It is the same on any number of threads.
///
/// # Examples
///
/// ```
/// use if_mesh::{index::Bvh, least_distance::least_distance};
/// use if_core::shapes::meshes::icosphere;
/// let [inner, outer] = [1.0, 1.1].map(|radius| Bvh::new(&icosphere(radius, 3)));
/// let found = least_distance(&inner, &outer).expect("both have triangles");
/// assert!(found.distance > 0.09 && found.distance < 0.1 && found.error < 1e-12);
/// ```
pub fn least_distance(a: &Bvh, b: &Bvh) -> Option<LeastDistance> {
    a.nearest_pair(b).map(LeastDistance::from)
}

/// The least distance of two triangles of `tree` that share no corner; `None` if there are no such
/// two.
///
/// Corners are shared if they are one vertex or have equal coordinates. Triangles with two corners at
/// one position, or of zero area, count like all others.
///
/// # Accuracy
///
/// As [`least_distance`].
pub fn least_own_distance(tree: &Bvh) -> Option<LeastDistance> {
    tree.nearest_own_pair().map(LeastDistance::from)
}

impl From<crate::index::NearPair> for LeastDistance {
    fn from(pair: crate::index::NearPair) -> Self {
        let bounds = pair.bounds;
        Self {
            distance: bounds.upper,
            error: bounds.upper - bounds.lower,
            triangles: pair.triangles,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::distance::triangle_distance;
    use if_core::math::{Point, Vector};
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::{icosphere, tube};

    /// The slow twin: all pairs that are not skipped.
    fn all(a: &TriMesh, b: &TriMesh, skip: impl Fn(usize, usize) -> bool) -> Option<LeastDistance> {
        let mut least: Option<(Real, Real, [u32; 2])> = None;
        for i in 0..a.triangles().len() {
            for j in 0..b.triangles().len() {
                if !skip(i, j) {
                    let d = triangle_distance(a.corners(i), b.corners(j));
                    let (lower, upper, pair) =
                        least.unwrap_or((Real::INFINITY, Real::INFINITY, [0; 2]));
                    let nearest = if d.upper < upper { [i as u32, j as u32] } else { pair };
                    least = Some((lower.min(d.lower), upper.min(d.upper), nearest));
                }
            }
        }
        let found = |(lower, distance, triangles)| LeastDistance {
            distance,
            error: distance - lower,
            triangles,
        };
        least.map(found)
    }

    fn moved(mesh: &TriMesh, f: impl Fn(&Point) -> Point) -> TriMesh {
        mesh.with_vertices(mesh.vertices().iter().map(f).collect()).unwrap()
    }

    /// Two wavy sheets or shells, nearer and farther apart; the last two intersect.
    fn scenes() -> Vec<[TriMesh; 2]> {
        let ball = icosphere(1.0, 2);
        let wavy = |amplitude: Real, offset: Real| {
            moved(&icosphere(1.0, 2), |p| {
                p * (1.0 + offset + amplitude * (9.0 * p.x + 4.0 * p.y).sin())
            })
        };
        let band = |radius: Real| {
            moved(&tube(radius, 1.0, 17, 5, false), |p| Point::new(p.x, p.y - 0.4, p.z + 0.01))
        };
        let shift = |mesh: &TriMesh, by: Vector| moved(mesh, |p| p + by);
        vec![
            [ball.clone(), wavy(0.01, 0.05)],
            [ball.clone(), wavy(0.001, 0.0501)],
            [ball.clone(), band(1.1)],
            [ball.clone(), shift(&ball, Vector::new(5.0, 4.0, 3.0))],
            [ball.clone(), wavy(0.1, 0.0)],
            [ball.clone(), ball],
        ]
    }

    #[test]
    fn the_least_distance_is_that_of_all_pairs_on_any_number_of_threads() {
        for (k, [a, b]) in scenes().iter().enumerate() {
            let trees = [Bvh::new(a), Bvh::new(b)];
            let expected = all(a, b, |_, _| false).unwrap();
            for threads in [1, 2, 7] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let found = pool.install(|| least_distance(&trees[0], &trees[1])).unwrap();
                assert_eq!(
                    (found.distance, found.triangles),
                    (expected.distance, expected.triangles),
                    "scene {k}"
                );
                // Pairs that are pruned cannot widen the bounds.
                assert!(found.error <= expected.error && found.error < 1e-11, "{found:?}");
                assert_eq!(found.distance == 0.0, k >= 4, "scene {k}");
            }
        }
    }

    #[test]
    fn own_distances_are_those_of_all_pairs_without_a_common_corner() {
        for (k, [_, mesh]) in scenes().iter().enumerate() {
            let folded = moved(mesh, |p| Point::new(p.x, p.y * p.y, p.z + 0.3 * p.y));
            for mesh in [mesh, &folded] {
                let t = mesh.triangles();
                let shares = |i: usize, j: usize| i >= j || t[i].iter().any(|v| t[j].contains(v));
                let expected = all(mesh, mesh, shares).unwrap();
                let found = least_own_distance(&Bvh::new(mesh)).unwrap();
                assert_eq!(
                    (found.distance, found.triangles),
                    (expected.distance, expected.triangles),
                    "scene {k}"
                );
                assert!(found.error < 1e-11, "{found:?}");
            }
        }
    }

    #[test]
    fn a_motion_that_keeps_distances_keeps_the_least_one() {
        let [a, b] = scenes().swap_remove(0);
        let before = least_distance(&Bvh::new(&a), &Bvh::new(&b)).unwrap();
        let turn = if_core::nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0);
        let turned = |mesh: &TriMesh| moved(mesh, |p| turn * p + Vector::new(10.0, -3.0, 1.0));
        let after = least_distance(&Bvh::new(&turned(&a)), &Bvh::new(&turned(&b))).unwrap();
        assert!((before.distance - after.distance).abs() < 1e-13, "{before:?} {after:?}");
        let back = least_distance(&Bvh::new(&b), &Bvh::new(&a)).unwrap();
        assert!((before.distance - back.distance).abs() <= before.error + back.error);
        let halved = |mesh: &TriMesh| Bvh::new(&moved(mesh, |p| p * 0.5));
        let small = least_distance(&halved(&a), &halved(&b)).unwrap();
        assert!((0.5 * before.distance - small.distance).abs() < 1e-13);
    }

    #[test]
    fn without_a_pair_there_is_no_distance() {
        let none = TriMesh::new(Vec::new(), Vec::new()).unwrap();
        let one = TriMesh::new(
            vec![Point::origin(), Point::new(1.0, 0.0, 0.0), Point::new(0.0, 1.0, 0.0)],
            vec![[0, 1, 2]],
        )
        .unwrap();
        let [none_tree, one_tree] = [&none, &one].map(Bvh::new);
        assert_eq!(least_distance(&none_tree, &one_tree), None);
        assert_eq!(least_own_distance(&none_tree), None);
        assert_eq!(least_own_distance(&one_tree), None);
        assert_eq!(least_distance(&one_tree, &one_tree).unwrap().distance, 0.0);
    }

    #[test]
    fn doubled_vertices_along_a_seam_are_no_distance() {
        let v = [
            [0, 0, 0],
            [1, 0, 0],
            [0, 1, 0],
            [1, 0, 0],
            [0, 1, 0],
            [1, 1, 0],
            [5, 0, 0],
            [6, 0, 0],
            [5, 1, 0],
        ];
        let v = v.map(|p| Point::new(p[0].into(), p[1].into(), p[2].into())).to_vec();
        let mesh = TriMesh::new(v, vec![[0, 1, 2], [3, 5, 4], [6, 7, 8]]).unwrap();
        let found = least_own_distance(&Bvh::new(&mesh)).unwrap();
        assert!((found.distance - 4.0).abs() < 1e-12 && found.triangles == [1, 2], "{found:?}");
    }
}
