//! The project's own capture: the mannequin in its clothes, turning before a camera, seen as a
//! noisy human parser and a normal estimator would see it.

mod motion;
mod noise;

use super::{CaptureError, CaptureWriter, FramePictures, Subject};
use if_body::SkinWeights;
use if_body::mannequin::{self, Garment, MannequinParams, rig};
use if_body::{Pose, Skeleton};
use if_body::{TemplateBody, TemplateError};
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;
use if_mesh::camera::Camera;
use if_mesh::ply::{self, Column, PlyMesh, Property, WriteParams};
use if_mesh::raster::{IdBuffer, NOTHING, RasterParams, Rasteriser};
use motion::Waves;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What is captured, and how badly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SynthParams {
    /// What the mannequin wears.
    pub garments: Vec<Garment>,
    /// Pictures of one full turn, from 1 on.
    pub frames: usize,
    /// Pixels on each side, from 16 to 4096.
    pub size: usize,
    /// How badly labels are seen: 0 as they are, 1 as by a poor parser. From 0 to 1.
    pub label_noise: Real,
    /// How badly the outline is seen. From 0 to 1.
    pub mask_noise: Real,
    /// How far clothes move by themselves, in metres along their normals. From 0 to 0.1.
    pub nonrigid: Real,
    /// Another number, another noise and another motion.
    pub seed: u64,
    /// The mannequin. Its layers should not overlap: a camera would see through them.
    pub mannequin: MannequinParams,
}

impl Default for SynthParams {
    /// T-shirt, trousers and jacket in 24 pictures of 256 pixels, seen with a third of the noise.
    fn default() -> Self {
        Self {
            garments: vec![Garment::Trousers, Garment::Tshirt, Garment::Jacket],
            frames: 24,
            size: 256,
            label_noise: 0.3,
            mask_noise: 0.3,
            nonrigid: 0.0,
            seed: 0,
            mannequin: MannequinParams { resolution: 1.0, overlap: 0.0 },
        }
    }
}

/// What was captured.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SynthReport {
    /// Pictures.
    pub frames: usize,
    /// Names of the labels.
    pub labels: Vec<String>,
    /// Pixels of each label in all pictures, as they are.
    pub pixels: Vec<usize>,
    /// Pixels whose noisy label is another one.
    pub wrong_labels: usize,
    /// Pixels whose noisy mask is another one.
    pub wrong_mask: usize,
}

/// Why there is no capture.
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
    /// The caller asked to stop; nothing is left.
    #[error("cancelled")]
    Cancelled,
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
        check("nonrigid", nonrigid, (0.0..=0.1).contains(&nonrigid), "from 0 to 0.1 (m)")?;
        self.mannequin.validate().map_err(|e| e.within("mannequin"))
    }
}

/// The subfolder with the template body: what a reconstruction may use beside the pictures.
pub const BODY: &str = "body";
/// The subfolder with the body and the garments as they are, with skinning weights: for judging.
/// Where clothes move by themselves, it has all layers posed in each frame, too: `frame_NNNN.ply`,
/// with their labels.
pub const TRUTH: &str = "truth";

/// Renders the capture into `folder`, which must not exist. `progress` is told how many frames are
/// done, and returns whether to go on.
///
/// Beside what every capture has, the folder holds the clean masks and labels (`mask`, `label`)
/// where there is noise,
/// [`BODY`] and [`TRUTH`].
///
/// # Errors
///
/// Parameters out of range, or files that cannot be written; nothing is left then.
pub fn synth(
    params: &SynthParams,
    folder: &Path,
    progress: &mut dyn FnMut(usize) -> bool,
) -> Result<SynthReport, SynthError> {
    params.validate()?;
    let scene = Scene::new(params);
    let camera = camera(params.size);
    let mut worn = params.garments.clone();
    worn.sort();
    worn.dedup();
    let subject = Subject {
        camera: camera.clone(),
        garments: worn.iter().map(|g| g.name().to_owned()).collect(),
        joints: scene.skeleton.names().map(String::from).collect(),
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
        pixels: vec![0; worn.len() + 2],
        wrong_labels: 0,
        wrong_mask: 0,
    };
    let size = (params.size, params.size);
    let mut rasteriser = Rasteriser::default();
    let make = |name: &str| {
        let path = writer.folder().join(name);
        std::fs::create_dir(&path)
            .map(|()| path.clone())
            .map_err(|source| CaptureError::Io { path, source })
    };
    let (body, truth) = (make(BODY)?, make(TRUTH)?);
    let waves = Waves::new(params.nonrigid, params.seed);
    for frame in 0..params.frames {
        if !progress(frame) {
            return Err(SynthError::Cancelled);
        }
        let pose = rig::turning_pose(frame, params.frames);
        let moved = scene.posed(&pose, &waves, frame as Real / params.frames as Real);
        if !waves.still() {
            let path = truth.join(format!("frame_{frame:04}.ply"));
            let labels = Property::new("label", Column::U8(scene.labels()));
            let ply = PlyMesh { vertex_properties: vec![labels], ..PlyMesh::new(moved.clone()) };
            ply::write_path(&ply, moved.vertices(), &WriteParams::default(), &path)
                .map_err(|source| SynthError::Mesh { path, source })?;
        }
        let seen = scene.seen(&moved, &camera, &mut rasteriser);
        // Each frame has its own noise, whatever the number of frames before it.
        let mut rng =
            Pcg64Mcg::seed_from_u64(params.seed.wrapping_mul(1_000_003).wrapping_add(frame as u64));
        let noisy_labels =
            noise::labels(&seen.labels, size, params.label_noise, worn.len() as u8 + 2, &mut rng);
        let noisy_mask = noise::mask(&seen.mask, size, params.mask_noise, &mut rng);
        let pictures = FramePictures {
            mask: &seen.mask,
            labels: &seen.labels,
            normals: &seen.normals,
            noisy_mask: (params.mask_noise > 0.0).then_some(&noisy_mask),
            noisy_labels: (params.label_noise > 0.0).then_some(&noisy_labels),
        };
        writer.push(&pose, &pictures)?;
        seen.labels.iter().for_each(|l| report.pixels[usize::from(*l)] += 1);
        report.wrong_labels +=
            seen.labels.iter().zip(&noisy_labels).filter(|(a, b)| a != b).count();
        report.wrong_mask += seen.mask.iter().zip(&noisy_mask).filter(|(a, b)| a != b).count();
    }
    scene.template().write(&body)?;
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

/// Before the person, at breast height, 32° from top to bottom.
fn camera(size: usize) -> Camera {
    let (angle, height) = (32.0f64.to_radians(), 1.72);
    let distance = 0.56 * height / (0.5 * angle).tan() + 0.25;
    let (eye, target) =
        (Point::new(0.0, 0.55 * height, distance), Point::new(0.0, 0.5 * height, 0.0));
    Camera::looking_at((size, size), &eye, &target, &Vector::y(), angle)
        .expect("the size is in range, and the eye is not the target")
}

struct Layer {
    mesh: TriMesh,
    skin: SkinWeights,
}

/// The mannequin in its clothes, in rest.
struct Scene {
    skeleton: Skeleton,
    /// The body, then garments from inside.
    layers: Vec<Layer>,
    /// All layers in one mesh.
    all: TriMesh,
    /// Triangle from which each layer begins in it.
    first: Vec<usize>,
}

/// Truth of one frame.
struct Seen {
    mask: Vec<bool>,
    labels: Vec<u8>,
    normals: Vec<[f32; 3]>,
}

impl Scene {
    fn new(params: &SynthParams) -> Self {
        let mut worn = params.garments.clone();
        worn.sort();
        worn.dedup();
        let meshes = std::iter::once(mannequin::body(&params.mannequin))
            .chain(worn.iter().map(|kind| mannequin::garment(*kind, &params.mannequin)));
        let layers: Vec<Layer> =
            meshes.map(|mesh| Layer { skin: rig::skin_weights(mesh.vertices()), mesh }).collect();
        let (mut vertices, mut triangles, mut first) = (Vec::new(), Vec::new(), Vec::new());
        for layer in &layers {
            let n = vertices.len() as u32;
            first.push(triangles.len());
            vertices.extend_from_slice(layer.mesh.vertices());
            triangles.extend(layer.mesh.triangles().iter().map(|t| t.map(|v| v + n)));
        }
        let all = TriMesh::new(vertices, triangles).expect("meshes side by side are a mesh");
        Self { skeleton: rig::skeleton(), layers, all, first }
    }

    fn template(&self) -> TemplateBody {
        let body = &self.layers[0];
        TemplateBody {
            mesh: body.mesh.clone(),
            skin: body.skin.clone(),
            skeleton: self.skeleton.clone(),
        }
    }

    /// For each vertex of all layers the label.
    fn labels(&self) -> Vec<u8> {
        let one =
            |(k, layer): (usize, &Layer)| vec![k as u8 + super::SKIN; layer.mesh.vertices().len()];
        self.layers.iter().enumerate().flat_map(one).collect()
    }

    /// All layers in a pose, the garments moved by `waves` before.
    fn posed(&self, pose: &Pose, waves: &Waves, turn: Real) -> TriMesh {
        let transforms =
            self.skeleton.transforms(pose).expect("the pose has the joints of the rig");
        let mut posed = Vec::with_capacity(self.all.vertices().len());
        for (k, layer) in self.layers.iter().enumerate() {
            let mut rest = layer.mesh.vertices().to_vec();
            if k > 0 && !waves.still() {
                rest.iter_mut()
                    .zip(layer.mesh.vertex_normals())
                    .for_each(|(p, n)| *p += n * waves.at(p, turn));
            }
            let hang = layer.skin.joints().iter().zip(layer.skin.weights()).zip(&rest);
            posed.extend(hang.map(|((joints, weights), p)| {
                let parts = joints
                    .iter()
                    .zip(weights)
                    .map(|(j, w)| (transforms[usize::from(*j)] * p).coords * Real::from(*w));
                Point::from(parts.sum::<Vector>())
            }));
        }
        self.all.with_vertices(posed).expect("rotations keep coordinates finite")
    }

    fn seen(&self, moved: &TriMesh, camera: &Camera, rasteriser: &mut Rasteriser) -> Seen {
        let mut ids = IdBuffer::default();
        rasteriser.look(moved, moved.vertices(), camera, &RasterParams::default(), &mut ids);
        let normals: Vec<Vector> =
            moved.vertex_normals().iter().map(|n| camera.rotation() * n).collect();
        let (width, n) = (camera.width(), ids.triangle.len());
        let mut seen = Seen {
            mask: vec![false; n],
            labels: vec![super::BACKGROUND; n],
            normals: vec![[0.0; 3]; n],
        };
        for (at, &id) in ids.triangle.iter().enumerate().filter(|(_, id)| **id != NOTHING) {
            let layer = self.first.partition_point(|first| *first <= id as usize) - 1;
            seen.mask[at] = true;
            seen.labels[at] = layer as u8 + super::SKIN;
            if let Some((bary, cos)) = rasteriser.hit(moved, camera, id, at % width, at / width) {
                let corners = moved.triangles()[id as usize];
                let sum: Vector = (0..3).map(|k| normals[corners[k] as usize] * bary[k]).sum();
                // Where a back is seen, an estimator gives the side that it sees.
                let normal = unit_or_zero(&sum) * if cos < 0.0 { -1.0 } else { 1.0 };
                seen.normals[at] = [normal.x as f32, normal.y as f32, normal.z as f32];
            }
        }
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::{Capture, Channels};

    fn small(noise: Real) -> SynthParams {
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
    fn a_synthetic_capture_is_read_again_and_is_the_same_twice() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        let report = synth(&small(0.3), &a, &mut |_| true).unwrap();
        assert_eq!(report, synth(&small(0.3), &b, &mut |_| true).unwrap());
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
            // What faces the camera has normals against the view.
            assert!(clean.normals.iter().zip(&clean.mask).all(|(n, m)| !m || n[2] < 0.35));
        }
        // Blobs and outlines move by about a pixel of this size: not in each frame.
        assert!(moved.iter().all(|n| *n > 0), "{moved:?}");
        assert!(counts == report.pixels && counts.iter().all(|n| *n > 100), "{counts:?}");
        let total: usize = report.pixels[1..].iter().sum();
        assert!(
            (0.005..0.2).contains(&(report.wrong_labels as Real / total as Real)),
            "{report:?}"
        );
    }

    #[test]
    fn clothes_that_move_by_themselves_move_as_far_as_said_and_the_body_does_not() {
        let scene = Scene::new(&small(0.0));
        let pose = rig::turning_pose(1, 8);
        let still = scene.posed(&pose, &Waves::new(0.0, 1), 0.25);
        let moved = scene.posed(&pose, &Waves::new(0.01, 1), 0.25);
        let mut square = [(0.0, 0.0); 2];
        for ((p, q), label) in still.vertices().iter().zip(moved.vertices()).zip(scene.labels()) {
            let sum = &mut square[usize::from(label > super::super::SKIN)];
            *sum = (sum.0 + (p - q).norm_squared(), sum.1 + 1.0);
        }
        assert_eq!(square[0].0, 0.0);
        let high = (square[1].0 / square[1].1 as Real).sqrt();
        assert!((0.003..0.015).contains(&high), "{high}");
    }

    #[test]
    fn the_outline_of_a_pose_lies_where_its_joints_do() {
        let scene = Scene::new(&small(0.0));
        let camera = camera(64);
        let pose = rig::turning_pose(1, 8);
        let moved = scene.posed(&pose, &Waves::new(0.0, 0), 0.0);
        let seen = scene.seen(&moved, &camera, &mut Rasteriser::default());
        for (joint, frame) in
            scene.skeleton.joints().iter().zip(scene.skeleton.frames(&pose).unwrap())
        {
            let pixel = camera.project(&Point::from(frame.translation.vector)).unwrap();
            let at = pixel.y as usize * 64 + pixel.x as usize;
            assert!(seen.mask[at], "{} at {pixel}", joint.name);
        }
    }

    #[test]
    fn without_noise_there_are_no_noisy_pictures_and_what_is_cancelled_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("clean");
        let report = synth(&small(0.0), &path, &mut |_| true).unwrap();
        assert_eq!((report.wrong_labels, report.wrong_mask), (0, 0));
        assert!(!path.join("label_noisy").exists() && !path.join("mask_noisy").exists());
        let stopped = folder.path().join("stopped");
        assert!(matches!(synth(&small(0.0), &stopped, &mut |k| k < 2), Err(SynthError::Cancelled)));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        for bad in [
            SynthParams { frames: 0, ..small(0.0) },
            SynthParams { label_noise: Real::NAN, ..small(0.0) },
        ] {
            assert!(matches!(synth(&bad, &stopped, &mut |_| true), Err(SynthError::Parameter(_))));
        }
    }
}
