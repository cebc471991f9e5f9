//! `ifg clean`.

use crate::folder::Folder;
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::{icosphere, tube};
use if_mesh::file::{Content, MeshFile};
use if_mesh::ply::{self, Column, PlyMesh, Property, WriteParams};

/// A tube with a hole in its side, a stray ball beside it, and a label for each vertex.
fn raw(folder: &Folder) {
    let tube = tube(0.1, 0.4, 40, 20, false);
    let ball = icosphere(0.005, 1);
    let base = tube.vertices().len() as u32;
    let vertices = tube
        .vertices()
        .iter()
        .copied()
        .chain(ball.vertices().iter().map(|p| p + if_core::math::Vector::x()))
        .collect();
    let mut triangles = [&tube.triangles()[..600], &tube.triangles()[606..]].concat();
    triangles.extend(ball.triangles().iter().map(|t| t.map(|v| v + base)));
    let mesh = TriMesh::new(vertices, triangles).unwrap();
    let label = Property::new("label", Column::U8(vec![3; mesh.vertices().len()]));
    let ply = PlyMesh { vertex_properties: vec![label], ..PlyMesh::new(mesh) };
    ply::write_path(&ply, ply.mesh.vertices(), &WriteParams::default(), &folder.path("raw.ply"))
        .unwrap();
}

#[test]
fn clean_drops_fills_and_keeps_openings_and_attributes() {
    let folder = Folder::new();
    raw(&folder);
    let run = folder.ifg("clean raw.ply --out clean.ply").expect(0);
    for word in [
        "isolated elements",
        "1 dropped",
        "1 filled",
        "2 openings kept",
        "clean_before.png",
        "Wrote clean.ply",
    ] {
        assert!(run.stdout.contains(word), "{word}\n{}", run.stdout);
    }
    let file = MeshFile::read(&folder.path("clean.ply")).unwrap();
    let Content::Ply(ply) = file.content() else { panic!("a PLY file") };
    let label = ply.vertex_property("label").unwrap();
    assert_eq!(label.values, Column::U8(vec![3; ply.mesh.vertices().len()]));
    assert!(folder.read("clean_after.png").starts_with(b"\x89PNG"));
    let json = folder
        .ifg("clean raw.ply --out all.ply --openings 0 --no-pictures --json")
        .expect(0)
        .json();
    assert_eq!(json["report"]["holes"]["filled"].as_array().unwrap().len(), 3);
    assert_eq!(json["written"].as_array().unwrap().len(), 1);
    // Of the two ends one is named.
    let json = folder
        .ifg("clean raw.ply --out one.ply --open-at 0.1,0.2,0 --no-pictures --json")
        .expect(0)
        .json();
    assert_eq!(json["report"]["holes"]["filled"].as_array().unwrap().len(), 2);
}

#[test]
fn sides_of_a_parted_seam_are_named_and_count_as_no_openings() {
    let folder = Folder::new();
    let half = tube(0.1, 0.2, 24, 8, false);
    let base = half.vertices().len() as u32;
    let upper = half.vertices().iter().map(|p| p + if_core::math::Vector::y() * 0.20005);
    let vertices = half.vertices().iter().copied().chain(upper).collect();
    let triangles = half.triangles().iter().map(|t| t.map(|v| v + base));
    let mesh = TriMesh::new(vertices, half.triangles().iter().copied().chain(triangles).collect());
    let ply = PlyMesh::new(mesh.unwrap());
    let (how, path) = (WriteParams::default(), folder.path("crack.ply"));
    ply::write_path(&ply, ply.mesh.vertices(), &how, &path).unwrap();
    for options in ["--openings 2", "", "--no-fill"] {
        let command = format!("clean crack.ply --out out.ply --no-pictures {options}");
        let run = folder.ifg(&command).expect(0);
        for word in ["2 sides of parted seams", "the first around", "0.20", "merge their vertices"]
        {
            assert!(run.stdout.contains(word), "{word}\n{}", run.stdout);
        }
        assert!(options == "--no-fill" || run.stdout.contains("2 openings kept"), "{}", run.stdout);
    }
}

#[test]
fn colours_and_normals_of_obj_files_are_carried_and_what_is_lost_is_named() {
    let folder = Folder::new();
    let tube = tube(0.1, 0.4, 40, 20, false);
    let text = |colour: &dyn Fn(usize) -> &'static str| {
        let vertex = |(k, p): (usize, &if_core::math::Point)| {
            format!("v {} {} {}{}\n", p.x, p.y, p.z, colour(k))
        };
        let mut text: String = tube.vertices().iter().enumerate().map(vertex).collect();
        text.extend(tube.vertices().iter().map(|p| format!("vn {} 0 {}\n", p.x / 0.1, p.z / 0.1)));
        let corner = |v: &u32| format!(" {0}//{0}", v + 1);
        let hole = if_core::math::Point::new(0.1, 0.2, 0.0);
        let is_kept = |t: &&[u32; 3]| (tube.vertices()[t[0] as usize] - hole).norm() > 0.03;
        text.extend(
            tube.triangles()
                .iter()
                .filter(is_kept)
                .map(|t| format!("f{}\n", t.iter().map(corner).collect::<String>())),
        );
        text
    };
    std::fs::write(folder.path("all.obj"), text(&|_| " 1 0.2 0")).unwrap();
    let run = folder.ifg("clean all.obj --out all.ply --no-pictures").expect(0);
    assert!(run.stdout.contains("texture coordinates, materials and groups"), "{}", run.stdout);
    assert!(run.stdout.contains("1 filled"), "{}", run.stdout);
    assert!(!run.stdout.contains("colours"), "{}", run.stdout);
    let file = MeshFile::read(&folder.path("all.ply")).unwrap();
    let Content::Ply(ply) = file.content() else { panic!("a PLY file") };
    let n = ply.mesh.vertices().len();
    for (name, value) in [("red", 255), ("green", 51), ("blue", 0)] {
        assert_eq!(ply.vertex_property(name).unwrap().values, Column::U8(vec![value; n]));
    }
    let [x, z] = ["nx", "nz"].map(|name| ply.vertex_property(name).unwrap().values.to_f64());
    let is_outward = |v: usize| {
        let p = ply.mesh.vertices()[v];
        x[v] * p.x + z[v] * p.z > 0.95 * p.x.hypot(p.z)
    };
    assert!((0..n).all(is_outward));
    std::fs::write(folder.path("some.obj"), text(&|k| if k == 0 { "" } else { " 1 0 0" })).unwrap();
    let run = folder.ifg("clean some.obj --out some.ply --no-pictures").expect(0);
    assert!(run.stdout.contains("colours of vertices are not kept"), "{}", run.stdout);
}

#[test]
fn what_cannot_be_cleaned_is_refused() {
    let folder = Folder::new();
    raw(&folder);
    for (command, word) in [
        ("clean raw.ply --out clean.obj", ".ply"),
        ("clean raw.ply --out raw.ply", "--in-place"),
        ("clean missing.ply --out clean.ply", "missing.ply"),
        ("clean raw.ply --out clean.ply --project", "--body"),
        ("clean raw.ply --out body.ply --body body.ply --in-place", "input file `body.ply`"),
        ("clean raw.ply --out clean.ply --body body.ply --openings 2", "--openings"),
        ("clean raw.ply --out clean.ply --body body.ply --longer 20cm", "--longer"),
        ("clean raw.ply --out clean.ply --body body.ply --no-fill", "--no-fill"),
        ("clean raw.ply --out clean.ply --openings 2 --no-fill", "--no-fill"),
        ("clean raw.ply --out clean.ply --surface-passes 100000000", "0..=10000"),
        ("clean raw.ply --out raw.ply/clean.ply", "a part of the path is a file"),
        ("clean raw.ply --out clean.ply --least-share 200", "share"),
        ("clean raw.ply --out clean.ply --parts 0", "--parts"),
    ] {
        let run = folder.ifg(command).expect(2);
        assert!(run.stderr.contains(word), "{command}\n{}", run.stderr);
    }
    assert!(!folder.path("clean.ply").exists());
}

#[test]
fn a_body_may_stand_beside_openings_to_project_onto() {
    let folder = Folder::new();
    raw(&folder);
    folder.ifg("clean raw.ply --out deep/er/clean.ply --body body.ply --project --openings 2 --no-pictures").expect(0);
    assert!(folder.path("deep/er/clean.ply").exists());
    let all = folder.read("deep/er/clean.ply");
    folder.ifg("clean raw.ply --out raw.ply --in-place --body body.ply --project --openings 2 --no-pictures").expect(0);
    assert!(folder.read("raw.ply") == all);
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_passes_over_the_surface() {
    let folder = Folder::new();
    let fine = PlyMesh::new(tube(0.1, 0.4, 300, 300, false));
    ply::write_path(&fine, fine.mesh.vertices(), &WriteParams::default(), &folder.path("fine.ply"))
        .unwrap();
    let run = folder.interrupt(
        "clean fine.ply --out new/clean.ply --surface-passes 10000",
        "new/.ifg-partial-clean.ply",
    );
    assert!(run.stderr.contains("cancelled; `new/clean.ply` was not written"), "{}", run.stderr);
}

#[test]
fn at_most_so_many_parts_are_kept_however_small() {
    let folder = Folder::new();
    raw(&folder);
    let parts = |args: &str| {
        let args =
            format!("clean raw.ply --out clean.ply --no-pictures --json --least-share 0 {args}");
        let json = folder.ifg(&args).expect(0).json();
        ["kept", "dropped"].map(|what| json["report"]["components"][what].as_array().unwrap().len())
    };
    assert_eq!(parts(""), [2, 0]);
    assert_eq!(parts("--parts 1"), [1, 1]);
}

#[test]
fn the_boundary_is_left_as_it_is_where_that_is_asked_for() {
    let folder = Folder::new();
    let tube = tube(0.1, 0.4, 40, 20, false);
    // A zigzag round the top.
    let ragged = tube.vertices().iter().enumerate().map(|(v, p)| {
        let up = if p.y > 0.399 && v % 2 == 0 { 0.01 } else { 0.0 };
        p + if_core::math::Vector::y() * up
    });
    let ply = PlyMesh::new(tube.with_vertices(ragged.collect()).unwrap());
    ply::write_path(&ply, ply.mesh.vertices(), &WriteParams::default(), &folder.path("ragged.ply"))
        .unwrap();
    let moved = |args: &str| {
        let args =
            format!("clean ragged.ply --out clean.ply --openings 2 --no-pictures --json {args}");
        let json = folder.ifg(&args).expect(0).json();
        let vertices =
            |name: &str| MeshFile::read(&folder.path(name)).unwrap().mesh().vertices().to_vec();
        let (before, after) = (vertices("ragged.ply"), vertices("clean.ply"));
        (
            json["report"]["smoothing"]["moved"].as_u64().unwrap(),
            after.iter().filter(|p| !before.contains(p)).count(),
        )
    };
    let (told, found) = moved("");
    assert!(told > 0 && found > 0, "{told} {found}");
    assert_eq!(moved("--no-smooth"), (0, 0));
}

#[test]
fn openings_that_are_missing_and_faces_that_are_left_out_are_named() {
    let folder = Folder::new();
    raw(&folder);
    let run = folder.ifg("clean raw.ply --out five.ply --openings 5 --no-pictures").expect(0);
    assert!(run.stdout.contains("5 openings were asked for, and there are 3"), "{}", run.stdout);
    let ply = |faces: &str, count: usize| {
        let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
        format!(
            "{header}element face {count}\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n{faces}"
        )
    };
    folder.write("quad.ply", ply("3 0 1 2\n3 2 1 3\n3 1 1 2\n", 3));
    let run = folder.ifg("clean quad.ply --out two.ply --openings 1 --no-pictures").expect(0);
    let note = "1 faces that name a vertex twice are left out, the first of them face 2";
    assert!(run.stdout.contains(note) && !run.stdout.contains("more than three"), "{}", run.stdout);
}

/// As exporters write a garment with texture coordinates: both sides of a seam have vertices of their own.
#[test]
fn texture_seams_are_no_boundary_and_keep_both_coordinates() {
    let folder = Folder::new();
    let tube = tube(0.1, 0.4, 40, 20, false);
    let n = tube.vertices().len() as u32;
    let halves = tube.triangles().iter();
    let halves = halves.map(|t| if is_right_of(&tube, t) { t.map(|v| v + n) } else { *t });
    let mesh = TriMesh::new([tube.vertices(), tube.vertices()].concat(), halves.collect()).unwrap();
    let s = (0..2 * n).map(|v| if v < n { 0.25 } else { 0.75 }).collect();
    let ply = PlyMesh {
        vertex_properties: vec![Property::new("s", Column::F32(s))],
        ..PlyMesh::new(mesh)
    };
    ply::write_path(&ply, ply.mesh.vertices(), &WriteParams::default(), &folder.path("seam.ply"))
        .unwrap();
    let run = folder.ifg("clean seam.ply --out clean.ply --no-pictures --json").expect(0);
    let report = &run.json()["report"];
    assert_eq!(report["holes"]["openings"].as_array().unwrap().len(), 2);
    assert_eq!(report["seam_edges"], 40, "{report}");
    let file = MeshFile::read(&folder.path("clean.ply")).unwrap();
    let Content::Ply(clean) = file.content() else { panic!("a PLY file") };
    let Column::F32(s) = &clean.vertex_property("s").unwrap().values else { panic!("as given") };
    for t in clean.mesh.triangles() {
        let right = if is_right_of(&clean.mesh, t) { 0.75 } else { 0.25 };
        assert!(t.iter().all(|v| s[*v as usize] == right), "{t:?}");
    }
}

fn is_right_of(mesh: &TriMesh, t: &[u32; 3]) -> bool {
    t.iter().map(|v| mesh.vertices()[*v as usize].x).sum::<f64>() > 0.0
}
