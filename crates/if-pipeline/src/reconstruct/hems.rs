//! Hems of garments, laid straight.

use super::embedded;
use if_core::edges::{Edges, NONE, parts};
use if_core::geodesic::Neighbours;
use if_core::math::{Point, Real, area_vector};
use if_core::mesh::TriMesh;
use if_sparse::{Cholesky, Entry, Mat};

/// Width of a hem, in metres: about the cell of the extraction and what its edges are rounded by.
const WIDTH: Real = 0.01;
/// Length over which cloth beside a hem bends, in metres, before it leaves its place.
const BEND: Real = 0.02;
/// Weight with which a hem itself keeps its place, relative to cloth beside it. It makes the system
/// regular where a hem hangs on a corner alone.
const STAY: Real = 1e-3;
/// Largest coefficient of a hinge relative to its weight: slivers have larger ones, and are softer.
const SLIVER: Real = 50.0;

/// The canonical mesh is closed. At a hem it turns from the garment to its underside, or steps down
/// to what is below, and the turn is rounded: the garment that is cut out of it ends in a rim of a
/// centimetre that curls in. Here the rim is laid straight on from the cloth beside it, as long as
/// it is, by the least
///
/// ```text
/// Σ 3 / (A₁ + A₂) |Σ cₖ xₖ|²  over pairs of triangles at an edge: the bending energy of isometric deformations,
///                             zero where both lie in one plane [Bergou et al. 2006]
/// + Σ Aᵥ wᵥ / BEND⁴ |xᵥ − x̄ᵥ|²   w = 1 beyond 2 WIDTH from the boundary along edges (fixed there), falling to STAY at WIDTH
/// ```
///
/// A part that is rim throughout, of which nothing is fixed, stays: it would shrink to a point. Where
/// triangles would meet, that is taken back ([`embedded::moved`]), and where there is no solution,
/// which garments without slivers have, the mesh stays as it is.
pub(super) fn straightened(mesh: &TriMesh) -> TriMesh {
    let (x, edges) = (mesh.vertices(), Edges::new(mesh));
    let on_boundary = edges.boundary_vertices(x.len());
    let boundary = (0..x.len() as u32).filter(|v| on_boundary[*v as usize]);
    let far = Neighbours::new(&edges, x).distances(boundary, 2.0 * WIDTH);
    let part = parts(mesh);
    let mut held = vec![false; x.len()];
    (0..x.len()).filter(|v| far[*v] >= 2.0 * WIDTH).for_each(|v| held[part[v] as usize] = true);
    let is_free = |v: &usize| far[*v] < 2.0 * WIDTH && held[part[*v] as usize];
    let free: Vec<usize> = (0..x.len()).filter(is_free).collect();
    let mut row = vec![None; x.len()];
    free.iter().enumerate().for_each(|(i, v)| row[*v] = Some(i));

    // A third of the triangles around each vertex.
    let mut areas = vec![0.0; x.len()];
    for (t, tri) in mesh.triangles().iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        let share = area_vector(a, b, c).norm() / 6.0;
        tri.iter().for_each(|v| areas[*v as usize] += share);
    }
    let mut right = Mat::zeros(free.len(), 3);
    let mut entries = Vec::new();
    for (i, &v) in free.iter().enumerate() {
        let held = ((far[v] - WIDTH) / WIDTH).max(0.0).powi(2).max(STAY);
        let weight = areas[v] * held / BEND.powi(4);
        entries.push(Entry::new(i, i, weight));
        (0..3).for_each(|k| right[(i, k)] = weight * x[v][k]);
    }
    for (e, &[s, t]) in edges.triangles.iter().enumerate() {
        if t == NONE || edges.valence[e] > 2 {
            continue;
        }
        let [a, b] = edges.vertices[e];
        let third = |t: u32| mesh.triangles()[t as usize].into_iter().find(|v| *v != a && *v != b);
        let (Some(c), Some(d)) = (third(s), third(t)) else { continue };
        let hinge = [a, b, c, d].map(|v| v as usize);
        if hinge.iter().all(|v| row[*v].is_none()) {
            continue;
        }
        let Some(k) = coefficients(hinge.map(|v| &x[v])) else { continue };
        for (p, kp) in hinge.iter().zip(k) {
            let Some(i) = row[*p] else { continue };
            for (q, kq) in hinge.iter().zip(k) {
                match row[*q] {
                    Some(j) if j <= i => entries.push(Entry::new(i, j, kp * kq)),
                    Some(_) => {}
                    None => (0..3).for_each(|axis| right[(i, axis)] -= kp * kq * x[*q][axis]),
                }
            }
        }
    }
    let Ok(factor) = Cholesky::new(free.len(), &entries) else { return mesh.clone() };
    factor.solve_in_place(&mut right);
    let mut moved = x.to_vec();
    for (i, &v) in free.iter().enumerate() {
        let to = Point::new(right[(i, 0)], right[(i, 1)], right[(i, 2)]);
        // No rim is longer: what goes farther, or nowhere, hung on slivers.
        if (to - x[v]).norm() <= 2.0 * WIDTH {
            moved[v] = to;
        }
    }
    embedded::moved(mesh, &edges.neighbours(x.len()), moved)
}

/// The coefficients cₖ of a hinge times the root of its weight: ends of the edge first, then the
/// vertices opposite. `None` where a triangle has no area.
fn coefficients([a, b, c, d]: [&Point; 4]) -> Option<[Real; 4]> {
    let areas = [area_vector(a, b, c).norm(), area_vector(a, b, d).norm()];
    if areas.contains(&0.0) {
        return None;
    }
    // Cotangents of the angles at both ends of the edge.
    let cot =
        |at: &Point, other: &Point, tip: &Point, area: Real| (other - at).dot(&(tip - at)) / area;
    let [at_a, at_b] = [[a, b], [b, a]]
        .map(|[at, other]| [cot(at, other, c, areas[0]), cot(at, other, d, areas[1])]);
    let k = [at_b[0] + at_b[1], at_a[0] + at_a[1], -at_a[0] - at_b[0], -at_a[1] - at_b[1]];
    let largest = k.iter().fold(0.0, |m: Real, k| m.max(k.abs()));
    let weight = (6.0 / (areas[0] + areas[1])).sqrt() * (SLIVER / largest).min(1.0);
    Some(k.map(|k| k * weight))
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes;
    use if_mesh::index::Bvh;
    use if_mesh::intersections::own_pairs;
    use std::f64::consts::FRAC_PI_2;

    /// Steps of a tube's profile, of 4 mm each.
    const STEPS: u32 = 30;

    /// A tube that begins with this radius and leans outwards by `lean`, open at both ends. If it is
    /// `curled`, the last 8 mm of its profile turn in by a right angle.
    fn tube(mut radius: Real, lean: Real, curled: bool) -> TriMesh {
        let (mut y, mut profile) = (0.0, Vec::new());
        for k in 0..=STEPS {
            profile.push((radius, y));
            let turns = if curled { (k + 3).saturating_sub(STEPS) } else { 0 };
            let (sin, cos) = (lean - 0.5 * FRAC_PI_2 * Real::from(turns)).sin_cos();
            (radius, y) = (radius + 0.004 * sin, y - 0.004 * cos);
        }
        profile.reverse();
        meshes::revolved(&profile, 250)
    }

    fn farthest(a: &TriMesh, b: &TriMesh) -> Real {
        a.vertices().iter().zip(b.vertices()).map(|(p, q)| (p - q).norm()).fold(0.0, Real::max)
    }

    #[test]
    fn a_rim_that_curls_in_is_laid_straight() {
        let (curled, straight) = (tube(0.2, 0.0, true), tube(0.2, 0.0, false));
        let found = straightened(&curled);
        assert!(farthest(&curled, &straight) > 5e-3);
        assert!(farthest(&found, &straight) < 1.5e-3, "{}", farthest(&found, &straight));
        let inside = -0.004 * Real::from(STEPS) + 2.0 * WIDTH..-2.0 * WIDTH - 1e-9;
        for (p, q) in found.vertices().iter().zip(curled.vertices()) {
            assert!(p == q || !inside.contains(&q.y), "what is far from hems stays");
        }
    }

    #[test]
    fn what_is_straight_and_what_has_no_hem_stays() {
        let tube = tube(0.2, 0.0, false);
        assert!(farthest(&straightened(&tube), &tube) < 5e-4);
        let ball = meshes::icosphere(0.3, 3);
        assert_eq!(straightened(&ball).vertices(), ball.vertices());
    }

    #[test]
    fn a_scrap_that_is_rim_throughout_stays() {
        // Of a ball of 3 cm, a cap that is 3.3 cm wide.
        let ball = meshes::icosphere(0.03, 4);
        let is_cap = |t: &[u32; 3]| t.iter().all(|v| ball.vertices()[*v as usize].y > 0.025);
        let cap = ball.triangles().iter().copied().filter(is_cap).collect();
        let cap = TriMesh::new(ball.vertices().to_vec(), cap).unwrap();
        assert_eq!(straightened(&cap).vertices(), cap.vertices());
    }

    #[test]
    fn an_embedded_mesh_stays_one() {
        // Laid straight, the hem of the inner tube would end 2 mm outside of the outer one.
        let inner = tube(0.2, 0.3, true);
        let widest = inner.vertices().iter().map(|p| p.x).fold(0.0, Real::max);
        let outer = tube(widest + 1e-3, 0.0, false);
        let n = inner.vertices().len() as u32;
        let vertices = [inner.vertices(), outer.vertices()].concat();
        let more = outer.triangles().iter().map(|t| t.map(|v| v + n));
        let both = inner.triangles().iter().copied().chain(more).collect();
        let both = TriMesh::new(vertices, both).unwrap();
        let found = straightened(&both);
        assert_eq!(own_pairs(&both, &Bvh::new(&both)), []);
        assert_eq!(own_pairs(&found, &Bvh::new(&found)), []);
        let alone = straightened(&inner);
        let reach = alone.vertices().iter().map(|p| p.x.hypot(p.z)).fold(0.0, Real::max);
        assert!(reach > widest + 2e-3, "{reach} {widest}");
    }
}
