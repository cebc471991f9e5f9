//! Motions: a pose for each frame.

mod bones;
mod bvh;
mod lowest;
mod matching;
mod retarget;
mod standing;

pub use bvh::BvhError;

use self::bvh::Bvh;
use self::retarget::{Retargeted, retarget};
use crate::pose::{Pose, PoseError};
use crate::skeleton::{Skeleton, opened};
use if_core::math::{Real, Vector};
use if_mesh::file::is_gltf;
use nalgebra::UnitQuaternion;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::HashMap;
use std::io::{self, Read};
use std::ops::Range;
use std::path::Path;

/// A pose for each frame of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Frames per second.
    pub frames_per_second: Real,
    /// One pose a frame; never empty.
    pub poses: Vec<Pose>,
    /// Joints of the skeleton that the file does not have: they follow their parents.
    pub unmatched: Vec<String>,
    /// Joints of the file that no joint of the skeleton follows, the nearest to its hips first.
    pub left_over: Vec<String>,
    /// Upper arms, forearms, thighs and shins that the file lacks while it has other joints of that limb, in words:
    /// `left upper arm`. Probably it has another name for them.
    pub still: Vec<String>,
    /// Where a BVH file has the hips of the first frame on its floor, from the origin, to which they are moved; in
    /// metres of the skeleton.
    pub moved_to_origin: Option<[Real; 2]>,
    /// The frame that stands for the rest pose of the file, where that is no upright person.
    pub rest_frame: Option<usize>,
}

/// A motion cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum MotionError {
    /// The file cannot be read.
    #[error("cannot read the motion: {0}")]
    Io(#[from] io::Error),
    /// The file is not as docs/animate.md specifies.
    #[error("the motion is not as docs/animate.md specifies: {0}")]
    Json(#[from] serde_json::Error),
    /// The BVH file is invalid, or of another skeleton.
    #[error("{verdict}: {0}", verdict = .0.verdict())]
    Bvh(#[from] BvhError),
    /// The file is neither JSON nor text.
    #[error(
        "the motion is not text; give JSON as docs/animate.md specifies, or BVH; FBX files are not read"
    )]
    Text,
    /// The file is glTF.
    #[error(
        "the motion is a glTF file, whose animations are not read; export it as BVH, or give JSON as docs/animate.md specifies"
    )]
    Gltf,
    /// The motion has not exactly the joints of the skeleton.
    #[error(
        "{fault} `{joint}`; a motion in JSON has each joint of the skeleton once, by its name and in any order: {}",
        joints.join(", ")
    )]
    Joint { fault: &'static str, joint: String, joints: Vec<String> },
    /// There are no frames.
    #[error("the motion has no frames; give at least one")]
    Empty,
    /// The frames per second are none.
    #[error("the motion has {0} frames per second; give a number from 0.001 to 100,000")]
    Rate(Real),
    /// The pose of a frame is invalid.
    #[error("frame {frame} of the motion: {source}")]
    Pose { frame: usize, source: PoseError },
}

#[derive(Serialize, Deserialize)]
struct File {
    #[serde(default = "default_rate")]
    fps: Real,
    joints: Vec<String>,
    frames: Vec<Frame>,
}

#[derive(Serialize, Deserialize)]
struct Frame {
    root_t: [Real; 3],
    rot: Vec<[Real; 4]>,
}

fn default_rate() -> Real {
    30.0
}

/// Whether so many frames per second are a rate that files of motions hold.
pub fn is_rate(frames_per_second: Real) -> bool {
    (1e-3..=1e5).contains(&frames_per_second)
}

/// The first bytes of a binary glTF file.
const GLB: &[u8] = b"glTF";
/// The first word of a BVH file.
const BVH: &str = "HIERARCHY";

/// The text of a file: UTF-8, or a BVH file in Latin-1, as older programs write the names of joints. Those are the
/// first 256 characters of Unicode.
fn text(bytes: &[u8]) -> Result<Cow<'_, str>, MotionError> {
    if let Ok(text) = str::from_utf8(bytes) {
        return Ok(text.into());
    }
    let first = bytes.trim_ascii_start().get(..BVH.len());
    let is_bvh = first.is_some_and(|first| first.eq_ignore_ascii_case(BVH.as_bytes()));
    let latin = || bytes.iter().map(|byte| char::from(*byte)).collect::<String>();
    is_bvh.then(|| latin().into()).ok_or(MotionError::Text)
}

/// Where a motion lists each joint of the skeleton.
fn places_of(listed: &[String], skeleton: &Skeleton) -> Result<Vec<usize>, MotionError> {
    let joints = || skeleton.names().map(str::to_owned).collect();
    let error =
        |fault, joint: &str| MotionError::Joint { fault, joint: joint.into(), joints: joints() };
    let mut places = HashMap::new();
    for (place, name) in listed.iter().enumerate() {
        if places.insert(name.as_str(), place).is_some() {
            return Err(error("the motion lists twice the joint", name));
        }
    }
    let place = |name| places.remove(name).ok_or_else(|| error("the motion lacks the joint", name));
    let found = skeleton.names().map(place).collect::<Result<_, _>>()?;
    match listed.iter().find(|name| places.contains_key(name.as_str())) {
        None => Ok(found),
        Some(name) => Err(error("the skeleton lacks the joint", name)),
    }
}

impl Motion {
    /// Poses of all joints, made by a program.
    ///
    /// # Errors
    ///
    /// [`MotionError::Empty`] or [`MotionError::Rate`].
    pub fn new(frames_per_second: Real, poses: Vec<Pose>) -> Result<Self, MotionError> {
        Self::check_frames(frames_per_second, &poses)?;
        let (unmatched, left_over, still) = Default::default();
        let (moved_to_origin, rest_frame) = (None, None);
        Ok(Self {
            frames_per_second,
            poses,
            unmatched,
            left_over,
            still,
            moved_to_origin,
            rest_frame,
        })
    }

    fn check_frames(frames_per_second: Real, poses: &[Pose]) -> Result<(), MotionError> {
        if poses.is_empty() {
            return Err(MotionError::Empty);
        }
        if !is_rate(frames_per_second) {
            return Err(MotionError::Rate(frames_per_second));
        }
        Ok(())
    }

    /// Reads a pose sequence (docs/animate.md) for a skeleton: `joints`, the names of the skeleton's
    /// joints in their order; `frames`, each with the translation `root_t` and a quaternion
    /// (w, x, y, z) for each joint in `rot`; and `fps`, 30 by default.
    ///
    /// What begins with `HIERARCHY` is read as BVH, whose skeleton may have other proportions, another
    /// rest pose, and other units: bones are turned to where those of the file point, and translations
    /// are scaled by the heights of the hips.
    ///
    /// # Errors
    ///
    /// [`MotionError`], with the index of the frame or joint, or the line.
    pub fn read(reader: impl Read, skeleton: &Skeleton) -> Result<Self, MotionError> {
        Self::read_as(reader, skeleton, false)
    }

    /// The same; what `is_bvh` is no JSON, whatever it begins with.
    fn read_as(
        mut reader: impl Read,
        skeleton: &Skeleton,
        is_bvh: bool,
    ) -> Result<Self, MotionError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes)?;
        if bytes.starts_with(GLB) {
            return Err(MotionError::Gltf);
        }
        let text = text(&bytes)?;
        let text = text.trim_start_matches('\u{feff}');
        if is_bvh || text.trim_start().starts_with(BVH) {
            Self::from_bvh(text, skeleton)
        } else {
            Self::from_json(text, skeleton)
        }
    }

    fn from_bvh(text: &str, skeleton: &Skeleton) -> Result<Self, MotionError> {
        let file = Bvh::read(text)?;
        let frames_per_second = 1.0 / file.frame_time;
        let Retargeted { poses, unmatched, left_over, still, start, rest_frame } =
            retarget(file, skeleton)?;
        let pose = |(frame, (translation, turns)): (usize, (Vector, Vec<UnitQuaternion<Real>>))| {
            let pose = Pose { root_translation: translation, rotations: turns };
            Pose::from_quaternions(translation, &pose.quaternions())
                .map_err(|source| MotionError::Pose { frame, source })
        };
        let poses = poses.into_iter().enumerate().map(pose).collect::<Result<_, _>>()?;
        let moved_to_origin = Some([start.x, start.z]);
        let motion = Self::new(frames_per_second, poses)?;
        Ok(Self { unmatched, left_over, still, moved_to_origin, rest_frame, ..motion })
    }

    fn from_json(text: &str, skeleton: &Skeleton) -> Result<Self, MotionError> {
        let file: File = serde_json::from_str(text)?;
        let places = places_of(&file.joints, skeleton)?;
        let pose = |(frame, f): (usize, &Frame)| {
            let fault = |source| MotionError::Pose { frame, source };
            if f.rot.len() != places.len() {
                let (got, expected) = (f.rot.len(), places.len());
                return Err(fault(PoseError::Count { got, expected }));
            }
            let rotations: Vec<_> = places.iter().map(|place| f.rot[*place]).collect();
            Pose::from_quaternions(Vector::from(f.root_t), &rotations).map_err(fault)
        };
        let poses = file.frames.iter().enumerate().map(pose).collect::<Result<_, _>>()?;
        Self::new(file.fps, poses)
    }

    /// Writes what [`Motion::read`] reads.
    ///
    /// # Errors
    ///
    /// Errors of the writer, and what [`Motion::read`] would refuse: a rate out of range, or a pose that
    /// is invalid or of another skeleton. Nothing is written then.
    pub fn write(&self, mut writer: impl io::Write, skeleton: &Skeleton) -> io::Result<()> {
        self.check(skeleton).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))?;
        let frame =
            |pose: &Pose| Frame { root_t: pose.root_translation.into(), rot: pose.quaternions() };
        let file = File {
            fps: self.frames_per_second,
            joints: skeleton.names().map(str::to_owned).collect(),
            frames: self.poses.iter().map(frame).collect(),
        };
        serde_json::to_writer(&mut writer, &file)?;
        writer.write_all(b"\n")
    }

    fn check(&self, skeleton: &Skeleton) -> Result<(), MotionError> {
        Self::check_frames(self.frames_per_second, &self.poses)?;
        for (frame, pose) in self.poses.iter().enumerate() {
            let (got, expected) = (pose.rotations.len(), skeleton.len());
            let checked = if got == expected {
                Pose::from_quaternions(pose.root_translation, &pose.quaternions()).map(|_| ())
            } else {
                Err(PoseError::Count { got, expected })
            };
            checked.map_err(|source| MotionError::Pose { frame, source })?;
        }
        Ok(())
    }

    /// Reads the file at `path`, as BVH if its extension says so.
    ///
    /// # Errors
    ///
    /// As [`Motion::read`].
    pub fn read_path(path: &Path, skeleton: &Skeleton) -> Result<Self, MotionError> {
        let file = opened(path)?;
        if is_gltf(path) {
            return Err(MotionError::Gltf);
        }
        let is_bvh =
            path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("bvh"));
        Self::read_as(file, skeleton, is_bvh)
    }

    /// The frames of a range, at the same rate.
    ///
    /// # Panics
    ///
    /// If there are no such frames.
    pub fn part(&self, frames: Range<usize>) -> Self {
        assert!(!frames.is_empty(), "a motion has frames");
        Self { poses: self.poses[frames].to_vec(), ..self.clone() }
    }

    /// Every `step`-th frame, the first one included.
    ///
    /// # Panics
    ///
    /// If `step` is 0.
    pub fn every(&self, step: usize) -> Self {
        Self {
            frames_per_second: self.frames_per_second / step as Real,
            poses: self.poses.iter().step_by(step).cloned().collect(),
            unmatched: self.unmatched.clone(),
            left_over: self.left_over.clone(),
            still: self.still.clone(),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests;
