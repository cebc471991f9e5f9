//! Non-rigid registration: deforms the surface of one body onto that of another.
//!
//! ```text
//! for rounds of diffusion n = 256, 256, 128, …, 4:
//!     r = nearest point of the target − vertex    where it is near and faces the same way
//!     vertices += r, diffused n times over the edges, normalised by the diffused count of vertices with an r
//! ```
//!
//! Wide diffusion moves whole limbs first, narrow diffusion fits details last; vertices without r
//! follow their neighbours. The result is deterministic and independent of the order of vertices.

use super::AlignParams;
use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use if_mesh::index::Bvh;
use if_mesh::seams::weld_all;
use rayon::prelude::*;

/// Rounds of diffusion, one entry for each search of nearest points.
const ROUNDS: [usize; 16] = [256, 256, 256, 128, 128, 128, 64, 64, 32, 32, 16, 16, 8, 8, 4, 4];
/// Largest distance of a nearest point, as a share of the target's height.
const SEARCH_RADIUS: Real = 0.06;
/// Least cosine between the normals of a vertex and of its nearest point, to reject opposite sides
/// of fingers and folds.
const FACING: Real = 0.5;

pub(super) struct Registered {
    /// Positions of the source's vertices.
    pub(super) positions: Vec<Point>,
    /// Their mean distance from the target's surface, in metres.
    pub(super) residual: Real,
    /// Share of the source's area whose triangles turned by more than a right angle.
    pub(super) turned: Real,
}

impl Registered {
    pub(super) fn is_good(&self, params: &AlignParams, target: &TriMesh) -> bool {
        self.residual <= params.poor * target.aabb().size().y && self.turned <= params.turned
    }
}

/// Registers `source`, whose vertices start at `start`, with `target`. Vertices of `source` at one position stay
/// together.
pub(super) fn register(source: &TriMesh, target: &TriMesh, start: Vec<Point>) -> Registered {
    let Some(welded) = weld_all(source) else { return register_sewn(source, target, start) };
    let sewn = welded.first_of().iter().map(|v| start[*v as usize]).collect();
    let found = register_sewn(&welded.mesh, target, sewn);
    Registered { positions: welded.unweld(&found.positions, &start), ..found }
}

fn register_sewn(source: &TriMesh, target: &TriMesh, start: Vec<Point>) -> Registered {
    let (tree, normals) = (Bvh::new(target), face_normals(target, target.vertices()));
    let radius = SEARCH_RADIUS * target.aabb().size().y;
    let graph = Graph::new(source);
    let mut positions = start.clone();
    for rounds in ROUNDS {
        let vertex_normals = vertex_normals(source, &positions);
        let found: Vec<Option<Vector>> = positions
            .par_iter()
            .zip(&vertex_normals)
            .map(|(p, n)| {
                let near = tree.closest(p, radius)?;
                (normals[near.triangle as usize].dot(n) >= FACING).then(|| near.point - p)
            })
            .collect();
        let moves = graph.diffused(&found, rounds);
        positions.iter_mut().zip(moves).for_each(|(p, m)| *p += m);
    }
    let residual = residual(positions.iter().copied(), target);
    let turned = turned(source, &start, &positions);
    Registered { positions, residual, turned }
}

/// Mean distance of points from a surface, in metres; zero for no points.
pub(super) fn residual(points: impl Iterator<Item = Point>, target: &TriMesh) -> Real {
    let tree = Bvh::new(target);
    let points: Vec<Point> = points.collect();
    let distances: Vec<Real> = points
        .par_iter()
        .map(|p| tree.closest(p, Real::INFINITY).map_or(0.0, |c| c.distance))
        .collect();
    distances.iter().sum::<Real>() / distances.len().max(1) as Real
}

/// Share of the area whose normals turned by more than a right angle.
fn turned(mesh: &TriMesh, before: &[Point], after: &[Point]) -> Real {
    let (mut all, mut turned) = (0.0, 0.0);
    for t in mesh.triangles() {
        let area =
            |p: &[Point]| area_vector(&p[t[0] as usize], &p[t[1] as usize], &p[t[2] as usize]);
        let (a, b) = (area(before), area(after));
        all += a.norm();
        turned += if a.dot(&b) < 0.0 { a.norm() } else { 0.0 };
    }
    if all > 0.0 { turned / all } else { 0.0 }
}

fn face_normals(mesh: &TriMesh, at: &[Point]) -> Vec<Vector> {
    let normal = |t: &[u32; 3]| {
        unit_or_zero(&area_vector(&at[t[0] as usize], &at[t[1] as usize], &at[t[2] as usize]))
    };
    mesh.triangles().iter().map(normal).collect()
}

/// Area-weighted; zero for vertices without triangles.
fn vertex_normals(mesh: &TriMesh, at: &[Point]) -> Vec<Vector> {
    let mut normals = vec![Vector::zeros(); at.len()];
    for t in mesh.triangles() {
        let n = area_vector(&at[t[0] as usize], &at[t[1] as usize], &at[t[2] as usize]);
        t.iter().for_each(|v| normals[*v as usize] += n);
    }
    normals.iter().map(unit_or_zero).collect()
}

/// The neighbours of each vertex.
struct Graph(Rows<u32>);

impl Graph {
    fn new(mesh: &TriMesh) -> Self {
        Self(Edges::new(mesh).neighbours(mesh.vertices().len()))
    }

    /// Normalised diffusion: `rounds` times each value becomes the mean of itself and the mean of
    /// its neighbours, then the sum is divided by the diffused count of values. Zero where that
    /// count is zero.
    fn diffused(&self, values: &[Option<Vector>], rounds: usize) -> Vec<Vector> {
        let mut now: Vec<[Real; 4]> =
            values.iter().map(|v| v.map_or([0.0; 4], |v| [v.x, v.y, v.z, 1.0])).collect();
        let mut next = now.clone();
        for _ in 0..rounds {
            next.par_iter_mut().enumerate().with_min_len(2048).for_each(|(v, out)| {
                let around = self.0.of(v);
                let mut sum = [0.0; 4];
                for n in around {
                    (0..4).for_each(|k| sum[k] += now[*n as usize][k]);
                }
                let share = if around.is_empty() { 0.0 } else { 0.5 / around.len() as Real };
                let keep = if around.is_empty() { 1.0 } else { 0.5 };
                *out = [0, 1, 2, 3].map(|k| keep * now[v][k] + share * sum[k]);
            });
            std::mem::swap(&mut now, &mut next);
        }
        now.iter()
            .map(
                |[x, y, z, n]| {
                    if *n > 0.0 { Vector::new(*x, *y, *z) / *n } else { Vector::zeros() }
                },
            )
            .collect()
    }
}
