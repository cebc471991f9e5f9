//! Sheets of a garment that lie on one another.

use if_core::aabb::Aabb;
use if_core::closest::closest_on_triangle;
use if_core::edges::VertexTriangles;
use if_core::math::{Point, Real, Vector, area_vector, barycentric_point};
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
                let c = tri.map(|u| &x[u as usize]);
                let normal = area_vector(c[0], c[1], c[2]);
                let nearest = best.map_or(range, |b| b.distance);
                if cannot_be_over(p, c, &normal, nearest) {
                    return;
                }
                if own.iter().any(|o| triangles[*o as usize].iter().any(|u| tri.contains(u))) {
                    return;
                }
                let (barycentric, _) = closest_on_triangle(p, c[0], c[1], c[2]);
                let to = p - barycentric_point(c, barycentric);
                let distance = to.norm();
                let over = normal.dot(&to).abs() >= OVER * distance * normal.norm();
                if distance <= range && over && best.is_none_or(|b| distance < b.distance) {
                    best = Some(Facing { vertex: v as u32, triangle: t, barycentric, distance });
                }
            });
            best
        })
        .collect()
}

/// What rounding may change in comparisons that only save work, relative and in metres.
const ROUNDING: [Real; 2] = [1e-9, 1e-12];

/// Whether the nearest point of a triangle is certainly farther from `p` than `nearest`, or beside it: most that are
/// near are of the same sheet, whose plane leads past `p`.
fn cannot_be_over(p: &Point, corners: [&Point; 3], normal: &Vector, nearest: Real) -> bool {
    let [relative, absolute] = ROUNDING;
    let (length, above) = (normal.norm(), normal.dot(&(p - corners[0])).abs());
    let least = Aabb::from_points(corners).distance_squared(p).sqrt();
    least > nearest + absolute
        || above > (nearest + absolute) * (1.0 + relative) * length
        || above * (1.0 + relative) + absolute * length < OVER * least * length
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::random::SplitMix64;

    #[test]
    fn what_is_left_out_without_a_look_is_not_over() {
        let mut random = SplitMix64::new(5);
        let mut counts = [0; 2];
        for _ in 0..20_000 {
            let mut point = |size: Real| Point::from([0; 3].map(|_| size * (random.unit() - 0.5)));
            let (p, a, b, c) = (Point::origin(), point(0.02), point(0.02), point(0.02));
            let nearest = 0.006 * random.unit();
            let normal = area_vector(&a, &b, &c);
            let (barycentric, _) = closest_on_triangle(&p, &a, &b, &c);
            let to = p - barycentric_point([&a, &b, &c], barycentric);
            let is_over = normal.dot(&to).abs() >= OVER * to.norm() * normal.norm();
            let counts_as_over = is_over && to.norm() <= nearest;
            let left_out = cannot_be_over(&p, [&a, &b, &c], &normal, nearest);
            assert!(!(left_out && counts_as_over), "{a} {b} {c} {nearest}");
            counts[0] += usize::from(left_out);
            counts[1] += usize::from(!counts_as_over);
        }
        assert!(counts[0] > counts[1] / 2, "{counts:?}");
    }
}
