//! Whatever is wrong is said, with exit code 2, and nothing is written.

use crate::folder::{Folder, body, moved, obj, ply};
use if_core::math::Vector;
use if_core::mesh::TriMesh;

/// Runs `fix` and `check`; both must end with 2 and say all the words; nothing may be written.
#[track_caller]
fn refused(folder: &Folder, args: &str, words: &[&str]) {
    let before = folder.files();
    let fix = folder.ifg(&format!("fix {args} --out fixed")).expect(2);
    let check = folder.ifg(&format!("check {args}")).expect(2);
    for word in words {
        assert!(fix.stderr.contains(word), "`{word}` is missing:\n{}", fix.stderr);
        assert!(check.stderr.contains(word), "`{word}` is missing:\n{}", check.stderr);
    }
    assert!(fix.stdout.is_empty() && check.stdout.is_empty());
    assert!(folder.files() == before, "files changed");
}

/// Runs a command; it must end with 2 and say all the words; nothing may be written.
#[track_caller]
fn fails(folder: &Folder, args: &str, words: &[&str]) {
    let before = folder.files();
    let run = folder.ifg(args).expect(2);
    for word in words {
        assert!(run.stderr.contains(word), "`{word}` is missing:\n{}", run.stderr);
    }
    assert!(folder.files() == before, "files changed");
}

/// A garment file of this content is refused.
#[track_caller]
fn bad_garment(name: &str, content: impl AsRef<[u8]>, words: &[&str]) {
    let folder = Folder::new();
    folder.write(name, content);
    refused(&folder, &format!("--body body.ply skirt.ply {name}"), &[&[name], words].concat());
}

/// A body file of this content is refused.
#[track_caller]
fn bad_body(name: &str, content: impl AsRef<[u8]>, words: &[&str]) {
    let folder = Folder::new();
    folder.write(name, content);
    refused(&folder, &format!("--body {name} skirt.ply"), &[&[name], words].concat());
}

#[test]
fn a_missing_file() {
    refused(&Folder::new(), "--body body.ply nowhere.ply", &["nowhere.ply", "No such file"]);
}

#[test]
fn a_folder_in_place_of_a_file() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("folder.ply")).unwrap();
    refused(&folder, "--body body.ply folder.ply", &["folder.ply", "not a file"]);
}

#[test]
fn an_empty_file() {
    bad_garment("empty.ply", "", &["the file is empty"]);
    bad_garment("empty.obj", "", &["no `v` line"]);
    bad_body("empty.ply", "", &["the file is empty"]);
}

#[test]
fn a_truncated_file() {
    let whole = ply(&body());
    let line_end = whole[..whole.len() * 2 / 3].rfind('\n').unwrap();
    bad_garment("cut.ply", &whole[..line_end], &["the file ends at", "cut off"]);
    bad_garment("cut.ply", &whole[..line_end + 4], &["record", "expected 3"]);
    bad_garment("header.ply", &whole[..60], &["end_header"]);
}

#[test]
fn a_wrong_extension() {
    bad_garment("shirt.stl", obj(&body()), &[".ply, .obj, .glb, .gltf or .vrm"]);
}

#[test]
fn not_a_number() {
    bad_garment(
        "nan.obj",
        obj(&body()).replacen("v ", "v nan ", 1).replacen("v nan ", "v NaN 0 0 #", 1),
        &["vertex 0", "finite"],
    );
    bad_garment("word.obj", "v 1 2 x\n", &["line 1", "\"x\""]);
}

#[test]
fn an_index_out_of_range() {
    bad_garment("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", &["line 4", "9"]);
}

#[test]
fn a_garment_without_triangles() {
    bad_garment("points.obj", "v 0 0 0\nv 1 0 0\n", &["points", "no triangles"]);
}

#[test]
fn a_body_in_millimetres() {
    bad_body(
        "mm.obj",
        obj(&moved(&body(), |p| p * (1740.0 / 1.8))),
        &["1740.0", "millimetres", "--scale 0.001"],
    );
}

#[test]
fn a_scale_that_is_wrong_is_named() {
    let folder = Folder::new();
    let refused = |scale: &str, wanted: &[&str]| {
        refused(&folder, &format!("--body body.ply skirt.ply --scale {scale}"), wanted);
    };
    refused("0.001", &["likely kilometres", "it was scaled by 0.001; leave out --scale"]);
    refused("0.01", &["it was scaled by 0.01; leave out --scale"]);
    refused("100", &["it was scaled by 100", "leave out --scale"]);
    refused("-1", &["give a positive number"]);
}

#[test]
fn a_body_without_an_inside() {
    let whole = body();
    let sheet = TriMesh::new(whole.vertices().to_vec(), whole.triangles()[..20].to_vec()).unwrap();
    bad_body("sheet.obj", obj(&sheet), &["no inside", "closed"]);
}

#[test]
fn the_body_as_a_garment() {
    bad_garment(
        "again.ply",
        ply(&body()),
        &["`again` is the body itself", "garments after the body"],
    );
}

#[test]
fn a_garment_far_away() {
    bad_garment(
        "far.obj",
        obj(&moved(&body(), |p| p + Vector::x() * 50.0)),
        &["far", "from the body"],
    );
}

#[test]
fn one_name_for_two_layers() {
    let folder = Folder::new();
    folder.write("twice.toml", "body='body.ply'\n[[garment]]\nfile='skirt.ply'\n[[garment]]\nfile='hoop.ply'\nname='skirt'\n");
    refused(&folder, "twice.toml", &["hoop.ply", "two layers are called `skirt`"]);
}

#[test]
fn one_file_name_for_two_outputs() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("other")).unwrap();
    folder.write("other/Skirt.ply", folder.read("hoop.ply"));
    fails(
        &folder,
        "fix --body body.ply skirt.ply other/Skirt.ply --out fixed",
        &["other/Skirt.ply", "both be written"],
    );
    folder.write("other/outfit.toml", folder.read("outfit.toml"));
    fails(
        &folder,
        "fix outfit.toml other/outfit.toml --out fixed",
        &["other/outfit.toml", "both be written"],
    );
}

#[test]
fn an_outfit_file_at_fault() {
    for (content, words) in [
        ("body = ", &["broken.toml"][..]),
        ("", &["missing field `body`"]),
        ("body = 'body.ply'\n", &["no garment"]),
        (
            "body = 'body.ply'\nbodice = 1\n[[garment]]\nfile = 'skirt.ply'\n",
            &["unknown field `bodice`", "expected", "garment"],
        ),
        (
            "body = 'body.ply'\n[[garment]]\nfiel = 'skirt.ply'\n",
            &["unknown field `fiel`", "`file`"],
        ),
        (
            "body = 'body.ply'\n[[garment]]\nfile = 'skirt.ply'\n[params]\nclearence = 1\n",
            &["unknown parameter `clearence`", "goal.clearance"],
        ),
        (
            "body = 'body.ply'\n[[garment]]\nfile = 'skirt.ply'\n[params]\nclearance = 'wide'\n",
            &["clearance = 'wide'"],
        ),
        ("body = 'body.ply'\nscale = 0\n[[garment]]\nfile = 'skirt.ply'\n", &["scale is 0"]),
        ("body = 'body.ply'\n[[garment]]\nfile = '..'\n", &["names no file"]),
        ("body = 'body.ply'\n[[garment]]\nfile = 'gone.ply'\n", &["gone.ply", "No such file"]),
    ] {
        let folder = Folder::new();
        folder.write("broken.toml", content);
        refused(&folder, "broken.toml", words);
    }
    refused(&Folder::new(), "gone.toml", &["gone.toml", "No such file"]);
}

#[test]
fn arguments_at_fault() {
    let folder = Folder::new();
    refused(&folder, "skirt.ply", &["skirt.ply", "--body"]);
    refused(&folder, "--body body.ply outfit.toml", &["outfit.toml", "its own body"]);
    refused(&folder, "", &["FILES"]);
    refused(&folder, "--body body.ply skirt.ply --scale 0", &["--scale", "positive"]);
    fails(&folder, "fix --body body.ply skirt.ply", &["--out"]);
    fails(&folder, "fix outfit.toml --clearance 1ft --out fixed", &["`ft`", "mm"]);
    fails(&folder, "fix outfit.toml --clearance -1mm --out fixed", &["-1mm", "negative"]);
    fails(
        &folder,
        "fix outfit.toml --set clearence=1.0 --out fixed",
        &["clearence", "goal.clearance"],
    );
    fails(&folder, "check outfit.toml --threads 0", &["--threads"]);
    for given in [
        "--own keep --set own=remove",
        "--clearance 1mm --set goal.clearance=0.001",
        "--set rounds=40 --set effort.rounds=50",
        "--pinch keep --set pinch=yield",
    ] {
        let twice = format!("fix --body body.ply skirt.ply {given} --out fixed");
        fails(&folder, &twice, &["is given twice on the command line"]);
    }
}

#[test]
fn a_parameter_out_of_range() {
    fails(&Folder::new(), "fix outfit.toml --set clearance=-1.0 --out fixed", &["clearance", "-1"]);
}

#[test]
fn an_output_folder_that_cannot_be() {
    let folder = Folder::new();
    fails(&folder, "fix outfit.toml --out body.ply", &["body.ply", "file"]);
    fails(&folder, "fix outfit.toml --out body.ply/below", &["body.ply/below", "file"]);
    if cfg!(target_os = "linux") {
        // Not even root may make files there.
        fails(&folder, "fix outfit.toml --out /proc/ifg", &["/proc/ifg", "--out"]);
    }
    std::fs::create_dir_all(folder.path("fixed/skirt.ply")).unwrap();
    fails(&folder, "fix outfit.toml --out fixed", &["fixed/skirt.ply", "in the way"]);
    // What is in the way of a copy along leaves the rest alone too.
    let shirt = String::from_utf8(folder.read("shirt.obj")).unwrap();
    folder.write("shirt.obj", format!("mtllib cloth.mtl\n{shirt}"));
    folder.write("cloth.mtl", "map_Kd maps/red.png\n");
    std::fs::create_dir(folder.path("maps")).unwrap();
    folder.write("maps/red.png", "red");
    std::fs::create_dir_all(folder.path("other/cloth.mtl")).unwrap();
    folder.write("other/skirt.ply", "mine");
    fails(&folder, "fix outfit.toml --out other", &["other/cloth.mtl", "in the way"]);
    std::fs::remove_dir(folder.path("other/cloth.mtl")).unwrap();
    folder.write("other/maps", "a file");
    fails(
        &folder,
        "fix outfit.toml --out other",
        &["other/maps/red.png", "a part of the path is a file"],
    );
}

#[cfg(target_os = "linux")]
#[test]
fn a_material_library_that_cannot_be_read() {
    let folder = Folder::new();
    let shirt = String::from_utf8(folder.read("shirt.obj")).unwrap();
    folder.write("shirt.obj", format!("mtllib cloth.mtl\n{shirt}"));
    // A file whose beginning not even root can read.
    std::os::unix::fs::symlink("/proc/self/mem", folder.path("cloth.mtl")).unwrap();
    let run = folder.ifg("fix outfit.toml --out fixed").expect(2);
    assert!(
        run.stderr.contains("cannot read `cloth.mtl`, which `shirt.obj` names"),
        "{}",
        run.stderr
    );
    assert!(!folder.path("fixed").exists());
}

#[test]
fn an_output_that_is_an_input() {
    let folder = Folder::new();
    fails(&folder, "fix outfit.toml --out .", &["skirt.ply", "--in-place"]);
    // The body is never written, in place or not.
    std::fs::create_dir(folder.path("other")).unwrap();
    folder.write("other/body.ply", folder.read("hoop.ply"));
    folder
        .write("names.toml", "body='body.ply'\n[[garment]]\nfile='other/body.ply'\nname='hoop'\n");
    fails(&folder, "fix names.toml --out . --in-place", &["body.ply", "input file"]);
}

/// A limit on the size of files stands in for a full disk.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_nothing_half_written() {
    let folder = Folder::new();
    let before = folder.files();
    let script = format!(
        "trap '' XFSZ; ulimit -f 1; exec {} fix outfit.toml --out fixed",
        env!("CARGO_BIN_EXE_ifg")
    );
    let mut shell = std::process::Command::new("sh");
    let run: crate::folder::Run =
        shell.arg("-c").arg(script).current_dir(folder.path(".")).output().unwrap().into();
    let run = run.expect(2);
    assert!(
        run.stderr.contains("cannot write `fixed/") && run.stderr.contains("make room"),
        "{}",
        run.stderr
    );
    assert!(folder.files() == before, "files changed");
}

/// What whoever starts a program allows it: the shell's limit, in blocks of 512 or 1024 bytes.
#[cfg(unix)]
#[test]
fn a_limit_of_file_sizes_is_an_error_with_advice() {
    let folder = Folder::new();
    let run = |args: &str| {
        let mut command = std::process::Command::new("sh");
        let line = format!("ulimit -f 1; exec \"$0\" {args}");
        command.args(["-c", &line, env!("CARGO_BIN_EXE_ifg")]).current_dir(folder.path("."));
        crate::folder::Run::from(command.output().unwrap()).expect(2)
    };
    for args in ["fix outfit.toml --out w --no-pictures", "capture synth --out w --frames 1"] {
        let run = run(args);
        assert!(run.stderr.contains("ulimit -f"), "{}", run.stderr);
        assert!(!folder.path("w").exists());
    }
}

#[test]
fn errors_are_json_too() {
    let folder = Folder::new();
    for command in ["fix --out fixed", "check"] {
        let json =
            folder.ifg(&format!("{command} --json --body body.ply gone.ply")).expect(2).json();
        assert_eq!((&json["state"], &json["outfit"]), (&"failed".into(), &"outfit".into()));
        assert_eq!(json["error"]["code"], "ifg::input::mesh");
        assert!(json["error"]["causes"][0].as_str().unwrap().contains("gone.ply"), "{json}");
    }
}

#[test]
fn a_parameter_is_given_once_and_is_a_number() {
    let folder = Folder::new();
    let outfit = String::from_utf8(folder.read("outfit.toml")).unwrap();
    folder.write(
        "twice.toml",
        outfit + "[params]\nclearance = 1e-3\n[params.goal]\nclearance = 2e-3\n",
    );
    refused(&folder, "twice.toml", &["parameter `clearance` is given twice"]);
    // Where that is, for programs too.
    let run = folder.ifg("check twice.toml --json").expect(2);
    let at = &run.json()["error"]["at"];
    assert_eq!((at["line"].as_u64(), at["column"].as_u64()), (Some(9), Some(9)), "{at}");
    assert!(at["file"].as_str().unwrap().ends_with("twice.toml"), "{at}");
    const NAN: &str = "fix --body body.ply skirt.ply --out fixed --set clearance=nan";
    fails(&folder, NAN, &["parameter `clearance`", "finite"]);
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_not_read_without_end() {
    let folder = Folder::new();
    std::os::unix::fs::symlink("/dev/zero", folder.path("zero.toml")).unwrap();
    let made = std::process::Command::new("mkfifo").arg(folder.path("pipe.toml")).status();
    assert!(made.unwrap().success());
    for name in ["zero.toml", "pipe.toml"] {
        let run = folder.ifg(&format!("fix {name} --out fixed")).expect(2);
        assert!(run.stderr.contains(name) && run.stderr.contains("not a file"), "{}", run.stderr);
        let motion = format!("animate outfit.toml --motion {name} --skeleton {name} --out moved");
        let run = folder.ifg(&motion).expect(2);
        assert!(run.stderr.contains("not a file"), "{}", run.stderr);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn names_that_are_no_text_are_refused() {
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::new();
    let name = std::ffi::OsStr::from_bytes(b"skirt\xfe.ply");
    std::fs::rename(folder.path("skirt.ply"), folder.path("").join(name)).unwrap();
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_ifg"))
        .args(["fix", "--body", "body.ply", "--out", "fixed"])
        .arg(name)
        .current_dir(folder.path(""))
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&run.stderr).contains("is not UTF-8"));
    assert!(!folder.path("fixed").exists());
}
