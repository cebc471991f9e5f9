//! Sheets of a garment that lie on one another.

use if_core::aabb::Aabb;
use if_core::closest::closest_on_triangle;
use if_core::edges::VertexTriangles;
use if_core::math::{Real, area_vector, barycentric_point};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use rayon::prelude::*;

/// A vertex and the nearest triangle of another sheet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facing {
    pub(crate) vertex: u32,
    pub(crate) triangle: u32,
    /// Nearest point of the triangle.
    pub(crate) barycentric: [Real; 3],
    /// How far it is, in metres.
    pub(crate) distance: Real,
}

/// Cosine between the offset and the triangle's normal below which a triangle lies beside the
/// vertex, further on in the same sheet, rather than over it.
const OVER: Real = 0.7;

/// For each vertex the nearest triangle of another sheet within `range` metres, if there is one.
pub(crate) fn facing_sheets(mesh: &TriMesh, tree: &Bvh, range: Real) -> Vec<Facing> {
    let (x, triangles) = (mesh.vertices(), mesh.triangles());
    let around = VertexTriangles::new(mesh);
    (0..x.len())
        .into_par_iter()
        .with_min_len(256)
        .filter_map(|v| {
            let own = around.of(v);
            if own.is_empty() {
                return None;
            }
            let p = &x[v];
            let mut best: Option<Facing> = None;
            tree.overlapping(&Aabb { min: *p, max: *p }.inflated(range), |t| {
                let tri = triangles[t as usize];
                if own.iter().any(|o| triangles[*o as usize].iter().any(|u| tri.contains(u))) {
                    return;
                }
                let c = tri.map(|u| &x[u as usize]);
                let (barycentric, _) = closest_on_triangle(p, c[0], c[1], c[2]);
                let to = p - barycentric_point(c, barycentric);
                let distance = to.norm();
                let normal = area_vector(c[0], c[1], c[2]);
                let over = normal.dot(&to).abs() >= OVER * distance * normal.norm();
                if distance <= range && over && best.is_none_or(|b| distance < b.distance) {
                    best = Some(Facing { vertex: v as u32, triangle: t, barycentric, distance });
                }
            });
            best
        })
        .collect()
}
