//! Boundary loops and their shape.

use super::curve::map_loop;
use super::edit_mesh::EditMesh;
use super::half_edges::{HalfEdges, ends, next, previous};
use if_core::math::{Point, Real, Vector, unit_or_zero};
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
    /// `A (1 − n·a) min(1, 4πA / L²)` with the loop's vector area A a, the mean normal n of a band of
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
    /// the surface's normal along the loop, averaged over a band of triangles, and L the length of the loop
    /// without its ragged edge. Of bands of one and of two rings the more open one counts.
    /// For a hole in a sheet, n·a = 1; at the end of a tube, n·a = 0; at the boundary of a flat
    /// cloth, n·a = −1. The last factor excludes narrow slits such as those between the legs.
    pub(super) fn new(work: &EditMesh, half_edges: &HalfEdges, boundary: &[u32]) -> Self {
        let at = |h: u32| work.points[ends(&work.triangles, h)[0] as usize];
        let points: Vec<Point> = boundary.iter().map(|&h| at(h)).collect();
        let n = points.len();
        let center = points.iter().fold(Vector::zeros(), |s, p| s + p.coords) / n.max(1) as Real;
        let mut span = Vector::zeros();
        for k in 0..n {
            let (p, q) = (points[k], points[(k + 1) % n]);
            span -= (p.coords - center).cross(&(q.coords - center)) / 2.0;
        }
        let (area, length) = (span.norm(), length(&points));
        let openness = if area > 0.0 && length > 0.0 {
            let along = RINGS.map(|rings| {
                let normals = band_normals(work, half_edges, boundary, rings);
                let steps = (0..n).map(|k| (points[(k + 1) % n] - points[k]).norm());
                let sum = normals.zip(steps).map(|(normal, step)| normal * step).sum::<Vector>();
                sum.dot(&span) / (area * length)
            });
            let along = along[0].min(along[1]);
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

/// Rings of triangles along a loop whose normals are compared with the loop's: at the end of a tube one or
/// the other is that of its side. With hems turned in, the first leans towards a lid (the T-shirts and
/// sweaters of `data/body_*`), and with narrow cuffs the second already follows the arm (suit jackets).
/// With three rings both cuffs of a suit jacket would be holes.
const RINGS: [usize; 2] = [1, 2];
/// Rounds of averaging normals along a loop, at most: over about as many edges. A quarter of them leaves
/// twice the tilt that a scan's noise gives them, and four times as many mix the sides of a cuff.
const ROUNDS: usize = 16;

/// Unit normal at each vertex of a loop, of the triangles in so many rings around it and its neighbours on
/// the loop; zero where undefined.
///
/// The triangles of a noisy scan are tilted, each its own way: without the average the mean of their normals
/// is short, and a hole in a sheet looks like the end of a tube.
fn band_normals(
    work: &EditMesh,
    half_edges: &HalfEdges,
    boundary: &[u32],
    rings: usize,
) -> impl Iterator<Item = Vector> {
    let mut triangles = Vec::new();
    let at = |h: &u32| {
        near_triangles(work, half_edges, *h, rings, &mut triangles);
        Point::from(triangles.iter().map(|t| work.area_vector(*t as usize)).sum::<Vector>())
    };
    let mut normals: Vec<Point> = boundary.iter().map(at).collect();
    average(&mut normals, ROUNDS.min(boundary.len() / 6));
    normals.into_iter().map(|n| unit_or_zero(&n.coords))
}

/// The triangles in so many rings around the vertex that half-edge `h` leaves, ascending, into a buffer.
fn near_triangles(
    work: &EditMesh,
    half_edges: &HalfEdges,
    h: u32,
    rings: usize,
    triangles: &mut Vec<u32>,
) {
    triangles.clear();
    let start = |h: u32| ends(&work.triangles, h)[0];
    let mut reached = vec![(start(h), h)]; // vertices, each with a half-edge that leaves it
    let mut last = 0;
    for ring in 1..=rings {
        for k in std::mem::replace(&mut last, reached.len())..reached.len() {
            half_edges.around(reached[k].1, |g| {
                triangles.push(g / 3);
                for other in [next(g), previous(g)].into_iter().filter(|_| ring < rings) {
                    if reached.iter().all(|(v, _)| *v != start(other)) {
                        reached.push((start(other), other));
                    }
                }
            });
        }
    }
    triangles.sort_unstable();
    triangles.dedup();
}

/// Averages each point of a closed line with its neighbours, in rounds.
fn average(points: &mut [Point], rounds: usize) {
    for _ in 0..rounds {
        map_loop(points, |a, b, c| Point::from((a.coords + b.coords * 2.0 + c.coords) / 4.0));
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
    let mut rounds = (points.len() / 6).max(4);
    while points.len() > FINE && rounds > FEW {
        average(&mut points, BEFORE_HALVING);
        points = points.into_iter().step_by(2).collect();
        rounds = (rounds - BEFORE_HALVING).div_ceil(4);
    }
    average(&mut points, rounds);
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
    use if_core::random::SplitMix64;
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
    fn a_hole_in_a_noisy_scan_is_none_the_less_a_hole() {
        // Edges of 3 mm, and noise of 1 mm.
        let tube = tube(0.18, 0.15, 380, 50, false);
        let mut random = SplitMix64::new(1);
        let mut off = || Vector::from([0; 3].map(|_| 0.002 * 3f64.sqrt() * (random.unit() - 0.5)));
        let noisy: Vec<Point> = tube.vertices().iter().map(|p| p + off()).collect();
        let mut triangles = tube.triangles().to_vec();
        let hole = Point::new(0.18, 0.075, 0.0);
        triangles.retain(|t| (tube.vertices()[t[0] as usize] - hole).norm() > 0.05);
        let mesh = TriMesh::new(noisy, triangles).unwrap();
        let mut found: Vec<Real> = shapes(&mesh).iter().map(|l| l.openness).collect();
        found.sort_by(Real::total_cmp);
        let disc = |radius: Real| std::f64::consts::PI * radius * radius;
        assert_eq!(found.len(), 3);
        assert!(found[0] < 0.05 * disc(0.05) && found[1] > 0.7 * disc(0.18), "{found:?}");
    }

    #[test]
    fn the_end_of_a_tube_with_its_hem_turned_in_is_open() {
        let tube = tube(0.1, 0.4, 60, 20, false);
        let turned_in = |p: &Point| match p.y {
            y if y > 0.39 => Point::new(0.8 * p.x, 0.38, 0.8 * p.z),
            _ => *p,
        };
        let mesh = tube.with_vertices(tube.vertices().iter().map(turned_in).collect()).unwrap();
        let found = shapes(&mesh);
        assert!(found.iter().all(|l| l.openness > 10.0 * 1e-3 * mesh.area()), "{found:?}");
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
                average(&mut slowly, 1);
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
