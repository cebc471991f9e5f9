//! Crumpled places of the canonical mesh, laid smooth.

use super::embedded;
use super::fair::to_mean;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use rayon::prelude::*;

/// Mean angle, weighted by area, between a vertex's triangles and the smoothed normal there beyond
/// which it is crumpled. On the built-in coat half of the vertices are below 3.3°, nine in ten below
/// 19.5°, and one in a hundred is above 67°.
const CRUMPLED: Real = 20.0;
/// Rounds in which crumpled vertices are looked for and moved: what is still crumpled goes further.
const ROUNDS: usize = 5;
/// Passes of a round.
const PASSES: usize = 10;
/// Share of the way to the mean of its neighbours by which a crumpled vertex moves in a pass.
const SHARE: Real = 0.5;
/// Rings round crumpled vertices that move with them, by half of that.
const RINGS: usize = 2;
/// Rounds over which the normals of vertices are smoothed.
const NORMAL_ROUNDS: usize = 3;

/// Where the fitted surface folds or meets itself, its signed distance has creases, and what is
/// extracted is as rough as a cell: at hems of loose clothes, and where they leave the body. Such
/// vertices move to the mean of their neighbours:
///
/// ```text
/// repeat: crumpled ← mean angle of the triangles at a vertex to the normals around > 20°
///         Laplacian passes there, and with half the weight over two rings
/// ```
///
/// An embedded mesh stays one ([`embedded::moved`]).
pub(super) fn smoothed(mesh: &TriMesh) -> TriMesh {
    let neighbours = Edges::new(mesh).neighbours(mesh.vertices().len());
    let mut x = mesh.vertices().to_vec();
    for _ in 0..ROUNDS {
        let weights = weights(mesh.triangles(), &x, &neighbours);
        for _ in 0..PASSES {
            x = (0..x.len())
                .into_par_iter()
                .with_min_len(4096)
                .map(|v| match weights[v] {
                    0.0 => x[v],
                    w => x[v] + to_mean(&x, &neighbours, v) * (SHARE * w),
                })
                .collect();
        }
    }
    embedded::moved(mesh, &neighbours, x)
}

/// For each vertex 1 if it is crumpled, a half near such a vertex, else 0.
fn weights(triangles: &[[u32; 3]], x: &[Point], neighbours: &Rows<u32>) -> Vec<Real> {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| &x[v as usize]);
        area_vector(a, b, c)
    };
    let areas: Vec<Vector> = triangles.par_iter().with_min_len(4096).map(area).collect();
    let mut normals = vec![Vector::zeros(); x.len()];
    for (t, n) in triangles.iter().zip(&areas) {
        t.iter().for_each(|v| normals[*v as usize] += n);
    }
    for _ in 0..NORMAL_ROUNDS {
        normals = (0..x.len())
            .into_par_iter()
            .with_min_len(4096)
            .map(|v| {
                let around = neighbours.of(v);
                let sum = around.iter().fold(Vector::zeros(), |s, u| s + normals[*u as usize]);
                normals[v] + sum / around.len().max(1) as Real
            })
            .collect();
    }
    let normals: Vec<Vector> = normals.iter().map(unit_or_zero).collect();
    let mut off = vec![(0.0, 0.0); x.len()];
    for (t, n) in triangles.iter().zip(&areas) {
        let (area, n) = (n.norm(), unit_or_zero(n));
        for v in t.map(|v| v as usize) {
            let angle = n.dot(&normals[v]).clamp(-1.0, 1.0).acos();
            off[v] = (off[v].0 + area * angle, off[v].1 + area);
        }
    }
    let limit = CRUMPLED.to_radians();
    let mut weights: Vec<Real> =
        off.iter().map(|(sum, area)| if *sum > limit * area { 1.0 } else { 0.0 }).collect();
    for _ in 0..RINGS {
        let before = weights.clone();
        let near = |v: usize| neighbours.of(v).iter().any(|u| before[*u as usize] > 0.0);
        (0..x.len()).filter(|v| before[*v] == 0.0 && near(*v)).for_each(|v| weights[v] = 0.5);
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes;
    use if_mesh::index::Bvh;
    use if_mesh::intersections::own_pairs;

    #[test]
    fn what_is_smooth_stays_and_what_is_crumpled_is_laid_smooth() {
        let ball = meshes::icosphere(0.5, 4);
        assert_eq!(smoothed(&ball).vertices(), ball.vertices());
        // One pole is crumpled by as much as its edges are long.
        let crumple = |(k, p): (usize, &Point)| {
            if p.y > 0.4 {
                p + p.coords * (0.04 * ((k * 7919 % 101) as Real / 50.0 - 1.0))
            } else {
                *p
            }
        };
        let rough: Vec<Point> = ball.vertices().iter().enumerate().map(crumple).collect();
        let rough = ball.with_vertices(rough).unwrap();
        let found = smoothed(&rough);
        let off = |m: &TriMesh| -> Real {
            let top = m.vertices().iter().filter(|p| p.y > 0.4);
            top.map(|p| (p.coords.norm() - 0.5).powi(2)).sum::<Real>().sqrt()
        };
        assert!(off(&found) < 0.6 * off(&rough), "{} {}", off(&rough), off(&found));
        let crumpled = |m: &TriMesh| {
            let neighbours = Edges::new(m).neighbours(m.vertices().len());
            let weights = weights(m.triangles(), m.vertices(), &neighbours);
            weights.iter().filter(|w| **w == 1.0).count()
        };
        assert!(crumpled(&rough) > 50 && crumpled(&found) < crumpled(&rough) / 10);
        for (p, q) in found.vertices().iter().zip(rough.vertices()).filter(|(_, q)| q.y < 0.2) {
            assert_eq!(p, q);
        }
    }

    #[test]
    fn an_embedded_mesh_stays_one() {
        // A thin, crumpled plate: smoothed alone, its two sides would go through each other.
        let ball = meshes::icosphere(0.5, 4);
        let flat = |(k, p): (usize, &Point)| {
            Point::new(p.x, 0.008 * p.y + 0.03 * (9.0 * p.x).sin() * (11.0 * p.z).sin(), p.z)
                + p.coords * (0.01 * (k * 37 % 11) as Real / 5.0)
        };
        let plate: Vec<Point> = ball.vertices().iter().enumerate().map(flat).collect();
        let plate = ball.with_vertices(plate).unwrap();
        let pairs = |m: &TriMesh| own_pairs(m, &Bvh::new(m)).len();
        let found = smoothed(&plate);
        assert!(found.vertices() != plate.vertices());
        assert!(pairs(&found) <= pairs(&plate), "{} {}", pairs(&plate), pairs(&found));
    }
}
