//! Synthetic captures: the dressed mannequin turns in front of a camera, seen with the errors of a
//! human parser and a normal estimator.

mod estimator;
mod motion;
mod noise;
mod scene;
mod shape;

pub use shape::ShapeNoise;

use super::{CaptureError, CaptureWriter, FramePictures, PoseSigma, Subject, write_poses};
use crate::build::BUILD;
use estimator::{estimated, mistaken};
use if_body::TemplateError;
use if_body::mannequin::{Garment, MannequinParams, rig};
use if_core::math::Real;
use if_core::monitor::{Cancelled, Monitor, Progress};
use if_core::parameter::ParameterError;
use if_mesh::ply::{self, Column, PlyMesh, Property, WriteParams};
use if_mesh::raster::Rasteriser;
use motion::Waves;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use scene::{Scene, camera};
use serde::{Deserialize, Serialize};
use shape::misshapen;
use std::path::{Path, PathBuf};

/// Parameters of [`synth`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SynthParams {
    /// The garments of the mannequin.
    pub garments: Vec<Garment>,
    /// Number of frames of one full turn, from 1 to 10000.
    pub frames: usize,
    /// Width and height of the images in pixels, from 16 to 4096.
    pub size: usize,
    /// Noise of the labels, from 0 (none) to 1 (a poor parser).
    pub label_noise: Real,
    /// Noise of the outlines, from 0 to 1.
    pub mask_noise: Real,
    /// Amplitude of the clothes' own motion along their normals, in metres, from 0 to 0.1. Inwards it is at most half
    /// of the way to the body.
    pub nonrigid: Real,
    /// Error of the poses; that of `truth/poses.json` is zero.
    pub pose_noise: PoseSigma,
    /// Frames within which errors of poses correlate, from 0 (independent) to 1000.
    pub pose_correlation: Real,
    /// Constant error of the camera's orientation, from 0 to 30: the standard deviation of its turn
    /// about each axis, in degrees.
    pub camera_noise: Real,
    /// Error of the template's shape; that of `truth/template` is zero.
    pub shape_noise: ShapeNoise,
    /// Error of the normals, from 0 to 60: the root of the mean square angle, in degrees.
    pub normal_noise: Real,
    /// Random seed of noise and motion.
    pub seed: u64,
    /// The mannequin. Its layers should not intersect, since intersections would be visible.
    pub mannequin: MannequinParams,
}

impl Default for SynthParams {
    /// T-shirt, trousers and jacket in 24 frames of 256 × 256 pixels, with a third of the noise in
    /// masks and labels, exact poses, camera, template and normals.
    fn default() -> Self {
        Self {
            garments: vec![Garment::Trousers, Garment::Tshirt, Garment::Jacket],
            frames: 24,
            size: 256,
            label_noise: 0.3,
            mask_noise: 0.3,
            nonrigid: 0.0,
            pose_noise: PoseSigma::EXACT,
            pose_correlation: 0.0,
            camera_noise: 0.0,
            shape_noise: ShapeNoise::default(),
            normal_noise: 0.0,
            seed: 0,
            mannequin: MannequinParams { resolution: 1.0, overlap: 0.0 },
        }
    }
}

/// Report of [`synth`].
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SynthReport {
    /// Number of frames.
    pub frames: usize,
    /// Names of the labels.
    pub labels: Vec<String>,
    /// Pixels of each label in all frames, without noise.
    pub pixels: Vec<usize>,
    /// Pixels whose noisy label is wrong.
    pub wrong_labels: usize,
    /// Pixels whose noisy mask is wrong.
    pub wrong_mask: usize,
}

/// A synthetic capture cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum SynthError {
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The capture cannot be written.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The template body cannot be written.
    #[error(transparent)]
    Template(#[from] TemplateError),
    /// A mesh cannot be written.
    #[error("{}: {source}", path.display())]
    Mesh { path: PathBuf, source: ply::WriteError },
    /// The monitor cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl SynthParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range or NaN.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let Self { frames, size, label_noise, mask_noise, nonrigid, .. } = *self;
        let unit = |x: Real| (0.0..=1.0).contains(&x);
        let check = ParameterError::check;
        check("frames", frames as Real, (1..=10_000).contains(&frames), "from 1 to 10000")?;
        check("size", size as Real, (16..=4096).contains(&size), "from 16 to 4096 (pixels)")?;
        check("label_noise", label_noise, unit(label_noise), "from 0 to 1")?;
        check("mask_noise", mask_noise, unit(mask_noise), "from 0 to 1")?;
        let (normal, correlation) = (self.normal_noise, self.pose_correlation);
        check("normal_noise", normal, (0.0..=60.0).contains(&normal), "from 0 to 60 (degrees)")?;
        let camera = self.camera_noise;
        check("camera_noise", camera, (0.0..=30.0).contains(&camera), "from 0 to 30 (degrees)")?;
        let frames = (0.0..=1000.0).contains(&correlation);
        check("pose_correlation", correlation, frames, "from 0 to 1000 (frames)")?;
        self.pose_noise.validate().map_err(|e| e.within("pose_noise"))?;
        self.shape_noise.validate().map_err(|e| e.within("shape_noise"))?;
        check("nonrigid", nonrigid, (0.0..=0.1).contains(&nonrigid), "from 0 to 0.1 (m)")?;
        self.mannequin.validate().map_err(|e| e.within("mannequin"))
    }
}

/// The subfolder with the template body, an input of reconstructions.
pub const BODY: &str = "body";
/// The subfolder with the true body and garments, with skinning weights, for evaluation. If clothes
/// have their own motion, it also has all layers posed in each frame, with labels: `frame_NNNN.ply`;
/// if poses have errors, the true ones: `poses.json`; if the template has, the true one: `template`.
/// `synth.json` has the build and the [`SynthParams`], which make the same capture again.
pub const TRUTH: &str = "truth";

/// Renders the capture into `folder`, which must not exist.
///
/// Besides the files of every capture, the folder has the clean masks and labels (`mask`, `label`)
/// if there is noise, [`BODY`] and [`TRUTH`]. Progress is reported as stage `render`.
///
/// # Errors
///
/// [`SynthError`]. No files are left.
pub fn synth(
    params: &SynthParams,
    folder: &Path,
    monitor: &mut dyn Monitor,
) -> Result<SynthReport, SynthError> {
    params.validate()?;
    let scene = Scene::new(params);
    let camera = camera(params.size);
    let subject = Subject {
        camera: mistaken(&camera, params.camera_noise, params.seed),
        garments: scene.worn.iter().map(|g| g.name().to_owned()).collect(),
        joints: scene.skeleton.names().map(String::from).collect(),
        pose_sigma: Some(params.pose_noise),
        camera_sigma_degrees: Some(params.camera_noise),
        generator: "ifg capture synth".into(),
    };
    let mut writer = CaptureWriter::create(folder, &subject)?;
    let mut report = SynthReport {
        frames: params.frames,
        labels: ["background", "skin"]
            .map(String::from)
            .into_iter()
            .chain(subject.garments.clone())
            .collect(),
        pixels: vec![0; subject.garments.len() + 2],
        wrong_labels: 0,
        wrong_mask: 0,
    };
    let size = (params.size, params.size);
    let names = report.labels.len() as u8;
    let mut rasteriser = Rasteriser::default();
    let home = writer.folder().to_path_buf();
    let make = |name: &str| {
        let path = home.join(name);
        std::fs::create_dir(&path)
            .map(|()| path.clone())
            .map_err(|source| CaptureError::Io { path, source })
    };
    let (body, truth) = (make(BODY)?, make(TRUTH)?);
    let path = truth.join("synth.json");
    let made_by = serde_json::json!({ "build": BUILD, "params": params });
    std::fs::write(&path, format!("{made_by:#}\n"))
        .map_err(|source| CaptureError::Io { path, source })?;
    let waves = Waves::new(params.nonrigid, params.seed);
    let poses: Vec<_> =
        (0..params.frames).map(|frame| rig::turning_pose(frame, params.frames)).collect();
    let given = estimated(&poses, params.pose_noise, params.pose_correlation, params.seed);
    if !params.pose_noise.is_exact() {
        let path = truth.join("poses.json");
        write_poses(&path, &subject.joints, &camera, (0..).zip(&poses))?;
    }
    for frame in 0..params.frames {
        let total = Some(params.frames);
        monitor.report(&Progress { done: frame, total, ..Progress::stage("render") })?;
        let moved = scene.posed(&poses[frame], &waves, frame as Real / params.frames as Real);
        if !waves.still() {
            let path = truth.join(format!("frame_{frame:04}.ply"));
            let labels = Property::new("label", Column::U8(scene.labels()));
            let ply = PlyMesh { vertex_properties: vec![labels], ..PlyMesh::new(moved.clone()) };
            ply::write_path(&ply, moved.vertices(), &WriteParams::default(), &path)
                .map_err(|source| SynthError::Mesh { path, source })?;
        }
        let seen = scene.seen(&moved, &camera, &mut rasteriser);
        // The noise of a frame does not depend on the number of frames.
        let mut rng =
            Pcg64Mcg::seed_from_u64(params.seed.wrapping_mul(1_000_003).wrapping_add(frame as u64));
        let noisy_labels = noise::labels(&seen.labels, size, params.label_noise, names, &mut rng);
        let noisy_mask = noise::mask(&seen.mask, size, params.mask_noise, &mut rng);
        let normals = noise::normals(&seen.normals, size, params.normal_noise, &mut rng);
        let pictures = FramePictures {
            mask: &seen.mask,
            labels: &seen.labels,
            normals: &normals,
            noisy_mask: (params.mask_noise > 0.0).then_some(&noisy_mask),
            noisy_labels: (params.label_noise > 0.0).then_some(&noisy_labels),
        };
        writer.push(&given[frame], &pictures)?;
        seen.labels.iter().for_each(|l| report.pixels[usize::from(*l)] += 1);
        report.wrong_labels +=
            seen.labels.iter().zip(&noisy_labels).filter(|(a, b)| a != b).count();
        report.wrong_mask += seen.mask.iter().zip(&noisy_mask).filter(|(a, b)| a != b).count();
    }
    let template = scene.template();
    if params.shape_noise != ShapeNoise::default() {
        template.write(&make(&format!("{TRUTH}/template"))?)?;
    }
    misshapen(template, params.shape_noise, params.seed).write(&body)?;
    for (k, layer) in scene.layers.iter().enumerate() {
        let name = if k == 0 { "body" } else { &subject.garments[k - 1] };
        let path = truth.join(format!("{name}.ply"));
        let ply = PlyMesh {
            vertex_properties: layer.skin.to_properties(),
            ..PlyMesh::new(layer.mesh.clone())
        };
        ply::write_path(&ply, layer.mesh.vertices(), &WriteParams::default(), &path)
            .map_err(|source| SynthError::Mesh { path, source })?;
    }
    writer.finish()?;
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::{Capture, Channels};
    use if_body::TemplateBody;
    use if_core::monitor::Silent;
    use std::ops::ControlFlow;

    pub(super) fn small(noise: Real) -> SynthParams {
        SynthParams {
            garments: vec![Garment::Jacket, Garment::Trousers],
            frames: 3,
            size: 64,
            label_noise: noise,
            mask_noise: (3.0 * noise).min(1.0), // a third of it moves nothing by a pixel of this size
            mannequin: MannequinParams { resolution: 0.7, overlap: 0.0 },
            ..SynthParams::default()
        }
    }

    #[test]
    fn a_synthetic_capture_is_read_again_and_is_reproducible() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        let report = synth(&small(0.3), &a, &mut Silent).unwrap();
        let made_by = std::fs::read(a.join(TRUTH).join("synth.json")).unwrap();
        let made_by: serde_json::Value = serde_json::from_slice(&made_by).unwrap();
        let recorded = SynthParams::deserialize(&made_by["params"]).unwrap();
        assert_eq!(report, synth(&recorded, &b, &mut Silent).unwrap());
        let capture = Capture::open(&a).unwrap();
        assert_eq!(capture.garments(), ["trousers", "jacket"], "inner to outer");
        let template = TemplateBody::read(&a.join(BODY)).unwrap();
        capture.check_skeleton(&template.skeleton).unwrap();
        let truth = Capture::open_with(&a, &Channels::truth()).unwrap();
        let mut counts = vec![0; 4];
        let mut moved = [0; 2];
        for frame in 0..3 {
            let (noisy, clean) = (capture.frame(frame).unwrap(), truth.frame(frame).unwrap());
            assert_eq!(noisy, Capture::open(&b).unwrap().frame(frame).unwrap());
            moved[0] += usize::from(noisy.labels != clean.labels);
            moved[1] += usize::from(noisy.mask != clean.mask);
            clean.labels.iter().for_each(|l| counts[usize::from(*l)] += 1);
            assert!(clean.labels.iter().zip(&clean.mask).all(|(l, m)| (*l > 0) == *m));
            // Visible surfaces face the camera.
            assert!(clean.normals.iter().zip(&clean.mask).all(|(n, m)| !m || n[2] < 0.35));
        }
        // Noise moves outlines by about a pixel of this size, so not every frame changes.
        assert!(moved.iter().all(|n| *n > 0), "{moved:?}");
        assert!(counts == report.pixels && counts.iter().all(|n| *n > 100), "{counts:?}");
        let total: usize = report.pixels[1..].iter().sum();
        assert!(
            (0.005..0.2).contains(&(report.wrong_labels as Real / total as Real)),
            "{report:?}"
        );
    }

    #[test]
    fn a_misshapen_template_has_the_true_one_beside_the_truth() {
        let folder = tempfile::tempdir().unwrap();
        let (exact, off) = (folder.path().join("exact"), folder.path().join("off"));
        synth(&small(0.0), &exact, &mut Silent).unwrap();
        let shape_noise = ShapeNoise { bones: 0.03, girth: 0.02 };
        synth(&SynthParams { shape_noise, ..small(0.0) }, &off, &mut Silent).unwrap();
        let read = |path: std::path::PathBuf| TemplateBody::read(&path).unwrap();
        let template = read(exact.join(BODY));
        let kept = read(off.join(TRUTH).join("template"));
        assert_eq!(kept.mesh.vertices(), template.mesh.vertices());
        let given = read(off.join(BODY));
        let moves = given.mesh.vertices().iter().zip(template.mesh.vertices());
        let largest = moves.map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        assert!((5e-3..0.2).contains(&largest), "{largest}");
    }

    #[test]
    fn without_noise_there_are_no_noisy_images_and_cancelling_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("clean");
        let report = synth(&small(0.0), &path, &mut Silent).unwrap();
        assert_eq!((report.wrong_labels, report.wrong_mask), (0, 0));
        assert!(!path.join("label_noisy").exists() && !path.join("mask_noisy").exists());
        let stopped = folder.path().join("stopped");
        let mut stop_at_2 = |p: &Progress| {
            if p.done == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let cancelled = synth(&small(0.0), &stopped, &mut stop_at_2);
        assert!(matches!(cancelled, Err(SynthError::Cancelled(_))), "{cancelled:?}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        for bad in [
            SynthParams { frames: 0, ..small(0.0) },
            SynthParams { label_noise: Real::NAN, ..small(0.0) },
            SynthParams { normal_noise: 90.0, ..small(0.0) },
            SynthParams { pose_correlation: -1.0, ..small(0.0) },
            SynthParams { camera_noise: -1.0, ..small(0.0) },
            SynthParams { shape_noise: ShapeNoise { bones: 0.5, girth: 0.0 }, ..small(0.0) },
        ] {
            assert!(matches!(synth(&bad, &stopped, &mut Silent), Err(SynthError::Parameter(_))));
        }
    }
}
