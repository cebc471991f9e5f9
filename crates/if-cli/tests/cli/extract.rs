//! `ifg extract`: a closed mesh or a network becomes a mesh with the same surface.

use crate::folder::Folder;
use if_mesh::file::MeshFile;
use if_mesh::index::Bvh;
use if_mesh::measure::{smallest_angles, surface_distance};

#[test]
fn a_body_is_remeshed_and_what_was_done_is_told() {
    let folder = Folder::new();
    let run = folder.ifg("extract body.ply --out round.ply --cell 2cm --relax 5").expect(0);
    for word in ["triangles", "least angle", "field evaluated", "skipped", "wrote round.ply, round.before.png, round.after.png"] {
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
}

#[test]
fn a_fitted_network_becomes_the_mesh_that_it_was_fitted_to() {
    let folder = Folder::new();
    folder.ifg("fit body.ply --out body.safetensors --steps 6").expect(0);
    let run = folder.ifg("extract body.safetensors --out again.ply --cell 1cm").expect(0);
    for word in ["least angle", "field evaluated", "wrote again.ply, again.after.png"] {
        assert!(run.stdout.contains(word), "{word}\n{}", run.stdout);
    }
    assert!(!run.stdout.contains("distance of the meshes") && !folder.path("again.before.png").exists());
    let read = |name: &str| MeshFile::read(&folder.path(name)).unwrap().mesh().clone();
    let (before, after) = (read("body.ply"), read("again.ply"));
    assert!(if_mesh::validate::is_valid(&after));
    let apart = surface_distance((&before, &Bvh::new(&before)), (&after, &Bvh::new(&after)), 5_000, 0);
    // The fit is held to 1 mm (tests of `ifg fit`), cells of 1 cm cut a body of 10 cm radius by 0.1 mm.
    assert!(apart.chamfer_mm < 1.0 && apart.hausdorff_mm < 6.0, "{apart:?}");
    let json = folder.ifg("extract body.safetensors --out c.ply --cell 2cm --no-pictures --json").expect(0).json();
    assert!(json["before"].is_null() && json["distance"].is_null() && json["after"]["triangles"].as_u64().unwrap() > 100);
    folder.write("cut.safetensors", &folder.read("body.safetensors")[..5000]);
    let cut = folder.ifg("extract cut.safetensors --out d.ply").expect(2);
    assert!(cut.stderr.contains("cut.safetensors") && cut.stderr.contains("cut short"), "{}", cut.stderr);
    let scaled = folder.ifg("extract body.safetensors --out d.ply --scale 0.01").expect(2);
    assert!(scaled.stderr.contains("metres"), "{}", scaled.stderr);
    assert!(!folder.path("d.ply").exists());
}

#[test]
fn what_is_no_field_is_refused() {
    let folder = Folder::new();
    let open = folder.ifg("extract skirt.ply --out a.ply").expect(2);
    assert!(open.stderr.contains("skirt.ply") && open.stderr.contains("not closed"), "{}", open.stderr);
    folder.ifg("extract nothing.ply --out a.ply").expect(2);
    folder.ifg("extract body.ply --out a.ply --cell 0mm").expect(2);
    folder.ifg("extract body.ply --out no/folder/a.ply --no-pictures").expect(2);
    assert!(!folder.path("a.ply").exists());
}
