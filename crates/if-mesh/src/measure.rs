//! Measures: displacement, strain, distance between surfaces, shape of triangles.
//!
//! Displacements are in metres and strains are fractions; distances of surfaces are in millimetres.

use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::math::{Point, Real, area_vector, barycentric_point};
use if_core::mesh::TriMesh;
use if_core::random::SplitMix64;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How far vertices moved, in metres.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Displacement {
    /// Mean over all vertices.
    pub mean: Real,
    /// 95 % of the vertices moved at most this far.
    pub p95: Real,
    /// Largest displacement.
    pub max: Real,
    /// Vertices that moved at all.
    pub vertices: usize,
}

/// How much edges changed their length, as the fraction `|ℓ′ / ℓ − 1|` (0.01 is one percent).
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Strain {
    /// Root of the mean square over all edges.
    pub rms: Real,
    /// 99 % of the edges changed at most this much.
    pub p99: Real,
    /// Largest strain.
    pub max: Real,
}

/// Distances between two surfaces, at points spread evenly over both.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct SurfaceDistance {
    /// Points on each of the two surfaces; 0 if one has no area, and nothing was measured.
    pub samples: usize,
    /// Mean distance of the first surface's points from the second.
    pub mean_first_to_second_mm: Real,
    /// Mean distance of the second surface's points from the first.
    pub mean_second_to_first_mm: Real,
    /// The mean of the two means.
    pub chamfer_mm: Real,
    /// The farthest point of the first surface from the second.
    pub max_first_to_second_mm: Real,
    /// The farthest point of the second surface from the first.
    pub max_second_to_first_mm: Real,
    /// The larger of the two maxima: a lower bound of the Hausdorff distance, which it approaches
    /// as the samples get denser.
    pub hausdorff_mm: Real,
}

const MM: Real = 1e3;
const PERCENT: Real = 100.0;

/// How far the vertices moved from `before` to `after`. All zero without vertices.
///
/// # Source
///
/// As `cost` of the project's referee (`numpy.percentile`, linear between ranks).
///
/// # Panics
///
/// If the lengths differ.
pub fn displacement(before: &[Point], after: &[Point]) -> Displacement {
    assert_eq!(before.len(), after.len(), "one new position for each old one");
    let mut moved: Vec<Real> = before.iter().zip(after).map(|(a, b)| (b - a).norm()).collect();
    let vertices = before.iter().zip(after).filter(|(a, b)| a != b).count();
    let mean = mean(&moved);
    moved.sort_unstable_by(Real::total_cmp);
    Displacement { mean, p95: percentile(&moved, 95.0), max: percentile(&moved, 100.0), vertices }
}

/// Edges shorter than this, in metres, count as this long, so that the strain of a degenerate edge
/// is finite. The referee's value: ten times more or less changes no garment, whose shortest edges
/// are above 1e-5 m.
const SHORTEST_EDGE: Real = 1e-12;

/// How much the edges of `before` changed their length when its vertices moved to `after`. All zero
/// without edges.
///
/// # Source
///
/// As `cost` of the project's referee, in which edges that keep a length of zero are strained by
/// 100 %.
///
/// # Panics
///
/// If the number of positions is not that of the vertices.
pub fn strain(before: &TriMesh, after: &[Point]) -> Strain {
    strain_of(&Edges::new(before).vertices, before.vertices(), after)
}

/// Change of an edge's length as a share of the length before; 0 if both are zero.
pub fn edge_strain(before: Real, after: Real) -> Real {
    if before.max(after) < SHORTEST_EDGE {
        0.0
    } else {
        (after / before.max(SHORTEST_EDGE) - 1.0).abs()
    }
}

/// [`strain`] of the given edges.
///
/// # Panics
///
/// If the lengths differ, or an edge has an index out of range.
pub fn strain_of(edges: &[[u32; 2]], before: &[Point], after: &[Point]) -> Strain {
    assert_eq!(before.len(), after.len(), "one new position for each old one");
    let length = |p: &[Point], e: &[u32; 2]| (p[e[0] as usize] - p[e[1] as usize]).norm();
    let change = |e| edge_strain(length(before, e), length(after, e));
    let mut strains: Vec<Real> = edges.iter().map(change).collect();
    let squares: Vec<Real> = strains.iter().map(|s| s * s).collect();
    // Only the largest tenth is asked for, and sorted.
    let tenth = strains.len().saturating_sub(1) * 9 / 10;
    if !strains.is_empty() {
        strains.select_nth_unstable_by(tenth, Real::total_cmp);
        strains[tenth..].sort_unstable_by(Real::total_cmp);
    }
    Strain {
        rms: mean(&squares).sqrt(),
        p99: percentile(&strains, 99.0),
        max: percentile(&strains, 100.0),
    }
}

/// Two-sided distance of two surfaces by `samples` points on each, uniform by area and stratified:
/// point k lies in the k-th of `samples` parts of equal area, in the order of the triangles.
///
/// The same meshes and the same `seed` give the same bits on any number of threads.
pub fn surface_distance(
    (first, first_index): (&TriMesh, &impl ClosestPoint),
    (second, second_index): (&TriMesh, &impl ClosestPoint),
    samples: usize,
    seed: u64,
) -> SurfaceDistance {
    let there = distances(&surface_samples(first, samples, seed), second_index);
    let back = distances(&surface_samples(second, samples, seed ^ OTHER_SIDE), first_index);
    if there.is_empty() || back.is_empty() {
        return SurfaceDistance::default();
    }
    let most = |d: &[Real]| d.iter().copied().fold(0.0, Real::max) * MM;
    let (mean_there, mean_back) = (mean(&there) * MM, mean(&back) * MM);
    let (max_there, max_back) = (most(&there), most(&back));
    SurfaceDistance {
        samples,
        mean_first_to_second_mm: mean_there,
        mean_second_to_first_mm: mean_back,
        chamfer_mm: 0.5 * (mean_there + mean_back),
        max_first_to_second_mm: max_there,
        max_second_to_first_mm: max_back,
        hausdorff_mm: max_there.max(max_back),
    }
}

/// Makes the samples of two equal meshes differ.
const OTHER_SIDE: u64 = 0x5bd1_e995_9d5c_0a67;

fn distances(points: &[Point], surface: &impl ClosestPoint) -> Vec<Real> {
    // Only a surface without triangles returns `None`, for all points.
    points
        .par_iter()
        .filter_map(|p| surface.closest(p, Real::INFINITY))
        .map(|c| c.distance)
        .collect()
}

/// Points on the surface of `mesh`, uniform by area and stratified; empty if it has no area.
pub fn surface_samples(mesh: &TriMesh, samples: usize, seed: u64) -> Vec<Point> {
    let mut sum = 0.0;
    let mut until = Vec::with_capacity(mesh.triangles().len()); // area up to and with each triangle
    for t in 0..mesh.triangles().len() {
        let [a, b, c] = mesh.corners(t);
        sum += area_vector(a, b, c).norm();
        until.push(sum);
    }
    if !(sum > 0.0 && sum.is_finite()) {
        return Vec::new();
    }
    let sample = |k: usize| {
        let mut random = SplitMix64::new(seed.wrapping_add(k as u64));
        let place = (k as Real + random.unit()) / samples as Real * sum;
        let t = until.partition_point(|s| *s <= place).min(until.len() - 1);
        // Uniform in the parallelogram, folded into the triangle.
        let (mut u, mut v) = (random.unit(), random.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        barycentric_point(mesh.corners(t), [1.0 - u - v, u, v])
    };
    (0..samples).map(sample).collect()
}

/// The smallest angle of each triangle, in degrees; 0 for one without area.
pub fn smallest_angles(mesh: &TriMesh) -> Vec<Real> {
    let smallest = |[a, b, c]: [&Point; 3]| {
        let sides = [b - c, c - a, a - b];
        let cross = area_vector(a, b, c).norm();
        if cross == 0.0 {
            return 0.0;
        }
        let angle = |k: usize| cross.atan2(-sides[(k + 1) % 3].dot(&sides[(k + 2) % 3]));
        (0..3).map(angle).fold(Real::INFINITY, Real::min).to_degrees()
    };
    (0..mesh.triangles().len()).map(|t| smallest(mesh.corners(t))).collect()
}

fn mean(values: &[Real]) -> Real {
    if values.is_empty() { 0.0 } else { values.iter().sum::<Real>() / values.len() as Real }
}

/// The value below which `percent` of the `sorted` values lie, linear between ranks; 0 without
/// values.
///
/// # Source
///
/// `numpy.percentile`, method `linear`, with its rounding.
pub fn percentile(sorted: &[Real], percent: Real) -> Real {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let rank = (percent / PERCENT).clamp(0.0, 1.0) * last as Real;
    let (low, t) = (rank.floor() as usize, rank.fract());
    let (a, b) = (sorted[low], sorted[(low + 1).min(last)]);
    if t < 0.5 { a + (b - a) * t } else { b - (b - a) * (1.0 - t) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::closest::{Closest, closest_on_triangle};
    use if_core::math::Vector;

    /// All triangles, one after the other.
    struct Slow<'a>(&'a TriMesh);

    impl ClosestPoint for Slow<'_> {
        fn closest(&self, p: &Point, max_distance: Real) -> Option<Closest> {
            let on = |t: usize| {
                let corners = self.0.corners(t);
                let (barycentric, feature) =
                    closest_on_triangle(p, corners[0], corners[1], corners[2]);
                let point = barycentric_point(corners, barycentric);
                Closest {
                    point,
                    distance: (point - p).norm(),
                    triangle: t as u32,
                    barycentric,
                    feature,
                }
            };
            let all = (0..self.0.triangles().len()).map(on).filter(|c| c.distance <= max_distance);
            all.min_by(|a, b| a.distance.total_cmp(&b.distance))
        }
    }

    fn square(side: Real, z: Real) -> TriMesh {
        let v = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]
            .map(|(x, y)| Point::new(x, y, z))
            .to_vec();
        TriMesh::new(v, vec![[0, 1, 2], [0, 2, 3]]).unwrap()
    }

    #[test]
    fn percentiles_are_those_of_numpy() {
        // numpy.percentile([1, 2, 4, 8], q) for q = 0, 25, 50, 95, 99, 100
        let expected =
            [(0.0, 1.0), (25.0, 1.75), (50.0, 3.0), (95.0, 7.4), (99.0, 7.88), (100.0, 8.0)];
        for (q, value) in expected {
            approx::assert_relative_eq!(
                percentile(&[1.0, 2.0, 4.0, 8.0], q),
                value,
                max_relative = 1e-15
            );
        }
        assert_eq!(percentile(&[], 95.0), 0.0);
        assert_eq!(percentile(&[7.0], 99.0), 7.0);
    }

    #[test]
    fn a_shift_displaces_and_strains_nothing_and_a_stretch_strains_edges() {
        let mesh = square(1.0, 0.0);
        let shifted: Vec<Point> =
            mesh.vertices().iter().map(|p| p + Vector::new(0.003, 0.004, 0.0)).collect();
        let d = displacement(mesh.vertices(), &shifted);
        for moved in [d.mean, d.p95, d.max] {
            approx::assert_relative_eq!(moved, 5e-3, max_relative = 1e-12);
        }
        assert!(strain(&mesh, &shifted).max < 1e-14);
        // Doubled in x: of five edges two double, two stay, and the diagonal grows by √(5/2).
        let wide: Vec<Point> =
            mesh.vertices().iter().map(|p| Point::new(2.0 * p.x, p.y, p.z)).collect();
        let s = strain(&mesh, &wide);
        let diagonal = 2.5f64.sqrt() - 1.0;
        approx::assert_relative_eq!(s.max, 1.0);
        approx::assert_relative_eq!(
            s.rms,
            ((2.0 + diagonal * diagonal) / 5.0).sqrt(),
            max_relative = 1e-14
        );
    }

    #[test]
    fn an_edge_of_length_zero_is_not_strained_until_it_grows() {
        let strain = |before: Real, after: Real| {
            strain_of(
                &[[0, 1]],
                &[Point::origin(), Point::new(before, 0.0, 0.0)],
                &[Point::new(0.0, 3.0, 0.0), Point::new(after, 3.0, 0.0)],
            )
        };
        assert_eq!(strain(0.0, 0.0).max, 0.0);
        assert!(strain(0.0, 1e-3).max > 1e7);
        assert_eq!(strain(1e-3, 0.0).max, 1.0);
    }

    #[test]
    fn distances_of_parallel_squares_are_exact() {
        let (a, b) = (square(1.0, 0.0), square(1.0, 0.025));
        let d = surface_distance((&a, &Slow(&a)), (&b, &Slow(&b)), 500, 7);
        for mm in
            [d.chamfer_mm, d.hausdorff_mm, d.mean_first_to_second_mm, d.max_second_to_first_mm]
        {
            approx::assert_relative_eq!(mm, 25.0, max_relative = 1e-12);
        }
        // A square of twice the side reaches √2 beyond the corner, and only one direction sees it.
        let c = square(2.0, 0.0);
        let d = surface_distance((&a, &Slow(&a)), (&c, &Slow(&c)), 4000, 7);
        assert!(d.max_first_to_second_mm < 1e-9);
        assert!(d.hausdorff_mm > 1300.0 && d.hausdorff_mm <= 2f64.sqrt() * 1000.0, "{d:?}");
    }

    #[test]
    fn samples_are_uniform_by_area_and_the_same_again() {
        // Two triangles, one of nine times the area.
        let v = vec![Point::origin(), Point::new(3.0, 0.0, 0.0), Point::new(0.0, 3.0, 0.0)];
        let w = [Point::new(9.0, 0.0, 0.0), Point::new(10.0, 0.0, 0.0), Point::new(9.0, 1.0, 0.0)];
        let mesh = TriMesh::new([v, w.to_vec()].concat(), vec![[0, 1, 2], [3, 4, 5]]).unwrap();
        let samples = surface_samples(&mesh, 1000, 3);
        assert_eq!(samples.iter().filter(|p| p.x < 5.0).count(), 900);
        let center: Vector = samples[..900].iter().map(|p| p.coords).sum::<Vector>() / 900.0;
        // The centroid is (1, 1, 0); the standard error of a mean of 900 points is 0.024.
        assert!((center - Vector::new(1.0, 1.0, 0.0)).norm() < 0.1, "{center}");
        assert_eq!(samples, surface_samples(&mesh, 1000, 3));
        assert_ne!(samples, surface_samples(&mesh, 1000, 4));
    }

    #[test]
    fn smallest_angles_are_those_of_known_triangles() {
        let triangle = |p: [[Real; 2]; 3]| {
            TriMesh::new(
                p.map(|p| Point::new(p[0], p[1], 7.0)).to_vec(),
                vec![[0, 1, 2], [2, 0, 1]],
            )
            .unwrap()
        };
        let cases = [
            ([[0.0, 0.0], [1.0, 0.0], [0.5, 0.75f64.sqrt()]], 60.0),
            ([[0.0, 0.0], [1.0, 0.0], [0.0, 3f64.sqrt()]], 30.0),
            ([[0.0, 0.0], [1.0, 0.0], [-1.0, 1e-3]], 5e-4f64.atan2(1.0).to_degrees()),
            ([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]], 0.0),
            ([[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]], 0.0),
        ];
        for (p, expected) in cases {
            for angle in smallest_angles(&triangle(p)) {
                approx::assert_relative_eq!(angle, expected, epsilon = 1e-9, max_relative = 1e-3);
            }
        }
    }

    #[test]
    fn nothing_gives_zeros() {
        let (empty, a) = (TriMesh::default(), square(1.0, 0.0));
        let point = TriMesh::new(vec![Point::origin(); 3], vec![[0, 1, 2]]).unwrap();
        assert_eq!(displacement(&[], &[]), Displacement::default());
        assert_eq!(strain(&empty, &[]), Strain::default());
        assert_eq!(strain(&point, point.vertices()), Strain::default());
        for other in [&empty, &point] {
            let d = surface_distance((other, &Slow(other)), (&a, &Slow(&a)), 10, 0);
            assert_eq!(d, SurfaceDistance::default());
        }
        assert_eq!(surface_distance((&a, &Slow(&a)), (&a, &Slow(&a)), 0, 0).samples, 0);
    }
}
