use super::*;
use if_core::math::{Point, Vector};
use serde_json::{Value, json};

mod forms;
mod invalid;

/// Builds files with two triangles of four corners each.
#[derive(Clone)]
struct Builder {
    document: Value,
    bin: Vec<u8>,
}

impl Builder {
    fn new() -> Self {
        let document = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [],
            "meshes": [], "accessors": [], "bufferViews": [], "buffers": [{"byteLength": 0}],
            "materials": [{"name": "denim", "extras": {"number": 0.1}}],
        });
        Self { document, bin: Vec::new() }
    }

    fn push(&mut self, list: &str, entry: Value) -> usize {
        let list = self.document[list].as_array_mut().unwrap();
        list.push(entry);
        list.len() - 1
    }

    fn accessor(&mut self, kind: &str, code: u32, count: usize, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend_from_slice(bytes);
        let view = self.push("bufferViews", view);
        let about =
            json!({"bufferView": view, "componentType": code, "count": count, "type": kind});
        self.push("accessors", about)
    }

    fn floats(&mut self, kind: &str, count: usize, numbers: &[f32]) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(kind, 5126, count, &bytes)
    }

    /// A square in the plane z = 0, at `z`, as a node with these properties.
    fn square(&mut self, z: f32, node: Value) -> usize {
        let p = [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]];
        let position = self.floats("VEC3", 4, p.as_flattened());
        let normal = self.floats("VEC3", 4, [[0.0, 0.0, 1.0]; 4].as_flattened());
        let indices = self.accessor("SCALAR", 5121, 6, &[0, 1, 2, 0, 2, 3]);
        let primitive = json!({
            "attributes": {"POSITION": position, "NORMAL": normal}, "indices": indices,
            "material": 0,
        });
        let mesh = self.push("meshes", json!({"primitives": [primitive]}));
        let mut node = node;
        node["mesh"] = json!(mesh);
        self.node(node)
    }

    /// A node of the scene.
    fn node(&mut self, node: Value) -> usize {
        let node = self.push("nodes", node);
        self.document["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
        node
    }

    fn bytes(&self) -> Vec<u8> {
        let mut document = self.document.clone();
        document["buffers"][0]["byteLength"] = json!(self.bin.len());
        glb_of(&document, &self.bin)
    }

    fn read(&self) -> Result<GltfMesh, ReadError> {
        read(self.bytes())
    }
}

fn glb_of(document: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut out = b"glTF".to_vec();
    let length = 28 + json.len() + bin.len();
    for word in [2, length as u32, json.len() as u32, 0x4E4F_534A] {
        out.extend(word.to_le_bytes());
    }
    out.extend(json);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(0x004E_4942u32.to_le_bytes());
    out.extend(bin);
    out
}

pub(super) fn document(bytes: &[u8]) -> Value {
    serde_json::from_slice(&bytes[source::Source::new(bytes.to_vec()).unwrap().json]).unwrap()
}

/// The binary chunk.
pub(super) fn bin(bytes: &[u8]) -> &[u8] {
    let json = source::Source::new(bytes.to_vec()).unwrap().json;
    &bytes[json.end + 8..]
}

fn written(gltf: &GltfMesh, positions: &[Point]) -> Vec<u8> {
    write(gltf, positions, Normals::Follow).unwrap().bytes
}

#[test]
fn all_triangles_of_the_scene_are_read_where_the_scene_shows_them() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    // A turn by 90° about z, then a move, below a parent that doubles.
    let child = builder.square(
        0.25,
        json!({"rotation": [0.0, 0.0, 0.5f64.sqrt(), 0.5f64.sqrt()], "translation": [0, 0, 1]}),
    );
    builder.document["scenes"][0]["nodes"].as_array_mut().unwrap().pop();
    builder.node(json!({"scale": [2, 2, 2], "children": [child]}));
    // Not in the scene.
    builder.square(9.0, json!({}));
    builder.document["scenes"][0]["nodes"].as_array_mut().unwrap().pop();
    let glb = builder.read().unwrap();
    assert_eq!(glb.mesh().triangles(), [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]);
    let v = glb.mesh().vertices();
    assert_eq!(v[1], Point::new(1.0, 0.0, 0.0));
    assert!((v[5] - Point::new(0.0, 2.0, 2.5)).norm() < 1e-15, "{}", v[5]);
    assert!(!glb.is_single_precision());
}

#[test]
fn nodes_that_mirror_keep_the_outside_out() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    builder.square(0.0, json!({"scale": [-1, 1, 1]}));
    builder.square(0.0, json!({"scale": [-1, -1, 1]}));
    let glb = builder.read().unwrap();
    for (t, _) in glb.mesh().triangles().iter().enumerate() {
        let [a, b, c] = glb.mesh().corners(t);
        assert!((b - a).cross(&(c - a)).z > 0.0, "triangle {t}");
    }
    assert_eq!(glb.mesh().triangles()[2], [4, 6, 5]);
    let moved: Vec<Point> = glb.mesh().vertices().iter().map(|p| p + Vector::z() * 0.5).collect();
    let again = read(written(&glb, &moved)).unwrap();
    assert_eq!(
        (again.mesh().triangles(), again.mesh().vertices()),
        (glb.mesh().triangles(), &moved[..])
    );
}

#[test]
fn without_moves_the_bytes_stay_and_else_only_what_moved_and_its_bounds() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({"name": "shirt"}));
    builder.square(0.5, json!({"scale": [0.01, 0.01, 0.01]}));
    let glb = builder.read().unwrap();
    assert_eq!(written(&glb, glb.mesh().vertices()), builder.bytes());
    let mut moved = glb.mesh().vertices().to_vec();
    moved[6] += Vector::new(0.001, 0.0, -0.0031);
    let expected = glb.positions_as_written(&moved);
    assert_eq!(expected[..6], moved[..6]);
    assert!((expected[6] - moved[6]).norm() < 1e-9 && expected[6] != moved[6]);
    let bytes = written(&glb, &moved);
    let again = read(bytes.clone()).unwrap();
    assert_eq!(again.mesh().vertices(), expected);
    // The document is the same but for the bounds of the second accessor.
    let (mut before, after) = (document(&builder.bytes()), document(&bytes));
    before["accessors"][3]["min"] = after["accessors"][3]["min"].clone();
    before["accessors"][3]["max"] = after["accessors"][3]["max"].clone();
    assert_eq!(before, after);
    let least = after["accessors"][3]["min"][2].as_f64().unwrap();
    assert!((least - 0.19).abs() < 1e-6, "{least}");
    // 12 bytes of a position, and normals of its square.
    let (was, is) = (bin(glb.bytes()), bin(&bytes));
    assert_eq!(was.len(), is.len());
    let first = glb.parts[1].positions.at(0);
    assert_eq!(was[..first], is[..first], "the first square");
}

#[test]
fn normals_turn_with_the_surface_in_the_coordinates_of_their_node() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({"rotation": [0.5f64.sqrt(), 0, 0, 0.5f64.sqrt()]}));
    let glb = builder.read().unwrap();
    // In the scene the square faces −y. It is turned to face +x.
    let v = glb.mesh().vertices();
    assert!((v[3] - Point::new(0.0, 0.0, 1.0)).norm() < 1e-15);
    let turned: Vec<Point> = v.iter().map(|p| Point::new(-p.y, p.x, p.z)).collect();
    let again = read(written(&glb, &turned)).unwrap();
    let normals = again.parts[0].normals.unwrap();
    // What faces +x in the scene faces +x in the node, which turns about x.
    for k in 0..4 {
        let n = Vector::from(normals.values::<3>(&again.source, k));
        assert!((n - Vector::x()).norm() < 1e-6, "{n}");
    }
}

#[test]
fn tangents_turn_with_the_normals_and_keep_their_side() {
    // As floats, as bytes that stand for shares, and as others, which are replaced by floats.
    for (code, normalized) in [(5126, false), (5120, true), (5120, false)] {
        let mut builder = Builder::new();
        builder.square(0.0, json!({"rotation": [0.5f64.sqrt(), 0, 0, 0.5f64.sqrt()]}));
        let tangents = match code {
            5126 => builder.floats("VEC4", 4, [[1.0, 0.0, 0.0, -1.0]; 4].as_flattened()),
            _ => {
                let one = if normalized { 127 } else { 1 };
                let row = [one, 0, 0, (-(one as i8)) as u8];
                builder.accessor("VEC4", code, 4, &[row; 4].concat())
            }
        };
        builder.document["accessors"][tangents]["normalized"] = json!(normalized);
        if !normalized && code == 5120 {
            builder.document["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
            builder.document["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
        }
        let attributes = &mut builder.document["meshes"][0]["primitives"][0]["attributes"];
        attributes["TANGENT"] = json!(tangents);
        let glb = builder.read().unwrap();
        // It lies along +x and faces −y in the scene; turned about z it lies along −y.
        let v = glb.mesh().vertices();
        let turned: Vec<Point> = v.iter().map(|p| Point::new(p.y, -p.x, p.z)).collect();
        let again = read(written(&glb, &turned)).unwrap();
        let tangents = again.parts[0].tangents.unwrap();
        for k in 0..4 {
            // −y of the scene is +z of the node.
            let [x, y, z, side] = tangents.values::<4>(&again.source, k);
            assert!((Vector::new(x, y, z) - Vector::z()).norm() < 1e-6, "{code} {x} {y} {z}");
            assert!((side + 1.0).abs() < 1e-6, "{side}");
        }
    }
}

#[test]
fn tangents_lie_along_the_surface_where_a_node_stretches_it() {
    // The surface slopes along x; a node that stretches x makes it flatter. Tangents go with the
    // surface, at right angles to what normals do.
    let mut builder = Builder::new();
    builder.square(0.0, json!({"scale": [3, 1, 1]}));
    let slope: Vec<f32> = [[0., 0., 0.], [1., 0., 1.], [1., 1., 1.], [0., 1., 0.]].concat();
    let positions = builder.floats("VEC3", 4, &slope);
    let along = 0.5f32.sqrt();
    let tangents = builder.floats("VEC4", 4, [[along, 0.0, along, 1.0]; 4].as_flattened());
    let attributes = &mut builder.document["meshes"][0]["primitives"][0]["attributes"];
    (attributes["POSITION"], attributes["TANGENT"]) = (json!(positions), json!(tangents));
    let glb = builder.read().unwrap();
    // Laid flat, the surface is level in the node as well.
    let flat: Vec<Point> =
        glb.mesh().vertices().iter().map(|p| Point::new(p.x, p.y, 0.0)).collect();
    let again = read(written(&glb, &flat)).unwrap();
    let tangents = again.parts[0].tangents.unwrap();
    for k in 0..4 {
        let [x, y, z, side] = tangents.values::<4>(&again.source, k);
        assert!((Vector::new(x, y, z) - Vector::x()).norm() < 1e-6, "{x} {y} {z}");
        assert_eq!(side, 1.0);
    }
}

#[test]
fn joints_and_morph_targets_place_vertices_and_are_undone() {
    let mut builder = Builder::new();
    let node = builder.square(0.0, json!({"translation": [5, 5, 5], "skin": 0}));
    let offsets = builder.floats("VEC3", 4, [[0.0, 0.0, 1.0]; 4].as_flattened());
    let joints = builder.accessor("VEC4", 5121, 4, &[[0, 1, 0, 0]; 4].concat());
    let weights =
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0]];
    let weights = builder.floats("VEC4", 4, weights.as_flattened());
    let mut bind = [0.0; 32];
    for k in [0, 5, 10, 15, 16, 21, 26, 31] {
        bind[k] = 1.0;
    }
    bind[28] = -1.0; // the second joint's rest place is at x = 1
    let bind = builder.floats("MAT4", 2, &bind);
    let first = builder.node(json!({}));
    let second = builder.node(json!({"translation": [1, 0, 0], "scale": [1, 3, 1]}));
    builder.document["skins"] = json!([{"joints": [first, second], "inverseBindMatrices": bind}]);
    let mesh = &mut builder.document["meshes"][0];
    mesh["weights"] = json!([0.5]);
    let primitive = &mut mesh["primitives"][0];
    primitive["attributes"]["JOINTS_0"] = json!(joints);
    primitive["attributes"]["WEIGHTS_0"] = json!(weights);
    primitive["targets"] = json!([{"POSITION": offsets}]);
    assert_eq!(node, 0);
    let glb = builder.read().unwrap();
    // Half of the morph target; the node's own transform does not count; the second joint
    // stretches by 3 along y.
    let expected = [[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [1.0, 2.0, 0.5], [0.0, 3.0, 0.5]];
    for (v, expected) in glb.mesh().vertices().iter().zip(expected) {
        assert!((v - Point::from(expected)).norm() < 1e-15, "{v}");
    }
    let moved: Vec<Point> =
        glb.mesh().vertices().iter().map(|p| p + Vector::new(0.1, 0.2, 0.3)).collect();
    let again = read(written(&glb, &moved)).unwrap();
    for (v, moved) in again.mesh().vertices().iter().zip(&moved) {
        assert!((v - moved).norm() < 1e-6, "{v}");
    }
    assert_eq!(again.mesh().vertices(), glb.positions_as_written(&moved));
}

#[test]
fn vertices_of_the_same_weights_in_another_order_lie_at_the_same_place() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({"skin": 0}));
    let place = builder.floats("VEC3", 4, [[0.3, 0.1, 0.7]; 4].as_flattened());
    let joints = [[0, 1, 2, 0], [2, 1, 0, 0], [1, 2, 0, 0], [0, 2, 1, 0]];
    let shares: [f32; 3] = [0.1, 0.27, 0.63];
    let weights =
        joints.map(|j| [0, 1, 2, 3].map(|k| if k < 3 { shares[j[k] as usize] } else { 0.0 }));
    let joints = builder.accessor("VEC4", 5121, 4, joints.as_flattened());
    let weights = builder.floats("VEC4", 4, weights.as_flattened());
    let turn = |angle: f64| [0.0, 0.0, (angle / 2.0).sin(), (angle / 2.0).cos()];
    let nodes = [0.1, 0.37, 1.3]
        .map(|a| builder.node(json!({"rotation": turn(a), "translation": [a, 1, 0]})));
    builder.document["skins"] = json!([{"joints": nodes}]);
    let attributes = &mut builder.document["meshes"][0]["primitives"][0]["attributes"];
    attributes["POSITION"] = json!(place);
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    let glb = builder.read().unwrap();
    let first = glb.mesh().vertices()[0];
    assert!(glb.mesh().vertices().iter().all(|p| *p == first), "{:?}", glb.mesh().vertices());
}

#[test]
fn in_the_pose_of_binding_weights_do_not_matter() {
    // Matrices of binding in single precision undo places of joints but for rounding.
    let places = [[0.1, 0.9, 0.03], [0.3, 1.3, -0.07], [0.7, 1.1, 0.013]];
    let vertices = |stretch: f64| {
        let mut builder = Builder::new();
        builder.square(0.0, json!({"skin": 0}));
        let place = builder.floats("VEC3", 4, [[0.3, 1.2, 0.7]; 4].as_flattened());
        let joints = builder.accessor("VEC4", 5121, 4, &[[0, 1, 2, 0]; 4].concat());
        let weights = [[0.2, 0.3, 0.5, 0.0], [0.204, 0.296, 0.5, 0.0], [1.0, 0.0, 0.0, 0.0]];
        let weights = [weights.as_flattened(), &[0.0, 0.0, 1.0, 0.0]].concat();
        let weights = builder.floats("VEC4", 4, &weights);
        let bind = places.map(|p: [f64; 3]| {
            let [x, y, z] = p.map(|x| -x as f32);
            [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0]
        });
        let bind = builder.floats("MAT4", 3, bind.as_flattened());
        let nodes =
            places.map(|p| builder.node(json!({"translation": [p[0] * stretch, p[1], p[2]]})));
        builder.document["skins"] = json!([{"joints": nodes, "inverseBindMatrices": bind}]);
        let attributes = &mut builder.document["meshes"][0]["primitives"][0]["attributes"];
        attributes["POSITION"] = json!(place);
        attributes["JOINTS_0"] = json!(joints);
        attributes["WEIGHTS_0"] = json!(weights);
        builder.read().unwrap().mesh().vertices().to_vec()
    };
    let bound = vertices(1.0);
    assert!(bound.iter().all(|p| *p == bound[0]), "{bound:?}");
    assert!((bound[0] - Point::new(0.3, 1.2, 0.7)).norm() < 1e-7);
    // Posed, however little, they do.
    let posed = vertices(1.0001);
    assert!((1..4).all(|k| posed[k] != posed[0]), "{posed:?}");
}

#[test]
fn joints_are_numbered_as_in_the_one_list_of_skins() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    let mut below = |node: Value| builder.push("nodes", node);
    let [foot, hand] = ["foot", "hand"].map(|name| below(json!({"name": name})));
    let leg = below(json!({"name": "leg", "children": [foot]}));
    let arm = below(json!({"name": "arm", "children": [hand]}));
    let hips = builder.node(json!({"name": "hips", "children": [leg, arm]}));
    let order = |skins: Value| {
        let mut builder = builder.clone();
        builder.document["skins"] = skins;
        let joints = builder.read().unwrap().joints().to_vec();
        assert!(joints.iter().enumerate().all(|(k, j)| j.parent.is_none_or(|p| p < k)));
        joints.into_iter().map(|joint| joint.name).collect::<Vec<_>>()
    };
    // Breadth first, as many exporters list them.
    let list = json!([hips, arm, leg, foot, hand]);
    let expected = ["hips", "arm", "leg", "foot", "hand"];
    assert_eq!(order(json!([{"joints": list}, {"joints": list}])), expected);
    let as_the_scene = ["hips", "leg", "foot", "arm", "hand"];
    assert_eq!(
        order(json!([{"joints": [hand, hips, arm, leg, foot]}])),
        as_the_scene,
        "a child first"
    );
    assert_eq!(
        order(json!([{"joints": list}, {"joints": [hips, leg]}])),
        as_the_scene,
        "two lists"
    );
}

#[test]
fn joints_of_another_armature_with_the_names_of_the_body_s_are_these() {
    let mut builder = Builder::new();
    // The garment's armature comes first, and has a joint more, below one that the body has, too.
    let mut armature = |extra: &[&str]| {
        let mut below = |name: &&str| builder.push("nodes", json!({"name": name}));
        let extra: Vec<usize> = extra.iter().map(&mut below).collect();
        let leg = builder.push("nodes", json!({"name": "leg", "children": extra}));
        let hips = builder.node(json!({"name": "hips", "children": [leg]}));
        [vec![hips, leg], extra].concat()
    };
    let [of_garment, of_body] = [armature(&["belt"]), armature(&[])];
    builder.document["skins"] = json!([{"joints": of_garment}, {"joints": of_body}]);
    builder.square(0.0, json!({"name": "garment", "skin": 0}));
    builder.square(1.0, json!({"name": "body", "skin": 1}));
    for name in ["body", "garment"] {
        let mesh = read_layer(builder.bytes(), Some(name), None).unwrap();
        let joints: Vec<(&str, Option<usize>)> =
            mesh.joints().iter().map(|joint| (joint.name.as_str(), joint.parent)).collect();
        assert_eq!(joints, [("hips", None), ("leg", Some(0)), ("belt", Some(1))], "{name}");
    }
}

#[test]
fn joints_without_a_name_are_called_by_their_node() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    let hand = builder.push("nodes", json!({}));
    let arm = builder.node(json!({"name": "", "children": [hand]}));
    builder.document["skins"] = json!([{"joints": [arm, hand]}]);
    let names: Vec<String> =
        builder.read().unwrap().joints().iter().map(|joint| joint.name.clone()).collect();
    assert_eq!(names, [format!("joint {arm}"), format!("joint {hand}")]);
}

#[test]
fn joints_of_skins_lie_where_the_scene_shows_them() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    assert_eq!(builder.read().unwrap().joints(), []);
    // An armature in centimetres that stands along z, a joint in it, a node between, and a joint there.
    let turn = [-0.5f64.sqrt(), 0.0, 0.0, 0.5f64.sqrt()];
    let mut below = |node: Value| builder.push("nodes", node);
    let hand = below(json!({"name": "hand", "translation": [50, 0, 0]}));
    let between = below(json!({"children": [hand], "scale": [0.5, 1, 1]}));
    let arm = below(json!({"name": "arm", "translation": [0, 0, 100], "children": [between]}));
    builder.node(json!({"children": [arm], "scale": [0.01, 0.01, 0.01], "rotation": turn}));
    let skins = json!([{"joints": [hand]}, {"joints": [hand, arm]}, {"joints": [99]}]);
    builder.document["skins"] = skins;
    let joint = |name: &str, parent, place: [f64; 3]| SkinJoint {
        name: name.into(),
        parent,
        place: place.into(),
    };
    let expected = [joint("arm", None, [0.0, 1.0, 0.0]), joint("hand", Some(0), [0.25, 1.0, 0.0])];
    let found = builder.read().unwrap();
    assert_eq!(found.joints().len(), 2);
    for (found, expected) in found.joints().iter().zip(&expected) {
        assert_eq!((&found.name, found.parent), (&expected.name, expected.parent));
        assert!((found.place - expected.place).norm() < 1e-12, "{found:?}");
    }
}

#[test]
fn strips_fans_and_lists_without_indices_are_triangles() {
    for (mode, expected) in
        [(4, vec![[0, 1, 2]]), (5, vec![[0, 1, 2], [1, 3, 2]]), (6, vec![[1, 2, 0], [2, 3, 0]])]
    {
        let mut builder = Builder::new();
        builder.square(0.0, json!({}));
        let primitive = &mut builder.document["meshes"][0]["primitives"][0];
        primitive["mode"] = json!(mode);
        primitive.as_object_mut().unwrap().remove("indices");
        assert_eq!(builder.read().unwrap().mesh().triangles(), expected, "{mode}");
    }
    // A line is no triangle.
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    builder.document["meshes"][0]["primitives"][0]["mode"] = json!(1);
    assert!(matches!(builder.read(), Err(ReadError::NoTriangles)));
}

#[test]
fn positions_that_share_bytes_are_not_written_as_something_else() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({}));
    builder.square(1.0, json!({}));
    // The second square's first corner is the first one's last.
    let at = builder.document["bufferViews"][0]["byteOffset"].as_u64().unwrap() + 36;
    builder.document["bufferViews"][3]["byteOffset"] = json!(at);
    let glb = builder.read().unwrap();
    let mut moved = glb.mesh().vertices().to_vec();
    moved[3].x += 0.5;
    let fault = write(&glb, &moved, Normals::Follow).unwrap_err();
    assert!(matches!(fault, WriteError::Overlap), "{fault}");
    moved[3].x = 1e39;
    let fault = write(&glb, &moved, Normals::Follow).unwrap_err();
    assert!(matches!(fault, WriteError::Range { vertex: 3 }), "{fault}");
}

#[test]
fn damaged_bytes_never_panic_and_what_is_written_is_read_again() {
    use rand::{Rng, RngExt, SeedableRng};
    let mut builder = Builder::new();
    builder.square(0.0, json!({"rotation": [0.1, 0.2, 0.3, 0.9]}));
    builder.square(1.0, json!({}));
    let whole = builder.bytes();
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(5);
    let mut accepted = 0;
    for _ in 0..4000 {
        let mut bytes = whole.clone();
        for _ in 0..random.random_range(1..4) {
            let at = random.random_range(0..bytes.len());
            bytes[at] = random.next_u32() as u8;
        }
        let Ok(glb) = read(bytes) else { continue };
        accepted += 1;
        let moved: Vec<Point> =
            glb.mesh().vertices().iter().map(|p| p + Vector::repeat(0.01)).collect();
        if let Ok(files) = write(&glb, &moved, Normals::Follow) {
            let again = read(files.bytes).unwrap();
            assert_eq!(again.mesh().vertices(), glb.positions_as_written(&moved));
        }
    }
    assert!(accepted > 200, "{accepted}");
}

#[test]
fn a_node_is_a_layer_and_several_are_written_into_one_file() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({"name": "shirt"}));
    let nested = builder.square(0.5, json!({"name": "coat", "scale": [2, 2, 2]}));
    builder.document["scenes"][0]["nodes"].as_array_mut().unwrap().pop();
    builder.node(json!({"name": "outer", "translation": [0, 0, 1], "children": [nested]}));
    let bytes = builder.bytes();
    let [shirt, coat, outer] =
        ["shirt", "coat", "outer"].map(|name| read_layer(bytes.clone(), Some(name), None).unwrap());
    assert_eq!(shirt.mesh().vertices(), &builder.read().unwrap().mesh().vertices()[..4]);
    assert_eq!(coat.mesh().vertices()[2], Point::new(2.0, 2.0, 2.0));
    assert_eq!(coat.mesh(), outer.mesh());
    assert!(coat.shares_vertices_with(&outer) && !coat.shares_vertices_with(&shirt));

    let moved = |glb: &GltfMesh, by: f64| -> Vec<Point> {
        let moved: Vec<Point> =
            glb.mesh().vertices().iter().map(|p| p + Vector::repeat(by)).collect();
        glb.positions_as_written(&moved)
    };
    let (x, y) = (moved(&shirt, 0.25), moved(&coat, -0.125));
    let out =
        write_layers(&[(&shirt, &x), (&coat, &y)], Normals::Follow, Beside::Files).unwrap().bytes;
    for (name, expected) in [("shirt", &x), ("coat", &y)] {
        assert_eq!(read_layer(out.clone(), Some(name), None).unwrap().mesh().vertices(), expected);
    }
    // Nothing moved: the very bytes.
    let still = [(&shirt, shirt.mesh().vertices()), (&coat, coat.mesh().vertices())];
    assert_eq!(write_layers(&still, Normals::Follow, Beside::Files).unwrap().bytes, bytes);
    // The same vertices twice, and layers of two files.
    let twice = [(&coat, &y[..]), (&outer, outer.mesh().vertices())];
    let fault = write_layers(&twice, Normals::Follow, Beside::Files).unwrap_err();
    assert!(matches!(fault, WriteError::Overlap), "{fault}");
    let other = builder.square(9.0, json!({"name": "hat"}));
    let hat = read_layer(builder.bytes(), Some("hat"), None).unwrap();
    assert_eq!(other, 3);
    let two = [(&coat, &y[..]), (&hat, hat.mesh().vertices())];
    let fault = write_layers(&two, Normals::Follow, Beside::Files).unwrap_err();
    assert!(matches!(fault, WriteError::SeveralFiles), "{fault}");
}

#[test]
fn a_frame_has_no_animation_that_would_pose_it_again() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({"name": "shirt"}));
    let still = builder.read().unwrap();
    let layers = [(&still, still.mesh().vertices())];
    assert_eq!(write_frame(&layers, Normals::Follow).unwrap().bytes, still.bytes());

    let times = builder.floats("SCALAR", 1, &[0.0]);
    let moves = builder.floats("VEC3", 1, &[7.0, 0.0, 0.0]);
    builder.document["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
        "samplers": [{"input": times, "output": moves}],
    }]);
    let glb = builder.read().unwrap();
    let moved: Vec<Point> =
        glb.mesh().vertices().iter().map(|p| p + Vector::repeat(0.25)).collect();
    for positions in [&moved[..], glb.mesh().vertices()] {
        let frame = write_frame(&[(&glb, positions)], Normals::Follow).unwrap().bytes;
        assert_eq!(read(frame.clone()).unwrap().mesh().vertices(), positions);
        let (mut before, after) = (document(glb.bytes()), document(&frame));
        assert!(after.get("animations").is_none());
        assert_eq!(after["nodes"], before["nodes"].take());
    }
    // Elsewhere they stay.
    assert!(document(&written(&glb, &moved)).get("animations").is_some());
}

#[test]
fn a_node_that_is_no_layer_is_refused() {
    let mut builder = Builder::new();
    builder.square(0.0, json!({"name": "left"}));
    builder.square(1.0, json!({"name": "hat"}));
    builder.square(2.0, json!({"name": "hat"}));
    builder.node(json!({"name": "lamp"}));
    let fault = |builder: &Builder, name: &str| {
        read_layer(builder.bytes(), Some(name), None).unwrap_err().to_string()
    };
    let missing = fault(&builder, "Left");
    assert!(missing.contains("no node `Left`") && missing.contains("`left`, `hat`"), "{missing}");
    assert!(fault(&builder, "hat").contains("nodes 1 and 2 are both named `hat`"));
    assert!(fault(&builder, "lamp").contains("no triangles"));
}
