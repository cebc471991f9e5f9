//! Many outfits in one run: one folder each, finished ones are skipped, a fault stops only its own.

use crate::folder::{Folder, Run, TOO_FEW};
use if_core::mesh::TriMesh;
use if_mesh::ply::read_path;
use serde_json::Value;

fn batch() -> Folder {
    let folder = Folder::new();
    for name in ["a", "b"] {
        folder.write(&format!("{name}.toml"), folder.read("outfit.toml"));
    }
    folder
}

fn states(run: &Run) -> Vec<String> {
    let lines = run.stdout.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    lines.map(|json| json["state"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn each_outfit_has_its_folder_and_finished_ones_are_skipped() {
    let folder = batch();
    let run = folder.ifg("fix a.toml b.toml --out done").expect(0);
    assert!(run.stdout.contains("2 outfits: 2 clean"), "{}", run.stdout);
    assert!(
        folder.path("done/a/receipt.json").exists() && folder.path("done/b/shirt.obj").exists()
    );
    // Their body, which is prepared once for both, changes no byte.
    folder.ifg("fix a.toml --out alone").expect(0);
    for garment in ["shirt.obj", "skirt.ply"] {
        let [both, alone] = ["done/a", "alone"].map(|f| folder.read(&format!("{f}/{garment}")));
        assert!(both == alone, "{garment}");
    }
    let before = folder.files();
    let run = folder.ifg("fix a.toml b.toml --out done").expect(0);
    assert_eq!(
        run.stdout.matches("finished before, clean everywhere, skipped").count(),
        2,
        "{}",
        run.stdout
    );
    assert!(folder.files() == before);
    assert_eq!(
        states(&folder.ifg("fix a.toml b.toml --out done --json --again").expect(0)),
        ["clean everywhere", "clean everywhere"]
    );
}

#[test]
fn outfits_that_are_given_one_by_one_come_to_what_a_batch_of_them_does() {
    let folder = batch();
    folder.ifg("fix a.toml b.toml --out done").expect(0);
    for outfit in ["a", "b"] {
        let each = format!("fix {outfit}.toml --out each --each");
        let run = folder.ifg(&each).expect(0);
        assert!(run.stdout.contains("1 outfit: 1 clean"), "{}", run.stdout);
        assert!(folder.ifg(&each).expect(0).stdout.contains("clean everywhere, skipped"));
        for file in ["shirt.obj", "skirt.ply"] {
            let [both, alone] =
                ["done", "each"].map(|out| folder.read(&format!("{out}/{outfit}/{file}")));
            assert!(both == alone, "{file}");
        }
    }
    // Each finds done what the other has made.
    let run = folder.ifg("fix a.toml b.toml --out each").expect(0);
    assert_eq!(run.stdout.matches("skipped").count(), 2, "{}", run.stdout);
    folder.ifg("fix a.toml --out done --each").expect(0);
    folder.ifg("fix --body body.ply hoop.ply --out w --each").expect(2);
}

#[test]
fn an_outfit_at_which_a_run_was_killed_comes_after_the_others() {
    let folder = batch();
    // What a kill leaves while `a` is being resolved.
    std::fs::create_dir_all(folder.path("done/a/.ifg-partial")).unwrap();
    let order = |args: &str| -> Vec<String> {
        let run = folder.ifg(&format!("fix a.toml b.toml --out done --json {args}")).expect(0);
        let lines = run.stdout.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        lines.map(|json| json["outfit"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(order(""), ["b", "a"]);
    assert!(!folder.path("done/a/.ifg-partial").exists());
    assert_eq!(order("--again"), ["a", "b"]);
}

#[test]
fn each_shard_does_its_part_and_the_whole_command_finds_it_done() {
    let folder = batch();
    folder.write("c.toml", folder.read("outfit.toml"));
    let fix = |shard: &str| {
        let run = folder.ifg(&format!("fix a.toml b.toml c.toml --out done --json {shard}"));
        states(&run.expect(0))
    };
    assert_eq!(fix("--shard 2/3"), ["clean everywhere"]);
    assert!(folder.path("done/b/receipt.json").exists() && !folder.path("done/a").exists());
    assert_eq!(fix("--shard 1/2"), ["clean everywhere", "clean everywhere"]);
    let again = folder.ifg("fix a.toml b.toml c.toml --out done --json").expect(0);
    assert_eq!(states(&again), ["finished", "finished", "finished"]);
    let reached = r#""cleanness":"clean everywhere""#;
    assert_eq!(again.stdout.matches(reached).count(), 3, "{}", again.stdout);
    assert!(fix("--shard 5/5").is_empty());
    folder.ifg("fix a.toml b.toml --shard 3/2").expect(2);
    folder.ifg("fix shirt.obj --body body.ply --out x --shard 1/2").expect(2);
}

#[test]
fn a_busy_folder_has_an_exit_code_of_its_own() {
    let folder = batch();
    // As another process that writes there.
    let hidden = folder.path("done/a/.ifg-partial");
    std::fs::create_dir_all(&hidden).unwrap();
    let lock = std::fs::File::create(hidden.join(".ifg-lock")).unwrap();
    lock.lock().unwrap();
    let run = folder.ifg("fix a.toml b.toml --out done").expect(75);
    assert!(run.stderr.contains("another ifg is writing"), "{}", run.stderr);
    assert!(folder.path("done/b/receipt.json").exists(), "the others are done");
    folder.ifg("fix a.toml --out done/a").expect(75);
    lock.unlock().unwrap();
    folder.ifg("fix a.toml b.toml --out done").expect(0);
}

#[test]
fn what_has_changed_is_done_again() {
    let folder = batch();
    let run = |args: &str| {
        states(&folder.ifg(&format!("fix a.toml b.toml --out done --json {args}")).expect(0))
    };
    assert_eq!(run(""), ["clean everywhere", "clean everywhere"]);
    assert_eq!(run(""), ["finished", "finished"]);
    // Other parameters.
    assert_eq!(run("--clearance 1mm"), ["clean everywhere", "clean everywhere"]);
    assert_eq!(run("--clearance 1mm"), ["finished", "finished"]);
    // An output that was damaged, as after a fault of the disk.
    folder.write("done/b/skirt.ply", "half");
    assert_eq!(run("--clearance 1mm"), ["finished", "clean everywhere"]);
    // Another input.
    let shirt = String::from_utf8(folder.read("shirt.obj")).unwrap() + "# changed\n";
    folder.write("shirt.obj", shirt);
    assert_eq!(run("--clearance 1mm"), ["clean everywhere", "clean everywhere"]);
}

#[test]
fn other_materials_and_textures_are_done_again() {
    let folder = batch();
    let shirt = String::from_utf8(folder.read("shirt.obj")).unwrap();
    folder.write("shirt.obj", format!("mtllib cloth.mtl\n{shirt}"));
    folder.write("cloth.mtl", "map_Kd red.png\nmap_Ka gone.png\n");
    folder.write("red.png", "red");
    let run = || states(&folder.ifg("fix a.toml b.toml --out done --json").expect(0));
    assert_eq!(run(), ["clean everywhere", "clean everywhere"]);
    let receipt: Value = serde_json::from_slice(&folder.read("done/a/receipt.json")).unwrap();
    let inputs = receipt["inputs"].as_array().unwrap().iter().skip(3);
    let inputs: Vec<_> =
        inputs.map(|i| (i["layer"].as_str().unwrap(), i["file"].as_str().unwrap())).collect();
    assert_eq!(inputs, [("top", "cloth.mtl"), ("top", "red.png")]);
    for (name, content) in
        [("red.png", "crimson"), ("gone.png", "found again"), ("cloth.mtl", "map_Kd red.png\n")]
    {
        assert_eq!(run(), ["finished", "finished"]);
        folder.write(name, content);
        assert_eq!(run(), ["clean everywhere", "clean everywhere"], "{name}");
        assert_eq!(folder.read(&format!("done/b/{name}")), content.as_bytes());
    }
}

#[test]
fn the_materials_of_a_body_are_not_replaced_by_those_of_a_garment() {
    let folder = batch();
    let shirt = String::from_utf8(folder.read("shirt.obj")).unwrap();
    std::fs::create_dir(folder.path("top")).unwrap();
    folder.write("top/shirt.obj", format!("mtllib material.mtl\n{shirt}"));
    folder.write("top/material.mtl", "Kd 1 0 0\n");
    std::fs::create_dir(folder.path("person")).unwrap();
    let text = |mesh: &TriMesh| {
        let v = mesh.vertices().iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
        let f =
            mesh.triangles().iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
        format!("mtllib material.mtl\n{}", v.chain(f).collect::<String>())
    };
    let mesh = read_path(&folder.path("body.ply")).unwrap().mesh;
    folder.write("person/body.obj", text(&mesh));
    folder.write("person/material.mtl", "Kd 0.9 0.7 0.6\n");
    let fix = "fix --body person/body.obj top/shirt.obj";
    let run = folder.ifg(&format!("{fix} --out person")).expect(2);
    assert!(run.stderr.contains("person/material.mtl"), "{}", run.stderr);
    assert_eq!(folder.read("person/material.mtl"), b"Kd 0.9 0.7 0.6\n");
    folder.ifg(&format!("{fix} --out fixed")).expect(0);
    assert_eq!(folder.read("fixed/material.mtl"), b"Kd 1 0 0\n");
}

#[test]
fn what_was_left_is_tried_again() {
    let folder = batch();
    let run = |args: &str, code| {
        states(&folder.ifg(&format!("fix a.toml b.toml --out done --json {args}")).expect(code))
    };
    let unproven = format!("{TOO_FEW} --write-unproven");
    for _ in 0..2 {
        assert_eq!(run(&unproven, 1), ["not clean", "not clean"]);
        assert!(
            folder.path("done/a/shirt.obj").exists() && folder.path("done/b/receipt.json").exists()
        );
    }
    assert_eq!(run("", 0), ["clean everywhere", "clean everywhere"]);
}

#[test]
fn a_fault_stops_only_its_own_outfit() {
    let folder = batch();
    folder.write("broken.toml", "body = 'body.ply'\n[[garment]]\nfile = 'gone.ply'\n");
    let run = folder.ifg("fix a.toml broken.toml b.toml --out done").expect(2);
    assert!(run.stdout.contains("2 clean") && run.stdout.contains("1 unusable"), "{}", run.stdout);
    assert!(run.stderr.contains("gone.ply"), "{}", run.stderr);
    assert!(!folder.path("done/broken").exists());
    let run = folder.ifg("check a.toml broken.toml --json").expect(2);
    assert_eq!(states(&run), ["not clean", "failed"]);
}

/// Ctrl-C in the middle of a batch: what was finished stays, nothing is half-written, and the next
/// run goes on from there.
#[cfg(unix)]
#[test]
fn a_cancelled_batch_goes_on_where_it_stopped() {
    use std::process::Stdio;
    use std::time::{Duration, Instant};
    const OUTFITS: usize = 300;
    let folder = Folder::new();
    let mut args = String::from("fix --out done --no-pictures");
    for k in 0..OUTFITS {
        folder.write(&format!("o{k}.toml"), folder.read("outfit.toml"));
        args += &format!(" o{k}.toml");
    }
    let mut child =
        folder.command(&args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let patience = Instant::now();
    while !folder.path("done/o0/receipt.json").exists() {
        assert!(patience.elapsed() < Duration::from_secs(30), "no outfit in 30 s");
        std::thread::sleep(Duration::from_millis(2));
    }
    crate::folder::cancel(child.id());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let finished =
        (0..OUTFITS).filter(|k| folder.path(&format!("done/o{k}/receipt.json")).exists()).count();
    assert!(0 < finished && finished < OUTFITS, "{finished}");
    for (path, _) in folder.files() {
        assert!(!path.ends_with(".ifg-partial"), "{}", path.display());
    }
    let folders = std::fs::read_dir(folder.path("done")).unwrap().count();
    assert_eq!(folders, finished, "a folder without a receipt");
    // Of the rest only a few, to be quick.
    let some = format!("fix --out done --json o0.toml o{}.toml", OUTFITS - 1);
    assert_eq!(states(&folder.ifg(&some).expect(0)), ["finished", "clean everywhere"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_signal_that_the_starter_has_it_ignore_stays_ignored() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let folder = Folder::new();
    let mut files = String::new();
    for k in 0..40 {
        folder.write(&format!("o{k}.toml"), folder.read("outfit.toml"));
        files += &format!(" o{k}.toml");
    }
    // As `nohup` does, and shells with what they start in the background.
    let ifg = env!("CARGO_BIN_EXE_ifg");
    let script = format!("trap '' HUP INT; exec {ifg} fix --out done --no-pictures{files}");
    let mut shell = Command::new("sh");
    shell.args(["-c", &script]).current_dir(folder.path("."));
    let mut child = shell.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let patience = Instant::now();
    while !folder.path("done/o0/receipt.json").exists() {
        assert!(patience.elapsed() < Duration::from_secs(30), "no outfit in 30 s");
        std::thread::sleep(Duration::from_millis(2));
    }
    for signal in ["-HUP", "-INT"] {
        Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    }
    assert!(!folder.path("done/o39/receipt.json").exists(), "it was done before the signals");
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert!(folder.path("done/o39/receipt.json").exists());
}

#[test]
fn what_another_outfit_of_the_batch_reads_is_not_replaced() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("a")).unwrap();
    let garment =
        |body: &str, file: &str| format!("body = \"{body}\"\n[[garment]]\nfile = \"{file}\"\n");
    // `a` would write a/skirt.ply, which is the garment or the body of `b`.
    folder.write("a/skirt.ply", folder.read("skirt.ply"));
    folder.write("a.toml", garment("body.ply", "skirt.ply"));
    folder.write("b.toml", garment("body.ply", "a/skirt.ply"));
    folder.write("a/body.ply", folder.read("body.ply"));
    for options in ["", "--in-place", "--shard 1/2"] {
        let before = folder.read("a/skirt.ply");
        let run = folder.ifg(&format!("fix a.toml b.toml --out . {options}")).expect(2);
        assert!(run.stderr.contains("is an input of outfit `b`"), "{}", run.stderr);
        assert!(folder.read("a/skirt.ply") == before, "{options}");
    }
    // Outfits may share what neither writes.
    folder.write("b.toml", garment("body.ply", "skirt.ply"));
    folder.ifg("fix a.toml b.toml --out done").expect(0);
}
