//! `ifg fit`: what it writes, says and refuses.

use crate::folder::{Folder, body, ply};
#[cfg(unix)]
use crate::folder::{Run, moved};
use if_core::field::SignedDistance;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_neural::field::NeuralField;
use if_neural::files::read_network;
use if_neural::network::Network;
#[cfg(unix)]
use std::process::Stdio;

#[test]
fn a_fitted_body_is_a_field_and_the_same_bytes_on_any_number_of_threads() {
    let folder = Folder::new();
    let run = folder.ifg("fit body.ply --out body.safetensors --steps 6 --threads 1").expect(0);
    for word in
        ["fitted to its field", "mean mm", "p99 mm", "6 steps, all done", "Wrote body.safetensors"]
    {
        assert!(run.stdout.contains(word), "{word}\n{}", run.stdout);
    }
    let file = folder.read("body.safetensors");
    let (network, frame) = read_network(file.as_slice()).unwrap();
    let field = NeuralField::new(network, frame).unwrap();
    // The drawn-out ball reaches 0.9 m up; its sides are 0.15 m and 0.1 m from the middle.
    for (p, inside) in [
        ([0.0, 0.0, 0.0], true),
        ([0.0, 0.85, 0.0], true),
        ([0.0, 0.95, 0.0], false),
        ([0.12, 0.0, 0.08], false),
    ] {
        assert_eq!(field.distance(&Point::from(p)) < 0.0, inside, "{p:?}");
    }
    let json = folder
        .ifg("fit body.ply --out again.safetensors --steps 6 --threads 3 --json")
        .expect(0)
        .json();
    assert_eq!((&json["state"], &json["report"]["steps"]), (&"steps".into(), &6.into()));
    assert!(json["report"]["error"]["mean"].as_f64().unwrap() < 1e-3);
    assert!(folder.read("again.safetensors") == file);
}

#[test]
fn what_is_not_kept_of_a_fit_is_told() {
    let folder = Folder::new();
    let run = folder.ifg("fit body.ply --out none.safetensors --steps 0").expect(0);
    assert!(run.stdout.contains("0 steps, all done, "), "{}", run.stdout);
    let run = folder.ifg("fit body.ply --out one.safetensors --steps 1").expect(0);
    assert!(run.stdout.contains("1 steps, all done, none of them kept"), "{}", run.stdout);
    assert!(folder.read("one.safetensors") == folder.read("none.safetensors"));
}

#[test]
#[ignore = "stress"]
fn an_accuracy_ends_the_fit_or_the_exit_code_says_that_it_was_not_reached() {
    let folder = Folder::new();
    let run = folder.ifg("fit body.ply --out a.safetensors --accuracy 5mm --steps 500").expect(0);
    assert!(run.stdout.contains("accuracy reached"), "{}", run.stdout);
    let run =
        folder.ifg("fit body.ply --out b.safetensors --accuracy 0.0001mm --steps 2").expect(1);
    assert!(
        run.stderr.contains("not reached") && folder.path("b.safetensors").exists(),
        "{}",
        run.stderr
    );
}

/// From a sphere: the first values of the grid are the body's own.
#[test]
fn steps_bring_the_network_nearer() {
    let folder = Folder::new();
    let mean = |steps: u32| {
        let args =
            format!("fit body.ply --out n.safetensors --network fast --steps {steps} --json");
        let json = folder.ifg(&args).expect(0).json();
        let (network, _) = read_network(&folder.read("n.safetensors")[..]).unwrap();
        assert!(matches!(network, Network::Sdf(_)));
        json["report"]["error"]["mean"].as_f64().unwrap()
    };
    let (first, later) = (mean(0), mean(30));
    assert!(later < 0.9 * first, "{first} -> {later}");
}

#[test]
#[ignore = "stress"]
fn an_open_mesh_is_fitted_by_its_vertices() {
    let folder = Folder::new();
    let closed = body();
    let open = TriMesh::new(closed.vertices().to_vec(), closed.triangles()[3..].to_vec()).unwrap();
    folder.write("open.ply", ply(&open));
    let run = folder.ifg("fit open.ply --out new/folder/open.safetensors --steps 2").expect(0);
    assert!(folder.path("new/folder/open.safetensors").exists());
    assert!(run.stdout.contains("vertices as points"), "{}", run.stdout);
}

#[test]
fn what_cannot_be_fitted_is_refused_and_nothing_is_written() {
    let folder = Folder::new();
    let closed = body();
    let turned: Vec<[u32; 3]> = closed.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    folder.write("turned.ply", ply(&TriMesh::new(closed.vertices().to_vec(), turned).unwrap()));
    folder.write("empty.ply", ply(&TriMesh::default()));
    let before = folder.files();
    for (args, words) in [
        ("fit turned.ply --out x.safetensors", ["turned.ply", "outside"]),
        ("fit empty.ply --out x.safetensors", ["empty.ply", "triangles"]),
        ("fit none.ply --out x.safetensors", ["none.ply", "path"]),
        // Before a fit of minutes, not after it.
        (
            "fit body.ply --out skirt.ply/x.safetensors --seconds 300",
            ["skirt.ply", "a part of the path is a file"],
        ),
        ("fit body.ply --out body.ply --seconds 300", ["body.ply", ".safetensors"]),
        ("fit body.ply --out skirt.ply --seconds 300", ["skirt.ply", ".safetensors"]),
        ("fit body.ply --out x.safetensors --seconds 0", ["--seconds", "positive"]),
        ("fit body.ply --out x.safetensors --accuracy 0mm", ["--accuracy", "above zero"]),
    ] {
        let run = folder.ifg(args).expect(2);
        for word in words {
            assert!(run.stderr.contains(word), "`{word}` is missing:\n{}", run.stderr);
        }
    }
    assert!(folder.files() == before, "files changed");
}

#[cfg(unix)]
#[test]
#[ignore = "stress"]
fn a_cancelled_fit_goes_on_from_its_checkpoint_to_the_same_bytes() {
    let folder = Folder::new();
    folder.ifg("fit body.ply --out whole.safetensors --steps 6").expect(0);
    let args = "fit body.ply --out part.safetensors --steps 6 --checkpoint state/c.safetensors";
    let run = interrupted(&folder, args, || ()).expect(130);
    assert!(run.stderr.contains("--resume state/c.safetensors goes on with it"), "{}", run.stderr);
    assert!(folder.path("part.safetensors").exists());
    let json = folder
        .ifg("fit body.ply --out part.safetensors --resume state/c.safetensors --threads 1 --json")
        .expect(0)
        .json();
    assert_eq!((&json["state"], &json["report"]["steps"]), (&"steps".into(), &6.into()));
    assert!(folder.read("part.safetensors") == folder.read("whole.safetensors"), "other bytes");
    // In the same box, thinner at the upper end.
    let thinner = moved(&body(), |p| {
        if (0.5..0.8).contains(&p.y) { Point::new(0.8 * p.x, p.y, 0.8 * p.z) } else { *p }
    });
    folder.write("thinner.ply", ply(&thinner));
    let before = folder.files();
    let run =
        folder.ifg("fit thinner.ply --out x.safetensors --resume state/c.safetensors").expect(2);
    assert!(run.stderr.contains("something else than `thinner.ply`"), "{}", run.stderr);
    for (args, words) in [
        ("--out x.safetensors --resume state/c.safetensors --steps 9", "cannot be used with"),
        ("--out x.safetensors --resume whole.safetensors", "that --checkpoint wrote"),
        (
            "--out x.safetensors --resume state/c.safetensors --scale 2",
            "something else than `body.ply`",
        ),
        (
            "--out x.safetensors --resume state/c.safetensors --points",
            "something else than `body.ply`",
        ),
        ("--out state/c.safetensors --resume state/c.safetensors", "is the input file"),
        ("--out x.safetensors --checkpoint ./x.safetensors", "are both"),
        ("--out x.safetensors --checkpoint whole.safetensors", "it is not a checkpoint"),
    ] {
        let run = folder.ifg(&format!("fit body.ply {args}")).expect(2);
        assert!(run.stderr.contains(words), "{args}\n{}", run.stderr);
    }
    assert!(folder.files() == before, "files changed");
}

/// Starts a fit, and interrupts it during its first steps, after `meanwhile`.
#[cfg(unix)]
fn interrupted(folder: &Folder, args: &str, meanwhile: impl FnOnce()) -> Run {
    use std::io::{BufRead, BufReader, Read};
    let mut child = folder
        .command(&format!("{args} --verbose"))
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut told = BufReader::new(child.stderr.take().unwrap());
    let mut stderr = String::new();
    while !stderr.contains("fitting begins") {
        assert!(told.read_line(&mut stderr).unwrap() > 0, "it ended: {stderr}");
    }
    meanwhile();
    crate::folder::cancel(child.id());
    told.read_to_string(&mut stderr).unwrap();
    Run { code: child.wait().unwrap().code(), stdout: String::new(), stderr }
}

#[cfg(unix)]
#[test]
#[ignore = "stress"]
fn where_the_checkpoint_cannot_be_written_the_network_is() {
    let folder = Folder::new();
    let in_the_way = || std::fs::create_dir(folder.path("state/c.safetensors")).unwrap();
    let args =
        "fit body.ply --out part.safetensors --steps 100000 --checkpoint state/c.safetensors";
    let run = interrupted(&folder, args, in_the_way).expect(2);
    for words in ["cannot write `state/c.safetensors`", "nothing goes on from here"] {
        assert!(run.stderr.contains(words), "{words}\n{}", run.stderr);
    }
    read_network(&folder.read("part.safetensors")[..]).unwrap();
}

#[cfg(unix)]
#[test]
#[ignore = "stress"]
fn ctrl_c_before_the_first_step_leaves_the_network_that_stands_there() {
    use std::thread::sleep;
    use std::time::Duration;
    let folder = Folder::new();
    folder.write("good.safetensors", "good");
    let mut child = folder
        .command("fit body.ply --out good.safetensors --steps 100000")
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    // While it reads.
    while !folder.path(".ifg-partial-good.safetensors").exists() {
        assert!(child.try_wait().unwrap().is_none(), "it ended");
        sleep(Duration::from_millis(1));
    }
    crate::folder::cancel(child.id());
    let run = Run::from(child.wait_with_output().unwrap()).expect(130);
    assert!(run.stderr.contains("cancelled before the first step"), "{}", run.stderr);
    assert_eq!(folder.read("good.safetensors"), b"good");
    assert!(!folder.path(".ifg-partial-good.safetensors").exists());
}
