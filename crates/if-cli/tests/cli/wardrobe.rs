//! A wardrobe from the command line; batches that are killed and go on.

use crate::folder::{Folder, Run, angular_belt, belt, body, flap, obj, ply};
use if_body::mannequin::{self, Garment, MannequinParams};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::random::SplitMix64;
use if_mesh::ply::{Column, PlyMesh, Property, WriteParams, read_bytes, write_path};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

/// The mesh, a little larger.
fn larger(mesh: &TriMesh) -> TriMesh {
    mesh.with_vertices(
        mesh.vertices().iter().map(|p| Point::new(p.x * 1.1, p.y * 1.02, p.z * 1.1)).collect(),
    )
    .unwrap()
}

/// A wardrobe `w` of two bodies and six belts made on the first.
fn belts() -> Folder {
    let folder = Folder::new();
    folder.write("large.ply", ply(&larger(&body())));
    folder.ifg("wardrobe add w --body slim --mesh body.ply").expect(0);
    folder.ifg("wardrobe add w --body large --mesh large.ply").expect(0);
    for k in 0..6 {
        let from = -0.3 + 0.1 * f64::from(k);
        folder.write(
            &format!("belt{k}.ply"),
            ply(&belt(0.97 + 0.01 * f64::from(k % 3), from, from + 0.3)),
        );
        folder.ifg(&format!("wardrobe add w --body slim belt{k}.ply")).expect(0);
    }
    folder
}

/// A wardrobe `w` of two mannequins and their garments.
fn mannequins() -> Folder {
    let folder = Folder::new();
    let params = MannequinParams { resolution: 0.7, overlap: 0.5 };
    let slim = mannequin::body(&params);
    folder.write("slim.ply", ply(&slim));
    folder.write("large.ply", ply(&larger(&slim)));
    folder.ifg("wardrobe add w --body slim --mesh slim.ply").expect(0);
    folder.ifg("wardrobe add w --body large --mesh large.ply").expect(0);
    for kind in Garment::ALL {
        folder.write(&format!("{}.ply", kind.name()), ply(&mannequin::garment(kind, &params)));
        folder.ifg(&format!("wardrobe add w --body slim {}.ply", kind.name())).expect(0);
    }
    folder
}

/// Files of an output folder, but for those that hold seconds.
fn results(folder: &Folder, out: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let root = folder.path(out);
    let timed = |p: &Path| {
        ["timings.json", "report.html", "summary.csv", ".ifg-lock"].iter().any(|n| p.ends_with(n))
    };
    let files = folder
        .files()
        .into_iter()
        .filter(|(p, _)| p.starts_with(&root) && p.is_file() && !timed(p));
    files.map(|(p, bytes)| (p.strip_prefix(&root).unwrap().to_owned(), bytes)).collect()
}

/// Kills a batch again and again at random moments; what it leaves in the end are the bytes of one
/// that ran in peace. Returns how many of the kills struck before the batch was done.
#[cfg(unix)]
fn kill_and_resume(folder: &Folder, batch: &str, kills: usize) -> usize {
    let start = Instant::now();
    folder.ifg(&format!("{batch} --out peace")).expect(0);
    let seconds = start.elapsed().as_secs_f64();
    let mut random = SplitMix64::new(7);
    let mut struck = 0;
    for _ in 0..kills {
        let share = random.unit();
        let mut child = folder
            .command(&format!("{batch} --out killed"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // On average a kill for each part of the work.
        std::thread::sleep(Duration::from_secs_f64(2.0 * share * seconds / kills as f64));
        child.kill().unwrap(); // SIGKILL: nothing can be tidied up
        struck += usize::from(child.wait().unwrap().code().is_none());
        // Whatever stands under a result's name is whole.
        for (path, bytes) in results(folder, "killed") {
            let name = path.to_string_lossy();
            if name.starts_with("results/")
                && !name.contains(".ifg-")
                && name.ends_with("result.json")
            {
                let result: Value = serde_json::from_slice(&bytes).unwrap();
                for output in result["outputs"].as_array().unwrap() {
                    let file = folder
                        .path("killed")
                        .join(&path)
                        .with_file_name(output["file"].as_str().unwrap());
                    assert_eq!(
                        file.metadata().unwrap().len(),
                        output["bytes"].as_u64().unwrap(),
                        "{}",
                        file.display()
                    );
                }
            }
        }
    }
    folder.ifg(&format!("{batch} --out killed")).expect(0);
    assert!(results(folder, "killed") == results(folder, "peace"), "the files differ");
    struck
}

#[cfg(unix)]
#[test]
fn a_killed_batch_goes_on_and_leaves_the_same_bytes() {
    let folder = belts();
    let struck = kill_and_resume(
        &folder,
        "wardrobe batch w --random 24 --any-order --most 3 --no-pictures",
        6,
    );
    assert!(struck > 0, "no kill struck");
}

#[cfg(unix)]
#[test]
#[ignore = "stress"]
fn a_batch_of_mannequins_killed_twenty_times_leaves_the_same_bytes() {
    let folder = mannequins();
    let struck = kill_and_resume(&folder, "wardrobe batch w --random 12 --at-once 2", 20);
    assert!(struck >= 10, "{struck}");
}

#[test]
fn a_batch_in_shards_has_the_bytes_of_one_process() {
    let folder = belts();
    let batch = "wardrobe batch w --random 9 --any-order --most 3 --no-pictures";
    folder.ifg(&format!("{batch} --out whole")).expect(0);
    // At the same time, as on three machines.
    let parts: Vec<_> = (1..=3)
        .map(|k| {
            let mut command = folder.command(&format!("{batch} --out parts --shard {k}/3"));
            command.stdout(Stdio::null()).spawn().unwrap()
        })
        .collect();
    for mut part in parts {
        assert!(part.wait().unwrap().success());
    }
    assert!(folder.path("parts/shards/2-of-3/summary.json").exists());
    // While a part is being written the whole is not collected.
    let lock = folder.path("parts/shards/2-of-3/results/.ifg-lock");
    let lock = std::fs::File::create(lock).unwrap();
    lock.lock().unwrap();
    folder.ifg(&format!("{batch} --out parts")).expect(75);
    drop(lock);
    let run = folder.ifg(&format!("{batch} --out parts")).expect(0);
    assert_eq!(run.stdout.lines().count(), 2, "nothing was done again: {}", run.stdout);
    assert!(!folder.path("parts/shards").exists());
    assert!(results(&folder, "parts") == results(&folder, "whole"), "the files differ");
    // A part of a longer list finds what the whole has; what is damaged there it replaces.
    let longer = batch.replace("--random 9", "--random 10");
    let damaged = results(&folder, "parts")
        .into_iter()
        .map(|(path, _)| folder.path("parts").join(path))
        .find(|path| path.ends_with("result.json"));
    std::fs::write(damaged.unwrap(), "{}").unwrap();
    let shard = folder.ifg(&format!("{longer} --out parts --shard 1/1")).expect(0);
    let lines = shard.stdout.lines().count();
    assert!((3..5).contains(&lines), "two are done, not ten: {}", shard.stdout);
    let rows = std::fs::read_to_string(folder.path("parts/shards/1-of-1/summary.csv")).unwrap();
    for row in rows.lines().skip(1) {
        assert!(row.rsplit(',').nth(1).is_some_and(|seconds| !seconds.is_empty()), "{row}");
    }
    folder.ifg(&format!("{longer} --out parts")).expect(0);
    folder.ifg(&format!("{longer} --out ten")).expect(0);
    assert!(results(&folder, "parts") == results(&folder, "ten"), "the files differ");
}

#[test]
fn a_body_that_is_missing_stops_no_other_outfit() {
    let folder = belts();
    folder.write(
        "list.toml",
        "[[outfit]]\nbody = \"large\"\ngarments = [\"belt0\"]\n\
         [[outfit]]\nbody = \"slim\"\ngarments = [\"belt0\"]\n",
    );
    std::fs::remove_file(folder.path("w/bodies/large/body.ply")).unwrap();
    folder.ifg("wardrobe batch w --list list.toml --no-pictures --out done").expect(2);
    let summary: Value = serde_json::from_slice(&folder.read("done/summary.json")).unwrap();
    assert_eq!((&summary["clean"], &summary["failed"]), (&1.into(), &1.into()), "{summary}");
    let said = summary["entries"][0].to_string();
    assert!(said.contains("the file is missing"), "{said}");
}

#[test]
fn where_a_garment_is_worn_can_be_said_and_a_batch_may_write_no_meshes() {
    let folder = belts();
    let layer = |folder: &Folder| {
        let asset = folder.read("w/garments/belt0/asset.json");
        let asset: serde_json::Value = serde_json::from_slice(&asset).unwrap();
        (asset["layer"]["class"].clone(), asset["layer"]["order"].clone())
    };
    assert_ne!(layer(&folder), ("outer".into(), 3.into()));
    folder.ifg("wardrobe add w --body slim --class outer --order 3 belt0.ply").expect(0);
    assert_eq!(layer(&folder), ("outer".into(), 3.into()));
    let batch = "wardrobe batch w --random 2 --any-order --no-pictures";
    folder.ifg(&format!("{batch} --seed 5 --no-meshes --out five")).expect(0);
    folder.ifg(&format!("{batch} --seed 5 --no-meshes --out again")).expect(0);
    folder.ifg(&format!("{batch} --seed 5 --out whole")).expect(0);
    folder.ifg(&format!("{batch} --seed 6 --no-meshes --out six")).expect(0);
    folder.write("list.json", "\u{feff}{\"outfit\": []}");
    for option in ["--body slim", "--seed 7", "--least 9", "--any-order"] {
        let refused =
            folder.ifg(&format!("wardrobe batch w --list list.json {option} --out no")).expect(2);
        assert!(
            refused.stderr.contains("'--list <FILE>' cannot be used with"),
            "{}",
            refused.stderr
        );
    }
    let names = |out: &str, end: &str| {
        let files = results(&folder, out).into_iter().map(|(path, _)| path);
        let mut names: Vec<_> =
            files.filter(|path| path.to_string_lossy().ends_with(end)).collect();
        names.sort();
        names
    };
    assert!(names("five", ".ply").is_empty() && !names("whole", ".ply").is_empty());
    assert_eq!(results(&folder, "five"), results(&folder, "again"), "the same are drawn");
    assert_ne!(names("five", "result.json"), names("six", "result.json"));
}

#[test]
fn what_a_garment_is_strained_by_to_fit_another_body_is_printed_and_listed() {
    let folder = belts();
    let huge = body();
    let twice = huge.vertices().iter().map(|p| Point::new(p.x * 1.8, p.y * 1.2, p.z * 1.8));
    folder.write("huge.ply", ply(&huge.with_vertices(twice.collect()).unwrap()));
    folder.ifg("wardrobe add w --body huge --mesh huge.ply").expect(0);
    let run = folder.ifg("wardrobe match w --body huge belt0 --no-pictures --out look").expect(0);
    assert!(run.stdout.contains(" % rms, ") && run.stdout.contains(" % p99, "), "{}", run.stdout);
    let note = "`belt0`: to fit `huge`, one edge in a hundred was strained by ";
    assert!(run.stderr.contains(note), "{}", run.stderr);
    let files = results(&folder, "look");
    assert!(files.iter().all(|(path, _)| path.extension().is_none_or(|end| end != "png")));
    // A body that is a tenth larger is no other size.
    let run = folder.ifg("wardrobe match w --body large belt0 --no-pictures --out fits").expect(0);
    assert!(!run.stderr.contains("one edge in a hundred"), "{}", run.stderr);
    folder.write(
        "list.toml",
        "[[outfit]]\nbody = \"huge\"\ngarments = [\"belt0\"]\n\
         [[outfit]]\nbody = \"slim\"\ngarments = [\"belt0\"]\n",
    );
    folder.ifg("wardrobe batch w --list list.toml --no-pictures --no-meshes --out done").expect(0);
    let summary: Value = serde_json::from_slice(&folder.read("done/summary.json")).unwrap();
    let strain = |k: usize| summary["entries"][k]["alignment_strain"].as_f64().unwrap();
    assert!(strain(0) > 0.5 && strain(1) < 0.01, "{summary}");
    let rows = String::from_utf8(folder.read("done/summary.csv")).unwrap();
    let column = |row: &str| row.split(',').nth(10).unwrap().to_owned();
    let mut rows = rows.lines().map(column);
    assert_eq!(rows.next().as_deref(), Some("alignment_strain_p99_percent"));
    let listed: f64 = rows.next().unwrap().parse().unwrap();
    assert!((listed - 1e2 * strain(0)).abs() < 0.01, "{listed}");
}

#[test]
fn a_garment_that_meets_itself_fails_with_strict_and_is_listed() {
    let folder = belts();
    folder.write("flap.ply", ply(&flap()));
    folder.ifg("wardrobe add w --body slim flap.ply").expect(0);
    let run = "wardrobe match w --body slim flap --set own=keep --no-pictures --out look";
    folder.ifg(run).expect(0);
    let strict = folder.ifg(&format!("{run} --strict")).expect(1);
    assert!(strict.stderr.contains("own pairs of `flap`:"), "{}", strict.stderr);
    folder.write(
        "list.toml",
        "[[outfit]]\nbody = \"slim\"\ngarments = [\"belt0\"]\n\
         [[outfit]]\nbody = \"slim\"\ngarments = [\"flap\"]\n",
    );
    let batch = "wardrobe batch w --list list.toml --set own=keep --no-pictures --out done";
    let run = folder.ifg(batch).expect(0);
    assert!(run.stdout.contains("2 clean (100.0 %), 1 of them everywhere"), "{}", run.stdout);
    folder.ifg(&format!("{batch} --strict")).expect(1);
    let summary: Value = serde_json::from_slice(&folder.read("done/summary.json")).unwrap();
    let entry = |k: usize| &summary["entries"][k];
    assert_eq!((&entry(0)["everywhere"], &entry(1)["everywhere"]), (&true.into(), &false.into()));
    let own = entry(1)["own_pairs"].as_array().unwrap();
    assert!(own[0].as_u64().unwrap() > 0 && own[0] == own[1], "{own:?}");
    let rows = String::from_utf8(folder.read("done/summary.csv")).unwrap();
    assert!(rows.starts_with("combination,") && rows.contains(",own_pairs_after,everywhere,"));
}

#[test]
fn a_wardrobe_is_filled_listed_and_matched() {
    let folder = belts();
    let list = folder.ifg("wardrobe list w --json").expect(0).json();
    assert_eq!(list["garments"].as_object().unwrap().len(), 6);
    assert_eq!(list["bodies"].as_object().unwrap().keys().collect::<Vec<_>>(), ["large", "slim"]);
    assert!(folder.ifg("wardrobe list w").expect(0).stdout.contains("belt3"));
    let run = folder.ifg("wardrobe match w --body large belt0 belt1 --out look").expect(0);
    assert!(run.stdout.contains("Topology") && run.stdout.contains("look"), "{}", run.stdout);
    for name in [
        "belt0.ply",
        "belt1.ply",
        "large.ply",
        "before.png",
        "after.png",
        "result.json",
        "report.html",
    ] {
        assert!(folder.path("look").join(name).exists(), "{name}");
    }
    let page = String::from_utf8(folder.read("look/report.html")).unwrap();
    assert!(
        page.contains("data:image/png;base64,") && !page.contains("http"),
        "one file, no network"
    );
    // The garments as they were written, checked as any others.
    folder.ifg("check --body look/large.ply look/belt0.ply look/belt1.ply").expect(0);
    assert!(
        folder
            .ifg("wardrobe match w --body large belt0 belt1 --out look")
            .expect(0)
            .stdout
            .contains("was there already")
    );
    // Another combination takes its place, and what is not of the first one stays.
    folder.write("look/notes.txt", "mine");
    std::fs::create_dir(folder.path("look/sub")).unwrap();
    folder.write("look/sub/notes.txt", "mine too");
    folder.ifg("wardrobe match w --body slim belt2 --out look").expect(0);
    assert!(!folder.path("look/belt0.ply").exists() && folder.path("look/slim.ply").exists());
    assert_eq!(
        (folder.read("look/notes.txt"), folder.read("look/sub/notes.txt")),
        (b"mine".into(), b"mine too".into())
    );
    // A file of the user's is not replaced.
    folder.write("look/belt1.ply", "mine");
    let before = folder.files();
    let refused = folder.ifg("wardrobe match w --body slim belt1 --out look").expect(2).stderr;
    assert!(refused.contains("belt1.ply` is in the way") && folder.files() == before, "{refused}");
    #[cfg(unix)]
    assert!(
        folder.files().iter().all(|(path, _)| !path.ends_with(".ifg-lock")),
        "locks are removed"
    );
}

#[test]
fn a_result_is_not_replaced_by_a_worse_one() {
    let folder = belts();
    folder.ifg("wardrobe match w --body slim belt0 --out look").expect(0);
    let before = folder.files();
    let run = folder.ifg("wardrobe match w --body slim belt0 belt0 --out look").expect(2);
    assert!(run.stderr.contains("`belt0` occurs twice"), "{}", run.stderr);
    const TOO_FEW: &str = "--set rounds=1 --set settle_rounds=1 --set ease_rounds=0";
    let run = folder
        .ifg(&format!("wardrobe match w --body slim belt0 belt1 --out look {TOO_FEW}"))
        .expect(1);
    assert!(
        run.stderr.contains("`look` holds a better result")
            && run.stdout.contains("Nothing written"),
        "{}",
        run.stderr
    );
    assert!(folder.files() == before);
    // Where nothing better stands the report is written; asked for, the meshes are, too.
    folder.ifg(&format!("wardrobe match w --body slim belt0 belt1 --out left {TOO_FEW}")).expect(1);
    assert!(folder.path("left/report.html").exists() && !folder.path("left/belt0.ply").exists());
    folder
        .ifg(&format!(
            "wardrobe match w --body slim belt0 belt1 --out look {TOO_FEW} --write-unproven"
        ))
        .expect(1);
    assert!(folder.path("look/belt1.ply").exists());
}

#[test]
fn matches_beside_one_another_run_at_once_and_leave_no_locks() {
    let folder = belts();
    let start = |out: &str| {
        let args = format!("wardrobe match w --body large belt0 belt1 belt2 --out par/{out}");
        folder.command(&args).stdout(Stdio::null()).spawn().unwrap()
    };
    for mut child in ["a", "b", "c"].map(start) {
        assert!(child.wait().unwrap().success());
    }
    let mut names: Vec<_> =
        std::fs::read_dir(folder.path("par")).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["a", "b", "c"]);
    #[cfg(unix)]
    assert!(folder.files().iter().all(|(path, _)| !path.ends_with(".ifg-lock")));
}

#[test]
fn what_was_being_replaced_at_a_kill_is_there_again() {
    let folder = belts();
    let before = folder.files();
    let rename =
        |from: &str, to: &str| std::fs::rename(folder.path(from), folder.path(to)).unwrap();
    rename("w/garments/belt0", "w/garments/.ifg-old-belt0");
    std::fs::create_dir(folder.path("w/garments/.ifg-whole-x")).unwrap();
    rename("w/bodies/slim", "w/bodies/.ifg-old-slim");
    let list = folder.ifg("wardrobe list w --json").expect(0).json();
    assert!(list["garments"]["belt0"].is_object() && list["bodies"]["slim"].is_object(), "{list}");
    assert!(folder.files() == before);
}

#[test]
fn a_stray_folder_does_not_stop_the_others() {
    let folder = belts();
    std::fs::create_dir(folder.path("w/bodies/junk")).unwrap();
    let run = folder.ifg("wardrobe match w --body slim belt0 --out look").expect(0);
    assert!(run.stderr.contains("body `junk` is left out"), "{}", run.stderr);
    let list = folder.ifg("wardrobe list w --json").expect(2).json();
    assert_eq!(
        (&list["faults"][0]["part"], &list["faults"][0]["name"]),
        (&"body".into(), &"junk".into())
    );
    let stderr = folder.ifg("wardrobe match w --body junk belt0 --out other").expect(2).stderr;
    assert!(stderr.contains("body.json"), "{stderr}");
    // A body that is added anew is mended, and the garments of one that is gone are marked.
    folder.ifg("wardrobe add w --body junk --mesh large.ply").expect(0);
    folder.ifg("wardrobe list w").expect(0);
    std::fs::remove_dir_all(folder.path("w/bodies/slim")).unwrap();
    assert!(folder.ifg("wardrobe list w").expect(0).stdout.contains("slim (not there)"));
    assert_eq!(
        folder.ifg("wardrobe list w --json").expect(0).json()["without_body"]
            .as_array()
            .unwrap()
            .len(),
        6
    );
}

#[test]
fn what_a_file_holds_beside_its_mesh_goes_through_a_wardrobe() {
    let folder = belts();
    let mesh = belt(0.97, -0.2, 0.1);
    let (n, m) = (mesh.vertices().len(), mesh.triangles().len());
    let texcoord = Property {
        name: "texcoord".into(),
        values: Column::F32((0..6 * m).map(|k| k as f32 / 64.0).collect()),
        lists: Some((0..=m as u32).map(|k| 6 * k).collect()),
    };
    let up = |k: usize| Column::F32(vec![[0.0, 0.0, 1.0][k]; n]);
    let file = PlyMesh {
        vertex_properties: vec![
            Property::new("red", Column::U8((0..n).map(|k| (k % 256) as u8).collect())),
            Property::new("nx", up(0)),
            Property::new("ny", up(1)),
            Property::new("nz", up(2)),
        ],
        face_properties: vec![
            texcoord,
            Property::new("texnumber", Column::I32((0..m as i32).collect())),
        ],
        comments: vec!["TextureFile wool.png".into(), "CC0".into()],
        ..PlyMesh::new(mesh.clone())
    };
    write_path(&file, mesh.vertices(), &WriteParams::default(), &folder.path("wool.ply")).unwrap();
    // The same of three flat sides from another program.
    let coarse = angular_belt(1.2, 0.2, 0.3);
    let count = coarse.vertices().len();
    let vertices: String =
        coarse.vertices().iter().map(|p| format!("v {} {} {} 1 0.2 0\n", p.x, p.y, p.z)).collect();
    let texture: String = (0..count).map(|k| format!("vt {k} 0.5\n")).collect();
    let corner = |v: u32| format!("{0}/{0}", v + 1);
    let faces = coarse.triangles().iter().map(|t| format!("f {}\n", t.map(corner).join(" ")));
    let faces: String = faces.collect();
    let text = format!("mtllib felt.mtl\n{vertices}{texture}g a\nusemtl felt\n{faces}g b\n");
    folder.write("felt.obj", text);
    let told = folder.ifg("wardrobe add w --body slim wool.ply felt.obj").expect(0).stdout;
    assert!(
        told.contains("felt.mtl") && told.contains("groups and objects are not kept: a, b"),
        "{told}"
    );

    folder
        .ifg("wardrobe match w --body slim felt wool --out look --set split=if_strained")
        .expect(0);
    let read = |name: &str| read_bytes(&folder.read(name)).unwrap();
    let wool = read("look/wool.ply");
    assert_ne!(wool.mesh.vertices(), mesh.vertices());
    assert_eq!(
        (&wool.face_properties, wool.vertex_property("red")),
        (&file.face_properties, file.vertex_property("red"))
    );
    assert_eq!(wool.comments, file.comments);
    let Column::F32(nz) = &wool.vertex_property("nz").unwrap().values else {
        panic!("another type")
    };
    assert!(nz.iter().any(|z| *z != 1.0), "normals turn with the surface");
    let felt = read("look/felt.ply");
    assert_eq!(felt.comments, ["material 0 felt", "mtllib felt.mtl"]);
    let [texcoord, material] = &felt.face_properties[..] else {
        panic!("{:?}", felt.face_properties)
    };
    assert_eq!(
        (texcoord.values.len(), material.values.len()),
        (6 * felt.mesh.triangles().len(), felt.mesh.triangles().len())
    );
    let Column::U8(green) = &felt.vertex_property("green").unwrap().values else {
        panic!("another type")
    };
    assert!(green.iter().all(|g| *g == 51) && green.len() == felt.mesh.vertices().len());
    assert!(felt.mesh.vertices().len() > count, "it was split");
    // In a batch, too; and the body is the user's file.
    folder.write("list.toml", "[[outfit]]\nbody='slim'\ngarments=['wool']\n");
    folder.ifg("wardrobe batch w --list list.toml --out listed --no-pictures").expect(0);
    let summary: Value = serde_json::from_slice(&folder.read("listed/summary.json")).unwrap();
    let path =
        format!("listed/results/{}/wool.ply", summary["entries"][0]["folder"].as_str().unwrap());
    assert_eq!(read(&path).face_properties, file.face_properties);
    assert_eq!(folder.read("look/slim.ply"), folder.read("body.ply"));
}

#[test]
fn a_body_may_be_an_obj_file() {
    let folder = Folder::new();
    folder.write("body.obj", obj(&body()));
    folder
        .ifg("wardrobe add w --body anna --mesh body.obj --template body.obj skirt.ply")
        .expect(0);
    folder.ifg("wardrobe match w --body anna skirt --out look").expect(0);
    let anna = read_bytes(&folder.read("look/anna.ply")).unwrap().mesh;
    assert_eq!(anna, body(), "without loss");
    folder.ifg("check --body look/anna.ply look/skirt.ply").expect(0);
}

#[test]
fn inputs_are_not_replaced() {
    let folder = Folder::new();
    for (part, name) in [("garments", "skirt.ply"), ("bodies", "body.ply")] {
        let stem = name.strip_suffix(".ply").unwrap();
        std::fs::create_dir_all(folder.path(&format!("w/{part}/{stem}"))).unwrap();
        folder.write(&format!("w/{part}/{stem}/scan.ply"), folder.read(name));
    }
    let body = "wardrobe add w --body body --mesh w/bodies/body/scan.ply";
    let run = folder.ifg(body).expect(2);
    assert!(run.stderr.contains("w/bodies/body") && run.stderr.contains("in it"), "{}", run.stderr);
    folder.ifg("wardrobe add w --body anna --mesh body.ply").expect(0);
    let run = folder.ifg("wardrobe add w --body anna skirt.ply").expect(2);
    assert!(run.stderr.contains("would be replaced"), "{}", run.stderr);
    assert!(!folder.read("w/garments/skirt/scan.ply").is_empty());
    // What a wardrobe has itself gets its name again.
    folder.ifg("wardrobe add w --body anna --mesh w/bodies/anna/body.ply").expect(0);
}

#[test]
fn files_may_be_in_centimetres() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("cm")).unwrap();
    folder.write("cm/body.ply", ply(&body().scaled(100.0).unwrap()));
    folder.write(
        "cm/skirt.obj",
        obj(&read_bytes(&folder.read("skirt.ply")).unwrap().mesh.scaled(100.0).unwrap()),
    );
    let run = folder.ifg("wardrobe add w --body anna --mesh cm/body.ply cm/skirt.obj").expect(2);
    assert!(
        run.stderr.contains("if the files are in centimetres, add --scale 0.01"),
        "{}",
        run.stderr
    );
    folder.ifg("wardrobe add w --body anna --mesh cm/body.ply cm/skirt.obj --scale 0.01").expect(0);
    folder.ifg("wardrobe match w --body anna skirt --out look").expect(0);
    folder.ifg("check --body body.ply look/skirt.ply").expect(0);
    let info: Value = serde_json::from_slice(&folder.read("w/garments/skirt/asset.json")).unwrap();
    assert!(info["provenance"]["tool"].as_str().unwrap().ends_with("--scale 0.01"));
    // Forgotten for the garment alone, or for a body that is in metres.
    let run = folder.ifg("wardrobe add w --body anna cm/skirt.obj").expect(2);
    assert!(
        run.stderr.contains("times the body") && run.stderr.contains("--scale"),
        "{}",
        run.stderr
    );
    let run = folder.ifg("wardrobe add w --body anna skirt.ply --scale 0").expect(2);
    assert!(run.stderr.contains("positive"), "{}", run.stderr);
}

#[test]
fn faults_say_what_to_do() {
    let folder = belts();
    let stderr = |args: &str| folder.ifg(args).expect(2).stderr;
    assert!(stderr("wardrobe match w --body large hat --out look").contains("belt0, belt1"));
    assert!(stderr("wardrobe match w --body nobody belt0 --out look").contains("large, slim"));
    assert!(stderr("wardrobe add w --body nobody belt0.ply").contains("nobody"));
    assert!(stderr("wardrobe add w --body slim gone.ply").contains("gone.ply"));
    folder.write(
        "far.ply",
        ply(&crate::folder::moved(&belt(1.0, 0.0, 0.1), |p| Point::new(p.x + 9.0, p.y, p.z))),
    );
    assert!(stderr("wardrobe add w --body slim far.ply").contains("from the body"));
    assert!(!folder.path("w/garments/far").exists());
    let open = stderr("wardrobe add w --body open --mesh belt0.ply");
    assert!(
        open.contains("no inside") && open.contains("belt0.ply") && !open.contains("combination"),
        "{open}"
    );
    for command in
        ["list gone", "match gone --body slim belt0 --out look", "batch gone --random 2 --out many"]
    {
        assert!(
            stderr(&format!("wardrobe {command}")).contains("`gone` is not a wardrobe"),
            "{command}"
        );
    }
    assert!(
        !folder.path("gone").exists()
            && !folder.path("look").exists()
            && !folder.path("many").exists()
    );
    assert!(stderr("wardrobe batch w --out many").contains("<--list <FILE>|--random <N>>"));
    assert!(stderr("wardrobe batch w --random 5000 --out many").contains("different combinations"));
    folder.write("list.toml", "[[outfit]]\nbody = 'slim'\ngarment = ['belt0']\n");
    assert!(stderr("wardrobe batch w --list list.toml --out listed").contains("list.toml"));
    // One failing combination is recorded, and the others are done.
    folder.write(
        "list.toml",
        "[[outfit]]\nbody='slim'\ngarments=['hat']\n[[outfit]]\nbody='slim'\ngarments=['belt0']\n",
    );
    let run = folder.ifg("wardrobe batch w --list list.toml --out listed --no-pictures").expect(2);
    assert!(
        run.stdout.contains("1 clean (50.0 %)") && run.stdout.contains("no garment `hat`"),
        "{}",
        run.stdout
    );
    let summary: Value = serde_json::from_slice(&folder.read("listed/summary.json")).unwrap();
    assert_eq!(summary["entries"][0]["error"]["kind"], "no_garment");
    // Names that would break the tables.
    folder.write("list.toml", "[[outfit]]\nbody='slim'\ngarments=['belt0']\n[[outfit]]\nbody='slim'\ngarments=[\"a,b\\nc\"]\n");
    let refused = stderr("wardrobe batch w --list list.toml --out named");
    assert!(
        refused.contains("outfit 2")
            && refused.contains("is not a valid name")
            && !folder.path("named").exists(),
        "{refused}"
    );
    // A file where a folder should be, and a folder of the user's.
    assert!(
        stderr("wardrobe match w --body slim belt0 --out belt1.ply")
            .contains("it is a file, not a folder")
    );
    std::fs::create_dir(folder.path("mine")).unwrap();
    folder.write("mine/note.txt", "keep");
    assert!(stderr("wardrobe match w --body slim belt0 --out mine").contains("in the way"));
    assert_eq!(folder.read("mine/note.txt"), b"keep");
}

#[test]
#[ignore = "stress"]
fn the_field_of_the_clothed_body_is_baked_where_that_is_asked_for() {
    let folder = Folder::new();
    folder.ifg("wardrobe add w --body slim --mesh body.ply --bake skirt.ply").expect(0);
    folder.ifg("wardrobe add w --body slim hoop.ply").expect(0);
    let baked = |name: &str| {
        let info: Value =
            serde_json::from_slice(&folder.read(&format!("w/garments/{name}/asset.json"))).unwrap();
        info["phi"]["baked"]["file"].clone()
    };
    assert_eq!((baked("skirt"), baked("hoop")), ("phi.baked".into(), Value::Null));
    assert!(!folder.read("w/garments/skirt/phi.baked").is_empty());
}

#[cfg(unix)]
#[test]
fn a_bake_that_takes_minutes_can_be_cancelled() {
    let folder = Folder::new();
    let scene = MannequinParams::default();
    folder.write("person.ply", ply(&mannequin::body(&scene)));
    folder.write("tshirt.ply", ply(&mannequin::garment(Garment::Tshirt, &scene)));
    folder.ifg("wardrobe add w --body person --mesh person.ply").expect(0);
    folder.interrupt("wardrobe add w --body person --bake tshirt.ply", "w/bodies/person");
}

#[cfg(target_os = "linux")]
#[test]
fn a_line_that_cannot_be_printed_is_told_and_is_no_cancellation() {
    let folder = belts();
    for (random, json) in [(2, ""), (1, "--json")] {
        let args = format!(
            "wardrobe batch w --random {random} --any-order --most 2 --no-pictures --out many {json}"
        );
        let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let run = Run::from(folder.command(&args).stdout(full).output().unwrap()).expect(2);
        assert!(
            run.stderr.contains("No space left") && !run.stderr.contains("cancelled"),
            "{}",
            run.stderr
        );
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_is_heard_to_the_end_of_the_last_garment() {
    let folder = Folder::new();
    folder.ifg("wardrobe add w --body slim --mesh body.ply").expect(0);
    let added = folder.path("w/garments/skirt/asset.json");
    let ready = || {
        let start = Instant::now();
        while !added.exists() {
            assert!(start.elapsed() < Duration::from_secs(20), "no garment");
            std::thread::sleep(Duration::from_millis(2));
        }
    };
    folder.interrupt_printing("wardrobe add w --body slim skirt.ply", ready).expect(130);
}
