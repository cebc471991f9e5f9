//! Frames on disk: each as one file, whole or not at all. Beside walked frames lies the state of each
//! run, from which the next frame follows.
//!
//! A file is a line of JSON, with the digest of what the frame was computed from, and positions in
//! single precision.

use super::animator::{AnimateParams, Animator};
use super::error::AnimateError;
use super::movement::{Movement, Place};
use super::report::FrameReport;
use crate::build::BUILD;
use if_body::Pose;
use if_core::math::{Point, Real, Vector};
use if_core::nalgebra::{Quaternion, UnitQuaternion};
use if_outfit::digest::{DigestOfParts, digest};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The frames of an animation.
#[derive(Debug)]
pub struct Frames {
    folder: PathBuf,
    request: String,
    rows: Vec<FrameReport>,
    /// Vertices of each layer, the body first.
    vertices: Vec<usize>,
}

/// The first line of a frame.
#[derive(Serialize, Deserialize)]
struct FrameHead {
    request: String,
    sha256: String,
    row: FrameReport,
}

/// The first line of the state.
#[derive(Serialize, Deserialize)]
struct StateHead {
    request: String,
    sha256: String,
    /// The frame after which it was written.
    frame: usize,
    place: PlaceHead,
}

#[derive(Serialize, Deserialize)]
enum PlaceHead {
    Pose {
        root: [Real; 3],
        /// (w, x, y, z) of each joint.
        rotations: Vec<[Real; 4]>,
    },
    /// The body's positions are before the snapshot, as many as these.
    Body(usize),
}

/// The state of an animator.
#[derive(Debug)]
pub(super) struct State {
    pub(super) place: Place,
    /// Of its walker.
    pub(super) snapshot: Vec<u8>,
}

impl Frames {
    /// The frames in `folder`, which is created, that belong to this outfit, motion and parameters.
    ///
    /// # Errors
    ///
    /// A folder that cannot be made.
    pub(super) fn open(
        folder: &Path,
        movement: Movement<'_>,
        params: &AnimateParams,
    ) -> Result<Self, AnimateError> {
        let vertices = movement.outfit().layers().map(|l| l.mesh.vertices().len()).collect();
        let request = request(movement, params)?;
        let frames = Self { folder: folder.into(), request, rows: Vec::new(), vertices };
        frames.made()
    }

    /// Other frames of the same request, in a folder within.
    ///
    /// # Errors
    ///
    /// A folder that cannot be made.
    pub(super) fn within(&self, name: &str) -> Result<Self, AnimateError> {
        let (request, vertices) = (self.request.clone(), self.vertices.clone());
        Self { folder: self.folder.join(name), request, rows: Vec::new(), vertices }.made()
    }

    fn made(self) -> Result<Self, AnimateError> {
        std::fs::create_dir_all(&self.folder)
            .map_err(|source| AnimateError::Io { path: self.folder.clone(), source })?;
        Ok(self)
    }

    /// Writes the file of a frame.
    pub(super) fn write(&self, positions: &[Point], row: &FrameReport) -> Result<(), AnimateError> {
        let bytes: Vec<u8> = positions
            .iter()
            .flat_map(|p| [p.x, p.y, p.z])
            .flat_map(|x| (x as f32).to_le_bytes())
            .collect();
        let head = FrameHead {
            request: self.request.clone(),
            sha256: digest(&bytes).sha256,
            row: row.clone(),
        };
        write(&self.path(row.frame), &head, &bytes)
    }

    /// Removes the file of a frame and the state of a run that begins with it, if they are there.
    pub(super) fn remove(&self, frame: usize) -> Result<(), AnimateError> {
        for path in [self.path(frame), self.state_path(frame)] {
            match std::fs::remove_file(&path) {
                Err(source) if source.kind() != io::ErrorKind::NotFound => {
                    return Err(AnimateError::Io { path, source });
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Removes what a process that was killed left half-written.
    pub(super) fn remove_partial(&self) -> Result<(), AnimateError> {
        if_mesh::atomic::remove_partial(&self.folder)
            .map_err(|source| AnimateError::Io { path: self.folder.clone(), source })
    }

    /// Writes the state after a frame of the run that begins with `first`.
    pub(super) fn write_state(
        &self,
        (first, frame): (usize, usize),
        animator: &Animator<'_>,
    ) -> Result<(), AnimateError> {
        let mut bytes = Vec::new();
        let place = match &animator.place {
            Place::Pose(pose) => PlaceHead::Pose {
                root: pose.root_translation.into(),
                rotations: pose.quaternions(),
            },
            Place::Body(body) => {
                let numbers = body.iter().flat_map(|p| [p.x, p.y, p.z]);
                bytes.extend(numbers.flat_map(Real::to_le_bytes));
                PlaceHead::Body(body.len())
            }
        };
        bytes.extend(animator.walker().snapshot());
        let sha256 = digest(&bytes).sha256;
        let head = StateHead { request: self.request.clone(), sha256, frame, place };
        write(&self.state_path(first), &head, &bytes)
    }

    /// The frame after which the state of the run that begins with `first` was written, and the state, if it
    /// is of this request and unchanged.
    pub(super) fn state(&self, first: usize) -> Option<(usize, State)> {
        let (head, mut bytes) = read::<StateHead>(&self.state_path(first))?;
        if head.request != self.request || head.sha256 != digest(&bytes).sha256 {
            return None;
        }
        let place = match head.place {
            PlaceHead::Pose { root, rotations } => {
                let rotation = |q: &[Real; 4]| {
                    UnitQuaternion::new_unchecked(Quaternion::new(q[0], q[1], q[2], q[3]))
                };
                let rotations = rotations.iter().map(rotation).collect();
                Place::Pose(Pose { root_translation: Vector::from(root), rotations })
            }
            PlaceHead::Body(count) => {
                let size = count.checked_mul(24).filter(|size| *size <= bytes.len())?;
                let snapshot = bytes.split_off(size);
                let body = std::mem::replace(&mut bytes, snapshot);
                let number = |b: &[u8]| Real::from_le_bytes(b.try_into().expect("chunks of eight"));
                let point =
                    |b: &[u8]| Point::new(number(&b[..8]), number(&b[8..16]), number(&b[16..]));
                Place::Body(body.chunks_exact(24).map(point).collect())
            }
        };
        Some((head.frame, State { place, snapshot: bytes }))
    }

    fn path(&self, frame: usize) -> PathBuf {
        self.folder.join(format!("{frame:06}.frame"))
    }

    fn state_path(&self, first: usize) -> PathBuf {
        self.folder.join(format!("{first:06}.state"))
    }

    /// A frame, if it is there, of this request and unchanged.
    pub(super) fn stored(&self, frame: usize) -> Option<(FrameReport, Vec<Point>)> {
        let (head, bytes) = read::<FrameHead>(&self.path(frame))?;
        let fits = head.request == self.request
            && head.row.frame == frame
            && bytes.len() == 12 * self.vertices.iter().sum::<usize>()
            && head.sha256 == digest(&bytes).sha256;
        let single =
            |b: &[u8]| Real::from(f32::from_le_bytes(b.try_into().expect("chunks of four")));
        let points: Vec<Point> = bytes
            .chunks_exact(12)
            .map(|b| Point::new(single(&b[..4]), single(&b[4..8]), single(&b[8..])))
            .collect();
        (fits && points.iter().all(|p| p.iter().all(|x| x.is_finite())))
            .then_some((head.row, points))
    }

    /// A frame that was written before.
    ///
    /// # Errors
    ///
    /// [`AnimateError::Changed`] if it is not there any more, or not as it was written.
    pub(super) fn written(&self, frame: usize) -> Result<(FrameReport, Vec<Point>), AnimateError> {
        self.stored(frame).ok_or_else(|| AnimateError::Changed { path: self.path(frame) })
    }

    /// All frames, from the first on, with these rows.
    pub(super) fn with_rows(self, rows: Vec<FrameReport>) -> Self {
        Self { rows, ..self }
    }

    /// Rows of all frames that are done.
    pub fn rows(&self) -> &[FrameReport] {
        &self.rows
    }

    /// Number of frames that are done.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether none is done.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Digest of outfit, motion and parameters.
    pub fn request(&self) -> &str {
        &self.request
    }

    /// The positions of all layers in a frame, the body's first, one after the other.
    ///
    /// # Errors
    ///
    /// [`AnimateError::Frame`] if there is no such frame, [`AnimateError::Changed`] if the file is not as
    /// it was written.
    pub fn positions(&self, frame: usize) -> Result<Vec<Point>, AnimateError> {
        if frame >= self.len() {
            return Err(AnimateError::Frame { frame, frames: self.len() });
        }
        self.written(frame).map(|(_, points)| points)
    }

    /// The positions of each layer in a frame, the body first.
    ///
    /// # Errors
    ///
    /// As [`Frames::positions`].
    pub fn layers(&self, frame: usize) -> Result<Vec<Vec<Point>>, AnimateError> {
        let mut points = self.positions(frame)?.into_iter();
        Ok(self.vertices.iter().map(|count| points.by_ref().take(*count).collect()).collect())
    }
}

/// The digest of all that decides the frames.
fn request(movement: Movement<'_>, params: &AnimateParams) -> Result<String, AnimateError> {
    let head = json!({
        "build": BUILD,
        "params": params,
        "fps": movement.frames_per_second(),
    });
    let mut parts = DigestOfParts::default();
    parts.add(head.to_string().as_bytes());
    movement.digest(&mut |part| parts.add(part))?;
    Ok(parts.finish().sha256)
}

/// Writes a line of JSON and bytes, whole or not at all.
fn write(path: &Path, head: &impl Serialize, bytes: &[u8]) -> Result<(), AnimateError> {
    if_mesh::atomic::write_file::<io::Error>(path, |file| {
        file.write_all(&serde_json::to_vec(head)?)?;
        file.write_all(b"\n")?;
        file.write_all(bytes)
    })
    .map_err(|source| AnimateError::Io { path: path.into(), source })
}

/// A line of JSON and what follows; `None` if the file is missing or damaged.
fn read<T: DeserializeOwned>(path: &Path) -> Option<(T, Vec<u8>)> {
    let mut bytes = std::fs::read(path).ok()?;
    let end = bytes.iter().position(|b| *b == b'\n')?;
    let head = serde_json::from_slice(&bytes[..end]).ok()?;
    Some((head, bytes.split_off(end + 1)))
}
