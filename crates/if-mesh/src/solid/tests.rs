use super::*;
use crate::seams::weld;
use if_core::aabb::Aabb;
use if_core::field::SignedDistance;
use if_core::monitor::Silent;
use if_core::shapes::meshes::icosphere;

/// A ring of `n` quads between two profiles of (radius, height), front side outwards.
fn lathe(profile: &[(Real, Real)], n: u32) -> TriMesh {
    let mut v = Vec::new();
    for &(r, y) in profile {
        for k in 0..n {
            let a = Real::from(k) / Real::from(n) * std::f64::consts::TAU;
            v.push(Point::new(r * a.sin(), y, r * a.cos()));
        }
    }
    let mut t = Vec::new();
    for row in 0..profile.len() as u32 - 1 {
        for k in 0..n {
            let (a, b) = (row * n + k, row * n + (k + 1) % n);
            t.push([a, b, b + n]);
            t.push([a, b + n, a + n]);
        }
    }
    TriMesh::new(v, t).unwrap()
}

/// A closed spindle of radius 0.1 and height 1.6.
fn body() -> TriMesh {
    let rows: Vec<(Real, Real)> = (0..=40)
        .map(|k| {
            let u = Real::from(k) / 40.0;
            ((0.1 * (1.0 - (2.0 * u - 1.0).powi(8))).max(1e-4), 1.6 * u)
        })
        .collect();
    let open = lathe(&rows, 48);
    let (mut v, mut t) = (open.vertices().to_vec(), open.triangles().to_vec());
    let last = 40 * 48;
    v.push(Point::new(0.0, 0.0, 0.0));
    v.push(Point::new(0.0, 1.6, 0.0));
    let (bottom, top) = (v.len() as u32 - 2, v.len() as u32 - 1);
    for k in 0..48 {
        t.push([bottom, (k + 1) % 48, k]);
        t.push([top, last + k, last + (k + 1) % 48]);
    }
    let mesh = TriMesh::new(v, t).unwrap();
    assert!(mesh.signed_volume() > 0.0);
    mesh
}

fn check(layer: &ClosedLayer, cases: &[(Real, Real, Real)]) {
    for &(r, y, expected) in cases {
        for a in [0.1, 1.7, 4.0] {
            let p = Point::new(r * f64::sin(a), y, r * f64::cos(a));
            let got = layer.sided(&p, 0.5).map_or(Real::INFINITY, |s| s.distance);
            if expected < 0.0 {
                assert!(got < 0.0, "({r}, {y}) should be inside, got {got}");
            } else {
                assert!(got > 0.0, "({r}, {y}) should be outside, got {got}");
            }
        }
    }
}

#[test]
fn a_flared_skirt_has_an_inside_down_to_its_hem() {
    let mesh = body();
    let solid = ClosedLayer::body(&mesh);
    let skirt = lathe(&[(0.32, 0.5), (0.25, 0.7), (0.18, 0.9), (0.12, 1.0)], 64);
    // As given, with triangles of both windings, and with a back.
    let flip = |t: &[u32; 3]| [t[0], t[2], t[1]];
    let back: Vec<[u32; 3]> = skirt.triangles().iter().map(flip).collect();
    let mixed = skirt.triangles().iter().zip(&back).enumerate();
    let mixed = mixed.map(|(t, (a, b))| if t % 3 == 0 { *b } else { *a }).collect();
    let both = [skirt.triangles(), &back].concat();
    // With thickness: lined 5 mm further in, one surface without an edge.
    let rows = [(0.32, 0.5), (0.25, 0.7), (0.18, 0.9), (0.12, 1.0)];
    let lining = rows.iter().rev().map(|(r, y)| (r - 5e-3, *y));
    let closed: Vec<_> = rows.into_iter().chain(lining).chain([rows[0]]).collect();
    let thick = weld(&lathe(&closed, 64)).unwrap().mesh;
    assert!(Edges::new(&thick).boundary_loops(&thick).is_empty());
    let open = [mixed, both].map(|t| TriMesh::new(skirt.vertices().to_vec(), t).unwrap());
    for skirt in open.into_iter().chain([thick]) {
        let layer = ClosedLayer::garment(&skirt, &solid, &mesh);
        check(&layer, &[(0.2, 0.6, -1.0), (0.15, 0.52, -1.0), (0.29, 0.6, 1.0), (0.2, 0.4, 1.0)]);
    }
    let layer = ClosedLayer::garment(&skirt, &solid, &mesh);
    check(
        &layer,
        &[
            (0.2, 0.6, -1.0),
            (0.15, 0.52, -1.0),
            (0.29, 0.6, 1.0),
            (0.2, 0.95, 1.0),
            (0.2, 0.4, 1.0),
            (0.11, 1.05, 1.0),
            (0.11, 0.99, -1.0),
            // Within a voxel of the sheet the triangle's label decides.
            (0.2833, 0.6, -1.0),
            (0.2867, 0.6, 1.0),
        ],
    );
    let s = layer.sided(&Point::new(0.0, 0.6, 0.28), 0.1).unwrap();
    assert!(s.normal.z > 0.8 && s.distance < -1e-3 && s.distance > -0.01);
}

#[test]
fn a_folded_collar_is_part_of_the_inside_and_its_top_side_the_way_out() {
    let mesh = body();
    let solid = ClosedLayer::body(&mesh);
    // Up along the body, over a crease, and down again outside, 10 mm away: front becomes back.
    let collar = lathe(
        &[(0.12, 0.8), (0.115, 1.0), (0.112, 1.1), (0.117, 1.105), (0.122, 1.1), (0.128, 1.02)],
        64,
    );
    let layer = ClosedLayer::garment(&collar, &solid, &mesh);
    check(
        &layer,
        &[
            (0.14, 1.06, 1.0),
            (0.127, 1.06, 1.0),
            (0.118, 1.06, -1.0), // in the pocket
            (0.1145, 1.06, -1.0),
            (0.108, 1.05, -1.0), // between body and collar
            (0.13, 0.9, 1.0),
        ],
    );
    let s = layer.sided(&Point::new(0.0, 1.06, 0.118), 0.1).unwrap();
    assert!(s.normal.z > 0.9, "the way out of the pocket leads through the flap: {:?}", s.normal);
    let closure = layer.closure.as_ref().unwrap();
    assert!(closure.outside.contains(&[false; 2]), "triangles in the pocket");
}

#[test]
fn above_a_sharp_fold_is_outside_and_within_it_inside() {
    let mesh = body();
    let solid = ClosedLayer::body(&mesh);
    // Up along the body, and down again outside: one sheet has the body behind it and the pocket
    // before it, the other one the outside.
    let collar = lathe(&[(0.12, 0.8), (0.112, 1.0), (0.112, 1.1), (0.12, 1.05), (0.13, 1.02)], 64);
    let layer = ClosedLayer::garment(&collar, &solid, &mesh);
    check(
        &layer,
        &[
            (0.112, 1.101, 1.0),
            (0.1125, 1.101, 1.0),
            (0.1115, 1.102, 1.0),
            (0.1125, 1.103, 1.0),
            (0.1123, 1.097, -1.0),
        ],
    );
}

#[test]
fn the_space_between_a_trunk_and_a_sleeve_is_outside() {
    let beside = |mesh: &TriMesh, scale: Real| -> Vec<Point> {
        let place = |p: &Point| Point::new(scale * p.x + 0.24, p.y, scale * p.z);
        mesh.vertices().iter().map(place).collect()
    };
    let joined = |trunk: &TriMesh, arm: Vec<Point>| {
        let n = trunk.vertices().len() as u32;
        let more = trunk.triangles().iter().map(|t| t.map(|v| v + n));
        let triangles = trunk.triangles().iter().copied().chain(more).collect();
        TriMesh::new([trunk.vertices().to_vec(), arm].concat(), triangles).unwrap()
    };
    // The shirt lies 60 mm from the trunk, and 40 mm from the arm, over which its sleeve is.
    let mesh = joined(&body(), beside(&body(), 0.4));
    let rows: Vec<_> = (0..=30).map(|k| (0.16, 0.5 + 0.02 * Real::from(k))).collect();
    let trunk = lathe(&rows, 64);
    let shirt = joined(&trunk, beside(&trunk, 0.045 / 0.16));
    let layer = ClosedLayer::garment(&shirt, &ClosedLayer::body(&mesh), &mesh);
    for y in [0.6, 0.75, 1.0] {
        let side = |x: Real| layer.sided(&Point::new(x, y, 0.0), 0.5).unwrap().distance;
        for x in [0.164, 0.168, 0.172, 0.176, 0.18, 0.184, 0.188] {
            assert!(side(x) > 0.0, "{x}, {y}: {}", side(x));
        }
        assert!(side(0.12) < 0.0 && side(0.198) < 0.0, "{y}");
    }
}

#[test]
fn across_the_cap_of_a_skirt_the_field_jumps_and_says_so() {
    let mesh = body();
    let solid = ClosedLayer::body(&mesh);
    let skirt = lathe(&[(0.32, 0.5), (0.25, 0.7), (0.18, 0.9), (0.12, 1.0)], 64);
    let layer = ClosedLayer::garment(&skirt, &solid, &mesh);
    assert_eq!(ClothedField::new(vec![&solid]).lipschitz(), 1.0);
    let field = ClothedField::new(vec![&solid, &layer]);
    let [below, above] = [0.46, 0.54].map(|y| field.distance(&Point::new(0.2, y, 0.0)));
    assert!(below > 0.0 && above < 0.0 && below - above > 1.5 * 0.08, "{below} {above}");
    assert_eq!(field.lipschitz(), Real::INFINITY);
}

#[test]
fn a_vertex_just_inside_is_found_whatever_the_reach() {
    let mesh = body();
    let solid = ClosedLayer::body(&mesh);
    let skirt = lathe(&[(0.32, 0.5), (0.25, 0.7), (0.18, 0.9), (0.12, 1.0)], 64);
    let layer = ClosedLayer::garment(&skirt, &solid, &mesh);
    for reach in [0.0, 1e-4, 0.01, 1.0] {
        let inside = layer.sided(&Point::new(0.0, 0.6, 0.2840), reach);
        assert!(inside.is_some_and(|s| s.distance < 0.0), "{reach}: {inside:?}");
        let outside = layer.sided(&Point::new(0.0, 0.6, 0.2865), reach);
        assert!(outside.is_none_or(|s| s.distance > 0.0), "{reach}: {outside:?}");
        let in_body = solid.sided(&Point::new(0.0, 0.8, 0.0995), reach);
        assert!(in_body.is_some_and(|s| s.distance < 0.0));
    }
}

#[test]
fn the_union_of_layers_is_the_smaller_distance() {
    let mesh = body();
    let solid = ClosedLayer::body(&mesh);
    let skirt = lathe(&[(0.32, 0.5), (0.12, 1.0)], 64);
    let layer = ClosedLayer::garment(&skirt, &solid, &mesh);
    let both = ClothedField::new(vec![&solid, &layer]);
    let p = Point::new(0.0, 0.7, 0.4);
    assert_eq!(both.distance(&p), layer.sided(&p, 1.0).unwrap().distance);
    let q = Point::new(0.0, 1.3, 0.2);
    assert!(both.distance(&q) <= solid.sided(&q, 1.0).unwrap().distance);
    assert!(both.distance(&Point::new(0.0, 1.2, 0.0)) < 0.0);
}

#[test]
fn a_point_deep_inside_a_body_is_inside_whatever_the_reach() {
    let solid = ClosedLayer::body(&body());
    let s = solid.sided(&Point::new(0.0, 0.8, 0.0), 1e-3).unwrap();
    assert!(s.distance < -0.09 && s.distance > -0.11);
    assert!(solid.sided(&Point::new(0.0, 0.8, 0.5), 0.1).is_none());
}

#[test]
fn a_baked_clothed_body_agrees_with_its_source_where_it_is_not_cut() {
    let ball = ClosedLayer::body(&icosphere(0.2, 4));
    let field = ClothedField::new(vec![&ball]);
    let region = Aabb { min: Point::new(-0.25, -0.1, -0.25), max: Point::new(0.25, 0.1, 0.25) };
    let baked = field.baked(&region, 0.01, &mut Silent).unwrap();
    for k in 0..40 {
        let (a, r) = (0.157 * Real::from(k), 0.17 + 0.0012 * Real::from(k));
        let p = Point::new(r * a.cos(), 0.001 * Real::from(k), r * a.sin());
        // Where the cut is nearer than the surface, inside, the value is the cut's.
        let expected = field.distance(&p).max(p.y.abs() - 0.1).min(0.02);
        assert!(
            (baked.distance(&p) - expected).abs() < 1e-3,
            "{} for {expected}",
            baked.distance(&p)
        );
    }
}
