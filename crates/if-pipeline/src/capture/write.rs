//! Writing a capture.

use super::PoseSigma;
use super::error::CaptureError;
use super::meta::{self, CONVENTION, FrameMeta, Meta};
use super::picture::{self, Kind, PictureError};
use if_body::Pose;
use if_core::math::Real;
use if_mesh::atomic::{FileSet, FileSetError, write_file};
use if_mesh::camera::Camera;
use serde::Serialize;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// The description of a capture to be written.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The one camera.
    pub camera: Camera,
    /// Names of the garments, inner to outer.
    pub garments: Vec<String>,
    /// Names of the joints that the poses rotate.
    pub joints: Vec<String>,
    /// How far the poses are off; `None` if that is unknown.
    pub pose_sigma: Option<PoseSigma>,
    /// Standard deviation of a constant turn of the camera about each axis, in degrees; `None` if
    /// that is unknown.
    pub camera_sigma_degrees: Option<Real>,
    /// The program that made the images, for readers.
    pub generator: String,
}

/// The images of a frame, one value per pixel, rows from the top.
#[derive(Clone, Copy, Debug)]
pub struct FramePictures<'a> {
    /// Whether a pixel shows the person.
    pub mask: &'a [bool],
    /// Label of each pixel.
    pub labels: &'a [u8],
    /// Unit normals in the camera's frame, zero where missing.
    pub normals: &'a [[f32; 3]],
    /// The mask with noise, if `mask` is the truth.
    pub noisy_mask: Option<&'a [bool]>,
    /// The labels with noise, if `labels` is the truth.
    pub noisy_labels: Option<&'a [u8]>,
}

/// Writes poses of numbered frames, and the camera that they go with, with the keys of `meta.json`: whole,
/// or not at all.
///
/// # Errors
///
/// The file cannot be written.
pub fn write_poses<'a>(
    path: &Path,
    joints: &[String],
    camera: &Camera,
    poses: impl Iterator<Item = (u32, &'a Pose)>,
) -> Result<(), CaptureError> {
    let poses = Poses {
        k: meta::rows(camera.intrinsics()),
        r: meta::rows(camera.rotation()),
        t: (*camera.translation()).into(),
        joints,
        frames: poses.map(|(index, pose)| FrameMeta::new(index, pose)).collect(),
    };
    let text = serde_json::to_vec(&poses)
        .map_err(|source| CaptureError::Json { path: path.into(), source })?;
    write_file(path, |file| file.write_all(&text))
        .map_err(|source| CaptureError::Io { path: path.into(), source })
}

#[derive(Serialize)]
struct Poses<'a> {
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    #[serde(rename = "R")]
    r: [[f64; 3]; 3],
    t: [f64; 3],
    joints: &'a [String],
    frames: Vec<FrameMeta>,
}

/// Writes a capture into a hidden folder beside the final one, out of which [`CaptureWriter::finish`]
/// moves it. If dropped before, no files are left; what a killed process left, the next writer of the
/// same folder removes.
#[derive(Debug)]
pub struct CaptureWriter {
    target: PathBuf,
    /// The name of the folder.
    name: OsString,
    /// Has the folder as its one file.
    hidden: FileSet,
    part: PathBuf,
    meta: Meta,
    size: (usize, usize),
    noisy: [bool; 2],
}

impl CaptureWriter {
    /// Starts the capture `folder`.
    ///
    /// # Errors
    ///
    /// Names are invalid, the folder exists, its parent is not writable, or another process writes it.
    pub fn create(folder: &Path, subject: &Subject) -> Result<Self, CaptureError> {
        let fault = |source| CaptureError::Io { path: folder.into(), source };
        if folder.exists() {
            return Err(CaptureError::InTheWay { path: folder.into() });
        }
        let labels: Vec<String> = ["background", "skin"]
            .map(String::from)
            .into_iter()
            .chain(subject.garments.clone())
            .collect();
        meta::check_names(folder, &labels, &subject.garments)?;
        let parent = match folder.parent() {
            Some(p) if !p.as_os_str().is_empty() => p,
            _ => Path::new("."),
        };
        let name = folder.file_name().ok_or_else(|| fault(ErrorKind::InvalidInput.into()))?;
        let hidden = FileSet::open_for(parent, name).map_err(|error| of_files(folder, error))?;
        let part = hidden.path(name);
        for kind in Kind::ALL {
            fs::create_dir_all(part.join(kind.folder())).map_err(fault)?;
        }
        let camera = &subject.camera;
        let meta = Meta {
            generator: subject.generator.clone(),
            width: camera.width(),
            height: camera.height(),
            k: meta::rows(camera.intrinsics()),
            r: meta::rows(camera.rotation()),
            t: (*camera.translation()).into(),
            convention: CONVENTION.into(),
            labels,
            layers_inner_to_outer: subject.garments.clone(),
            joints: subject.joints.clone(),
            channels: BTreeMap::new(),
            pose_sigma_degrees: subject.pose_sigma.map(|s| s.degrees),
            pose_sigma_mm: subject.pose_sigma.map(|s| 1e3 * s.translation),
            camera_sigma_degrees: subject.camera_sigma_degrees,
            frames: Vec::new(),
        };
        let size = (camera.width(), camera.height());
        let (target, name) = (folder.to_path_buf(), name.to_owned());
        Ok(Self { target, name, hidden, part, meta, size, noisy: [false; 2] })
    }

    /// The temporary folder: other files in it become part of the capture.
    pub fn folder(&self) -> &Path {
        &self.part
    }

    /// Writes the next frame.
    ///
    /// # Errors
    ///
    /// Images of another size, noisy images in only some frames, a pose of another number of joints,
    /// a label without a name, or a file that cannot be written.
    pub fn push(&mut self, pose: &Pose, pictures: &FramePictures) -> Result<(), CaptureError> {
        let frame = self.meta.frames.len();
        let counts = [
            ("mask", Some(pictures.mask.len())),
            ("label image", Some(pictures.labels.len())),
            ("normal image", Some(pictures.normals.len())),
            ("noisy mask", pictures.noisy_mask.map(<[bool]>::len)),
            ("noisy label image", pictures.noisy_labels.map(<[u8]>::len)),
        ];
        let expected = self.size.0 * self.size.1;
        for (what, got) in counts {
            if let Some(got) = got.filter(|n| *n != expected) {
                return Err(CaptureError::PixelCount { frame, what, got, expected });
            }
        }
        let noisy = [pictures.noisy_mask.is_some(), pictures.noisy_labels.is_some()];
        if frame == 0 {
            self.noisy = noisy;
            for kind in [Kind::Mask, Kind::Label] {
                if noisy[kind as usize] {
                    let path = self.part.join(kind.noisy());
                    fs::create_dir(&path).map_err(|source| CaptureError::Io { path, source })?;
                }
            }
        } else if let Some(k) = (0..2).find(|k| noisy[*k] != self.noisy[*k]) {
            return Err(CaptureError::NoisyPicture { frame, what: ["mask", "label image"][k] });
        }
        if pose.rotations.len() != self.meta.joints.len() {
            let source = if_body::PoseError::Count {
                got: pose.rotations.len(),
                expected: self.meta.joints.len(),
            };
            return Err(CaptureError::Pose { path: self.target.clone(), frame, source });
        }
        for labels in [Some(pictures.labels), pictures.noisy_labels].into_iter().flatten() {
            if let Some(at) = labels.iter().position(|l| usize::from(*l) >= self.meta.labels.len())
            {
                let (path, names) = (self.target.clone(), self.meta.labels.len());
                return Err(CaptureError::Label {
                    path,
                    column: at % self.size.0,
                    row: at / self.size.0,
                    label: labels[at],
                    names,
                });
            }
        }
        let size = self.size;
        self.file(frame, Kind::Mask.folder(), |f| picture::write_mask(f, size, pictures.mask))?;
        self.file(frame, Kind::Label.folder(), |f| {
            picture::write_labels(f, size, pictures.labels)
        })?;
        self.file(frame, Kind::Normal.folder(), |f| {
            picture::write_normals(f, size, pictures.normals)
        })?;
        if let Some(mask) = pictures.noisy_mask {
            self.file(frame, Kind::Mask.noisy(), |f| picture::write_mask(f, size, mask))?;
        }
        if let Some(labels) = pictures.noisy_labels {
            self.file(frame, Kind::Label.noisy(), |f| picture::write_labels(f, size, labels))?;
        }
        self.meta.frames.push(FrameMeta::new(frame as u32, pose));
        Ok(())
    }

    /// Writes `meta.json` and moves the folder to its name.
    ///
    /// # Errors
    ///
    /// The capture has no frames, the folder exists by now, or files cannot be written.
    pub fn finish(self) -> Result<(), CaptureError> {
        let path = self.part.join(meta::FILE);
        self.meta.checked(&path)?;
        let text = serde_json::to_vec(&self.meta)
            .map_err(|source| CaptureError::Json { path: path.clone(), source })?;
        fs::write(&path, text).map_err(|source| CaptureError::Io { path, source })?;
        if self.target.exists() {
            return Err(CaptureError::InTheWay { path: self.target });
        }
        self.hidden.commit(&[&self.name]).map_err(|error| of_files(&self.target, error))
    }

    fn file(
        &self,
        frame: usize,
        folder: &str,
        write: impl FnOnce(BufWriter<File>) -> Result<(), PictureError>,
    ) -> Result<(), CaptureError> {
        let path = self.part.join(folder).join(meta::file_name(frame as u32));
        let done =
            File::create(&path).map_err(PictureError::Io).and_then(|f| write(BufWriter::new(f)));
        done.map_err(|source| CaptureError::Picture { frame, path, source })
    }
}

/// Why a capture's folder cannot be written.
fn of_files(folder: &Path, error: FileSetError) -> CaptureError {
    let path = folder.to_path_buf();
    match error {
        FileSetError::Busy { .. } => CaptureError::Busy { path },
        FileSetError::InTheWay { .. } => CaptureError::InTheWay { path },
        FileSetError::Folder { source, .. } | FileSetError::File { source, .. } => {
            CaptureError::Io { path, source }
        }
        error => CaptureError::Io { path, source: std::io::Error::other(error) },
    }
}
