//! A capture: a person in layered clothes who turns before one camera, as pictures that a human
//! parser and a normal estimator made of a video. The folder is specified in `docs/capture.md`.
//!
//! [`Capture::open`] reads `meta.json` and looks at the head of every picture; pictures themselves are read frame by
//! frame, and no frame is kept.

mod error;
mod meta;
mod picture;
pub mod synth;
mod write;

pub use error::CaptureError;
pub use picture::PictureError;
pub use write::{CaptureWriter, FramePictures, Subject};

use if_body::{Pose, Skeleton};
use if_mesh::camera::Camera;
use meta::Meta;
use picture::Kind;
use std::path::{Path, PathBuf};

/// Label of what is not the person.
pub const BACKGROUND: u8 = 0;
/// Label of the person where no garment covers them.
pub const SKIN: u8 = 1;
/// Label of the innermost garment; the others follow, inner to outer.
pub const FIRST_GARMENT: u8 = 2;

/// Which subfolders hold the pictures. `None` takes what `meta.json` names under `channels`; where
/// it names nothing, `mask_noisy` and `label_noisy` where there are such folders, else `mask` and
/// `label`; and `normal`.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Channels {
    /// Of the foreground masks.
    pub mask: Option<String>,
    /// Of the label images.
    pub label: Option<String>,
    /// Of the normals.
    pub normal: Option<String>,
}

impl Channels {
    /// The clean pictures of a rendered capture: truth, for judging, never input.
    pub fn truth() -> Self {
        Self {
            mask: Some("mask".into()),
            label: Some("label".into()),
            normal: Some("normal".into()),
        }
    }
}

/// The pictures of one frame, each with one value for each pixel, rows from the top.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Frame {
    /// Whether a pixel shows the person.
    pub mask: Vec<bool>,
    /// [`BACKGROUND`], [`SKIN`], or a garment from [`FIRST_GARMENT`] on; smaller than the number of label names.
    pub labels: Vec<u8>,
    /// Unit normals in the frame of the camera (x right, y down, z away), zero where there is none.
    pub normals: Vec<[f32; 3]>,
}

/// An opened capture. Cheap to keep: no pictures are in it.
#[derive(Clone, Debug)]
pub struct Capture {
    folder: PathBuf,
    camera: Camera,
    labels: Vec<String>,
    joints: Vec<String>,
    frames: Vec<(u32, Pose)>,
    /// Subfolders of masks, labels and normals.
    channels: [String; 3],
}

impl Capture {
    /// Opens the capture in `folder` with the pictures that a front end gave.
    ///
    /// # Errors
    ///
    /// [`CaptureError`]: a `meta.json` that is missing or wrong, a picture that is missing, has another size or kind.
    pub fn open(folder: &Path) -> Result<Self, CaptureError> {
        Self::open_with(folder, &Channels::default())
    }

    /// Opens the capture in `folder` with the given pictures.
    ///
    /// # Errors
    ///
    /// As [`Capture::open`].
    pub fn open_with(folder: &Path, channels: &Channels) -> Result<Self, CaptureError> {
        let meta = Meta::read(&folder.join(meta::FILE))?;
        let (camera, frames) = meta.checked(&folder.join(meta::FILE))?;
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

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The one camera, which does not move.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Number of frames, one at least.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Never: a capture has a frame.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// What each label means: `background`, `skin`, and the garments from inside.
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// The garments, inner to outer.
    pub fn garments(&self) -> &[String] {
        &self.labels[usize::from(FIRST_GARMENT)..]
    }

    /// Names of the joints that poses turn.
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// How the person stands in a frame.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn pose(&self, frame: usize) -> &Pose {
        &self.frames[frame].1
    }

    /// The number in the file names of a frame.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn number(&self, frame: usize) -> u32 {
        self.frames[frame].0
    }

    /// Reads the pictures of a frame.
    ///
    /// # Errors
    ///
    /// A picture that cannot be decoded, or a label without a name.
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

    /// Reads the mask of a frame alone: `true` from half of full white on.
    ///
    /// # Errors
    ///
    /// A picture that cannot be decoded.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn mask(&self, frame: usize) -> Result<Vec<bool>, CaptureError> {
        self.read(frame, Kind::Mask, picture::mask)
    }

    /// Reads the label image of a frame alone.
    ///
    /// # Errors
    ///
    /// A picture that cannot be decoded, or a label without a name.
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

    /// Reads the normals of a frame alone.
    ///
    /// # Errors
    ///
    /// A picture that cannot be decoded.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn normals(&self, frame: usize) -> Result<Vec<[f32; 3]>, CaptureError> {
        self.read(frame, Kind::Normal, picture::normals)
    }

    /// Whether the poses are those of this skeleton: the same joints in the same order.
    ///
    /// # Errors
    ///
    /// The first joint that differs.
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
