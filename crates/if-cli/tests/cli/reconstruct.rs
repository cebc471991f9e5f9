//! What `ifg reconstruct` refuses, and what it leaves of a wardrobe that others write into.

use crate::folder::{Folder, Run};
use if_body::{Motion, Pose, SkinWeights, TemplateBody};
use if_core::math::{Point, Vector};
use if_pipeline::capture::Capture;
use if_pipeline::reconstruct::posed;
use serde_json::{Value, json};
use std::fs;
use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

const CAPTURE: &str = "capture synth --out cap --garments trousers,tshirt --frames 6 --size 96";
const QUICK: &str = "--cell 24mm";

/// Changes `meta.json` of the capture.
fn edit(folder: &Folder, change: impl FnOnce(&mut Value)) {
    let mut meta: Value = serde_json::from_slice(&folder.read("cap/meta.json")).unwrap();
    change(&mut meta);
    folder.write("cap/meta.json", meta.to_string());
}

/// Copies a folder with all that is in it.
fn copy(from: &std::path::Path, to: &std::path::Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let (path, to) = entry.map(|e| (e.path(), to.join(e.file_name()))).unwrap();
        match path.is_dir() {
            true => copy(&path, &to),
            false => assert!(fs::copy(&path, &to).is_ok()),
        }
    }
}

/// The names of the folders in a folder.
fn names(folder: &Folder, parent: &str) -> Vec<String> {
    let entries = fs::read_dir(folder.path(parent)).unwrap();
    let mut names: Vec<String> =
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.retain(|n| !n.starts_with('.'));
    names.sort();
    names
}

#[test]
fn what_is_wrong_is_said_before_anything_is_written() {
    let folder = Folder::new();
    folder.ifg(CAPTURE).expect(0);
    let meta = folder.read("cap/meta.json");
    let refused = |args: &str, words: &[&str]| {
        let stderr =
            folder.ifg(&format!("reconstruct cap --body cap/body --out w {args}")).expect(2).stderr;
        for word in words {
            assert!(stderr.contains(word), "`{word}` is missing:\n{stderr}");
        }
        folder.write("cap/meta.json", &meta);
    };
    refused("--prefix a/", &["a/trousers"]);
    refused("--prefix .", &[".trousers"]);
    edit(&folder, |meta| {
        for key in ["labels", "layers_inner_to_outer"] {
            let list = meta[key].as_array_mut().unwrap();
            let n = list.len();
            (list[n - 2], list[n - 1]) = (json!("a b"), json!("a_b"));
        }
    });
    refused("", &["`a b` and `a_b`", "cap_a_b"]);
    edit(&folder, |meta| meta["frames"][2]["rot"][3] = json!([0.0, 0.0, 0.0, 0.0]));
    refused("", &["frame 2", "rotation 3", "unit quaternion"]);
    edit(&folder, |meta| drop(meta["frames"][4]["rot"].as_array_mut().unwrap().pop()));
    refused("", &["frame 4", "12 rotations for 13 joints"]);
    edit(&folder, |meta| {
        meta["joints"].as_array_mut().unwrap().pop();
        meta["frames"]
            .as_array_mut()
            .unwrap()
            .iter_mut()
            .for_each(|f| drop(f["rot"].as_array_mut().unwrap().pop()));
    });
    refused("", &["12 joints", "has 13", "give --body"]);
    edit(&folder, |meta| meta["t"] = json!([0.0, 0.0, -50.0]));
    refused("", &["none of the 6 frames", "frame 0", "lies elsewhere", "behind the camera"]);
    edit(&folder, |meta| meta["t"][2] = json!(3000.0));
    refused("", &["lies elsewhere", "m from the camera", "in metres?"]);
    edit(&folder, |meta| meta["frames"][1]["root_t"] = json!([0.0, 1e300, 0.0]));
    refused("", &["frame 1", "moves the root"]);
    let picture = folder.read("cap/mask_noisy/0003.png");
    folder.write("cap/mask_noisy/0003.png", &picture[..picture.len() / 2]);
    refused("", &["frame 3", "0003.png", "end of file"]);
    assert!(!folder.path("w/garments").exists() && !folder.path("w/bodies").exists());
    folder.write("cap/mask_noisy/0003.png", picture);
    // What a stopped run left is at fault, and the help says so.
    fs::create_dir_all(folder.path("w")).unwrap();
    folder.write("w/.cap.reconstruct.state", "no state");
    refused("", &["not a complete checkpoint", "can be removed"]);
}

#[test]
fn each_nth_frame_alone_is_used_under_its_number() {
    let folder = Folder::new();
    folder.ifg(CAPTURE).expect(0);
    let run = folder.ifg(&format!(
        "reconstruct cap --body cap/body --out w --every 2 --pose-noise 1,3 --json {QUICK}"
    ));
    assert_eq!(run.expect(0).json()["surface"]["frames"], 3);
    let poses: Value = serde_json::from_slice(&folder.read("w/clothed/cap/poses.json")).unwrap();
    let frames = poses["frames"].as_array().unwrap();
    assert_eq!(frames.iter().map(|f| &f["index"]).collect::<Vec<_>>(), [0, 2, 4]);
    folder.ifg("reconstruct cap --body cap/body --out w --every 0").expect(2);
}

#[test]
fn captures_of_several_bodies_share_a_wardrobe_also_at_once() {
    let folder = Folder::new();
    folder.ifg(CAPTURE).expect(0);
    edit(&folder, |meta| {
        for key in ["labels", "layers_inner_to_outer"] {
            let list = meta[key].as_array_mut().unwrap();
            *list.last_mut().unwrap() = json!("white shirt");
        }
    });
    // Another body in a folder of the same name: a comment makes its file another one.
    fs::create_dir_all(folder.path("other/body")).unwrap();
    let mut ply = folder.read("cap/body/body_clean.ply");
    let at = ply.windows(7).position(|w| w == b"element").unwrap();
    ply.splice(at..at, b"comment of another person\n".iter().copied());
    folder.write("other/body/body_clean.ply", ply);
    folder.write("other/body/skeleton.json", folder.read("cap/body/skeleton.json"));
    let command = |body: &str, prefix: &str| {
        folder.command(&format!("reconstruct cap --body {body} --out w --prefix {prefix} {QUICK}"))
    };
    let runs = [("cap/body", "a_"), ("other/body", "b_"), ("cap/body", "c_")];
    let started: Vec<_> = runs[..2]
        .iter()
        .map(|(body, prefix)| {
            command(body, prefix).stdout(std::process::Stdio::null()).spawn().unwrap()
        })
        .collect();
    for mut child in started {
        assert!(child.wait().unwrap().success());
    }
    Run::from(command(runs[2].0, runs[2].1).output().unwrap()).expect(0);
    assert_eq!(names(&folder, "w/bodies"), ["body", "body_2"]);
    assert_eq!(names(&folder, "w/garments").len(), 6);
    let body = |garment: &str| {
        let info: Value =
            serde_json::from_slice(&folder.read(&format!("w/garments/{garment}/asset.json")))
                .unwrap();
        info["body"]["name"].clone()
    };
    assert_eq!(body("a_white_shirt"), body("c_trousers"));
    assert_ne!(body("a_white_shirt"), body("b_white_shirt"));
    // All are still of use.
    folder.ifg("wardrobe list w").expect(0);
    folder.ifg("wardrobe match w --body body b_trousers a_white_shirt --out worn").expect(0);
    // Nor a garment that cannot be read, nor one of a capture with the same description.
    let info = folder.read("w/garments/c_trousers/asset.json");
    folder.write("w/garments/c_trousers/asset.json", "{");
    let run = Run::from(command("cap/body", "c_").output().unwrap()).expect(2);
    assert!(run.stderr.contains("garments/c_trousers` is in the way"), "{}", run.stderr);
    folder.write("w/garments/c_trousers/asset.json", info);
    copy(&folder.path("cap"), &folder.path("twin/cap"));
    let twin = format!("reconstruct twin/cap --body cap/body --out w --prefix c_ {QUICK}");
    let run = folder.ifg(&twin).expect(2);
    assert!(run.stderr.contains("made of another capture"), "{}", run.stderr);
    // Another capture of the same name does not replace the clothed person of this one.
    let other = format!(
        "made of another capture, `{}`",
        folder.path("cap").canonicalize().unwrap().display()
    );
    fs::create_dir(folder.path("elsewhere")).unwrap();
    fs::rename(folder.path("cap"), folder.path("elsewhere/cap")).unwrap();
    let meta = folder.path("elsewhere/cap/meta.json");
    fs::write(&meta, fs::read_to_string(&meta).unwrap() + "\n").unwrap();
    let clothed = folder.read("w/clothed/cap/report.json");
    let again = format!("reconstruct elsewhere/cap --body other/body --out w --prefix d_ {QUICK}");
    let run = folder.ifg(&again).expect(2);
    for words in ["a clothed person `cap`", &other, "another name"] {
        assert!(run.stderr.contains(words), "{words}\n{}", run.stderr);
    }
    // Nor its garments, though it is called by the same words elsewhere.
    let mut same = folder
        .command(&format!("reconstruct cap --body ../other/body --out ../w --prefix a_ {QUICK}"));
    let run = Run::from(same.current_dir(folder.path("elsewhere")).output().unwrap()).expect(2);
    for words in ["a garment `a_", &other, "--prefix"] {
        assert!(run.stderr.contains(words), "{words}\n{}", run.stderr);
    }
    assert_eq!(folder.read("w/clothed/cap/report.json"), clothed);
}

/// Starts a reconstruction, calls `meanwhile` when it has written its first checkpoint, and returns how it
/// ended.
fn while_running(folder: &Folder, args: &str, state: &str, meanwhile: impl FnOnce()) -> Run {
    let mut command = folder.command(args);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while !folder.path(state).exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "no {state}");
        sleep(Duration::from_millis(1));
    }
    meanwhile();
    child.wait_with_output().unwrap().into()
}

#[test]
fn a_capture_of_the_name_of_one_that_is_being_reconstructed_is_refused_for_now() {
    let folder = Folder::new();
    folder.ifg(CAPTURE).expect(0);
    folder.ifg(&CAPTURE.replace("--out cap", "--out other/cap --seed 1")).expect(0);
    let of = |capture: &str, prefix: &str| {
        format!("reconstruct {capture} --body cap/body --out w {prefix} --cell 12mm")
    };
    let mut refused = Vec::new();
    let run = while_running(&folder, &of("cap", ""), "w/.cap.reconstruct.state", || {
        // The same once more, another capture of the name, and one that would write the same garments.
        refused = [of("cap", ""), of("other/cap", "--prefix b_"), of("other/cap", "")]
            .map(|args| folder.ifg(&args))
            .into();
    });
    run.expect(0);
    for run in refused {
        let run = run.expect(75);
        assert!(
            run.stderr.contains("another ifg is writing into `w/clothed/cap`"),
            "{}",
            run.stderr
        );
    }
    assert_eq!(names(&folder, "w/garments"), ["cap_trousers", "cap_tshirt"]);
    let hidden: Vec<_> = fs::read_dir(folder.path("w")).unwrap().collect();
    assert_eq!(hidden.len(), 3, "bodies, garments and clothed: {hidden:?}");
    // Afterwards it is refused for good.
    let run = folder.ifg(&of("other/cap", "--prefix b_")).expect(2);
    assert!(run.stderr.contains("made of another capture"), "{}", run.stderr);
}

#[test]
fn another_description_at_the_same_place_replaces_nothing_unless_that_is_asked_for() {
    let folder = Folder::new();
    folder.ifg(CAPTURE).expect(0);
    let args = format!("reconstruct cap --body cap/body --out w --body-name anna {QUICK}");
    // What was written, and under which names, is stated.
    let run = folder.ifg(&args).expect(0);
    let line = "w: body anna, garments cap_trousers, cap_tshirt, and clothed/cap";
    assert!(run.stdout.contains(line), "{}", run.stdout);
    assert_eq!(names(&folder, "w/bodies"), ["anna"]);
    let before = folder.read("w/clothed/cap/provenance.json");
    edit(&folder, |meta| meta["generator"] = json!("another program"));
    let run = folder.ifg(&args).expect(2);
    for words in ["a garment `cap_trousers`", "had another meta.json", "add --replace"] {
        assert!(run.stderr.contains(words), "{words}\n{}", run.stderr);
    }
    // Nor does another prefix replace the clothed person.
    let run = folder.ifg(&format!("{args} --prefix b_")).expect(2);
    assert!(run.stderr.contains("a clothed person `cap`"), "{}", run.stderr);
    assert!(folder.read("w/clothed/cap/provenance.json") == before);
    // The body is there, and keeps its name.
    let run = folder.ifg(&(args.replace("anna", "berta") + " --replace --json")).expect(0);
    let wrote = &run.json()["wrote"];
    assert_eq!(wrote["body"], "anna");
    assert_eq!(wrote["garments"], json!(["cap_trousers", "cap_tshirt"]));
    assert_eq!(wrote["clothed"], "clothed/cap");
    assert!(run.json()["surface"]["frames"] == 6);
    assert!(folder.read("w/clothed/cap/provenance.json") != before);
    folder.ifg(&args).expect(0);
    // Of another folder it replaces nothing.
    copy(&folder.path("cap"), &folder.path("twin/cap"));
    let twin = args.replace("reconstruct cap", "reconstruct twin/cap") + " --replace";
    assert!(folder.ifg(&twin).expect(2).stderr.contains("made of another capture"));
}

#[test]
fn a_finished_capture_is_skipped_until_something_of_it_changes() {
    let folder = Folder::new();
    folder.ifg(CAPTURE).expect(0);
    let args = format!("reconstruct cap --body cap/body --out w {QUICK}");
    let is_skipped = |args: &str| {
        let stdout = folder.ifg(args).expect(0).stdout;
        stdout.contains("cap: finished before, skipped (--again does it again)")
    };
    let first = folder.ifg(&format!("{args} --json")).expect(0);
    assert!(is_skipped(&args));
    assert_eq!(folder.ifg(&format!("{args} --json")).expect(0).stdout, first.stdout);
    assert!(!is_skipped(&format!("{args} --again")));
    // Another option, other pictures, another body, a file that is gone or not as it was written.
    assert!(!is_skipped(&format!("{args} --bake")));
    assert!(is_skipped(&format!("{args} --bake")) && !is_skipped(&args));
    folder.write("cap/mask_noisy/0001.png", folder.read("cap/mask_noisy/0002.png"));
    assert!(!is_skipped(&args) && is_skipped(&args));
    let mut skeleton = folder.read("cap/body/skeleton.json");
    skeleton.push(b'\n');
    folder.write("cap/body/skeleton.json", skeleton);
    assert!(!is_skipped(&args) && is_skipped(&args));
    fs::remove_dir_all(folder.path("w/garments/cap_tshirt")).unwrap();
    assert!(!is_skipped(&args) && is_skipped(&args));
    fs::remove_file(folder.path("w/clothed/cap/report.html")).unwrap();
    assert!(!is_skipped(&args) && is_skipped(&args));
    folder.write("w/clothed/cap/receipt.json", "{");
    assert!(!is_skipped(&args) && is_skipped(&args));
}

#[test]
fn what_a_finished_capture_was_warned_of_fails_strict_again() {
    let folder = Folder::new();
    folder.ifg(&CAPTURE.replace("--frames 6", "--frames 3")).expect(0);
    let args = format!("reconstruct cap --body cap/body --out w --strict {QUICK}");
    let runs = [folder.ifg(&args).expect(1).stdout, folder.ifg(&args).expect(1).stdout];
    let warned = |text: &str| text.matches("warning: ").count();
    assert!(runs[1].contains("finished before"), "{}", runs[1]);
    assert!(warned(&runs[0]) > 0 && warned(&runs[0]) == warned(&runs[1]), "{runs:?}");
}

#[test]
fn a_damaged_checkpoint_starts_anew_with_a_note_and_half_of_one_is_removed() {
    let folder = Folder::new();
    folder.ifg(CAPTURE).expect(0);
    let args = format!("reconstruct cap --body cap/body --out w --prefix a_ --verbose {QUICK}");
    let state = "w/.cap.a_.reconstruct.state";
    fs::create_dir_all(folder.path("w")).unwrap();
    let args = args + " --again";
    for damaged in [&b""[..], &[0; 500], b"ifg surface v0\n\0 of another version"] {
        folder.write(state, damaged);
        // What a kill leaves while it is written, and what another process is writing.
        folder.write("w/.ifg-.cap.a_.reconstruct.state-x1y2z3.part", "half");
        folder.write("w/.ifg-another.ply-x1y2z3.part", "half");
        let run = folder.ifg(&args).expect(0);
        assert!(run.stderr.contains("is damaged, or of another version"), "{}", run.stderr);
        let left: Vec<_> = fs::read_dir(folder.path("w")).unwrap().map(|e| e.unwrap()).collect();
        assert_eq!(left.len(), 4, "{left:?}");
        assert!(folder.path("w/.ifg-another.ply-x1y2z3.part").exists());
        // With -v each stage is logged.
        for stage in ["reading frames", "fitting the surface", "finding garments"] {
            assert!(run.stderr.contains(&format!("DEBUG cap: {stage}")), "{stage}\n{}", run.stderr);
        }
    }
    assert!(!folder.ifg(&args.replace("--verbose", "")).expect(0).stderr.contains("DEBUG"));
}

#[test]
#[ignore = "stress"]
fn poses_with_a_stated_error_are_refined_and_exact_ones_are_left() {
    let folder = Folder::new();
    let scene = "--garments trousers,tshirt --frames 6 --size 96";
    folder.ifg(&format!("capture synth --out cap {scene}")).expect(0);
    folder.ifg(&format!("capture synth --out off {scene} --pose-noise 3,9")).expect(0);
    let run = |cap: &str, out: &str, args: &str| {
        folder
            .ifg(&format!("reconstruct {cap} --body {cap}/body --out {out} {QUICK} {args}"))
            .expect(0)
            .stdout
    };
    let mesh = |path: &str| folder.read(&format!("{path}/canonical.ply"));
    // The one capture states exact poses, the other 3° and 9 mm.
    assert!(!run("cap", "exact", "").contains("refined"));
    assert!(!folder.path("exact/clothed/cap/poses.json").exists());
    assert!(run("off", "stated", "").contains("poses were refined"));
    let read = |path: &str| serde_json::from_slice::<Value>(&folder.read(path)).unwrap();
    let [truth, refined, given] =
        ["off/truth/poses.json", "stated/clothed/off/poses.json", "off/meta.json"].map(read);
    assert_eq!(refined["frames"].as_array().unwrap().len(), 6);
    assert!(
        truth["frames"] == read("cap/meta.json")["frames"] && truth["joints"] == given["joints"]
    );
    assert!(refined["frames"] != given["frames"] && given["frames"] != truth["frames"]);
    // A capture that states nothing has an estimator's poses; the option overrides that.
    edit(&folder, |meta| {
        meta.as_object_mut().unwrap().retain(|key, _| !key.starts_with("pose_sigma"));
    });
    assert!(run("cap", "unstated", "").contains("poses were refined"));
    assert!(!run("cap", "again", "--pose-noise 0,0").contains("refined"));
    assert!(mesh("exact/clothed/cap") == mesh("again/clothed/cap"));
    assert!(mesh("exact/clothed/cap") != mesh("unstated/clothed/cap"));
    for bad in ["3", "-1,2", "a,b", "nan,1", "90,1"] {
        let args = format!("reconstruct cap --body cap/body --out w --pose-noise={bad}");
        folder.ifg(&args).expect(2);
    }
}

#[test]
fn frames_that_do_not_match_their_images_are_named_and_strict_exits_with_1() {
    let folder = Folder::new();
    folder.ifg(CAPTURE).expect(0);
    let args = format!("reconstruct cap --body cap/body --out w {QUICK}");
    // An arm swings by 90° in one frame, where the images do not show it.
    edit(&folder, |meta| {
        let joints = meta["joints"].as_array().unwrap();
        let arm = joints.iter().position(|j| j == "left_arm").unwrap();
        meta["frames"][3]["rot"][arm] = json!([0.5f64.sqrt(), 0.0, 0.0, 0.5f64.sqrt()]);
    });
    // Poses are smooth in time: the arm of the frame before or after may be off as well.
    let words = |text: &str| {
        let named = text.split("warning: frame").nth(1).and_then(|t| t.split(" cannot").next());
        let named = named.unwrap_or_default().trim_start_matches('s').split(',');
        let frames: Vec<usize> = named.filter_map(|f| f.trim().parse().ok()).collect();
        frames.contains(&3) && frames.iter().all(|f| (2..=4).contains(f)) && text.contains("left_")
    };
    assert!(words(&folder.ifg(&args).expect(0).stdout));
    assert!(words(&folder.ifg(&format!("{args} --strict --json")).expect(1).stderr));
    assert!(folder.path("w/garments/cap_trousers").exists());
    // One that is far off is left out, which is said.
    folder.ifg(&CAPTURE.replace("--out cap", "--out far")).expect(0);
    let meta = folder.path("far/meta.json");
    let mut far: Value = serde_json::from_slice(&std::fs::read(&meta).unwrap()).unwrap();
    far["frames"][1]["root_t"] = json!([1.0, 0.0, 0.0]);
    std::fs::write(&meta, far.to_string()).unwrap();
    let run = folder.ifg(&args.replace("reconstruct cap", "reconstruct far")).expect(0);
    assert!(run.stdout.contains("warning: in frame 1 the posed template"), "{}", run.stdout);
    let strict = args.replace("reconstruct cap", "reconstruct far") + " --strict --json";
    let strict = folder.ifg(&strict).expect(1);
    assert!(strict.stderr.contains("; it is not used"), "{}", strict.stderr);
}

#[test]
fn a_garment_that_no_picture_shows_is_named_and_strict_exits_with_1() {
    let folder = Folder::new();
    folder.ifg(CAPTURE).expect(0);
    edit(&folder, |meta| {
        for list in ["labels", "layers_inner_to_outer"] {
            meta[list].as_array_mut().unwrap().push(json!("scarf"));
        }
    });
    let args = format!("reconstruct cap --body cap/body --out w {QUICK}");
    let words = "scarf: not reconstructed";
    assert!(folder.ifg(&args).expect(0).stdout.contains(words));
    let strict = folder.ifg(&format!("{args} --strict --json")).expect(1);
    assert!(strict.stderr.contains(words), "{}", strict.stderr);
    assert_eq!(strict.json()["missing"], json!(["scarf"]));
    assert_eq!(names(&folder, "w/garments"), ["cap_trousers", "cap_tshirt"]);
}

#[test]
fn the_fields_route_writes_the_networks_that_its_meshes_come_from() {
    let folder = Folder::new();
    let scene = "--garments trousers,tshirt --frames 4 --size 64 --pose-noise 2,5 --camera-noise 1";
    folder.ifg(&format!("capture synth --out cap {scene}")).expect(0);
    let args = "reconstruct cap --body cap/body --route fields --fields-steps 12 --cell 24mm";
    let run = folder.ifg(&format!("{args} --out w --phi-steps 4 --frames")).expect(0);
    assert!(run.stdout.contains("φ and d were trained in 12 steps"), "{}", run.stdout);
    let report: Value = serde_json::from_slice(&folder.read("w/clothed/cap/report.json")).unwrap();
    let round = &report["fields"]["rounds"][0];
    assert!(round["rays"]["used"].as_u64().unwrap() > 10_000, "{round}");
    assert!(report["motion"]["mean_mm"].as_f64().unwrap() > 0.0);
    // The canonical mesh is that of the written φ, which every garment has.
    let phi = "w/clothed/cap/phi.safetensors";
    folder.ifg(&format!("extract {phi} --cell 24mm --out again.ply")).expect(0);
    let [again, canonical] = ["again.ply", "w/clothed/cap/canonical.ply"]
        .map(|path| if_mesh::ply::read_path(&folder.path(path)).unwrap().mesh.aabb());
    assert!((again.min - canonical.min).norm() < 0.01 && (again.max - canonical.max).norm() < 0.01);
    assert!(folder.read(phi) == folder.read("w/garments/cap_trousers/phi.safetensors"));
    assert!(names(&folder, "w").iter().all(|n| !n.contains("state")));
    // Frames are LBS(x + d) with the written d and poses, not with those that were given.
    let bytes = folder.read("w/clothed/cap/deformation.safetensors");
    let (network, frame) = if_neural::files::read_deformation(&bytes[..]).unwrap();
    let file = if_mesh::ply::read_path(&folder.path("w/clothed/cap/canonical.ply")).unwrap();
    let template = TemplateBody::read(&folder.path("cap/body")).unwrap();
    let skin = SkinWeights::from_ply(&file, template.skeleton.len()).unwrap();
    let points: Vec<[f32; 3]> = file.mesh.vertices().iter().map(|p| frame.to_unit(p)).collect();
    let mut offsets = vec![[0.0; 3]; points.len()];
    network.offsets(&points, &vec![1; points.len()], &mut offsets);
    let d: Vec<Vector> =
        offsets.iter().map(|d| Vector::from(d.map(f64::from)) / frame.scale).collect();
    assert!(d.iter().any(|d| d.norm() > 1e-4));
    let poses = folder.path("w/clothed/cap/poses.json");
    let motion = Motion::read_path(&poses, &template.skeleton).unwrap();
    let capture = Capture::open(&folder.path("cap")).unwrap();
    let at = |pose: &Pose| posed(&file.mesh, &skin, &template.skeleton, pose, &d).unwrap();
    let found =
        if_mesh::ply::read_path(&folder.path("w/clothed/cap/frames/frame_0001.ply")).unwrap().mesh;
    let off = |expected: Vec<Point>| {
        let apart = found.vertices().iter().zip(&expected).map(|(a, b)| (a - b).norm());
        apart.fold(0.0, f64::max)
    };
    let (by_found, by_given) = (off(at(&motion.poses[1])), off(at(capture.pose(1))));
    assert!(by_found < 1e-5 && by_given > 1e-3, "{by_found} {by_given}");
    // The camera that they go with is beside them.
    let written: Value = serde_json::from_slice(&fs::read(poses).unwrap()).unwrap();
    let given: Value = serde_json::from_slice(&folder.read("cap/meta.json")).unwrap();
    assert!(written["R"] != given["R"] && written["R"][2].as_array().unwrap().len() == 3);
    for bad in ["--motion-steps 3 --frames", "--fields-steps x", "--route other"] {
        folder.ifg(&format!("{args} --out w {bad}")).expect(2);
    }
    for bad in ["--fields-steps 3", "--phi mlp"] {
        let stderr =
            folder.ifg(&format!("reconstruct cap --body cap/body --out w {bad}")).expect(2).stderr;
        assert!(stderr.contains("add --route fields"), "{stderr}");
    }
}

#[test]
fn half_a_turn_leaves_a_skirt_whole() {
    let folder = Folder::new();
    folder.ifg("capture synth --out cap --garments skirt --frames 24 --size 96").expect(0);
    edit(&folder, |meta| meta["frames"].as_array_mut().unwrap().truncate(12));
    folder.ifg(&format!("reconstruct cap --body cap/body --out w {QUICK}")).expect(0);
    // The side that no frame sees is no underside: it would be cut out, from hem to waist.
    let report: Value = serde_json::from_slice(&folder.read("w/clothed/cap/report.json")).unwrap();
    assert_eq!(report["garments"][0]["openings"], 2, "{}", report["garments"]);
}
