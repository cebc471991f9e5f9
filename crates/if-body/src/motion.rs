//! Motions: a pose for each frame.

use crate::pose::{Pose, PoseError};
use crate::skeleton::Skeleton;
use if_core::math::{Real, Vector};
use serde::Deserialize;
use std::io::{self, Read};
use std::path::Path;

/// A pose for each frame of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Frames per second.
    pub frames_per_second: Real,
    /// One pose a frame; never empty.
    pub poses: Vec<Pose>,
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
    /// The motion has a joint that the skeleton lacks, or the other way round.
    #[error(
        "joint {index} of the motion is `{found}`, but the skeleton has `{expected}` there; \
         export the motion for this skeleton, with its joints in its order"
    )]
    Joint { index: usize, found: String, expected: String },
    /// There are no frames.
    #[error("the motion has no frames; give at least one")]
    Empty,
    /// The frames per second are not positive.
    #[error("the motion has {0} frames per second; give a positive number")]
    Rate(Real),
    /// The pose of a frame is invalid.
    #[error("frame {frame} of the motion: {source}")]
    Pose { frame: usize, source: PoseError },
}

#[derive(Deserialize)]
struct File {
    #[serde(default = "default_rate")]
    fps: Real,
    joints: Vec<String>,
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    root_t: [Real; 3],
    rot: Vec<[Real; 4]>,
}

fn default_rate() -> Real {
    30.0
}

/// What stands for a joint that is missing.
const MISSING: &str = "none";

impl Motion {
    /// Reads a pose sequence (docs/animate.md) for a skeleton: `joints`, the names of the skeleton's
    /// joints in their order; `frames`, each with the translation `root_t` and a quaternion
    /// (w, x, y, z) for each joint in `rot`; and `fps`, 30 by default.
    ///
    /// # Errors
    ///
    /// [`MotionError`], with the index of the frame or joint.
    pub fn read(reader: impl Read, skeleton: &Skeleton) -> Result<Self, MotionError> {
        let file: File = serde_json::from_reader(reader)?;
        let names: Vec<&str> = skeleton.names().collect();
        for index in 0..names.len().max(file.joints.len()) {
            let found = file.joints.get(index).map_or(MISSING, String::as_str);
            let expected = names.get(index).copied().unwrap_or(MISSING);
            if found != expected {
                let (found, expected) = (found.to_owned(), expected.to_owned());
                return Err(MotionError::Joint { index, found, expected });
            }
        }
        if file.frames.is_empty() {
            return Err(MotionError::Empty);
        }
        if !(file.fps.is_finite() && file.fps > 0.0) {
            return Err(MotionError::Rate(file.fps));
        }
        let pose = |(frame, f): (usize, &Frame)| {
            let fault = |source| MotionError::Pose { frame, source };
            if f.rot.len() != names.len() {
                let (got, expected) = (f.rot.len(), names.len());
                return Err(fault(PoseError::Count { got, expected }));
            }
            Pose::from_quaternions(Vector::from(f.root_t), &f.rot).map_err(fault)
        };
        let poses = file.frames.iter().enumerate().map(pose).collect::<Result<_, _>>()?;
        Ok(Self { frames_per_second: file.fps, poses })
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    ///
    /// As [`Motion::read`].
    pub fn read_path(path: &Path, skeleton: &Skeleton) -> Result<Self, MotionError> {
        Self::read(io::BufReader::new(std::fs::File::open(path)?), skeleton)
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
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::Joint;
    use if_core::math::Point;

    fn skeleton() -> Skeleton {
        let joint = |name: &str, parent| Joint {
            name: name.into(),
            parent,
            head: Point::origin(),
            tail: Point::new(0.0, 1.0, 0.0),
        };
        Skeleton::new(vec![joint("hips", None), joint("knee", Some(0))]).unwrap()
    }

    fn read(joints: &str, frames: &str) -> Result<Motion, MotionError> {
        let text = format!(r#"{{"fps": 24, "joints": {joints}, "frames": {frames}}}"#);
        Motion::read(text.as_bytes(), &skeleton())
    }

    const JOINTS: &str = r#"["hips", "knee"]"#;
    const FRAME: &str = r#"{"root_t": [0, 1, 2], "rot": [[1, 0, 0, 0], [0, 1, 0, 0]]}"#;

    #[test]
    fn a_motion_has_a_pose_for_each_frame() {
        let motion = read(JOINTS, &format!("[{FRAME}, {FRAME}, {FRAME}]")).unwrap();
        assert_eq!((motion.frames_per_second, motion.poses.len()), (24.0, 3));
        assert_eq!(motion.poses[1].root_translation, Vector::new(0.0, 1.0, 2.0));
        assert_eq!(motion.poses[1].quaternions()[1], [0.0, 1.0, 0.0, 0.0]);
        let half = motion.every(2);
        assert_eq!((half.frames_per_second, half.poses.len()), (12.0, 2));
    }

    #[test]
    fn invalid_motions_are_errors_that_name_the_place() {
        let error = |joints: &str, frames: &str| read(joints, frames).unwrap_err().to_string();
        let frames = format!("[{FRAME}]");
        let table = [
            (r#"["hips", "elbow"]"#, frames.as_str(), "joint 1 of the motion is `elbow`"),
            (r#"["hips"]"#, &frames, "joint 1 of the motion is `none`"),
            (r#"["hips", "knee", "toe"]"#, &frames, "the skeleton has `none`"),
            (JOINTS, "[]", "no frames"),
            (JOINTS, r#"[{"root_t": [0, 0, 0], "rot": [[1, 0, 0, 0]]}]"#, "frame 0"),
            (
                JOINTS,
                r#"[{"root_t": [0, 0, 0], "rot": [[1, 0, 0, 0], [2, 0, 0, 0]]}]"#,
                "rotation 1",
            ),
            (
                JOINTS,
                r#"[{"root_t": [0, 0, 1e300], "rot": [[1, 0, 0, 0], [1, 0, 0, 0]]}]"#,
                "frame 0",
            ),
            (JOINTS, r#"[{"root_t": [NaN, 0, 0], "rot": []}]"#, "docs/animate.md"),
        ];
        for (joints, frames, expected) in table {
            let found = error(joints, frames);
            assert!(found.contains(expected), "{found}");
        }
        let text = format!(r#"{{"fps": 0, "joints": {JOINTS}, "frames": {frames}}}"#);
        assert!(matches!(
            Motion::read(text.as_bytes(), &skeleton()),
            Err(MotionError::Rate(rate)) if rate == 0.0
        ));
    }
}
