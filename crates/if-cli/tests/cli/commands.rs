//! What the commands print and write, and how they end.

use crate::folder::{Folder, TOO_FEW, angular_belt, body, moved, obj, ply};
use if_core::mesh::TriMesh;
use if_mesh::file::{Content, MeshFile};

#[test]
fn check_is_0_for_clean_and_1_for_not_clean_and_changes_nothing() {
    let folder = Folder::new();
    let before = folder.files();
    let clean = folder.ifg("check --body body.ply hoop.ply").expect(0);
    assert!(
        clean.stdout.contains("0 intersecting pairs") && clean.stdout.contains(": clean"),
        "{}",
        clean.stdout
    );
    let found = folder.ifg("check outfit.toml").expect(1);
    assert!(found.stdout.contains("not clean") && found.stdout.contains("top"), "{}", found.stdout);
    assert_eq!(folder.files(), before);
}

#[test]
fn check_counts_as_json() {
    let folder = Folder::new();
    let json = folder.ifg("check outfit.toml --json").expect(1).json();
    assert_eq!(json["state"], "not clean");
    let pairs = json["report"]["pairs"].as_array().unwrap();
    let names: Vec<_> = pairs
        .iter()
        .map(|p| (p["inner"].as_str().unwrap(), p["outer"].as_str().unwrap()))
        .collect();
    assert_eq!(names, [("body", "skirt"), ("body", "top"), ("skirt", "top")]);
    assert!(pairs[0]["pairs"]["crossing"].as_u64().unwrap() > 0);
    // Layers that meet have no distance; a garment has one to itself.
    assert_eq!(pairs[0]["least_distance"]["distance"], 0.0);
    let own = &json["report"]["own_least_distances"][0];
    assert!(own["distance"].as_f64().unwrap() > 1e-3, "{own}");
    assert!(own["error"].as_f64().unwrap() < 1e-12, "{own}");
}

#[test]
fn fix_writes_what_check_then_finds_clean() {
    let folder = Folder::new();
    let run = folder.ifg_drawing("fix outfit.toml --out fixed").expect(0);
    for word in [
        "outer",
        "pairs",
        "-> 0",
        "moved",
        "strain",
        "seconds",
        "Least distance of two layers: ",
        "Wrote fixed: skirt.ply, shirt.obj",
    ] {
        assert!(run.stdout.contains(word), "{word}\n{}", run.stdout);
    }
    assert!(run.stderr.is_empty(), "{}", run.stderr);
    folder.ifg("check --body body.ply fixed/skirt.ply fixed/shirt.obj").expect(0);
    for name in ["before.png", "after.png"] {
        assert!(folder.read(&format!("fixed/{name}")).starts_with(b"\x89PNG"), "{name}");
    }
    let page = String::from_utf8(folder.read("fixed/report.html")).unwrap();
    // One file without network, with the layers before and after to turn.
    assert!(!page.contains("http") && page.contains("class=\"viewer\""));
    assert!(page.contains(r#""states":["before","after"]"#) && page.contains(r#""lines":["#));
    assert!(!folder.path("fixed/body.ply").exists());
    assert!(!folder.path("fixed/.ifg-partial").exists());
    let (old, new) = (
        MeshFile::read(&folder.path("skirt.ply")).unwrap(),
        MeshFile::read(&folder.path("fixed/skirt.ply")).unwrap(),
    );
    assert_eq!(old.mesh().triangles(), new.mesh().triangles());
    assert_ne!(old.mesh().vertices(), new.mesh().vertices());
}

#[test]
fn what_is_left_is_named_and_written_only_where_that_is_asked_for() {
    let folder = Folder::new();
    let before = folder.files();
    let run = folder.ifg(&format!("fix outfit.toml --out fixed {TOO_FEW}")).expect(1);
    let named =
        ["`body`", "`skirt`", "`top`"].iter().filter(|name| run.stderr.contains(**name)).count();
    assert!(named >= 2 && run.stderr.contains("intersecting triangle pairs"), "{}", run.stderr);
    assert!(
        run.stderr.contains("--write-unproven") && run.stdout.contains("Nothing written"),
        "{}{}",
        run.stdout,
        run.stderr
    );
    assert!(folder.files() == before, "files changed");
    let run =
        folder.ifg(&format!("fix outfit.toml --out fixed {TOO_FEW} --write-unproven")).expect(1);
    assert!(run.stderr.contains("what was reached is written"), "{}", run.stderr);
    let receipt: serde_json::Value =
        serde_json::from_slice(&folder.read("fixed/receipt.json")).unwrap();
    assert_eq!(receipt["state"], "not clean");
    folder.ifg("check --body body.ply fixed/skirt.ply fixed/shirt.obj").expect(1);
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_check_at_once() {
    let folder = Folder::new();
    let run = folder.interrupt_printing("check outfit.toml", || ()).expect(130);
    assert!(!run.stdout.contains("intersecting pairs"), "{}", run.stdout.trim());
}

#[test]
fn large_triangles_are_split_with_all_that_hangs_on_them_where_that_is_asked_for() {
    let folder = Folder::new();
    // Bands of three flat sides, in millimetres: too coarse to go round the body.
    let band = |from: f64| moved(&angular_belt(1.2, from, from + 0.1), |p| p * 1000.0);
    folder.write("large.ply", ply(&moved(&body(), |p| p * 1000.0)));
    folder.write("inner.ply", ply(&band(0.2)));
    let mesh = band(-0.2);
    let (n, texture) = (mesh.vertices().len(), "vt 0 0\nvt 1 0\nvt 0 1\nusemtl red\n");
    let faces = mesh
        .triangles()
        .iter()
        .map(|t| format!("f {}/1 {}/2 {}/3\n", t[0] + 1, t[1] + 1, t[2] + 1))
        .collect::<String>();
    let vertices =
        mesh.vertices().iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z)).collect::<String>();
    folder.write("outer.obj", vertices + texture + &faces);
    let fix = "fix --body large.ply inner.ply outer.obj --scale 0.001 --out";
    folder.ifg(&format!("{fix} same")).expect(0);
    assert_eq!(
        MeshFile::read(&folder.path("same/outer.obj")).unwrap().mesh().triangles(),
        mesh.triangles()
    );
    let run = folder.ifg(&format!("{fix} finer --set split=if_strained")).expect(0);
    assert!(run.stdout.contains("outer: 12 triangles of the input were split"), "{}", run.stdout);
    folder.ifg("check --body large.ply finer/inner.ply finer/outer.obj --scale 0.001").expect(0);
    let inner = MeshFile::read(&folder.path("finer/inner.ply")).unwrap();
    assert!(inner.mesh().vertices().len() > n);
    let Content::Ply(inner) = inner.content() else { panic!("another format") };
    assert!(inner.vertex_property("label").unwrap().values.to_f64().iter().all(|l| *l == 7.0));
    let outer = String::from_utf8(folder.read("finer/outer.obj")).unwrap();
    let lines = |keyword: &str| outer.lines().filter(|l| l.starts_with(keyword)).count();
    assert!(
        lines("v ") > n
            && lines("vt ") >= 3 + 3
            && lines("f ") > mesh.triangles().len()
            && lines("usemtl red") == 1,
        "{outer}"
    );
    assert!(
        outer.lines().filter(|l| l.starts_with("f ")).all(|l| l.matches('/').count() == 3),
        "{outer}"
    );
}

#[test]
fn material_libraries_and_textures_are_copied_along() {
    let folder = Folder::new();
    let shirt = String::from_utf8(folder.read("shirt.obj")).unwrap();
    folder.write(
        "shirt.obj",
        format!("mtllib cloth of shirt.mtl\nmtllib gone.mtl\nmtllib ../body.ply\n{shirt}"),
    );
    std::fs::create_dir(folder.path("maps")).unwrap();
    folder.write(
        "cloth of shirt.mtl",
        "newmtl a\nmap_Kd -s 2 2 1 maps/red cloth.png\nmap_Ka ./maps/red cloth.png\nbump missing.png\n",
    );
    folder.write("maps/red cloth.png", "not looked at");
    let run = folder.ifg("fix outfit.toml --out fixed").expect(0);
    for name in ["cloth of shirt.mtl", "maps/red cloth.png"] {
        assert_eq!(folder.read(&format!("fixed/{name}")), folder.read(name), "{name}");
    }
    for word in [
        "`gone.mtl` is not",
        "`../body.ply` is not",
        "`missing.png` is not",
        "skirt.ply, shirt.obj, cloth of shirt.mtl",
    ] {
        assert!(run.stdout.contains(word), "{word}\n{}", run.stdout);
    }
    assert!(!folder.path("fixed/.ifg-partial").exists() && !folder.path("fixed/body.ply").exists());
    // Where the copy would be the file itself, nothing is done.
    folder.ifg("fix outfit.toml --out . --in-place").expect(0);
    assert_eq!(folder.read("maps/red cloth.png"), b"not looked at");
    // One that has the name of another output.
    folder.write("cloth of shirt.mtl", "map_Kd receipt.json\n");
    folder.write("receipt.json", "{}");
    let refused = folder.ifg("fix outfit.toml --out other").expect(2);
    assert!(
        refused.stderr.contains("receipt.json") && !folder.path("other").exists(),
        "{}",
        refused.stderr
    );
}

#[test]
fn textures_that_ply_files_name_are_copied_along() {
    let folder = Folder::new();
    let skirt = String::from_utf8(folder.read("skirt.ply")).unwrap();
    let (magic, rest) = skirt.split_once('\n').unwrap();
    let comments =
        "comment TextureFile red cloth.png\ncomment TextureFile gone.png\ncomment by hand";
    let (format, rest) = rest.split_once('\n').unwrap();
    folder.write("skirt.ply", format!("{magic}\n{format}\n{comments}\n{rest}"));
    folder.write("red cloth.png", "not looked at");
    let run = folder.ifg("fix outfit.toml --out fixed").expect(0);
    assert_eq!(folder.read("fixed/red cloth.png"), b"not looked at");
    assert!(run.stdout.contains("skirt.ply: the texture `gone.png` is not"), "{}", run.stdout);
    assert!(!run.stdout.contains("by hand"));
}

#[test]
fn the_receipt_says_what_went_in_and_came_out() {
    let folder = Folder::new();
    let json = folder.ifg("fix outfit.toml --out fixed --clearance 1mm --json").expect(0).json();
    assert_eq!((&json["state"], &json["out"]), (&"clean everywhere".into(), &"fixed".into()));
    assert!(json["report"]["before"]["pairs"].as_array().unwrap().len() == 3);
    let report = &json["report"];
    let least = report["after"]["pairs"].as_array().unwrap().iter();
    let least = least.map(|p| p["least_distance"]["distance"].as_f64().unwrap());
    let least = least.fold(f64::INFINITY, f64::min);
    let reached = report["clearance_reached"].as_f64().unwrap();
    assert!(least > 0.0 && (reached - least / 1e-3).abs() < 1e-9, "{reached} {least}");
    let receipt: serde_json::Value =
        serde_json::from_slice(&folder.read("fixed/receipt.json")).unwrap();
    assert_eq!(receipt["params"]["goal"]["clearance"], 0.001);
    assert_eq!(receipt["inputs"][2]["layer"], "top");
    assert_eq!(receipt["inputs"][2]["bytes"], folder.read("shirt.obj").len());
    assert_eq!(receipt["outputs"][1]["file"], "shirt.obj");
    assert_eq!(receipt["outputs"].as_array().unwrap().len(), 2);
    assert_eq!(receipt["report"]["layers"][1]["name"], "top");
    assert!(receipt["timings"]["layers"]["top"].is_number());
    assert!(receipt["tool"]["target"].as_str().unwrap().contains('-'));
    assert_eq!(receipt["inputs"][0]["sha256"].as_str().unwrap().len(), 64);
}

#[test]
fn timings_name_the_phases_and_change_nothing_else() {
    let folder = Folder::new();
    folder.ifg("fix outfit.toml --out plain").expect(0);
    let run = folder.ifg("fix outfit.toml --out timed --timings --verbose").expect(0);
    for word in ["Where the time went", "reading", "sweeps", "cores"] {
        assert!(run.stdout.contains(word), "{word}\n{}", run.stdout);
    }
    // Events are still logged, and not by the names of the phases around them.
    assert!(run.stderr.contains("DEBUG garment=") && !run.stderr.contains("settling"));
    let receipt = |out: &str| -> serde_json::Value {
        serde_json::from_slice(&folder.read(&format!("{out}/receipt.json"))).unwrap()
    };
    let [mut plain, mut timed] = ["plain", "timed"].map(receipt);
    assert!(plain["timings"]["phases"].is_null());
    let total = timed["timings"]["phases"].take();
    let names = |phase: &serde_json::Value| -> Vec<String> {
        let within = phase["phases"].as_array().unwrap().iter();
        within.map(|p| p["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(&total), ["reading", "resolving", "writing"]);
    let resolving = &total["phases"][1];
    let settling = names(resolving).iter().position(|name| name == "settling").unwrap();
    let settling = &resolving["phases"][settling];
    for name in ["verification", "outward grid", "cloth", "contacts", "sweeps", "repair"] {
        assert!(names(settling).contains(&name.to_owned()), "{name}: {settling}");
    }
    let wall = |phase: &serde_json::Value| phase["wall"].as_f64().unwrap();
    let within: f64 = settling["phases"].as_array().unwrap().iter().map(wall).sum();
    assert!(within > 0.0 && within <= wall(settling) && wall(settling) < wall(&total));
    #[cfg(target_os = "linux")]
    assert!(plain["timings"]["peak_memory"].as_u64().unwrap() > 1 << 20);
    for receipt in [&mut plain, &mut timed] {
        receipt.as_object_mut().unwrap().remove("timings").unwrap();
    }
    assert_eq!(plain, timed);
    let json = folder.ifg("fix outfit.toml --out again --timings --json").expect(0).json();
    assert_eq!(json["phases"]["name"], "total");
}

#[test]
fn several_objects_of_a_file_are_noted() {
    let folder = Folder::new();
    let shirt = String::from_utf8(folder.read("shirt.obj")).unwrap();
    folder.write("shirt.obj", format!("{shirt}o buttons\nf 1 2 3\no empty\n"));
    let check = folder.ifg("check outfit.toml");
    assert!(!check.stdout.contains("objects"), "{}", check.stdout);
    folder.write("shirt.obj", format!("o shirt\n{shirt}o buttons\nf 1 2 3\no empty\n"));
    let check = folder.ifg("check outfit.toml");
    let note = "Note: `top`: the file has 2 objects (`shirt`, `buttons`)";
    assert!(check.stdout.contains(note), "{}", check.stdout);
}

#[test]
fn harmless_faults_are_noted_and_kept() {
    let folder = Folder::new();
    let content = String::from_utf8(folder.read("shirt.obj")).unwrap() + "v 0.3 0.1 0\nf 1 1 2\n";
    folder.write("shirt.obj", content);
    let check = folder.ifg("check outfit.toml").expect(1);
    assert!(
        check.stdout.contains("Note: `top`: 1 vertices belong to no triangle"),
        "{}",
        check.stdout
    );
    assert!(check.stdout.contains("Note: `top`: 1 faces use a vertex twice"), "{}", check.stdout);
    folder.ifg("fix outfit.toml --out fixed").expect(0);
    let (old, new) = (folder.read("shirt.obj"), folder.read("fixed/shirt.obj"));
    let lines = |bytes: Vec<u8>, key: &str| {
        String::from_utf8(bytes).unwrap().lines().filter(|l| l.starts_with(key)).count()
    };
    assert_eq!(lines(old.clone(), "v "), lines(new.clone(), "v "));
    assert_eq!(lines(old, "f "), lines(new, "f "));
    let receipt = String::from_utf8(folder.read("fixed/receipt.json")).unwrap();
    assert!(receipt.contains("belong to no triangle"), "{receipt}");
}

#[test]
fn what_needs_nothing_comes_back_byte_by_byte() {
    let folder = Folder::new();
    let run = folder.ifg("fix --body body.ply hoop.ply --out fixed").expect(0);
    assert!(run.stdout.contains("hoop.ply (unchanged)"), "{}", run.stdout);
    assert_eq!(folder.read("fixed/hoop.ply"), folder.read("hoop.ply"));
}

#[test]
fn in_place_replaces_the_inputs_and_is_then_clean() {
    let folder = Folder::new();
    let body = folder.read("body.ply");
    folder.ifg("fix outfit.toml --out . --in-place").expect(0);
    folder.ifg("check outfit.toml").expect(0);
    assert_eq!(folder.read("body.ply"), body);
}

#[test]
fn millimetres_are_scaled_and_come_back_as_millimetres() {
    let folder = Folder::new();
    let scaled = |name: &str| {
        let file = MeshFile::read(&folder.path(name)).unwrap();
        obj(&moved(file.mesh(), |p| p * 1000.0))
    };
    folder.write("body_mm.obj", scaled("body.ply"));
    folder.write("skirt_mm.obj", scaled("skirt.ply"));
    folder.ifg("fix --body body_mm.obj skirt_mm.obj --out mm --scale 0.001").expect(0);
    folder.ifg("check --body body_mm.obj mm/skirt_mm.obj --scale 0.001").expect(0);
    let read = |name: &str| MeshFile::read(&folder.path(name)).unwrap().mesh().clone();
    let (before, after): (TriMesh, TriMesh) = (read("skirt_mm.obj"), read("mm/skirt_mm.obj"));
    let most = before
        .vertices()
        .iter()
        .zip(after.vertices())
        .map(|(p, q)| (p - q).norm())
        .fold(0.0, f64::max);
    assert!(0.0 < most && most < 50.0, "{most} mm");
}

#[test]
fn parameters_come_from_the_file_and_then_from_the_command_line() {
    let folder = Folder::new();
    let toml =
        String::from_utf8(folder.read("outfit.toml")).unwrap() + "[params]\nclearance = 0.002\n";
    folder.write("loose.toml", toml);
    let clearance = |args: &str| {
        folder.ifg(&format!("fix loose.toml --out fixed {args}")).expect(0);
        serde_json::from_slice::<serde_json::Value>(&folder.read("fixed/receipt.json")).unwrap()["params"]["goal"]["clearance"].clone()
    };
    assert_eq!(clearance(""), 0.002);
    assert_eq!(clearance("--set clearance=0.001"), 0.001);
    assert_eq!(clearance("--set goal.clearance=0.0012"), 0.0012);
    assert_eq!(clearance("--clearance 0.7mm"), 0.0007);
}

#[test]
fn the_demo_is_resolved_and_can_be_fixed_again_from_its_files() {
    let folder = Folder::new();
    let run = folder.ifg("demo --size coarse").expect(0);
    assert!(run.stdout.contains("-> 0 intersecting pairs"), "{}", run.stdout);
    folder.ifg("check out/demo/input/demo.toml").expect(1);
    folder.ifg("fix out/demo/input/demo.toml --out again").expect(0);
    for (path, bytes) in folder.files() {
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.parent().unwrap().ends_with("again") && name != "receipt.json" {
            assert_eq!(bytes, folder.read(&format!("out/demo/{name}")), "{name}");
        }
    }
}

#[test]
#[ignore = "stress"]
fn the_other_variant_of_the_demo_wears_trousers_and_what_is_left_is_written() {
    let folder = Folder::new();
    let run = folder.ifg(&format!("demo --variant trousers --size coarse {TOO_FEW}")).expect(1);
    assert!(
        run.stdout.contains("trousers") && run.stdout.contains("Wrote out/demo"),
        "{}",
        run.stdout
    );
    let outfit = String::from_utf8(folder.read("out/demo/input/demo.toml")).unwrap();
    assert!(outfit.contains("trousers.ply") && !outfit.contains("skirt"), "{outfit}");
    assert!(folder.path("out/demo/trousers.ply").exists());
}

#[test]
fn help_documents_the_exit_codes() {
    let run = Folder::new().ifg("--help").expect(0);
    assert!(run.stdout.contains("Exit codes") && run.stdout.contains("130"), "{}", run.stdout);
}

#[test]
fn without_a_terminal_there_are_no_colours_and_no_progress() {
    let folder = Folder::new();
    let run = folder.ifg("fix outfit.toml --out fixed").expect(0);
    assert!(!run.stdout.contains('\x1b') && run.stderr.is_empty(), "{}{}", run.stdout, run.stderr);
    for line in run.stdout.lines() {
        assert!(line.chars().count() <= 100, "{line}");
    }
    let run = folder.ifg("check --body body.ply missing.ply").expect(2);
    assert!(!run.stderr.contains('\x1b') && run.stderr.is_ascii(), "{}", run.stderr);
}
