use super::*;
use if_body::Joint;
use if_core::math::{Point, Vector};
use nalgebra::UnitQuaternion;
use serde_json::{Value, json};
use std::fs;
use tempfile::TempDir;

const W: usize = 5;
const H: usize = 3;

fn subject() -> Subject {
    let camera = Camera::looking_at(
        (W, H),
        &Point::new(0.0, 1.0, 3.0),
        &Point::new(0.0, 1.0, 0.0),
        &Vector::y(),
        0.5,
    )
    .unwrap();
    let name = |s: &str| s.to_owned();
    Subject {
        pose_sigma: Some(PoseSigma::EXACT),
        camera_sigma_degrees: None,
        camera,
        garments: vec![name("shirt")],
        joints: vec![name("hips"), name("head")],
        generator: name("a test"),
    }
}

/// What frame `k` shows: all different.
fn frame(k: usize) -> Frame {
    let n = W * H;
    let normal = |i: usize| {
        let v = Vector::new(i as f64, 3.0, -4.0 - k as f64).normalize();
        if (i + k).is_multiple_of(4) { [0.0; 3] } else { [v.x as f32, v.y as f32, v.z as f32] }
    };
    Frame {
        mask: (0..n).map(|i| (i + k).is_multiple_of(3)).collect(),
        labels: (0..n).map(|i| ((i + k) % 3) as u8).collect(),
        normals: (0..n).map(normal).collect(),
    }
}

fn pose(k: usize) -> Pose {
    let turn = UnitQuaternion::from_axis_angle(&Vector::y_axis(), 0.3 * k as f64);
    Pose {
        root_translation: Vector::new(0.0, 0.1 * k as f64, 0.0),
        rotations: vec![turn, UnitQuaternion::identity()],
    }
}

fn write(folder: &Path, frames: usize) {
    let mut writer = CaptureWriter::create(folder, &subject()).unwrap();
    for k in 0..frames {
        let f = frame(k);
        let pictures = FramePictures {
            mask: &f.mask,
            labels: &f.labels,
            normals: &f.normals,
            noisy_mask: None,
            noisy_labels: None,
        };
        writer.push(&pose(k), &pictures).unwrap();
    }
    writer.finish().unwrap();
}

/// A capture of three frames in a folder of its own.
fn captured() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("turn");
    write(&path, 3);
    (folder, path)
}

/// Changes `meta.json`.
fn edit(folder: &Path, change: impl FnOnce(&mut Value)) {
    let path = folder.join("meta.json");
    let mut value: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut value);
    fs::write(path, value.to_string()).unwrap();
}

#[test]
fn a_written_capture_is_read_again() {
    let (parent, path) = captured();
    assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 1, "no temporary folder is left");
    // Some editors put a byte order mark before the text.
    let meta = fs::read(path.join("meta.json")).unwrap();
    fs::write(path.join("meta.json"), [b"\xEF\xBB\xBF", &meta[..]].concat()).unwrap();
    let capture = Capture::open(&path).unwrap();
    assert_eq!((capture.len(), capture.garments()), (3, &["shirt".to_owned()][..]));
    assert_eq!(capture.camera(), &subject().camera);
    for k in 0..3 {
        let (read, wanted) = (capture.frame(k).unwrap(), frame(k));
        assert_eq!((read.mask, read.labels), (wanted.mask, wanted.labels));
        for (a, b) in read.normals.iter().zip(&wanted.normals) {
            let cos: f32 = (0..3).map(|c| a[c] * b[c]).sum();
            // 8 bits are steps of 1/127 in each axis: 0.4°.
            assert!(*b == [0.0; 3] && *a == *b || cos > 0.4f32.to_radians().cos(), "{a:?} {b:?}");
        }
        let angle = capture.pose(k).rotations[0].angle_to(&pose(k).rotations[0]);
        assert!(
            angle < 1e-7 && capture.pose(k).root_translation == pose(k).root_translation,
            "{angle}"
        );
    }
}

#[test]
fn a_dropped_writer_leaves_nothing_and_a_folder_is_not_overwritten() {
    let parent = tempfile::tempdir().unwrap();
    let path = parent.path().join("turn");
    drop(CaptureWriter::create(&path, &subject()).unwrap());
    assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 0);
    let empty = CaptureWriter::create(&path, &subject()).unwrap();
    assert!(matches!(empty.finish(), Err(CaptureError::NoFrames { .. })));
    assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 0);
    write(&path, 1);
    assert!(matches!(CaptureWriter::create(&path, &subject()), Err(CaptureError::InTheWay { .. })));
}

#[test]
fn what_a_killed_writer_left_goes_and_a_running_one_keeps_others_out() {
    let parent = tempfile::tempdir().unwrap();
    let path = parent.path().join("turn");
    let killed = CaptureWriter::create(&path, &subject()).unwrap();
    let half = killed.folder().join("half");
    fs::write(&half, "of a frame").unwrap();
    let other = CaptureWriter::create(&path, &subject());
    assert!(matches!(other, Err(CaptureError::Busy { path: p }) if p == path));
    // As a kill does it: locks are let go, files stay.
    let hidden = half.parent().and_then(std::path::Path::parent).unwrap().to_path_buf();
    fs::rename(&hidden, parent.path().join("kept")).unwrap();
    drop(killed);
    fs::rename(parent.path().join("kept"), &hidden).unwrap();
    assert!(half.exists());
    write(&path, 1);
    assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 1, "the capture alone");
    assert!(!path.join("half").exists() && Capture::open(&path).is_ok());
}

#[test]
fn noisy_images_are_preferred_unless_the_truth_is_requested() {
    let parent = tempfile::tempdir().unwrap();
    let path = parent.path().join("turn");
    let mut writer = CaptureWriter::create(&path, &subject()).unwrap();
    let (clean, noisy) = (frame(0), frame(1));
    let pictures = FramePictures {
        mask: &clean.mask,
        labels: &clean.labels,
        normals: &clean.normals,
        noisy_mask: None,
        noisy_labels: Some(&noisy.labels),
    };
    writer.push(&pose(0), &pictures).unwrap();
    let error =
        writer.push(&pose(0), &FramePictures { noisy_labels: None, ..pictures }).unwrap_err();
    assert!(
        matches!(error, CaptureError::NoisyPicture { frame: 1, what: "label image" }),
        "{error}"
    );
    writer.finish().unwrap();
    assert_eq!(Capture::open(&path).unwrap().frame(0).unwrap().labels, noisy.labels);
    let truth = Capture::open_with(&path, &Channels::truth()).unwrap();
    assert_eq!(truth.frame(0).unwrap().labels, clean.labels);
    edit(&path, |m| m["channels"] = json!({"label": "label"}));
    assert_eq!(Capture::open(&path).unwrap().frame(0).unwrap().labels, clean.labels);
}

#[test]
fn missing_and_invalid_images_are_errors_of_opening() {
    let (_parent, path) = captured();
    let picture = path.join("normal/0001.png");
    let sound = fs::read(&picture).unwrap();
    fs::remove_file(&picture).unwrap();
    let error = Capture::open(&path).unwrap_err();
    assert!(matches!(error, CaptureError::Missing { frame: 1, frames: 3, .. }), "{error}");
    fs::write(&picture, b"no picture").unwrap();
    let error = Capture::open(&path).unwrap_err();
    assert!(
        matches!(error, CaptureError::Picture { frame: 1, source: PictureError::Decode(_), .. }),
        "{error:?}"
    );
    fs::copy(path.join("mask/0001.png"), &picture).unwrap();
    let error = Capture::open(&path).unwrap_err();
    assert!(
        matches!(error, CaptureError::Picture { source: PictureError::Format { .. }, .. }),
        "{error}"
    );
    // The head is sound, and the rest is cut off: found when the frame is read.
    fs::write(&picture, &sound[..sound.len() - 30]).unwrap();
    let capture = Capture::open(&path).unwrap();
    assert!(capture.frame(0).is_ok());
    assert!(matches!(capture.frame(1), Err(CaptureError::Picture { frame: 1, .. })));
    fs::write(&picture, &sound).unwrap();
    edit(&path, |m| m["width"] = json!(6));
    let error = Capture::open(&path).unwrap_err();
    assert!(
        matches!(
            error,
            CaptureError::Picture {
                source: PictureError::Size { width: 5, expected_width: 6, .. },
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn the_error_of_a_label_without_a_name_has_its_pixel() {
    let (_parent, path) = captured();
    let mut labels = frame(2).labels;
    labels[2 * W + 3] = 7;
    picture::write_labels(fs::File::create(path.join("label/0002.png")).unwrap(), (W, H), &labels)
        .unwrap();
    let error = Capture::open(&path).unwrap().frame(2).unwrap_err();
    assert!(
        matches!(error, CaptureError::Label { column: 3, row: 2, label: 7, names: 3, .. }),
        "{error}"
    );
}

/// A change of `meta.json`, and the error it must give.
type Fault = (fn(&mut Value), fn(&CaptureError) -> bool);

#[test]
fn invalid_meta_json_is_an_error_that_says_why() {
    use CaptureError as E;
    let faults: [Fault; 16] = [
        (
            |m| m["pose_sigma_mm"] = json!(-3),
            |e| matches!(e, E::Sigma { key: "pose_sigma_mm", .. }),
        ),
        (|m| m["K"][0][0] = json!(-1.0), |e| matches!(e, E::Camera { .. })),
        (|m| m["R"] = json!([[1, 0, 0], [0, 1, 0], [0, 0, -1]]), |e| matches!(e, E::Camera { .. })),
        (|m| m["t"] = json!([0, 0]), |e| matches!(e, E::Json { .. })),
        (|m| m["K"] = json!("wide"), |e| matches!(e, E::Json { .. })),
        (|m| m["frames"] = json!([]), |e| matches!(e, E::NoFrames { .. })),
        (
            |m| m["frames"][1]["index"] = json!(0),
            |e| matches!(e, E::FrameOrder { frame: 1, index: 0, previous: 0, .. }),
        ),
        (
            |m| m["frames"][1]["rot"] = json!([[1, 0, 0, 0]]),
            |e| matches!(e, E::Pose { frame: 1, .. }),
        ),
        (
            |m| m["frames"][2]["rot"][1] = json!([0, 0, 0, 0]),
            |e| matches!(e, E::Pose { frame: 2, .. }),
        ),
        (
            |m| m["labels"] = json!(["skin", "background", "shirt"]),
            |e| matches!(e, E::LabelName { index: 0, .. }),
        ),
        (|m| m["labels"] = json!(["background"]), |e| matches!(e, E::LabelCount { count: 1, .. })),
        (
            |m| m["layers_inner_to_outer"] = json!(["coat"]),
            |e| matches!(e, E::LayerName { index: 0, .. }),
        ),
        (
            |m| m["layers_inner_to_outer"] = json!([]),
            |e| matches!(e, E::LayerName { index: 0, .. }),
        ),
        (|m| m["channels"] = json!({"label": "../../secret"}), |e| matches!(e, E::BadName { .. })),
        (
            |m| {
                m["labels"] = json!(["background", "skin", "shirt", "shirt"]);
                m["layers_inner_to_outer"] = json!(["shirt", "shirt"]);
            },
            |e| matches!(e, E::SameLayer { first: 0, second: 1, .. }),
        ),
        (
            |m| {
                m["labels"] = json!(["background", "skin", "skin"]);
                m["layers_inner_to_outer"] = json!(["skin"]);
            },
            |e| matches!(e, E::BadName { name, .. } if name == "skin"),
        ),
    ];
    for (k, (change, expected)) in faults.iter().enumerate() {
        let (_parent, path) = captured();
        edit(&path, change);
        let error = Capture::open(&path).unwrap_err();
        assert!(expected(&error), "fault {k}: {error:?}");
        assert!(error.to_string().contains("meta.json"), "fault {k}: {error}");
    }
    let nowhere = Capture::open(Path::new("no/such/folder")).unwrap_err();
    assert!(matches!(nowhere, E::Io { .. }), "{nowhere}");
}

#[test]
fn the_stated_error_of_poses_is_read_and_poses_can_be_replaced() {
    let (_parent, path) = captured();
    let capture = Capture::open(&path).unwrap();
    assert!(capture.pose_sigma().unwrap().is_exact());
    edit(&path, |m| drop(m.as_object_mut().unwrap().remove("pose_sigma_mm")));
    edit(&path, |m| m["pose_sigma_degrees"] = json!(3));
    let sigma = Capture::open(&path).unwrap().pose_sigma();
    assert_eq!(sigma, Some(PoseSigma { degrees: 3.0, translation: 0.0 }));

    edit(&path, |m| drop(m.as_object_mut().unwrap().remove("pose_sigma_degrees")));
    assert_eq!(Capture::open(&path).unwrap().pose_sigma(), None);

    let mut poses: Vec<Pose> = (0..capture.len()).map(|k| capture.pose(k).clone()).collect();
    poses[1].root_translation.x += 1.0;
    let other = capture.with_poses(poses.clone()).unwrap();
    assert!(other.pose(1) == &poses[1] && other.pose(0) == capture.pose(0));
    poses[2].rotations.pop();
    let error = capture.with_poses(poses).unwrap_err();
    assert!(matches!(error, CaptureError::Pose { frame: 2, .. }), "{error}");
}

#[test]
fn a_skeleton_that_does_not_match_is_an_error() {
    let (_parent, path) = captured();
    let capture = Capture::open(&path).unwrap();
    let skeleton = |names: &[&str]| {
        let joint = |(k, n): (usize, &&str)| Joint {
            name: (*n).into(),
            parent: k.checked_sub(1),
            head: Point::origin(),
            tail: Point::origin(),
        };
        Skeleton::new(names.iter().enumerate().map(joint).collect()).unwrap()
    };
    assert!(capture.check_skeleton(&skeleton(&["hips", "head"])).is_ok());
    let count = capture.check_skeleton(&skeleton(&["hips"]));
    assert!(matches!(count, Err(CaptureError::JointCount { capture: 2, skeleton: 1 })));
    let name = capture.check_skeleton(&skeleton(&["hips", "neck"])).unwrap_err();
    assert!(
        matches!(name, CaptureError::JointName { joint: 1, .. })
            && name.to_string().contains("`neck`"),
        "{name}"
    );
}

/// Runs only where the shared data are.
#[test]
fn rendered_sequences_are_read_if_they_exist() {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let Ok(folders) = fs::read_dir(shared.join("sequences")) else { return };
    let skeleton = Skeleton::read_path(&shared.join("body_a/skeleton.json")).unwrap();
    for folder in folders.map(|f| f.unwrap().path()).filter(|p| p.join("meta.json").exists()) {
        let capture = Capture::open(&folder).unwrap();
        capture.check_skeleton(&skeleton).unwrap();
        assert_eq!(capture.len(), 24);
        let last = capture.frame(23).unwrap();
        let truth = Capture::open_with(&folder, &Channels::truth()).unwrap().frame(23).unwrap();
        let wrong = last.labels.iter().zip(&truth.labels).filter(|(a, b)| a != b).count();
        assert!(wrong > 0 && wrong < last.labels.len() / 20, "{wrong} labels differ");
        // A person faces the camera: no normal leads away from it.
        let away = truth.normals.iter().zip(&truth.mask).filter(|(n, m)| **m && n[2] > 0.3).count();
        assert_eq!(away, 0);
    }
}
