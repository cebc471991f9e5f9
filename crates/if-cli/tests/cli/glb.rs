//! Outfits of GLB files.

use crate::folder::{Folder, belt, body};
use if_core::mesh::TriMesh;
use if_mesh::file::MeshFile;
use serde_json::json;

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
    let run = folder.ifg("fix --body body.glb skirt.gltf --out fixed").expect(2);
    assert!(run.stderr.contains("export a .gltf as one .glb"), "{}", run.stderr);
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
    // The same from an outfit file, with names of its own.
    folder.write(
        "look.toml",
        "body = \"look.glb#Body\"\n[[garment]]\nfile = \"look.glb#a/b\"\nname = \"belt\"\n\
         [[garment]]\nfile = \"look.glb#Coat\"\n",
    );
    folder.ifg("fix look.toml --out again").expect(0);
    assert!(folder.read("again/look.glb") == folder.read("fixed/look.glb"));
    // In place: the body's file is written, and the body stays.
    folder.ifg("fix look.toml --out .").expect(2);
    folder.ifg("fix look.toml --out . --in-place").expect(0);
    assert!(folder.read("look.glb") == folder.read("fixed/look.glb"));
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
    let run = folder.ifg("check --body look.glb look.glb#Coat").expect(2);
    let flat = run.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(flat.contains("look.glb#NODE") || flat.contains("scene.glb#NODE"), "{}", run.stderr);
}
