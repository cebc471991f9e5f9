//! Relaxation: better triangles on the same surface.

use crate::marching::newton::newton_step;
use if_core::aabb::Aabb;
use if_core::edges::{Edges, VertexTriangles};
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::convert::Infallible;

/// Parameters of [`relax`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RelaxParams {
    /// Rounds of steps along the surface and back onto it.
    pub rounds: usize,
    /// Part of the way to the middle of the neighbours, from 0 to 1.
    pub step: Real,
}

impl Default for RelaxParams {
    /// Three rounds, after which no triangle of a marched sphere has an angle below 10°.
    fn default() -> Self {
        Self { rounds: 3, step: 0.7 }
    }
}

impl RelaxParams {
    /// Checks the range of the step.
    ///
    /// # Errors
    ///
    /// A step out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let ok = (0.0..=1.0).contains(&self.step);
        ParameterError::check("step", self.step, ok, "from 0 to 1")
    }
}

/// Moves vertices along the surface towards the middle of their neighbours and then, by one Newton
/// step, onto `φ = 0`: slivers become well-shaped triangles.
///
/// Vertices of a border slide along it, and stay at its corners. No triangle turns away from the
/// normals of its vertices: where one would, its corners stay for this round.
///
/// A shell thinner than its edges is extracted with holes, and a few vertices at their rims may
/// change to the other sheet: one in 16,000 with the default step, up to three in 10,000 with a step
/// of 1, on shells of a quarter to 0.9 of a cell. Triangles of two sheets may then intersect;
/// [`extract`](crate::extract::extract) moves their vertices back, and its report
/// warns of near and of unresolved sheets.
///
/// # Errors
///
/// A step out of range.
pub fn relax<F: SignedDistance + ?Sized>(
    mesh: &TriMesh,
    field: &F,
    params: &RelaxParams,
) -> Result<TriMesh, ParameterError> {
    params.validate()?;
    let Ok(mesh) = relax_within(mesh, &field, params, None, |_| Ok::<_, Infallible>(()));
    Ok(mesh)
}

/// The same, for a step from 0 to 1. A vertex that would leave `region` stays for that round, as
/// next to jumps of a field Newton steps may end anywhere. `evaluated` is told of the evaluations of each
/// round, and may end it.
pub(crate) fn relax_within<E>(
    mesh: &TriMesh,
    field: &dyn SignedDistance,
    params: &RelaxParams,
    region: Option<&Aabb>,
    mut evaluated: impl FnMut(usize) -> Result<(), E>,
) -> Result<TriMesh, E> {
    let edges = Edges::new(mesh);
    let fans = VertexTriangles::new(mesh);
    let borders = border_neighbours(mesh, &edges);
    let mut mesh = mesh.clone();
    let mut samples =
        vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; mesh.vertices().len()];
    for _ in 0..params.rounds {
        let normals = mesh.vertex_normals();
        let mut moved: Vec<Point> = (0..mesh.vertices().len())
            .into_par_iter()
            .map(|v| {
                let along = match borders[v] {
                    Border::Inside => to_middle(&mesh, &fans, v, &normals[v]),
                    Border::Between(a, b) => along_border(&mesh, v, a, b),
                    Border::Fixed => Vector::zeros(),
                };
                mesh.vertices()[v] + along * params.step
            })
            .collect();
        field.samples(&moved, &mut samples);
        evaluated(moved.len())?;
        moved.par_iter_mut().enumerate().for_each(|(v, p)| {
            if !matches!(borders[v], Border::Fixed) {
                *p -= newton_step(&samples[v], 0.5 * longest_edge(&mesh, &fans, v));
            }
            if region.is_some_and(|r| !r.contains(p)) {
                *p = mesh.vertices()[v];
            }
        });
        keep_orientation(&mesh, &normals, &mut moved);
        mesh = mesh
            .with_vertices(moved)
            .expect("steps are bounded by the lengths of edges, which are finite");
    }
    Ok(mesh)
}

/// Position of a vertex relative to the borders.
#[derive(Clone, Copy, PartialEq)]
enum Border {
    Inside,
    /// On a border, between these two vertices.
    Between(u32, u32),
    /// At a corner of a border, or where borders meet.
    Fixed,
}

/// Cosine of the angle by which a border must turn to have a corner. Hems of 20 edges turn by 18° at
/// a vertex.
const CORNER: Real = 0.7;

fn border_neighbours(mesh: &TriMesh, edges: &Edges) -> Vec<Border> {
    let mut out = vec![Border::Inside; mesh.vertices().len()];
    let mut ends: Vec<(u32, u32)> = Vec::new();
    for (e, &[a, b]) in edges.vertices.iter().enumerate() {
        match edges.valence[e] {
            1 => ends.extend([(a, b), (b, a)]),
            2 => {}
            _ => [a, b].iter().for_each(|v| out[*v as usize] = Border::Fixed),
        }
    }
    ends.sort_unstable();
    for run in ends.chunk_by(|a, b| a.0 == b.0) {
        let v = run[0].0 as usize;
        let p = mesh.vertices()[v];
        out[v] = match (out[v], run) {
            (Border::Inside, [(_, a), (_, b)]) => {
                let towards = |w: u32| unit_or_zero(&(mesh.vertices()[w as usize] - p));
                if -towards(*a).dot(&towards(*b)) > CORNER {
                    Border::Between(*a, *b)
                } else {
                    Border::Fixed
                }
            }
            _ => Border::Fixed,
        };
    }
    out
}

/// Vector from a vertex to the area-weighted middle of its fan, projected to the tangent plane.
fn to_middle(mesh: &TriMesh, fans: &VertexTriangles, v: usize, normal: &Vector) -> Vector {
    let p = mesh.vertices()[v];
    let (mut sum, mut weight) = (Vector::zeros(), 0.0);
    for t in fans.of(v) {
        let [a, b, c] = mesh.corners(*t as usize);
        let area = area_vector(a, b, c).norm();
        sum += ((a - p) + (b - p) + (c - p)) * (area / 3.0);
        weight += area;
    }
    if weight > 0.0 {
        let d = sum / weight;
        d - normal * normal.dot(&d)
    } else {
        Vector::zeros()
    }
}

fn along_border(mesh: &TriMesh, v: usize, a: u32, b: u32) -> Vector {
    let [a, b] = [a, b].map(|w| mesh.vertices()[w as usize] - mesh.vertices()[v]);
    let tangent = unit_or_zero(&(b - a));
    tangent * (0.5 * tangent.dot(&(a + b)))
}

/// Length of the longest edge at a vertex, in metres.
fn longest_edge(mesh: &TriMesh, fans: &VertexTriangles, v: usize) -> Real {
    let p = mesh.vertices()[v];
    fans.of(v)
        .iter()
        .flat_map(|t| mesh.corners(*t as usize))
        .fold(0.0, |r, q| r.max((q - p).norm()))
}

/// Moves back the corners of triangles that turned away from the normals of their vertices, until
/// all such triangles are as before. Terminates, as a vertex is moved back only once.
fn keep_orientation(mesh: &TriMesh, normals: &[Vector], moved: &mut [Point]) {
    /// Minimum cosine between a triangle's normal and the sum of its vertices' normals. Well-shaped
    /// triangles have 0.9 and more also where the surface is strongly curved; below zero they are
    /// flipped.
    const LEAST: Real = 0.5;
    loop {
        let bad: Vec<u32> = (0..mesh.triangles().len())
            .into_par_iter()
            .filter_map(|t| {
                let tri = mesh.triangles()[t].map(|v| v as usize);
                let axis = unit_or_zero(&tri.iter().map(|v| normals[*v]).sum());
                let cosine =
                    |p: [&Point; 3]| unit_or_zero(&area_vector(p[0], p[1], p[2])).dot(&axis);
                let after = cosine(tri.map(|v| &moved[v]));
                (after < LEAST && after < cosine(mesh.corners(t))).then_some(t as u32)
            })
            .collect();
        if bad.is_empty() {
            return;
        }
        for t in bad {
            for v in mesh.triangles()[t as usize] {
                moved[v as usize] = mesh.vertices()[v as usize];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extract::{ExtractParams, Resolution, extract, layer_phase};
    use crate::marching::clip;
    use crate::measure::smallest_angles;
    use if_core::monitor::Silent;
    use if_core::shapes::{Sphere, meshes};

    /// Smallest angle of any triangle, in degrees.
    fn smallest_angle(mesh: &TriMesh) -> Real {
        smallest_angles(mesh).into_iter().fold(Real::INFINITY, Real::min)
    }

    const BALL: Sphere = Sphere { center: Point::new(0.0, 0.0, 0.0), radius: 1.0 };

    fn marched(cell: Real) -> TriMesh {
        let params = ExtractParams {
            resolution: Resolution::Cell(cell),
            phase: [0.3, 0.7, 0.1],
            ..ExtractParams::default()
        };
        extract(&BALL, &params, &mut Silent).unwrap().mesh
    }

    #[test]
    fn slivers_of_a_marched_ball_become_well_shaped() {
        let before = marched(0.05);
        let after = relax(&before, &BALL, &RelaxParams::default()).unwrap();
        assert!(
            smallest_angle(&before) < 2.0 && smallest_angle(&after) > 10.0,
            "{}",
            smallest_angle(&after)
        );
        assert!(after.vertices().iter().all(|p| BALL.distance(p).abs() < 1e-4));
        let t = after.face_normals();
        assert!(t.iter().enumerate().all(|(t, n)| n.dot(&after.corners(t)[0].coords) > 0.9));
    }

    #[test]
    fn a_border_slides_along_itself() {
        let ball = marched(0.08);
        let values: Vec<Real> = ball.vertices().iter().map(|p| p.y - 0.3).collect();
        let bowl = clip(&ball, &values);
        let after =
            relax(&bowl, &BALL, &RelaxParams { rounds: 8, ..RelaxParams::default() }).unwrap();
        let edges = Edges::new(&after);
        let on_border = edges.boundary_vertices(after.vertices().len());
        let (mut shortest, mut longest) = (Real::INFINITY, 0.0f64);
        for (e, [a, b]) in edges.vertices.iter().enumerate() {
            if edges.valence[e] == 1 {
                let length = (after.vertices()[*a as usize] - after.vertices()[*b as usize]).norm();
                (shortest, longest) = (shortest.min(length), longest.max(length));
            }
        }
        assert!(longest < 6.0 * shortest, "{shortest} {longest}");
        for (v, p) in after.vertices().iter().enumerate().filter(|(v, _)| on_border[*v]) {
            assert!((p.y - 0.3).abs() < 0.02, "vertex {v} {p}");
        }
    }

    /// The points within `half` of the surface of [`BALL`].
    struct Shell {
        half: Real,
    }
    impl SignedDistance for Shell {
        fn distance(&self, p: &Point) -> Real {
            BALL.distance(p).abs() - self.half
        }
        fn sample(&self, p: &Point) -> FieldSample {
            let s = BALL.sample(p);
            let side = if s.distance < 0.0 { -1.0 } else { 1.0 };
            FieldSample { distance: self.distance(p), gradient: s.gradient * side }
        }
        fn bounds(&self) -> Option<Aabb> {
            BALL.bounds().map(|b| b.inflated(self.half))
        }
        fn lipschitz(&self) -> Real {
            1.0
        }
    }

    #[test]
    fn hardly_any_vertex_of_a_shell_thinner_than_a_cell_changes_to_the_other_sheet() {
        let cell = 0.1;
        for (thickness, step) in [(0.25, 1.0), (0.5, 0.7), (0.5, 1.0), (0.9, 1.0)] {
            let shell = Shell { half: 0.5 * thickness * cell };
            let (mut crossed, mut moved, mut all) = (0, 0, 0);
            for layer in 0..6 {
                let params = ExtractParams {
                    resolution: Resolution::Cell(cell),
                    phase: layer_phase(layer),
                    ..ExtractParams::default()
                };
                let before = extract(&shell, &params, &mut Silent).unwrap().mesh;
                let after = relax(&before, &shell, &RelaxParams { rounds: 8, step }).unwrap();
                let sheet = |p: &Point| BALL.distance(p) > 0.0;
                let pairs = || before.vertices().iter().zip(after.vertices());
                crossed += pairs().filter(|(p, q)| sheet(p) != sheet(q)).count();
                moved += pairs().filter(|(p, q)| p != q).count();
                all += before.vertices().len();
            }
            // Measured: 3 of 9,820, 1 and 4 of 16,722, 3 of 22,444, all at rims of holes.
            assert!(crossed * 1000 < all, "{thickness} cells, step {step}: {crossed} of {all}");
            assert!(4 * moved > all, "{moved} of {all}");
        }
    }

    #[test]
    fn a_vertex_that_would_leave_the_region_stays() {
        let before = marched(0.1);
        let region = Aabb { min: Point::new(-2.0, -2.0, -2.0), max: Point::new(0.9, 2.0, 2.0) };
        // The zero of this field lies farther out, so that Newton steps lead there.
        let field = Sphere { radius: 1.1, ..BALL };
        let (params, mut evaluations) = (RelaxParams::default(), Vec::new());
        let Ok(after) = relax_within(&before, &field, &params, Some(&region), |n| {
            evaluations.push(n);
            Ok::<_, Infallible>(())
        });
        assert_eq!(evaluations, vec![before.vertices().len(); params.rounds]);
        let ended = relax_within(&before, &field, &params, Some(&region), |_| Err("cancelled"));
        assert_eq!(ended, Err("cancelled"));
        for (p, q) in before.vertices().iter().zip(after.vertices()) {
            assert!(region.contains(q) || p == q, "{p} went to {q}");
        }
        assert!(after.vertices().iter().any(|p| p.x < 0.8 && field.distance(p).abs() < 1e-3));
    }

    #[test]
    fn corners_of_borders_and_degenerate_triangles_stay() {
        struct Flat;
        impl SignedDistance for Flat {
            fn distance(&self, p: &Point) -> Real {
                p.z
            }
            fn sample(&self, p: &Point) -> FieldSample {
                FieldSample { distance: p.z, gradient: Vector::z() }
            }
            fn bounds(&self) -> Option<Aabb> {
                None
            }
            fn lipschitz(&self) -> Real {
                1.0
            }
        }
        let sheet = meshes::cloth(1.0, 1.0, 4, 4);
        let after = relax(&sheet, &Flat, &RelaxParams::default()).unwrap();
        for corner in [0, 4, 20, 24] {
            assert_eq!(after.vertices()[corner], sheet.vertices()[corner]);
        }
        approx::assert_relative_eq!(after.area(), 1.0, max_relative = 1e-12);
        let point = TriMesh::new(vec![Point::origin(); 3], vec![[0, 1, 2]]).unwrap();
        assert_eq!(relax(&point, &Flat, &RelaxParams::default()), Ok(point));
        assert_eq!(
            relax(&TriMesh::default(), &Flat, &RelaxParams::default()),
            Ok(TriMesh::default())
        );
    }

    #[test]
    fn a_step_out_of_range_is_an_error_and_an_unused_vertex_stays() {
        let ball = meshes::icosphere(1.0, 2);
        let lonely = Point::new(5.0, 5.0, 5.0);
        let with_one = [ball.vertices(), &[lonely]].concat();
        let mesh = TriMesh::new(with_one, ball.triangles().to_vec()).unwrap();
        for step in [Real::NAN, -0.1, 1.1, 1e308, Real::INFINITY] {
            let error = relax(&mesh, &BALL, &RelaxParams { rounds: 2, step }).unwrap_err();
            assert!(error.to_string().contains("from 0 to 1"), "{error}");
        }
        for step in [0.0, 1.0] {
            let after = relax(&mesh, &BALL, &RelaxParams { rounds: 2, step }).unwrap();
            assert_eq!(after.vertices().last(), Some(&lonely));
        }
    }
}
