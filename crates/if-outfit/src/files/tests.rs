//! What is proven is what a reader of the files gets.

use super::*;
use crate::resolve::{Split as Splitting, resolve};
use if_core::math::Vector;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::meshes::{icosphere, tube};
use if_mesh::file::Content;
use if_mesh::ply::{Column, CoordinateType, PlyMesh, Property, WriteParams, write_path};
use if_mesh::polygons::Polygons;
use serde_json::json;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Radius of the ball that is the body, in metres.
const BALL: Real = 0.3;

/// A band about the ball, of `sides` flat sides.
fn band(radius: Real, sides: u32, along: u32) -> TriMesh {
    let tube = tube(radius, 0.1, sides, along, false);
    let lowered = tube.vertices().iter().map(|p| p - Vector::y() * 0.05).collect();
    tube.with_vertices(lowered).unwrap()
}

/// A PLY file of a mesh in metres, stored in units of `scale` metres, with a label at each vertex.
fn ply(path: &Path, mesh: &TriMesh, scale: Real, coordinates: CoordinateType) -> LayerFile {
    let mut ply = PlyMesh::new(mesh.scaled(1.0 / scale).unwrap());
    let labels = (0..mesh.vertices().len()).map(|v| (v % 251) as u8).collect();
    ply.vertex_properties = vec![Property::new("label", Column::U8(labels))];
    let params = WriteParams { coordinates, ..Default::default() };
    write_path(&ply, ply.mesh.vertices(), &params, path).unwrap();
    LayerFile::new(path)
}

/// The text of an OBJ file of a mesh. With `seam`, each triangle has its own vertices.
fn obj(path: &Path, mesh: &TriMesh, seam: bool) -> LayerFile {
    let mut text = String::from("# by hand\no band\n");
    let corners = mesh.triangles().as_flattened();
    let line = |p: &Point| format!("v {:?} {:?} {:?}\n", p.x, p.y, p.z);
    if seam {
        text.extend(corners.iter().map(|v| line(&mesh.vertices()[*v as usize])));
        text.extend(
            (0..mesh.triangles().len())
                .map(|t| format!("f {} {} {}\n", 3 * t + 1, 3 * t + 2, 3 * t + 3)),
        );
    } else {
        text.extend(mesh.vertices().iter().map(line));
        text.extend(
            mesh.triangles().iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1)),
        );
    }
    fs::write(path, text).unwrap();
    LayerFile::new(path)
}

/// A folder with the body in units of `scale` metres.
fn scene(scale: Real) -> (TempDir, LayerFile) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.ply");
    let body = ply(&path, &icosphere(BALL, 4), scale, CoordinateType::Double);
    (folder, body)
}

/// Resolves, writes and reads again: what is read is the outfit that was proven, bit for bit.
fn round_trip(
    (folder, body): &(TempDir, LayerFile),
    garment: LayerFile,
    scale: Real,
) -> (OutfitFiles, ResolvedFiles, OutfitFiles) {
    let files = OutfitFiles::read(body.clone(), vec![garment], scale).unwrap();
    assert!(!files.verify().unwrap().is_clean());
    let resolved = files.resolve(&ResolveParams::default(), &mut Silent).unwrap();
    let again = read_again(&resolved, folder, body, scale);
    (files, resolved, again)
}

fn read_again(
    resolved: &ResolvedFiles,
    folder: &TempDir,
    body: &LayerFile,
    scale: Real,
) -> OutfitFiles {
    let written = resolved.write(&folder.path().join("out")).unwrap();
    let layers = written.into_iter().map(LayerFile::new).collect();
    let again = OutfitFiles::read(body.clone(), layers, scale).unwrap();
    assert_eq!(again.outfit().garments[0].mesh, resolved.outfit.garments[0].mesh);
    let (found, reported) = (again.verify().unwrap(), &resolved.report.after);
    assert!(found.is_clean());
    // Distances would differ by what rounding moves.
    assert_eq!((&found.pairs, &found.own_pairs), (&reported.pairs, &reported.own_pairs));
    assert_eq!(found.own_least_distances, reported.own_least_distances);
    again
}

fn labels(files: &OutfitFiles) -> Column {
    let Some(Content::Ply(ply)) = files.files().nth(1).map(MeshFile::content) else {
        panic!("a PLY file")
    };
    ply.vertex_property("label").unwrap().values.clone()
}

#[test]
fn single_precision_is_proven_as_stored_and_attributes_stay() {
    let scene = scene(1.0);
    let path = scene.0.path().join("band.ply");
    let garment = ply(&path, &band(0.295, 40, 4), 1.0, CoordinateType::Float);
    let (files, resolved, again) = round_trip(&scene, garment, 1.0);
    assert_eq!(files.outfit().garments[0].storage, Storage::F32);
    let is_single = |p: &Point| p.iter().all(|x| Real::from(*x as f32) == *x);
    assert!(resolved.outfit.garments[0].mesh.vertices().iter().all(is_single));
    assert_eq!(labels(&again), labels(&files));
}

#[test]
fn files_in_millimetres_are_proven_as_their_reader_gets_them() {
    let scene = scene(1e-3);
    for coordinates in [CoordinateType::Float, CoordinateType::Double] {
        let path = scene.0.path().join("band.ply");
        let garment = ply(&path, &band(0.295, 40, 4), 1e-3, coordinates);
        let (_, _, again) = round_trip(&scene, garment, 1e-3);
        let stored = again.files().nth(1).unwrap().mesh().aabb().size();
        assert!((stored.x - 2.0 * 300.0).abs() < 15.0, "{stored} mm");
    }
}

#[test]
fn distances_of_primitives_are_those_of_files_in_millimetres() {
    let scene = scene(1e-3);
    let path = scene.0.path().join("band.ply");
    let garment = ply(&path, &band(0.295, 40, 4), 1e-3, CoordinateType::Float);
    let files = OutfitFiles::read(scene.1.clone(), vec![garment], 1e-3).unwrap();
    let mut params = ResolveParams::default();
    params.goal.least_distance = 1e-4;
    let resolved = files.resolve(&params, &mut Silent).unwrap();
    let again = read_again(&resolved, &scene.0, &scene.1, 1e-3).verify().unwrap();
    assert!(again.own_primitive_distances[0].is_some());
    assert_eq!(resolved.report.after.own_primitive_distances, again.own_primitive_distances);
}

#[test]
fn text_is_proven_as_stored_and_only_positions_change() {
    let scene = scene(1.0);
    let garment = obj(&scene.0.path().join("band.obj"), &band(0.295, 40, 4), false);
    let input = fs::read_to_string(&garment.path).unwrap();
    round_trip(&scene, garment, 1.0);
    let output = fs::read_to_string(scene.0.path().join("out/band.obj")).unwrap();
    let others = |text: &str| -> Vec<String> {
        text.lines().filter(|l| !l.starts_with("v ")).map(str::to_owned).collect()
    };
    assert_eq!(others(&output), others(&input));
    assert_ne!(output, input);
}

#[test]
fn positions_with_few_digits_are_proven_as_they_are_printed() {
    let storage = Storage::Text { decimals: 5 };
    let garment = Layer { storage, ..Layer::new("band", band(0.295, 40, 4)) };
    let outfit = Outfit::new(Layer::new("ball", icosphere(BALL, 4)), vec![garment]).unwrap();
    let resolved = resolve(&outfit, &ResolveParams::default(), &mut Silent).unwrap();
    let found = resolved.outfit.garments[0].mesh.vertices();
    let printed = |p: &Point| p.map(|x| format!("{x:.5}").parse::<Real>().unwrap());
    assert_eq!(found, found.iter().map(printed).collect::<Vec<_>>());
    assert!(verify(&resolved.outfit).unwrap().is_clean());
}

#[test]
fn both_sides_of_a_seam_move_as_one() {
    let scene = scene(1.0);
    let mesh = band(0.295, 40, 4);
    let garment = obj(&scene.0.path().join("band.obj"), &mesh, true);
    let (_, resolved, _) = round_trip(&scene, garment, 1.0);
    let stored = resolved.outfit.garments[0].mesh.vertices();
    let mut place = vec![None; mesh.vertices().len()];
    for (corner, v) in mesh.triangles().as_flattened().iter().enumerate() {
        assert_eq!(*place[*v as usize].get_or_insert(stored[corner]), stored[corner]);
    }
}

#[test]
fn split_triangles_are_stored_with_their_attributes_and_proven_so() {
    let scene = scene(1.0);
    let path = scene.0.path().join("band.ply");
    let garment = ply(&path, &band(0.33, 3, 1), 1.0, CoordinateType::Float);
    let files = OutfitFiles::read(scene.1.clone(), vec![garment], 1.0).unwrap();
    let mut params = ResolveParams::default();
    params.goal.split = Splitting::IfStrained;
    let resolved = files.resolve(&params, &mut Silent).unwrap();
    let before = files.outfit().garments[0].mesh.vertices().len();
    let again = read_again(&resolved, &scene.0, &scene.1, 1.0);
    assert!(again.outfit().garments[0].mesh.vertices().len() > before);
    let (Column::U8(old), Column::U8(new)) = (labels(&files), labels(&again)) else {
        panic!("labels are bytes")
    };
    assert_eq!(new[..before], old);
    assert_eq!(new.len(), again.outfit().garments[0].mesh.vertices().len());
}

#[test]
fn a_garment_that_needs_nothing_is_a_copy() {
    let scene = scene(1.0);
    let path = scene.0.path().join("band.ply");
    // A comment and numbers that no writer of this project would write.
    fs::write(
        &path,
        "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 3\nproperty float x\n\
         property float y\nproperty float z\nelement face 1\n\
         property list uchar int vertex_indices\nend_header\n\
         0.50 0 0\n0.5000 0.1 0\n5e-1 0 1e-1\n3 0 1 2\n",
    )
    .unwrap();
    for scale in [1.0, 1.25] {
        let body = ply(
            &scene.0.path().join("ball.ply"),
            &icosphere(BALL, 4),
            scale,
            CoordinateType::Float,
        );
        let files = OutfitFiles::read(body, vec![LayerFile::new(&path)], scale).unwrap();
        let resolved = files.resolve(&ResolveParams::default(), &mut Silent).unwrap();
        let out = scene.0.path().join("out");
        resolved.write(&out).unwrap();
        assert_eq!(fs::read(out.join("band.ply")).unwrap(), fs::read(&path).unwrap());
    }
}

#[test]
fn a_garment_from_memory_keeps_the_attributes_of_its_file_in_another_pose() {
    let (folder, _) = scene(1.0);
    let worn = band(0.295, 40, 4);
    let elsewhere = worn.with_vertices(worn.vertices().iter().map(|p| p * 2.0).collect()).unwrap();
    let path = folder.path().join("elsewhere.ply");
    ply(&path, &elsewhere, 1.0, CoordinateType::Float);
    let Content::Ply(file) = MeshFile::read(&path).unwrap().content().clone() else {
        panic!("a PLY file")
    };
    let outfit =
        Outfit::new(Layer::new("ball", icosphere(BALL, 4)), vec![Layer::new("band", worn)]);
    let files = OutfitFiles::from_memory(outfit.unwrap(), vec![MeshFile::from_ply(file)]);
    let resolved = files.resolve(&ResolveParams::default(), &mut Silent).unwrap();
    let written = resolved.write(folder.path()).unwrap();
    assert_eq!(written, [folder.path().join("band.ply")]);
    let again = MeshFile::read(&written[0]).unwrap();
    assert_eq!(again.mesh().vertices(), resolved.outfit.garments[0].mesh.vertices());
    let Content::Ply(again) = again.content() else { panic!("a PLY file") };
    assert!(again.vertex_property("label").is_some());
}

#[test]
fn a_garment_from_memory_that_stays_is_written_where_it_is_and_not_where_its_file_has_it() {
    let (folder, _) = scene(1.0);
    let path = folder.path().join("elsewhere.ply");
    // It is clean as it is worn; only the file has it lower.
    let worn = band(0.32, 40, 4);
    let lower = worn.vertices().iter().map(|p| p - Vector::y()).collect();
    ply(&path, &worn.with_vertices(lower).unwrap(), 1.0, CoordinateType::Double);
    let file = MeshFile::read(&path).unwrap();
    let body = Layer::new("ball", icosphere(BALL, 4));
    let outfit = Outfit::new(body, vec![Layer::new("band", worn.clone())]).unwrap();
    let files = OutfitFiles::from_memory(outfit, vec![file]);
    let resolved = files.resolve(&ResolveParams::default(), &mut Silent).unwrap();
    let written = resolved.write(folder.path()).unwrap();
    assert_eq!(MeshFile::read(&written[0]).unwrap().mesh().vertices(), worn.vertices());
}

#[test]
fn a_garment_that_is_not_at_the_body_is_noted() {
    let ball = icosphere(BALL, 2);
    let beside = ball.vertices().iter().map(|p| Point::new(p.x + 2.5 * BALL, p.y, p.z)).collect();
    let hat = ball.with_vertices(beside).unwrap();
    let file = MeshFile::from_ply(PlyMesh::new(hat.clone()));
    let outfit = Outfit::new(Layer::new("ball", ball), vec![Layer::new("hat", hat)]).unwrap();
    let notes = OutfitFiles::from_memory(outfit, vec![file]).notes();
    assert!(notes.iter().any(|n| n.starts_with("`hat`: 0.15 m from the body")), "{notes:?}");
}

#[test]
fn a_face_whose_triangles_fold_over_each_other_is_noted() {
    let corners = [[0.0, 0.0], [2.0, 2.0], [0.0, 4.0], [1.0, 2.0]];
    let corners = corners.map(|[x, y]| Point::new(0.02 * x, 0.02 * y, 2.0 * BALL));
    let notes_on = |face: [u32; 4]| {
        let faces = Polygons::new([face]).unwrap();
        let mesh = TriMesh::new(corners.to_vec(), faces.triangles()).unwrap();
        let ply = PlyMesh { polygons: Some(faces), ..PlyMesh::new(mesh.clone()) };
        let layers = vec![Layer::new("patch", mesh)];
        let outfit = Outfit::new(Layer::new("ball", icosphere(BALL, 2)), layers).unwrap();
        let notes = OutfitFiles::from_memory(outfit, vec![MeshFile::from_ply(ply)]).notes();
        notes.into_iter().filter(|note| note.contains("concave")).collect::<Vec<_>>()
    };
    let [note] = &notes_on([0, 1, 2, 3])[..] else { panic!("one note") };
    assert!(
        note.starts_with("`patch`: 1 faces are concave or far from flat (the first is face 0)")
    );
    assert!(notes_on([3, 0, 1, 2]).is_empty(), "the notch sees the whole face");
}

#[test]
fn errors_name_layer_file_and_cause() {
    let (folder, body) = scene(1.0);
    let at = |name: &str| folder.path().join(name);
    let read = |garments: &[&LayerFile], scale| {
        let garments = garments.iter().map(|g| (*g).clone()).collect();
        OutfitFiles::read(body.clone(), garments, scale).unwrap_err().to_string()
    };
    let belt = ply(&at("belt.ply"), &band(0.295, 40, 4), 1.0, CoordinateType::Float);
    assert!(read(&[&belt], 0.0).contains("the scale is 0"));
    let missing = read(&[&belt, &LayerFile::new(at("coat.ply"))], 1.0);
    assert!(missing.contains("garment `coat`") && missing.contains("coat.ply"), "{missing}");
    let far = band(0.295, 40, 4).with_vertices(
        band(0.295, 40, 4).vertices().iter().map(|p| p + Vector::x() * 9.0).collect(),
    );
    let far = ply(&at("far.ply"), &far.unwrap(), 1.0, CoordinateType::Float);
    let far = read(&[&belt, &far], 1.0);
    assert!(
        far.contains("far.ply") && far.contains("(far)") && far.contains("m from the body"),
        "{far}"
    );

    fs::create_dir(at("b")).unwrap();
    let twin = LayerFile { name: "twin".into(), path: at("b/BELT.ply") };
    fs::copy(&belt.path, &twin.path).unwrap();
    let files = OutfitFiles::read(body.clone(), vec![belt, twin], 1.0).unwrap();
    let mut params = ResolveParams::default();
    params.effort.rounds = 1;
    match files.resolve(&params, &mut Silent) {
        Err(FilesError::Unresolved { unresolved, result }) => {
            let text = unresolved.to_string();
            assert!(text.ends_with("remain") && text.contains('`'), "{text}");
            let same = result.write(folder.path()).unwrap_err().to_string();
            assert!(same.contains("`belt` and `twin`"), "{same}");
        }
        other => panic!("one round cannot separate two equal belts: {other:?}"),
    }
}

/// A JSON glTF file of a mesh, whose numbers are in `numbers.bin` beside it.
fn gltf(path: &Path, mesh: &TriMesh) -> LayerFile {
    let positions = mesh.vertices().iter().flat_map(|p| [p.x, p.y, p.z]);
    let mut bin: Vec<u8> = positions.flat_map(|x| (x as f32).to_le_bytes()).collect();
    let start = bin.len();
    bin.extend(mesh.triangles().as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    let view =
        |from: usize, to: usize| json!({"buffer": 0, "byteOffset": from, "byteLength": to - from});
    let accessor = |view: u32, code: u32, count: usize, kind: &str| json!({"bufferView": view, "componentType": code, "count": count, "type": kind});
    let document = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            accessor(0, 5126, mesh.vertices().len(), "VEC3"),
            accessor(1, 5125, 3 * mesh.triangles().len(), "SCALAR"),
        ],
        "bufferViews": [view(0, start), view(start, bin.len())],
        "buffers": [{"byteLength": bin.len(), "uri": "numbers.bin"}],
    });
    fs::write(path, document.to_string()).unwrap();
    fs::write(path.with_file_name("numbers.bin"), bin).unwrap();
    LayerFile::new(path)
}

#[test]
fn numbers_beside_two_files_never_replace_one_another() {
    let (folder, body) = scene(1.0);
    let garment = |name: &str, radius: Real| {
        let path = folder.path().join(name);
        fs::create_dir(&path).unwrap();
        gltf(&path.join(format!("{name}.gltf")), &band(radius, 40, 4))
    };
    let garments = vec![garment("shirt", 0.295), garment("coat", 0.31)];
    let files = OutfitFiles::read(body, garments, 1.0).unwrap();
    let resolved = files.resolve(&ResolveParams::default(), &mut Silent).unwrap();
    let fault = resolved.write(&folder.path().join("out")).unwrap_err();
    let is_named = |file: &Path| file == Path::new("numbers.bin");
    assert!(matches!(&fault, FilesError::SameFile { file, .. } if is_named(file)), "{fault}");
    assert!(!folder.path().join("out").exists());
}
