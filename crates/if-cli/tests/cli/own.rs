//! Garments that intersect themselves: removed or kept, and what the states and exit codes are.

use crate::folder::{Folder, flap, ply};
use if_core::math::Point;
use if_core::mesh::TriMesh;

/// A folder with `flap.ply`.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("flap.ply", ply(&flap()));
    folder
}

#[test]
fn own_pairs_are_removed() {
    let folder = folder();
    let json = folder.ifg("check --body body.ply flap.ply --json").expect(0).json();
    assert_eq!(json["state"], "clean between layers");
    let own = json["report"]["own_pairs"][0].as_u64().unwrap();
    assert!(own > 0);
    let json =
        folder.ifg("fix --body body.ply flap.ply --out out --strict --json").expect(0).json();
    assert_eq!(json["state"], "clean everywhere");
    let own_pairs = &json["report"]["layers"][0]["own_pairs"];
    assert_eq!((own_pairs["before"].as_u64(), own_pairs["after"].as_u64()), (Some(own), Some(0)));
    let found = folder.ifg("check --body body.ply out/flap.ply --strict").expect(0);
    assert!(found.stdout.contains(": clean everywhere"), "{}", found.stdout);
    let receipt: serde_json::Value =
        serde_json::from_slice(&folder.read("out/receipt.json")).unwrap();
    assert_eq!(receipt["state"], "clean everywhere");
}

#[test]
fn own_pairs_that_are_kept_are_an_error_with_strict_only() {
    let folder = folder();
    let fix = "fix --body body.ply flap.ply --out out --own keep";
    let run = folder.ifg(fix).expect(0);
    assert!(run.stdout.contains(": clean between layers") && run.stderr.is_empty());
    let strict = folder.ifg(&format!("{fix} --strict")).expect(1);
    assert!(strict.stderr.contains("of `flap`:"), "{}", strict.stderr);
    assert_eq!(folder.read("out/flap.ply"), folder.read("flap.ply"));
    let strict = folder.ifg("check --body body.ply flap.ply --strict").expect(1);
    assert!(strict.stderr.contains("of `flap`:"), "{}", strict.stderr);
    // In a batch a finished outfit is judged by its receipt.
    folder.write("a.toml", "body = \"body.ply\"\n[[garment]]\nfile = \"flap.ply\"\n");
    folder.write("b.toml", folder.read("a.toml"));
    let batch = "fix a.toml b.toml --out batch --own keep --strict";
    folder.ifg(batch).expect(1);
    let again = folder.ifg(batch).expect(1);
    assert!(again.stdout.contains("finished before, clean between layers"), "{}", again.stdout);
    assert!(again.stderr.contains("but not everywhere"), "{}", again.stderr);
    folder.ifg("fix a.toml b.toml --out batch --own keep").expect(0);
}

#[test]
fn a_body_that_intersects_itself_is_not_clean_everywhere() {
    let folder = Folder::new();
    let body = crate::folder::body();
    let n = body.vertices().len() as u32;
    let turned = body.vertices().iter().map(|p| Point::new(p.x, p.y + 0.01, p.z + 0.01));
    let vertices = body.vertices().iter().copied().chain(turned).collect();
    let more = body.triangles().iter().map(|t| t.map(|v| v + n));
    let triangles = body.triangles().iter().copied().chain(more).collect();
    folder.write("twice.ply", ply(&TriMesh::new(vertices, triangles).unwrap()));
    let json = folder.ifg("check --body twice.ply hoop.ply --json").expect(0).json();
    assert_eq!(json["state"], "clean between layers");
    assert!(json["report"]["body_own_pairs"].as_u64().unwrap() > 0);
    let strict = folder.ifg("check --body twice.ply hoop.ply --strict").expect(1);
    assert!(strict.stderr.contains("of `twice`:"), "{}", strict.stderr);
}
