//! Voxels of a garment that is closed by shadows, curtains and caps.

use super::ClosedLayer;
use crate::body_surface::BodySurface;
use crate::index::Bvh;
use crate::sheet::Sheet;
use crate::voxels::{Voxel, Voxels};
use if_core::aabb::Aabb;
use if_core::closest::ClosestPoint;
use if_core::edges::{Edges, NONE};
use if_core::math::{Point, Real, Vector, barycentric_point, unit_or_zero};
use if_core::mesh::TriMesh;
use rayon::prelude::*;

/// Side of the voxels, as a share of the body's height: 4 mm for a person. Halving it costs eight
/// times the memory and changes no sign on the test data; doubling it merges sleeves with the
/// torso.
pub(super) const CELL: Real = 1.0 / 420.0;
/// Maximum distance to the body at which a triangle casts a shadow, as a share of the body's height:
/// 50 mm for a person, more than the gap between a collar and a neck.
const SHADOW: Real = 1.0 / 34.0;
/// Radius of the ball that touches cloth from behind, in which a part of the body is looked for, as a
/// share of the largest length of a shadow.
const BEHIND: Real = 1.5;
/// Maximum length of curtains, as a share of the body's height; a loop farther away has a cap only.
const CURTAIN: Real = 0.25;

/// Curtains and parts of caps per task: each may lead through many voxels.
const TASK: usize = 16;

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
    cast_shadow(&mut voxels, mesh, edges, body.skin(), height * SHADOW);
    voxels.add_walls(body.surface().map_or(body_mesh, BodySurface::closed));
    let closing = curtains_and_caps(&Sheet::new(mesh, edges), body);
    voxels.add_walls_of(closing.into_par_iter().with_max_len(TASK));
    match body.surface() {
        Some(surface) => voxels.flood(|p| !surface.contains(p)),
        None => {
            voxels.flood(|p| body.sided(p, Real::INFINITY).is_none_or(|s| s.distance > 0.0));
        }
    }
    voxels
}

/// Fills the space between each triangle and the body.
fn cast_shadow(voxels: &mut Voxels, mesh: &TriMesh, edges: &Edges, body: &Bvh, reach: Real) {
    let feet: Vec<Option<Point>> =
        mesh.vertices().par_iter().map(|p| foot(voxels, p, body, reach)).collect();
    let cell = voxels.cell();
    let longest =
        |p: [&Point; 3]| (0..3).map(|k| (p[k] - p[(k + 1) % 3]).norm()).fold(0.0, Real::max);
    let feet_of = |t: usize| match mesh.triangles()[t].map(|v| feet[v as usize]) {
        [Some(a), Some(b), Some(c)] => Some([a, b, c]),
        _ => None,
    };
    // Parts that an edge of each triangle is divided into; 0 without a shadow.
    let steps = |t: usize| {
        let size = longest(mesh.corners(t));
        // Nearest points on two legs, or on an arm and the torso, have no common shadow.
        let is_common = |foot: &[Point; 3]| longest(foot.each_ref()) <= 2.0 * size + 2.0 * cell;
        let parts = || (1.5 * size / cell).ceil().max(1.0) as usize;
        feet_of(t).filter(is_common).map_or(0, |_| parts())
    };
    let triangles = 0..mesh.triangles().len();
    let steps: Vec<usize> = triangles.clone().into_par_iter().map(steps).collect();
    let mut first = vec![NONE; mesh.vertices().len()];
    for t in triangles.clone().rev().filter(|t| steps[*t] > 0) {
        mesh.triangles()[t].iter().for_each(|v| first[*v as usize] = t as u32);
    }
    let shadow = |t: usize| {
        let foot = feet_of(t).filter(|_| steps[t] > 0)?;
        let corners = mesh.triangles()[t].map(|v| first[v as usize] == t as u32);
        let is_first = |e: u32| {
            let first = edges.triangles[e as usize][0] as usize;
            first == t || steps[first] != steps[t]
        };
        let own = Own { corners, edges: edges.of_triangle[t].map(is_first) };
        Some(segments(mesh.corners(t), foot, steps[t], own))
    };
    voxels.fill(triangles.into_par_iter().filter_map(shadow).flatten_iter());
}

/// The point of the `body` that the shadow of a garment's vertex `p` ends at, if it casts one.
///
/// Of cloth between a trunk and an arm the nearest point may be on the arm: the way there leads
/// through the garment's own sleeve, and the space before that is outside. There, with a part of the
/// body behind, no shadow is cast. Behind a collar or a lapel there is none.
fn foot(voxels: &Voxels, p: &Point, body: &Bvh, reach: Real) -> Option<Point> {
    let nearest = body.closest(p, reach)?.point;
    let radius = BEHIND * reach;
    let is_behind = || {
        let middle = p + unit_or_zero(&(p - nearest)) * radius;
        body.closest(&middle, radius).is_some()
    };
    (!meets_wall(voxels, p, &nearest) || !is_behind()).then_some(nearest)
}

/// Whether the way between two points leads out of the walls at the first one and into one again.
fn meets_wall(voxels: &Voxels, from: &Point, to: &Point) -> bool {
    let steps = (2.0 * (to - from).amax() / voxels.cell()).ceil().max(1.0);
    let mut has_left = false;
    (0..=steps as usize).any(|k| {
        let is_wall = voxels.at(&(from + (to - from) * (k as Real / steps))) == Voxel::Wall;
        has_left |= !is_wall;
        has_left && is_wall
    })
}

/// The corners and edges (from corner k to corner k + 1) of a triangle that no other triangle has
/// filled the space below of.
struct Own {
    corners: [bool; 3],
    edges: [bool; 3],
}

/// Segments that fill the space between a triangle and its nearest points on the body. Each edge is
/// divided into `steps` parts.
fn segments(
    top: [&Point; 3],
    foot: [Point; 3],
    steps: usize,
    own: Own,
) -> impl Iterator<Item = [Point; 2]> + '_ {
    let is_own = move |i: usize, j: usize| match (i, j, steps - i - j) {
        (0, 0, _) => own.corners[0],
        (_, 0, 0) => own.corners[1],
        (0, _, 0) => own.corners[2],
        (_, 0, _) => own.edges[0],
        (_, _, 0) => own.edges[1],
        (0, _, _) => own.edges[2],
        _ => true,
    };
    let places = (0..=steps).flat_map(move |i| (0..=steps - i).map(move |j| (i, j)));
    places.filter(move |(i, j)| is_own(*i, *j)).map(move |(i, j)| {
        let (u, v) = (i as Real / steps as Real, j as Real / steps as Real);
        let w = [1.0 - u - v, u, v];
        [barycentric_point(top, w), barycentric_point(foot.each_ref(), w)]
    })
}

/// What closes the openings of a garment over `body`.
pub(super) fn curtains_and_caps(sheet: &Sheet, body: &ClosedLayer) -> Vec<[Point; 3]> {
    closing_within(sheet, body, body.bvh.aabb().size().max() * CURTAIN)
}

/// Caps over the openings of a garment over `body`.
pub(super) fn caps(sheet: &Sheet, body: &ClosedLayer) -> Vec<[Point; 3]> {
    closing_within(sheet, body, 0.0)
}

/// As [`curtains_and_caps`], with curtains where the body is within `reach` metres. The rims of cloth with
/// thickness have caps alone: where a sleeve of it turns to the trunk, a curtain would lead there.
fn closing_within(sheet: &Sheet, body: &ClosedLayer, reach: Real) -> Vec<[Point; 3]> {
    let loops = sheet.edges.boundary_loops(&sheet.mesh);
    let hems = loops.iter().flat_map(|walk| closing(&sheet.mesh, walk, body, reach));
    let rims = sheet.rims(body.skin());
    hems.chain(rims.iter().flat_map(|walk| closing(&sheet.mesh, walk, body, 0.0))).collect()
}

/// Curtains from the loop to the body, and a cap over the loop.
///
/// Where parts of the body are not there, the nearest part may be a hand beside a hem: curtains
/// then lead towards the middle of the loop only.
fn closing(mesh: &TriMesh, walk: &[u32], body: &ClosedLayer, reach: Real) -> Vec<[Point; 3]> {
    let rim: Vec<Point> = walk.iter().map(|v| mesh.vertices()[*v as usize]).collect();
    let middle = Point::from(rim.iter().map(|p| p.coords).sum::<Vector>() / rim.len() as Real);
    let feet: Vec<Option<Point>> =
        rim.par_iter().map(|p| body.skin().closest(p, reach).map(|c| c.point)).collect();
    let inwards_only = body.surface().is_some_and(BodySurface::is_incomplete);
    let is_curtain =
        |k: usize, foot: &Point| !inwards_only || (foot - rim[k]).dot(&(middle - rim[k])) > 0.0;
    let mut triangles = Vec::with_capacity(3 * rim.len());
    for k in 0..rim.len() {
        let next = (k + 1) % rim.len();
        triangles.push([rim[k], rim[next], middle]);
        if let (Some(a), Some(b)) = (feet[k], feet[next])
            && is_curtain(k, &a)
            && is_curtain(next, &b)
        {
            triangles.extend([[rim[k], rim[next], b], [rim[k], b, a]]);
        }
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes::{icosphere, tube};

    /// The voxels filled below a mesh by all segments of all triangles.
    fn filled_anew(mesh: &TriMesh, body: &Bvh, reach: Real, voxels: &mut Voxels) {
        let (cell, every) = (voxels.cell(), [true; 3]);
        let mut all = Vec::new();
        for t in 0..mesh.triangles().len() {
            let top = mesh.corners(t);
            let foot = top.map(|p| body.closest(p, reach).map(|c| c.point));
            let [Some(a), Some(b), Some(c)] = foot else { continue };
            let size = (0..3).map(|k| (top[k] - top[(k + 1) % 3]).norm()).fold(0.0, Real::max);
            let steps = (1.5 * size / cell).ceil().max(1.0) as usize;
            all.extend(segments(top, [a, b, c], steps, Own { corners: every, edges: every }));
        }
        voxels.fill(all.into_par_iter());
    }

    #[test]
    fn shadows_of_shared_corners_and_edges_are_filled_once_and_wholly() {
        let body = Bvh::new(&icosphere(0.1, 3));
        // Triangles of different sizes, some of them beyond reach of the body.
        let bent = tube(0.12, 0.3, 9, 14, true);
        let vertices =
            bent.vertices().iter().map(|p| Point::new(p.x * (1.0 + p.y), p.y * p.y, p.z));
        let mesh = bent.with_vertices(vertices.collect()).unwrap();
        for cell in [0.004, 0.01, 0.03, 0.2] {
            let mut once = Voxels::new(&mesh.aabb(), cell);
            let mut anew = once.clone();
            cast_shadow(&mut once, &mesh, &Edges::new(&mesh), &body, 0.06);
            filled_anew(&mesh, &body, 0.06, &mut anew);
            assert_eq!(once.counts(), anew.counts(), "{cell}");
            assert!(cell > 0.02 || once.counts()[3] > 100, "{:?}", once.counts());
        }
    }
}
