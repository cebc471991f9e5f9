use super::*;
use crate::index::Bvh;
use crate::intersections::own_pairs;
use crate::sdf::MeshSdf;
use if_core::aabb::Aabb;
use if_core::edges::{Edges, VertexTriangles};
use if_core::field::FieldSample;
use if_core::math::Point;
use if_core::math::Vector;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::random::SplitMix64;
use if_core::shapes::{Gyroid, Plane, Sphere, Torus, Union, meshes};

/// Edges of other than two triangles, and Euler's characteristic.
fn topology(mesh: &TriMesh) -> (usize, i64) {
    let edges = Edges::new(mesh);
    let odd = edges.valence.iter().filter(|v| **v != 2).count();
    (odd, mesh.vertices().len() as i64 + mesh.triangles().len() as i64 - edges.len() as i64)
}

fn with(cell: Real) -> ExtractParams {
    ExtractParams { resolution: Resolution::Cell(cell), ..ExtractParams::default() }
}

fn ball(cell: Real) -> Extraction {
    let field = Sphere { center: Point::new(0.013, -0.007, 0.021), radius: 0.5 };
    extract(&field, &with(cell), &mut Silent).unwrap()
}

#[test]
fn flat_sides_on_the_last_plane_of_the_lattice_are_closed() {
    // Sides of 8 and a half cells end on nodes, but for rounding; as single precision has them, a
    // nanometre beyond.
    for side in [0.085, Real::from(0.085_f32), 0.095, 0.105, 0.115, 0.125] {
        let half = Vector::repeat(0.5 * side);
        let cube = meshes::cuboid(half);
        let cube = cube.with_vertices(cube.vertices().iter().map(|p| p + half).collect()).unwrap();
        let field = MeshSdf::closed(&cube).unwrap();
        let found = extract(&field, &with(0.01), &mut Silent).unwrap();
        assert_eq!(topology(&found.mesh), (0, 2), "{side}");
        assert!(found.report.warnings.is_empty(), "{side} {:?}", found.report.warnings);
    }
}

#[test]
fn a_ball_is_closed_of_euler_characteristic_two_and_its_volume_of_second_order() {
    let exact = std::f64::consts::PI / 6.0;
    let errors = [0.08, 0.04, 0.02].map(|cell| {
        let marched = ball(cell);
        assert_eq!(topology(&marched.mesh), (0, 2));
        assert!(marched.report.warnings.is_empty());
        let center = Point::new(0.013, -0.007, 0.021);
        assert!(
            marched.mesh.vertices().iter().all(|p| ((p - center).norm() - 0.5).abs() < 1e-12),
            "exact after Newton"
        );
        exact - marched.mesh.signed_volume()
    });
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((1.9..2.1).contains(&order), "{errors:?}");
    }
}

#[test]
fn shapes_keep_their_genus_and_the_work_follows_the_surface() {
    let ring = Torus { center: Point::origin(), major: 0.4, minor: 0.15 };
    let coarse = extract(&ring, &with(0.04), &mut Silent).unwrap();
    let fine = extract(&ring, &with(0.01), &mut Silent).unwrap();
    assert_eq!((topology(&coarse.mesh), topology(&fine.mesh)), ((0, 0), (0, 0)));
    // 16 times the surface; 64 times would be the volume.
    let of = |e: &Extraction| e.report.evaluations.refine;
    assert!(of(&fine) < 20 * of(&coarse), "{} {}", of(&fine), of(&coarse));
    let one = Sphere { center: Point::new(-0.3, 0.0, 0.0), radius: 0.2 };
    let two = Union(one, Sphere { center: Point::new(0.3, 0.0, 0.0), ..one });
    let both = extract(&two, &with(0.03), &mut Silent).unwrap();
    assert_eq!(topology(&both.mesh), (0, 4));
}

/// A field given at the nodes of a lattice and nowhere else, positive on the border.
struct Nodes(Vec<Real>);

impl Nodes {
    const N: usize = 9;

    fn random(seed: u64) -> Self {
        let mut random = SplitMix64::new(seed);
        let values = (0..Self::N.pow(3)).map(|n| {
            let border = (0..3).any(|k| [0, Self::N - 1].contains(&(n / Self::N.pow(k) % Self::N)));
            let value = 0.5 * random.unit() - 0.25;
            if border { 1.0 } else { value }
        });
        Self(values.collect())
    }
}

impl SignedDistance for Nodes {
    /// Trilinear.
    fn distance(&self, p: &Point) -> Real {
        let base = [0, 1, 2].map(|k| (p[k].floor() as usize).min(Self::N - 2));
        (0..8)
            .map(|c| {
                let at = [0, 1, 2].map(|k| base[k] + (c >> k & 1));
                let w: Real = (0..3).map(|k| 1.0 - (p[k] - at[k] as Real).abs()).product();
                w * self.0[at[0] + Self::N * (at[1] + Self::N * at[2])]
            })
            .sum()
    }
    fn sample(&self, p: &Point) -> FieldSample {
        FieldSample { distance: self.distance(p), gradient: Vector::zeros() }
    }
    fn bounds(&self) -> Option<Aabb> {
        None
    }
    fn lipschitz(&self) -> Real {
        Real::INFINITY
    }
}

#[test]
fn any_values_at_the_nodes_give_a_manifold_without_intersections() {
    let region = Aabb { min: Point::origin(), max: Point::new(8.0, 8.0, 8.0) };
    for seed in 0..12 {
        let field = Nodes::random(seed);
        let params =
            ExtractParams { region: Some(region), phase: [0.0; 3], newton: 0, ..with(1.0) };
        let mesh = extract(&field, &params, &mut Silent).unwrap().mesh;
        let edges = Edges::new(&mesh);
        assert!(
            mesh.triangles().len() > 500 && edges.valence.iter().all(|v| *v == 2),
            "seed {seed}"
        );
        // One fan a vertex: its triangles are as many as its edges, and all are reached.
        let fans = VertexTriangles::new(&mesh);
        for v in 0..mesh.vertices().len() {
            let fan: Vec<[u32; 3]> =
                fans.of(v).iter().map(|t| mesh.triangles()[*t as usize]).collect();
            let next = |w: u32| {
                let t =
                    fan.iter().find(|t| (0..3).any(|k| t[k] == v as u32 && t[(k + 1) % 3] == w))?;
                t.iter().copied().find(|u| *u != v as u32 && *u != w)
            };
            let start = *fan[0].iter().find(|u| **u != v as u32 && next(**u).is_some()).unwrap();
            let (mut at, mut steps) = (next(start).unwrap(), 1);
            while at != start {
                (at, steps) = (next(at).unwrap(), steps + 1);
            }
            assert_eq!(steps, fan.len(), "seed {seed}, vertex {v}");
        }
        assert_eq!(own_pairs(&mesh, &Bvh::new(&mesh)).len(), 0, "seed {seed}");
    }
}

#[test]
fn zeros_on_the_nodes_make_no_holes() {
    // The surface passes exactly through nodes, edges and sides of the lattice.
    let flat = Plane { point: Point::new(0.0, 0.5, 0.0), normal: Vector::y() };
    let region = Aabb { min: Point::origin(), max: Point::new(1.0, 1.0, 1.0) };
    let params = ExtractParams { region: Some(region), phase: [0.0; 3], ..with(0.125) };
    let marched = extract(&flat, &params, &mut Silent).unwrap();
    assert!(
        matches!(marched.report.warnings[..], [Warning::LeavesRegion { edges: 32 }]),
        "{:?}",
        marched.report.warnings
    );
    assert_eq!(marched.mesh.triangles().len(), 128);
    approx::assert_relative_eq!(marched.mesh.area(), 1.0, max_relative = 1e-12);
    let ball = Sphere { center: Point::new(0.5, 0.5, 0.5), radius: 0.375 };
    let mesh = extract(&ball, &params, &mut Silent).unwrap().mesh;
    assert_eq!(topology(&mesh), (0, 2));
    assert!((0..mesh.triangles().len()).all(|t| mesh.corners(t)[0] != mesh.corners(t)[1]));
}

#[test]
fn a_field_without_a_surface_gives_an_empty_mesh_and_a_labyrinth_an_open_one() {
    let region = Aabb { min: Point::origin(), max: Point::new(1.0, 1.0, 1.0) };
    let far = Sphere { center: Point::new(9.0, 0.0, 0.0), radius: 1.0 };
    let params = ExtractParams { region: Some(region), ..with(0.05) };
    assert_eq!(extract(&far, &params, &mut Silent).unwrap().mesh, TriMesh::default());
    let labyrinth = extract(&Gyroid { period: 0.5 }, &params, &mut Silent).unwrap();
    let leaves =
        labyrinth.report.warnings.iter().any(|w| matches!(w, Warning::LeavesRegion { .. }));
    assert!(leaves && Edges::new(&labyrinth.mesh).valence.iter().all(|v| *v <= 2));
}

/// The name of the parameter that is out of range.
fn parameter(error: ExtractError) -> String {
    match error {
        ExtractError::Parameter(error) => error.name.into_owned(),
        other => panic!("{other}"),
    }
}

#[test]
fn invalid_input_is_an_error() {
    let field = Sphere { center: Point::origin(), radius: 1.0 };
    let region = field.bounds().unwrap();
    let of = |params: ExtractParams| extract(&field, &params, &mut Silent).unwrap_err();
    for cell in [0.0, -1.0, Real::NAN, Real::INFINITY] {
        assert_eq!(parameter(of(with(cell))), "cell");
        let slope = Slope::Given(cell);
        assert_eq!(
            cell == Real::INFINITY,
            extract(&field, &ExtractParams { slope, ..with(0.1) }, &mut Silent).is_ok()
        );
        let resolution = Resolution::Accuracy { error: 1e-3, finest: cell };
        assert_eq!(parameter(of(ExtractParams { resolution, ..with(0.1) })), "finest");
    }
    let phase = ExtractParams { phase: [0.0, 2.0, 0.0], ..with(0.1) };
    assert_eq!(parameter(of(phase)), "phase[1]");
    assert_eq!(parameter(of(ExtractParams { noise: -1.0, ..with(0.1) })), "noise");
    let none = ExtractParams { resolution: Resolution::Cells(0), ..with(0.1) };
    assert_eq!(parameter(of(none)), "cells");
    assert!(matches!(
        extract(&Gyroid { period: 1.0 }, &with(0.1), &mut Silent),
        Err(ExtractError::NoRegion)
    ));
    let endless = Aabb { max: Point::new(1.0, Real::INFINITY, 1.0), ..region };
    let point = Aabb { min: Point::origin(), max: Point::origin() };
    for region in [Aabb::EMPTY, endless, point] {
        assert!(matches!(
            of(ExtractParams { region: Some(region), ..with(0.1) }),
            ExtractError::Region { .. }
        ));
    }
    assert!(matches!(of(with(1e-9)), ExtractError::TooFine { .. }));
    let unmeasured = Resolution::Accuracy { error: 1e-6, finest: 1e-4 };
    let unmeasured = ExtractParams { resolution: unmeasured, check: 0, ..with(0.1) };
    assert_eq!(parameter(of(unmeasured)), "check");
    let dense = ExtractParams { sampling: Sampling::Dense, ..with(1e-3) };
    assert!(matches!(of(dense), ExtractError::TooManyNodes { .. }));
    let hole = Nodes(vec![Real::NAN; Nodes::N.pow(3)]);
    let region = Aabb { min: Point::origin(), max: Point::new(8.0, 8.0, 8.0) };
    let error = extract(&hole, &ExtractParams { region: Some(region), ..with(1.0) }, &mut Silent)
        .unwrap_err();
    assert!(matches!(error, ExtractError::NotANumber { .. }));
}

#[test]
fn more_memory_than_is_allowed_is_refused_before_it_is_taken() {
    let field = Sphere { center: Point::origin(), radius: 0.5 };
    let of = |params: ExtractParams| extract(&field, &params, &mut Silent);
    let refused = |params: ExtractParams| match of(params).unwrap_err() {
        ExtractError::TooLarge { bytes, limit, cell } => {
            assert!(bytes > limit && limit == params.memory && cell > 0.0)
        }
        other => panic!("{other}"),
    };
    let little = ExtractParams { memory: 1 << 24, ..ExtractParams::default() };
    refused(ExtractParams { resolution: Resolution::Cells(16_384), ..little });
    // A billion nodes.
    let dense = ExtractParams {
        sampling: Sampling::Dense,
        resolution: Resolution::Cells(1024),
        ..ExtractParams::default()
    };
    refused(dense);
    let slope = Slope::Sampled { points: usize::MAX, factor: 1.5, seed: 0 };
    assert!(matches!(
        of(ExtractParams { slope, ..little }),
        Err(ExtractError::TooManyPoints { points: usize::MAX, .. })
    ));
    // What is just enough gives the same mesh, and less names what is missing; relaxing takes
    // more.
    let base = with(0.02);
    let mesh = of(base).unwrap().mesh;
    let least = |relax: usize| {
        let mut memory = 0;
        while let Err(ExtractError::TooLarge { bytes, .. }) =
            of(ExtractParams { memory, relax, ..base })
        {
            memory = bytes;
        }
        memory
    };
    let (plain, relaxed) = (least(0), least(1));
    assert!(plain < relaxed, "{plain} {relaxed}");
    assert_eq!(of(ExtractParams { memory: plain, ..base }).unwrap().mesh, mesh);
    refused(ExtractParams { memory: plain - 1, ..base });
    // In proportion to the surface: some hundred bytes for each vertex.
    assert!(
        (100..1000).contains(&(plain / mesh.vertices().len())),
        "{plain} for {}",
        mesh.vertices().len()
    );
}

#[test]
fn the_centre_of_a_triangle_is_off_by_its_sides_and_the_curvature() {
    let found = ball(0.03).mesh;
    for t in 0..found.triangles().len() {
        let [a, b, c] = found.corners(t);
        let squares = (a - b).norm_squared() + (b - c).norm_squared() + (c - a).norm_squared();
        let center = Point::from((a.coords + b.coords + c.coords) / 3.0);
        let off = 0.5 - (center - Point::new(0.013, -0.007, 0.021)).norm();
        // The curvature of a ball of half a metre is 2; terms of the fourth order are left out.
        approx::assert_relative_eq!(off, 2.0 * squares / 18.0, max_relative = 0.01, epsilon = 1e-9);
    }
}

#[test]
fn one_thread_gives_the_bits_of_many() {
    let on =
        |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| ball(0.03));
    let (one, many) = (on(1), on(5));
    assert_eq!(one.mesh, many.mesh);
    assert_eq!(one.report, ExtractReport { seconds: one.report.seconds, ..many.report });
}

#[test]
fn a_region_without_a_surface_is_a_warning() {
    let ball = Sphere { center: Point::origin(), radius: 1.0 };
    let warnings = |x: Real, size: Real| {
        let corner = Vector::repeat(0.5 * size);
        let middle = Point::new(x, 0.0, 0.0);
        let params = ExtractParams {
            region: Some(Aabb { min: middle - corner, max: middle + corner }),
            resolution: Resolution::Cells(8),
            ..ExtractParams::default()
        };
        extract(&ball, &params, &mut Silent).unwrap().report.warnings
    };
    assert_eq!(warnings(0.0, 0.5), [Warning::Empty { inside: true }]);
    assert_eq!(warnings(3.0, 0.5), [Warning::Empty { inside: false }]);
    assert!(warnings(0.0, 3.0).is_empty());
}
