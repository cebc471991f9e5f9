//! `meta.json`.

use super::PoseSigma;
use super::error::CaptureError;
use super::picture::Kind;
use if_body::{Pose, PoseError};
use if_core::math::{Real, Vector};
use if_mesh::camera::Camera;
use if_mesh::regular_file;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Its name in the folder of a capture.
pub(super) const FILE: &str = "meta.json";

/// The file name of the images of a frame.
pub(super) fn file_name(index: u32) -> String {
    format!("{index:04}.png")
}

/// The content of the file; other keys are ignored.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Meta {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(super) generator: String,
    pub(super) width: usize,
    pub(super) height: usize,
    #[serde(rename = "K")]
    pub(super) k: [[Real; 3]; 3],
    #[serde(rename = "R")]
    pub(super) r: [[Real; 3]; 3],
    pub(super) t: [Real; 3],
    #[serde(default)]
    pub(super) convention: String,
    pub(super) labels: Vec<String>,
    pub(super) layers_inner_to_outer: Vec<String>,
    pub(super) joints: Vec<String>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) channels: BTreeMap<String, String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) pose_sigma_degrees: Option<Real>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) pose_sigma_mm: Option<Real>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) camera_sigma_degrees: Option<Real>,
    pub(super) frames: Vec<FrameMeta>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct FrameMeta {
    pub(super) index: u32,
    pub(super) root_t: [Real; 3],
    pub(super) rot: Vec<[Real; 4]>,
}

impl FrameMeta {
    pub(super) fn new(index: u32, pose: &Pose) -> Self {
        Self { index, root_t: pose.root_translation.into(), rot: pose.quaternions() }
    }
}

/// The conventions, written into files for readers.
pub(super) const CONVENTION: &str = "x_cam = R x_world + t; OpenCV axes (x right, y down, z forward); metres; pixel centre (i + 0.5); rot (w, x, y, z)";

/// A matrix from its rows.
fn matrix(rows: &[[Real; 3]; 3]) -> Matrix3<Real> {
    Matrix3::from_fn(|row, column| rows[row][column])
}

/// Its rows.
pub(super) fn rows(m: &Matrix3<Real>) -> [[Real; 3]; 3] {
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| m[(row, column)]))
}

impl Meta {
    pub(super) fn read(path: &Path) -> Result<Self, CaptureError> {
        let bytes = regular_file::read(path)
            .map_err(|source| CaptureError::Io { path: path.into(), source })?;
        // Some editors begin files with a byte order mark.
        serde_json::from_slice(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes))
            .map_err(|source| CaptureError::Json { path: path.into(), source })
    }

    /// The subfolder named for images of this kind.
    pub(super) fn channel(&self, kind: Kind) -> Option<&str> {
        self.channels.get(kind.folder()).map(String::as_str)
    }

    /// The stated error of the poses; `None` without either key.
    pub(super) fn pose_sigma(&self, path: &Path) -> Result<Option<PoseSigma>, CaptureError> {
        let degrees = in_range(path, "pose_sigma_degrees", self.pose_sigma_degrees, 60.0)?;
        let mm = in_range(path, "pose_sigma_mm", self.pose_sigma_mm, 1000.0)?;
        let stated = self.pose_sigma_degrees.is_some() || self.pose_sigma_mm.is_some();
        let [degrees, mm] = [degrees, mm].map(|value| value.unwrap_or(0.0));
        Ok(stated.then_some(PoseSigma { degrees, translation: mm / 1000.0 }))
    }

    /// The stated error of the camera's orientation; `None` without the key.
    pub(super) fn camera_sigma(&self, path: &Path) -> Result<Option<Real>, CaptureError> {
        in_range(path, "camera_sigma_degrees", self.camera_sigma_degrees, 30.0)
    }

    /// Validates the file and returns camera and frames. `path` is for messages.
    pub(super) fn checked(&self, path: &Path) -> Result<(Camera, Vec<(u32, Pose)>), CaptureError> {
        let at = || path.to_path_buf();
        check_names(path, &self.labels, &self.layers_inner_to_outer)?;
        for name in self.channels.values() {
            check_name(path, name)?;
        }
        let camera =
            Camera::new(self.width, self.height, matrix(&self.k), matrix(&self.r), self.t.into())
                .map_err(|source| CaptureError::Camera { path: at(), source })?;
        if self.frames.is_empty() {
            return Err(CaptureError::NoFrames { path: at() });
        }
        let mut frames: Vec<(u32, Pose)> = Vec::with_capacity(self.frames.len());
        for (frame, f) in self.frames.iter().enumerate() {
            if let Some((previous, _)) = frames.last().filter(|(previous, _)| f.index <= *previous)
            {
                return Err(CaptureError::FrameOrder {
                    path: at(),
                    frame,
                    index: f.index,
                    previous: *previous,
                });
            }
            let fault = |source| CaptureError::Pose { path: at(), frame, source };
            if f.rot.len() != self.joints.len() {
                return Err(fault(PoseError::Count {
                    got: f.rot.len(),
                    expected: self.joints.len(),
                }));
            }
            frames.push((
                f.index,
                Pose::from_quaternions(Vector::from(f.root_t), &f.rot).map_err(fault)?,
            ));
        }
        Ok((camera, frames))
    }
}

/// A stated error, from 0 to `most`.
fn in_range(
    path: &Path,
    key: &'static str,
    value: Option<Real>,
    most: Real,
) -> Result<Option<Real>, CaptureError> {
    match value {
        Some(value) if !(0.0..=most).contains(&value) => {
            Err(CaptureError::Sigma { path: path.into(), key, value, most })
        }
        value => Ok(value),
    }
}

/// Checks that labels and layers name the same garments, each once.
pub(super) fn check_names(
    path: &Path,
    labels: &[String],
    layers: &[String],
) -> Result<(), CaptureError> {
    let at = || path.to_path_buf();
    if !(2..=255).contains(&labels.len()) {
        return Err(CaptureError::LabelCount { path: at(), count: labels.len() });
    }
    for (index, name) in ["background", "skin"].iter().enumerate() {
        if labels[index] != *name {
            return Err(CaptureError::LabelName {
                path: at(),
                index,
                found: labels[index].clone(),
            });
        }
    }
    let garments = &labels[2..];
    for index in 0..garments.len().max(layers.len()) {
        let (label, layer) = (garments.get(index), layers.get(index));
        if label != layer {
            let name = |n: Option<&String>| n.map_or("missing".into(), Clone::clone);
            return Err(CaptureError::LayerName {
                path: at(),
                index,
                label: name(label),
                layer: name(layer),
            });
        }
    }
    for (second, name) in layers.iter().enumerate() {
        check_name(path, name)?;
        if labels[..2].contains(name) {
            return Err(CaptureError::BadName { path: path.into(), name: name.clone() });
        }
        if let Some(first) = layers[..second].iter().position(|n| n == name) {
            return Err(CaptureError::SameLayer { path: at(), first, second, name: name.clone() });
        }
    }
    Ok(())
}

/// Checks that a name is valid in file names.
fn check_name(path: &Path, name: &str) -> Result<(), CaptureError> {
    let fits = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | ' ');
    if name.is_empty() || name.starts_with('.') || !name.chars().all(fits) {
        return Err(CaptureError::BadName { path: path.into(), name: name.into() });
    }
    Ok(())
}
