//! Captures: a person in layered clothes who turns in front of one camera, as images that a human
//! parser and a normal estimator computed from a video. `docs/reference/capture.md` specifies the
//! folder.
//!
//! [`Capture::open`] reads `meta.json` and the header of every image. Images are read frame by frame
//! and not kept.

mod error;
mod meta;
mod picture;
pub mod synth;
mod write;

pub use error::CaptureError;
pub use picture::PictureError;
pub use write::{CaptureWriter, FramePictures, Subject, write_poses};

use if_body::{Pose, Skeleton};
use if_core::math::Real;
use if_core::parameter::ParameterError;
use if_mesh::camera::Camera;
use meta::Meta;
use picture::Kind;
use serde::{Deserialize, Serialize};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// Label of the background.
pub const BACKGROUND: u8 = 0;
/// Label of the person's skin.
pub const SKIN: u8 = 1;
/// Label of the innermost garment; the labels of the others follow, inner to outer.
pub const FIRST_GARMENT: u8 = 2;

/// Subfolders of the images. `None` uses the folder named by `channels` in `meta.json`; without that,
/// `mask_noisy`, `label_noisy` and `normal_noisy` if they exist, else `mask`, `label` and `normal`.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Channels {
    /// Subfolder of the foreground masks.
    pub mask: Option<String>,
    /// Subfolder of the label images.
    pub label: Option<String>,
    /// Subfolder of the normals.
    pub normal: Option<String>,
}

impl Channels {
    /// The noise-free images of a rendered capture, for evaluation only.
    pub fn truth() -> Self {
        Self {
            mask: Some("mask".into()),
            label: Some("label".into()),
            normal: Some("normal".into()),
        }
    }
}

/// How far the poses of a capture are off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PoseSigma {
    /// Root of the mean square angle by which each joint's rotation is off, in degrees.
    pub degrees: Real,
    /// Standard deviation of the root's position along each axis, in metres.
    pub translation: Real,
}

impl PoseSigma {
    /// Exact poses.
    pub const EXACT: Self = Self { degrees: 0.0, translation: 0.0 };

    /// Whether the poses are exact.
    pub fn is_exact(&self) -> bool {
        *self == Self::EXACT
    }

    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The angle is not from 0° to 60°, or the distance not from 0 to 1 m.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let Self { degrees, translation } = *self;
        let check = ParameterError::check;
        check("degrees", degrees, (0.0..=60.0).contains(&degrees), "from 0 to 60 (degrees)")?;
        check("translation", translation, (0.0..=1.0).contains(&translation), "from 0 to 1 (m)")
    }
}

impl Default for PoseSigma {
    /// 3° and 9 mm, for poses of an estimator: joints are off by 34 mm on average then.
    ///
    /// # Source
    ///
    /// On 3DPW joints are off by 36 mm after a similarity transform [Shin et al. 2024].
    fn default() -> Self {
        Self { degrees: 3.0, translation: 0.009 }
    }
}

/// The images of one frame, one value per pixel, rows from the top.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Frame {
    /// Whether a pixel shows the person.
    pub mask: Vec<bool>,
    /// [`BACKGROUND`], [`SKIN`], or a garment from [`FIRST_GARMENT`] on; less than the number of
    /// label names.
    pub labels: Vec<u8>,
    /// Unit normals in the camera's frame (x right, y down, z away), zero where missing.
    pub normals: Vec<[f32; 3]>,
}

/// An opened capture. It holds no images.
#[derive(Clone, Debug)]
pub struct Capture {
    folder: PathBuf,
    camera: Camera,
    labels: Vec<String>,
    joints: Vec<String>,
    frames: Vec<(u32, Pose)>,
    pose_sigma: Option<PoseSigma>,
    camera_sigma_degrees: Option<Real>,
    /// Subfolders of masks, labels and normals.
    channels: [String; 3],
}

impl Capture {
    /// Opens the capture in `folder` with its default images ([`Channels`]).
    ///
    /// # Errors
    ///
    /// [`CaptureError`]: `meta.json` is missing or invalid, or an image is missing or has the wrong
    /// size or format.
    pub fn open(folder: &Path) -> Result<Self, CaptureError> {
        Self::open_with(folder, &Channels::default())
    }

    /// Opens the capture in `folder` with the given images.
    ///
    /// # Errors
    ///
    /// As [`Capture::open`].
    pub fn open_with(folder: &Path, channels: &Channels) -> Result<Self, CaptureError> {
        let meta = Meta::read(&folder.join(meta::FILE))?;
        let (camera, frames) = meta.checked(&folder.join(meta::FILE))?;
        let pose_sigma = meta.pose_sigma(&folder.join(meta::FILE))?;
        let camera_sigma_degrees = meta.camera_sigma(&folder.join(meta::FILE))?;
        let noisy = |kind: Kind, given: &Option<String>| {
            let name = given.as_deref().or_else(|| meta.channel(kind));
            let found =
                || if folder.join(kind.noisy()).is_dir() { kind.noisy() } else { kind.folder() };
            name.unwrap_or_else(found).to_owned()
        };
        let channels = [
            noisy(Kind::Mask, &channels.mask),
            noisy(Kind::Label, &channels.label),
            noisy(Kind::Normal, &channels.normal),
        ];
        let this = Self {
            folder: folder.into(),
            camera,
            labels: meta.labels,
            joints: meta.joints,
            frames,
            pose_sigma,
            camera_sigma_degrees,
            channels,
        };
        for frame in 0..this.len() {
            for kind in Kind::ALL {
                let path = this.path(frame, kind);
                match picture::check(&path, kind, this.size()) {
                    Ok(()) => {}
                    Err(PictureError::Io(e)) if e.kind() == std::io::ErrorKind::NotFound => {
                        return Err(CaptureError::Missing { frame, frames: this.len(), path });
                    }
                    Err(source) => return Err(CaptureError::Picture { frame, path, source }),
                }
            }
        }
        Ok(this)
    }

    /// Every file that it is read from: the description, then the images of each frame.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        let images = |frame| Kind::ALL.map(|kind| self.path(frame, kind));
        std::iter::once(self.folder.join(meta::FILE)).chain((0..self.len()).flat_map(images))
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The one camera, which does not move.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Number of frames, at least one.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Always `false`: a capture has at least one frame.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// The name of each label: `background`, `skin`, and the garments from inner to outer.
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// The garments, inner to outer.
    pub fn garments(&self) -> &[String] {
        &self.labels[usize::from(FIRST_GARMENT)..]
    }

    /// Names of the joints that the poses rotate.
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// The pose in a frame.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn pose(&self, frame: usize) -> &Pose {
        &self.frames[frame].1
    }

    /// The error of the poses that `meta.json` states; `None` if it states none.
    pub fn pose_sigma(&self) -> Option<PoseSigma> {
        self.pose_sigma
    }

    /// The constant error of the camera's orientation about each axis that `meta.json` states, as a
    /// standard deviation in degrees; `None` if it states none.
    pub fn camera_sigma_degrees(&self) -> Option<Real> {
        self.camera_sigma_degrees
    }

    /// The same capture seen by another camera, with pictures of the same size.
    ///
    /// # Panics
    ///
    /// If the sizes differ.
    pub fn with_camera(&self, camera: Camera) -> Self {
        let size = (camera.width(), camera.height());
        assert_eq!(size, self.size(), "the pictures keep their size");
        Self { camera, ..self.clone() }
    }

    /// The same capture with other poses, one for each frame.
    ///
    /// # Errors
    ///
    /// A pose has another number of joints than the capture.
    ///
    /// # Panics
    ///
    /// If there is not one pose for each frame.
    pub fn with_poses(&self, poses: Vec<Pose>) -> Result<Self, CaptureError> {
        assert_eq!(poses.len(), self.len(), "one pose for each frame");
        let mut this = self.clone();
        for (frame, (pose, known)) in poses.into_iter().zip(&mut this.frames).enumerate() {
            let (got, expected) = (pose.rotations.len(), self.joints.len());
            if got != expected {
                let path = self.folder.join(meta::FILE);
                let source = if_body::PoseError::Count { got, expected };
                return Err(CaptureError::Pose { path, frame, source });
            }
            known.1 = pose;
        }
        Ok(this)
    }

    /// The same capture with its first frame and each `n`-th after it, under their numbers: long videos
    /// have more frames than a reconstruction gains by, or than memory holds.
    pub fn every(&self, n: NonZeroUsize) -> Self {
        let frames = self.frames.iter().step_by(n.get()).cloned().collect();
        Self { frames, ..self.clone() }
    }

    /// The number in the file names of a frame.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn number(&self, frame: usize) -> u32 {
        self.frames[frame].0
    }

    /// Reads the images of a frame.
    ///
    /// # Errors
    ///
    /// An image cannot be decoded, or a label has no name.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn frame(&self, frame: usize) -> Result<Frame, CaptureError> {
        Ok(Frame {
            mask: self.mask(frame)?,
            labels: self.label_image(frame)?,
            normals: self.normals(frame)?,
        })
    }

    /// Reads only the mask of a frame: `true` from half of full white on.
    ///
    /// # Errors
    ///
    /// The image cannot be decoded.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn mask(&self, frame: usize) -> Result<Vec<bool>, CaptureError> {
        self.read(frame, Kind::Mask, picture::mask)
    }

    /// Reads only the label image of a frame.
    ///
    /// # Errors
    ///
    /// The image cannot be decoded, or a label has no name.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn label_image(&self, frame: usize) -> Result<Vec<u8>, CaptureError> {
        let labels = self.read(frame, Kind::Label, picture::labels)?;
        match labels.iter().position(|l| usize::from(*l) >= self.labels.len()) {
            None => Ok(labels),
            Some(at) => Err(CaptureError::Label {
                path: self.path(frame, Kind::Label),
                column: at % self.camera.width(),
                row: at / self.camera.width(),
                label: labels[at],
                names: self.labels.len(),
            }),
        }
    }

    /// Reads only the normals of a frame.
    ///
    /// # Errors
    ///
    /// The image cannot be decoded.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn normals(&self, frame: usize) -> Result<Vec<[f32; 3]>, CaptureError> {
        self.read(frame, Kind::Normal, picture::normals)
    }

    /// Checks that the poses are for this skeleton: the same joints in the same order.
    ///
    /// # Errors
    ///
    /// The first different joint.
    pub fn check_skeleton(&self, skeleton: &Skeleton) -> Result<(), CaptureError> {
        if self.joints.len() != skeleton.len() {
            return Err(CaptureError::JointCount {
                capture: self.joints.len(),
                skeleton: skeleton.len(),
            });
        }
        for (joint, (ours, theirs)) in self.joints.iter().zip(skeleton.names()).enumerate() {
            if ours != theirs {
                return Err(CaptureError::JointName {
                    joint,
                    capture: ours.clone(),
                    skeleton: theirs.into(),
                });
            }
        }
        Ok(())
    }

    fn size(&self) -> (usize, usize) {
        (self.camera.width(), self.camera.height())
    }

    fn path(&self, frame: usize, kind: Kind) -> PathBuf {
        self.folder.join(&self.channels[kind as usize]).join(meta::file_name(self.frames[frame].0))
    }

    fn read<T>(
        &self,
        frame: usize,
        kind: Kind,
        read: impl Fn(&Path, (usize, usize)) -> Result<T, PictureError>,
    ) -> Result<T, CaptureError> {
        let path = self.path(frame, kind);
        read(&path, self.size()).map_err(|source| CaptureError::Picture { frame, path, source })
    }
}

#[cfg(test)]
mod tests;
