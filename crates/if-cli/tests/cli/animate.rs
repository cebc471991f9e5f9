//! `ifg animate` on the mannequin, which is written with its skeleton and weights.

use crate::folder::Folder;
use if_body::mannequin::{self, Garment, MannequinParams, rig};
use if_body::skinning::{blends, pose_points};
use if_body::{Joint, Motion, Skeleton, SkinWeights, TemplateBody};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::tube;
use if_mesh::gltf::read_layer;
use if_mesh::ply::{PlyMesh, WriteParams, read_path, write_path};
use if_pipeline::animate::AnimateParams;
use serde_json::{Value, json};
use std::f64::consts::FRAC_PI_8;

/// The body with weights, trousers without, and a motion of three frames that lifts a knee.
pub(crate) fn scene() -> Folder {
    let folder = Folder::new();
    let params = MannequinParams { resolution: 0.7, overlap: 0.0 };
    let mesh = mannequin::body(&params);
    let skin = rig::skin_weights(mesh.vertices());
    let body = TemplateBody { mesh, skin, skeleton: rig::skeleton() };
    std::fs::create_dir(folder.path("doll")).unwrap();
    body.write(&folder.path("doll")).unwrap();
    let trousers = PlyMesh::new(mannequin::garment(Garment::Trousers, &params));
    let path = folder.path("doll/trousers.ply");
    write_path(&trousers, trousers.mesh.vertices(), &WriteParams::default(), &path).unwrap();
    write(&folder, &motion());
    folder
}

fn write(folder: &Folder, motion: &Value) {
    std::fs::write(folder.path("doll/motion.json"), motion.to_string()).unwrap();
}

fn motion() -> Value {
    let joints: Vec<String> = rig::skeleton().names().map(str::to_owned).collect();
    let thigh = joints.iter().position(|n| n == "left_thigh").unwrap();
    let frame = |k: f64| {
        let half = -FRAC_PI_8 - 0.04 * k;
        let mut rot = vec![[1.0, 0.0, 0.0, 0.0]; joints.len()];
        rot[thigh] = [half.cos(), half.sin(), 0.0, 0.0];
        json!({"root_t": [0.0, 0.0, 0.02 * k], "rot": rot})
    };
    let frames = [0.0, 1.0, 2.0].map(frame);
    json!({"fps": 30, "joints": joints, "frames": frames})
}

const ANIMATE: &str =
    "animate --body doll/body_clean.ply doll/trousers.ply --motion doll/motion.json";

#[test]
fn a_knee_is_lifted_in_clean_frames_that_point_caches_hold() {
    let folder = scene();
    let run = folder.ifg(&format!("{ANIMATE} --out moved --strict --meshes --gltf")).expect(0);
    for words in ["3 frames: 3 clean, 3 clean everywhere", "Weights taken from the body: trousers"]
    {
        assert!(run.stdout.contains(words), "{words}\n{}", run.stdout);
    }
    let report: Value = serde_json::from_slice(&folder.read("moved/report.json")).unwrap();
    assert_eq!(report["params"], json!(AnimateParams::default()));
    let frames = report["report"]["frames"].as_array().unwrap();
    assert!(frames.iter().all(|f| f["smoothed"] == true));
    assert!(frames[0]["pairs_before"].as_u64().unwrap() > 0);
    assert!(frames.iter().all(|f| f["pairs"] == 0 && f["new_own_pairs"] == 0 && f["inside"] == 0));
    // The last frame of the cache is the mesh of the last frame, and that is clean by `check`.
    let mesh = read_path(&folder.path("moved/meshes/000002/trousers.ply")).unwrap().mesh;
    let cache = folder.read("moved/trousers.pc2");
    let n = mesh.vertices().len();
    assert_eq!(cache.len(), 32 + 3 * 12 * n);
    let singles = |bytes: &[u8]| -> Vec<f32> {
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    };
    let flat = |points: &[Point]| -> Vec<f32> {
        points.iter().flat_map(|p| [p.x, p.y, p.z]).map(|x| x as f32).collect()
    };
    let [first, _, last] =
        [0, 1, 2].map(|k| singles(&cache[32 + k * 12 * n..32 + (k + 1) * 12 * n]));
    assert_eq!(last, flat(mesh.vertices()));
    // In the glTF file the first frame is the shape of the mesh, and the end of the file what is added
    // to it for the last frame: the same bits.
    let glb = folder.read("moved/motion.glb");
    let shape = read_layer(glb.clone(), Some("trousers"), None).unwrap();
    assert_eq!(flat(shape.mesh().vertices()), first);
    let added = singles(&glb[glb.len() - 12 * n..]);
    assert!(first.iter().zip(&added).map(|(a, b)| a + b).eq(last), "exact in single precision");
    folder
        .ifg("check --strict --body moved/meshes/000002/body_clean.ply moved/meshes/000002/trousers.ply")
        .expect(0);
    for picture in ["moved/motion.png", "moved/strip.png"] {
        assert_eq!(&folder.read(picture)[1..4], b"PNG");
    }
    let page = String::from_utf8(folder.read("moved/report.html")).unwrap();
    assert!(page.contains(r#""states":["frame 0","frame 1","frame 2"]"#) && !page.contains("http"));
    // Done frames are kept, and give the same bytes.
    let again = folder.ifg(&format!("{ANIMATE} --out moved --no-pictures")).expect(0);
    assert!(again.stdout.contains("3 frames kept from an earlier run"), "{}", again.stdout);
    assert_eq!(folder.read("moved/trousers.pc2"), cache);
}

#[test]
fn the_depth_of_a_body_is_above_zero() {
    for (depth, expected) in [("0", "above zero is needed"), ("-1cm", "cannot be negative")] {
        let run = scene().ifg(&format!("{ANIMATE} --out moved --body-depth {depth}")).expect(2);
        assert!(run.stderr.contains(expected), "{}", run.stderr);
    }
}

#[test]
fn what_passes_through_what_between_frames_is_named() {
    let folder = scene();
    let run = folder.ifg(&format!("{ANIMATE} --out slow --strict --continuous --no-pictures"));
    let run = run.expect(0);
    let words = "layers pass through one another in 0 of 2 intervals";
    assert!(run.stdout.contains(words), "{}", run.stdout);
    // A thin limb, 10 m from its joint, jumps through a sheet of cloth.
    limb_and_cloth(&folder);
    const JUMP: &str =
        "animate --body limb/body_clean.ply limb/cloth.ply --motion limb/motion.json --out jump";
    let run = folder.ifg(&format!("{JUMP} --strict --continuous")).expect(1);
    assert!(run.stderr.contains("in 1 of 1 intervals triangles pass"), "{}", run.stderr);
    assert!(run.stdout.contains("2 frames: 2 clean, 2 clean everywhere"), "{}", run.stdout);
    let report: Value = serde_json::from_slice(&folder.read("jump/report.json")).unwrap();
    let interval = &report["between_frames"][0];
    assert!(interval["crossings"].as_u64().unwrap() > 10, "{interval}");
    assert_eq!(interval["first"][0]["layers"], json!(["body_clean", "cloth"]));
    let page = String::from_utf8(folder.read("jump/report.html")).unwrap();
    assert!(page.contains("Between frames") && page.contains(", cloth "));
    assert!(report["between_seconds"].as_f64().unwrap() > 0.0, "{report}");
    // Frames are clean, so without --strict this is no failure.
    let run = folder.ifg(&format!("{JUMP} --continuous --no-pictures")).expect(0);
    assert!(run.stdout.contains("s for the ways between"), "{}", run.stdout);
    let run = folder.ifg(&format!("{JUMP} --no-pictures")).expect(0);
    assert!(!run.stdout.contains("s for the ways between"), "{}", run.stdout);
}

/// A rod that turns about a far joint by 24 cm from the first frame to the second, and a sheet of
/// cloth on its way that stays.
fn limb_and_cloth(folder: &Folder) {
    let weights = |mesh: &TriMesh, joint: u16| {
        let n = mesh.vertices().len();
        SkinWeights::new(vec![[joint, 0, 0, 0]; n], vec![[1.0, 0.0, 0.0, 0.0]; n], 2).unwrap()
    };
    let joint = |name: &str, parent| Joint {
        name: name.into(),
        parent,
        head: Point::new(0.0, 0.0, -10.0),
        tail: Point::origin(),
    };
    let mesh = tube(0.004, 0.3, 8, 8, true);
    let skin = weights(&mesh, 1);
    let skeleton = Skeleton::new(vec![joint("root", None), joint("limb", Some(0))]).unwrap();
    std::fs::create_dir(folder.path("limb")).unwrap();
    TemplateBody { mesh, skin, skeleton }.write(&folder.path("limb")).unwrap();
    let sheet = tube(0.1, 0.2, 24, 8, false);
    let flat = |p: &Point| Point::new(0.12 + 0.1 * p.x, p.y, p.z);
    // The half of an open tube on the side of the rod, pressed flat.
    let is_kept = |t: &&[u32; 3]| t.iter().all(|v| sheet.vertices()[*v as usize].x <= 1e-9);
    let kept: Vec<[u32; 3]> = sheet.triangles().iter().filter(is_kept).copied().collect();
    let mut used: Vec<u32> = kept.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let place = |v: &u32| used.binary_search(v).unwrap() as u32;
    let vertices = used.iter().map(|v| flat(&sheet.vertices()[*v as usize])).collect();
    let cloth = TriMesh::new(vertices, kept.iter().map(|t| t.each_ref().map(place)).collect());
    let mut cloth = PlyMesh::new(cloth.unwrap());
    cloth.vertex_properties = weights(&cloth.mesh, 0).to_properties();
    let path = folder.path("limb/cloth.ply");
    write_path(&cloth, cloth.mesh.vertices(), &WriteParams::default(), &path).unwrap();
    let frame = |angle: f64| {
        let (cos, sin) = ((0.5 * angle).cos(), (0.5 * angle).sin());
        json!({"root_t": [0, 0, 0], "rot": [[1, 0, 0, 0], [cos, 0.0, sin, 0.0]]})
    };
    let motion = json!({"joints": ["root", "limb"], "frames": [frame(0.0), frame(0.024)]});
    std::fs::write(folder.path("limb/motion.json"), motion.to_string()).unwrap();
}

#[test]
fn a_folder_of_bodies_carries_garments_without_a_skeleton() {
    let folder = scene();
    // The bodies of the motion's frames as meshes without weights, and one that is not in metres.
    let rest = read_path(&folder.path("doll/body_clean.ply")).unwrap().mesh;
    let skin = rig::skin_weights(rest.vertices());
    let motion = Motion::read(motion().to_string().as_bytes(), &rig::skeleton()).unwrap();
    std::fs::create_dir(folder.path("bodies")).unwrap();
    let write = |name: &str, mesh: TriMesh| {
        let ply = PlyMesh::new(mesh);
        let path = folder.path(name);
        write_path(&ply, ply.mesh.vertices(), &WriteParams::default(), &path).unwrap();
    };
    for (k, pose) in motion.poses.iter().enumerate() {
        let maps = blends(&skin, &rig::skeleton().transforms(pose).unwrap());
        let posed = pose_points(rest.vertices(), &maps);
        write(&format!("bodies/body_{k:04}.ply"), rest.with_vertices(posed).unwrap());
    }
    write("bare.ply", rest.clone());
    const CARRY: &str = "animate --body bare.ply doll/trousers.ply --motion bodies --no-pictures";
    let run = folder.ifg(&format!("{CARRY} --out carried --strict --meshes --gltf")).expect(0);
    let words = "3 frames: 3 clean, 3 clean everywhere";
    assert!(run.stdout.contains(words), "{}", run.stdout);
    // The trousers are where the skeleton would have them, but for folds.
    folder.ifg(&format!("{ANIMATE} --out moved --no-pictures --meshes")).expect(0);
    let frame = |out: &str| {
        let path = format!("{out}/meshes/000002/trousers.ply");
        read_path(&folder.path(&path)).unwrap().mesh.vertices().to_vec()
    };
    let (carried, moved) = (frame("carried"), frame("moved"));
    let apart = carried.iter().zip(&moved).map(|(a, b)| (a - b).norm()).sum::<f64>();
    let mean = apart / carried.len() as f64;
    let trousers = read_path(&folder.path("doll/trousers.ply")).unwrap().mesh;
    let far = moved.iter().zip(trousers.vertices()).map(|(a, b)| (a - b).norm());
    assert!(mean < 5e-3 && far.fold(0.0, f64::max) > 0.3, "{mean}");
    // One frame of them, as it is when the walk begins there.
    folder.ifg(&format!("{CARRY} --out one --strict --frames 0 --meshes --gltf")).expect(0);
    assert!(folder.path("one/meshes/000000").exists() && folder.path("one/motion.glb").exists());
    // Another one into the same folder: frames have their numbers in the motion, the first run's are gone.
    folder.ifg(&format!("{CARRY} --out one --strict --frames 1 --meshes")).expect(0);
    let [first, second] = ["one/meshes/000000", "one/meshes/000001"].map(|f| folder.path(f));
    assert!(second.exists() && !first.exists() && !folder.path("one/motion.glb").exists());
    let report: Value = serde_json::from_slice(&folder.read("one/report.json")).unwrap();
    assert_eq!(report["report"]["frames"][0]["frame"], 1);
    // A point cache has them as well, and the step from one to the next.
    let cache = folder.read("one/trousers.pc2");
    assert_eq!(
        (&cache[20..24], &cache[24..28]),
        (&1f32.to_le_bytes()[..], &1f32.to_le_bytes()[..])
    );
    // A number of a series is missing.
    std::fs::copy(folder.path("bodies/body_0002.ply"), folder.path("bodies/body_0004.ply"))
        .unwrap();
    let run = folder.ifg(&format!("{CARRY} --out gap --frames 0")).expect(0);
    assert!(run.stderr.contains("frames seem to be missing"), "{}", run.stderr);
    assert!(run.stderr.contains("body_0002.ply") && run.stderr.contains("body_0004.ply"));
    std::fs::remove_file(folder.path("bodies/body_0004.ply")).unwrap();
    // A run that goes on has the same bytes.
    let last = folder.read("carried/trousers.pc2");
    std::fs::remove_file(folder.path("carried/frames/000002.frame")).unwrap();
    let run = folder.ifg(&format!("{CARRY} --out carried --strict")).expect(0);
    assert!(!run.stderr.contains("missing"), "{}", run.stderr);
    assert!(run.stdout.contains("2 frames kept"), "{}", run.stdout);
    assert_eq!(folder.read("carried/trousers.pc2"), last);
    // What is written into the folder of bodies would be a body.
    let run = folder.ifg(&format!("{CARRY} --out bodies")).expect(2);
    assert!(run.stderr.contains("output `bodies` is the input file `bodies` itself"));
    // A body of other vertices, and options without use.
    write("bodies/body_0003.ply", tube(0.1, 0.2, 8, 4, true));
    let run = folder.ifg(&format!("{CARRY} --out other")).expect(2);
    assert!(run.stderr.contains("body_0003.ply") && run.stderr.contains("at rest has"));
    let run = folder.ifg(&format!("{CARRY} --out other --skeleton doll/skeleton.json")).expect(2);
    assert!(run.stderr.contains("has no use for --skeleton"), "{}", run.stderr);
}

#[test]
fn inputs_are_not_replaced_and_names_are_checked_before_any_work() {
    let folder = scene();
    folder.ifg(&format!("{ANIMATE} --out moved --no-pictures --meshes --frames 0")).expect(0);
    let first = folder.read("moved/meshes/000000/trousers.ply");
    std::fs::write(folder.path("moved/meshes/000000/mine.txt"), "mine").unwrap();
    const AGAIN: &str = "animate --body moved/meshes/000000/body_clean.ply moved/meshes/000000/trousers.ply \
        --skeleton doll/skeleton.json --motion doll/motion.json --out moved --no-pictures";
    let run = folder.ifg(&format!("{AGAIN} --meshes --frames 0")).expect(2);
    assert!(run.stderr.contains("is the input file `moved/meshes/000000/"), "{}", run.stderr);
    // What an earlier run wrote stays if it is an input now, as does what it did not write.
    folder.ifg(&format!("{AGAIN} --meshes --frames 1")).expect(0);
    assert_eq!(folder.read("moved/meshes/000000/trousers.ply"), first);
    assert_eq!(folder.read("moved/meshes/000000/mine.txt"), b"mine");
    folder.ifg(&format!("{ANIMATE} --out moved --no-pictures --frames 2")).expect(0);
    assert!(folder.path("moved/meshes/000000/mine.txt").exists());
    assert!(!folder.path("moved/meshes/000001").exists());

    // A report that is not of this program says nothing of what it wrote, nor a changed one of other files.
    std::fs::create_dir(folder.path("mine")).unwrap();
    folder.write("mine/data.csv", "mine");
    folder.write("mine/report.json", r#"{"tool": "mine", "outputs": ["data.csv"]}"#);
    const MINE: &str = "--out mine --no-pictures --frames 0";
    folder.ifg(&format!("{ANIMATE} {MINE}")).expect(0);
    assert_eq!(folder.read("mine/data.csv"), b"mine");
    let report = String::from_utf8(folder.read("mine/report.json")).unwrap();
    folder.write("mine/report.json", report.replace("trousers.pc2", "data.csv"));
    folder.ifg(&format!("{ANIMATE} {MINE}")).expect(0);
    assert_eq!(folder.read("mine/data.csv"), b"mine");

    std::fs::create_dir(folder.path("other")).unwrap();
    std::fs::copy(folder.path("doll/trousers.ply"), folder.path("other/Trousers.ply")).unwrap();
    let same = ANIMATE.replace("doll/trousers.ply", "doll/trousers.ply other/Trousers.ply");
    let run = folder.ifg(&format!("{same} --out twice")).expect(2);
    let words = "`doll/trousers.ply` and `other/Trousers.ply` would both be written to";
    assert!(run.stderr.contains(words), "{}", run.stderr);
    let run = folder.ifg(&format!("{ANIMATE} --out twice --set split=if_strained")).expect(2);
    assert!(run.stderr.contains("cannot be split in a motion"), "{}", run.stderr);
    assert!(!folder.path("twice").exists());
}

/// One frame in centimetres, in which the left thigh is raised by 45 degrees; legs alone.
fn bvh() -> String {
    let joints = rig::skeleton();
    let joint = |name: &str| joints.joints().iter().find(|j| j.name == name).unwrap();
    let offset = |from: Point, to: Point| {
        let d = (to - from) * 100.0;
        format!("OFFSET {} {} {}", d.x, d.y, d.z)
    };
    let leg = |side: &str| {
        let [thigh, shin, foot] = ["thigh", "shin", "foot"].map(|part| format!("{side}_{part}"));
        let channels = "CHANNELS 3 Zrotation Xrotation Yrotation";
        let [hips, h, k, f] = ["hips", &thigh, &shin, &foot].map(joint);
        let end = offset(f.head, f.tail);
        let offsets = [offset(hips.head, h.head), offset(h.head, k.head), offset(k.head, f.head)];
        format!(
            "JOINT {thigh} {{ {} {channels}\nJOINT {shin} {{ {} {channels}\nJOINT {foot} {{ {} \
             {channels}\nEnd Site {{ {end} }} }} }} }}\n",
            offsets[0], offsets[1], offsets[2]
        )
    };
    format!(
        "HIERARCHY\nROOT hips {{ OFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation \
         Yrotation\n{}{}}}\nMOTION\nFrames: 1\nFrame Time: 0.033333\n\
         0 90 0 0 0 0  0 -45 0 0 0 0 0 0 0  0 0 0 0 0 0 0 0 0\n",
        leg("left"),
        leg("right")
    )
}

#[test]
fn a_bvh_file_of_legs_moves_the_legs() {
    let folder = scene();
    std::fs::write(folder.path("doll/raise.bvh"), bvh()).unwrap();
    let run = folder
        .ifg("animate --body doll/body_clean.ply doll/trousers.ply --motion doll/raise.bvh --out raised --strict --meshes --no-pictures")
        .expect(0);
    for words in
        ["1 frame: 1 clean, 1 clean everywhere", "lacks, which follow their parents: spine, head"]
    {
        assert!(run.stdout.contains(words), "{words}\n{}", run.stdout);
    }
    // A leg that is raised by 45 degrees about the hip swings forwards.
    let rest = read_path(&folder.path("doll/trousers.ply")).unwrap().mesh;
    let moved = read_path(&folder.path("raised/meshes/000000/trousers.ply")).unwrap().mesh;
    let forward = |sign: f64| {
        let all = rest.vertices().iter().zip(moved.vertices());
        let leg = all.filter(|(p, _)| p.x * sign > 0.02 && p.y < 0.3);
        let (sum, count) = leg.fold((0.0, 0.0), |(s, n), (p, q)| (s + q.z - p.z, n + 1.0));
        sum / count
    };
    assert!(forward(1.0) > 0.3 && forward(-1.0).abs() < 0.01, "{} {}", forward(1.0), forward(-1.0));
    // Half of a file is an error with the place.
    std::fs::write(folder.path("doll/raise.bvh"), &bvh()[..600]).unwrap();
    let run = folder
        .ifg("animate --body doll/body_clean.ply doll/trousers.ply --motion doll/raise.bvh --out half")
        .expect(2);
    assert!(run.stderr.contains("BVH"), "{}", run.stderr);
}

#[test]
#[ignore = "stress"]
fn the_built_in_person_takes_two_steps() {
    let folder = Folder::new();
    let run = folder.ifg("demo --motion --size coarse --out demo").expect(0);
    assert!(run.stdout.contains("8 frames: 8 clean"), "{}", run.stdout);
    let report: Value = serde_json::from_slice(&folder.read("demo/motion/report.json")).unwrap();
    let frames = report["report"]["frames"].as_array().unwrap();
    assert!(frames.iter().all(|f| f["pairs_before"].as_u64().unwrap() > 0));
    // The scene is on disk, and the documented command gives the same.
    let motion = "--motion demo/input/motion.json --frames 0 --no-pictures --out again";
    folder.ifg(&format!("animate demo/input/demo.toml {motion}")).expect(0);
    assert!(folder.path("again/coat.pc2").exists());
}

#[test]
fn a_skeleton_that_may_be_of_another_body_is_noticed() {
    let folder = scene();
    let mut skeleton: Value = serde_json::from_slice(&folder.read("doll/skeleton.json")).unwrap();
    for joint in skeleton["joints"].as_array_mut().unwrap() {
        for x in joint["head"].as_array_mut().unwrap() {
            *x = json!(1.1 * x.as_f64().unwrap());
        }
    }
    std::fs::write(folder.path("other.json"), skeleton.to_string()).unwrap();
    let run = |options: &str| {
        let set = "--frames 0 --no-pictures --out moved";
        folder.ifg(&format!("{ANIMATE} {set} {options}")).stdout
    };
    assert!(run("--skeleton other.json").contains("Is this the skeleton of this body?"));
    assert!(!run("").contains("Is this the skeleton of this body?"));
}

#[test]
fn parameters_of_the_motion_are_set_by_name() {
    let folder = scene();
    let set = "--motion-set smoothing=0 --motion-set walk.gap=0.0008 --frames 0-1 --no-pictures";
    folder.ifg(&format!("{ANIMATE} --out moved {set}")).expect(0);
    let report: Value = serde_json::from_slice(&folder.read("moved/report.json")).unwrap();
    let mut params = AnimateParams { smoothing: 0.0, ..AnimateParams::default() };
    params.walk.gap = 0.0008;
    assert_eq!(report["params"], json!(params));
    let frames = report["report"]["frames"].as_array().unwrap();
    assert!(frames.iter().all(|f| f["smoothed"] == false));
}

#[test]
fn parts_of_a_motion_are_done_by_several_machines() {
    let folder = scene();
    let set = "--no-pictures --motion-set smoothing=0.034 --motion-set run=1";
    let part = |k: u32| format!("{ANIMATE} --out moved {set} --shard {k}/2");
    let said = folder.ifg(&part(2)).expect(0).stdout;
    assert!(said.starts_with("2 of 3: frames 1 to 2, 2 of them new, in moved/frames"), "{said}");
    let again: Value =
        serde_json::from_str(&folder.ifg(&format!("{} --json", part(2))).expect(0).stdout).unwrap();
    assert_eq!((&again["frames"], &again["new"]), (&json!([1, 2]), &json!(0)));
    folder.ifg(&part(1)).expect(0);
    assert!(!folder.path("moved/report.json").exists());
    let report = |out: &str| -> Value {
        folder.ifg(&format!("{ANIMATE} --out {out} {set}")).expect(0);
        serde_json::from_slice(&folder.read(&format!("{out}/report.json"))).unwrap()
    };
    let kept = |report: &Value| report["report"]["kept"].as_u64().unwrap();
    let [whole, parts] = ["whole", "moved"].map(report);
    assert_eq!((kept(&whole), kept(&parts)), (0, 3));
    assert_eq!(folder.read("whole/trousers.pc2"), folder.read("moved/trousers.pc2"));
    assert_eq!(whole["report"]["jitter_max"], parts["report"]["jitter_max"]);
}

#[test]
fn motions_and_weights_that_do_not_fit_are_errors_that_name_them() {
    let folder = scene();
    let fails = |options: &str, words: &str| {
        let run = folder.ifg(&format!("{ANIMATE} --out moved {options}")).expect(2);
        assert!(run.stderr.contains(words), "{words}\n{}", run.stderr);
        assert!(!folder.path("moved/report.json").exists());
    };
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut other = motion();
        change(&mut other);
        write(&folder, &other);
    };
    changed(&|m| m["joints"][3] = json!("wing"));
    fails("", "the motion lacks the joint `left_arm`");
    changed(&|m| m["frames"] = json!([]));
    fails("", "the motion has no frames");
    changed(&|m| m["frames"][1]["rot"] = json!([[1, 0, 0, 0]]));
    fails("", "frame 1 of the motion: the pose has 1 rotations for 13 joints");
    changed(&|m| m["frames"][2]["rot"][4] = json!([0, 0, 0, 0]));
    fails("", "frame 2 of the motion: rotation 4");
    let run = folder.ifg(&format!("{ANIMATE} --out moved")).expect(2);
    assert_eq!(run.stderr.matches("rotation 4").count(), 1, "a cause twice: {}", run.stderr);
    std::fs::write(folder.path("doll/motion.json"), r#"{"joints": [], "frames": NaN}"#).unwrap();
    fails("", "docs/animate.md");
    write(&folder, &motion());
    fails("--skeleton missing.json", "missing.json");
    fails("--scale 0.01", "frames are in metres");
    let of_metres = read_path(&folder.path("doll/body_clean.ply")).unwrap().mesh;
    let large = PlyMesh::new(of_metres.scaled(100.0).unwrap());
    let path = folder.path("doll/large.ply");
    write_path(&large, large.mesh.vertices(), &WriteParams::default(), &path).unwrap();
    let run = folder
        .ifg(
            "animate --body doll/large.ply doll/trousers.ply --motion doll/motion.json --out moved",
        )
        .expect(2);
    assert!(run.stderr.contains("likely centimetres"), "{}", run.stderr);
    assert!(run.stderr.contains("export body, garments and skeleton in metres"), "{}", run.stderr);
    assert!(!run.stderr.contains("add --scale"), "{}", run.stderr);
    fails("--every 0", "0");
    fails("--frames 3", "the motion has 3 frames, the last is 2");
    fails("--frames 2-1", "the last frame is before the first");
    fails("--frames x", "`x` is no frame");
    fails("--motion-set smoothing=-1", "`smoothing` is -1");
    fails("--motion-set clearance=0.1", "unknown parameter `clearance`; valid names are `turn`, ");
    fails("--motion-set gap=wide", "parameter `gap`");
    for twice in ["--motion-set pinch=keep", "--motion-set gap=0.001 --motion-set walk.gap=0.002"] {
        fails(twice, "of the motion is given twice");
    }
    fails("--fps 25", "has no use for --fps");
    fails("--set pinch=yield", "the body at rest cannot be drawn back in a motion");
    let nowhere = ANIMATE.replace("doll/motion.json", "doll/bodeis --skeleton missing.json");
    let run = folder.ifg(&format!("{nowhere} --out moved")).expect(2);
    assert!(run.stderr.contains("`doll/bodeis` cannot be used"), "{}", run.stderr);
    folder
        .ifg("animate --body doll/trousers.ply doll/trousers.ply --motion doll/motion.json --out moved")
        .expect(2);
    let bare = PlyMesh::new(read_path(&folder.path("doll/body_clean.ply")).unwrap().mesh);
    let path = folder.path("doll/bare.ply");
    write_path(&bare, bare.mesh.vertices(), &WriteParams::default(), &path).unwrap();
    let run = folder
        .ifg("animate --body doll/bare.ply doll/trousers.ply --motion doll/motion.json --out moved")
        .expect(2);
    assert!(run.stderr.contains("layer `bare`"), "{}", run.stderr);
}
