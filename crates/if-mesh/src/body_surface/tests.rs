use super::*;
use crate::sdf::MeshSdf;
use crate::solid::ClosedLayer;
use if_core::field::SignedDistance;
use if_core::shapes::meshes::{cloth, icosphere, torus, tube};

const HEIGHT: Real = 2.0;

fn ball() -> TriMesh {
    icosphere(0.5 * HEIGHT, 4)
}

fn without(mesh: &TriMesh, is_gone: impl Fn(usize, Point) -> bool) -> TriMesh {
    let middle = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        Point::from((a.coords + b.coords + c.coords) / 3.0)
    };
    let kept = (0..mesh.triangles().len()).filter(|t| !is_gone(*t, middle(*t)));
    let triangles = kept.map(|t| mesh.triangles()[t]).collect();
    TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap()
}

fn flipped(mesh: &TriMesh) -> TriMesh {
    let triangles = mesh.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap()
}

/// All meshes as one, each scaled and moved along x.
fn together(list: &[(&TriMesh, Real, Real)]) -> TriMesh {
    let (mut vertices, mut triangles): (Vec<Point>, Vec<[u32; 3]>) = (vec![], vec![]);
    for (mesh, scale, x) in list {
        let base = vertices.len() as u32;
        let moved = mesh.vertices().iter().map(|p| p * *scale + Vector::x() * *x);
        vertices.extend(moved);
        triangles.extend(mesh.triangles().iter().map(|t| t.map(|v| v + base)));
    }
    TriMesh::new(vertices, triangles).unwrap()
}

fn surface(mesh: &TriMesh) -> BodySurface {
    BodySurface::new(mesh, &Edges::new(mesh)).unwrap().expect("not closed")
}

fn random_points(n: usize, half: Real) -> Vec<Point> {
    let mut random = if_core::random::SplitMix64::new(7);
    (0..n).map(|_| Point::from([0; 3].map(|_| (2.0 * random.unit() - 1.0) * half))).collect()
}

/// Signed distances of `mesh` and of the whole ball agree within `error` at all points for which
/// `counts` holds; at the others nothing may be inside farther than the ball says.
fn agrees_with_ball(mesh: &TriMesh, error: Real, counts: impl Fn(&Point) -> bool) {
    let (whole, surface) = (MeshSdf::closed(&ball()).unwrap(), surface(mesh));
    let mut inside = 0;
    for p in random_points(3000, 0.6 * HEIGHT).iter().filter(|p| counts(p)) {
        let truth = whole.distance(p);
        let side = surface.side(p, Real::INFINITY).unwrap();
        let found = if side.inside { -side.near.distance } else { side.near.distance };
        assert!((truth - found).abs() <= error, "{p}: {found} for {truth}");
        inside += usize::from(found < 0.0);
    }
    assert!(inside > 200, "{inside}");
}

#[test]
fn a_closed_body_needs_nothing() {
    for mesh in [ball(), torus(0.5, 0.2, 32, 16)] {
        assert!(BodySurface::new(&mesh, &Edges::new(&mesh)).unwrap().is_none());
    }
    assert!(ClosedLayer::body(&icosphere(1.0, 1)).body_report().is_none());
}

#[test]
fn pinholes_count_as_skin() {
    // A second ball beside it makes the body 5 m long, and holes of 83 mm small.
    let both = together(&[(&ball(), 1.0, 0.0), (&ball(), 0.5, 3.5)]);
    let holed = without(&both, |t, _| t % 97 == 5);
    let report = surface(&holed).report().clone();
    assert!(report.holes.len() > 40 && report.holes.iter().all(|h| h.filled), "{report:?}");
    assert!(report.own_pairs == 0 && report.inner_parts == 0 && report.sheets == 0);
    assert!(report.notes()[0].contains("holes of up to"), "{:?}", report.notes());
    // A filled triangle bulges by less than its sagitta, 0.08² / 8.
    agrees_with_ball(&holed, 8e-4, |_| true);
}

#[test]
fn nothing_is_inside_where_a_cap_is_nearer_than_the_skin() {
    let headless = without(&ball(), |_, p| p.y > 0.8);
    let report = surface(&headless).report().clone();
    assert_eq!((report.holes.len(), report.openings().count()), (1, 1));
    approx::assert_relative_eq!(report.holes[0].size, 1.2, epsilon = 0.05);
    // Away from the opening all is as on the whole ball.
    agrees_with_ball(&headless, 1e-12, |p| p.y < 0.2 && p.coords.norm() > 0.6);
    let layer = ClosedLayer::body(&headless);
    let at = |x, y, z| layer.sided(&Point::new(x, y, z), Real::INFINITY).unwrap();
    // In the missing head, just below its place, and at the cap from below.
    for (x, y, z) in [(0.0, 0.95, 0.0), (0.4, 0.85, 0.1), (0.0, 0.75, 0.0)] {
        assert!(at(x, y, z).distance > 0.0, "{x} {y} {z}: {:?}", at(x, y, z));
    }
    assert!(at(0.0, -0.5, 0.1).distance < -0.4 && at(0.98, 0.05, 0.0).distance < 0.0);
    assert!(at(0.55, 0.9, 0.0).boundary, "a rim is an obstacle");
    assert_eq!(layer.voxel(&Point::new(0.0, 0.5, 0.0)), crate::voxels::Voxel::Inside);
}

#[test]
fn turned_doubled_and_loose_triangles_are_the_same_ball() {
    let whole = ball();
    let inverted = flipped(&whole);
    assert_eq!(surface(&inverted).report().turned_parts, 1);
    let mut mixed = whole.triangles().to_vec();
    mixed.iter_mut().step_by(7).for_each(|t| t.swap(0, 1));
    let mixed = TriMesh::new(whole.vertices().to_vec(), mixed).unwrap();
    assert_eq!(surface(&mixed).report().turned_triangles, whole.triangles().len().div_ceil(7));
    let both = [whole.triangles(), flipped(&whole).triangles()].concat();
    let both = TriMesh::new(whole.vertices().to_vec(), both).unwrap();
    assert_eq!(surface(&both).report().repeated_triangles, whole.triangles().len());
    let corners: Vec<Point> =
        whole.triangles().as_flattened().iter().map(|v| whole.vertices()[*v as usize]).collect();
    let jitter = |(k, p): (usize, &Point)| p + Vector::repeat((k % 5) as Real * 1e-6);
    let corners = corners.iter().enumerate().map(jitter).collect();
    let loose = (0..whole.triangles().len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    let loose = TriMesh::new(corners, loose.collect()).unwrap();
    let report = surface(&loose).report().clone();
    assert_eq!(report.merged_vertices, 3 * whole.triangles().len() - whole.vertices().len());
    assert!(report.holes.is_empty(), "{report:?}");
    for mesh in [&inverted, &mixed, &both] {
        agrees_with_ball(mesh, 1e-12, |_| true);
    }
    agrees_with_ball(&loose, 2e-5, |_| true);
}

#[test]
fn parts_inside_are_ignored_and_parts_that_poke_out_are_united() {
    let whole = ball();
    let eyes = together(&[(&whole, 1.0, 0.0), (&whole, 0.1, 0.4), (&flipped(&whole), 0.1, -0.4)]);
    let report = surface(&eyes).report().clone();
    assert_eq!((report.inner_parts, report.turned_parts, report.own_pairs), (2, 1, 0));
    agrees_with_ball(&eyes, 1e-12, |_| true);

    let small = icosphere(1.0, 3);
    let nose = together(&[(&whole, 1.0, 0.0), (&small, 0.3, 1.0)]);
    let report = surface(&nose).report().clone();
    assert!(report.own_pairs > 20 && report.hidden_triangles > 100, "{report:?}");
    let surface = surface(&nose);
    for p in random_points(4000, 1.4) {
        let truth = (p.coords.norm() - 1.0).min((p - Point::new(1.0, 0.0, 0.0)).norm() - 0.3);
        let found = surface.side(&p, Real::INFINITY).unwrap();
        // Chords lie up to 1.3e-3 (of 0.1 m) and 3e-3 below the spheres. Outside, distances are
        // exact; inside, the way out may be longer by a triangle near the intersection.
        if truth > 0.005 {
            assert!(!found.inside && (found.near.distance - truth).abs() < 0.005, "{p} {truth}");
        } else if truth < -0.005 {
            assert!(found.inside && found.near.distance > -truth - 0.005, "{p} {truth}");
            let out = found.near.point + (found.near.point - p) * 0.1;
            let beyond = surface.side(&out, Real::INFINITY).unwrap();
            assert!(!beyond.inside || beyond.near.distance < 0.02, "{p} {out}");
        }
    }
}

#[test]
fn two_overlapping_halves_are_one_ball() {
    let whole = ball();
    let (left, right) = (without(&whole, |_, p| p.x > 0.1), without(&whole, |_, p| p.x < -0.1));
    // The same vertices, and vertices of its own 2 mm farther out.
    agrees_with_ball(&together(&[(&left, 1.0, 0.0), (&right, 1.0, 0.0)]), 1e-12, |_| true);
    let apart = together(&[(&left, 1.0, 0.0), (&right, 1.002, 0.0)]);
    assert!(surface(&apart).report().openings().count() == 2);
    agrees_with_ball(&apart, 5e-3, |p| p.coords.norm() > 0.9);
}

#[test]
fn lashes_beside_a_body_have_no_side() {
    let card = cloth(0.3, 0.3, 4, 4);
    let haired = together(&[(&ball(), 1.0, 0.0), (&card, 1.0, 1.1)]);
    let report = surface(&haired).report().clone();
    assert_eq!((report.sheets, report.holes.len()), (1, 0));
    agrees_with_ball(&haired, 1e-12, |_| true);
}

#[test]
fn pieces_of_skin_beside_an_opening_have_a_front() {
    // The opening of a bowl, and a piece of the ball in the middle of it.
    let piece = |p: Point| p.y > 0.97;
    let mesh = without(&ball(), |_, p| p.y > 0.93 && !piece(p));
    let report = surface(&mesh).report().clone();
    assert_eq!((report.islands, report.sheets), (1, 0), "{report:?}");
    let layer = ClosedLayer::body(&mesh);
    for reach in [0.0, 1e-3, 1.0] {
        let at = |y| layer.sided(&Point::new(0.01, y, 0.02), reach);
        assert!(at(0.985).is_some_and(|s| s.distance < 0.0 && s.normal.y > 0.9), "{reach}");
        assert!(at(1.005).is_none_or(|s| s.distance > 0.0), "{reach}");
    }
}

#[test]
fn what_has_no_inside_is_refused() {
    let bowl = without(&ball(), |_, p| p.y > 0.0);
    let skirt = tube(0.3, 0.6, 24, 8, false);
    let folded = TriMesh::new(
        vec![Point::origin(), Point::new(1.0, 0.0, 0.0), Point::new(0.0, 1.0, 0.0)],
        vec![[0, 1, 2], [0, 2, 1]],
    );
    let half = without(&tube(0.3, 0.6, 24, 8, false), |_, p| p.x > 0.0);
    for (case, mesh) in [
        ("plane", cloth(1.0, 1.0, 4, 4)),
        ("skirt", skirt),
        ("folded", folded.unwrap()),
        ("half a tube", half),
    ] {
        let error = check(&mesh).unwrap_err();
        assert!(error.to_string().contains("no inside"), "{case}: {error}");
        // The layer of such a mesh exists all the same.
        assert!(ClosedLayer::body(&mesh).body_report().is_none());
    }
    assert!(check(&bowl).is_ok(), "a bowl has one");
}

#[test]
fn degenerate_input_has_an_answer() {
    let p = |k: u32| Point::new(f64::from(k % 3), f64::from(k / 3), f64::from(k % 5) * 0.1);
    let points: Vec<Point> = (0..9).map(p).collect();
    let mut random = if_core::random::SplitMix64::new(3);
    let mut soup = Vec::new();
    while soup.len() < 60 {
        let t = [0; 3].map(|_| (random.unit() * 9.0) as u32);
        if t[0] != t[1] && t[1] != t[2] && t[2] != t[0] {
            soup.push(t);
        }
    }
    let far = points.iter().map(|p| p + Vector::repeat(1e12)).collect();
    let one_place = vec![Point::origin(); 9];
    let mut astray = points.clone();
    astray[8] *= 1e150;
    for vertices in [points, far, one_place, astray] {
        let mesh = TriMesh::new(vertices, soup.clone()).unwrap();
        match BodySurface::new(&mesh, &Edges::new(&mesh)) {
            Ok(surface) => {
                let surface = surface.expect("a soup is not closed");
                for q in random_points(20, 2.0) {
                    let side = surface.side(&q, Real::INFINITY);
                    assert!(side.is_none_or(|s| !s.near.distance.is_nan()));
                }
                assert!(check(&mesh).is_ok());
            }
            Err(error) => assert_eq!(check(&mesh).map_err(|e| e.openings), Err(error.openings)),
        }
    }
}

#[test]
fn triangles_are_turned_outwards_in_their_places() {
    let ball = icosphere(0.5, 2);
    assert!(turned_outwards(&ball).is_none());
    let back = turned_outwards(&flipped(&ball)).unwrap();
    assert_eq!(back.vertices(), ball.vertices());
    let same =
        |a: &[u32; 3], b: &[u32; 3]| (0..3).any(|k| [a[k], a[(k + 1) % 3], a[(k + 2) % 3]] == *b);
    assert!(back.triangles().iter().zip(ball.triangles()).all(|(a, b)| same(a, b)));
    // A few that wind against the others, in a body with a hole.
    let mut mixed = ball.triangles()[1..].to_vec();
    [3, 40, 41].into_iter().for_each(|t| mixed[t].swap(1, 2));
    let mixed = TriMesh::new(ball.vertices().to_vec(), mixed).unwrap();
    let back = turned_outwards(&mixed).unwrap();
    assert!(back.triangles().iter().zip(&ball.triangles()[1..]).all(|(a, b)| same(a, b)));
    // What has no inside stays.
    let sheet = TriMesh::new(ball.vertices().to_vec(), ball.triangles()[..4].to_vec()).unwrap();
    assert!(turned_outwards(&sheet).is_none());
}

/// A closed tube, bent to a circle and a tenth more: its thin end lies in its thick beginning.
#[test]
fn one_closed_part_that_passes_into_itself_has_one_inside() {
    let thick = |s: Real| if s < 0.5 { 0.15 } else { 0.15 - 0.22 * (s - 0.5) };
    let middle = |s: Real| {
        let (sin, cos) = (2.2 * std::f64::consts::PI * s).sin_cos();
        (Point::new(0.5 * cos, 0.0, 0.5 * sin), Vector::new(cos, 0.0, sin))
    };
    let straight = tube(1.0, 1.0, 24, 120, true);
    let bent = straight.vertices().iter().map(|p| {
        let (at, out) = middle(p.y);
        at + (out * p.x + Vector::y() * p.z) * thick(p.y)
    });
    let bent = straight.with_vertices(bent.collect()).unwrap();
    let bent = if bent.signed_volume() > 0.0 { bent } else { flipped(&bent) };
    assert!(is_closed(&bent, &Edges::new(&bent)));
    assert!(surface(&bent).report().own_pairs > 20);
    let layer = ClosedLayer::body(&bent);
    let inside = |p: &Point| layer.sided(p, 0.0).is_some_and(|sided| sided.distance < 0.0);
    // Around the thin end, beyond its skin, and within it.
    for (k, s) in (0..40).map(|k| (k, 0.945 + 0.001 * Real::from(k % 10))) {
        let (at, out) = middle(s);
        let (sin, cos) = Real::from(k).sin_cos();
        for beyond in [0.5, 1.3] {
            let p = at + (out * cos + Vector::y() * sin) * (beyond * thick(s));
            assert!(inside(&p), "{p} at {s}, {beyond}");
        }
    }
    assert!(!inside(&Point::origin()) && !inside(&(middle(0.75).0 + Vector::y() * 0.2)));
}

#[test]
fn two_copies_of_a_sheet_are_no_closed_body_whatever_rounding_leaves() {
    let sheet = ball();
    let twice = |at: Real| {
        let shifted: Vec<Point> =
            sheet.vertices().iter().map(|p| p + Vector::new(at, 0.7 * at, -0.3 * at)).collect();
        let both = [sheet.triangles(), flipped(&sheet).triangles()].concat();
        TriMesh::new(shifted, both).unwrap()
    };
    let meshes: Vec<TriMesh> = (0..40).map(|k| twice(0.0137 * Real::from(k))).collect();
    assert!(meshes.iter().any(|mesh| mesh.signed_volume() > 0.0), "rounding leaves some volume");
    assert!(meshes.iter().all(|mesh| !is_closed(mesh, &Edges::new(mesh))));
    assert!(is_closed(&sheet, &Edges::new(&sheet)));
}
