//! `--pinch` of `ifg fix` and `ifg animate`.

use crate::animate::scene;
use crate::folder::Folder;
use if_core::math::{Point, Vector};
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::icosphere;
use if_mesh::ply::{PlyMesh, WriteParams, read_path, write_path};
use serde_json::Value;

/// Two balls as a body that overlap by 8 mm, and a sheet of cloth between them.
pub(crate) fn balls() -> Folder {
    let folder = Folder::new();
    let ball = icosphere(0.1, 3);
    let n = ball.vertices().len() as u32;
    let at = |x: f64| ball.vertices().iter().map(move |p| p + Vector::x() * x);
    let vertices: Vec<Point> = at(-0.096).chain(at(0.096)).collect();
    let second = ball.triangles().iter().map(|t| t.map(|v| v + n));
    let triangles = ball.triangles().iter().copied().chain(second).collect();
    let place = |k: u32| 0.3 * (f64::from(k) / 20.0 - 0.5);
    let sheet = (0..441).map(|k| Point::new(0.0, place(k % 21), place(k / 21))).collect();
    let corners = (0..400).map(|k| k / 20 * 21 + k % 20);
    let cells = corners.flat_map(|a| [[a, a + 1, a + 21], [a + 1, a + 22, a + 21]]).collect();
    for (name, vertices, triangles) in [("balls", vertices, triangles), ("sheet", sheet, cells)] {
        let mesh = PlyMesh::new(TriMesh::new(vertices, triangles).unwrap());
        let path = folder.path(&format!("{name}.ply"));
        write_path(&mesh, mesh.mesh.vertices(), &WriteParams::default(), &path).unwrap();
    }
    folder
}

const FIX: &str = "fix --body balls.ply sheet.ply --set rounds=8";

#[test]
fn a_body_that_was_drawn_back_is_written_beside_its_garments() {
    let folder = balls();
    let run = folder.ifg(&format!("{FIX} --out kept")).expect(1);
    assert!(run.stdout.contains("--pinch yield draws it back there"), "{}", run.stdout);
    let run = folder.ifg(&format!("{FIX} --pinch yield --out yielded --strict")).expect(0);
    assert!(run.stdout.contains("the body was drawn back by at most"), "{}", run.stdout);
    let drawn = read_path(&folder.path("yielded/balls_drawn_back.ply")).unwrap().mesh;
    let given = read_path(&folder.path("balls.ply")).unwrap().mesh;
    assert_eq!(drawn.triangles(), given.triangles());
    let moved = given.vertices().iter().zip(drawn.vertices()).map(|(a, b)| (b - a).norm());
    let most = moved.fold(0.0, f64::max);
    let receipt: Value = serde_json::from_slice(&folder.read("yielded/receipt.json")).unwrap();
    let reported = receipt["report"]["drawn_back"]["moved"]["max"].as_f64().unwrap();
    assert!(most > 3e-3 && (most - reported).abs() < 1e-6, "{most} {reported}");
    // What was written is clean everywhere, by another run.
    folder.ifg("check --strict --body yielded/balls_drawn_back.ply yielded/sheet.ply").expect(0);
    // No garment is written over.
    std::fs::rename(folder.path("sheet.ply"), folder.path("balls_drawn_back.ply")).unwrap();
    let same = FIX.replace("sheet.ply", "balls_drawn_back.ply");
    let run = folder.ifg(&format!("{same} --pinch yield --out same")).expect(2);
    assert!(run.stderr.contains("balls_drawn_back.ply"), "{}", run.stderr);
}

#[test]
fn the_materials_of_a_body_are_copied_where_it_is_written() {
    let folder = balls();
    let mesh = read_path(&folder.path("balls.ply")).unwrap().mesh;
    let v = mesh.vertices().iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let f = mesh.triangles().iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    let text = v.chain(f).collect::<String>();
    folder.write(
        "balls.obj",
        format!("mtllib skin.mtl\nmtllib receipt.json\nmtllib gone.mtl\n{text}"),
    );
    folder.write("skin.mtl", "map_Kd skin.png\n");
    folder.write("skin.png", "freckles");
    folder.write("receipt.json", "");
    let fix = FIX.replace("balls.ply", "balls.obj");
    let run = folder.ifg(&format!("{fix} --write-unproven --out kept")).expect(1);
    assert!(
        !folder.path("kept/skin.mtl").exists() && !run.stdout.contains("gone.mtl"),
        "{}",
        run.stdout
    );
    let run = folder.ifg(&format!("{fix} --pinch yield --out yielded")).expect(0);
    assert!(folder.read("yielded/balls_drawn_back.obj").starts_with(b"mtllib skin.mtl\n"));
    assert_eq!(folder.read("yielded/skin.png"), b"freckles");
    assert_eq!(folder.read("yielded/skin.mtl"), b"map_Kd skin.png\n");
    // What would be written over a file of ours is named instead.
    for note in ["`gone.mtl` is not in its folder", "`receipt.json` is not copied"] {
        assert!(run.stdout.contains(note), "{}", run.stdout);
    }
}

#[test]
fn frames_over_a_body_that_is_kept_name_what_lies_in_pinches() {
    let folder = scene();
    let run = folder
        .ifg(
            "animate --body doll/body_clean.ply doll/trousers.ply --motion doll/motion.json --pinch keep --frames 0-1 \
             --no-pictures --out kept",
        )
        .expect(0);
    assert!(run.stdout.contains("Pinches, where the body leaves no room"), "{}", run.stdout);
    let report: Value = serde_json::from_slice(&folder.read("kept/report.json")).unwrap();
    assert_eq!(report["params"]["pinch"], "keep");
    for frame in report["report"]["frames"].as_array().unwrap() {
        assert_eq!((&frame["pairs"], &frame["inside"]), (&0.into(), &0.into()));
        assert!(frame["pinch"]["body_faces"].is_u64(), "{frame}");
        assert!(frame["body"]["moved"]["max"].as_f64().unwrap() < 1e-6, "as skinned");
    }
}
