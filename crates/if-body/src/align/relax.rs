//! Relaxes cloth that the map of the bodies stretches: as rigid as possible, held where the body is near.
//!
//! ```text
//! min over y, R:   Σ wₐ_b |yₐ − y_b − s (Rₐ + R_b)/2 (xₐ − x_b)|² over the edges + Σ hᵥ |yᵥ − mᵥ|²
//! w = area at the edge / (its length)²,   h = area at the vertex / λ(d)²,   λ(d) = hold (1 + (d / near)²)
//! ```
//!
//! x are the vertices on the source body, d from its surface, m where the map puts them, and s is the scale
//! of the bodies. At the body cloth stays where the map puts it. Between limbs the map follows now one
//! and now the other; there the cloth spans them with the edges that it has.
//!
//! # Source
//!
//! Sorkine and Alexa 2007, *As-rigid-as-possible surface modeling*: rotations and a solve by turns, with
//! a matrix that is factored once. The weights are those of strain energy, so that small triangles and
//! fine meshes are no stiffer. That the map holds according to the distance of the body is ours.

use super::AlignParams;
use crate::skin_weights::SkinError;
use crate::surface::nearest_turn;
use if_core::edges::{Edges, parts};
use if_core::math::{Point, Real, Vector, area_vector};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use if_mesh::point_tree::PointTree;
use if_mesh::seams::weld_all;
use if_sparse::{Cholesky, Entry, Mat};
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Largest number of rounds.
const ROUNDS: usize = 10;
/// Largest movement in a round after which there is no further one, in metres.
const DONE: Real = 0.1e-3;
/// Shortest length of an edge, in metres: shorter ones would outweigh all others.
const SHORTEST: Real = 1e-5;
/// Distance within which parts of a garment, as a button and the front, hold on to each other, in metres.
const SEWN: Real = 0.01;
/// Number of nearest vertices among which one of another part is looked for.
const SEARCHED: usize = 16;
/// Weight of a link between parts: that of the edge between two equilateral triangles, 1 / 2√3.
const LINK: Real = 0.288_675;

/// Where a garment is before it is relaxed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mapped<'a> {
    /// The vertices on the target body.
    pub(super) points: &'a [Point],
    /// Their distances from the source body in metres, on it.
    pub(super) distances: &'a [Real],
    /// Scale of the bodies.
    pub(super) scale: Real,
}

/// The relaxed vertices of `garment`. Vertices at one position, as along a seam, stay together; those of no
/// triangle stay where the map puts them.
///
/// # Errors
///
/// The system cannot be solved: edges differ too much in length, or memory is short.
pub(super) fn relaxed(
    garment: &TriMesh,
    mapped: &Mapped,
    params: &AlignParams,
) -> Result<Vec<Point>, SkinError> {
    if garment.triangles().is_empty() {
        return Ok(mapped.points.to_vec());
    }
    let Some(welded) = weld_all(garment) else { return relaxed_sewn(garment, mapped, params) };
    let first = welded.first_of();
    let points: Vec<Point> = first.iter().map(|v| mapped.points[*v as usize]).collect();
    let distances: Vec<Real> = first.iter().map(|v| mapped.distances[*v as usize]).collect();
    let sewn = Mapped { points: &points, distances: &distances, ..*mapped };
    let found = relaxed_sewn(&welded.mesh, &sewn, params)?;
    Ok(welded.unweld(&found, mapped.points))
}

fn relaxed_sewn(
    garment: &TriMesh,
    mapped: &Mapped,
    params: &AlignParams,
) -> Result<Vec<Point>, SkinError> {
    let (rest, n) = (garment.vertices(), garment.vertices().len());
    let net = Net::new(garment);
    let hold = |v: usize| {
        let width = params.hold * (1.0 + (mapped.distances[v] / params.near).powi(2));
        net.areas[v].max(SHORTEST * SHORTEST) / (width * width)
    };
    let hold: Vec<Real> = (0..n).map(hold).collect();
    let mut entries = Vec::with_capacity(4 * n);
    for (v, hold) in hold.iter().enumerate() {
        let links = net.links.of(v);
        entries.push(Entry::new(v, v, hold + links.iter().map(|(_, w)| w).sum::<Real>()));
        let before = links.iter().filter(|(u, _)| (*u as usize) < v);
        entries.extend(before.map(|(u, w)| Entry::new(v, *u as usize, -w)));
    }
    let factor = Cholesky::new(n, &entries)?;
    let mut points = mapped.points.to_vec();
    for _ in 0..ROUNDS {
        let links = |v: usize| net.links.of(v).iter().map(|(u, w)| (*u as usize, *w));
        let turn = |v: usize| -> Matrix3<Real> {
            let of = |(u, w): (usize, Real)| {
                (points[v] - points[u]) * (rest[v] - rest[u]).transpose() * w
            };
            nearest_turn(&links(v).map(of).sum()).to_rotation_matrix().into_inner()
        };
        let turns: Vec<Matrix3<Real>> =
            (0..n).into_par_iter().with_min_len(256).map(turn).collect();
        let right = |v: usize| -> Vector {
            let of = |(u, w): (usize, Real)| (turns[v] + turns[u]) * (rest[v] - rest[u]) * w;
            mapped.points[v].coords * hold[v]
                + links(v).map(of).sum::<Vector>() * (0.5 * mapped.scale)
        };
        let right: Vec<Vector> = (0..n).into_par_iter().with_min_len(256).map(right).collect();
        let mut x = Mat::from_fn(n, 3, |v, k| right[v][k]);
        factor.solve_in_place(&mut x);
        let mut most: Real = 0.0;
        for (v, p) in points.iter_mut().enumerate() {
            let next = Point::new(x[(v, 0)], x[(v, 1)], x[(v, 2)]);
            most = most.max((next - *p).norm());
            *p = next;
        }
        if most <= DONE {
            break;
        }
    }
    Ok(points)
}

/// What holds a garment together.
struct Net {
    /// For each vertex those that it is linked to, with the weights.
    links: Rows<(u32, Real)>,
    /// The area at each vertex: a third of its triangles.
    areas: Vec<Real>,
}

impl Net {
    fn new(garment: &TriMesh) -> Self {
        let (rest, edges) = (garment.vertices(), Edges::new(garment));
        let (mut areas, mut shares) = (vec![0.0; rest.len()], vec![0.0; edges.vertices.len()]);
        for (t, of) in garment.triangles().iter().zip(&edges.of_triangle) {
            let [a, b, c] = t.map(|v| &rest[v as usize]);
            let third = area_vector(a, b, c).norm() / 6.0;
            t.iter().for_each(|v| areas[*v as usize] += third);
            of.iter().for_each(|e| shares[*e as usize] += third);
        }
        let edge = |([a, b], share): (&[u32; 2], &Real)| {
            let length = (rest[*a as usize] - rest[*b as usize]).norm().max(SHORTEST);
            (*a, *b, share / (length * length))
        };
        let mut links: Vec<_> = edges.vertices.iter().zip(&shares).map(edge).collect();
        links.extend(between_parts(garment));
        let both = links.iter().flat_map(|(a, b, w)| [(*a, (*b, *w)), (*b, (*a, *w))]);
        Self { links: Rows::new(rest.len(), both), areas }
    }
}

/// Links from vertices to near ones of other parts.
fn between_parts(garment: &TriMesh) -> Vec<(u32, u32, Real)> {
    let (rest, parts) = (garment.vertices(), parts(garment));
    if parts.iter().all(|p| *p == parts[0]) {
        return Vec::new();
    }
    let used = garment.used_vertices();
    let tree = PointTree::new(rest);
    let other = |found: &mut Vec<(Real, u32)>, v: usize| {
        tree.nearest(&rest[v], SEARCHED, found);
        let is_other = |u: u32| used[u as usize] && parts[u as usize] != parts[v];
        let near = found.iter().find(|(d2, u)| *d2 <= SEWN * SEWN && is_other(*u));
        near.filter(|_| used[v]).map(|(_, u)| (v as u32, *u, LINK))
    };
    let found = (0..rest.len()).into_par_iter().with_min_len(256).map_init(Vec::new, other);
    found.flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes::cloth;
    use if_mesh::measure::strain;
    use nalgebra::Rotation3;

    /// A sheet of 1 m by 0.4 m with edges of 1 cm, and the distances of its vertices from what holds it at both
    /// ends.
    fn sheet() -> (TriMesh, Vec<Real>) {
        let mesh = cloth(1.0, 0.4, 100, 40);
        let distances = mesh.vertices().iter().map(|p| p.x.min(1.0 - p.x)).collect();
        (mesh, distances)
    }

    /// Right of the middle the map follows another body, which is `away` farther right.
    fn parted(points: &[Point], away: Real) -> Vec<Point> {
        points.iter().map(|p| p + Vector::x() * if p.x > 0.5 { away } else { 0.0 }).collect()
    }

    fn relax(mesh: &TriMesh, points: &[Point], distances: &[Real], scale: Real) -> Vec<Point> {
        relaxed(mesh, &Mapped { points, distances, scale }, &AlignParams::default()).unwrap()
    }

    #[test]
    fn what_is_turned_and_scaled_as_a_whole_stays() {
        let (mesh, distances) = sheet();
        let turn = Rotation3::from_euler_angles(0.3, -2.0, 1.1);
        let there: Vec<Point> =
            mesh.vertices().iter().map(|p| turn * (p * 0.8) + Vector::x()).collect();
        let found = relax(&mesh, &there, &distances, 0.8);
        let most = found.iter().zip(&there).map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        assert!(most < 1e-9, "{most}");
    }

    #[test]
    fn a_stretch_between_limbs_is_spread_and_ends_stay() {
        let (mesh, distances) = sheet();
        let there = parted(mesh.vertices(), 0.02);
        let found = relax(&mesh, &there, &distances, 1.0);
        let [before, after] = [&there, &found].map(|points| strain(&mesh, points));
        assert!(before.max > 0.5 && after.max < 0.1, "{before:?} {after:?}");
        for ((p, q), d) in found.iter().zip(&there).zip(&distances) {
            assert!(*d > 0.0 || (p - q).norm() < 1e-3, "{}", (p - q).norm());
        }
    }

    #[test]
    fn a_button_goes_with_the_front_and_a_seam_stays_closed() {
        let (mesh, mut distances) = sheet();
        let (n, mut triangles) = (mesh.vertices().len() as u32, mesh.triangles().to_vec());
        let mut points = mesh.vertices().to_vec();
        // A button 2 mm before the front, right of the middle: all of it is mapped alike, and only
        // the front beside it takes it along. And a vertex of no triangle.
        points.extend(
            [[0.502, 0.2], [0.506, 0.2], [0.502, 0.204]].map(|[x, y]| Point::new(x, y, 0.002)),
        );
        triangles.push([n, n + 1, n + 2]);
        points.push(Point::new(5.0, 5.0, 5.0));
        distances.extend([0.5, 0.5, 0.5, 9.0]);
        // The triangles of the left half have vertices of their own.
        let all = points.len() as u32;
        let is_left = |t: &[u32; 3]| t.iter().all(|v| points[*v as usize].x <= 0.5);
        triangles.iter_mut().filter(|t| is_left(t)).for_each(|t| *t = t.map(|v| v + all));
        points.extend_from_within(..);
        distances.extend_from_within(..);
        let mesh = TriMesh::new(points, triangles).unwrap();
        let there = parted(mesh.vertices(), 0.04);
        let found = relax(&mesh, &there, &distances, 1.0);
        let used = mesh.used_vertices();
        let all = all as usize;
        let seam: Vec<usize> = (0..all).filter(|v| used[*v] && used[v + all]).collect();
        assert_eq!(seam.len(), 41);
        assert!(seam.iter().all(|v| found[*v] == found[v + all]));
        let n = n as usize;
        let beside = (0..n).filter(|v| used[*v]).map(|v| (found[v] - found[n]).norm());
        let gap = beside.fold(Real::INFINITY, Real::min);
        assert!((found[n].x - there[n].x).abs() > 0.01 && gap < 0.01, "{} {gap}", found[n]);
        assert_eq!(found[n + 3], there[n + 3]);
    }
}
