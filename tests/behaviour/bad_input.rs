//! Inputs that are no outfit give an error that names the fault; inputs that are odd but usable end
//! clean or with what is left. Nothing panics.

use crate::scenes::{assert_clean_or_left, ball_in_tube, moved, resolved};
use if_core::math::{Point, Real};
use if_core::mesh::{MeshError, TriMesh};
use if_core::monitor::Silent;
use if_core::shapes::meshes::{cloth, icosphere, tube};
use if_outfit::outfit::{Layer, Outfit, OutfitError};
use if_outfit::resolve::{Method, ResolveError, ResolveParams, resolve};
use if_outfit::verify::verify;

fn ball() -> Layer {
    Layer::new("ball", icosphere(0.3, 3))
}

fn outfit_with(garment: TriMesh) -> Outfit {
    Outfit::new(ball(), vec![Layer::new("garment", garment)]).unwrap()
}

#[test]
fn every_unusable_outfit_has_its_error_at_construction_in_verify_and_in_resolve() {
    let band = || Layer::new("band", tube(0.31, 0.2, 24, 4, false));
    let scaled = |s: Real| Layer::new("ball", moved(&icosphere(0.3, 3), |p| p * s));
    let nothing = TriMesh::new(vec![Point::origin()], vec![]).unwrap();
    type Check = fn(&OutfitError) -> bool;
    let cases: [(&str, Layer, Vec<Layer>, Check); 11] = [
        (
            "empty body",
            Layer::new("ball", TriMesh::default()),
            vec![band()],
            |e| matches!(e, OutfitError::Empty { layer } if layer == "ball"),
        ),
        (
            "empty garment",
            ball(),
            vec![Layer::new("band", nothing)],
            |e| matches!(e, OutfitError::Empty { layer } if layer == "band"),
        ),
        (
            "twins",
            ball(),
            vec![band(), band()],
            |e| matches!(e, OutfitError::DuplicateName { layer } if layer == "band"),
        ),
        ("named as the body", ball(), vec![Layer::new("ball", band().mesh)], |e| {
            matches!(e, OutfitError::DuplicateName { .. })
        }),
        (
            "a sheet",
            Layer::new("ball", cloth(1.0, 1.0, 4, 4)),
            vec![],
            |e| matches!(e, OutfitError::NoInside { reason, .. } if reason.openings == 1),
        ),
        (
            "a garment",
            Layer::new("ball", tube(0.3, 0.6, 24, 8, false)),
            vec![],
            |e| matches!(e, OutfitError::NoInside { reason, .. } if reason.openings == 2),
        ),
        (
            "flat",
            Layer::new("ball", moved(&ball().mesh, |p| Point::new(p.x, 0.0, p.z))),
            vec![],
            |e| matches!(e, OutfitError::NoInside { .. }),
        ),
        (
            "far",
            ball(),
            vec![Layer::new("band", moved(&band().mesh, |p| Point::new(p.x + 5.0, p.y, p.z)))],
            |e| matches!(e, OutfitError::FarFromBody { distance, .. } if *distance > 4.0),
        ),
        ("millimetres", scaled(3000.0), vec![], |e| {
            matches!(e, OutfitError::Units { unit: "millimetres", .. })
        }),
        ("centimetres", scaled(300.0), vec![], |e| {
            matches!(e, OutfitError::Units { unit: "centimetres", .. })
        }),
        ("inches", scaled(40.0), vec![], |e| {
            matches!(e, OutfitError::Units { unit: "inches", .. })
        }),
    ];
    for (case, body, garments, expected) in cases {
        let error = Outfit::new(body.clone(), garments.clone()).unwrap_err();
        assert!(expected(&error), "{case}: {error:?}");
        assert!(error.to_string().contains('`'), "{case}: the message names the layer: {error}");
        let outfit = Outfit { body, garments };
        assert_eq!(verify(&outfit).unwrap_err(), error, "{case}");
        assert_eq!(resolved(&outfit).unwrap_err(), ResolveError::Outfit(error), "{case}");
    }
}

#[test]
fn a_mesh_of_faulty_numbers_is_refused_before_it_can_be_a_layer() {
    let v = || vec![Point::origin(), Point::new(1.0, 0.0, 0.0), Point::new(0.0, 1.0, 0.0)];
    for bad in [Real::NAN, Real::INFINITY, Real::NEG_INFINITY] {
        let mut vertices = v();
        vertices[1].z = bad;
        assert!(matches!(
            TriMesh::new(vertices, vec![[0, 1, 2]]),
            Err(MeshError::NonFinite { vertex: 1, axis: 2, .. })
        ));
    }
    assert!(matches!(
        TriMesh::new(v(), vec![[0, 1, 3]]),
        Err(MeshError::IndexOutOfRange { index: 3, .. })
    ));
    assert!(matches!(
        TriMesh::new(v(), vec![[0, 1, 1]]),
        Err(MeshError::RepeatedVertex { vertex: 1, .. })
    ));
}

#[test]
fn odd_but_usable_garments_end_clean_or_with_what_is_left() {
    let band = tube(0.295, 0.2, 32, 4, false);
    let with = |vertices: &[Point], triangles: &[[u32; 3]]| {
        let (mut v, mut t) = (band.vertices().to_vec(), band.triangles().to_vec());
        v.extend_from_slice(vertices);
        t.extend_from_slice(triangles);
        TriMesh::new(v, t).unwrap()
    };
    let n = band.vertices().len() as u32;
    let p = |x, y, z| Point::new(x, y, z);
    let one = TriMesh::new(
        vec![p(0.29, 0.0, 0.0), p(0.29, 0.05, 0.0), p(0.29, 0.0, 0.05)],
        vec![[0, 2, 1]],
    )
    .unwrap();
    let cases = [
        ("one triangle", one),
        ("a vertex that no triangle uses", with(&[p(0.1, 0.0, 0.0)], &[])),
        (
            "a triangle of zero area",
            with(&[p(0.3, 0.0, 0.0), p(0.31, 0.0, 0.0), p(0.32, 0.0, 0.0)], &[[n, n + 1, n + 2]]),
        ),
        ("three corners at one place", with(&[p(0.28, 0.0, 0.0); 3], &[[n, n + 1, n + 2]])),
        ("three triangles at an edge", with(&[p(0.35, 0.1, 0.0)], &[[0, 1, n]])),
        ("the same triangle twice", with(&[], &[band.triangles()[7]])),
        ("a triangle and its flip", with(&[], &[[0, 1, 32], [1, 0, 32]])),
        (
            "two islands",
            with(
                &[p(0.0, 0.31, 0.0), p(0.05, 0.29, 0.0), p(0.0, 0.29, 0.05)],
                &[[n, n + 2, n + 1]],
            ),
        ),
        ("closed", moved(&icosphere(0.297, 3), |q| *q)),
        ("a sheet through the body", cloth(0.8, 0.8, 12, 12)),
        (
            "a needle",
            with(
                &[p(-0.6, 0.05, 0.0), p(0.6, 0.05, 0.0), p(0.0, 0.05, 1e-9)],
                &[[n, n + 1, n + 2]],
            ),
        ),
    ];
    // A few rounds are enough to meet every code path; some of these cannot become clean.
    let mut params = ResolveParams::default();
    (params.effort.rounds, params.effort.settle_rounds) = (6, 3);
    let mut clean = Vec::new();
    for (case, mesh) in cases {
        let start = std::time::Instant::now();
        let outfit = outfit_with(mesh);
        let outcome = resolve(&outfit, &params, &mut Silent);
        clean.extend(outcome.is_ok().then_some(case));
        assert_clean_or_left(&outfit, outcome);
        println!("{case}: {:.1} s", start.elapsed().as_secs_f64());
    }
    println!("clean: {clean:?}");
    assert!(!clean.is_empty(), "each ended with what is left");
}

#[test]
fn a_garment_beside_the_body_is_left_alone() {
    let mut outfit = ball_in_tube("band", 0.31);
    outfit.garments[0].mesh = moved(&outfit.garments[0].mesh, |p| Point::new(p.x + 0.7, p.y, p.z));
    let result = resolved(&outfit).unwrap();
    assert_eq!(result.outfit, outfit);
}

fn refusal(change: impl Fn(&mut ResolveParams)) -> Option<String> {
    let mut params = ResolveParams::default();
    change(&mut params);
    match resolve(&ball_in_tube("band", 0.295), &params, &mut Silent) {
        Err(ResolveError::Parameter(error)) => {
            assert!(
                !error.range.is_empty() && (!error.value.is_finite() || error.value <= 0.0),
                "{error}"
            );
            Some(error.name.into_owned())
        }
        _ => None,
    }
}

#[test]
fn parameters_that_are_not_numbers_or_negative_are_refused_by_name() {
    type Set = fn(&mut ResolveParams, Real);
    let parameters: [(&str, Set); 15] = [
        ("goal.clearance", |p, x| p.goal.clearance = x),
        ("goal.tuck_distance", |p, x| p.goal.tuck_distance = x),
        ("goal.body_depth", |p, x| p.goal.body_depth = x),
        ("effort.influence", |p, x| p.effort.influence = x),
        ("effort.repair_influence", |p, x| p.effort.repair_influence = x),
        ("effort.contact_step", |p, x| p.effort.contact_step = x),
        ("effort.contact_margin", |p, x| p.effort.contact_margin = x),
        ("effort.max_push", |p, x| p.effort.max_push = x),
        ("effort.long_edge", |p, x| p.effort.long_edge = x),
        ("effort.outward_cell", |p, x| p.effort.outward_cell = x),
        ("effort.tolerance", |p, x| p.effort.tolerance = x),
        ("effort.gap_growth", |p, x| p.effort.gap_growth = x),
        ("cloth.stretch_compliance", |p, x| p.cloth.stretch_compliance = x),
        ("cloth.anchor_compliance", |p, x| p.cloth.anchor_compliance = x),
        ("cloth.fold_distance", |p, x| p.cloth.fold_distance = x),
    ];
    for (name, set) in parameters {
        for bad in [Real::NAN, Real::INFINITY, -1.0] {
            assert_eq!(refusal(|p| set(p, bad)).as_deref(), Some(name), "{name} = {bad}");
        }
    }
    assert_eq!(refusal(|p| p.effort.outward_cell = 0.0).as_deref(), Some("effort.outward_cell"));
}

#[test]
fn the_reference_lists_every_parameter_with_its_default() {
    let text = include_str!("../../docs/reference/parameters.md");
    let groups = serde_json::to_value(ResolveParams::default()).unwrap();
    let fields = groups.as_object().unwrap().values().flat_map(|g| g.as_object().unwrap());
    let mut listed = 0;
    for (name, value) in fields {
        let row = text.lines().find(|line| line.starts_with(&format!("| `{name}` |")));
        let row = row.unwrap_or_else(|| panic!("`{name}` is missing"));
        let default = row.split('|').nth(2).unwrap().trim().trim_matches('`');
        let read: serde_json::Value = serde_json::from_str(default).unwrap();
        let same = read == *value || read.as_f64().is_some_and(|d| value.as_f64() == Some(d));
        assert!(same, "`{name}` is {value}, the reference has {default}");
        listed += 1;
    }
    assert_eq!(text.lines().filter(|line| line.starts_with("| `")).count(), listed);
}

#[test]
fn garments_whose_edges_have_no_length_are_no_panic() {
    let points = |places: &[Point]| {
        let vertices = places.iter().flat_map(|p| [*p; 3]).collect();
        let triangles = (0..places.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        TriMesh::new(vertices, triangles).unwrap()
    };
    let p = Point::new;
    let collapsed = points(&[p(0.0, 0.0, 0.29), p(0.0, 0.1, 0.25)]);
    // Lengths whose squares are zero, and some that are not.
    let tiny = |size: Real| {
        let mut x = collapsed.vertices().to_vec();
        x[..3].copy_from_slice(&[p(0.0, 0.0, 0.0), p(size, 0.0, 0.0), p(0.0, size, 0.0)]);
        collapsed.with_vertices(x).unwrap()
    };
    for method in [Method::Contacts, Method::Paper] {
        let mut params = ResolveParams::default();
        params.effort.method = method;
        for garment in [collapsed.clone(), tiny(1e-160), tiny(1e-300), tiny(1e-15)] {
            match resolve(&outfit_with(garment), &params, &mut Silent) {
                Ok(found) => assert!(found.report.after.is_clean()),
                Err(ResolveError::Unresolved { .. }) => {}
                Err(other) => panic!("{other}"),
            }
        }
    }
}
