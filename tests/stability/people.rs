//! Skeletons, skinning and captures that are broken.

use crate::cases::{Random, Tally, cases, check, finite, share};
use crate::files::mutated;
use if_body::SkinWeights;
use if_body::skinning::{WeightGrid, WeightGridParams, blends, pose_points};
use if_body::{Joint, Pose, Skeleton};
use if_core::math::{Point, Real, Vector};
use if_mesh::camera::Camera;
use if_pipeline::capture::{Capture, CaptureWriter, FramePictures, PoseSigma, Subject};
use std::fs;
use std::path::Path;

/// A number of any kind, now and then none.
fn number(r: &mut Random) -> Real {
    r.pick(&[0.0, 1.0, -1.0, 0.5, 1e-300, 1e3, 1e300, Real::NAN, Real::INFINITY])
}

fn skeleton(r: &mut Random, joints: usize) -> Skeleton {
    let joint = |k: usize, r: &mut Random| Joint {
        name: format!("joint {k}"),
        parent: (k > 0 && r.chance(0.9)).then(|| r.below(k.max(1))),
        head: r.point(1.0),
        tail: r.point(1.0),
    };
    Skeleton::new((0..joints).map(|k| joint(k, r)).collect()).unwrap()
}

fn skinned(count: u32) -> Tally {
    cases("skinning", count, |r| {
        let (joints, n) = (1 + r.below(12), 1 + r.below(40));
        let skeleton = skeleton(r, joints);
        let rough = r.chance(0.3);
        let rotations: Vec<[Real; 4]> = (0..joints)
            .map(|_| {
                let q = [
                    r.between(-1.0, 1.0),
                    r.between(-1.0, 1.0),
                    r.between(-1.0, 1.0),
                    r.between(-1.0, 1.0),
                ];
                let length = q.iter().map(|x| x * x).sum::<Real>().sqrt();
                if rough && r.chance(0.2) {
                    q.map(|x| x * number(r))
                } else {
                    q.map(|x| x / length)
                }
            })
            .collect();
        let unit = rotations
            .iter()
            .all(|q| (q.iter().map(|x| x * x).sum::<Real>().sqrt() - 1.0).abs() < 1e-3);
        let root = if rough { Vector::new(number(r), 0.0, number(r)) } else { r.vector(1.0) };
        // Farther off than the Earth is round, it is refused.
        let root_near = root.iter().all(|x| x.abs() <= 4e7);
        let pose = match Pose::from_quaternions(root, &rotations) {
            Ok(pose) => pose,
            Err(error) => {
                return check(!unit || !root_near, || error.to_string()).map(|()| "no pose");
            }
        };
        let transforms = skeleton.transforms(&pose).map_err(|e| e.to_string())?;
        let short = Pose { rotations: pose.rotations[1..].to_vec(), ..pose.clone() };
        check(skeleton.frames(&short).is_err(), || "a pose of too few joints was taken".into())?;

        let on: Vec<[u16; 4]> =
            (0..n).map(|_| [0; 4].map(|_| r.below(joints + usize::from(rough)) as u16)).collect();
        let weights: Vec<[f32; 4]> = (0..n)
            .map(|_| {
                let w = [r.unit(), r.unit(), r.unit(), r.unit()];
                let sum: Real = w.iter().sum();
                let off = if rough && r.chance(0.05) { number(r) } else { 1.0 };
                w.map(|x| (x / sum * off) as f32)
            })
            .collect();
        let sums = |w: &[f32; 4]| {
            w.iter().all(|x| x.is_finite() && *x >= 0.0)
                && (w.iter().sum::<f32>() - 1.0).abs() < 0.02
        };
        let sound =
            on.iter().flatten().all(|j| usize::from(*j) < joints) && weights.iter().all(sums);
        let skin = match SkinWeights::new(on, weights, joints) {
            Ok(skin) => skin,
            Err(error) => return check(!sound, || error.to_string()).map(|()| "no weights"),
        };
        let rest: Vec<Point> = (0..n).map(|_| r.point(1.0)).collect();
        let maps = blends(&skin, &transforms);
        let posed = pose_points(&rest, &maps);
        // Blends of rotations never stretch; the root may be far away.
        let chain: Real = 4.0 * (joints + 1) as Real + pose.root_translation.norm();
        let near = posed.iter().all(|p| p.coords.norm() <= chain * (1.0 + 1e-9));
        check(near && finite(&posed), || format!("a posed point beyond {chain:e} m"))?;
        // A small grid.
        let params = WeightGridParams {
            cell: 0.5,
            rounds: 2,
            neighbours: 1 + r.below(2 * n),
            ..WeightGridParams::default()
        };
        let grid = WeightGrid::new(&rest, &skin, joints, &params).map_err(|e| e.to_string())?;
        let by_grid = grid.pose(&rest, &transforms);
        let near = by_grid.iter().all(|p| p.coords.norm() <= chain * (1.0 + 1e-6));
        check(near && finite(&by_grid), || format!("a point of the grid beyond {chain:e} m"))?;
        Ok("posed")
    })
}

#[test]
fn skins_are_posed_or_refused() {
    let tally = skinned(1_000);
    assert!(share(&tally, "posed") > 0.5 && share(&tally, "no pose") > 0.05, "{tally:?}");
}

#[test]
#[ignore = "stress"]
fn many_skins_are_posed_or_refused() {
    skinned(50_000);
}

#[test]
fn spoiled_skeletons_are_read_or_refused() {
    let tally = cases("skeleton files", 3_000, |r| {
        let joints = 1 + r.below(4);
        let mut file = Vec::new();
        skeleton(r, joints).write(&mut file).map_err(|e| e.to_string())?;
        let Ok(read) = Skeleton::read(&mutated(r, &file)[..]) else { return Ok("refused") };
        let frames = read.frames(&Pose::rest(read.len())).map_err(|e| e.to_string())?;
        check(frames.len() == read.len(), || "frames".into())?;
        Ok("read")
    });
    assert!(share(&tally, "read") > 0.01 && share(&tally, "refused") > 0.3, "{tally:?}");
}

/// A capture of two frames of 8 × 6 pixels.
fn write_capture(folder: &Path) {
    let (w, h) = (8, 6);
    let camera = Camera::looking_at(
        (w, h),
        &Point::new(0.0, 1.0, 3.0),
        &Point::new(0.0, 1.0, 0.0),
        &Vector::y(),
        0.5,
    )
    .unwrap();
    let subject = Subject {
        pose_sigma: Some(PoseSigma::EXACT),
        camera_sigma_degrees: Some(0.0),
        camera,
        garments: vec!["shirt".into()],
        joints: vec!["hips".into(), "head".into()],
        generator: "a test".into(),
    };
    let mut writer = CaptureWriter::create(folder, &subject).unwrap();
    for k in 0..2 {
        let (mask, labels): (Vec<bool>, Vec<u8>) =
            (0..w * h).map(|i| ((i + k) % 3 > 0, ((i + k) % 3) as u8)).unzip();
        let normals = vec![[0.0, 0.6, -0.8]; w * h];
        let pictures = FramePictures {
            mask: &mask,
            labels: &labels,
            normals: &normals,
            noisy_mask: None,
            noisy_labels: None,
        };
        writer.push(&Pose::rest(2), &pictures).unwrap();
    }
    writer.finish().unwrap();
}

fn files_of(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { found.extend(files_of(&path)) } else { found.push(path) }
    }
    found.sort();
    found
}

fn captures(count: u32) -> Tally {
    let whole = tempfile::tempdir().unwrap();
    let source = whole.path().join("turn");
    write_capture(&source);
    let files = files_of(&source);
    cases("captures", count, |r| {
        let place = tempfile::tempdir().map_err(|e| e.to_string())?;
        let broken = r.below(files.len());
        for (k, path) in files.iter().enumerate() {
            let to = place.path().join(path.strip_prefix(&source).map_err(|e| e.to_string())?);
            fs::create_dir_all(to.parent().unwrap_or(place.path())).map_err(|e| e.to_string())?;
            let bytes = fs::read(path).map_err(|e| e.to_string())?;
            if k != broken {
                fs::write(to, bytes).map_err(|e| e.to_string())?;
            } else if r.chance(0.9) {
                fs::write(to, mutated(r, &bytes)).map_err(|e| e.to_string())?;
            }
        }
        let capture = match Capture::open(place.path()) {
            Ok(capture) => capture,
            Err(error) => {
                return check(!error.to_string().is_empty(), || "an error without words".into())
                    .map(|()| "refused");
            }
        };
        for k in 0..capture.len() {
            let Ok(frame) = capture.frame(k) else { return Ok("a frame refused") };
            let pixels = capture.camera().width() * capture.camera().height();
            let sizes = [frame.mask.len(), frame.labels.len(), frame.normals.len()];
            check(sizes == [pixels; 3], || format!("{sizes:?} for {pixels} pixels"))?;
            check(frame.normals.iter().flatten().all(|x| x.is_finite()), || {
                "a normal is no number".into()
            })?;
        }
        Ok("read")
    })
}

#[test]
fn broken_captures_are_read_or_refused() {
    let tally = captures(300);
    assert!(share(&tally, "refused") > 0.2 && share(&tally, "read") > 0.01, "{tally:?}");
}

#[test]
#[ignore = "stress"]
fn many_broken_captures_are_read_or_refused() {
    captures(20_000);
}
