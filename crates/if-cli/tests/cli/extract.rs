//! `ifg extract`: a closed mesh or a network becomes a mesh with the same surface.

use crate::folder::{Folder, moved, ply as text_of};
use if_core::field::SignedDistance;
use if_core::math::Vector;
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::icosphere;
use if_mesh::file::MeshFile;
use if_mesh::index::Bvh;
use if_mesh::measure::{smallest_angles, surface_distance};
use if_mesh::ply::{self, CoordinateType, PlyMesh, WriteParams};
use if_mesh::sdf::MeshSdf;

#[test]
fn a_body_is_remeshed_and_what_was_done_is_told() {
    let folder = Folder::new();
    let run = folder.ifg("extract body.ply --out round.ply --cell 2cm --relax 5").expect(0);
    for word in [
        "triangles",
        "least angle",
        "field evaluated",
        "skipped",
        "wrote round.ply, round.before.png, round.after.png",
    ] {
        assert!(run.stdout.contains(word), "{word}\n{}", run.stdout);
    }
    let mesh = MeshFile::read(&folder.path("round.ply")).unwrap().mesh().clone();
    // The body is a polyhedron; triangles along its creases may stay thin.
    let slivers = smallest_angles(&mesh).into_iter().filter(|a| *a < 10.0).count();
    assert!(100 * slivers <= mesh.triangles().len(), "{slivers} of {}", mesh.triangles().len());
    let before = MeshFile::read(&folder.path("body.ply")).unwrap().mesh().signed_volume();
    assert!((mesh.signed_volume() / before - 1.0).abs() < 0.02);
    assert!(folder.read("round.after.png").starts_with(b"\x89PNG"));
}

#[test]
fn an_accuracy_is_reached_and_reported_as_json() {
    let folder = Folder::new();
    let line = "extract body.ply --out fine.ply --accuracy 2mm --finest 5mm --layer 3 --no-pictures --json";
    let json = folder.ifg(line).expect(0).json();
    assert!(json["report"]["error"]["center_max"].as_f64().unwrap() <= 0.002, "{json}");
    assert!(json["distance"]["hausdorff_mm"].as_f64().unwrap() < 10.0);
    assert_eq!(json["files"].as_array().unwrap().len(), 1);
    assert!(!folder.path("fine.after.png").exists());
    // One that is not reached is written, and told by the exit code, too.
    let line = "extract body.ply --out coarse.ply --accuracy 0.01mm --finest 20mm --no-pictures";
    let run = folder.ifg(line).expect(1);
    assert!(run.stdout.contains("requested is 0.0100 mm"), "{}", run.stdout);
    assert!(folder.path("coarse.ply").exists());
}

#[test]
fn a_mesh_that_intersects_itself_becomes_the_surface_of_what_it_encloses() {
    let folder = Folder::new();
    let ball = icosphere(0.1, 3);
    let n = ball.vertices().len() as u32;
    let beside = ball.vertices().iter().map(|p| p + Vector::x() * 0.12);
    let vertices = ball.vertices().iter().copied().chain(beside).collect();
    let triangles = ball.triangles().iter().flat_map(|t| [*t, t.map(|v| v + n)]).collect();
    folder.write("both.ply", text_of(&TriMesh::new(vertices, triangles).unwrap()));
    let run = folder.ifg("extract both.ply --out one.ply --cell 6mm --no-pictures").expect(0);
    assert!(run.stdout.contains("what any of its parts encloses is inside"), "{}", run.stdout);
    let one = MeshFile::read(&folder.path("one.ply")).unwrap().mesh().clone();
    assert!(if_mesh::validate::is_valid(&one));
    // Two balls but for the lens of two caps of h = r - d / 2: V = π h² (3 r - h) / 3 each.
    let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.1_f64.powi(3);
    let lens = 2.0 * std::f64::consts::PI * 0.04_f64.powi(2) * (0.3 - 0.04) / 3.0;
    assert!((one.signed_volume() / (2.0 * ball - lens) - 1.0).abs() < 0.02);
}

#[test]
#[ignore = "stress"]
fn a_fitted_network_becomes_the_mesh_that_it_was_fitted_to() {
    let folder = Folder::new();
    folder.ifg("fit body.ply --out body.safetensors --steps 6").expect(0);
    let run = folder.ifg("extract body.safetensors --out again.ply --cell 1cm").expect(0);
    for word in ["least angle", "field evaluated", "wrote again.ply, again.after.png"] {
        assert!(run.stdout.contains(word), "{word}\n{}", run.stdout);
    }
    assert!(
        !run.stdout.contains("distance of the meshes") && !folder.path("again.before.png").exists()
    );
    let read = |name: &str| MeshFile::read(&folder.path(name)).unwrap().mesh().clone();
    let (before, after) = (read("body.ply"), read("again.ply"));
    assert!(if_mesh::validate::is_valid(&after));
    let apart =
        surface_distance((&before, &Bvh::new(&before)), (&after, &Bvh::new(&after)), 5_000, 0);
    // The fit is held to 1 mm (tests of `ifg fit`), cells of 1 cm cut a body of 10 cm radius by 0.1
    // mm.
    assert!(apart.chamfer_mm < 1.0 && apart.hausdorff_mm < 6.0, "{apart:?}");
    let json = folder
        .ifg("extract body.safetensors --out c.ply --cell 2cm --no-pictures --json")
        .expect(0)
        .json();
    assert!(
        json["before"].is_null()
            && json["distance"].is_null()
            && json["after"]["triangles"].as_u64().unwrap() > 100
    );
    folder.write("cut.safetensors", &folder.read("body.safetensors")[..5000]);
    let cut = folder.ifg("extract cut.safetensors --out d.ply").expect(2);
    assert!(
        cut.stderr.contains("cut.safetensors") && cut.stderr.contains("cut short"),
        "{}",
        cut.stderr
    );
    let scaled = folder.ifg("extract body.safetensors --out d.ply --scale 0.01").expect(2);
    assert!(scaled.stderr.contains("metres"), "{}", scaled.stderr);
    assert!(!folder.path("d.ply").exists());
}

#[test]
fn what_is_no_field_is_refused() {
    let folder = Folder::new();
    let open = folder.ifg("extract skirt.ply --out a.ply").expect(2);
    assert!(
        open.stderr.contains("skirt.ply") && open.stderr.contains("not closed"),
        "{}",
        open.stderr
    );
    folder.ifg("extract nothing.ply --out a.ply").expect(2);
    folder.ifg("extract body.ply --out a.ply --cell 0mm").expect(2);
    let lost = folder.ifg("extract body.ply --out a.ply --cell 5m").expect(2);
    assert!(
        lost.stderr.contains("nothing is left") && lost.stderr.contains("5000.00 mm"),
        "{}",
        lost.stderr
    );
    assert!(!folder.path("a.ply").exists());
}

#[test]
fn what_would_be_lost_is_not_overwritten_and_a_bad_name_is_refused_before_the_work() {
    let folder = Folder::new();
    folder.write("file", "text");
    std::fs::create_dir(folder.path("dir.ply")).unwrap();
    std::fs::create_dir(folder.path("b.after.png")).unwrap();
    let before = folder.files();
    for (command, words) in [
        ("extract body.ply --out body.ply", "is the input file `body.ply` itself"),
        ("extract body.ply --out ./none/../body.ply", "is the input file `body.ply` itself"),
        ("extract body.ply --out x.obj", "end in .ply"),
        ("extract body.ply --out file/a.ply", "a part of the path is a file"),
        ("extract body.ply --out dir.ply", "in the way"),
        ("extract body.ply --out b.ply", "`b.after.png` is in the way"),
    ] {
        // So many cells take minutes.
        let run = folder.ifg(&format!("{command} --cells 2000")).expect(2);
        assert!(run.stderr.contains(words), "{command}\n{}", run.stderr);
        assert!(!run.stderr.contains("--in-place"), "{}", run.stderr);
        assert!(folder.files() == before, "{command}: files changed");
    }
    folder.ifg("extract body.ply --out new/folder/a.ply --cell 5cm").expect(0);
    let names: Vec<_> = std::fs::read_dir(folder.path("new/folder"))
        .unwrap()
        .map(|f| f.unwrap().file_name())
        .collect();
    assert_eq!(names.len(), 3, "{names:?}");
}

#[cfg(unix)]
#[test]
fn a_link_is_followed_and_never_to_the_input() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("store")).unwrap();
    folder.write("store/real.ply", "old");
    std::os::unix::fs::symlink("store/real.ply", folder.path("link.ply")).unwrap();
    std::os::unix::fs::symlink("body.ply", folder.path("same.ply")).unwrap();
    let run = folder.ifg("extract body.ply --out same.ply --cell 5cm").expect(2);
    assert!(run.stderr.contains("input file `body.ply`"), "{}", run.stderr);
    folder.ifg("extract body.ply --out link.ply --cell 5cm --no-pictures").expect(0);
    assert!(
        folder.path("link.ply").is_symlink() && folder.read("store/real.ply").starts_with(b"ply")
    );
}

/// Far away, where coordinates of 4 bytes are 0.06 mm apart.
#[test]
fn errors_are_those_of_the_file_in_the_precision_of_the_input() {
    let folder = Folder::new();
    let far = moved(&icosphere(0.1, 3), |p| p + Vector::new(1000.0, 0.0, 0.0));
    for (coordinates, most) in [(CoordinateType::Double, 1e-9), (CoordinateType::Float, 1e-4)] {
        let ply = PlyMesh { coordinates, ..PlyMesh::new(far.clone()) };
        let how = WriteParams { coordinates, ..WriteParams::default() };
        ply::write_path(&ply, far.vertices(), &how, &folder.path("far.ply")).unwrap();
        let json = folder
            .ifg("extract far.ply --out near.ply --cell 3cm --no-pictures --json")
            .expect(0)
            .json();
        let error = &json["report"]["error"];
        let read = |name: &str| MeshFile::read(&folder.path(name)).unwrap();
        let (before, after) = (read("far.ply"), read("near.ply"));
        assert_eq!(after.is_single_precision(), coordinates == CoordinateType::Float);
        assert_eq!(
            error["checked"].as_u64(),
            Some(after.mesh().vertices().len() as u64),
            "all are checked"
        );
        let field = MeshSdf::closed(before.mesh()).unwrap();
        let worst =
            after.mesh().vertices().iter().map(|p| field.distance(p).abs()).fold(0.0, f64::max);
        let told = error["vertex_max"].as_f64().unwrap();
        assert!((told - worst).abs() <= 1e-3 * worst + 1e-12, "{told} is said, {worst} is");
        assert!(worst < most, "{worst}");
        assert!((worst > 1e-6) == (coordinates == CoordinateType::Float), "{worst}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn paths_that_are_not_utf_8_are_told_all_the_same() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::new();
    let (field, out) = (OsStr::from_bytes(b"b\xffdy.ply"), OsStr::from_bytes(b"r\xffund.ply"));
    std::fs::rename(folder.path("body.ply"), folder.path("").join(field)).unwrap();
    let mut command = folder.command("extract --cell 5cm --no-pictures --json --out");
    let run = crate::folder::Run::from(command.args([out, field]).output().unwrap()).expect(0);
    let json = run.json();
    assert_eq!(
        (&json["field"], &json["files"][0]),
        (&"b\u{fffd}dy.ply".into(), &"r\u{fffd}und.ply".into())
    );
    assert!(folder.path("").join(out).exists());
}
