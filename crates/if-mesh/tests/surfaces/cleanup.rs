//! Clean-up of anything: random soups, damaged surfaces, attributes.

#![allow(clippy::unwrap_used)] // also in what the tests share

use if_core::edges::{Edges, VertexTriangles};
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::{Cancelled, Progress, Silent};
use if_core::random::SplitMix64;
use if_core::shapes::Sphere;
use if_core::shapes::meshes::{icosphere, tube};
use if_mesh::attributes::VertexAttributes;
use if_mesh::cleanup::{
    Cleaned, CleanupError, CleanupParams, Complement, ComponentParams, FillParams, MAX_PASSES,
    Openings, PatchShape, SmoothParams, cleanup, fill_holes, make_manifold, remove_isolated,
    smooth_boundary,
};
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;
use if_mesh::ply::{Column, Property};
use if_mesh::seams::weld;
use if_mesh::validate::{Fault, faults};
use proptest::prelude::*;
use std::ops::ControlFlow;

fn clean(mesh: &TriMesh, params: &CleanupParams) -> Cleaned {
    let attributes = VertexAttributes::none(mesh.vertices().len());
    cleanup(mesh, &attributes, None, params, &mut Silent).unwrap()
}

/// Fans of triangles round each vertex that is used, by brute force.
fn fans(mesh: &TriMesh, v: usize) -> usize {
    let of = VertexTriangles::new(mesh);
    let mut left = of.of(v).to_vec();
    let mut fans = 0;
    while let Some(t) = left.pop() {
        fans += 1;
        let mut reached = vec![t];
        while let Some(t) = reached.pop() {
            let others =
                |t: u32| mesh.triangles()[t as usize].into_iter().filter(|u| *u as usize != v);
            let (near, far): (Vec<u32>, Vec<u32>) =
                left.iter().partition(|u| others(**u).any(|a| others(t).any(|b| a == b)));
            reached.extend(near);
            left = far;
        }
    }
    fans
}

/// What every result must be.
fn check(before: &TriMesh, after: &Cleaned) {
    let mesh = &after.mesh;
    assert!(mesh.vertices().iter().all(|p| p.iter().all(|x| x.is_finite())));
    for fault in faults(mesh) {
        // A soup, or a part of one, may be inside out; copies of split vertices lie where the
        // others are.
        let allowed = matches!(
            fault,
            Fault::NoTriangles { .. }
                | Fault::Duplicates { .. }
                | Fault::Units { .. }
                | Fault::InsideOut { .. }
                | Fault::PartInsideOut { .. }
        );
        assert!(allowed, "{fault}");
    }
    for v in 0..mesh.vertices().len() {
        assert_eq!(fans(mesh, v), 1, "vertex {v}");
    }
    assert_eq!(after.attributes.vertices(), mesh.vertices().len());
    // Against the manifold mesh: where flat triangles are mended, a triangle that was met already
    // may become two.
    let before = make_manifold(&closed(before)).0.mesh;
    let pairs = |mesh: &TriMesh| own_pairs(mesh, &Bvh::new(mesh)).len();
    let (before, after) = (pairs(&before), pairs(&closed(mesh)));
    assert!(after <= before, "{before} pairs became {after}");
}

/// The mesh with its seams closed, as it is cleaned up.
fn closed(mesh: &TriMesh) -> TriMesh {
    let welded = weld(mesh).filter(|welded| welded.edges > 0 && welded.repeated == 0);
    welded.map_or_else(|| mesh.clone(), |welded| welded.mesh)
}

/// Triangles on a small grid of points: doubled, flat, non-manifold and through each other, as
/// often as not.
fn soups() -> impl Strategy<Value = TriMesh> {
    (4usize..24).prop_flat_map(|n| {
        let point = prop_oneof![
            (0i8..4, 0i8..4, 0i8..3).prop_map(|(x, y, z)| Point::new(x.into(), y.into(), z.into())),
            (0.0..3.0, 0.0..3.0, 0.0..2.0).prop_map(|(x, y, z)| Point::new(x, y, z)),
        ];
        let triangle = (0..n as u32, 0..n as u32, 0..n as u32)
            .prop_filter("three corners", |(a, b, c)| a != b && b != c && c != a);
        (proptest::collection::vec(point, n), proptest::collection::vec(triangle, 0..40)).prop_map(
            |(points, triangles)| {
                TriMesh::new(points, triangles.into_iter().map(|(a, b, c)| [a, b, c]).collect())
                    .unwrap()
            },
        )
    })
}

/// Balls and tubes with triangles missing, doubled and turned over.
fn damaged() -> impl Strategy<Value = TriMesh> {
    let whole = prop_oneof![
        Just(icosphere(0.3, 2)),
        Just(tube(0.1, 0.3, 14, 7, false)),
        Just(tube(0.1, 0.3, 9, 5, true))
    ];
    (whole, any::<u64>(), 0.0..0.5).prop_map(|(mesh, seed, share)| {
        let mut random = SplitMix64::new(seed);
        let mut triangles = Vec::new();
        for t in mesh.triangles() {
            let r = random.unit();
            match r {
                r if r < share => {}
                r if r < share + 0.05 => triangles.push([t[1], t[0], t[2]]),
                r if r < share + 0.1 => triangles.extend([*t, *t]),
                _ => triangles.push(*t),
            }
        }
        let points = mesh
            .vertices()
            .iter()
            .map(|p| p + Vector::new(random.unit(), random.unit(), random.unit()) * 0.01)
            .collect();
        TriMesh::new(points, triangles).unwrap()
    })
}

fn policies() -> impl Strategy<Value = CleanupParams> {
    let openings = prop_oneof![
        Just(Openings::default()),
        (0usize..4).prop_map(Openings::Count),
        (0.0..4.0).prop_map(Openings::Longer),
        Just(Openings::Near(vec![Point::origin()])),
        Just(Openings::Complement(Box::new(Complement::new(icosphere(1.0, 1))))),
    ];
    (openings, any::<bool>(), any::<bool>()).prop_map(|(openings, all, single_precision)| {
        CleanupParams {
            openings,
            components: (!all).then(ComponentParams::default),
            single_precision,
            ..CleanupParams::default()
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_soup_becomes_a_valid_mesh(mesh in soups(), params in policies()) {
        check(&mesh, &clean(&mesh, &params));
    }

    #[test]
    fn any_damaged_surface_becomes_a_valid_mesh(mesh in damaged(), params in policies()) {
        check(&mesh, &clean(&mesh, &params));
    }

    #[test]
    fn a_second_clean_up_changes_nothing_where_the_first_left_no_hole(mesh in prop_oneof![soups(), damaged()], params in policies()) {
        // Smoothing stops where a loop is smooth or a vertex is held back, and the latter may go on
        // from there. Openings by shape are judged against the area, to which patches add: a loop
        // that was an opening can be a hole then.
        prop_assume!(!matches!(params.openings, Openings::Shape(_)));
        let params = CleanupParams { smooth: None, ..params };
        let first = clean(&mesh, &params);
        // A hole that could not be filled may be one that can, once its neighbours are.
        prop_assume!(first.report.holes.left.is_empty());
        let second = clean(&first.mesh, &params);
        // Two sides of what were three sheets with vertices of their own, one of them dropped.
        prop_assume!(second.report.seam_edges == 0);
        prop_assert_eq!(&second.mesh, &first.mesh, "{:?}", second.report);
    }
}

#[test]
#[ignore = "stress"]
fn many_more_soups() {
    let config =
        ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() };
    proptest!(config, |(mesh in prop_oneof![soups(), damaged()], params in policies())| check(&mesh, &clean(&mesh, &params)));
}

/// A sphere without the triangles whose centre lies in one of some balls.
fn holed(subdivisions: u32, holes: &[(Vector, Real)]) -> TriMesh {
    let ball = icosphere(0.3, subdivisions);
    let outside = |t: &[u32; 3]| {
        let c =
            t.iter().fold(Vector::zeros(), |s, v| s + ball.vertices()[*v as usize].coords) / 3.0;
        holes.iter().all(|(at, r)| (c - at).norm() > *r)
    };
    TriMesh::new(
        ball.vertices().to_vec(),
        ball.triangles().iter().filter(|t| outside(t)).copied().collect(),
    )
    .unwrap()
}

#[test]
fn patches_go_on_as_the_surface_does_and_lie_on_the_field_where_there_is_one() {
    let mesh = holed(5, &[(Vector::new(0.3, 0.0, 0.0), 0.08), (Vector::new(0.0, 0.3, 0.0), 0.04)]);
    let params = CleanupParams { openings: Openings::Count(0), ..CleanupParams::default() };
    let off = |c: &Cleaned| {
        c.mesh.vertices().iter().map(|p| (p.coords.norm() - 0.3).abs()).fold(0.0, Real::max)
    };
    let fair = clean(&mesh, &params);
    assert_eq!(fair.report.holes.filled.len(), 2);
    assert!(fair.report.holes.filled.iter().all(|f| f.shape == PatchShape::Fair));
    // A flat lid would be 11 mm too low; the biharmonic one is off by a tenth of that.
    assert!(off(&fair) < 1.5e-3, "{}", off(&fair));
    assert_eq!(Edges::new(&fair.mesh).valence.iter().filter(|v| **v != 2).count(), 0, "closed");
    let sphere = Sphere { center: Point::origin(), radius: 0.3 };
    let on = cleanup(
        &mesh,
        &VertexAttributes::none(mesh.vertices().len()),
        Some(&sphere as &dyn SignedDistance),
        &params,
        &mut Silent,
    )
    .unwrap();
    assert!(on.report.holes.filled.iter().all(|f| f.shape == PatchShape::Projected));
    assert!(off(&on) < 1e-9, "{}", off(&on));
    let area = on.mesh.area();
    assert!((area / icosphere(0.3, 5).area() - 1.0).abs() < 1e-3, "{area}");
}

#[test]
fn new_positions_are_those_of_single_precision_if_they_will_be_stored_so() {
    // A hole to fill and a ragged opening to smooth; positions of the input are doubles.
    let mesh = holed(4, &[(Vector::new(0.3, 0.0, 0.0), 0.08), (Vector::new(0.0, 0.3, 0.0), 0.15)]);
    let mut random = SplitMix64::new(7);
    let mut shaken = |p: &Point| p + Vector::repeat(1e-4 * random.unit());
    let mesh = mesh.with_vertices(mesh.vertices().iter().map(&mut shaken).collect()).unwrap();
    let params = CleanupParams {
        openings: Openings::Count(1),
        single_precision: true,
        ..CleanupParams::default()
    };
    let cleaned = clean(&mesh, &params);
    let (report, n) = (&cleaned.report, mesh.vertices().len());
    assert!(report.holes.filled.len() == 1 && report.smoothing.moved > 10, "{report:?}");
    let new = cleaned.mesh.vertices().iter().filter(|p| !mesh.vertices().contains(p));
    let new: Vec<&Point> = new.collect();
    assert!(new.len() >= report.smoothing.moved + cleaned.mesh.vertices().len() - n);
    let single = |p: &Point| p.map(|x| Real::from(x as f32));
    assert!(new.into_iter().all(|p| *p == single(p)));
}

#[test]
fn a_garment_without_a_patch_of_its_body_gets_it_back_and_keeps_its_openings() {
    // The body is the ball; the garment its lower part with a hole, its opening at y = 0.15.
    let body = icosphere(0.3, 4);
    let hole = Vector::new(0.0, -0.1, 0.28);
    let keep = |t: &[u32; 3]| {
        let c =
            t.iter().fold(Vector::zeros(), |s, v| s + body.vertices()[*v as usize].coords) / 3.0;
        c.y < 0.15 && (c - hole).norm() > 0.06
    };
    let triangles = body.triangles().iter().filter(|t| keep(t)).copied().collect();
    let garment = TriMesh::new(body.vertices().to_vec(), triangles).unwrap();
    let params = CleanupParams {
        openings: Openings::Complement(Box::new(Complement::new(body.clone()))),
        ..CleanupParams::default()
    };
    let result = clean(&garment, &params);
    assert_eq!((result.report.holes.filled.len(), result.report.holes.openings.len()), (1, 1));
    // What surely belongs to something else is no hole, however small.
    let foreign = body.vertices().iter().map(|p| (p.coords - hole).norm() < 0.08).collect();
    let complement = Complement { foreign, ..Complement::new(body) };
    let params = CleanupParams {
        openings: Openings::Complement(Box::new(complement)),
        ..CleanupParams::default()
    };
    assert_eq!(clean(&garment, &params).report.holes.openings.len(), 2);
}

#[test]
fn attributes_go_along() {
    let mesh = holed(4, &[(Vector::new(0.3, 0.0, 0.0), 0.08)]);
    let n = mesh.vertices().len();
    let (label, heat): (Vec<u8>, Vec<f64>) =
        mesh.vertices().iter().map(|p| (if p.y > 0.0 { 7 } else { 3 }, 20.0 + p.y)).unzip();
    let properties = vec![
        Property::new("label", Column::U8(label)),
        Property::new("heat", Column::F64(heat)),
        Property::new("j0", Column::U8(vec![1; n])),
        Property::new("j1", Column::U8(vec![2; n])),
        Property::new("w0", Column::F32(vec![0.75; n])),
        Property::new("w1", Column::F32(vec![0.25; n])),
    ];
    let attributes = VertexAttributes::new(n, properties).unwrap();
    let params = CleanupParams { openings: Openings::Count(0), ..CleanupParams::default() };
    let made = cleanup(&mesh, &attributes, None, &params, &mut Silent).unwrap();
    assert!(made.report.holes.filled[0].vertices > 10);
    let [label, heat, j0, _, w0, w1] = made.attributes.properties() else {
        panic!("six properties")
    };
    let (Column::U8(label), Column::F64(heat)) = (&label.values, &heat.values) else {
        panic!("types stay")
    };
    for (v, p) in made.mesh.vertices().iter().enumerate() {
        assert!((heat[v] - 20.0 - p.y).abs() < 0.04, "{} at {}", heat[v], p.y);
        if p.y.abs() > 0.03 {
            assert_eq!(label[v], if p.y > 0.0 { 7 } else { 3 }, "{p}");
        }
    }
    assert_eq!(j0.values, Column::U8(vec![1; heat.len()]));
    assert_eq!(
        (&w0.values, &w1.values),
        (&Column::F32(vec![0.75; heat.len()]), &Column::F32(vec![0.25; heat.len()]))
    );
    let error = cleanup(&mesh, &VertexAttributes::none(3), None, &params, &mut Silent).unwrap_err();
    assert!(matches!(error, CleanupError::Attributes { attributes: 3, .. }));
}

#[test]
fn a_size_whose_areas_are_no_numbers_is_an_error() {
    let tube = tube(0.1, 0.4, 40, 20, false);
    let attributes = VertexAttributes::none(tube.vertices().len());
    let params = CleanupParams { components: None, ..CleanupParams::default() };
    let cleaned =
        |factor| cleanup(&tube.scaled(factor).unwrap(), &attributes, None, &params, &mut Silent);
    for factor in [1e-200, 1e-75, 1e75, 1e200] {
        assert!(matches!(cleaned(factor), Err(CleanupError::Size { .. })), "{factor:e}");
    }
    for factor in [1e-3, 1.0] {
        assert_eq!(cleaned(factor).unwrap().mesh.triangles(), tube.triangles(), "{factor:e}");
    }
}

#[test]
fn a_ragged_hem_gets_smooth_and_keeps_its_length() {
    // A tube whose end is cut along triangles, at random.
    let whole = tube(0.15, 0.4, 90, 45, false);
    let mut random = SplitMix64::new(5);
    let triangles: Vec<[u32; 3]> = whole
        .triangles()
        .iter()
        .filter(|t| {
            let wave = (random.unit() - 0.5) * 0.015;
            let y = t.iter().map(|v| whole.vertices()[*v as usize].y).sum::<Real>() / 3.0;
            y < 0.35 + wave
        })
        .copied()
        .collect();
    let ragged = TriMesh::new(whole.vertices().to_vec(), triangles).unwrap();
    let result = clean(&ragged, &CleanupParams::default());
    let report = &result.report.smoothing;
    check(&ragged, &result);
    assert_eq!(report.loops.len(), 2);
    let round = std::f64::consts::TAU * 0.15;
    for l in &report.loops {
        assert!(l.roughness[1] <= 0.2, "{l:?}");
        assert!((l.boundary.length / round - 1.0).abs() < 0.05, "{l:?}");
    }
    let hem = report.loops.iter().find(|l| l.passes > 0).expect("the ragged one");
    assert!(hem.length_before > 1.15 * round && hem.boundary.length < 1.05 * round, "{hem:?}");
    let end = report.loops.iter().find(|l| l.passes == 0).expect("the other one");
    assert_eq!(end.length_before, end.boundary.length);
}

#[test]
fn the_surface_can_be_smoothed_and_its_boundary_left() {
    // A tube with a bump at every other place.
    let whole = tube(0.15, 0.4, 60, 30, false);
    let n = whole.vertices().len();
    let bump = |k: usize, p: &Point| {
        Point::new(p.x, p.y, p.z)
            + Vector::new(p.x, 0.0, p.z) * if k.is_multiple_of(2) { 0.01 } else { 0.0 }
    };
    let bumpy = TriMesh::new(
        (0..n).map(|k| bump(k, &whole.vertices()[k])).collect(),
        whole.triangles().to_vec(),
    )
    .unwrap();
    let smooth = SmoothParams { boundary: false, surface_passes: 2, ..SmoothParams::default() };
    let result = clean(&bumpy, &CleanupParams { smooth: Some(smooth), ..CleanupParams::default() });
    check(&bumpy, &result);
    let on_rim = |p: &Point| p.y.abs() < 1e-9 || (p.y - 0.4).abs() < 1e-9;
    let radius = |p: &Point| p.x.hypot(p.z);
    let spread = |mesh: &TriMesh| {
        let inner: Vec<Real> = mesh.vertices().iter().filter(|p| !on_rim(p)).map(radius).collect();
        let mean = inner.iter().sum::<Real>() / inner.len() as Real;
        (inner.iter().map(|r| (r - mean).powi(2)).sum::<Real>() / inner.len() as Real).sqrt()
    };
    assert_eq!(result.mesh.triangles(), bumpy.triangles());
    assert!(
        spread(&result.mesh) < 0.5 * spread(&bumpy),
        "{} of {}",
        spread(&result.mesh),
        spread(&bumpy)
    );
    for (p, q) in result.mesh.vertices().iter().zip(bumpy.vertices()).filter(|(_, q)| on_rim(q)) {
        assert_eq!(p, q);
    }
}

#[test]
fn the_same_bits_for_any_number_of_threads() {
    let mesh = holed(
        4,
        &[
            (Vector::new(0.3, 0.0, 0.0), 0.1),
            (Vector::new(0.0, 0.3, 0.0), 0.05),
            (Vector::new(0.0, 0.0, 0.3), 0.02),
        ],
    );
    let params = CleanupParams::default();
    let results: Vec<Cleaned> = [1, 2, 5]
        .into_iter()
        .map(|n| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(n)
                .build()
                .unwrap()
                .install(|| clean(&mesh, &params))
        })
        .collect();
    assert!(results.windows(2).all(|w| w[0] == w[1]));
}

#[test]
fn parameters_out_of_range_are_rejected() {
    let mesh = icosphere(0.1, 1);
    let refused = |params: CleanupParams| {
        let attributes = VertexAttributes::none(mesh.vertices().len());
        cleanup(&mesh, &attributes, None, &params, &mut Silent).unwrap_err().to_string()
    };
    let p = CleanupParams { openings: Openings::Longer(-1.0), ..CleanupParams::default() };
    assert!(refused(p).contains("-1"));
    let p = CleanupParams { openings: Openings::Shape(Real::NAN), ..CleanupParams::default() };
    assert!(refused(p).contains("NaN"));
    let p = CleanupParams {
        openings: Openings::Near(vec![Point::new(0.0, Real::INFINITY, 0.0)]),
        ..CleanupParams::default()
    };
    assert!(refused(p).contains("openings.near[0]"));
    let p = CleanupParams {
        openings: Openings::Complement(Box::new(Complement::new(TriMesh::default()))),
        ..CleanupParams::default()
    };
    assert!(refused(p).contains("openings.complement.body.triangles"));
    let components = Some(ComponentParams { least_share: 2.0, most: None });
    assert!(refused(CleanupParams { components, ..CleanupParams::default() }).contains("share"));
    let many = MAX_PASSES + 1;
    for smooth in [
        SmoothParams { passes: many, ..SmoothParams::default() },
        SmoothParams { rounds: many, ..SmoothParams::default() },
        SmoothParams { surface_passes: many, ..SmoothParams::default() },
    ] {
        let message = refused(CleanupParams { smooth: Some(smooth), ..CleanupParams::default() });
        assert!(message.contains("10001") && message.contains("at most 10,000"), "{message}");
    }
}

#[test]
fn single_steps_do_what_cleanup_does_and_check_their_parameters() {
    let tube = tube(0.1, 0.4, 40, 20, false);
    let holed = TriMesh::new(
        tube.vertices().to_vec(),
        [&tube.triangles()[..600], &tube.triangles()[604..]].concat(),
    )
    .unwrap();
    let (fill, smooth) = (FillParams::default(), SmoothParams::default());
    let (filled, report) =
        fill_holes(&holed, None, &Openings::default(), &fill, &mut Silent).unwrap();
    assert_eq!((report.filled.len(), report.openings.len()), (1, 2));
    let (smoothed, _) = smooth_boundary(&filled.mesh, None, &smooth, &mut Silent).unwrap();
    let whole = clean(&holed, &CleanupParams::default());
    assert_eq!(smoothed.mesh.triangles().len(), whole.mesh.triangles().len());
    // An openness of NaN would close neck and cuffs; the minimum-weight triangulation of so many
    // edges would take gigabytes.
    let rejected = |error: CleanupError| {
        let CleanupError::Parameter(error) = error else { panic!("{error}") };
        error.name.into_owned()
    };
    let nan = Openings::Shape(Real::NAN);
    let error = fill_holes(&holed, None, &nan, &fill, &mut Silent).unwrap_err();
    assert_eq!(rejected(error), "shape");
    let endless = FillParams { exact_up_to: usize::MAX, ..fill };
    let error = fill_holes(&holed, None, &Openings::default(), &endless, &mut Silent).unwrap_err();
    assert_eq!(rejected(error), "exact_up_to");
    let params = CleanupParams { fill: Some(endless), ..CleanupParams::default() };
    assert_eq!(params.validate().unwrap_err().name, "fill.exact_up_to");
    let forever = SmoothParams { passes: usize::MAX, ..smooth };
    let error = smooth_boundary(&holed, None, &forever, &mut Silent).unwrap_err();
    assert_eq!(rejected(error), "passes");
    let none = ComponentParams { least_share: Real::NAN, ..ComponentParams::default() };
    assert_eq!(remove_isolated(&holed, &none).unwrap_err().name, "least_share");
}

#[test]
fn a_monitor_can_cancel_at_any_report() {
    let mesh = holed(3, &[(Vector::new(0.3, 0.0, 0.0), 0.1), (Vector::new(0.0, 0.3, 0.0), 0.05)]);
    let none = VertexAttributes::none(mesh.vertices().len());
    let smooth = SmoothParams { surface_passes: 7, ..SmoothParams::default() };
    let params = CleanupParams { smooth: Some(smooth), ..CleanupParams::default() };
    let mut stages = Vec::new();
    let whole = cleanup(&mesh, &none, None, &params, &mut |p: &Progress<'_>| {
        stages.push(p.stage);
        ControlFlow::Continue(())
    });
    assert_eq!(whole.unwrap(), clean(&mesh, &params));
    let order = ["manifold", "components", "holes", "boundary"];
    assert!(stages.is_sorted_by_key(|s| order.iter().position(|t| t == s)));
    assert!(stages.iter().filter(|s| **s == "boundary").count() > 8, "{stages:?}");
    for last in 0..stages.len() {
        let mut calls = 0;
        let cancelled = cleanup(&mesh, &none, None, &params, &mut |_: &Progress<'_>| {
            calls += 1;
            if calls > last { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!((cancelled, calls), (Err(CleanupError::Cancelled(Cancelled)), last + 1));
    }
}

/// Found by [`many_more_soups`]: with its seam open, two of its triangles are no part of a manifold.
#[test]
fn a_soup_with_a_seam_gets_no_new_own_pairs() {
    let p = |x: Real, y: Real, z: Real| Point::new(x, y, z);
    let zero = p(0.0, 0.0, 0.0);
    let vertices = vec![
        zero,
        p(1.0, 2.0, 1.0),
        p(1.0, 2.0, 0.0),
        zero,
        p(1.0, 3.0, 0.0),
        p(2.0, 0.0, 0.0),
        p(1.0, 3.0, 1.0),
        p(0.09882060119920076, 2.1268898827913905, 0.17218836801977835),
        p(1.0, 0.0, 2.0),
        p(1.0, 2.0, 1.0),
    ];
    let triangles = [
        [8, 1, 0],
        [6, 5, 9],
        [8, 4, 9],
        [4, 3, 8],
        [1, 4, 6],
        [2, 5, 9],
        [2, 7, 6],
        [6, 9, 2],
        [6, 5, 2],
    ];
    let mesh = TriMesh::new(vertices, triangles.to_vec()).unwrap();
    let after = clean(&mesh, &CleanupParams::default());
    assert_eq!(after.report.seam_edges, 2);
    check(&mesh, &after);
}
