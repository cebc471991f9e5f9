//! Skeletons: the joints of a person, and their transforms in a pose.
//!
//! In the rest pose all joint frames are parallel to the world. A pose rotates each joint j in the
//! frame of its parent and translates the roots:
//!
//! ```text
//! G_root = T(t + head_root) R_root        G_j = G_parent T(head_j − head_parent) R_j
//! S_j = G_j T(−head_j)                    the skinning transform of j
//! ```

use crate::pose::{FARTHEST, Pose, PoseError};
use if_core::math::{Point, Real, Vector};
use if_mesh::file::{Content, MeshFile, ReadError, is_gltf};
use if_mesh::gltf::SkinJoint;
use if_mesh::regular_file;
use nalgebra::{Isometry3, Translation3};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::io::{self, Read};
use std::path::Path;

/// Length below which a bone of a person has no direction, in metres.
pub(crate) const SHORT: Real = 1e-6;

/// A joint and the bone that begins there.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name, unique in the skeleton.
    pub name: String,
    /// Index of its parent, smaller than its own; `None` for a root.
    pub parent: Option<usize>,
    /// Its centre of rotation in the rest pose.
    pub head: Point,
    /// The end of its bone in the rest pose.
    pub tail: Point,
}

/// A tree of joints, parents before children.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    joints: Vec<Joint>,
}

/// A skeleton cannot be read, or is invalid.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum SkeletonError {
    /// The file cannot be read.
    #[error("cannot read the skeleton: {0}")]
    Io(#[from] io::Error),
    /// The file is not as docs/reference/capture.md specifies.
    #[error("the skeleton is not as docs/reference/capture.md specifies: {0}")]
    Json(#[from] serde_json::Error),
    /// The glTF file cannot be read.
    #[error(transparent)]
    Gltf(#[from] ReadError),
    /// There are no joints.
    #[error("the skeleton has no joints")]
    Empty,
    /// Ids must count from 0.
    #[error(
        "joint {index} (`{name}`) has the id {id}; joints must be in the order of their ids, from 0"
    )]
    Order { index: usize, name: String, id: i64 },
    /// The parent of a joint is not an earlier joint.
    #[error(
        "joint {index} (`{name}`) has the parent {parent}; a parent must come before its children, and a root has -1"
    )]
    Parent { index: usize, name: String, parent: i64 },
    /// Two joints have the same name.
    #[error("joints {first} and {second} are both called `{name}`; each needs its own name")]
    SameName { first: usize, second: usize, name: String },
    /// A coordinate is NaN, infinite or too large.
    #[error(
        "joint {index} (`{name}`): its {end} is {at:?}; coordinates must be numbers of at most 4e7 m"
    )]
    NonFinite { index: usize, name: String, end: &'static str, at: Point },
}

/// `skeleton.json`.
#[derive(Serialize, Deserialize)]
struct File {
    #[serde(default)]
    convention: String,
    joints: Vec<JointFile>,
}

#[derive(Serialize, Deserialize)]
struct JointFile {
    id: i64,
    name: String,
    parent: i64,
    head: [Real; 3],
    tail: [Real; 3],
}

const CONVENTION: &str = "metres, y up. Rest joint frames are world-aligned: G_j = G_parent T(head_j - head_parent) R_j, \
    root G = T(root_t + head_root) R_root; skin matrix S_j = G_j T(-head_j). parent -1 is a root";

impl Skeleton {
    /// A skeleton of these joints.
    ///
    /// # Errors
    ///
    /// The first invalid joint.
    pub fn new(joints: Vec<Joint>) -> Result<Self, SkeletonError> {
        if joints.is_empty() {
            return Err(SkeletonError::Empty);
        }
        let mut names = HashMap::new();
        for (index, joint) in joints.iter().enumerate() {
            let name = || joint.name.clone();
            if let Some(parent) = joint.parent.filter(|p| *p >= index) {
                return Err(SkeletonError::Parent { index, name: name(), parent: parent as i64 });
            }
            if let Some(first) = names.insert(&joint.name, index) {
                return Err(SkeletonError::SameName { first, second: index, name: name() });
            }
            for (end, at) in [("head", joint.head), ("tail", joint.tail)] {
                if !at.iter().all(|x| x.abs() <= FARTHEST) {
                    return Err(SkeletonError::NonFinite { index, name: name(), end, at });
                }
            }
        }
        Ok(Self { joints })
    }

    /// Reads `skeleton.json` (docs/reference/capture.md).
    ///
    /// # Errors
    ///
    /// [`SkeletonError`], with the index of the joint.
    pub fn read(reader: impl Read) -> Result<Self, SkeletonError> {
        let text = io::read_to_string(reader).map_err(serde_json::Error::io)?;
        // Some editors begin files with a byte order mark.
        let file: File = serde_json::from_str(text.trim_start_matches('\u{feff}'))?;
        let joint = |(index, j): (usize, JointFile)| {
            if j.id != index as i64 {
                return Err(SkeletonError::Order { index, name: j.name, id: j.id });
            }
            if !(-1..index as i64).contains(&j.parent) {
                return Err(SkeletonError::Parent { index, name: j.name, parent: j.parent });
            }
            Ok(Joint {
                name: j.name,
                parent: usize::try_from(j.parent).ok(),
                head: j.head.into(),
                tail: j.tail.into(),
            })
        };
        Self::new(file.joints.into_iter().enumerate().map(joint).collect::<Result<_, _>>()?)
    }

    /// The skeleton of a glTF file: the joints of its skins as the scene shows them, which is the rest pose
    /// here. Bones end in the middle of the joints below them; the last joints have none.
    ///
    /// # Errors
    ///
    /// No joints, or the first invalid one.
    pub fn from_gltf(joints: &[SkinJoint]) -> Result<Self, SkeletonError> {
        let mut below = vec![(0.0, Vector::zeros()); joints.len()];
        for joint in joints {
            // `new` refuses a parent that does not exist.
            if let Some((count, sum)) = joint.parent.and_then(|p| below.get_mut(p)) {
                *count += 1.0;
                *sum += joint.place.coords;
            }
        }
        let joint = |(joint, (count, sum)): (&SkinJoint, (Real, Vector))| Joint {
            name: joint.name.clone(),
            parent: joint.parent,
            head: joint.place,
            tail: if count > 0.0 { Point::from(sum / count) } else { joint.place },
        };
        Self::new(joints.iter().zip(below).map(joint).collect())
    }

    /// Reads the file at `path`: `skeleton.json`, or a glTF file with a skin, by its extension.
    ///
    /// # Errors
    ///
    /// As [`Skeleton::read`] and [`Skeleton::from_gltf`], and a glTF file that cannot be read.
    pub fn read_path(path: &Path) -> Result<Self, SkeletonError> {
        if !is_gltf(path) {
            return Self::read(opened(path)?);
        }
        match MeshFile::read(path)?.content() {
            Content::Gltf(file) => Self::from_gltf(file.joints()),
            _ => Err(SkeletonError::Empty),
        }
    }

    /// Writes what [`Skeleton::read`] reads.
    ///
    /// # Errors
    ///
    /// Errors of the writer.
    pub fn write(&self, mut writer: impl io::Write) -> io::Result<()> {
        let joint = |(id, j): (usize, &Joint)| JointFile {
            id: id as i64,
            name: j.name.clone(),
            parent: j.parent.map_or(-1, |p| p as i64),
            head: j.head.into(),
            tail: j.tail.into(),
        };
        let file = File {
            convention: CONVENTION.into(),
            joints: self.joints.iter().enumerate().map(joint).collect(),
        };
        serde_json::to_writer_pretty(&mut writer, &file)?;
        writer.write_all(b"\n")
    }

    /// The skeleton with all coordinates multiplied by `factor`, to convert units to metres.
    ///
    /// # Errors
    ///
    /// A scaled coordinate is not finite.
    pub fn scaled(&self, factor: Real) -> Result<Self, SkeletonError> {
        let scaled =
            |j: &Joint| Joint { head: j.head * factor, tail: j.tail * factor, ..j.clone() };
        Self::new(self.joints.iter().map(scaled).collect())
    }

    /// All joints, parents before children.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Number of joints.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// Always `false`: a skeleton has at least one joint.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// The names of all joints.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.joints.iter().map(|j| j.name.as_str())
    }

    /// The frames G of all joints in a pose; their translations are the joints' positions.
    ///
    /// # Errors
    ///
    /// The pose has another number of joints.
    pub fn frames(&self, pose: &Pose) -> Result<Vec<Isometry3<Real>>, PoseError> {
        if pose.rotations.len() != self.joints.len() {
            return Err(PoseError::Count {
                got: pose.rotations.len(),
                expected: self.joints.len(),
            });
        }
        let mut frames: Vec<Isometry3<Real>> = Vec::with_capacity(self.joints.len());
        for (joint, turn) in self.joints.iter().zip(&pose.rotations) {
            frames.push(match joint.parent {
                None => Isometry3::from_parts(
                    Translation3::from(pose.root_translation + joint.head.coords),
                    *turn,
                ),
                Some(p) => {
                    frames[p]
                        * Isometry3::from_parts(
                            Translation3::from(joint.head - self.joints[p].head),
                            *turn,
                        )
                }
            });
        }
        Ok(frames)
    }

    /// The skinning transforms S of all joints in a pose, which map rest positions to posed ones.
    /// In the rest pose they are identities.
    ///
    /// # Errors
    ///
    /// The pose has another number of joints.
    pub fn transforms(&self, pose: &Pose) -> Result<Vec<Isometry3<Real>>, PoseError> {
        let frames = self.frames(pose)?;
        Ok(frames
            .iter()
            .zip(&self.joints)
            .map(|(g, j)| g * Translation3::from(-j.head.coords))
            .collect())
    }
}

/// The file at `path`, or an error that names it.
pub(crate) fn opened(path: &Path) -> io::Result<impl io::BufRead> {
    let named = |e: io::Error| io::Error::new(e.kind(), format!("{}: {e}", path.display()));
    regular_file::read(path).map(io::Cursor::new).map_err(named)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use std::f64::consts::FRAC_PI_2;

    fn joint(name: &str, parent: Option<usize>, head: [Real; 3]) -> Joint {
        Joint { name: name.into(), parent, head: head.into(), tail: head.into() }
    }

    #[test]
    fn bones_of_a_gltf_file_end_amid_the_joints_below() {
        let joint = |name: &str, parent, place: [Real; 3]| SkinJoint {
            name: name.into(),
            parent,
            place: place.into(),
        };
        let mut joints = vec![
            joint("hips", None, [0.0, 1.0, 0.0]),
            joint("l", Some(0), [0.1, 0.9, 0.0]),
            joint("r", Some(0), [-0.1, 0.9, 0.0]),
        ];
        let found = Skeleton::from_gltf(&joints).unwrap();
        let ends: Vec<[Point; 2]> = found.joints().iter().map(|j| [j.head, j.tail]).collect();
        let [hips, l, r] = [0, 1, 2].map(|k| joints[k].place);
        assert_eq!(ends, [[hips, Point::new(0.0, 0.9, 0.0)], [l, l], [r, r]]);
        assert_eq!(found.joints()[2].parent, Some(0));
        joints[2].name = "l".into();
        let fault = Skeleton::from_gltf(&joints).unwrap_err();
        assert!(matches!(fault, SkeletonError::SameName { first: 1, second: 2, .. }), "{fault}");
        assert!(matches!(Skeleton::from_gltf(&[]), Err(SkeletonError::Empty)));
        let fault = Skeleton::from_gltf(&[joint("l", Some(9), [0.0; 3])]).unwrap_err();
        assert!(matches!(fault, SkeletonError::Parent { index: 0, parent: 9, .. }), "{fault}");
    }

    fn arm() -> Skeleton {
        let joints = vec![
            joint("hips", None, [0.0, 1.0, 0.0]),
            joint("shoulder", Some(0), [0.0, 1.5, 0.0]),
            joint("elbow", Some(1), [0.3, 1.5, 0.0]),
        ];
        Skeleton::new(joints).unwrap()
    }

    #[test]
    fn a_bent_elbow_moves_the_hand_and_a_turned_hip_moves_all() {
        let skeleton = arm();
        let mut pose = Pose::rest(3);
        let hand = Point::new(0.6, 1.5, 0.0);
        for s in skeleton.transforms(&pose).unwrap() {
            approx::assert_relative_eq!(s, Isometry3::identity(), epsilon = 1e-15);
        }
        pose.rotations[2] = UnitQuaternion::from_axis_angle(&Vector::z_axis(), FRAC_PI_2);
        approx::assert_relative_eq!(
            skeleton.transforms(&pose).unwrap()[2] * hand,
            Point::new(0.3, 1.8, 0.0),
            epsilon = 1e-15
        );
        pose.rotations[0] = UnitQuaternion::from_axis_angle(&Vector::y_axis(), FRAC_PI_2);
        pose.root_translation = Vector::new(0.0, 0.5, 0.0);
        approx::assert_relative_eq!(
            skeleton.transforms(&pose).unwrap()[2] * hand,
            Point::new(0.0, 2.3, -0.3),
            epsilon = 1e-15
        );
        approx::assert_relative_eq!(
            skeleton.frames(&pose).unwrap()[2].translation.vector,
            Vector::new(0.0, 2.0, -0.3),
            epsilon = 1e-15
        );
        assert_eq!(skeleton.frames(&Pose::rest(2)), Err(PoseError::Count { got: 2, expected: 3 }));
    }

    #[test]
    fn a_written_skeleton_is_read_again() {
        let mut bytes = Vec::new();
        arm().write(&mut bytes).unwrap();
        assert_eq!(Skeleton::read(&bytes[..]).unwrap(), arm());
    }

    #[test]
    fn a_file_that_is_missing_is_named() {
        let path = Path::new("nowhere/skeleton.json");
        let message = Skeleton::read_path(path).unwrap_err().to_string();
        assert!(
            message.starts_with("cannot read the skeleton: nowhere/skeleton.json: "),
            "{message}"
        );
        let message = crate::Motion::read_path(path, &arm()).unwrap_err().to_string();
        assert!(
            message.starts_with("cannot read the motion: nowhere/skeleton.json: "),
            "{message}"
        );
    }

    #[test]
    fn invalid_joints_are_errors() {
        let read = |text: &str| Skeleton::read(text.as_bytes()).unwrap_err();
        let joint = |id: i32, name: &str, parent: i32| {
            format!(
                r#"{{"id":{id},"name":"{name}","parent":{parent},"head":[0,0,0],"tail":[0,0,1]}}"#
            )
        };
        let all = |joints: &[String]| format!(r#"{{"joints":[{}]}}"#, joints.join(","));
        assert!(matches!(read("{"), SkeletonError::Json(_)));
        assert!(matches!(read(&all(&[])), SkeletonError::Empty));
        assert!(matches!(
            read(&all(&[joint(1, "a", -1)])),
            SkeletonError::Order { index: 0, id: 1, .. }
        ));
        for parent in [0, 3, -2] {
            assert!(
                matches!(
                    read(&all(&[joint(0, "a", parent)])),
                    SkeletonError::Parent { index: 0, .. }
                ),
                "{parent}"
            );
        }
        let twice = read(&all(&[joint(0, "a", -1), joint(1, "a", 0)]));
        assert!(twice.to_string().contains("0 and 1 are both called `a`"), "{twice}");
    }
}
