//! Forms of the same numbers: quantised, sparse, in other files, shown by several nodes.

use super::*;
use std::fs;
use std::path::Path;

/// Gives an accessor of floats other elements in place of some.
pub(super) fn make_sparse(builder: &mut Builder, accessor: usize, elements: &[(u8, [f32; 3])]) {
    let indices: Vec<u8> = elements.iter().map(|(k, _)| *k).collect();
    let values: Vec<f32> = elements.iter().flat_map(|(_, p)| *p).collect();
    let indices = builder.accessor("SCALAR", 5121, elements.len(), &indices);
    let values = builder.floats("VEC3", elements.len(), &values);
    let view = |accessor: usize| builder.document["accessors"][accessor]["bufferView"].clone();
    let sparse = json!({
        "count": elements.len(),
        "indices": {"bufferView": view(indices), "componentType": 5121},
        "values": {"bufferView": view(values)},
    });
    // The accessors that described them are not part of the file.
    builder.document["accessors"].as_array_mut().unwrap().truncate(indices);
    builder.document["accessors"][accessor]["sparse"] = sparse;
}

/// A square of quantised positions and normals: whole numbers from 0 to 100, which a node scales.
fn quantised() -> Builder {
    let mut builder = Builder::new();
    builder.square(0.0, json!({"name": "shirt", "scale": [0.01, 0.01, 0.01]}));
    let rows: [[i16; 4]; 4] = [[0, 0, 7, 0], [100, 0, 7, 0], [100, 100, 7, 0], [0, 100, 7, 0]];
    let bytes: Vec<u8> = rows.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    let positions = builder.accessor("VEC3", 5122, 4, &bytes);
    let normals: Vec<u8> = [0u8, 0, 127, 0].repeat(4);
    let normals = builder.accessor("VEC3", 5120, 4, &normals);
    let uvs: Vec<u8> = [0u16, 1, 2, 3, 4, 5, 6, 7].iter().flat_map(|x| x.to_le_bytes()).collect();
    let uvs = builder.accessor("VEC2", 5123, 4, &uvs);
    let d = &mut builder.document;
    d["bufferViews"][positions]["byteStride"] = json!(8);
    d["bufferViews"][normals]["byteStride"] = json!(4);
    d["accessors"][normals]["normalized"] = json!(true);
    d["meshes"][0]["primitives"][0]["attributes"] =
        json!({"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs});
    d["extensionsUsed"] = json!(["KHR_mesh_quantization", "KHR_materials_sheen"]);
    d["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    builder
}

#[test]
fn quantised_positions_are_read_and_become_floats_once_they_move() {
    let builder = quantised();
    let glb = builder.read().unwrap();
    let v = glb.mesh().vertices();
    assert!((v[2] - Point::new(1.0, 1.0, 0.07)).norm() < 1e-15, "{}", v[2]);
    // Nothing moves: the same bytes.
    assert_eq!(written(&glb, v), builder.bytes());
    // One vertex moves upwards, to between two whole numbers.
    let mut moved = v.to_vec();
    moved[2].z += 0.0531;
    let bytes = written(&glb, &moved);
    let again = read(bytes.clone()).unwrap();
    assert!((again.mesh().vertices()[2] - moved[2]).norm() < 1e-8);
    assert_eq!(again.mesh().vertices()[..2], v[..2]);
    assert_eq!(again.mesh().vertices(), glb.positions_as_written(&moved));
    let d = document(&bytes);
    let about = &d["accessors"][3];
    assert_eq!((&about["componentType"], &about["count"]), (&json!(5126), &json!(4)));
    assert_eq!(about["min"], json!([0.0, 0.0, 7.0]));
    // The view of the whole numbers is used by nothing else, and so describes the floats.
    let views = d["bufferViews"].as_array().unwrap();
    assert_eq!(views.len(), builder.document["bufferViews"].as_array().unwrap().len());
    assert!(views[3].get("byteStride").is_none() && views[3]["byteLength"] == json!(48));
    assert_eq!(d["buffers"][0]["byteLength"], json!(bin(&bytes).len()));
    // Normals stay quantised, and follow; so the extension is still needed.
    assert_eq!(d["accessors"][4], builder.document["accessors"][4]);
    let n = Vector::from(again.parts[0].normals.unwrap().values::<3>(&again.source, 1));
    assert!((n.norm() - 1.0).abs() < 0.01 && n.z > 0.9 && n != Vector::z(), "{n}");
    assert_eq!(d["extensionsRequired"], json!(["KHR_mesh_quantization"]));
    // Once more, now in the place of the floats.
    moved[2].z += 0.0031;
    let third = read(written(&again, &moved)).unwrap();
    assert_eq!(third.bytes().len(), again.bytes().len());
    assert!((third.mesh().vertices()[2] - moved[2]).norm() < 1e-8);
}

#[test]
fn the_extension_goes_with_the_last_quantised_attribute() {
    let mut builder = quantised();
    let d = &mut builder.document;
    let attributes = d["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap();
    attributes.remove("NORMAL");
    d["accessors"][5]["normalized"] = json!(true); // which the format has without it
    let glb = builder.read().unwrap();
    let moved: Vec<Point> = glb.mesh().vertices().iter().map(|p| p + Vector::z()).collect();
    let d = document(&written(&glb, &moved));
    assert_eq!(d["extensionsUsed"], json!(["KHR_materials_sheen"]));
    assert!(d.get("extensionsRequired").is_none());
}

#[test]
fn normalised_positions_keep_their_single_precision_numbers() {
    let mut builder = quantised();
    builder.document["accessors"][3]["normalized"] = json!(true);
    let glb = builder.read().unwrap();
    let v = glb.mesh().vertices();
    assert!((v[1].x - 0.01 * 100.0 / 32767.0).abs() < 1e-12);
    let mut moved = v.to_vec();
    moved[0].x -= 0.25;
    let again = read(written(&glb, &moved)).unwrap();
    assert_eq!(again.mesh().vertices()[1..], v[1..], "those that did not move");
}

#[test]
fn sparse_positions_are_read_and_become_plain_once_they_move() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    make_sparse(&mut builder, 0, &[(2, [3.0, 1.0, 0.0]), (3, [0.0, 2.0, 0.0])]);
    make_sparse(&mut builder, 1, &[(2, [0.0, 1.0, 0.0])]);
    let glb = builder.read().unwrap();
    let expected = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 1.0, 0.0], [0.0, 2.0, 0.0]];
    assert_eq!(glb.mesh().vertices(), expected.map(Point::from));
    assert_eq!(written(&glb, glb.mesh().vertices()), builder.bytes());
    let mut moved = glb.mesh().vertices().to_vec();
    moved[1].z = 0.5;
    let bytes = written(&glb, &moved);
    let again = read(bytes.clone()).unwrap();
    assert_eq!(again.mesh().vertices(), moved);
    assert!(document(&bytes)["accessors"][0].get("sparse").is_none());
    // Without a base, the others are zero.
    let about = builder.document["accessors"][0].as_object_mut().unwrap();
    about.remove("bufferView");
    let v = builder.read().unwrap();
    assert_eq!(v.mesh().vertices()[1..3], [[0.0; 3], [3.0, 1.0, 0.0]].map(Point::from));
}

#[test]
fn several_nodes_show_one_mesh_which_cannot_move() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({"name": "left"}));
    builder.node(json!({"name": "right", "mesh": 0, "translation": [2, 0, 0]}));
    builder.square(1.0, json!({"name": "coat"}));
    let glb = builder.read().unwrap();
    let v = glb.mesh().vertices();
    assert_eq!((v.len(), v[4]), (12, Point::new(2.0, 0.0, 0.0)));
    assert_eq!(written(&glb, v), builder.bytes());
    // Neither both, nor one of them.
    let left = read_layer(builder.bytes(), Some("left"), None).unwrap();
    for layer in [&glb, &left] {
        let mut moved = layer.mesh().vertices().to_vec();
        moved[0].x += 0.5;
        assert!(layer.check_movable().is_err());
        let fault = write(layer, &moved, Normals::Follow).unwrap_err().to_string();
        assert!(fault.contains("nodes 0 and 1 show the same vertices"), "{fault}");
    }
    let coat = read_layer(builder.bytes(), Some("coat"), None).unwrap();
    coat.check_movable().unwrap();
}

/// The file as JSON, with its buffer at `uri`.
fn as_json(builder: &Builder, uri: &str) -> Vec<u8> {
    let mut document = builder.document.clone();
    document["buffers"][0] = json!({"byteLength": builder.bin.len(), "uri": uri});
    serde_json::to_vec_pretty(&document).unwrap()
}

#[test]
fn json_with_a_file_of_numbers_is_read_and_written_in_its_form() {
    for builder in [quantised(), {
        let mut b = Builder::new();
        b.square(0.5, json!({}));
        b
    }] {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("parts")).unwrap();
        fs::write(folder.path().join("parts/my shirt.bin"), &builder.bin).unwrap();
        let json = as_json(&builder, "./parts/my%20shirt.bin");
        let read_in = |bytes: Vec<u8>, folder: &Path| read_layer(bytes, None, Some(folder));
        let gltf = read_in(json.clone(), folder.path()).unwrap();
        assert!(!gltf.is_binary());
        assert_eq!(gltf.mesh(), builder.read().unwrap().mesh());
        let (path, bytes) = gltf.beside().next().unwrap();
        assert_eq!((path, bytes), (Path::new("parts/my shirt.bin"), &builder.bin[..]));
        // Nothing moves: the same bytes.
        let still = write(&gltf, gltf.mesh().vertices(), Normals::Follow).unwrap();
        assert_eq!(still.bytes, json);
        assert_eq!(still.beside, [(path.to_path_buf(), builder.bin.clone())]);
        let moved: Vec<Point> =
            gltf.mesh().vertices().iter().map(|p| p + Vector::repeat(0.25)).collect();
        let files = write(&gltf, &moved, Normals::Follow).unwrap();
        assert_eq!(files.beside.len(), 1);
        let out = tempfile::tempdir().unwrap();
        fs::create_dir(out.path().join("parts")).unwrap();
        fs::write(out.path().join(&files.beside[0].0), &files.beside[0].1).unwrap();
        let again = read_in(files.bytes, out.path()).unwrap();
        assert_eq!(again.mesh().vertices(), gltf.positions_as_written(&moved));
        // In one file, moved or not.
        for positions in [&moved, gltf.mesh().vertices()] {
            let layers = [(&gltf, positions)];
            let one = write_layers(&layers, Normals::Follow, Beside::Embedded).unwrap();
            assert!(one.beside.is_empty());
            let again = read_layer(one.bytes, None, None).unwrap();
            assert_eq!(again.mesh().vertices(), gltf.positions_as_written(positions));
        }
    }
}

#[test]
fn json_with_embedded_numbers_stays_one_file() {
    let mut builder = Builder::new();
    builder.square(0.5, json!({}));
    let uri = uri::data("data:application/gltf-buffer;base64,", &builder.bin);
    let json = as_json(&builder, &uri);
    let gltf = read(json.clone()).unwrap();
    assert_eq!(write(&gltf, gltf.mesh().vertices(), Normals::Follow).unwrap().bytes, json);
    let mut moved = gltf.mesh().vertices().to_vec();
    moved[3].z = -0.125;
    let files = write(&gltf, &moved, Normals::Follow).unwrap();
    assert!(files.beside.is_empty());
    let start = "\"data:application/gltf-buffer;base64,";
    assert!(String::from_utf8(files.bytes.clone()).unwrap().contains(start));
    assert_eq!(read(files.bytes).unwrap().mesh().vertices(), moved);
}

#[test]
fn files_beside_that_cannot_be_read_are_named() {
    let mut builder = Builder::new();
    builder.square(0.5, json!({}));
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().join("a/b");
    fs::create_dir_all(at.join("folder.bin")).unwrap();
    fs::write(folder.path().join("a/outside.bin"), &builder.bin).unwrap();
    fs::write(at.join("short.bin"), &builder.bin[..50]).unwrap();
    for (uri, expected) in [
        ("gone.bin", "buffer 0: cannot read `gone.bin`: No such file"),
        ("folder.bin", "buffer 0: cannot read `folder.bin`: not a file"),
        ("../outside.bin", "buffer 0 is at `../outside.bin`; it must be a data URI, or the path"),
        ("%2e%2e/outside.bin", "it must be a data URI, or the path"),
        ("/etc/passwd", "buffer 0 is at `/etc/passwd`; it must"),
        ("file:///etc/passwd", "buffer 0 is at `file:///etc/passwd`; it must"),
        ("https://example.org/a.bin", "it must be a data URI, or the path"),
        ("short.bin", "a buffer needs"),
        ("", "buffer 0 is at ``; it must"),
    ] {
        let fault = read_layer(as_json(&builder, uri), None, Some(&at)).unwrap_err().to_string();
        assert!(fault.contains(expected), "{uri}: {fault}");
    }
    // Without data at all.
    let mut document = builder.document.clone();
    document["buffers"][0] = json!({"byteLength": 9});
    let fault = read(document.to_string().into_bytes()).unwrap_err().to_string();
    assert!(fault.contains("buffer 0 has no data"), "{fault}");
}

#[test]
fn joints_are_named_with_their_weights() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({"skin": 0}));
    let joints = builder.accessor("VEC4", 5121, 4, &[[1, 0, 0, 0]; 4].concat());
    let weights = [[1.0, 0.0, 0.0, 0.0], [0.25, 0.75, 0.0, 0.0]].as_flattened().repeat(2);
    let weights = builder.floats("VEC4", 4, &weights);
    let joint = [builder.node(json!({"name": "hip"})), builder.node(json!({"name": "knee"}))];
    builder.document["skins"] = json!([{"joints": joint}]);
    assert_eq!(builder.read().unwrap().influences(|_| true), None);
    let attributes = &mut builder.document["meshes"][0]["primitives"][0]["attributes"];
    (attributes["JOINTS_0"], attributes["WEIGHTS_0"]) = (json!(joints), json!(weights));
    let found = builder.read().unwrap().influences(|_| true).unwrap();
    assert_eq!(found.joints, ["hip", "knee"]);
    assert_eq!(found.of_vertex[0], [(1, 1.0)]);
    assert_eq!(found.of_vertex[3], [(1, 0.25), (0, 0.75)]);
}

#[test]
fn what_hangs_from_a_joint_without_a_skin_follows_it() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({"name": "body", "skin": 0}));
    let joints = builder.accessor("VEC4", 5121, 4, &[[1, 0, 0, 0]; 4].concat());
    let weights = builder.floats("VEC4", 4, &[1.0, 0.0, 0.0, 0.0].repeat(4));
    let attributes = &mut builder.document["meshes"][0]["primitives"][0]["attributes"];
    (attributes["JOINTS_0"], attributes["WEIGHTS_0"]) = (json!(joints), json!(weights));
    // Below the hand a bone that is no joint, and a watch below that; a hat beside the joints.
    let watch = builder.square(1.0, json!({"name": "watch"}));
    builder.square(2.0, json!({"name": "hat"}));
    let strap = builder.node(json!({"name": "strap", "children": [watch]}));
    let hand = builder.node(json!({"name": "hand", "translation": [0, 5, 0], "children": [strap]}));
    let arm = builder.node(json!({"name": "arm", "translation": [3, 0, 0], "children": [hand]}));
    builder.document["scenes"][0]["nodes"] = json!([0, 2, arm]);
    builder.document["skins"] = json!([{"joints": [hand, arm]}]);
    let of = |node, is_joint: fn(&str) -> bool| {
        read_layer(builder.bytes(), Some(node), None).unwrap().influences(is_joint)
    };
    let found = of("watch", |_| true).unwrap();
    assert_eq!(
        (&found.joints[..], found.of_vertex),
        (&["hand".into()][..], vec![vec![(0, 1.0)]; 4])
    );
    // Where a skeleton lacks the hand, the arm.
    assert_eq!(of("watch", |name| name == "arm").unwrap().joints, ["arm"]);
    assert_eq!(of("watch", |_| false), None);
    assert_eq!(of("hat", |_| true), None);
    assert_eq!(of("body", |_| true).unwrap().of_vertex, vec![vec![(1, 1.0)]; 4]);
    // It is where the joint has it at rest.
    let watch = read_layer(builder.bytes(), Some("watch"), None).unwrap();
    assert_eq!(watch.mesh().vertices()[0], Point::new(3.0, 5.0, 1.0));
}
