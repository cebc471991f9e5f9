//! Outfits of glTF files, binary and JSON.

use crate::animate;
use crate::folder::{Folder, belt, body};
use crate::pinch::balls;
use if_body::mannequin::rig;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::icosphere;
use if_mesh::file::MeshFile;
use serde_json::{Value, json};

/// Meshes as a GLB file: each in centimetres below a node that scales it, with texture coordinates.
fn glb(meshes: &[(&str, &TriMesh)]) -> Vec<u8> {
    let mut bin: Vec<u8> = Vec::new();
    let (mut views, mut accessors, mut nodes, mut shapes) = (vec![], vec![], vec![], vec![]);
    for (k, (name, mesh)) in meshes.iter().enumerate() {
        let (n, m) = (mesh.vertices().len(), mesh.triangles().len());
        let mut add = |count: usize, code: usize, kind: &str, bytes: Vec<u8>| {
            views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()}));
            let view = views.len() - 1;
            accessors.push(
                json!({"bufferView": view, "componentType": code, "count": count, "type": kind}),
            );
            bin.extend(bytes);
            view
        };
        let floats = |all: Vec<f64>| all.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
        let positions = mesh.vertices().iter().flat_map(|p| [p.x, p.y, p.z].map(|x| 100.0 * x));
        let positions = add(n, 5126, "VEC3", floats(positions.collect()));
        let uv = (0..2 * n).map(|k| 0.001 * k as f64).collect();
        let uv = add(n, 5126, "VEC2", floats(uv));
        let corners = mesh.triangles().as_flattened().iter().flat_map(|v| v.to_le_bytes());
        let corners = add(3 * m, 5125, "SCALAR", corners.collect());
        nodes.push(json!({"name": name, "mesh": k, "scale": [0.01, 0.01, 0.01]}));
        shapes.push(json!({"primitives": [{
            "attributes": {"POSITION": positions, "TEXCOORD_0": uv}, "indices": corners, "material": 0,
        }]}));
    }
    let document = json!({
        "asset": {"version": "2.0"}, "materials": [{"name": "wool"}],
        "scenes": [{"nodes": (0..nodes.len()).collect::<Vec<_>>()}], "nodes": nodes,
        "meshes": shapes, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": bin.len()}],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let head = [2, 28 + text.len() + bin.len(), text.len(), 0x4E4F_534A];
    let mut out = b"glTF".to_vec();
    out.extend(head.iter().flat_map(|x| (*x as u32).to_le_bytes()));
    out.extend(text);
    out.extend([bin.len(), 0x004E_4942].iter().flat_map(|x| (*x as u32).to_le_bytes()));
    out.extend(bin);
    out
}

#[test]
fn a_garment_of_a_scene_is_resolved_in_its_own_units_and_keeps_the_rest() {
    let folder = Folder::new();
    let skirt = belt(0.97, -0.3, 0.2);
    folder.write("body.glb", glb(&[("body", &body())]));
    folder.write("skirt.glb", glb(&[("skirt", &skirt)]));
    folder.ifg("check --body body.glb skirt.glb").expect(1);
    let run = folder.ifg("fix --body body.glb skirt.glb --out fixed").expect(0);
    assert!(run.stdout.contains("Wrote fixed: skirt.glb"), "{}", run.stdout);
    folder.ifg("check --body body.glb fixed/skirt.glb").expect(0);
    let [before, after] = ["skirt.glb", "fixed/skirt.glb"].map(|name| folder.read(name));
    // As many bytes of numbers, and texture coordinates and triangles unchanged.
    let (n, m) = (skirt.vertices().len(), skirt.triangles().len());
    let rest = 8 * n + 12 * m;
    assert!(before[before.len() - rest..] == after[after.len() - rest..]);
    assert!(before[before.len() - rest - 12 * n..] != after[after.len() - rest - 12 * n..]);
    let [before, after] =
        ["skirt.glb", "fixed/skirt.glb"].map(|name| MeshFile::read(&folder.path(name)).unwrap());
    let moved = before.mesh().vertices().iter().zip(after.mesh().vertices());
    let largest = moved.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(largest > 1e-4 && largest < 0.1, "{largest} m");
}

#[test]
fn nodes_of_one_file_are_layers_and_written_back_into_it() {
    let folder = Folder::new();
    let (inner, outer) = (belt(0.97, -0.3, 0.2), belt(0.98, -0.2, 0.1));
    folder.write("look.glb", glb(&[("Body", &body()), ("a/b", &inner), ("Coat", &outer)]));
    let layers = "--body look.glb#Body look.glb#a/b look.glb#Coat";
    folder.ifg(&format!("check {layers}")).expect(1);
    let run = folder.ifg(&format!("fix {layers} --out fixed")).expect(0);
    assert!(run.stdout.contains("Wrote fixed: look.glb"), "{}", run.stdout);
    let fixed = layers.replace("look.glb", "fixed/look.glb");
    folder.ifg(&format!("check {fixed}")).expect(0);
    let read = |path: &str| MeshFile::read(&folder.path(path)).unwrap();
    for node in ["Body", "a/b", "Coat"] {
        let [before, after] = ["look", "fixed/look"].map(|f| read(&format!("{f}.glb#{node}")));
        assert_eq!(before.mesh().triangles(), after.mesh().triangles());
        assert_eq!(before.mesh().vertices() == after.mesh().vertices(), node == "Body", "{node}");
    }
    // An avatar in VRM is such a file.
    folder.write("look.vrm", folder.read("look.glb"));
    folder.ifg(&format!("fix {} --out avatar", layers.replace("glb", "vrm"))).expect(0);
    assert!(folder.read("avatar/look.vrm") == folder.read("fixed/look.glb"));
    // The same from an outfit file, with names of its own.
    folder.write(
        "look.toml",
        "body = \"look.glb#Body\"\n[[garment]]\nfile = \"look.glb#a/b\"\nname = \"belt\"\n\
         [[garment]]\nfile = \"look.glb#Coat\"\n",
    );
    folder.ifg("fix look.toml --out again").expect(0);
    assert!(folder.read("again/look.glb") == folder.read("fixed/look.glb"));
    // In a wardrobe they are garments of their own, called as their nodes.
    folder.ifg("wardrobe add w --body anna --mesh body.ply look.glb#a/b look.glb#Coat").expect(0);
    assert!(["a_b", "Coat"].iter().all(|g| folder.path(&format!("w/garments/{g}")).exists()));
    // In place: the body's file is written, and the body stays.
    folder.ifg("fix look.toml --out .").expect(2);
    folder.ifg("fix look.toml --out . --in-place").expect(0);
    assert!(folder.read("look.glb") == folder.read("fixed/look.glb"));
}

#[test]
fn a_body_that_was_drawn_back_is_written_with_the_garments_of_its_file() {
    let folder = balls();
    let read = |name: &str| MeshFile::read(&folder.path(name)).unwrap().mesh().clone();
    let (balls, sheet) = (read("balls.ply"), read("sheet.ply"));
    folder.write("look.glb", glb(&[("balls", &balls), ("sheet", &sheet)]));
    let run = "fix --body look.glb#balls look.glb#sheet --set rounds=8 --pinch yield --out yielded";
    folder.ifg(run).expect(0);
    let drawn = "yielded/look_drawn_back.glb";
    folder.ifg(&format!("check --strict --body {drawn}#balls {drawn}#sheet")).expect(0);
    // The numbers of a JSON file are in the file itself, and hashed with it.
    write_gltf(&folder, "balls", &[("balls", &balls)]);
    let run = "fix --body balls.gltf sheet.ply --set rounds=8 --pinch yield --out json";
    folder.ifg(run).expect(0);
    folder.ifg("check --strict --body json/balls_drawn_back.gltf json/sheet.ply").expect(0);
    assert!(!folder.path("json/data/balls.bin").exists());
    // Its images are copied with it.
    assert_eq!(folder.read("json/data/wool red.png"), b"red");
}

#[test]
fn nodes_that_are_missing_or_chosen_twice_are_named() {
    let folder = Folder::new();
    folder.write("look.glb", glb(&[("Body", &body()), ("Coat", &belt(0.97, -0.3, 0.2))]));
    let run = folder.ifg("check --body look.glb#Body look.glb#coat").expect(2);
    assert!(
        run.stderr.contains("no node `coat`") && run.stderr.contains("`Coat`"),
        "{}",
        run.stderr
    );
    assert!(run.stderr.contains("help: give one of these names"), "{}", run.stderr);
    let run = folder.ifg("check --body look.glb look.glb#Coat").expect(2);
    let flat = run.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(flat.contains("look.glb#NODE") || flat.contains("scene.glb#NODE"), "{}", run.stderr);
}

/// The JSON and the numbers of a GLB file.
fn parts(glb: &[u8]) -> (Value, &[u8]) {
    let end = 20 + u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    (serde_json::from_slice(&glb[20..end]).unwrap(), &glb[end + 8..])
}

/// Meshes as a JSON file `NAME.gltf`, with its numbers in `data/NAME.bin` and an image.
fn write_gltf(folder: &Folder, name: &str, meshes: &[(&str, &TriMesh)]) {
    let glb = glb(meshes);
    let (mut document, bin) = parts(&glb);
    document["buffers"][0]["uri"] = json!(format!("data/{name}.bin"));
    document["images"] = json!([{"uri": "data/wool%20red.png"}, {"uri": "../elsewhere.png"}]);
    std::fs::create_dir_all(folder.path("data")).unwrap();
    folder.write(&format!("data/{name}.bin"), bin);
    folder.write("data/wool red.png", "red");
    folder.write(&format!("{name}.gltf"), document.to_string());
}

#[test]
fn a_json_file_is_written_with_its_numbers_and_images() {
    let folder = Folder::new();
    write_gltf(&folder, "skirt", &[("skirt", &belt(0.97, -0.3, 0.2))]);
    write_gltf(&folder, "body", &[("body", &body())]);
    let outfit = "--body body.gltf skirt.gltf";
    folder.ifg(&format!("check {outfit}")).expect(1);
    let run = folder.ifg(&format!("fix {outfit} --out fixed")).expect(0);
    assert!(run.stdout.contains("`../elsewhere.png` is not in its folder"), "{}", run.stdout);
    folder.ifg("check --body body.gltf fixed/skirt.gltf").expect(0);
    assert_eq!(folder.read("fixed/data/wool red.png"), b"red");
    // As one of a batch, which resumes.
    folder.write("a.toml", "body='body.gltf'\n[[garment]]\nfile='skirt.gltf'\n");
    folder.write("b.toml", "body='body.ply'\n[[garment]]\nfile='hoop.ply'\n");
    let batch = || -> Value {
        folder.ifg("fix a.toml b.toml --out all").expect(0);
        serde_json::from_slice(&folder.read("all/a/receipt.json")).unwrap()
    };
    let receipt = batch();
    let files = |list: &str| -> Vec<&str> {
        receipt[list].as_array().unwrap().iter().map(|e| e["file"].as_str().unwrap()).collect()
    };
    let inputs =
        ["body.gltf", "skirt.gltf", "data/body.bin", "data/skirt.bin", "data/wool red.png"];
    assert_eq!(files("inputs"), inputs);
    assert!(files("outputs").starts_with(&["skirt.gltf", "data/skirt.bin", "data/wool red.png"]));
    // Numbers of the body or of a garment that change make it another outfit; else it is done.
    assert_eq!(batch(), receipt, "it was done again");
    let mut bin = folder.read("data/body.bin");
    bin[0] ^= 1;
    folder.write("data/body.bin", bin);
    assert_ne!(batch()["inputs"], receipt["inputs"]);
}

#[test]
fn files_of_numbers_never_replace_one_another_or_an_input() {
    let folder = Folder::new();
    write_gltf(&folder, "skirt", &[("skirt", &belt(0.97, -0.3, 0.2))]);
    let refused = |args: &str, words: &str| {
        let run = folder.ifg(args).expect(2);
        let flat = run.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(flat.contains(words), "{args}: {}", run.stderr);
    };
    refused("fix --body body.ply skirt.gltf --out .", "is the input file `skirt.gltf` itself");
    // Another garment of the same numbers' name.
    std::fs::create_dir_all(folder.path("other/data")).unwrap();
    folder.write("other/data/skirt.bin", folder.read("data/skirt.bin"));
    folder.write("other/top.gltf", folder.read("skirt.gltf"));
    refused(
        "fix --body body.ply skirt.gltf other/top.gltf --out fixed",
        "would both be written to `data/skirt.bin`",
    );
    // The numbers of the body.
    std::fs::create_dir_all(folder.path("out/data")).unwrap();
    write_gltf(&folder, "body", &[("body", &body())]);
    let text = String::from_utf8(folder.read("body.gltf")).unwrap();
    folder.write("out/doll.gltf", text.replace("data/body.bin", "data/skirt.bin"));
    folder.write("out/data/skirt.bin", folder.read("data/body.bin"));
    refused(
        "fix --body out/doll.gltf skirt.gltf --out out",
        "output `out/data/skirt.bin` is the input file `out/data/skirt.bin` itself",
    );
    // A folder in its place, and numbers that are missing.
    std::fs::create_dir_all(folder.path("full/data/skirt.bin")).unwrap();
    refused("fix --body body.ply skirt.gltf --out full", "full/data/skirt.bin");
    std::fs::remove_file(folder.path("data/skirt.bin")).unwrap();
    refused("fix --body body.ply skirt.gltf --out new", "buffer 0: cannot read `data/skirt.bin`");
    assert!(!folder.path("new").exists() && !folder.path("fixed").exists());
}

#[test]
fn a_body_may_show_one_mesh_in_several_nodes_and_a_garment_may_not() {
    let folder = Folder::new();
    let button = icosphere(0.02, 1);
    let (document, bin) = {
        let glb = glb(&[("Body", &body()), ("Button", &button), ("Coat", &belt(0.97, -0.3, 0.2))]);
        let (mut document, bin) = parts(&glb);
        document["nodes"][1]["translation"] = json!([0.4, 0.2, 0]);
        let mut second = document["nodes"][1].clone();
        (second["name"], second["translation"]) = (json!("Second"), json!([-0.4, 0.2, 0]));
        document["nodes"].as_array_mut().unwrap().push(second);
        let person = json!({"name": "Person", "children": [0, 1, 3]});
        document["nodes"].as_array_mut().unwrap().push(person);
        document["scenes"][0]["nodes"] = json!([2, 4]);
        (document, bin.to_vec())
    };
    let mut text = document;
    text["buffers"][0]["uri"] = json!("look.bin");
    folder.write("look.bin", bin);
    folder.write("look.gltf", text.to_string());
    folder.ifg("fix --body look.gltf#Person look.gltf#Coat --out fixed").expect(0);
    let read = |path: &str| MeshFile::read(&folder.path(path)).unwrap();
    let person = read("fixed/look.gltf#Person");
    assert_eq!(person.mesh(), read("look.gltf#Person").mesh());
    assert_eq!(
        person.mesh().triangles().len(),
        body().triangles().len() + 2 * button.triangles().len()
    );
    // As a garment it is counted, and not resolved.
    folder.ifg("check --body body.ply look.gltf#Second").expect(0);
    let before = folder.files();
    let run = folder.ifg("fix --body body.ply look.gltf#Second --out other").expect(2);
    let flat = run.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(flat.contains("garment `Second` cannot move"), "{}", run.stderr);
    assert!(flat.contains("nodes 3 and 1 show the same vertices"), "{}", run.stderr);
    assert!(folder.files() == before);
}

#[test]
fn an_error_says_whether_it_is_the_body_or_a_garment() {
    let folder = Folder::new();
    folder.write("look.glb", "glTF");
    let run = folder.ifg("check --body look.glb skirt.ply").expect(2);
    assert!(run.stderr.contains("cannot read body `look`"), "{}", run.stderr);
    let run = folder.ifg("check --body body.ply look.glb").expect(2);
    assert!(run.stderr.contains("cannot read garment `look`"), "{}", run.stderr);
    folder.write("look.glb", "{\"asset\": {\"version\": \"2.0\"}}");
    let run = folder.ifg("check --body body.ply look.glb").expect(2);
    assert!(run.stderr.contains("no triangles"), "{}", run.stderr);
}

/// Writes `doll/skinned.gltf`, a mesh with the skinning weights of the mannequin, whose last joint has this name.
fn write_skinned(folder: &Folder, mesh: &TriMesh, last: &str) {
    let glb = glb(&[("doll", mesh)]);
    let (mut document, bin) = parts(&glb);
    let (mut bin, n) = (bin.to_vec(), mesh.vertices().len());
    let skin = rig::skin_weights(mesh.vertices());
    let mut add = |code: u32, (count, kind): (usize, &str), bytes: Vec<u8>| {
        let view = json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()});
        bin.extend(bytes);
        let views = document["bufferViews"].as_array_mut().unwrap();
        views.push(view);
        let about = json!({"bufferView": views.len() - 1, "componentType": code, "count": count, "type": kind});
        let accessors = document["accessors"].as_array_mut().unwrap();
        accessors.push(about);
        accessors.len() - 1
    };
    let joints = skin.joints().as_flattened().iter().flat_map(|j| j.to_le_bytes()).collect();
    let weights = skin.weights().as_flattened().iter().flat_map(|w| w.to_le_bytes()).collect();
    let (joints, weights) = (add(5123, (n, "VEC4"), joints), add(5126, (n, "VEC4"), weights));
    // The mesh is in centimetres; the joints make metres of it.
    let (skeleton, scale) = (rig::skeleton(), 0.01);
    let bind = skeleton.joints().iter().flat_map(|joint| {
        let [x, y, z] = (-joint.head.coords).into();
        [scale, 0.0, 0.0, 0.0, 0.0, scale, 0.0, 0.0, 0.0, 0.0, scale, 0.0, x, y, z, 1.0]
    });
    let bind = bind.flat_map(|x| (x as f32).to_le_bytes()).collect();
    let bind = add(5126, (skeleton.len(), "MAT4"), bind);
    let nodes = document["nodes"].as_array_mut().unwrap();
    nodes[0] = json!({"name": "doll", "mesh": 0, "skin": 0});
    let joints_of = |is: &dyn Fn(usize) -> bool| -> Vec<usize> {
        (0..skeleton.len()).filter(|j| is(*j)).map(|j| 1 + j).collect()
    };
    for (j, joint) in skeleton.joints().iter().enumerate() {
        let name = if j + 1 == skeleton.len() { last } else { &joint.name };
        let above = joint.parent.map_or(Point::origin(), |p| skeleton.joints()[p].head);
        let translation: [f64; 3] = (joint.head - above).into();
        let mut node = json!({"name": name, "translation": translation});
        let children = joints_of(&|c| skeleton.joints()[c].parent == Some(j));
        if !children.is_empty() {
            node["children"] = json!(children);
        }
        nodes.push(node);
    }
    document["skins"] = json!([{"joints": joints_of(&|_| true), "inverseBindMatrices": bind}]);
    let roots = joints_of(&|j| skeleton.joints()[j].parent.is_none());
    document["scenes"][0]["nodes"] = json!([&[0], &roots[..]].concat());
    let attributes = &mut document["meshes"][0]["primitives"][0]["attributes"];
    (attributes["JOINTS_0"], attributes["WEIGHTS_0"]) = (json!(joints), json!(weights));
    document["buffers"] = json!([{"byteLength": bin.len(), "uri": "skinned.bin"}]);
    folder.write("doll/skinned.gltf", document.to_string());
    folder.write("doll/skinned.bin", bin);
}

#[test]
fn the_skin_of_a_body_moves_it() {
    let folder = animate::scene();
    let mesh = if_mesh::ply::read_path(&folder.path("doll/body_clean.ply")).unwrap().mesh;
    let last = rig::skeleton().names().last().unwrap().to_owned();
    let command = "animate --body doll/skinned.gltf doll/trousers.ply --motion doll/motion.json \
                   --no-pictures --meshes --out moved";
    write_skinned(&folder, &mesh, &last);
    let run = folder.ifg(command).expect(0);
    // The meshes of frames need no file beside them.
    let frame = "moved/meshes/000001";
    folder.ifg(&format!("check --body {frame}/skinned.gltf {frame}/trousers.ply")).expect(0);
    assert!(run.stdout.contains("3 frames: 3 clean"), "{}", run.stdout);
    assert!(run.stdout.contains("Weights taken from the body: trousers"), "{}", run.stdout);
    // So does that of a wardrobe.
    let added = "wardrobe add w --body doll --mesh doll/skinned.gltf --skeleton doll/skeleton.json";
    folder.ifg(added).expect(0);
    let stored = if_mesh::ply::read_path(&folder.path("w/bodies/doll/body.ply")).unwrap();
    let (found, given) = (
        if_body::SkinWeights::from_ply(&stored, rig::skeleton().len()).unwrap(),
        rig::skin_weights(mesh.vertices()),
    );
    let of = |skin: &if_body::SkinWeights, v: usize, joint: u16| {
        let slots = skin.joints()[v].iter().zip(&skin.weights()[v]);
        slots.filter(|(j, _)| **j == joint).map(|(_, w)| *w).sum::<f32>()
    };
    for v in 0..mesh.vertices().len() {
        let apart = |j: u16| (of(&found, v, j) - of(&given, v, j)).abs();
        assert!((0..rig::skeleton().len() as u16).all(|j| apart(j) < 1e-5), "vertex {v}");
    }
    // The skeleton may be that of a glTF file, too.
    let own = added.replace("skeleton.json", "skinned.gltf");
    folder.ifg(&own.replace("add w", "add own_joints")).expect(0);
    let joints = |root: &str| {
        let path = folder.path(&format!("{root}/bodies/doll/skeleton.json"));
        if_body::Skeleton::read_path(&path).unwrap()
    };
    assert!(joints("own_joints").names().eq(joints("w").names()));
    std::fs::rename(folder.path("doll/skeleton.json"), folder.path("kept.json")).unwrap();
    // Without another one it is that of the body's skin.
    folder.ifg(&command.replace("moved", "own")).expect(0);
    let given = command.replace("moved", "given") + " --skeleton doll/skinned.gltf";
    folder.ifg(&given).expect(0);
    let same = |out: &str| folder.read(&format!("{out}/meshes/000001/trousers.ply"));
    assert!(same("given") == same("own"));
    let vertices = |path: String| {
        if_mesh::ply::read_path(&folder.path(&path)).unwrap().mesh.vertices().to_vec()
    };
    let [given, own] =
        ["moved", "own"].map(|out| vertices(format!("{out}/meshes/000001/trousers.ply")));
    let apart = given.iter().zip(&own).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(given != vertices("doll/trousers.ply".into()) && apart < 1e-4, "{apart} m");
    let unskinned = command.replace("skinned.gltf", "body_clean.ply").replace("moved", "none");
    let run = folder.ifg(&unskinned).expect(2);
    assert!(run.stderr.contains("skeleton.json` cannot be used"), "{}", run.stderr);
    folder.write("doll/bare.glb", glb(&[("doll", &mesh)]));
    let run = folder.ifg(&command.replace("skinned.gltf", "bare.glb").replace("moved", "none"));
    assert!(run.expect(2).stderr.contains("bare.glb` has no skin"));
    std::fs::rename(folder.path("kept.json"), folder.path("doll/skeleton.json")).unwrap();
    write_skinned(&folder, &mesh, "tail");
    let run = folder.ifg(&command.replace("moved", "other")).expect(2);
    let flat = run.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(flat.contains("the joint `tail`, which the skeleton does not have"), "{}", run.stderr);
    let of_gltf = command.replace("motion.json", "skinned.gltf").replace("moved", "other");
    let run = folder.ifg(&of_gltf).expect(2);
    assert!(run.stderr.contains("animations are not read"), "{}", run.stderr);
    assert!(!folder.path("other").exists());
}
