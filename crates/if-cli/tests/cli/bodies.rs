//! Bodies as they come: the mannequin without a head and with pinholes, and what is no body at all.

use crate::folder::{Folder, belt, moved, obj, ply};
use if_body::mannequin::{self, Garment, MannequinParams};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;

const COARSE: MannequinParams = MannequinParams { resolution: 0.7, overlap: 0.5 };

/// The mannequin without its head, and without every 150th of its other triangles.
fn headless() -> TriMesh {
    let body = mannequin::body(&COARSE);
    let top = body.aabb().max.y;
    let below_neck = |t: &usize| {
        let height: Real = body.corners(*t).iter().map(|p| p.y).sum::<Real>() / 3.0;
        height < top - 0.3 && !t.is_multiple_of(150)
    };
    let kept = (0..body.triangles().len()).filter(below_neck).map(|t| body.triangles()[t]);
    TriMesh::new(body.vertices().to_vec(), kept.collect()).unwrap()
}

fn dressed(body: &TriMesh) -> Folder {
    let folder = Folder::new();
    folder.write("headless.ply", ply(body));
    folder.write("tshirt.ply", ply(&mannequin::garment(Garment::Tshirt, &COARSE)));
    folder.write("jacket.obj", obj(&mannequin::garment(Garment::Jacket, &COARSE)));
    folder
}

#[test]
fn a_body_without_a_head_and_with_pinholes_is_dressed_and_what_was_assumed_is_said() {
    let folder = dressed(&headless());
    let args = "--body headless.ply tshirt.ply jacket.obj";
    let before = folder.read("headless.ply");
    let check = folder.ifg(&format!("check {args}")).expect(1);
    for words in ["holes of up to", "count as closed", "nothing is pushed out of openings of"] {
        assert!(check.stdout.contains(words), "`{words}` is missing:\n{}", check.stdout);
    }
    let report = folder.ifg(&format!("check {args} --json")).expect(1).json();
    let holes = report["report"]["body"]["holes"].as_array().unwrap();
    let open = holes.iter().filter(|hole| hole["filled"] == false).count();
    assert!(open == 1 && holes.len() > 20, "{holes:?}");

    let fix = folder.ifg(&format!("fix {args} --out fixed --json")).expect(0).json();
    assert_eq!(fix["state"], "clean everywhere");
    assert_eq!(fix["report"]["before"]["body"]["holes"], report["report"]["body"]["holes"]);
    let after = folder.ifg("check --body headless.ply fixed/tshirt.ply fixed/jacket.obj");
    assert!(after.expect(0).stdout.contains(": clean"));
    assert!(folder.read("headless.ply") == before, "the body changed");
}

#[test]
fn a_closed_body_is_not_mentioned() {
    let folder = dressed(&mannequin::body(&COARSE));
    let run = folder.ifg("check --json --body headless.ply tshirt.ply jacket.obj").expect(1).json();
    assert!(run["report"].get("body").is_none(), "{run}");
}

#[test]
fn a_garment_is_no_body() {
    let folder = dressed(&headless());
    for command in ["check", "fix --out fixed"] {
        let run = folder.ifg(&format!("{command} --body tshirt.ply jacket.obj")).expect(2);
        for words in ["tshirt", "no inside", "openings"] {
            assert!(run.stderr.contains(words), "`{words}` is missing:\n{}", run.stderr);
        }
    }
    assert!(!folder.path("fixed").exists());
}

#[test]
fn the_order_is_proposed_from_where_garments_lie() {
    let folder = dressed(&mannequin::body(&COARSE));
    folder.write("coat.ply", ply(&mannequin::garment(Garment::Coat, &COARSE)));
    let args = "--order auto --body headless.ply coat.ply jacket.obj tshirt.ply";
    let run = folder.ifg(&format!("check {args}")).expect(1);
    assert!(run.stdout.contains("innermost first: tshirt < jacket < coat"), "{}", run.stdout);
    let run = folder.ifg(&format!("check {args} --json")).expect(1).json();
    assert_eq!(run["order"]["names"], serde_json::json!(["tshirt", "jacket", "coat"]));
    assert!(run["order"]["confidence"].as_f64().unwrap() > 0.5, "{}", run["order"]);
    let fix = folder.ifg(&format!("fix {args} --out fixed --json")).expect(0).json();
    let names: Vec<_> =
        fix["report"]["layers"].as_array().unwrap().iter().map(|l| l["name"].clone()).collect();
    assert_eq!(names, ["tshirt", "jacket", "coat"]);
}

#[test]
fn a_garment_inside_one_that_is_given_below_it_gets_a_note() {
    let folder = Folder::new();
    folder.write("wide.ply", ply(&belt(1.3, -0.2, 0.2)));
    folder.write("narrow.ply", ply(&belt(1.15, -0.2, 0.2)));
    let note = "`narrow`: 97 % of it lies inside `wide`, which is given below it";
    let run = folder.ifg("check --body body.ply wide.ply narrow.ply").expect(1);
    assert!(run.stdout.contains(note), "{}", run.stdout);
    let run = folder.ifg("check --body body.ply narrow.ply wide.ply").expect(0);
    assert!(!run.stdout.contains("given below"), "{}", run.stdout);
}

#[test]
fn an_ambiguous_order_is_an_error_that_names_the_pair() {
    let folder = Folder::new();
    // Mirror images of each other: each is the outer one in half of the places.
    let wavy = |sign: Real| {
        moved(&belt(1.2, -0.1, 0.2), |p| {
            let scale = 1.0 + sign * 0.04 * (4.0 * p.z.atan2(p.x)).sin();
            Point::new(p.x * scale, p.y, p.z * scale)
        })
    };
    folder.write("left.ply", ply(&wavy(1.0)));
    folder.write("right.ply", ply(&wavy(-1.0)));
    let args = "--order auto --body body.ply left.ply right.ply";
    let run = folder.ifg(&format!("fix {args} --out fixed")).expect(2);
    for words in ["`left`", "`right`", "ambiguous", "innermost first"] {
        assert!(run.stderr.contains(words), "`{words}` is missing:\n{}", run.stderr);
    }
    assert!(!folder.path("fixed").exists());
}
