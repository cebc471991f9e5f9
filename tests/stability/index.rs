//! Indices and surface tools of `if-mesh` on any mesh of any size.

use crate::cases::{Random, cases, check, finite, same_on_all_threads};
use crate::meshes;
use if_core::closest::{ClosestPoint, closest_on_triangle};
use if_core::intersect::triangles;
use if_core::math::{Point, Real, barycentric_point};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{own_pairs, pairs};
use if_mesh::measure::{displacement, smallest_angles, strain, surface_samples};
use if_mesh::split::split;
use if_mesh::validate::{faults, suspicious_units};
use if_mesh::winding::Winding;

/// Any mesh, scaled, squeezed, turned and moved.
pub fn placed(r: &mut Random) -> (TriMesh, Real) {
    let mesh = meshes::any(r);
    let (scale, aspect) = (r.power(-6.0, 6.0), r.pick(&[1.0, 1.0, 1e2, 1e6]));
    let offset = r.offset(scale, &[0.0, 1.0, 1e4]);
    (meshes::placed(&mesh, r, scale, aspect, offset), scale)
}

fn brute(mesh: &TriMesh, p: &Point) -> Real {
    let distance = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        (barycentric_point([a, b, c], closest_on_triangle(p, a, b, c).0) - p).norm()
    };
    (0..mesh.triangles().len()).map(distance).fold(Real::INFINITY, Real::min)
}

#[test]
fn a_hierarchy_answers_as_all_triangles_do() {
    cases("hierarchies", 500, |r| {
        let ((a, scale), (b, _)) = (placed(r), placed(r));
        let (tree, other) = (Bvh::new(&a), Bvh::new(&b));
        let found = pairs(&tree, &other).len();
        let all = (0..a.triangles().len())
            .flat_map(|i| (0..b.triangles().len()).map(move |j| (i, j)))
            .filter(|(i, j)| triangles(a.corners(*i), b.corners(*j)).is_some())
            .count();
        check(found == all, || format!("{found} pairs found, {all} are there"))?;
        let own = own_pairs(&a, &tree);
        check(own.windows(2).all(|w| w[0] < w[1]), || "own pairs out of order".into())?;
        let middle = a.aabb();
        for _ in 0..10 {
            let p = if middle.is_empty() {
                r.point(1.0)
            } else {
                middle.center() + r.vector(2.0 * scale)
            };
            let (near, least) = (tree.closest(&p, Real::INFINITY), brute(&a, &p));
            let Some(near) = near else {
                check(a.triangles().is_empty(), || "nothing is near".into())?;
                continue;
            };
            check(near.distance <= least * (1.0 + 1e-12) && finite(&[near.point]), || {
                format!("{:e} found, {least:e} is there", near.distance)
            })?;
            let inside = near.distance * 0.999;
            check(tree.closest(&p, inside).is_none_or(|c| c.distance <= inside), || {
                "farther than asked for".into()
            })?;
        }
        // Refitted to other positions, the tree answers as a new one.
        let moved: Vec<Point> = a.vertices().iter().map(|p| p + r.vector(0.3 * scale)).collect();
        let mesh = a.with_vertices(moved).map_err(|e| e.to_string())?;
        let mut refitted = tree;
        refitted.refit(mesh.vertices());
        let mut same = (pairs(&refitted, &other), pairs(&Bvh::new(&mesh), &other));
        same.0.sort_unstable();
        same.1.sort_unstable();
        check(same.0 == same.1, || {
            format!("{} pairs after refitting, {} anew", same.0.len(), same.1.len())
        })?;
        Ok("ok")
    });
}

#[test]
fn hierarchies_stand_numbers_at_the_ends_of_the_range() {
    cases("hierarchies at the ends", 500, |r| {
        let scale = r.pick(&[5e-324, 1e-310, 1e-160, 1e160, 1e300]);
        let mesh = meshes::soup(r, 12, 20);
        let mesh = mesh
            .with_vertices(mesh.vertices().iter().map(|p| p * scale).collect())
            .map_err(|e| e.to_string())?;
        let tree = Bvh::new(&mesh);
        let all = pairs(&tree, &tree).len();
        check(all >= mesh.triangles().len(), || {
            format!("{all} pairs: a triangle does not meet itself")
        })?;
        let _ = (own_pairs(&mesh, &tree), tree.closest(&r.point(scale), Real::INFINITY));
        let hit = tree.first_hit(&r.point(scale), &r.point(scale), |_| true);
        check(hit.is_none_or(|h| (0.0..=1.0).contains(&h.parameter)), || format!("{hit:?}"))?;
        Ok("ok")
    });
}

#[test]
fn tools_for_surfaces_keep_any_mesh_finite() {
    cases("tools for surfaces", 400, |r| {
        let (mesh, scale) = placed(r);
        let whole = mesh.aabb().inflated(1e-9 * scale);
        let halves =
            split(&mesh, &vec![true; mesh.triangles().len()]).map_err(|e| e.to_string())?;
        let inside = halves.mesh.vertices().iter().all(|p| whole.contains(p));
        check(inside, || "splitting leaves the box of the mesh".into())?;
        let moved: Vec<Point> = mesh.vertices().iter().map(|p| p + r.vector(scale)).collect();
        let _ = (faults(&mesh), suspicious_units(&mesh));
        let angles = smallest_angles(&mesh);
        check(angles.iter().all(|a| (0.0..=60.1).contains(a)), || format!("{angles:?}"))?;
        let d = displacement(mesh.vertices(), &moved);
        let s = strain(&mesh, &moved);
        check(d.max.is_finite() && s.max.is_finite(), || format!("{d:?} {s:?}"))?;
        check(finite(&surface_samples(&mesh, 50, 1)), || "samples".into())?;
        let winding = Winding::new(&mesh);
        let points: Vec<Point> =
            (0..20).map(|_| whole.center() + r.vector(scale)).filter(|p| finite(&[*p])).collect();
        let numbers = same_on_all_threads(|| {
            winding.of(&points).iter().map(|w| w.to_bits()).collect::<Vec<_>>()
        })?;
        check(numbers.iter().all(|w| Real::from_bits(*w).is_finite()), || {
            "a winding number".into()
        })?;
        Ok("ok")
    });
}
