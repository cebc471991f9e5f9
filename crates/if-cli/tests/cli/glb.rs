//! Outfits of GLB files.

use crate::folder::{Folder, belt, body};
use if_core::mesh::TriMesh;
use if_mesh::file::MeshFile;
use serde_json::json;

/// A mesh as a GLB file: in centimetres below a node that scales it, with texture coordinates.
fn glb(mesh: &TriMesh) -> Vec<u8> {
    let (n, m) = (mesh.vertices().len(), mesh.triangles().len());
    let positions = mesh.vertices().iter().flat_map(|p| [p.x, p.y, p.z].map(|x| 100.0 * x));
    let floats = positions.chain((0..2 * n).map(|k| 0.001 * k as f64));
    let mut bin: Vec<u8> = floats.flat_map(|x| (x as f32).to_le_bytes()).collect();
    bin.extend(mesh.triangles().as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    let view =
        |from: usize, length: usize| json!({"buffer": 0, "byteOffset": from, "byteLength": length});
    let accessor = |view: usize, code: usize, count: usize, kind: &str| json!({"bufferView": view, "componentType": code, "count": count, "type": kind});
    let document = json!({
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "materials": [{"name": "wool"}],
        "nodes": [{"name": "skirt", "mesh": 0, "scale": [0.01, 0.01, 0.01]}],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0,
        }]}],
        "accessors": [accessor(0, 5126, n, "VEC3"), accessor(1, 5126, n, "VEC2"), accessor(2, 5125, 3 * m, "SCALAR")],
        "bufferViews": [view(0, 12 * n), view(12 * n, 8 * n), view(20 * n, 12 * m)],
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
    folder.write("body.glb", glb(&body()));
    folder.write("skirt.glb", glb(&skirt));
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
