use super::batch::{self, BatchParams};
use super::combination::{Combination, Order, RandomParams, random};
use super::dresser::{Dresser, TurnedBone};
use super::matching::{self, MatchParams, Placed, State, run_into_folder};
use super::*;
use crate::asset::{Beside, LayerHint, Provenance};
use if_body::align::{AlignParams, Method};
use if_body::mannequin::{Garment, MannequinParams, body, garment, rig};
use if_body::{Joint, Skeleton, SkinWeights};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::atomic;
use if_mesh::ply::{PlyMesh, WriteParams, write_path};
use if_outfit::Pinch;
use std::fs;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

const COARSE: MannequinParams = MannequinParams { resolution: 0.7, overlap: 0.6 };

/// A body `slim` with all garments, and a body `large` without.
fn filled(root: &Path) -> Wardrobe {
    let mut wardrobe = Wardrobe::open(root).unwrap();
    let slim = body(&COARSE);
    let wider = |p: &Point| Point::new(p.x * 1.06, p.y * 1.03, p.z * 1.08);
    let large = slim.with_vertices(slim.vertices().iter().map(wider).collect()).unwrap();
    let files = root.join("files");
    fs::create_dir_all(&files).unwrap();
    let mut made = None;
    for (name, mesh) in [("slim", &slim), ("large", &large)] {
        let path = files.join(format!("{name}.ply"));
        let ply = PlyMesh::new(mesh.clone());
        write_path(&ply, mesh.vertices(), &WriteParams::default(), &path).unwrap();
        let new = NewBody::new(name, &path);
        let found = wardrobe.add_body(&new).unwrap();
        made = made.or(Some(found));
    }
    for kind in Garment::ALL {
        let (name, mesh) = (kind.name(), garment(kind, &COARSE));
        wardrobe.add(&parts(name, &mesh, made.as_ref().unwrap(), &Provenance::default())).unwrap();
    }
    wardrobe
}

fn parts<'a>(
    name: &'a str,
    mesh: &'a TriMesh,
    body: &'a BodyRef,
    provenance: &'a Provenance,
) -> Parts<'a> {
    Parts {
        name,
        hint: LayerHint::of_name(name),
        body,
        mesh,
        skin: None,
        beside: None,
        provenance,
        network: None,
        baked: None,
    }
}

fn on(body: &str, garments: &[&str]) -> Combination {
    Combination { body: body.into(), garments: garments.iter().map(ToString::to_string).collect() }
}

/// Files below a folder with their bytes, but for those that hold seconds.
fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for name in atomic::names(folder).unwrap() {
        found.extend(files(&folder.join(name)));
    }
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let timed = ["timings.json", "report.html", "summary.csv", ".ifg-lock"]
            .iter()
            .any(|n| path.ends_with(n));
        if path.is_file() && !timed {
            found.push((path.clone(), fs::read(&path).unwrap()));
        }
    }
    found.sort();
    found
}

fn keep_on(_: &batch::Event) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[test]
fn what_has_lost_its_mesh_is_a_fault() {
    let root = tempfile::tempdir().unwrap();
    let made = filled(root.path());
    let meshes = [
        ("garments/coat", &made.garments()["coat"].garment.file),
        ("bodies/slim", &made.bodies()["slim"].mesh.file),
    ];
    for (folder, file) in meshes {
        let path = root.path().join(folder).join(file);
        fs::rename(&path, path.with_extension("away")).unwrap();
        let wardrobe = Wardrobe::open(root.path()).unwrap();
        let [.., fault] = wardrobe.faults() else { panic!("a fault in {folder}") };
        let message = fault.error.to_string();
        assert!(message.starts_with(path.to_str().unwrap()), "{message}");
        assert!(message.contains("add the body again") || folder.starts_with("garments"));
        fs::rename(path.with_extension("away"), &path).unwrap();
        assert!(Wardrobe::open(root.path()).unwrap().faults().is_empty());
    }
}

#[test]
fn a_wardrobe_is_found_as_it_was_left() {
    let root = tempfile::tempdir().unwrap();
    let made = filled(root.path());
    let wardrobe = Wardrobe::open(root.path()).unwrap();
    assert_eq!((wardrobe.bodies(), wardrobe.garments()), (made.bodies(), made.garments()));
    assert_eq!(wardrobe.garments().len(), 5);
    assert!(wardrobe.garment("coat").unwrap().mesh.vertices().len() > 100);
    assert!(
        matches!(wardrobe.garment("hat"), Err(WardrobeError::NoGarment { known, .. }) if known.contains("coat, jacket"))
    );
    assert!(matches!(wardrobe.body("nobody"), Err(WardrobeError::NoBody { .. })));
    // One broken garment does not hide the others.
    fs::write(root.path().join("garments/coat/asset.json"), "{").unwrap();
    let wardrobe = Wardrobe::open(root.path()).unwrap();
    assert_eq!((wardrobe.garments().len(), wardrobe.faults().len()), (4, 1));
    fs::write(root.path().join("bodies/slim/body.ply"), "changed").unwrap();
    assert!(matches!(wardrobe.body("slim"), Err(WardrobeError::BodyInfo { .. })));
    // Nor does a broken body, or a folder that is none.
    fs::write(root.path().join("bodies/slim/body.json"), "{").unwrap();
    fs::create_dir(root.path().join("bodies/junk")).unwrap();
    let wardrobe = Wardrobe::open(root.path()).unwrap();
    let faults: Vec<_> = wardrobe.faults().iter().map(|f| (f.part, f.name.as_str())).collect();
    assert_eq!(faults, [(Part::Body, "junk"), (Part::Body, "slim"), (Part::Garment, "coat")]);
    assert!(wardrobe.body("large").is_ok());
    assert!(matches!(wardrobe.body("slim"), Err(WardrobeError::BodyInfo { .. })));
    assert!(matches!(wardrobe.body("junk"), Err(WardrobeError::Folder { .. })));
    assert!(matches!(wardrobe.garment("coat"), Err(WardrobeError::Asset(_))));
    assert!(matches!(
        Wardrobe::open_existing(&root.path().join("files")),
        Err(WardrobeError::NoWardrobe { .. })
    ));
}

#[test]
fn a_damaged_body_is_not_replaced_by_another_of_its_name() {
    let root = tempfile::tempdir().unwrap();
    let mut wardrobe = filled(root.path());
    fs::write(root.path().join("bodies/slim/body.json"), "{").unwrap();
    let (slim, large) = (root.path().join("files/slim.ply"), root.path().join("files/large.ply"));
    assert_eq!(wardrobe.add_body_once(&NewBody::new("slim", &slim)).unwrap().name, "slim_2");
    assert_eq!(wardrobe.add_body_once(&NewBody::new("anything", &large)).unwrap().name, "large");
}

#[test]
fn a_garment_that_another_process_has_added_meanwhile_is_not_replaced() {
    let root = tempfile::tempdir().unwrap();
    let mut late = filled(root.path());
    let mut early = Wardrobe::open(root.path()).unwrap();
    let (mesh, body) = (garment(Garment::Skirt, &COARSE), late.body_info("slim").unwrap());
    let body = body.reference();
    let add = |wardrobe: &mut Wardrobe, name: &str, source: &str| {
        let provenance = Provenance { source: source.into(), ..Provenance::default() };
        wardrobe.add(&parts(name, &mesh, &body, &provenance)).map(drop)
    };
    // A new one, and one that both had found.
    for name in ["scarf", "coat"] {
        add(&mut early, name, "first").unwrap();
        let fault = add(&mut late, name, "second");
        assert!(matches!(fault, Err(WardrobeError::Busy { .. })), "{fault:?}");
        let stored = Wardrobe::open(root.path()).unwrap();
        assert_eq!(stored.garments()[name].provenance.source, "first");
        // Who knows it may replace it.
        add(&mut early, name, "third").unwrap();
        add(&mut Wardrobe::open(root.path()).unwrap(), name, "fourth").unwrap();
    }
}

#[test]
fn the_longest_name_that_is_taken_gets_a_number_too() {
    let root = tempfile::tempdir().unwrap();
    let mut wardrobe = filled(root.path());
    let longest = "n".repeat(64);
    fs::create_dir_all(root.path().join("bodies").join(&longest)).unwrap();
    let (other, ply) = (root.path().join("files/other.ply"), PlyMesh::new(body(&COARSE)));
    let wider: Vec<Point> = ply.mesh.vertices().iter().map(|p| p * 1.01).collect();
    write_path(&ply, &wider, &WriteParams::default(), &other).unwrap();
    let name = wardrobe.add_body_once(&NewBody::new(&longest, &other)).unwrap().name;
    assert_eq!(name, "n".repeat(62) + "_2");
}

#[test]
fn folders_of_the_user_are_not_replaced() {
    let root = tempfile::tempdir().unwrap();
    let mut wardrobe = filled(root.path());
    let mine = ["garments/scarf/notes.txt", "bodies/anna/notes.txt", "out/shards/data/deep/data"]
        .map(|file| root.path().join(file));
    for file in &mine {
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, "mine").unwrap();
    }
    let (mesh, slim) = (garment(Garment::Skirt, &COARSE), root.path().join("files/slim.ply"));
    let body = wardrobe.body_info("slim").unwrap().reference();
    let scarf = wardrobe.add(&parts("scarf", &mesh, &body, &Provenance::default())).map(drop);
    let anna = wardrobe.add_body(&NewBody::new("anna", &slim)).map(drop);
    for fault in [scarf, anna] {
        assert!(matches!(fault, Err(WardrobeError::InTheWay { .. })), "{fault:?}");
    }
    // A part of a batch, with a file of the user's, too.
    let dresser = Dresser::new(&wardrobe, Default::default());
    let run = |out: &Path| {
        let params = MatchParams { picture_height: 0, ..Default::default() };
        let list = [on("slim", &["tshirt"])];
        batch::run(out, &dresser, &list, &params, &BatchParams::default(), &keep_on).unwrap()
    };
    let out = root.path().join("out");
    let shard = batch::shard_folder(&out, "1-of-1");
    run(&shard).unwrap();
    fs::write(shard.join("notes.txt"), "mine").unwrap();
    let summary = run(&out).unwrap();
    assert!(out.join("results").join(&summary.entries[0].folder).join("tshirt.ply").exists());
    assert_eq!(atomic::names(&shard).unwrap(), [""; 0], "the results are those of the whole");
    for file in mine.iter().chain([&shard.join("notes.txt")]) {
        assert_eq!(fs::read(file).unwrap(), b"mine");
    }
}

#[test]
fn seams_are_no_openings_of_a_garment() {
    let root = tempfile::tempdir().unwrap();
    let mut wardrobe = filled(root.path());
    let skirt = garment(Garment::Skirt, &COARSE);
    // Each triangle with vertices of its own.
    let all = skirt.triangles().as_flattened().iter();
    let corners: Vec<Point> = all.map(|v| skirt.vertices()[*v as usize]).collect();
    let own = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let soup = TriMesh::new(corners, own).unwrap();
    let body = wardrobe.body_info("slim").unwrap().reference();
    wardrobe.add(&parts("soup", &soup, &body, &Provenance::default())).unwrap();
    let openings = |name: &str| wardrobe.garments()[name].openings.len();
    assert_eq!((openings("soup"), openings("skirt")), (2, 2));
}

#[test]
fn a_body_that_is_added_again_keeps_what_it_has() {
    use if_body::{Joint, Skeleton};
    let root = tempfile::tempdir().unwrap();
    let mut wardrobe = filled(root.path());
    let (slim, large) = (root.path().join("files/slim.ply"), root.path().join("files/large.ply"));
    let skeleton = root.path().join("files/skeleton.json");
    let joint = Joint {
        name: "hips".into(),
        parent: None,
        head: Point::origin(),
        tail: Point::new(0.0, 0.2, 0.0),
    };
    Skeleton::new(vec![joint]).unwrap().write(fs::File::create(&skeleton).unwrap()).unwrap();
    let new = NewBody::new("other", &slim);
    let with_template = NewBody { template: Some(&slim), ..new };
    let with_skeleton = NewBody { skeleton: Some(&skeleton), ..new };
    for new in [with_template, with_skeleton, new] {
        assert_eq!(wardrobe.add_body_once(&new).unwrap().name, "slim");
    }
    let info = wardrobe.body_info("slim").unwrap();
    assert!(info.template.is_some() && info.skeleton.is_some());
    assert!(wardrobe.body("slim").unwrap().template.is_some());
    assert_eq!(wardrobe.bodies().len(), 2);
    // A template of somebody else, and a body.json that names a file elsewhere.
    let mesh = wardrobe.body("large").unwrap().mesh;
    let taller = mesh.vertices().iter().map(|p| Point::new(p.x, 1.3 * p.y, p.z)).collect();
    let (path, taller) =
        (root.path().join("files/taller.ply"), mesh.with_vertices(taller).unwrap());
    write_path(&PlyMesh::new(taller.clone()), taller.vertices(), &WriteParams::default(), &path)
        .unwrap();
    let wrong = NewBody { template: Some(&path), ..NewBody::new("another", &large) };
    let error = wardrobe.add_body(&wrong).unwrap_err();
    assert!(
        matches!(error, WardrobeError::Template { centimetres, .. } if centimetres > 7.0),
        "{error}"
    );
    let info = root.path().join("bodies/slim/body.json");
    let text = fs::read_to_string(&info).unwrap();
    fs::write(&info, text.replacen("body.ply", "../large/body.ply", 1)).unwrap();
    let error = Wardrobe::open(root.path()).unwrap().body("slim").map(|_| ()).unwrap_err();
    assert!(error.to_string().contains("`../large/body.ply` is not the name of a file"), "{error}");
}

#[test]
fn files_in_centimetres_are_stored_in_metres() {
    use if_body::{Joint, Skeleton};
    use if_outfit::outfit::OutfitError;
    let root = tempfile::tempdir().unwrap();
    let mut wardrobe = filled(root.path());
    let (body, skeleton) = (root.path().join("files/cm.ply"), root.path().join("files/cm.json"));
    let metres = wardrobe.body("slim").unwrap().mesh;
    let large = metres.scaled(100.0).unwrap();
    // Properties come along.
    let mut ply = PlyMesh::new(large.clone());
    ply.comments.push("in centimetres".into());
    write_path(&ply, large.vertices(), &WriteParams::default(), &body).unwrap();
    let joint = Joint {
        name: "hips".into(),
        parent: None,
        head: Point::new(0.0, 100.0, 0.0),
        tail: Point::new(0.0, 120.0, 0.0),
    };
    Skeleton::new(vec![joint]).unwrap().write(fs::File::create(&skeleton).unwrap()).unwrap();
    let new =
        NewBody { template: Some(&body), skeleton: Some(&skeleton), ..NewBody::new("cm", &body) };
    let error = wardrobe.add_body(&new).unwrap_err();
    assert!(
        matches!(
            &error,
            WardrobeError::Body { source: OutfitError::Units { scale: 0.01, .. }, .. }
        ),
        "{error}"
    );
    let added = wardrobe.add_body(&NewBody { scale: 0.01, ..new }).unwrap();
    // What is there already is known again, in units of its own.
    assert_eq!(
        wardrobe.add_body_once(&NewBody { scale: 0.01, ..NewBody::new("other", &body) }).unwrap(),
        added
    );
    let stored = wardrobe.body("cm").unwrap();
    assert_eq!(stored.skeleton.unwrap().joints()[0].tail.y, 1.2);
    for mesh in [stored.mesh, stored.template.unwrap().0] {
        let off = mesh
            .vertices()
            .iter()
            .zip(metres.vertices())
            .map(|(p, q)| (p - q).amax())
            .fold(0.0, f64::max);
        assert!(mesh.triangles() == metres.triangles() && off < 1e-6, "{off}");
    }
    assert!(
        String::from_utf8_lossy(&wardrobe.body_file("cm").unwrap())
            .contains("comment in centimetres")
    );
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            wardrobe.add_body(&NewBody { scale, ..new }),
            Err(WardrobeError::Parameter(e)) if e.name == "scale"
        ));
    }
    assert!(matches!(
        wardrobe.add_body(&NewBody { scale: 1e307, ..new }),
        Err(WardrobeError::Scale { .. })
    ));
    // A garment in other units than its body is refused too.
    let shirt = garment(Garment::Tshirt, &COARSE).scaled(100.0).unwrap();
    let error = wardrobe
        .add(&parts("shirt", &shirt, &added, &Provenance::default()))
        .map(drop)
        .unwrap_err();
    assert!(matches!(error, WardrobeError::Misfit(OutfitError::TooLarge { .. })), "{error}");
    assert!(!root.path().join("garments/shirt").exists());
    // No outfit could have both.
    let shirt = garment(Garment::Tshirt, &COARSE);
    let twin = wardrobe.add(&parts(&added.name, &shirt, &added, &Provenance::default()));
    let error = twin.map(drop).unwrap_err();
    assert!(matches!(error, WardrobeError::Misfit(OutfitError::DuplicateName { .. })), "{error}");
}

#[test]
fn a_folder_that_no_combination_can_name_is_a_fault() {
    let root = tempfile::tempdir().unwrap();
    filled(root.path());
    for part in ["bodies/slim", "garments/coat"] {
        let from = root.path().join(part);
        let to = root.path().join(format!("{part} copy"));
        fs::create_dir(&to).unwrap();
        for file in fs::read_dir(&from).unwrap() {
            let file = file.unwrap();
            fs::copy(file.path(), to.join(file.file_name())).unwrap();
        }
    }
    fs::rename(root.path().join("garments/coat"), root.path().join("garments/ulster")).unwrap();
    let wardrobe = Wardrobe::open(root.path()).unwrap();
    let faults: Vec<_> = wardrobe.faults().iter().map(|f| (f.part, f.name.as_str())).collect();
    assert_eq!(faults, [(Part::Body, "slim copy"), (Part::Garment, "coat copy")]);
    assert_eq!(wardrobe.garment_info("ulster").unwrap().name, "ulster");
}

#[test]
fn what_failed_for_want_of_a_file_is_tried_again() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let (out, list) = (root.path().join("out"), [on("slim", &["tshirt"])]);
    let params = MatchParams { picture_height: 0, ..Default::default() };
    let run = || {
        let dresser = Dresser::new(&wardrobe, Default::default());
        batch::run(
            &out,
            &dresser,
            &list,
            &params,
            &BatchParams { at_once: 8, again: false },
            &keep_on,
        )
        .unwrap()
        .unwrap()
    };
    let (file, away) =
        (root.path().join("garments/tshirt/garment.ply"), root.path().join("away.ply"));
    fs::rename(&file, &away).unwrap();
    let summary = run();
    assert_eq!(
        (summary.failed, summary.entries[0].error.as_ref().unwrap().kind.as_str()),
        (1, "asset")
    );
    fs::rename(&away, &file).unwrap();
    assert_eq!(run().clean, 1);
}

#[test]
fn a_body_that_would_yield_is_refused() {
    // Its result would be proven on a body that nobody gets.
    let mut params = MatchParams::default();
    params.resolve.goal.pinch = Pinch::Yield;
    assert_eq!(params.validate().unwrap_err().name, "resolve.goal.pinch");
}

#[test]
fn pictures_that_cannot_be_drawn_are_refused_before_the_work() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let dresser = Dresser::new(&wardrobe, Default::default());
    let never = |_: &batch::Event| -> ControlFlow<()> { panic!("nothing is begun") };
    for height in [1, 15, 8193, u32::MAX] {
        let params = MatchParams { picture_height: height, ..Default::default() };
        let ran = batch::run(
            &root.path().join("out"),
            &dresser,
            &[on("slim", &["tshirt"])],
            &params,
            &BatchParams::default(),
            &never,
        );
        assert!(matches!(ran, Err(WardrobeError::Parameter(e)) if e.value == f64::from(height)));
    }
}

#[test]
fn a_table_holds_any_name() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let dresser = Dresser::new(&wardrobe, Default::default());
    let out = root.path().join("out");
    let list = [on("slim", &["a,b\nc \"d\""])];
    let summary = batch::run(
        &out,
        &dresser,
        &list,
        &MatchParams::default(),
        &BatchParams::default(),
        &keep_on,
    )
    .unwrap()
    .unwrap();
    assert_eq!(summary.failed, 1);
    let csv = fs::read_to_string(out.join("summary.csv")).unwrap();
    assert!(csv.contains("\n\"a,b\nc \"\"d\"\" on slim\",failed,"), "{csv}");
}

#[test]
fn garments_of_an_unknown_body_and_bodies_without_an_inside_are_refused() {
    let root = tempfile::tempdir().unwrap();
    let mut wardrobe = filled(root.path());
    let shirt = garment(Garment::Tshirt, &COARSE);
    let stranger = BodyRef { name: "stranger".into(), sha256: "1".repeat(64) };
    let error = wardrobe
        .add(&parts("shirt", &shirt, &stranger, &Provenance::default()))
        .map(drop)
        .unwrap_err();
    assert!(matches!(error, WardrobeError::ForeignBody { .. }), "{error}");
    let path = root.path().join("open.ply");
    write_path(&PlyMesh::new(shirt.clone()), shirt.vertices(), &WriteParams::default(), &path)
        .unwrap();
    let error = wardrobe.add_body(&NewBody::new("open", &path)).unwrap_err();
    assert!(
        matches!(
            error,
            WardrobeError::Body { source: if_outfit::outfit::OutfitError::NoInside { .. }, .. }
        ),
        "{error}"
    );
    assert!(!root.path().join("bodies/open").exists());
}

#[test]
fn a_garment_of_one_body_is_worn_on_the_other() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let dresser = Dresser::new(&wardrobe, Default::default());
    let dressed = dresser.dress(&on("large", &["tshirt", "jacket"])).unwrap();
    assert_eq!(dressed.garments[0].report.method, Method::Topology);
    assert!(
        dressed.garments[1].mesh.aabb().size().x
            > garment(Garment::Jacket, &COARSE).aabb().size().x * 1.03
    );
    let own = dresser.dress(&on("slim", &["tshirt"])).unwrap();
    assert_eq!(
        (own.garments[0].report.method, own.garments[0].report.moved.max),
        (Method::Same, 0.0)
    );
    assert!(matches!(dresser.dress(&on("slim", &[])), Err(WardrobeError::NoGarments { .. })));
    assert!(matches!(
        dresser.dress(&on("slim", &["coat", "coat"])),
        Err(WardrobeError::Twice { .. })
    ));
}

/// Joints are numbers in the skeleton of a garment's own body.
#[test]
fn weights_of_a_garment_follow_the_skeleton_of_the_body_that_wears_it() {
    let root = tempfile::tempdir().unwrap();
    let mut wardrobe = Wardrobe::open(&root.path().join("wardrobe")).unwrap();
    let (mesh, shirt) = (body(&COARSE), garment(Garment::Tshirt, &COARSE));
    let own = rig::skeleton();
    let swapped = {
        // Both hang from the same joint.
        let mut joints = own.joints().to_vec();
        let [left, right] =
            ["left_thigh", "right_thigh"].map(|name| own.names().position(|n| n == name).unwrap());
        assert_eq!(joints[left].parent, joints[right].parent);
        let name = std::mem::take(&mut joints[left].name);
        joints[left].name = std::mem::replace(&mut joints[right].name, name);
        Skeleton::new(joints).unwrap()
    };
    let strange = {
        let renamed =
            own.joints().iter().map(|j| Joint { name: format!("x{}", j.name), ..j.clone() });
        Skeleton::new(renamed.collect()).unwrap()
    };
    let mut first = None;
    for (name, skeleton) in [("own", &own), ("swapped", &swapped), ("strange", &strange)] {
        let [ply, json] = ["ply", "json"].map(|end| root.path().join(format!("{name}.{end}")));
        write_path(&PlyMesh::new(mesh.clone()), mesh.vertices(), &WriteParams::default(), &ply)
            .unwrap();
        skeleton.write(fs::File::create(&json).unwrap()).unwrap();
        let new = NewBody { skeleton: Some(&json), ..NewBody::new(name, &ply) };
        let added = wardrobe.add_body(&new).unwrap();
        first.get_or_insert(added);
    }
    let n = shirt.vertices().len();
    let leg = own.names().position(|n| n == "left_thigh").unwrap() as u16;
    let weights = vec![[1.0, 0.0, 0.0, 0.0]; n];
    let skin = SkinWeights::new(vec![[leg, 0, 0, 0]; n], weights, own.len()).unwrap();
    let provenance = Provenance::default();
    let given = parts("shirt", &shirt, first.as_ref().unwrap(), &provenance);
    let ply = PlyMesh { vertex_properties: skin.to_properties(), ..PlyMesh::new(shirt.clone()) };
    let beside = Beside::of(&ply);
    wardrobe.add(&Parts { skin: Some(&skin), beside: Some(&beside), ..given }).unwrap();
    let dresser = Dresser::new(&wardrobe, Default::default());
    let asset = |body: &str| dresser.aligned("shirt", body).unwrap().asset.clone();
    assert_eq!(asset("own").skin, Some(skin));
    let moved = asset("swapped").skin.unwrap();
    assert_eq!(swapped.joints()[usize::from(moved.joints()[0][0])].name, "left_thigh");
    let without = asset("strange");
    assert_eq!(without.skin, None);
    assert_eq!(without.beside.file(shirt, None).vertex_properties, vec![]);
}

#[test]
fn a_batch_is_cached_by_content_and_one_failure_does_not_stop_it() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let dresser = Dresser::new(&wardrobe, Default::default());
    let list = [
        on("slim", &["tshirt", "jacket"]),
        on("slim", &["hat"]),
        on("large", &["tshirt"]),
        on("slim", &["coat", "coat"]),
    ];
    let params = MatchParams { picture_height: 64, ..Default::default() };
    let out = root.path().join("out");
    let run = |out: &Path, params: &MatchParams, at_once| {
        let count = AtomicUsize::new(0);
        let watch = |event: &batch::Event| {
            if let batch::Event::Done(_, _, false) = event {
                count.fetch_add(1, Ordering::SeqCst);
            }
            keep_on(event)
        };
        let batch = BatchParams { at_once, again: false };
        (
            batch::run(out, &dresser, &list, params, &batch, &watch).unwrap().unwrap(),
            count.into_inner(),
        )
    };
    let (summary, made) = run(&out, &params, 1);
    assert_eq!((summary.clean, summary.remaining, summary.failed, made), (2, 0, 2, 4));
    let kinds: Vec<_> =
        summary.entries.iter().map(|e| e.error.as_ref().map(|f| f.kind.as_str())).collect();
    assert_eq!(kinds, [None, Some("no_garment"), None, Some("combination")]);
    assert!(summary.entries[0].pairs[0] > 0 && summary.entries[0].pairs[1] == 0);
    let first = files(&out);
    for name in [
        "result.json",
        "tshirt.ply",
        "jacket.ply",
        "before.png",
        "after.png",
        "timings.json",
        "report.html",
    ] {
        assert!(out.join("results").join(&summary.entries[0].folder).join(name).exists(), "{name}");
    }
    // Nothing is done twice: only what has no folder is looked at again.
    assert_eq!(run(&out, &params, 1), (summary.clone(), 1));
    assert!(files(&out) == first);
    // A damaged output is made again, and two at once give the same bytes in another folder.
    fs::write(out.join("results").join(&summary.entries[0].folder).join("tshirt.ply"), "half")
        .unwrap();
    assert_eq!(run(&out, &params, 1).1, 2);
    assert!(files(&out) == first);
    let other = root.path().join("other");
    assert_eq!(run(&other, &params, 3).1, 4);
    let strip = |files: Vec<(PathBuf, Vec<u8>)>, root: &Path| -> Vec<(PathBuf, Vec<u8>)> {
        files.into_iter().map(|(p, b)| (p.strip_prefix(root).unwrap().to_owned(), b)).collect()
    };
    assert!(strip(files(&other), &other) == strip(first, &out));
    // Other parameters are another result.
    let mut changed = params.clone();
    changed.resolve.goal.clearance = 1e-3;
    assert_eq!(run(&out, &changed, 1).1, 4);
}

#[test]
fn a_cancelled_batch_leaves_whole_results_only() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let dresser = Dresser::new(&wardrobe, Default::default());
    let list = [on("slim", &["tshirt"]), on("slim", &["tshirt", "jacket"])];
    let params = MatchParams { picture_height: 0, ..Default::default() };
    let out = root.path().join("out");
    let stop = |event: &batch::Event| match event {
        batch::Event::Working(1, _) => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    assert_eq!(
        batch::run(&out, &dresser, &list, &params, &BatchParams::default(), &stop).unwrap(),
        None
    );
    assert_eq!(atomic::names(&out.join("results")).unwrap().len(), 1);
    assert!(!out.join("summary.json").exists());
    assert_eq!(batch::done(&out, &dresser, &list, &params).unwrap(), 1);
    let summary = batch::run(&out, &dresser, &list, &params, &BatchParams::default(), &keep_on)
        .unwrap()
        .unwrap();
    assert_eq!((summary.clean, summary.entries[1].state), (2, State::Clean));
}

#[test]
fn the_combination_at_which_a_batch_was_killed_comes_last() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let dresser = Dresser::new(&wardrobe, Default::default());
    let list = [on("slim", &["coat"]), on("slim", &["tshirt"])];
    let params = MatchParams { picture_height: 0, meshes: false, ..Default::default() };
    let out = root.path().join("out");
    std::mem::forget(super::begun::Begun::mark(&out, &list[0])); // as a killed process leaves it
    let done = std::sync::Mutex::new(Vec::new());
    let watch = |event: &batch::Event| {
        if let batch::Event::Done(index, ..) = event {
            done.lock().unwrap().push(*index);
        }
        keep_on(event)
    };
    let run = || {
        batch::run(&out, &dresser, &list, &params, &BatchParams::default(), &watch).unwrap();
        std::mem::take(&mut *done.lock().unwrap())
    };
    assert_eq!(run(), [1, 0]);
    assert_eq!(run(), [0, 1]);
}

#[test]
fn another_alignment_is_another_request() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let params = MatchParams { picture_height: 0, ..Default::default() };
    let (out, combination) = (root.path().join("out"), on("slim", &["tshirt"]));
    let matched = |align: AlignParams| {
        let dresser = Dresser::new(&wardrobe, align);
        run_into_folder(&out, &dresser, &combination, &params, false, &mut Silent)
    };
    let default = AlignParams::default();
    let other = AlignParams { neighbours: 8, ..default };
    let (first, placed) = matched(default).unwrap();
    assert_eq!((placed, first.request.align), (Placed::Written, default));
    assert_eq!(matched(default).unwrap().1, Placed::Before);
    let (second, placed) = matched(other).unwrap();
    assert_eq!((placed, second.request.align), (Placed::Written, other));
    assert_ne!(first.key, second.key);
    let error = matched(AlignParams { growth: -1.0, ..default }).unwrap_err();
    assert!(matches!(error, WardrobeError::Parameter(e) if e.name == "align.growth"));
}

#[test]
fn what_a_person_should_know_of_a_result_is_noted() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let dresser = Dresser::new(&wardrobe, Default::default());
    let params = MatchParams { picture_height: 0, ..Default::default() };
    let worn = on("large", &["tshirt"]);
    let mut result = matching::run(&dresser, &worn, &params, &mut Silent).unwrap().result;
    assert_eq!((result.notes(), result.turned.clone()), (vec![], vec![None]));
    assert_eq!(result.own_pairs(), [0, 0]);
    assert_eq!(result.cleanness(), Some(if_outfit::Cleanness::Everywhere));
    result.alignments[0].own_pairs = 2;
    let note = |change: &dyn Fn(&mut matching::MatchResult)| {
        let mut changed = result.clone();
        change(&mut changed);
        (changed.notes().join("\n"), changed.own_pairs())
    };
    let (text, _) = note(&|r| r.alignments[0].strain.rms = 0.31);
    assert!(text.contains("is it made for another size?"), "{text}");
    let (text, _) = note(&|r| r.alignments[0].method = Method::Similarity);
    assert!(text.contains("could not be registered") && text.contains("--template"), "{text}");
    let bone = TurnedBone { bone: "left_thigh".into(), degrees: 39.6 };
    let (text, _) = note(&|r| {
        r.alignments[0].strain.rms = 0.31;
        r.turned = vec![Some(bone.clone())];
    });
    assert!(text.contains("`left_thigh` is turned by 40°") && !text.contains("size"), "{text}");
    // As many pairs as at rest are none that anything has made.
    let left = |left: usize| {
        move |r: &mut matching::MatchResult| {
            r.report.as_mut().unwrap().layers[0].own_pairs.after = left;
        }
    };
    assert_eq!(note(&left(2)), (String::new(), [2, 2]));
    let (text, pairs) = note(&left(3));
    assert!(text.contains("meets itself in 3 pairs of triangles, at rest in 2"), "{text}");
    assert_eq!(pairs, [2, 3]);
}

#[test]
fn results_do_not_lie_among_bodies_and_garments() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let dresser = Dresser::new(&wardrobe, Default::default());
    let params = MatchParams { picture_height: 0, ..Default::default() };
    let worn = on("slim", &["tshirt"]);
    for inside in ["garments/look", "bodies/../garments", "clothed/a/b"] {
        let out = root.path().join(inside);
        fs::create_dir_all(root.path().join("clothed")).unwrap();
        let is_refused = |error| matches!(error, WardrobeError::InTheWay { .. });
        let one = run_into_folder(&out, &dresser, &worn, &params, false, &mut Silent);
        assert!(is_refused(one.unwrap_err()), "{inside}");
        let batch = BatchParams { at_once: 1, again: false };
        let all =
            batch::run(&out, &dresser, std::slice::from_ref(&worn), &params, &batch, &keep_on);
        assert!(is_refused(all.unwrap_err()), "{inside}");
    }
    assert!(!root.path().join("garments/look").exists());
    let out = root.path().join("look");
    run_into_folder(&out, &dresser, &worn, &params, false, &mut Silent).unwrap();
}

#[test]
fn random_combinations_are_wearable_different_and_the_same_for_a_seed() {
    let root = tempfile::tempdir().unwrap();
    let wardrobe = filled(root.path());
    let params = RandomParams { count: 12, ..Default::default() };
    let drawn = random(&wardrobe, &params).unwrap();
    assert_eq!(drawn, random(&wardrobe, &params).unwrap());
    assert_ne!(drawn, random(&wardrobe, &RandomParams { seed: 2, ..params.clone() }).unwrap());
    for (k, c) in drawn.iter().enumerate() {
        assert!((2..=4).contains(&c.garments.len()) && !drawn[..k].contains(c), "{c}");
        assert_eq!(c.body, ["large", "slim"][k % 2]);
        let at = |name: &str| c.garments.iter().position(|g| g == name);
        assert!(at("coat").is_none_or(|k| k + 1 == c.garments.len()), "{c}");
    }
    let any = random(&wardrobe, &RandomParams { count: 100, order: Order::Any, ..params.clone() })
        .unwrap();
    assert!(any.iter().any(|c| c.garments[0] == "coat"));
    assert!(matches!(
        random(&wardrobe, &RandomParams { count: 5000, ..params.clone() }),
        Err(WardrobeError::TooFew { .. })
    ));
    let error = random(&wardrobe, &RandomParams { count: 1_000_001, ..params.clone() });
    assert!(matches!(error, Err(WardrobeError::Parameter(e)) if e.name == "count"));
    assert!(matches!(
        random(&wardrobe, &RandomParams { least: 3, most: 2, ..params.clone() }),
        Err(WardrobeError::Sizes { .. })
    ));
    assert!(random(&wardrobe, &RandomParams { bodies: vec!["nobody".into()], ..params }).is_err());
}
