//! Repair after a step: unseen regions, and folds.

use super::evidence::Evidence;
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;

// "Mean" below is the mean distance to and from the truth (2.0 to 2.4 mm) of the surfaces fitted to
// the two sample captures of `docs/evidence/reconstruction.md`, all else being equal; "pairs" the
// number of their self-intersecting pairs (500 to 700).

/// Weight of observed normals at which a triangle counts as known: three pixels seen head-on. Half
/// and twice as much change the mean by less than 0.02 mm.
const KNOWN: Real = 3.0;
/// Weight of the silhouettes at which the position of a vertex counts as known although its
/// triangles are not: half that of one frame that sees it in profile. Half and twice as much change
/// the mean by less than 0.03 mm.
const ON_RIM: Real = 0.5;
/// Passes over unseen regions, and over folds. Without any there are 1,700 pairs; with 5, 10, 20 on
/// the first capture 815, 713, 663, and the mean distance to the truth is 2.15, 2.04, 1.95 mm, that
/// from it 2.17, 2.22, 2.26 mm: more passes only trade one for the other.
const PASSES: usize = 10;
/// Relaxation factor of a pass. A quarter and 1 act like half and twice as many passes.
const SHARE: Real = 0.5;
/// Cosine between the normal of a triangle and the expected one below which it is folded. At 0.2 and
/// 0.8 there are 781 and 408 pairs on the first capture, 645 and 429 on the second, and the mean
/// distance to the truth improves by up to 0.1 mm, that from it worsens by 0.03 mm.
const FOLDED: Real = 0.4;
/// Twice the area over the square of the longest edge, below which a triangle is a sliver: 1/10 is
/// an angle of 6°. Half and twice as much change the mean by less than 0.04 mm, and pairs by a sixth.
const SLIVER: Real = 0.1;

/// Repairs the surface `x`, whose triangles and evidence are those of `rest`, the template.
///
/// ```text
/// unseen and concave      towards the mean of its neighbours: clothes span the folds of the body
/// unseen and not concave  towards the position that the neighbours' displacement from the template predicts
/// folded, or a sliver     towards the mean of its neighbours
/// ```
pub(super) fn repair(
    rest: &TriMesh,
    mut x: Vec<Point>,
    neighbours: &Rows<u32>,
    evidence: &Evidence,
) -> Vec<Point> {
    let doubt = doubt(rest, evidence);
    let normals = normals(rest.triangles(), &x);
    for _ in 0..PASSES {
        x = (0..x.len())
            .map(|v| {
                if doubt[v] == 0.0 || neighbours.of(v).is_empty() {
                    return x[v];
                }
                let way = to_mean(&x, neighbours, v);
                let way = if way.dot(&normals[v]) > 0.0 {
                    way
                } else {
                    way - to_mean(rest.vertices(), neighbours, v)
                };
                x[v] + way * (SHARE * doubt[v])
            })
            .collect();
    }
    let expected: Vec<Vector> = evidence.normals.iter().map(|(sum, _)| unit_or_zero(sum)).collect();
    for _ in 0..PASSES {
        let folded = folded(rest.triangles(), &x, neighbours, &expected);
        if !folded.contains(&true) {
            break;
        }
        let next =
            |v: usize| if folded[v] { x[v] + to_mean(&x, neighbours, v) * SHARE } else { x[v] };
        x = (0..x.len()).map(next).collect();
    }
    x
}

/// Uncertainty of each vertex: 0 if all of its triangles were seen, or if it was on silhouettes;
/// squared, so that only poorly seen vertices move.
fn doubt(mesh: &TriMesh, evidence: &Evidence) -> Vec<Real> {
    let mut sums = vec![(0.0, 0.0); mesh.vertices().len()];
    for (tri, (_, weight)) in mesh.triangles().iter().zip(&evidence.normals) {
        for v in tri {
            let sum: &mut (Real, Real) = &mut sums[*v as usize];
            *sum = (sum.0 + (weight / KNOWN).min(1.0), sum.1 + 1.0);
        }
    }
    let doubt = |((seen, all), rim): (&(Real, Real), &(Real, Real))| {
        if *all == 0.0 || rim.1 > ON_RIM { 0.0 } else { (1.0 - seen / all).powi(2) }
    };
    sums.iter().zip(&evidence.rim).map(doubt).collect()
}

/// The offset of a vertex from the mean of its neighbours.
pub(super) fn to_mean(x: &[Point], neighbours: &Rows<u32>, v: usize) -> Vector {
    let sum = neighbours.of(v).iter().fold(Vector::zeros(), |sum, u| sum + x[*u as usize].coords);
    sum / neighbours.of(v).len().max(1) as Real - x[v].coords
}

/// Area-weighted unit normals of the vertices.
pub(super) fn normals(triangles: &[[u32; 3]], x: &[Point]) -> Vec<Vector> {
    let mut sums = vec![Vector::zeros(); x.len()];
    for tri in triangles {
        let [a, b, c] = tri.map(|v| &x[v as usize]);
        let n = area_vector(a, b, c);
        tri.iter().for_each(|v| sums[*v as usize] += n);
    }
    sums.iter().map(unit_or_zero).collect()
}

/// The corners of triangles that are slivers, or face away from the observed normal (or, unseen, from
/// their surroundings).
fn folded(
    triangles: &[[u32; 3]],
    x: &[Point],
    neighbours: &Rows<u32>,
    expected: &[Vector],
) -> Vec<bool> {
    let mut smooth = normals(triangles, x);
    for _ in 0..2 {
        smooth = (0..x.len())
            .map(|v| {
                let sum = neighbours
                    .of(v)
                    .iter()
                    .fold(Vector::zeros(), |sum, u| sum + smooth[*u as usize]);
                unit_or_zero(&(smooth[v] + sum / neighbours.of(v).len().max(1) as Real))
            })
            .collect();
    }
    let mut marked = vec![false; x.len()];
    for (tri, seen) in triangles.iter().zip(expected) {
        let corners = tri.map(|v| &x[v as usize]);
        let area = area_vector(corners[0], corners[1], corners[2]);
        let longest =
            (0..3).map(|k| (corners[k] - corners[(k + 1) % 3]).norm_squared()).fold(0.0, Real::max);
        let should = if *seen == Vector::zeros() {
            unit_or_zero(&tri.iter().fold(Vector::zeros(), |sum, v| sum + smooth[*v as usize]))
        } else {
            *seen
        };
        if area.norm() < SLIVER * longest || unit_or_zero(&area).dot(&should) < FOLDED {
            tri.iter().for_each(|v| marked[*v as usize] = true);
        }
    }
    marked
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::report::Pixels;
    use if_core::edges::Edges;
    use if_core::shapes::meshes;

    fn neighbours(mesh: &TriMesh) -> Rows<u32> {
        Edges::new(mesh).neighbours(mesh.vertices().len())
    }

    fn seen(mesh: &TriMesh, weight: Real) -> Evidence {
        Evidence {
            normals: mesh.face_normals().iter().map(|n| (n * weight, weight)).collect(),
            rim: vec![(0.0, 0.0); mesh.vertices().len()],
            pixels: Pixels::default(),
            overlap: Vec::new(),
            axes: Default::default(),
        }
    }

    #[test]
    fn a_seen_surface_without_folds_stays() {
        let ball = meshes::icosphere(0.2, 3);
        let x = repair(&ball, ball.vertices().to_vec(), &neighbours(&ball), &seen(&ball, 9.0));
        assert_eq!(x, ball.vertices());
    }

    #[test]
    fn an_unseen_bump_keeps_its_shape_and_an_unseen_dent_is_filled() {
        let ball = meshes::icosphere(0.2, 3);
        let nothing = seen(&ball, 0.0);
        // All of a ball is convex: what was carried along with its displacement stays.
        let moved: Vec<Point> =
            ball.vertices().iter().map(|p| p + Vector::new(0.0, 0.01, 0.0)).collect();
        let x = repair(&ball, moved.clone(), &neighbours(&ball), &nothing);
        for (p, q) in x.iter().zip(&moved) {
            approx::assert_relative_eq!(p, q, epsilon = 1e-12);
        }
        let mut dented = ball.vertices().to_vec();
        dented[40] *= 0.9;
        let x = repair(&ball, dented, &neighbours(&ball), &nothing);
        assert!(x[40].coords.norm() > 0.19, "{}", x[40].coords.norm());
    }

    #[test]
    fn a_folded_vertex_is_unfolded() {
        let sheet = meshes::cloth(1.0, 1.0, 8, 8);
        let evidence = seen(&sheet, 9.0);
        let mut x = sheet.vertices().to_vec();
        let middle = 4 * 9 + 4;
        x[middle].x += 0.2; // beyond its neighbour, 0.125 away
        x[middle].y += 0.02;
        let around = neighbours(&sheet);
        let expected = sheet.face_normals();
        assert!(folded(sheet.triangles(), &x, &around, &expected).contains(&true));
        let x = repair(&sheet, x, &around, &evidence);
        assert!(!folded(sheet.triangles(), &x, &around, &expected).contains(&true));
    }
}
