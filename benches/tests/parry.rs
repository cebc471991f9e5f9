//! The index against parry: the same distances, from a foreign tool.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use if_core::closest::ClosestPoint;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::{cloth, icosphere};
use if_mesh::index::Bvh;
use parry3d_f64::query::PointQuery;

/// Points in the cube from −0.5 to 1.5.
fn points(count: usize) -> impl Iterator<Item = Point> {
    let at = |k: usize, f: Real| 0.5 + (f * (k as Real + 1.0)).sin();
    (0..count).map(move |k| Point::new(at(k, 12.9898), at(k, 78.233), at(k, 37.719)))
}

#[test]
fn nearest_points_are_as_far_as_those_of_parry() {
    let wave = cloth(1.0, 1.0, 20, 20);
    let wave = wave
        .with_vertices(
            wave.vertices()
                .iter()
                .map(|p| Point::new(p.x, p.y, 0.1 * (9.0 * p.x).sin() * (7.0 * p.y).cos()))
                .collect(),
        )
        .unwrap();
    for mesh in [wave, icosphere(0.7, 3)] {
        let to = |p: &Point| parry3d_f64::math::Vector::new(p.x, p.y, p.z);
        let theirs = parry3d_f64::shape::TriMesh::new(
            mesh.vertices().iter().map(to).collect(),
            mesh.triangles().to_vec(),
        )
        .unwrap();
        check(&mesh, |p| theirs.distance_to_local_point(to(p), false));
    }
}

fn check(mesh: &TriMesh, theirs: impl Fn(&Point) -> Real) {
    let bvh = Bvh::new(mesh);
    for p in points(300) {
        let ours = bvh.closest(&p, Real::INFINITY).unwrap().distance;
        // Both round sums of products of coordinates near 1.
        approx::assert_relative_eq!(ours, theirs(&p), epsilon = 1e-12);
    }
}
