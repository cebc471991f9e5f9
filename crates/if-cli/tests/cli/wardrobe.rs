//! A wardrobe from the command line; batches that are killed and go on.

use crate::folder::{Folder, belt, body, ply};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_pipeline::mannequin::{self, Garment, MannequinParams};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

/// The mesh, a little larger.
fn larger(mesh: &TriMesh) -> TriMesh {
    mesh.with_vertices(mesh.vertices().iter().map(|p| Point::new(p.x * 1.1, p.y * 1.02, p.z * 1.1)).collect()).unwrap()
}

/// A wardrobe `w` of two bodies and six belts made on the first.
fn belts() -> Folder {
    let folder = Folder::new();
    folder.write("large.ply", ply(&larger(&body())));
    folder.ifg("wardrobe add w --body slim --mesh body.ply").expect(0);
    folder.ifg("wardrobe add w --body large --mesh large.ply").expect(0);
    for k in 0..6 {
        let from = -0.3 + 0.1 * f64::from(k);
        folder.write(&format!("belt{k}.ply"), ply(&belt(0.97 + 0.01 * f64::from(k % 3), from, from + 0.3)));
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
    let timed = |p: &Path| ["timings.json", "report.html", "summary.csv", ".ifg-lock"].iter().any(|n| p.ends_with(n));
    let files = folder.files().into_iter().filter(|(p, _)| p.starts_with(&root) && p.is_file() && !timed(p));
    files.map(|(p, bytes)| (p.strip_prefix(&root).unwrap().to_owned(), bytes)).collect()
}

/// Kills a batch again and again at random moments; what it leaves in the end are the bytes of one that ran in peace.
/// Returns how many of the kills struck before the batch was done.
#[cfg(unix)]
fn kill_and_resume(folder: &Folder, batch: &str, kills: usize) -> usize {
    let start = Instant::now();
    folder.ifg(&format!("{batch} --out peace")).expect(0);
    let seconds = start.elapsed().as_secs_f64();
    let mut random = 7u64;
    let mut struck = 0;
    for _ in 0..kills {
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let share = (random >> 11) as f64 / (1u64 << 53) as f64;
        let mut child =
            folder.command(&format!("{batch} --out killed")).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        // On average a kill for each part of the work.
        std::thread::sleep(Duration::from_secs_f64(2.0 * share * seconds / kills as f64));
        child.kill().unwrap(); // SIGKILL: nothing can be tidied up
        struck += usize::from(child.wait().unwrap().code().is_none());
        // Whatever stands under a result's name is whole.
        for (path, bytes) in results(folder, "killed") {
            let name = path.to_string_lossy();
            if name.starts_with("results/") && !name.contains(".ifg-") && name.ends_with("result.json") {
                let result: Value = serde_json::from_slice(&bytes).unwrap();
                for output in result["outputs"].as_array().unwrap() {
                    let file = folder.path("killed").join(&path).with_file_name(output["file"].as_str().unwrap());
                    assert_eq!(file.metadata().unwrap().len(), output["bytes"].as_u64().unwrap(), "{}", file.display());
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
    let struck = kill_and_resume(&folder, "wardrobe batch w --random 24 --any-order --most 3 --no-pictures", 6);
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
fn a_wardrobe_is_filled_listed_and_matched() {
    let folder = belts();
    let list = folder.ifg("wardrobe list w --json").expect(0).json();
    assert_eq!(list["garments"].as_object().unwrap().len(), 6);
    assert_eq!(list["bodies"].as_object().unwrap().keys().collect::<Vec<_>>(), ["large", "slim"]);
    assert!(folder.ifg("wardrobe list w").expect(0).stdout.contains("belt3"));
    let run = folder.ifg("wardrobe match w --body large belt0 belt1 --out look").expect(0);
    assert!(run.stdout.contains("Topology") && run.stdout.contains("look"), "{}", run.stdout);
    for name in ["belt0.ply", "belt1.ply", "large.ply", "before.png", "after.png", "result.json", "report.html"] {
        assert!(folder.path("look").join(name).exists(), "{name}");
    }
    let page = String::from_utf8(folder.read("look/report.html")).unwrap();
    assert!(page.contains("data:image/png;base64,") && !page.contains("http"), "one file, no network");
    // The garments as they were written, checked as any others.
    folder.ifg("check --body look/large.ply look/belt0.ply look/belt1.ply").expect(0);
    assert!(folder.ifg("wardrobe match w --body large belt0 belt1 --out look").expect(0).stdout.contains("was there already"));
    // Another combination takes its place.
    folder.ifg("wardrobe match w --body slim belt2 --out look").expect(0);
    assert!(!folder.path("look/belt0.ply").exists());
}

#[test]
fn faults_say_what_to_do() {
    let folder = belts();
    let stderr = |args: &str| folder.ifg(args).expect(2).stderr;
    assert!(stderr("wardrobe match w --body large hat --out look").contains("belt0, belt1"));
    assert!(stderr("wardrobe match w --body nobody belt0 --out look").contains("large, slim"));
    assert!(stderr("wardrobe add w --body nobody belt0.ply").contains("nobody"));
    assert!(stderr("wardrobe add w --body slim gone.ply").contains("gone.ply"));
    assert!(stderr("wardrobe add w --body open --mesh belt0.ply").contains("boundary edges"));
    assert!(stderr("wardrobe batch w --random 5000 --out many").contains("different combinations"));
    folder.write("list.toml", "[[outfit]]\nbody = 'slim'\ngarment = ['belt0']\n");
    assert!(stderr("wardrobe batch w --list list.toml --out listed").contains("list.toml"));
    // One failing combination is recorded, and the others are done.
    folder.write("list.toml", "[[outfit]]\nbody='slim'\ngarments=['hat']\n[[outfit]]\nbody='slim'\ngarments=['belt0']\n");
    let run = folder.ifg("wardrobe batch w --list list.toml --out listed --no-pictures").expect(2);
    assert!(run.stdout.contains("1 clean (50.0 %)") && run.stdout.contains("no garment `hat`"), "{}", run.stdout);
    let summary: Value = serde_json::from_slice(&folder.read("listed/summary.json")).unwrap();
    assert_eq!(summary["entries"][0]["error"]["kind"], "no_garment");
    // A folder of the user's is not replaced.
    std::fs::create_dir(folder.path("mine")).unwrap();
    folder.write("mine/note.txt", "keep");
    assert!(stderr("wardrobe match w --body slim belt0 --out mine").contains("in the way"));
    assert_eq!(folder.read("mine/note.txt"), b"keep");
}
