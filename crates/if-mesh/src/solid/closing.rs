//! Voxels of a garment that is closed by shadows, curtains and caps.

use super::ClosedLayer;
use crate::body_surface::BodySurface;
use crate::index::Bvh;
use crate::voxels::Voxels;
use if_core::aabb::Aabb;
use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, barycentric_point};
use if_core::mesh::TriMesh;
use rayon::prelude::*;

/// Side of the voxels, as a share of the body's height: 4 mm for a person. Halving it costs eight
/// times the memory and changes no sign on the test data; doubling it merges sleeves with the
/// torso.
pub(super) const CELL: Real = 1.0 / 420.0;
/// Maximum distance to the body at which a triangle casts a shadow, as a share of the body's height:
/// 50 mm for a person, more than the gap between a collar and a neck.
const SHADOW: Real = 1.0 / 34.0;
/// Maximum length of curtains, as a share of the body's height; a loop farther away has a cap only.
const CURTAIN: Real = 0.25;

/// Distances along a normal, in voxels, at which a voxel without a wall is searched.
pub(super) const PROBES: [Real; 5] = [0.8, 1.2, 1.7, 2.2, 2.8];

/// Voxels flooded from outside, with the garment, its shadow, the body, curtains and caps as walls.
pub(super) fn closed_voxels(
    mesh: &TriMesh,
    edges: &Edges,
    body: &ClosedLayer,
    body_mesh: &TriMesh,
) -> Voxels {
    let height = body.bvh.aabb().size().max();
    let extent =
        Aabb::from_points(mesh.triangles().iter().flatten().map(|v| &mesh.vertices()[*v as usize]));
    let mut voxels =
        Voxels::new(&extent.inflated(height * CELL * PROBES[PROBES.len() - 1]), height * CELL);
    voxels.add_walls(mesh);
    cast_shadow(&mut voxels, mesh, body.skin(), height * SHADOW);
    voxels.add_walls(body.surface().map_or(body_mesh, BodySurface::closed));
    for walk in edges.boundary_loops(mesh) {
        close_loop(&mut voxels, mesh, &walk, body, height * CURTAIN);
    }
    match body.surface() {
        Some(surface) => voxels.flood(|p| !surface.contains(p)),
        None => {
            voxels.flood(|p| body.sided(p, Real::INFINITY).is_none_or(|s| s.distance > 0.0));
        }
    }
    voxels
}

/// Fills the space between each triangle and the body.
fn cast_shadow(voxels: &mut Voxels, mesh: &TriMesh, body: &Bvh, reach: Real) {
    let feet: Vec<Option<Point>> =
        mesh.vertices().par_iter().map(|p| body.closest(p, reach).map(|c| c.point)).collect();
    let cell = voxels.cell();
    let longest =
        |p: [&Point; 3]| (0..3).map(|k| (p[k] - p[(k + 1) % 3]).norm()).fold(0.0, Real::max);
    let shadow = |t: usize| {
        let [Some(a), Some(b), Some(c)] = mesh.triangles()[t].map(|v| feet[v as usize]) else {
            return None;
        };
        let (top, foot) = (mesh.corners(t), [a, b, c]);
        let size = longest(top);
        // Nearest points on two legs, or on an arm and the torso, have no common shadow.
        if longest(foot.each_ref()) > 2.0 * size + 2.0 * cell {
            return None;
        }
        let steps = (1.5 * size / cell).ceil().max(1.0) as usize;
        Some(segments(top, foot, steps))
    };
    let all = (0..mesh.triangles().len()).into_par_iter().filter_map(shadow).flatten_iter();
    voxels.fill(all);
}

/// Segments that fill the space between a triangle and its nearest points on the body.
fn segments(
    top: [&Point; 3],
    foot: [Point; 3],
    steps: usize,
) -> impl Iterator<Item = [Point; 2]> + '_ {
    let places = (0..=steps).flat_map(move |i| (0..=steps - i).map(move |j| (i, j)));
    places.map(move |(i, j)| {
        let (u, v) = (i as Real / steps as Real, j as Real / steps as Real);
        let w = [1.0 - u - v, u, v];
        [barycentric_point(top, w), barycentric_point(foot.each_ref(), w)]
    })
}

/// Adds curtains from the loop to the body, and a cap over the loop.
///
/// Where parts of the body are not there, the nearest part may be a hand beside a hem: curtains
/// then lead towards the middle of the loop only.
fn close_loop(voxels: &mut Voxels, mesh: &TriMesh, walk: &[u32], body: &ClosedLayer, reach: Real) {
    let rim: Vec<Point> = walk.iter().map(|v| mesh.vertices()[*v as usize]).collect();
    let middle = Point::from(rim.iter().map(|p| p.coords).sum::<Vector>() / rim.len() as Real);
    let feet: Vec<Option<Point>> =
        rim.par_iter().map(|p| body.skin().closest(p, reach).map(|c| c.point)).collect();
    let inwards_only = body.surface().is_some_and(BodySurface::is_incomplete);
    let is_curtain =
        |k: usize, foot: &Point| !inwards_only || (foot - rim[k]).dot(&(middle - rim[k])) > 0.0;
    for k in 0..rim.len() {
        let next = (k + 1) % rim.len();
        voxels.add_wall([&rim[k], &rim[next], &middle]);
        if let (Some(a), Some(b)) = (&feet[k], &feet[next])
            && is_curtain(k, a)
            && is_curtain(next, b)
        {
            voxels.add_wall([&rim[k], &rim[next], b]);
            voxels.add_wall([&rim[k], b, a]);
        }
    }
}
