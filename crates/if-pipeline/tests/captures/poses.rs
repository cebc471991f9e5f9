//! Poses with errors, as estimators give them, are refined by the images of the project's own
//! capture.

#![allow(clippy::unwrap_used)] // also in what the tests share

use if_body::mannequin::{Garment, MannequinParams, rig};
use if_body::{Pose, Skeleton, TemplateBody};
use if_core::closest::ClosestPoint;
use if_core::math::{Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::index::Bvh;
use if_mesh::ply;
use if_pipeline::capture::synth::{BODY, SynthParams, TRUTH, synth};
use if_pipeline::capture::{Capture, PoseSigma};
use if_pipeline::reconstruct::{
    PoseParams, QualityReport, SurfaceParams, fit_surface, refine_poses,
};
use std::path::Path;

/// Stated error of the poses.
const SIGMA: PoseSigma = PoseSigma { degrees: 3.0, translation: 0.009 };

/// A capture with exact poses, and the same with errors.
fn scene(folder: &Path, frames: usize, size: usize) -> (Capture, Capture) {
    let params = SynthParams {
        garments: vec![Garment::Trousers, Garment::Tshirt],
        frames,
        size,
        pose_noise: SIGMA,
        mannequin: MannequinParams { resolution: 0.7, overlap: 0.0 },
        ..SynthParams::default()
    };
    synth(&params, folder, &mut Silent).unwrap();
    let given = Capture::open(folder).unwrap();
    assert_eq!(given.pose_sigma(), Some(SIGMA));
    let truth = given.with_poses((0..frames).map(|k| rig::turning_pose(k, frames)).collect());
    (truth.unwrap(), given)
}

fn poses(capture: &Capture) -> Vec<Pose> {
    (0..capture.len()).map(|k| capture.pose(k).clone()).collect()
}

/// Mean distance of joints between poses, in millimetres.
fn joints_off(skeleton: &Skeleton, truth: &Capture, poses: &[Pose]) -> Real {
    let mut sum = 0.0;
    for (frame, pose) in poses.iter().enumerate() {
        let a = skeleton.frames(truth.pose(frame)).unwrap();
        let b = skeleton.frames(pose).unwrap();
        let off = a.iter().zip(&b).map(|(a, b)| a.translation.vector - b.translation.vector);
        sum += off.map(|d| d.norm()).sum::<Real>() / (a.len() * poses.len()) as Real;
    }
    1e3 * sum
}

/// Mean distance of the true clothes from a surface, in millimetres.
fn surface_off(folder: &Path, mesh: &TriMesh) -> Real {
    let tree = Bvh::new(mesh);
    let (mut sum, mut count) = (0.0, 0);
    for name in ["trousers", "tshirt"] {
        let truth = ply::read_path(&folder.join(TRUTH).join(format!("{name}.ply"))).unwrap();
        for p in truth.mesh.vertices().iter().step_by(3) {
            sum += 1e3 * (tree.closest(p, Real::INFINITY).unwrap().point - p).norm();
            count += 1;
        }
    }
    sum / Real::from(count)
}

#[test]
fn refined_poses_and_their_surface_are_half_as_far_from_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("capture");
    let (truth, given) = scene(&path, 13, 96);
    let blank = folder.path().join("blank");
    write_blank(&blank, 96);
    std::fs::copy(blank.join("mask/0000.png"), path.join("mask_noisy/0007.png")).unwrap();

    let template = TemplateBody::read(&path.join(BODY)).unwrap();
    // One frame shows nobody: its pose follows from its neighbours'.
    let read = SurfaceParams::default();
    let params = PoseParams { rounds: 2, ..PoseParams::of(SIGMA) };
    let refined = refine_poses(&given, &template, &read, &params, &mut Silent).unwrap();
    assert_eq!(refined.report.unused, [7]);
    let off = |poses: &[Pose]| joints_off(&template.skeleton, &truth, poses);
    let (before, after) = (off(&poses(&given)), off(&refined.poses));
    assert!(after < 0.5 * before, "joints off by {before} mm, refined {after} mm");

    let fitted = |capture: &Capture| {
        let surface = fit_surface(capture, &template, &read, None, &mut Silent).unwrap();
        (surface_off(&path, &surface.mesh), surface.report.quality)
    };
    let (before, doubtful) = fitted(&given);
    let (after, fine) = fitted(&given.with_poses(refined.poses.clone()).unwrap());
    assert!(after < 0.6 * before, "clothes off by {before} mm, refined {after} mm");
    // The comparison with the images agrees.
    let worst = |q: &QualityReport| q.frames.iter().map(|f| f.residual.silhouette_mm).sum::<Real>();
    assert!(worst(&fine) < 0.6 * worst(&doubtful), "{} {}", worst(&fine), worst(&doubtful));
    assert!(fine.doubts.len() < doubtful.doubts.len(), "{fine:?} {doubtful:?}");
    let held_out = refined.report.held_out.unwrap();
    // The surface of two rounds is rough.
    assert!(
        (1.0..3.0).contains(&(held_out.silhouette_mm / fine.all.silhouette_mm)),
        "{held_out:?}"
    );
}

#[test]
fn refined_poses_are_the_same_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("capture");
    let (_, given) = scene(&path, 6, 64);
    let template = TemplateBody::read(&path.join(BODY)).unwrap();
    let params = PoseParams { rounds: 1, ..PoseParams::of(SIGMA) };
    let refine = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let read = SurfaceParams::default();
        let refined =
            pool.install(|| refine_poses(&given, &template, &read, &params, &mut Silent).unwrap());
        (refined.poses, refined.report)
    };
    assert_eq!(refine(1), refine(3));
}

#[test]
fn a_camera_that_is_turned_or_too_long_is_corrected_and_an_exact_one_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("capture");
    let (_, exact) = scene(&path, 8, 128);
    let template = TemplateBody::read(&path.join(BODY)).unwrap();
    let read = SurfaceParams::default();
    let refine = |capture: &Capture, camera_degrees| {
        let params = PoseParams { rounds: 1, camera_degrees, ..PoseParams::of(SIGMA) };
        refine_poses(capture, &template, &read, &params, &mut Silent).unwrap()
    };
    assert_eq!(&refine(&exact, 1.0).camera, exact.camera());

    let tilt = nalgebra::UnitQuaternion::new(Vector::new(1.5, -0.5, 0.8).map(Real::to_radians));
    let off = exact.with_camera(exact.camera().turned(&tilt));
    let left = refine(&off, 0.0);
    assert_eq!((&left.camera, left.report.camera_degrees), (off.camera(), 0.0));
    let found = refine(&off, 1.0);
    assert!((found.report.camera_degrees - tilt.angle().to_degrees()).abs() < 0.5);
    // What is left of the turn moves the person, 3 m away, by less than 1 cm.
    let rest = found.camera.rotation() * exact.camera().rotation().transpose();
    let rest = nalgebra::Rotation3::from_matrix_unchecked(rest).angle();
    assert!(rest < 0.003, "{rest} rad of {} are left", tilt.angle());
    assert_eq!(found.report.camera_zoom, 1.0);
    let silhouettes = [&left, &found].map(|r| r.report.rounds[0].silhouette_mm);
    assert!(silhouettes[1] < 0.8 * silhouettes[0], "{silhouettes:?}");
    let long = refine(&exact.with_camera(exact.camera().zoomed(1.05).unwrap()), 1.0);
    assert!((1.05 * long.report.camera_zoom - 1.0).abs() < 0.02, "{}", long.report.camera_zoom);
}

/// A capture of one frame without a person, for its mask.
fn write_blank(folder: &Path, size: usize) {
    use if_pipeline::capture::{CaptureWriter, FramePictures, Subject};
    let camera = if_mesh::camera::Camera::looking_at(
        (size, size),
        &if_core::math::Point::new(0.0, 1.0, 3.0),
        &if_core::math::Point::new(0.0, 1.0, 0.0),
        &Vector::y(),
        0.5,
    )
    .unwrap();
    let subject = Subject {
        pose_sigma: Some(PoseSigma::EXACT),
        camera_sigma_degrees: Some(0.0),
        camera,
        garments: vec!["top".into()],
        joints: vec!["root".into()],
        generator: "test".into(),
    };
    let mut writer = CaptureWriter::create(folder, &subject).unwrap();
    let n = size * size;
    let pictures = FramePictures {
        mask: &vec![false; n],
        labels: &vec![0; n],
        normals: &vec![[0.0; 3]; n],
        noisy_mask: None,
        noisy_labels: None,
    };
    writer.push(&Pose::rest(1), &pictures).unwrap();
    writer.finish().unwrap();
}
