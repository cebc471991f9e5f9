use super::*;
use crate::mannequin::{Garment, MannequinParams, body, garment};
use crate::skin_weights::SkinError;
use if_core::shapes::meshes::cloth;
use if_mesh::measure::{displacement, strain};
use if_mesh::solid::ClosedLayer;

const COARSE: MannequinParams = MannequinParams { resolution: 0.7, overlap: 0.0 };

/// Another person: taller, wider, with a larger belly.
fn grown(p: &Point) -> Point {
    let belly = 0.03 * (-((p.y - 1.05) / 0.15).powi(2)).exp();
    Point::new(p.x * (1.08 + belly), p.y * 1.06, p.z * (1.1 + 3.0 * belly) + belly * 0.3)
}

fn other(mesh: &TriMesh) -> TriMesh {
    mesh.with_vertices(mesh.vertices().iter().map(grown).collect()).unwrap()
}

fn shape(mesh: &TriMesh) -> BodyShape<'_> {
    BodyShape { mesh, skin: None, template: None, skeleton: None }
}

fn inside(body: &TriMesh, garment: &TriMesh) -> Real {
    let layer = ClosedLayer::body(body);
    let inside = garment
        .vertices()
        .iter()
        .filter(|p| layer.sided(p, 0.0).is_some_and(|s| s.distance < 0.0))
        .count();
    inside as Real / garment.vertices().len() as Real
}

#[test]
fn on_the_same_body_nothing_moves() {
    let (body, shirt) = (body(&COARSE), garment(Garment::Tshirt, &COARSE));
    let map = BodyMap::new(&shape(&body), &shape(&body), &AlignParams::default()).unwrap();
    assert_eq!((map.method(), map.residual()), (Method::Same, 0.0));
    assert_eq!(map.align(&shirt, None).unwrap(), shirt);
}

#[test]
fn on_a_person_of_another_size_garments_have_that_size() {
    let from = body(&COARSE);
    let smaller = |p: &Point| Point::from(p.coords * 0.7);
    let scaled =
        |mesh: &TriMesh| mesh.with_vertices(mesh.vertices().iter().map(smaller).collect()).unwrap();
    let to = scaled(&from);
    let map = BodyMap::new(&shape(&from), &shape(&to), &AlignParams::default()).unwrap();
    let coat = garment(Garment::Coat, &COARSE);
    let off = displacement(scaled(&coat).vertices(), map.align(&coat, None).unwrap().vertices());
    // The offsets of the skin alone would fold the coat between the legs.
    assert!(off.max < 1e-9, "{off:?}");
}

#[test]
fn garments_follow_a_body_of_the_same_topology_there_and_back() {
    let from = body(&COARSE);
    let to = other(&from);
    let params = AlignParams::default();
    let there = BodyMap::new(&shape(&from), &shape(&to), &params).unwrap();
    let back = BodyMap::new(&shape(&to), &shape(&from), &params).unwrap();
    assert_eq!(there.method(), Method::Topology);
    for kind in [Garment::Tshirt, Garment::Skirt, Garment::Coat] {
        let mesh = garment(kind, &COARSE);
        let moved = there.align(&mesh, None).unwrap();
        assert!(
            inside(&to, &moved) <= inside(&from, &mesh) + 0.01,
            "{kind:?} {}",
            inside(&to, &moved)
        );
        // The map of the body is smooth, so it is known what the garment should do; farther from
        // the body the ease follows one scale for all directions.
        let truth: Vec<Point> = mesh.vertices().iter().map(grown).collect();
        let off = displacement(&truth, moved.vertices());
        let again = back.align(&moved, None).unwrap();
        let round = displacement(mesh.vertices(), again.vertices());
        let strain = strain(&other(&mesh), moved.vertices());
        assert!(
            off.mean < 0.005 && round.mean < 0.5e-3 && round.p95 < 1e-3,
            "{kind:?} {off:?} {round:?}"
        );
        assert!(strain.rms < 0.025, "{kind:?} {strain:?}");
    }
}

#[test]
fn other_diagonals_keep_the_topology_and_other_vertex_numbers_do_not() {
    let mesh = body(&COARSE);
    // A tenth of the triangles turns its edge with a neighbour.
    let edges = Edges::new(&mesh);
    let mut triangles = mesh.triangles().to_vec();
    let mut turned = vec![false; triangles.len()];
    for (e, [s, t]) in edges.triangles.iter().enumerate().step_by(30) {
        let (s, t) = (*s as usize, *t as usize);
        if turned[s] || turned[t] {
            continue;
        }
        let [a, b] = edges.vertices[e];
        let apex = |t: usize| *mesh.triangles()[t].iter().find(|v| **v != a && **v != b).unwrap();
        (triangles[s], triangles[t]) = ([apex(s), apex(t), a], [apex(s), apex(t), b]);
        (turned[s], turned[t]) = (true, true);
    }
    let other = TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap();
    assert!(other.triangles() != mesh.triangles() && share_topology(&mesh, &other));
    let backwards =
        mesh.triangles().iter().map(|t| t.map(|v| mesh.vertices().len() as u32 - 1 - v)).collect();
    assert!(!share_topology(&mesh, &TriMesh::new(mesh.vertices().to_vec(), backwards).unwrap()));
    assert!(!share_topology(&TriMesh::default(), &TriMesh::default()));
}

#[test]
fn a_body_of_another_topology_is_registered() {
    let from = body(&COARSE);
    let to = other(&body(&MannequinParams { resolution: 0.9, ..COARSE }));
    let params = AlignParams::default();
    let map = BodyMap::new(&shape(&from), &shape(&to), &params).unwrap();
    assert_eq!(map.method(), Method::Registered);
    assert!(map.residual() < 0.002, "{}", map.residual());
    let mesh = garment(Garment::Tshirt, &COARSE);
    let truth: Vec<Point> = mesh.vertices().iter().map(grown).collect();
    let error = |map: &BodyMap| displacement(&truth, map.align(&mesh, None).unwrap().vertices());
    let similar = BodyMap::similar(&shape(&from), &shape(&to), &params).unwrap();
    assert_eq!(similar.method(), Method::Similarity);
    assert!(
        error(&map).mean < 0.01 && error(&map).mean < error(&similar).mean,
        "{:?}",
        error(&map)
    );
}

#[test]
fn seams_of_a_body_change_no_registration() {
    let from = body(&COARSE);
    let to = other(&body(&MannequinParams { resolution: 0.9, ..COARSE }));
    let corners = from.triangles().as_flattened().iter();
    let corners: Vec<Point> = corners.map(|v| from.vertices()[*v as usize]).collect();
    let own = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let soup = TriMesh::new(corners, own).unwrap();
    let mesh = garment(Garment::Tshirt, &COARSE);
    let aligned = |from: &TriMesh| {
        let map = BodyMap::new(&shape(from), &shape(&to), &AlignParams::default()).unwrap();
        assert_eq!(map.method(), Method::Registered);
        map.align(&mesh, None).unwrap()
    };
    let off = displacement(aligned(&from).vertices(), aligned(&soup).vertices());
    // Cloth is carried by normals of the body's vertices, which are those of single triangles here.
    assert!(off.mean < 0.5e-3 && off.max < 2e-3, "{off:?}");
}

#[test]
fn a_bone_of_no_length_moves_as_the_body_does() {
    use crate::mannequin::rig;
    let from = body(&COARSE);
    let to = other(&from);
    let skin = rig::skin_weights(from.vertices());
    let skeleton = rig::skeleton();
    let without_tails = |j: &crate::Joint| crate::Joint {
        tail: if j.name.ends_with("forearm") { j.head } else { j.tail },
        ..j.clone()
    };
    let bare = skeleton.joints().iter().map(without_tails).collect();
    let bare = crate::Skeleton::new(bare).unwrap();
    let with = |skeleton| BodyShape { skin: Some(&skin), skeleton: Some(skeleton), ..shape(&from) };
    let target = BodyShape { skeleton: Some(&bare), ..shape(&to) };
    let like = similarity::Similarity::between(&with(&skeleton), &target).unwrap();
    let start = similarity::start(&with(&skeleton), &target, &like);
    let spread = |points: &[Point]| {
        let hand = from.vertices().iter().zip(points).filter(|(p, _)| p.x > 0.6);
        if_core::aabb::Aabb::from_points(hand.map(|(_, q)| q)).size().norm()
    };
    assert!(spread(&start) > 0.5 * spread(from.vertices()), "{}", spread(&start));
}

#[test]
fn a_body_of_another_topology_that_faces_another_way_is_registered() {
    use crate::mannequin::rig;
    let from = body(&COARSE);
    let (skin, skeleton) = (rig::skin_weights(from.vertices()), rig::skeleton());
    let mesh = garment(Garment::Tshirt, &COARSE);
    let map = |degrees: Real, has_bones: bool| {
        let all = nalgebra::Rotation3::from_axis_angle(&Vector::y_axis(), degrees.to_radians());
        let there = |p: &Point| all * grown(p);
        let to = body(&MannequinParams { resolution: 0.9, ..COARSE });
        let to = to.with_vertices(to.vertices().iter().map(there).collect()).unwrap();
        let turned = |j: &crate::Joint| crate::Joint {
            head: there(&j.head),
            tail: there(&j.tail),
            ..j.clone()
        };
        let other = crate::Skeleton::new(skeleton.joints().iter().map(turned).collect()).unwrap();
        let bones = |skeleton| has_bones.then_some(skeleton);
        let from = BodyShape { skin: Some(&skin), skeleton: bones(&skeleton), ..shape(&from) };
        let to = BodyShape { skeleton: bones(&other), ..shape(&to) };
        let map = BodyMap::new(&from, &to, &AlignParams::default()).unwrap();
        assert_eq!(map.method(), Method::Registered, "{degrees}");
        let truth: Vec<Point> = mesh.vertices().iter().map(there).collect();
        displacement(&truth, map.align(&mesh, None).unwrap().vertices()).mean
    };
    for has_bones in [true, false] {
        let alike = map(0.0, has_bones);
        for degrees in [-60.0, 180.0] {
            let off = map(degrees, has_bones);
            assert!(off < 1.01 * alike, "{degrees} {has_bones}: {off} {alike}");
        }
    }
}

#[test]
fn the_bone_that_is_turned_the_most_tells_another_pose() {
    use crate::mannequin::rig;
    use nalgebra::{Rotation3, Unit};
    let body = body(&COARSE);
    let skeleton = rig::skeleton();
    // All face another way, and one shin is bent.
    let all = Rotation3::from_axis_angle(&Vector::y_axis(), 1.2);
    let across = Unit::new_normalize(all * Vector::x());
    let turned = |j: &crate::Joint| {
        let [head, tail] = [j.head, j.tail].map(|p| all * p);
        let bent = Rotation3::from_axis_angle(&across, 0.7) * (tail - head);
        let tail = if j.name == "left_shin" { head + bent } else { tail };
        crate::Joint { head, tail, ..j.clone() }
    };
    let other = crate::Skeleton::new(skeleton.joints().iter().map(turned).collect()).unwrap();
    let there = body.with_vertices(body.vertices().iter().map(|p| all * p).collect()).unwrap();
    let map = |skeleton| {
        let from = BodyShape { skeleton: Some(&skeleton), ..shape(&body) };
        let to = BodyShape { skeleton: Some(&other), ..shape(&there) };
        BodyMap::new(&from, &to, &AlignParams::default()).unwrap()
    };
    let found = map(skeleton);
    let (bone, angle) = found.most_turned().unwrap();
    assert!(bone == "left_shin" && (angle - 0.7).abs() < 0.02, "{bone} {angle}");
    let from = BodyMap::new(&shape(&body), &shape(&there), &AlignParams::default()).unwrap();
    assert_eq!(from.most_turned(), None);
}

/// A mannequin that strides with raised arms, and what garments do that are skinned as it is.
fn striding(body: &TriMesh) -> (TriMesh, impl Fn(&TriMesh) -> TriMesh) {
    use crate::mannequin::rig;
    use crate::skinning::{blends, pose_points, transferred_weights};
    use nalgebra::UnitQuaternion;
    let skeleton = rig::skeleton();
    let mut pose = crate::Pose::rest(skeleton.len());
    let mut turn = |name: &str, axis, angle: Real| {
        let joint = skeleton.names().position(|n| n == name).unwrap();
        pose.rotations[joint] = UnitQuaternion::from_axis_angle(&axis, angle);
    };
    turn("left_arm", Vector::z_axis(), 0.6);
    turn("right_arm", Vector::z_axis(), -0.6);
    turn("left_thigh", Vector::x_axis(), -0.5);
    turn("right_thigh", Vector::x_axis(), 0.4);
    let skin = rig::skin_weights(body.vertices());
    let transforms = skeleton.transforms(&pose).unwrap();
    let there = pose_points(body.vertices(), &blends(&skin, &transforms));
    let rest = body.clone();
    let skinned = move |garment: &TriMesh| {
        let own = transferred_weights(&rest, &skin, garment, skeleton.len()).unwrap();
        let posed = pose_points(garment.vertices(), &blends(&own, &transforms));
        garment.with_vertices(posed).unwrap()
    };
    (body.with_vertices(there).unwrap(), skinned)
}

#[test]
fn surfaces_in_another_pose_tell_no_heading() {
    let body = body(&COARSE);
    let (there, _) = striding(&body);
    let about = |degrees: Real| {
        nalgebra::Rotation3::from_axis_angle(&Vector::y_axis(), degrees.to_radians())
    };
    for degrees in [0.0, 90.0, 180.0] {
        let turn = about(degrees);
        let faces = |mesh: &TriMesh| {
            let turned = mesh.vertices().iter().map(|p| turn * p).collect();
            heading::of_surfaces(&body, &mesh.with_vertices(turned).unwrap(), 1.0)
        };
        assert_eq!(faces(&there), about(0.0), "{degrees}");
        assert!(faces(&other(&body)).angle_to(&turn) < 1e-9, "{degrees}");
    }
}

#[test]
fn garments_go_into_another_pose_as_skinning_takes_them_and_no_more_strained() {
    let from = body(&COARSE);
    let (to, skinned) = striding(&from);
    let map = BodyMap::new(&shape(&from), &shape(&to), &AlignParams::default()).unwrap();
    // With one similarity for the ease, the two were 7.5 and 8.4 mm from their twins.
    for (kind, most) in [(Garment::Tshirt, 0.005), (Garment::Trousers, 0.0025)] {
        let mesh = garment(kind, &COARSE);
        let (moved, twin) = (map.align(&mesh, None).unwrap(), skinned(&mesh));
        let off = displacement(twin.vertices(), moved.vertices());
        assert!(off.mean < most, "{kind:?} {off:?}");
    }
    // Between the legs the map follows now one and now the other.
    let coat = garment(Garment::Coat, &COARSE);
    let [mapped, moved, twin] = [
        map.map_points(coat.vertices(), None).unwrap(),
        map.align(&coat, None).unwrap().vertices().to_vec(),
        skinned(&coat).vertices().to_vec(),
    ]
    .map(|points| strain(&coat, &points));
    assert!(mapped.max > 3.0 && moved.max < 1.0, "{mapped:?} {moved:?}");
    assert!(moved.rms < twin.rms, "{moved:?} {twin:?}");
}

#[test]
fn seams_of_a_garment_are_no_intersections_of_it() {
    let body = body(&COARSE);
    let closed = ClosedLayer::body(&body);
    let map = BodyMap::new(&shape(&body), &shape(&body), &AlignParams::default()).unwrap();
    let of = |garment: &TriMesh| measure(&map, (garment, &closed), (garment, &closed)).own_pairs;
    // As exporters write it, each triangle with vertices of its own; and a copy that crosses it.
    let trousers = garment(Garment::Trousers, &COARSE);
    let corners = |by: Real| {
        let all = trousers.triangles().as_flattened().iter();
        all.map(|v| trousers.vertices()[*v as usize] + Vector::x() * by).collect::<Vec<Point>>()
    };
    let soup = |corners: Vec<Point>| {
        let n = corners.len() as u32 / 3;
        TriMesh::new(corners, (0..n).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()).unwrap()
    };
    assert_eq!(of(&soup(corners(0.0))), 0);
    assert!(of(&soup([corners(0.0), corners(0.02)].concat())) > 100);
}

#[test]
fn without_a_good_registration_a_similarity_is_used() {
    let from = body(&COARSE);
    // A ball of the same height.
    let ball = if_core::shapes::meshes::icosphere(0.85, 3);
    let map = BodyMap::new(
        &shape(&from),
        &shape(&ball),
        &AlignParams { poor: 1e-5, ..Default::default() },
    )
    .unwrap();
    assert_eq!(map.method(), Method::Similarity);
    let feet = map.map_points(&[Point::new(0.0, from.aabb().min.y, 0.0)], None).unwrap()[0];
    approx::assert_relative_eq!(feet.y, -0.85, epsilon = 1e-9);
}

#[test]
fn a_sleeve_follows_its_arm_and_not_the_trunk_beside_it() {
    // Two sheets 4 cm apart; one moves, the other does not. A point between them belongs to one by
    // its weights.
    let grid = |x: Real| {
        (0..400).map(move |k| Point::new(x, Real::from(k / 20) * 0.01, Real::from(k % 20) * 0.01))
    };
    let points: Vec<Point> = grid(0.0).chain(grid(0.04)).collect();
    let moved: Vec<Point> = grid(0.0).chain(grid(0.14)).collect();
    let cells = (0..800u32).filter(|k| k % 20 < 19 && k % 400 < 380);
    let triangles: Vec<[u32; 3]> =
        cells.flat_map(|k| [[k, k + 1, k + 20], [k + 20, k + 1, k + 21]]).collect();
    let (from, to) =
        (TriMesh::new(points, triangles.clone()).unwrap(), TriMesh::new(moved, triangles).unwrap());
    let one = |joint: u16, n: usize| (vec![[joint, 0, 0, 0]; n], vec![[1.0f32, 0.0, 0.0, 0.0]; n]);
    let ((mut joints, mut weights), (j, w)) = (one(0, 400), one(1, 400));
    joints.extend(j);
    weights.extend(w);
    let skin = SkinWeights::new(joints, weights, 2).unwrap();
    let shape = |mesh| BodyShape { mesh, skin: Some(&skin), template: None, skeleton: None };
    let map = BodyMap::new(
        &shape(&from),
        &shape(&to),
        &AlignParams { skin_floor: 1e-6, ..Default::default() },
    )
    .unwrap();
    let p = [Point::new(0.02, 0.1, 0.1)];
    let of = |joint| {
        let (j, w) = one(joint, 1);
        map.map_points(&p, Some(&SkinWeights::new(j, w, 2).unwrap())).unwrap()[0].x
    };
    approx::assert_relative_eq!(of(0), 0.02, epsilon = 1e-4);
    approx::assert_relative_eq!(of(1), 0.12, epsilon = 1e-4);
    // Without weights it is halfway between.
    let x = map.map_points(&p, None).unwrap()[0].x;
    assert!((0.05..0.09).contains(&x), "{x}");
}

#[test]
fn weights_of_a_body_with_seams_are_those_of_its_vertices() {
    // Two sheets 4 cm apart, of which the second moves by 10 cm. All triangles of the first have
    // vertices of their own, so that those of the second have other numbers once seams are closed.
    let (first, second) = (cloth(0.2, 0.2, 20, 20), cloth(0.2, 0.2, 20, 20));
    let corners = first.triangles().as_flattened().iter();
    let mut points: Vec<Point> = corners.map(|v| first.vertices()[*v as usize]).collect();
    let n = points.len();
    points.extend(second.vertices().iter().map(|p| p + Vector::z() * 0.04));
    let own = (0..n as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    let others = second.triangles().iter().map(|t| t.map(|v| v + n as u32));
    let triangles: Vec<[u32; 3]> = own.chain(others).collect();
    let moved = |(v, p): (usize, &Point)| if v < n { *p } else { p + Vector::z() * 0.1 };
    let to = TriMesh::new(points.iter().enumerate().map(moved).collect(), triangles.clone());
    let (from, to) = (TriMesh::new(points, triangles).unwrap(), to.unwrap());
    let skin = |joints: Vec<u16>| {
        let rows = joints.iter().map(|joint| [*joint, 0, 0, 0]).collect();
        SkinWeights::new(rows, vec![[1.0, 0.0, 0.0, 0.0]; joints.len()], 2).unwrap()
    };
    let body = skin((0..from.vertices().len()).map(|v| u16::from(v >= n)).collect());
    let shape = |mesh| BodyShape { mesh, skin: Some(&body), template: None, skeleton: None };
    let params = AlignParams { skin_floor: 1e-6, ..Default::default() };
    let map = BodyMap::new(&shape(&from), &shape(&to), &params).unwrap();
    assert_eq!(map.method(), Method::Topology);
    // Halfway between both: it goes with the sheet that has its joint.
    let between = [Point::new(0.1, 0.1, 0.02)];
    for (joint, height) in [(0, 0.02), (1, 0.12)] {
        let found = map.map_points(&between, Some(&skin(vec![joint]))).unwrap();
        approx::assert_relative_eq!(found[0].z, height, epsilon = 1e-4);
    }
}

#[test]
fn invalid_bodies_parameters_and_weights_are_errors() {
    let body = body(&COARSE);
    let empty = TriMesh::default();
    let params = AlignParams::default();
    let error = BodyMap::new(&shape(&body), &shape(&empty), &params).unwrap_err();
    assert!(matches!(error, AlignError::NoSurface { which: "target" }), "{error}");
    let cloud = TriMesh::new(body.vertices().to_vec(), vec![]).unwrap();
    for error in [
        BodyMap::new(&shape(&cloud), &shape(&body), &params),
        BodyMap::similar(&shape(&cloud), &shape(&body), &params),
    ] {
        assert_eq!(error.unwrap_err(), AlignError::NoSurface { which: "source" });
    }
    let flat = body
        .with_vertices(body.vertices().iter().map(|p| Point::new(p.x, 0.0, p.z)).collect())
        .unwrap();
    let error = BodyMap::similar(&shape(&body), &shape(&flat), &params).unwrap_err();
    assert!(matches!(error, AlignError::NoHeight { which: "target", .. }), "{error}");
    let bad = AlignParams { least_width: Real::NAN, ..params };
    assert!(matches!(
        BodyMap::new(&shape(&body), &shape(&body), &bad),
        Err(AlignError::Parameter(e)) if e.name == "least_width"
    ));
    let skin = SkinWeights::new(vec![[0; 4]], vec![[1.0, 0.0, 0.0, 0.0]], 1).unwrap();
    let thin = BodyShape { skin: Some(&skin), ..shape(&body) };
    let count = AlignError::from(SkinError::Count { vertices: body.vertices().len(), records: 1 });
    assert_eq!(BodyMap::new(&thin, &shape(&other(&body)), &params).unwrap_err(), count.clone());
    let map = BodyMap::new(&shape(&body), &shape(&body), &params).unwrap();
    assert_eq!(map.align(&body, Some(&skin)), Err(count));
}
