use super::*;
use crate::outfit::{Layer, Outfit};
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::{Cancelled, Monitor, Progress, Silent};
use if_core::shapes::meshes::{icosphere, tube};
use if_mesh::sdf::MeshSdf;
use if_mesh::solid::ClosedLayer;
use nalgebra::Rotation3;

pub(super) fn outfit(body: TriMesh, garments: Vec<TriMesh>) -> Outfit {
    let garment = |(k, mesh)| Layer::new(format!("garment {k}"), mesh);
    let garments = garments.into_iter().enumerate().map(garment).collect();
    Outfit::new(Layer::new("body", body), garments).unwrap()
}

/// A closed arm along y with its elbow at y = 0, and a sleeve over it.
pub(super) fn arm() -> Outfit {
    let shifted = |mesh: TriMesh, by: Real| {
        let moved = mesh.vertices().iter().map(|p| p + Vector::y() * by).collect();
        mesh.with_vertices(moved).unwrap()
    };
    let skin = shifted(tube(0.05, 0.6, 16, 24, true), -0.3);
    let sleeve = shifted(tube(0.056, 0.4, 16, 16, false), -0.2);
    outfit(skin, vec![sleeve])
}

/// The arm bent by `angle`, with weights that change over 4 cm.
pub(super) fn bent(points: &[Point], angle: Real) -> Vec<Point> {
    let turn = Rotation3::from_axis_angle(&Vector::z_axis(), angle);
    let bend = |p: &Point| {
        let share = (0.5 + p.y / 0.08).clamp(0.0, 1.0);
        p + (turn * p - p) * share
    };
    points.iter().map(bend).collect()
}

const BENT: Real = 2.4;

fn largest(a: &[Point], b: &[Point]) -> Real {
    a.iter().zip(b).map(|(a, b)| (b - a).norm()).fold(0.0, Real::max)
}

#[test]
fn an_arm_that_bends_into_itself_yields_and_its_sleeve_with_it() {
    let mut walker = Walker::new(&arm(), WalkParams::default()).unwrap();
    let rest = walker.rest().to_vec();
    let target = bent(&rest, BENT);
    let before = walker.prove(&target).unwrap();
    assert!(before.own_pairs[0] > 10 && before.new_own_pairs > 20, "{before:?}");
    assert_eq!(before.first_pairs.len(), 8);
    let walked = walker.walk(24, &|t| bent(&rest, t * BENT), &mut Silent).unwrap();
    assert_eq!((walked.reached, walked.unresolved.len()), (1.0, 0));
    let after = walker.prove(walker.positions()).unwrap();
    assert_eq!(after, Proof { own_pairs: vec![0, 0], ..Proof::default() });
    // Hand and shoulder are where they were to be; the elbow is not.
    let moved: Vec<Real> =
        walker.positions().iter().zip(&target).map(|(a, b)| (a - b).norm()).collect();
    let far = (0..rest.len()).filter(|v| rest[*v].y.abs() > 0.25);
    assert!(far.map(|v| moved[v]).fold(0.0, Real::max) < 2e-3);
    assert!(largest(walker.positions(), &target) > 5e-3);
    // Pushed straight, nothing is displaced any more.
    let walked = walker.walk(24, &|t| bent(&rest, (1.0 - t) * BENT), &mut Silent).unwrap();
    assert_eq!(walked.reached, 1.0);
    assert!(largest(walker.positions(), &rest) < 1e-3, "{}", largest(walker.positions(), &rest));
}

#[test]
fn a_garment_that_shrinks_into_the_body_stays_outside_and_moves_more_than_it() {
    let outfit = outfit(icosphere(0.5, 3), vec![icosphere(0.505, 3)]);
    let mut walker = Walker::new(&outfit, WalkParams::default()).unwrap();
    let rest = walker.rest().to_vec();
    let n = walker.layer(&rest, 0).len();
    let shrunk = |t: Real| {
        let garment = rest[n..].iter().map(|p| p * (1.0 - 0.02 * t));
        rest[..n].iter().copied().chain(garment).collect::<Vec<_>>()
    };
    let target = shrunk(1.0);
    let before = walker.prove(&target).unwrap();
    assert_eq!(before.inside, n, "no pair intersects, and all vertices are on the wrong side");
    walker.walk(4, &shrunk, &mut Silent).unwrap();
    assert_eq!(walker.prove(walker.positions()).unwrap().inside, 0);
    assert_eq!(walker.intersections(walker.positions()).unwrap().len(), 0);
    let [body, garment] = [0, 1].map(|layer| {
        largest(walker.layer(walker.positions(), layer), walker.layer(&target, layer))
    });
    assert!(garment > 5e-3 && body < 1e-7, "a body without overlaps keeps its place: {body}");
}

/// A ball of 15 cm, and a belt about its middle.
fn ball_and_belt(radius: Real) -> Outfit {
    outfit(icosphere(0.15, 3), vec![tube(radius, 0.04, 48, 2, false)])
}

#[test]
fn a_garment_deep_inside_the_body_is_on_the_wrong_side() {
    let inside = |outfit: &Outfit| {
        let walker = Walker::new(outfit, WalkParams::default()).unwrap();
        walker.prove(walker.rest()).unwrap().inside
    };
    let all = ball_and_belt(0.05).garments[0].mesh.vertices().len();
    assert_eq!(inside(&ball_and_belt(0.12)), all);
    // The nearest skin is 10 cm away.
    assert_eq!(inside(&ball_and_belt(0.05)), all);
    assert_eq!(inside(&ball_and_belt(0.16)), 0);
    assert_eq!(inside(&ball_and_belt(0.4)), 0);
}

#[test]
fn vertices_of_no_triangle_have_no_side() {
    let mut with_stray = ball_and_belt(0.16);
    let belt = &mut with_stray.garments[0].mesh;
    let stray = Point::new(0.0, 0.12, 0.0);
    let vertices = belt.vertices().iter().copied().chain([stray]).collect();
    *belt = TriMesh::new(vertices, belt.triangles().to_vec()).unwrap();
    let walker = Walker::new(&with_stray, WalkParams::default()).unwrap();
    assert_eq!(walker.prove(walker.rest()).unwrap().inside, 0);
}

#[test]
fn a_body_may_wind_inwards() {
    let flip = |t: &[u32; 3]| [t[0], t[2], t[1]];
    for radius in [0.12, 0.16] {
        let given = ball_and_belt(radius);
        let ball = &given.body.mesh;
        let flipped = ball.triangles().iter().map(flip).collect();
        let inward = TriMesh::new(ball.vertices().to_vec(), flipped).unwrap();
        let turned = outfit(inward, vec![given.garments[0].mesh.clone()]);
        let [a, b] = [given, turned].map(|outfit| {
            let walker = Walker::new(&outfit, WalkParams::default()).unwrap();
            (walker.prove(walker.rest()).unwrap(), walker.rest().to_vec())
        });
        assert_eq!(a, b);
    }
}

/// A tube of radius 0.2 with a lining of radius `inner`: one surface without an edge.
fn thick(tube: &TriMesh, inner: Real) -> TriMesh {
    let n = tube.vertices().len() as u32;
    let within =
        tube.vertices().iter().map(|p| Point::new(p.x * inner / 0.2, p.y, p.z * inner / 0.2));
    let vertices = tube.vertices().iter().copied().chain(within).collect();
    let lining = tube.triangles().iter().map(|t| [t[0] + n, t[2] + n, t[1] + n]);
    let rims = Edges::new(tube).boundary_loops(tube).into_iter().flat_map(|walk| {
        let next = [&walk[1..], &walk[..1]].concat();
        let sides = walk.into_iter().zip(next);
        sides.flat_map(|(a, b)| [[a + n, b, a], [b, a + n, b + n]]).collect::<Vec<_>>()
    });
    TriMesh::new(vertices, tube.triangles().iter().copied().chain(lining).chain(rims).collect())
        .unwrap()
}

#[test]
fn a_garment_tells_its_sides_however_it_is_wound_and_on_both_sides() {
    let flip = |t: &[u32; 3]| [t[0], t[2], t[1]];
    let body = tube(0.1, 1.0, 48, 24, true);
    let shirt = tube(0.2, 0.6, 48, 24, false);
    let n = shirt.vertices().len() as u32;
    let inwards: Vec<[u32; 3]> = shirt.triangles().iter().map(flip).collect();
    let mixed = shirt.triangles().iter().zip(&inwards).enumerate();
    let mixed = mixed.map(|(t, (a, b))| if t % 3 == 0 { *a } else { *b }).collect();
    let back = inwards.iter().map(|t| t.map(|v| v + n));
    let both = shirt.triangles().iter().copied().chain(back).collect();
    let twice = [shirt.vertices(), shirt.vertices()].concat();
    let shirts = [
        shirt.clone(),
        TriMesh::new(shirt.vertices().to_vec(), inwards).unwrap(),
        TriMesh::new(shirt.vertices().to_vec(), mixed).unwrap(),
        TriMesh::new(twice, both).unwrap(),
        thick(&shirt, 0.195),
    ];
    // Under the shirt's cloth, near it and near its hem, and beyond it.
    let at = |x: Real, y: Real| {
        let bead = icosphere(0.01, 1);
        let moved = bead.vertices().iter().map(|p| p + Vector::new(x, y, 0.0)).collect();
        bead.with_vertices(moved).unwrap()
    };
    for shirt in shirts {
        for (x, y, is_inside) in [(0.18, 0.3, true), (0.17, 0.05, true), (0.23, 0.3, false)] {
            let bead = at(x, y);
            let count = if is_inside { bead.vertices().len() } else { 0 };
            let outfit = outfit(body.clone(), vec![shirt.clone(), bead]);
            let walker = Walker::new(&outfit, WalkParams::default()).unwrap();
            assert_eq!(walker.prove(walker.rest()).unwrap().inside, count, "{x} {y}");
            assert_eq!(judged(&walker, &outfit, walker.rest()), (0, count), "{x} {y}");
        }
    }
}

#[test]
fn parts_hidden_in_the_body_hide_no_vertices() {
    let [skin, inner] = [icosphere(0.15, 3), icosphere(0.08, 3)];
    let n = skin.vertices().len() as u32;
    let more = inner.triangles().iter().map(|t| t.map(|v| v + n));
    let triangles = skin.triangles().iter().copied().chain(more).collect();
    let body = TriMesh::new([skin.vertices(), inner.vertices()].concat(), triangles).unwrap();
    let belt = ball_and_belt(0.1).garments[0].mesh.clone();
    let count = belt.vertices().len();
    let outfit = outfit(body, vec![belt]);
    let walker = Walker::new(&outfit, WalkParams::default()).unwrap();
    assert_eq!(walker.prove(walker.rest()).unwrap().inside, count);
}

#[test]
fn the_rest_state_is_as_clean_as_it_is_judged_alone() {
    // A vertex is drawn past its neighbours: the triangle that is folded over lies on the skin, and faces inwards.
    let ball = icosphere(0.15, 3);
    let mut vertices = ball.vertices().to_vec();
    let top = Point::new(0.0, 0.15, 0.0);
    let nearest = |p: &Point| {
        let far = |v: &usize| (ball.vertices()[*v] - p).norm();
        (0..vertices.len()).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap()
    };
    let first = nearest(&top);
    let edge = ball.mean_edge();
    let turned = Rotation3::from_axis_angle(&Vector::z_axis(), -1.8 * edge / 0.15);
    vertices[first] = turned * vertices[first] * 1.01;
    let body = ball.with_vertices(vertices).unwrap();
    // A piece of cloth 2 mm above.
    let cloth = icosphere(0.1535, 5);
    let is_near =
        |t: &[u32; 3]| t.iter().all(|v| (cloth.vertices()[*v as usize] - top).norm() < 0.04);
    let kept = cloth.triangles().iter().filter(|t| is_near(t)).copied().collect();
    let cloth = TriMesh::new(cloth.vertices().to_vec(), kept).unwrap();
    let field = MeshSdf::open(&body, Real::INFINITY).unwrap();
    let used = cloth.vertices().iter().zip(cloth.used_vertices()).filter(|(_, is_used)| *is_used);
    let behind =
        used.filter(|(p, _)| field.signed_within(p, 0.06).is_some_and(|s| s.distance < 0.0));
    assert!(behind.count() > 3, "the nearest triangle faces away from some");
    let outfit = outfit(body, vec![cloth]);
    let walker = Walker::new(&outfit, WalkParams::default()).unwrap();
    assert_eq!(judged(&walker, &outfit, walker.rest()), (0, 0));
    let proof = walker.prove(walker.rest()).unwrap();
    assert_eq!((proof.pairs, proof.inside), (0, 0), "{proof:?}");
    // What lies 5 mm deep is found as before.
    let n = outfit.body.mesh.vertices().len();
    let mut x = walker.rest().to_vec();
    x[n..].iter_mut().for_each(|p| *p *= 0.145 / 0.1535);
    assert!(walker.prove(&x).unwrap().inside > 100);
}

/// A body, a shirt that turns outwards and down at its top, 1 m up, and a tube over it.
fn collar_and_coat() -> (Walker, usize, Outfit) {
    let skin = tube(0.1, 1.6, 48, 64, true);
    let straight = tube(0.12, 0.6, 64, 24, false);
    let fold = |p: &Point| {
        let over = p.y - 0.5;
        let (r, y) = if over > 0.0 { (0.12 + 0.01, 0.5 - over) } else { (0.12, p.y) };
        Point::new(p.x * r / 0.12, y + 0.5, p.z * r / 0.12)
    };
    let shirt = straight.with_vertices(straight.vertices().iter().map(fold).collect()).unwrap();
    let coat = tube(0.14, 0.5, 64, 20, false);
    let raised = coat.vertices().iter().map(|p| p + Vector::y() * 0.6).collect();
    let outfit = outfit(skin, vec![shirt, coat.with_vertices(raised).unwrap()]);
    let walker = Walker::new(&outfit, WalkParams::default()).unwrap();
    let first_of_coat = walker.rest().len() - outfit.garments[1].mesh.vertices().len();
    (walker, first_of_coat, outfit)
}

/// Pairs and vertices inside in the outfit with the layers at `x`, judged as a single outfit is.
fn judged(walker: &Walker, outfit: &Outfit, x: &[Point]) -> (usize, usize) {
    let mut outfit = outfit.clone();
    for (k, garment) in outfit.garments.iter_mut().enumerate() {
        garment.mesh = garment.mesh.with_vertices(walker.layer(x, k + 1).to_vec()).unwrap();
    }
    let found = crate::verify(&outfit).unwrap();
    (found.total_pairs(), found.total_inside())
}

#[test]
fn what_lies_over_a_folded_collar_is_not_inside() {
    let (walker, n, outfit) = collar_and_coat();
    let rest = walker.rest().to_vec();
    assert_eq!(walker.prove(&rest).unwrap(), Proof { own_pairs: vec![0; 3], ..Proof::default() });
    // Pressed through the shirt without meeting it, the tube is inside.
    let inner = rest[n..].iter().map(|p| Point::new(p.x * 0.78, p.y, p.z * 0.78));
    let pressed: Vec<Point> = rest[..n].iter().copied().chain(inner).collect();
    let proof = walker.prove(&pressed).unwrap();
    assert!(proof.pairs == 0 && proof.inside > 500, "{proof:?}");
    // Some are named, by their numbers in the layer.
    assert_eq!((proof.first_pairs.len(), proof.first_inside.len()), (0, 8));
    let coat = outfit.garments[1].mesh.vertices().len();
    let is_of_coat = |v: &VertexInside| v.layer == 2 && v.below < 2 && (v.vertex as usize) < coat;
    assert!(proof.first_inside.iter().all(is_of_coat), "{proof:?}");
    assert_eq!(judged(&walker, &outfit, &rest), (0, 0));
    let (pairs, inside) = judged(&walker, &outfit, &pressed);
    assert!(pairs == 0 && inside > 500, "{inside}");
}

#[test]
fn vertices_whose_triangles_pass_over_a_collar_are_not_inside() {
    let (walker, n, outfit) = collar_and_coat();
    let mut x = walker.rest().to_vec();
    // Vertices of one row, ordered round the body, dip behind the collar.
    let mut row: Vec<usize> = (n..x.len()).filter(|v| (x[*v].y - 1.05).abs() < 1e-6).collect();
    row.sort_by(|a, b| x[*a].z.atan2(x[*a].x).total_cmp(&x[*b].z.atan2(x[*b].x)));
    let dip = |p: &Point| Point::new(p.x * 0.114 / 0.14, 0.997, p.z * 0.114 / 0.14);
    for v in [row[3], row[4]] {
        x[v] = dip(&x[v]);
        let proof = walker.prove(&x).unwrap();
        assert_eq!((proof.pairs, proof.inside), (0, 0));
        assert_eq!(judged(&walker, &outfit, &x), (0, 0));
    }
    let layer = |k: usize| outfit.garments[k].mesh.with_vertices(walker.layer(&x, k + 1).to_vec());
    let [body, shirt] = [&outfit.body.mesh, &layer(0).unwrap()];
    let closed = ClosedLayer::garment(shirt, &ClosedLayer::body(body), body);
    let is_behind = |v: &usize| closed.sided(&x[*v], 0.0).is_some_and(|s| s.distance < 0.0);
    assert!([row[3], row[4]].iter().all(is_behind), "voxels have the opening of a collar inside");
}

#[test]
fn a_body_that_is_kept_stays_as_given_and_cloth_meets_it_in_named_pinches_alone() {
    let mut walker = Walker::new(&arm(), WalkParams::default()).unwrap();
    let rest = walker.rest().to_vec();
    let target = bent(&rest, BENT);
    walker.walk(24, &|t| bent(&rest, t * BENT), &mut Silent).unwrap();
    let yielded = walker.positions().to_vec();
    let (kept, found) = walker.keep(&yielded, &target, &mut Silent).unwrap();
    let skin = walker.layer(&rest, 0).len();
    assert_eq!(kept[..skin], crate::storage::Storage::F32.round(&target[..skin]));
    assert_eq!((found.pairs, found.inside, found.new_own_pairs), (0, 0, 0), "{found:?}");
    assert!(found.own_pairs[0] > 10 && found.own_pairs[1] == 0, "the body meets itself as given");
    // What is named is what intersects, and lies in the bend of the elbow.
    let pinched = found.pinched.unwrap();
    let of_layers = |[a, b]: &&[(usize, u32); 2]| [a.0, b.0] == [0, 1];
    let all = walker.intersections(&kept).unwrap();
    let mut between: Vec<[u32; 2]> = all.iter().filter(of_layers).map(|p| p.map(|t| t.1)).collect();
    between.sort_unstable();
    let mut named = pinched.pairs[0].clone();
    named.sort_unstable();
    assert!(!between.is_empty() && named == between);
    let corners = |t: &u32| walker.scene.mesh.triangles()[*t as usize];
    let far = |v: u32| rest[v as usize].y.abs() > 0.22;
    assert!(pinched.body.iter().all(|t| !corners(t).into_iter().any(far)));
    // Cloth there is where it was between the sheets of a body that yields, within millimetres.
    for t in pinched.pairs[0].iter().map(|p| p[1] + walker.scene.triangle_starts[1] as u32) {
        for v in corners(&t) {
            assert!((kept[v as usize] - yielded[v as usize]).norm() < 0.01);
        }
    }
    // A walk from there takes nothing in pinches for verified.
    let mesh = walker.mesh(walker.positions()).unwrap();
    let mut known = walker.clean.known();
    known.update(&mesh, &walker.clean.tree, &walker.scene.fans);
    assert!(known.pairs.len() > 10);
    // Nothing moves: all stays known.
    known.update(&mesh, &walker.clean.tree, &walker.scene.fans);
    assert!(known.pairs.len() > 10);
    // Bent a little, there is room everywhere.
    let target = bent(&rest, 0.3);
    walker.restart(rest.clone()).unwrap();
    walker.walk(4, &|t| bent(&rest, t * 0.3), &mut Silent).unwrap();
    let state = walker.positions().to_vec();
    let (_, found) = walker.keep(&state, &target, &mut Silent).unwrap();
    assert!(found.pinched.unwrap().pairs[0].is_empty() && found.pairs + found.inside == 0);
}

#[test]
fn the_body_yields_near_its_own_overlaps_only() {
    let params = WalkParams { body_reach: 0.03, ..WalkParams::default() };
    let mut walker = Walker::new(&arm(), params).unwrap();
    let rest = walker.rest().to_vec();
    let target = bent(&rest, 1.8);
    let walked = walker.walk(18, &|t| bent(&rest, t * 1.8), &mut Silent).unwrap();
    assert_eq!((walked.reached, walked.wide), (1.0, 0));
    let pairs = walker.intersections(&target).unwrap();
    let met: Vec<Point> = pairs
        .iter()
        .flatten()
        .filter(|(layer, _)| *layer == 0)
        .flat_map(|(_, t)| walker.scene.mesh.triangles()[*t as usize])
        .map(|v| target[v as usize])
        .collect();
    let (mut held, mut most) = (0, Real::default());
    for (p, to) in walker.layer(walker.positions(), 0).iter().zip(&target) {
        let near = met.iter().map(|q| (q - to).norm()).fold(Real::INFINITY, Real::min);
        // Rounding to single precision is all that is left.
        if near > 0.0301 {
            held += 1;
            assert!((p - to).norm() < 1e-7, "{near} {}", (p - to).norm());
        } else {
            most = most.max((p - to).norm());
        }
    }
    // Held at places where it cannot stay, it yields there too, and the end is reached as before.
    let params = WalkParams { body_reach: 0.0, ..WalkParams::default() };
    let mut walker = Walker::new(&arm(), params).unwrap();
    let walked = walker.walk(8, &|t| bent(&rest, t * 1.8), &mut Silent).unwrap();
    assert_eq!(walked.reached, 1.0);
    assert!(held > 100 && most > 1e-3, "{held} {most}");
}

#[test]
fn a_clean_state_goes_towards_another_as_far_as_contacts_permit() {
    let outfit = outfit(icosphere(0.5, 3), vec![icosphere(0.505, 3)]);
    let mut walker = Walker::new(&outfit, WalkParams::default()).unwrap();
    let rest = walker.rest().to_vec();
    let n = walker.layer(&rest, 0).len();
    let scaled = |by: Real| {
        let garment = rest[n..].iter().map(|p| p * by);
        rest[..n].iter().copied().chain(garment).collect::<Vec<_>>()
    };
    // Nothing is in the way outwards.
    let wider = scaled(1.02);
    walker.approach(&rest, &wider, &rest, &mut Silent).unwrap();
    assert!(largest(walker.positions(), &wider) < 1e-6);
    // Inwards the body is: most of the 5 mm of room is used, and none that is not there.
    let tighter = scaled(0.98);
    let walked = walker.approach(&rest, &tighter, &rest, &mut Silent).unwrap();
    assert_eq!(walked.reached, 1.0);
    let gap = walker.positions()[n].coords.norm() - 0.5;
    assert!((0.25e-3..1e-3).contains(&gap), "{gap}");
    assert_eq!(walker.prove(walker.positions()).unwrap(), walker.prove(&rest).unwrap());
    assert!(walker.approach(&rest, &rest[1..], &rest, &mut Silent).is_err());
    // The body meets itself nowhere, and takes over less than a millimetre.
    let shifted: Vec<Point> = rest.iter().map(|p| p + Vector::new(5e-3, 0.0, 0.0)).collect();
    walker.approach(&rest, &shifted, &rest, &mut Silent).unwrap();
    let [body, garment] =
        [0, 1].map(|k| largest(walker.layer(&rest, k), walker.layer(walker.positions(), k)));
    assert!(body < 1e-3 && garment > 3e-3, "{body} {garment}");
}

#[test]
fn layers_that_nearly_touch_are_moved_apart_at_rest() {
    let outfit = outfit(icosphere(0.5, 3), vec![icosphere(0.50001, 3)]);
    let walker = Walker::new(&outfit, WalkParams::default()).unwrap();
    let [body, garment] = [0, 1].map(|layer| walker.layer(walker.rest(), layer));
    for (a, b) in body.iter().zip(garment) {
        let gap = (b - a).norm();
        assert!((0.8e-3..1.5e-3).contains(&gap), "{gap}");
    }
}

#[test]
fn a_walk_from_a_snapshot_has_the_same_bits() {
    let mut walker = Walker::new(&arm(), WalkParams::default()).unwrap();
    let rest = walker.rest().to_vec();
    walker.walk(12, &|t| bent(&rest, t * 1.8), &mut Silent).unwrap();
    let snapshot = walker.snapshot();
    let mut other = Walker::new(&arm(), WalkParams::default()).unwrap();
    other.restore(&snapshot).unwrap();
    let on = |walker: &mut Walker| {
        walker.walk(4, &|t| bent(&rest, 1.8 + 0.6 * t), &mut Silent).unwrap();
        walker.positions().to_vec()
    };
    assert_eq!(on(&mut walker), on(&mut other));
    // Bytes that are cut off or changed are errors, and nothing moves.
    for bytes in [&snapshot[..snapshot.len() - 1], &snapshot[1..], &[]] {
        assert!(other.restore(bytes).is_err());
    }
    let mut changed = snapshot.clone();
    changed[16..24].copy_from_slice(&Real::NAN.to_le_bytes());
    assert!(other.restore(&changed).unwrap_err().to_string().contains("not finite"));
}

#[test]
fn invalid_states_are_typed_errors() {
    let shell = |radius| icosphere(radius, 2);
    let crossing = outfit(shell(0.5), vec![tube(0.3, 0.9, 12, 4, false)]);
    let error = Walker::new(&crossing, WalkParams::default()).unwrap_err();
    assert!(
        matches!(&error, WalkError::NotClean { layers: [a, b], .. } if a == "body" && b == "garment 0"),
        "{error}"
    );
    let clean = outfit(shell(0.5), vec![shell(0.51)]);
    let error = Walker::new(&clean, WalkParams { gap: -1.0, ..WalkParams::default() });
    assert!(matches!(error, Err(WalkError::Parameter(_))));
    let mut walker = Walker::new(&clean, WalkParams::default()).unwrap();
    let rest = walker.rest().to_vec();
    let mut broken = rest.clone();
    broken[7].x = Real::NAN;
    let (got, expected) = (7, rest.len());
    let error = walker.walk(1, &|_| broken.clone(), &mut Silent);
    assert_eq!(error, Err(WalkError::Target { got, expected }));
    assert!(matches!(walker.restart(rest[1..].to_vec()), Err(WalkError::Target { .. })));
    struct Stop;
    impl Monitor for Stop {
        fn report(&mut self, _: &Progress<'_>) -> Result<(), Cancelled> {
            Err(Cancelled)
        }
    }
    let error = walker.walk(1, &|_| rest.clone(), &mut Stop);
    assert_eq!(error, Err(WalkError::Cancelled(Cancelled)));
}

#[test]
fn doubled_vertices_of_a_seam_move_as_one() {
    // The sleeve cut open along y: its seam has two columns of vertices.
    let mut layers = arm();
    let sleeve = layers.garments[0].mesh.clone();
    let (mut vertices, mut triangles) = (sleeve.vertices().to_vec(), sleeve.triangles().to_vec());
    let is_seam = |p: &Point| p.z.abs() < 1e-9 && p.x > 0.0;
    let doubled: Vec<u32> =
        (0..vertices.len() as u32).filter(|v| is_seam(&sleeve.vertices()[*v as usize])).collect();
    assert_eq!(doubled.len(), 17);
    for t in &mut triangles {
        let middle = t.iter().map(|v| sleeve.vertices()[*v as usize].z).sum::<Real>();
        for v in t.iter_mut().filter(|_| middle > 0.0) {
            if let Some(k) = doubled.iter().position(|d| d == v) {
                *v = (sleeve.vertices().len() + k) as u32;
            }
        }
    }
    vertices.extend(doubled.iter().map(|v| sleeve.vertices()[*v as usize]));
    layers.garments[0].mesh = TriMesh::new(vertices, triangles).unwrap();
    let mut walker = Walker::new(&layers, WalkParams::default()).unwrap();
    let rest = walker.rest().to_vec();
    walker.walk(8, &|t| bent(&rest, t * 1.2), &mut Silent).unwrap();
    let now = walker.layer(walker.positions(), 1);
    for (k, v) in doubled.iter().enumerate() {
        assert_eq!(now[*v as usize], now[sleeve.vertices().len() + k]);
    }
}
