//! Boundary loops and their shape.

use super::curve::map_loop;
use super::edit_mesh::EditMesh;
use super::half_edges::{HalfEdges, ends};
use if_core::math::{Point, Real, Vector};
use serde::Serialize;

/// Size, place and openness of a boundary loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LoopShape {
    /// Number of its edges.
    pub edges: usize,
    /// Its length, in metres.
    pub length: Real,
    /// Its centre, in metres.
    pub center: [Real; 3],
    /// Least and largest coordinates, in metres.
    pub aabb: [[Real; 3]; 2],
    /// How much it looks like an opening, in square metres: 0 for a hole in a flat sheet. It is
    /// `A (1 − n·a) min(1, 4πA / L²)` with the loop's vector area A a, the mean normal n of the
    /// triangles along it, and its length L after smoothing.
    pub openness: Real,
}

impl LoopShape {
    /// Measures a loop.
    ///
    /// ```text
    /// openness = A (1 − n·a) min(1, 4πA / L²),   A a = −½ ∮ x × dx,   n = ∮ N ds / ∮ ds
    /// ```
    ///
    /// in square metres: A is the area that the loop spans and `a` the normal of a lid over it; N is
    /// the surface's normal along the loop, and L the length of the loop without its ragged edge.
    /// For a hole in a sheet, n·a = 1; at the end of a tube, n·a = 0; at the boundary of a flat
    /// cloth, n·a = −1. The last factor excludes narrow slits such as those between the legs.
    pub(super) fn new(work: &EditMesh, half_edges: &HalfEdges, boundary: &[u32]) -> Self {
        let at = |h: u32| work.points[ends(&work.triangles, h)[0] as usize];
        let points: Vec<Point> = boundary.iter().map(|&h| at(h)).collect();
        let n = points.len();
        let center = points.iter().fold(Vector::zeros(), |s, p| s + p.coords) / n.max(1) as Real;
        let (mut span, mut normal, mut length) = (Vector::zeros(), Vector::zeros(), 0.0);
        for k in 0..n {
            let (p, q) = (points[k], points[(k + 1) % n]);
            let step = (q - p).norm();
            span -= (p.coords - center).cross(&(q.coords - center)) / 2.0;
            normal += work.normal_at(half_edges, boundary[k]) * step;
            length += step;
        }
        let area = span.norm();
        let openness = if area > 0.0 && length > 0.0 {
            let along = normal.dot(&span) / (area * length);
            let round = 2.0 * std::f64::consts::TAU * area
                / smoothed_length(points.clone()).powi(2).max(Real::MIN_POSITIVE);
            area * (1.0 - along).max(0.0) * round.min(1.0)
        } else {
            0.0
        };
        let mut aabb = [[Real::INFINITY; 3], [Real::NEG_INFINITY; 3]];
        for p in &points {
            for axis in 0..3 {
                aabb[0][axis] = aabb[0][axis].min(p[axis]);
                aabb[1][axis] = aabb[1][axis].max(p[axis]);
            }
        }
        Self { edges: n, length, center: center.into(), aabb, openness }
    }
}

/// Maximum number of points of a loop that is smoothed at full resolution.
const FINE: usize = 1024;
/// Number of rounds up to which a loop is smoothed at full resolution.
const FEW: usize = 64;
/// Rounds before every other point is dropped.
const BEFORE_HALVING: usize = 8;

/// Length of a loop of n edges after n / 6 rounds of averaging, which remove teeth of up to about √n
/// edges.
///
/// The width of the average grows with the root of the rounds. So once a loop is smooth, every other
/// point suffices for a quarter of the rounds: the time is linear in the points, and the length
/// changes by less than a thousandth.
fn smoothed_length(mut points: Vec<Point>) -> Real {
    let smooth = |points: &mut [Point], rounds: usize| {
        for _ in 0..rounds {
            map_loop(points, |a, b, c| Point::from((a.coords + b.coords * 2.0 + c.coords) / 4.0));
        }
    };
    let mut rounds = (points.len() / 6).max(4);
    while points.len() > FINE && rounds > FEW {
        smooth(&mut points, BEFORE_HALVING);
        points = points.into_iter().step_by(2).collect();
        rounds = (rounds - BEFORE_HALVING).div_ceil(4);
    }
    smooth(&mut points, rounds);
    length(&points)
}

/// Length of the closed line through `points`, in metres.
pub(super) fn length(points: &[Point]) -> Real {
    (0..points.len()).map(|k| (points[(k + 1) % points.len()] - points[k]).norm()).sum()
}

#[cfg(test)]
mod tests {
    use super::super::half_edges::boundary_loops;
    use super::*;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::{cloth, tube};

    fn shapes(mesh: &TriMesh) -> Vec<LoopShape> {
        let (work, half_edges) = (EditMesh::new(mesh), HalfEdges::of_mesh(mesh));
        boundary_loops(mesh.triangles(), &half_edges)
            .iter()
            .map(|l| LoopShape::new(&work, &half_edges, l))
            .collect()
    }

    #[test]
    fn ends_of_tubes_are_open_and_holes_in_them_are_not() {
        let mut triangles = tube(0.1, 0.4, 60, 20, false).triangles().to_vec();
        let tube = tube(0.1, 0.4, 60, 20, false);
        triangles.retain(|t| {
            let c = t.iter().fold(Vector::zeros(), |s, v| s + tube.vertices()[*v as usize].coords)
                / 3.0;
            (c - Vector::new(0.1, 0.2, 0.0)).norm() > 0.035
        });
        let mut found = shapes(&TriMesh::new(tube.vertices().to_vec(), triangles).unwrap());
        found.sort_by(|a, b| b.openness.total_cmp(&a.openness));
        assert_eq!(found.len(), 3);
        let disc = std::f64::consts::PI * 0.1f64.powi(2);
        for end in &found[..2] {
            approx::assert_relative_eq!(end.openness, disc, max_relative = 0.02);
            approx::assert_relative_eq!(
                end.length,
                std::f64::consts::TAU * 0.1,
                max_relative = 0.01
            );
        }
        assert!(found[2].openness < 0.01 * disc, "{}", found[2].openness);
    }

    #[test]
    fn coarsening_long_loops_does_not_change_their_smoothed_length() {
        for n in [1025, 4000, 20_001] {
            // A bent and wavy circle with a ragged edge.
            let at = |k: usize| {
                let angle = std::f64::consts::TAU * k as Real / n as Real;
                let ragged =
                    if k.is_multiple_of(3) { 1.01 } else { 1.0 } + 0.05 * (20.0 * angle).sin();
                Point::new(ragged * angle.cos(), 0.3 * (2.0 * angle).sin(), ragged * angle.sin())
            };
            let points: Vec<Point> = (0..n).map(at).collect();
            let mut slowly = points.clone();
            for _ in 0..n / 6 {
                map_loop(&mut slowly, |a, b, c| {
                    Point::from((a.coords + b.coords * 2.0 + c.coords) / 4.0)
                });
            }
            assert!(length(&points) > 1.2 * length(&slowly), "{n}");
            approx::assert_relative_eq!(
                smoothed_length(points),
                length(&slowly),
                max_relative = 2e-3
            );
        }
    }

    #[test]
    fn the_boundary_of_a_cloth_is_an_opening() {
        let found = shapes(&cloth(0.3, 0.3, 6, 6));
        assert_eq!(found.len(), 1);
        assert!(found[0].openness > 0.1, "{}", found[0].openness);
    }
}
