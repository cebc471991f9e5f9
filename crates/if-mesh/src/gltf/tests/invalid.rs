//! Files at fault: each is refused with an error that names what is wrong and where.

use super::*;

type Damage = fn(&mut Value);

/// One square as a node, and a second node with a skin and a morph target.
fn skinned() -> Builder {
    let mut builder = Builder::new();
    builder.square(0.0, json!({"name": "shirt", "skin": 0}));
    let offsets = builder.floats("VEC3", 4, &[0.5; 12]); // accessor 3
    let joints = builder.accessor("VEC4", 5121, 4, &[[0, 1, 0, 0]; 4].concat()); // 4
    let weights = builder.floats("VEC4", 4, &[0.5, 0.5, 0.0, 0.0].repeat(4)); // 5
    let one = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let bind = builder.floats("MAT4", 2, &one.repeat(2)); // 6
    let joint = [builder.node(json!({"name": "hip"})), builder.node(json!({"name": "knee"}))];
    builder.document["skins"] = json!([{"joints": joint, "inverseBindMatrices": bind}]);
    let mesh = &mut builder.document["meshes"][0];
    mesh["weights"] = json!([0.5]);
    let primitive = &mut mesh["primitives"][0];
    primitive["attributes"]["JOINTS_0"] = json!(joints);
    primitive["attributes"]["WEIGHTS_0"] = json!(weights);
    primitive["targets"] = json!([{"POSITION": offsets}]);
    builder
}

#[track_caller]
fn refused(k: usize, bytes: Vec<u8>, expected: &str) {
    match read(bytes) {
        Ok(_) => panic!("{k}: it was read, without `{expected}`"),
        Err(fault) => assert!(fault.to_string().contains(expected), "{k}: {fault}"),
    }
}

#[test]
fn descriptions_at_fault_are_named() {
    let cases: [(Damage, &str); 40] = [
        (|d| d["asset"] = json!({}), "`asset.version` is ``"),
        (|d| d["asset"]["version"] = json!("1.0"), "`asset.version` is `1.0`; export glTF 2.0"),
        (|d| d["nodes"] = json!({}), "the JSON of the file"),
        (|d| d["nodes"][0]["mesh"] = json!(7), "mesh 7 does not exist; there are 1"),
        (|d| d["nodes"][0]["mesh"] = json!(-1), "the JSON of the file"),
        (|d| d["nodes"][0]["mesh"] = json!(0.5), "the JSON of the file"),
        (|d| d["nodes"][0]["matrix"] = json!([1, 0]), "the JSON of the file"),
        (|d| d["nodes"][0]["children"] = json!([9]), "node 9 does not exist"),
        (|d| d["nodes"][0]["children"] = json!([0]), "node 0 is reached twice"),
        (
            |d| {
                d["nodes"][1]["children"] = json!([2]);
                d["nodes"][2]["children"] = json!([1]);
                d["scenes"][0]["nodes"] = json!([0]);
            },
            "node 1 is reached twice; the nodes of a scene must be a tree",
        ),
        (|d| d["scenes"][0]["nodes"] = json!([0, 0]), "node 0 is reached twice"),
        (|d| d["scenes"][0]["nodes"] = json!([5]), "node 5 does not exist"),
        (|d| d["scenes"][0]["nodes"] = json!([]), "no triangles"),
        (|d| d["scene"] = json!(3), "scene 3 does not exist"),
        (|d| d["nodes"][0]["skin"] = json!(4), "skin 4 does not exist"),
        (|d| d["skins"][0]["joints"] = json!([1]), "joint 1 does not exist; there are 1"),
        (|d| d["skins"][0]["joints"] = json!([1, 99]), "joint node 99 does not exist"),
        (|d| d["skins"][0]["joints"] = json!([0, 1, 2]), "inverse bind matrix 2 does not exist"),
        (|d| d["skins"][0]["inverseBindMatrices"] = json!(0), "inverseBindMatrices must be MAT4"),
        (
            |d| [1, 2].into_iter().for_each(|k| d["nodes"][k]["scale"] = json!([1, 0, 1])),
            "nor joints flatten space",
        ),
        (|d| d["accessors"][3]["count"] = json!(3), "accessor 3 holds 3 elements; POSITION of a"),
        (|d| d["accessors"][4]["count"] = json!(2), "accessor 4 holds 2 elements; JOINTS must"),
        (|d| d["accessors"][5]["componentType"] = json!(5121), "WEIGHTS must be VEC4 of floats or"),
        (|d| d["accessors"][4]["componentType"] = json!(5126), "JOINTS must be VEC4 of whole"),
        (|d| d["accessors"][0]["count"] = json!(5), "POSITION needs 60 bytes, and there are 48"),
        (|d| d["accessors"][0]["count"] = json!(u64::MAX), "POSITION needs"),
        (
            |d| d["accessors"][2]["count"] = json!(4_000_000_000u64),
            "indices needs 4000000000 bytes",
        ),
        (|d| d["accessors"][0]["byteOffset"] = json!(1u64 << 60), "POSITION needs"),
        (
            |d| d["accessors"][0]["componentType"] = json!(5123),
            "accessor 0 holds VEC3 of component",
        ),
        (|d| d["accessors"][0]["componentType"] = json!(9), "component type 9; POSITION must be"),
        (|d| d["accessors"][0]["type"] = json!("VEC2"), "accessor 0 holds VEC2"),
        (|d| d["accessors"][2]["componentType"] = json!(5120), "accessor 2 holds SCALAR"),
        (
            |d| drop(d["accessors"][0].as_object_mut().unwrap().remove("bufferView")),
            "accessor 0 has no data",
        ),
        (|d| d["accessors"][0]["bufferView"] = json!(77), "buffer view 77 does not exist"),
        (|d| d["bufferViews"][0]["buffer"] = json!(2), "buffer 2 does not exist; there are 1"),
        (|d| d["bufferViews"][0]["byteStride"] = json!(8), "elements of 12 bytes every 8 bytes"),
        (
            |d| d["bufferViews"][0]["byteLength"] = json!(40),
            "POSITION needs 48 bytes, and there are 40",
        ),
        (|d| d["bufferViews"][0]["byteOffset"] = json!(1u64 << 62), "POSITION needs"),
        (
            |d| d["buffers"][0]["byteLength"] = json!(1u64 << 40),
            "a buffer needs 1099511627776 bytes",
        ),
        (|d| d["meshes"][0]["primitives"][0]["attributes"] = json!({}), "no triangles"),
    ];
    for (k, (damage, expected)) in cases.into_iter().enumerate() {
        let mut builder = skinned();
        assert!(k > 0 || builder.read().is_ok());
        let mut document = builder.document.clone();
        document["buffers"][0]["byteLength"] = json!(builder.bin.len());
        damage(&mut document);
        builder.document = document;
        refused(k, glb_of(&builder.document, &builder.bin), expected);
    }
}

#[test]
fn transforms_at_fault_are_named() {
    let cases: [(Damage, &str); 4] = [
        (|d| d["nodes"][0]["scale"] = json!([1, 1, 0]), "node 0: its transform"),
        (|d| d["nodes"][0]["scale"] = json!([1e300, 1e300, 1e300]), "node 0: its transform"),
        (|d| d["nodes"][0]["rotation"] = json!([0, 0, 0, 0]), "node 0: its transform"),
        (|d| d["nodes"][0]["matrix"] = json!(vec![0; 16]), "node 0: its transform"),
    ];
    for (k, (damage, expected)) in cases.into_iter().enumerate() {
        let mut builder = Builder::new();
        builder.square(0.0, json!({}));
        damage(&mut builder.document);
        refused(k, builder.bytes(), expected);
    }
}

#[test]
fn what_is_not_read_is_named_with_what_to_export() {
    let cases: [(Damage, &str); 7] = [
        (
            |d| d["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]),
            "the file needs it for this layer or another: KHR_draco_mesh_compression is not supported; export without",
        ),
        (
            |d| {
                d["meshes"][0]["primitives"][0]["extensions"] =
                    json!({"KHR_draco_mesh_compression": {}})
            },
            "KHR_draco_mesh_compression is not supported",
        ),
        (
            |d| d["bufferViews"][0]["extensions"] = json!({"EXT_meshopt_compression": {}}),
            "EXT_meshopt_compression is not supported",
        ),
        (
            |d| d["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {}}),
            "EXT_mesh_gpu_instancing is not supported",
        ),
        (|d| d["buffers"][0]["uri"] = json!("shirt.bin"), "buffer 0: cannot read `shirt.bin`"),
        (|d| d["buffers"][0]["uri"] = json!("../shirt.bin"), "buffer 0 is at `../shirt.bin`; it"),
        (|d| d["buffers"][0]["uri"] = json!("data:;base64,*"), "base64 of the data URI is damaged"),
    ];
    for (k, (damage, expected)) in cases.into_iter().enumerate() {
        let mut builder = Builder::new();
        builder.square(0.0, json!({}));
        damage(&mut builder.document);
        refused(k, builder.bytes(), expected);
    }
}

#[test]
fn sparse_accessors_at_fault_are_named() {
    let cases: [(Damage, &str); 8] = [
        (|s| *s = json!({}), "the JSON of the file"),
        (|s| s["count"] = json!(9), "indices of a sparse accessor needs 9 bytes"),
        (
            |s| s["indices"]["componentType"] = json!(5126),
            "component type 5126; indices of a sparse",
        ),
        (|s| s["indices"]["bufferView"] = json!(50), "buffer view 50 does not exist"),
        (|s| s["indices"]["byteOffset"] = json!(1u64 << 63), "indices of a sparse accessor needs"),
        (|s| s["values"]["bufferView"] = json!(51), "buffer view 51 does not exist"),
        (|s| s["values"]["bufferView"] = json!(2), "POSITION needs 24 bytes, and there are 6"),
        (
            |s| s["indices"]["bufferView"] = json!(2),
            "element of a sparse accessor 4 does not exist",
        ),
    ];
    for (k, (damage, expected)) in cases.into_iter().enumerate() {
        let mut builder = Builder::new();
        builder.square(0.0, json!({}));
        forms::make_sparse(&mut builder, 0, &[(1, [2.0, 0.0, 0.0]), (2, [2.0, 2.0, 0.0])]);
        if k == 7 {
            builder.bin[96] = 4; // the first index of the triangles
        }
        assert!(k == 7 || builder.read().is_ok());
        damage(&mut builder.document["accessors"][0]["sparse"]);
        refused(k, builder.bytes(), expected);
    }
    // Gigabytes of zeros.
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    forms::make_sparse(&mut builder, 0, &[(1, [2.0, 0.0, 0.0])]);
    let about = builder.document["accessors"][0].as_object_mut().unwrap();
    about.remove("bufferView");
    about.insert("count".into(), json!(4_000_000_000u64));
    refused(8, builder.bytes(), "uses its data of sparse accessors too often");
}

#[test]
fn numbers_at_fault_are_named() {
    for (z, found) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (f32::NEG_INFINITY, "-inf")] {
        let mut builder = Builder::new();
        builder.square(z, json!({}));
        let fault = builder.read().unwrap_err().to_string();
        assert!(fault.contains("accessor 0, element 0") && fault.contains(found), "{fault}");
    }
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    *builder.bin.last_mut().unwrap() = 9;
    refused(0, builder.bytes(), "vertex 9 does not exist; there are 4");
}

#[test]
fn damaged_containers_are_named() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    let whole = builder.bytes();
    type DamageBytes = fn(&mut Vec<u8>);
    let cases: [(DamageBytes, &str); 10] = [
        (|b| b.clear(), "not a glTF file"),
        (|b| b[0] = b'x', "not a glTF file"),
        (|b| b[4] = 1, "not a glTF file: it must begin with `glTF` and the number 2"),
        (|b| b.truncate(8), "the header needs 12 bytes, and there are 8"),
        (|b| b.truncate(12), "the file ends too early"),
        (|b| b.truncate(b.len() - 1), "the file ends too early"),
        (|b| b[8..12].copy_from_slice(&[255; 4]), "the file needs 4294967295 bytes"),
        (|b| b[12..16].copy_from_slice(&[255; 4]), "a chunk needs"),
        (|b| b[16] = b'x', "the first chunk of the file must be JSON"),
        (|b| b[20] = 0, "the JSON of the file"),
    ];
    for (k, (damage, expected)) in cases.into_iter().enumerate() {
        let mut bytes = whole.clone();
        damage(&mut bytes);
        refused(k, bytes, expected);
    }
    for end in 0..whole.len() {
        assert!(read(whole[..end].to_vec()).is_err(), "{end}");
    }
    // JSON whose arrays are deeper than a stack.
    let deep = format!("{{\"extras\": {}", "[".repeat(1 << 20));
    refused(11, deep.into_bytes(), "the JSON of the file");
}

#[test]
fn a_file_that_shows_its_data_too_often_is_refused() {
    // 2,000 nodes of one mesh: more vertices than a file of this size may have.
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    let many = builder.floats("VEC3", 4000, &vec![0.25; 12000]);
    builder.document["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(many);
    for _ in 0..2000 {
        builder.node(json!({"mesh": 0}));
    }
    refused(0, builder.bytes(), "the file uses its data of positions too often");
    // The same triangles in many primitives.
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    let many = builder.accessor("SCALAR", 5121, 3000, &[0, 1, 2].repeat(1000));
    let mut primitive = builder.document["meshes"][0]["primitives"][0].clone();
    primitive["indices"] = json!(many);
    builder.document["meshes"][0]["primitives"] = json!(vec![primitive; 500]);
    refused(1, builder.bytes(), "the file uses its data of triangles too often");
    // The same morph target many times.
    let mut builder = skinned();
    let n = 3000;
    let many = builder.floats("VEC3", n, &vec![0.25; 3 * n]);
    builder.document["meshes"][0]["weights"] = json!(vec![1; 500]);
    let primitive = &mut builder.document["meshes"][0]["primitives"][0];
    primitive["attributes"] = json!({"POSITION": many});
    primitive["targets"] = json!(vec![json!({"POSITION": many}); 500]);
    refused(2, builder.bytes(), "of morph targets and weights too often");
}

#[test]
fn nothing_that_is_shown_ever_so_often_takes_memory_all_the_same() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    let empty: Vec<Value> = (0..100)
        .map(|_| json!({"attributes": {"POSITION": builder.floats("VEC3", 0, &[])}}))
        .collect();
    let mesh = builder.push("meshes", json!({"primitives": empty}));
    builder.node(json!({"mesh": mesh}));
    assert_eq!(builder.read().unwrap().mesh().triangles().len(), 2);
    for _ in 0..300 {
        builder.node(json!({"mesh": mesh}));
    }
    refused(0, builder.bytes(), "of primitives");
}
