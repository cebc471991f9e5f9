//! How much room a body leaves in front of its skin: none where it meets itself.

use crate::findings::own_of;
use if_core::closest::closest_on_triangle;
use if_core::math::{Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use rayon::prelude::*;

/// Length of the ray that decides whether a vertex lies in another part of the body, in metres: the
/// thickest part is a trunk.
const THROUGH: Real = 0.6;

/// What the normal of a vertex of a body points at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Facing {
    /// The vertex.
    pub(crate) vertex: u32,
    /// The triangle that is met.
    pub(crate) triangle: u32,
    /// Where it is met, as weights of its corners.
    pub(crate) weights: [Real; 3],
    /// Distance along the normal, in metres; negative where the vertex lies in another part of the
    /// body, and has to go back by so much to leave it.
    pub(crate) room: Real,
}

/// For each vertex that is `asked` for, what it faces along its direction in `normals`, with a room of
/// at most `most` metres and at least `-deepest`; sorted by vertex. `tree` is that of `mesh`.
///
/// ```text
/// outwards, the first triangle is met from behind:   the vertex lies in another part
///     room = − distance to the first triangle inwards
/// else: room = distance to the first triangle outwards
/// ```
pub(crate) fn facings(
    (mesh, tree): (&TriMesh, &Bvh),
    normals: &[Vector],
    asked: &[bool],
    [most, deepest]: [Real; 2],
) -> Vec<Facing> {
    let x = mesh.vertices();
    let one = |v: usize| -> Option<Facing> {
        let n = normals[v];
        if !asked[v] || n == Vector::zeros() {
            return None;
        }
        let is_other = |t: u32| !mesh.triangles()[t as usize].contains(&(v as u32));
        let along = |t: u32| {
            let [a, b, c] = mesh.corners(t as usize);
            (b - a).cross(&(c - a)).dot(&n)
        };
        let out = tree.first_hit(&x[v], &(x[v] + n * THROUGH), is_other)?;
        let (triangle, room) = if along(out.triangle) > 0.0 {
            let back = tree.first_hit(&x[v], &(x[v] - n * deepest), is_other)?;
            (back.triangle, -back.parameter * deepest)
        } else {
            (out.triangle, out.parameter * THROUGH)
        };
        // What is met in front faces the vertex, and what is passed by it does so, too.
        if room > most || along(triangle) >= 0.0 {
            return None;
        }
        let [a, b, c] = mesh.corners(triangle as usize);
        let (weights, _) = closest_on_triangle(&(x[v] + n * room), a, b, c);
        Some(Facing { vertex: v as u32, triangle, weights, room })
    };
    (0..x.len()).into_par_iter().with_min_len(256).filter_map(one).collect()
}

/// Depth, in metres, up to which a vertex in another part of the body is found to be so.
const DEEPEST: Real = 0.3;

/// Room that the sheets of cloth in a pinch need, with a `gap` for each: all garments lie there twice.
pub(crate) fn room(garments: usize, gap: Real) -> Real {
    (2 * garments + 1) as Real * gap
}

/// Triangles of a body that leave less than `room` metres, or meet the body.
pub(crate) fn pinched(mesh: &TriMesh, room: Real) -> Vec<bool> {
    let tree = Bvh::new(mesh);
    let all = vec![true; mesh.vertices().len()];
    let mut is_narrow = vec![false; mesh.vertices().len()];
    // A vertex in another part of the body is narrow however deep it lies.
    for facing in facings((mesh, &tree), &mesh.vertex_normals(), &all, [room, DEEPEST]) {
        is_narrow[facing.vertex as usize] = true;
    }
    let of_triangle = |t: &[u32; 3]| t.iter().any(|v| is_narrow[*v as usize]);
    let mut pinched: Vec<bool> = mesh.triangles().iter().map(of_triangle).collect();
    for triangle in own_of(mesh, &tree).into_iter().flatten() {
        pinched[triangle as usize] = true;
    }
    pinched
}
