//! `ifg cut` and `ifg capture synth`.

use crate::folder::Folder;
use if_body::TemplateBody;
use if_core::math::Vector;
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::{icosphere, tube};
use if_mesh::ply::{self, Column, PlyMesh, Property, WriteParams, read_bytes, write};
use if_pipeline::capture::Capture;
use if_pipeline::capture::synth::BODY;

/// A closed tube, trousers below 0.4 and a shirt above, every eleventh vertex wrong or unknown; and
/// a height.
fn labelled(folder: &Folder) {
    let mesh = tube(0.2, 1.0, 32, 40, true);
    let label = |(v, y): (usize, f64)| match v % 11 {
        3 => 0,
        7 => 1,
        _ => 2 + u8::from(y > 0.4),
    };
    let heights: Vec<f64> = mesh.vertices().iter().map(|p| p.y).collect();
    let labels = heights.iter().copied().enumerate().map(label).collect();
    let mut ply = PlyMesh::new(mesh);
    ply.vertex_properties = vec![
        Property::new("label", Column::U8(labels)),
        Property::new("height", Column::F32(heights.iter().map(|y| *y as f32).collect())),
    ];
    let mut bytes = Vec::new();
    write(&ply, ply.mesh.vertices(), &WriteParams::default(), &mut bytes).unwrap();
    folder.write("labelled.ply", bytes);
}

#[test]
fn cut_writes_one_mesh_for_each_label_with_attributes_and_a_table() {
    let folder = Folder::new();
    labelled(&folder);
    let run = folder
        .ifg("cut labelled.ply --out pieces --smooth 10cm --name 2=trousers --name 3=shirt")
        .expect(0);
    for word in [
        "trousers",
        "shirt",
        "borders",
        "labels changed",
        "unknown ones filled in",
        "labels_after.png",
    ] {
        assert!(run.stdout.contains(word), "{word}\n{}", run.stdout);
    }
    assert!(!run.stdout.contains("skin.ply"), "the skin was outvoted everywhere\n{}", run.stdout);
    assert!(
        run.stdout.contains("Note: label 1 (skin) has no file: none of its "),
        "{}",
        run.stdout
    );
    assert!(!run.stdout.contains("likely"), "{}", run.stdout);
    let ply = read_bytes(&folder.read("labelled.ply")).unwrap();
    let larger: Vec<_> = ply.mesh.vertices().iter().map(|p| p * 170.0).collect();
    let mut bytes = Vec::new();
    write(&ply, &larger, &WriteParams::default(), &mut bytes).unwrap();
    folder.write("larger.ply", bytes);
    let larger = folder.ifg("cut larger.ply --out larger --smooth 17 --no-pictures").expect(0);
    assert!(
        larger.stdout.contains("the input: 170 units high: likely centimetres"),
        "{}",
        larger.stdout
    );
    assert!(folder.read("pieces/labels_before.png").starts_with(b"\x89PNG"));
    let shirt = read_bytes(&folder.read("pieces/shirt.ply")).unwrap();
    assert_eq!(
        shirt.vertex_property("label").unwrap().values,
        Column::U8(vec![3; shirt.mesh.vertices().len()])
    );
    let heights = shirt.vertex_property("height").unwrap().values.to_f64();
    for (p, height) in shirt.mesh.vertices().iter().zip(heights) {
        assert!((p.y - height).abs() < 1e-6 && p.y > 0.36, "{p} {height}");
    }
    let json = folder
        .ifg("cut labelled.ply --out again --smooth 10cm --json --no-pictures")
        .expect(0)
        .json();
    let borders: Vec<_> = json["pieces"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| (p["name"].clone(), p["borders"].clone()))
        .collect();
    assert_eq!(borders, [("label_2".into(), 1.into()), ("label_3".into(), 1.into())]);
    let files: Vec<_> =
        std::fs::read_dir(folder.path("again")).unwrap().map(|f| f.unwrap().file_name()).collect();
    assert_eq!(files.len(), 2, "{files:?}");
}

/// Triangles with vertices of their own, labels on one half alone.
#[test]
fn seams_do_not_part_labels() {
    let folder = Folder::new();
    let whole = tube(0.2, 1.0, 32, 40, true);
    let corners: Vec<_> =
        whole.triangles().as_flattened().iter().map(|v| whole.vertices()[*v as usize]).collect();
    let own = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let label = |p: &if_core::math::Point| if p.x > 0.0 { 2 + u8::from(p.y > 0.4) } else { 0 };
    let labels = corners.iter().map(label).collect();
    let mut ply = PlyMesh::new(TriMesh::new(corners, own).unwrap());
    ply.vertex_properties = vec![Property::new("label", Column::U8(labels))];
    let mut bytes = Vec::new();
    write(&ply, ply.mesh.vertices(), &WriteParams::default(), &mut bytes).unwrap();
    folder.write("soup.ply", bytes);
    folder.ifg("cut soup.ply --out pieces --name 2=trousers --name 3=shirt").expect(0);
    let areas = ["trousers", "shirt"]
        .map(|name| read_bytes(&folder.read(&format!("pieces/{name}.ply"))).unwrap().mesh.area());
    let (sum, all) = (areas[0] + areas[1], whole.area());
    assert!(sum > 0.9 * all, "{areas:?} of {all}: the other half takes the labels beside it");
}

#[test]
fn large_labels_are_cut_as_small_ones_are() {
    let folder = Folder::new();
    labelled(&folder);
    let mut ply = read_bytes(&folder.read("labelled.ply")).unwrap();
    let Column::U8(labels) = &mut ply.vertex_properties[0].values else { panic!("another type") };
    for label in labels.iter_mut().filter(|l| **l > 1) {
        *label = if *label == 2 { 200 } else { 254 };
    }
    let mut bytes = Vec::new();
    write(&ply, ply.mesh.vertices(), &WriteParams::default(), &mut bytes).unwrap();
    folder.write("large.ply", bytes);
    let cut = |mesh: &str, out: &str| {
        let mut json = folder
            .ifg(&format!("cut {mesh} --out {out} --smooth 10cm --no-pictures --json"))
            .expect(0)
            .json();
        let told = json.as_object_mut().unwrap();
        ["mesh", "out", "pieces", "notes", "seconds"]
            .iter()
            .for_each(|key| drop(told.remove(*key).unwrap()));
        json
    };
    assert_eq!(cut("labelled.ply", "small"), cut("large.ply", "large"));
    let piece = |name: &str| read_bytes(&folder.read(name)).unwrap();
    for (small, large, label) in [("label_2", "label_200", 200), ("label_3", "label_254", 254)] {
        let (small, large) =
            (piece(&format!("small/{small}.ply")), piece(&format!("large/{large}.ply")));
        assert_eq!(small.mesh, large.mesh);
        assert_eq!(
            large.vertex_property("label").unwrap().values,
            Column::U8(vec![label; large.mesh.vertices().len()])
        );
    }
}

#[test]
fn a_folder_in_the_way_of_one_piece_leaves_the_others_as_they_were() {
    let folder = Folder::new();
    labelled(&folder);
    std::fs::create_dir_all(folder.path("o/label_3.ply")).unwrap();
    folder.write("o/label_2.ply", "mine");
    let before = folder.files();
    let run = folder.ifg("cut labelled.ply --out o --smooth 10cm --no-pictures").expect(2);
    assert!(run.stderr.contains("label_3.ply` is in the way"), "{}", run.stderr);
    assert!(folder.files() == before, "files changed");
}

#[test]
fn what_is_in_no_file_is_told() {
    let folder = Folder::new();
    // Of three balls one has no label, one a label and a single vertex of another.
    let ball = icosphere(0.1, 2);
    let n = ball.vertices().len();
    let balls = (0..3).map(|k| ball.vertices().iter().map(move |p| p + Vector::x() * f64::from(k)));
    let triangles =
        (0..3u32).flat_map(|k| ball.triangles().iter().map(move |t| t.map(|v| v + k * n as u32)));
    let mesh = TriMesh::new(balls.flatten().collect(), triangles.collect()).unwrap();
    let labels = (0..3 * n).map(|v| if v == 5 { 4 } else { [2, 3, 0][v / n] }).collect();
    let ply = PlyMesh {
        vertex_properties: vec![Property::new("label", Column::U8(labels))],
        ..PlyMesh::new(mesh)
    };
    ply::write_path(&ply, ply.mesh.vertices(), &WriteParams::default(), &folder.path("balls.ply"))
        .unwrap();
    let run = folder.ifg("cut balls.ply --out o --no-pictures --smooth 10cm").expect(0);
    for words in [
        "162 vertices stay unknown and are in no file: 320 triangles, 0.12",
        "label 4 (label_4) has no file: none of its 1 vertices",
    ] {
        assert!(run.stdout.contains(words), "{words}\n{}", run.stdout);
    }
    let json = folder
        .ifg("cut balls.ply --out p --no-pictures --smooth 10cm --json --name 4=pocket")
        .expect(0)
        .json();
    let undecided = &json["undecided"];
    assert_eq!(
        (&undecided["vertices"], &undecided["triangles"], &undecided["components"]),
        (&162.into(), &320.into(), &1.into())
    );
    assert!(
        (undecided["area_m2"].as_f64().unwrap() / ball.area() - 1.0).abs() < 1e-4,
        "{undecided}"
    );
    assert_eq!(
        json["labels_lost"],
        serde_json::json!([{"label": 4, "name": "pocket", "vertices": 1}])
    );
    assert_eq!(json["pieces"].as_array().unwrap().len(), 2);
    assert_eq!(json["notes"].as_array().unwrap().len(), 2);
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_smoothing_of_labels() {
    let folder = Folder::new();
    // Two labels far apart on a long tube: the solve takes thousands of steps.
    let mesh = tube(0.05, 40.0, 16, 6000, false);
    let n = mesh.vertices().len();
    let labels = (0..n)
        .map(|v| {
            if v == 0 {
                2
            } else if v == n - 1 {
                3
            } else {
                0
            }
        })
        .collect();
    let ply = PlyMesh {
        vertex_properties: vec![Property::new("label", Column::U8(labels))],
        ..PlyMesh::new(mesh)
    };
    ply::write_path(&ply, ply.mesh.vertices(), &WriteParams::default(), &folder.path("long.ply"))
        .unwrap();
    let run = folder.interrupt("cut long.ply --out o", "o/.ifg-partial");
    assert!(run.stderr.contains("cancelled; `o` was not written"), "{}", run.stderr);
}

#[test]
fn labels_that_are_missing_or_none_and_names_that_are_none_are_named() {
    let folder = Folder::new();
    labelled(&folder);
    let cases = [
        ("cut labelled.ply --out o --labels layer", "label, height"),
        ("cut labelled.ply --out o --labels height", "whole numbers"),
        ("cut hoop.obj --out o", "cannot read"),
        ("cut labelled.ply --out o --name 3=a/b", "a/b"),
        ("cut labelled.ply --out o --name 2=x --name 3=X", "each name once"),
        ("cut labelled.ply --out o --name 2=x --name 2=y", "once for each label"),
        ("cut labelled.ply --out o --name 9=hat", "the labels of the file are 1, 2, 3"),
    ];
    for (args, word) in cases {
        let run = folder.ifg(&format!("{args} --no-pictures")).expect(2);
        assert!(run.stderr.contains(word), "{args}: {}", run.stderr);
        assert!(!folder.path("o").exists(), "{args}");
    }
    let over = folder.ifg("cut labelled.ply --out . --name 2=labelled --no-pictures").expect(2);
    assert!(over.stderr.contains("the input file"), "{}", over.stderr);
}

#[test]
fn each_error_of_a_synthetic_capture_is_in_what_it_is_an_error_of() {
    let folder = Folder::new();
    const SYNTH: &str = "capture synth --frames 2 --size 48 --garments skirt,tshirt --noise 0";
    folder.ifg(&format!("{SYNTH} --out exact")).expect(0);
    const FILES: [&str; 5] = [
        "meta.json",
        "body/body_clean.ply",
        "normal/0001.png",
        "mask/0001.png",
        "truth/tshirt.ply",
    ];
    for (option, changed) in [
        ("--pose-noise 3,9", &FILES[..1]),
        ("--pose-noise 3,9 --pose-correlation 4", &FILES[..1]),
        ("--camera-noise 1", &FILES[..1]),
        ("--shape-noise 3,20", &FILES[1..2]),
        ("--normal-noise 12", &FILES[2..3]),
        ("--nonrigid 2cm", &FILES[2..4]),
        ("--label-noise 1", &[]),
        ("--mask-noise 1", &[]),
        ("--seed 4", &[]),
    ] {
        let out = option.replace([' ', '-', ','], "_");
        folder.ifg(&format!("{SYNTH} {option} --out {out}")).expect(0);
        let differs = |file: &&str| {
            folder.read(&format!("exact/{file}")) != folder.read(&format!("{out}/{file}"))
        };
        assert_eq!(FILES.into_iter().filter(differs).collect::<Vec<_>>(), changed, "{option}");
        for noisy in ["label_noisy", "mask_noisy"] {
            let is_asked_for = option.contains(&noisy.replace("_noisy", "-noise"));
            let there = folder.path(&format!("{out}/{noisy}")).exists();
            assert_eq!(there, is_asked_for, "{option}: {noisy}");
        }
    }
    let path = folder.path("__shape_noise_3_20/truth/template");
    let (exact, kept) = (folder.path("exact").join(BODY), path);
    let read = |path: &std::path::Path| TemplateBody::read(path).unwrap().mesh;
    assert_eq!(read(&exact), read(&kept), "the true shape is beside the truth");
}

#[test]
fn a_synthetic_capture_is_one_and_is_not_overwritten() {
    let folder = Folder::new();
    let run = folder
        .ifg("capture synth --out turn --frames 2 --size 48 --garments skirt,tshirt")
        .expect(0);
    assert!(
        run.stdout.contains("skirt") && run.stdout.contains("2 frames of 48x48"),
        "{}",
        run.stdout
    );
    let capture = Capture::open(&folder.path("turn")).unwrap();
    assert_eq!(
        (capture.len(), capture.garments()),
        (2, &["tshirt".to_owned(), "skirt".to_owned()][..])
    );
    let template = TemplateBody::read(&folder.path("turn").join(BODY)).unwrap();
    capture.check_skeleton(&template.skeleton).unwrap();
    let again = folder.ifg("capture synth --out turn --frames 2 --size 48").expect(2);
    assert!(again.stderr.contains("already exists"), "{}", again.stderr);
    let none = folder.ifg("capture synth --out none --noise 2").expect(2);
    assert!(
        none.stderr.contains("label_noise") && !folder.path("none").exists(),
        "{}",
        none.stderr
    );
}
