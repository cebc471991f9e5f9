//! The joints of a person, and where a pose puts them.
//!
//! In rest all frames of joints are parallel to the world. A pose turns each joint j in the frame
//! of its parent, and moves the roots:
//!
//! ```text
//! G_root = T(t + head_root) R_root        G_j = G_parent T(head_j − head_parent) R_j
//! S_j = G_j T(−head_j)                    where what hangs on j goes
//! ```

use if_core::math::{Point, Real, Vector};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use std::io::{self, Read};
use std::path::Path;

/// A joint and the bone that begins there.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name, different from all others.
    pub name: String,
    /// Index of the joint that carries it, smaller than its own; `None` for a root.
    pub parent: Option<usize>,
    /// Where it turns about, in rest.
    pub head: Point,
    /// Where its bone ends, in rest.
    pub tail: Point,
}

/// Joints, parents before children.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    joints: Vec<Joint>,
}

/// How a person stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// By how much the roots are moved from their place in rest, in metres.
    pub root_translation: Vector,
    /// How each joint is turned in the frame of its parent.
    pub rotations: Vec<UnitQuaternion<Real>>,
}

impl Pose {
    /// Nothing turned, nothing moved.
    pub fn rest(joints: usize) -> Self {
        Self {
            root_translation: Vector::zeros(),
            rotations: vec![UnitQuaternion::identity(); joints],
        }
    }
}

/// Why joints make no skeleton.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum SkeletonError {
    /// The system does not give the file.
    #[error("cannot read the skeleton: {0}")]
    Io(#[from] io::Error),
    /// The text has another form.
    #[error("the skeleton is not what docs/capture.md describes: {0}")]
    Json(#[from] serde_json::Error),
    /// No joints.
    #[error("the skeleton has no joints")]
    Empty,
    /// Ids must count from 0.
    #[error(
        "joint {index} (`{name}`) has the id {id}; joints must stand in the order of their ids, from 0"
    )]
    Order { index: usize, name: String, id: i64 },
    /// A joint hangs on nothing known.
    #[error(
        "joint {index} (`{name}`) has the parent {parent}; a parent must stand before its children, and a root has -1"
    )]
    Parent { index: usize, name: String, parent: i64 },
    /// Two joints of one name.
    #[error("joints {first} and {second} are both called `{name}`; each needs its own name")]
    SameName { first: usize, second: usize, name: String },
    /// A coordinate is NaN or infinite.
    #[error("joint {index} (`{name}`): its {end} is {at:?}; coordinates must be finite")]
    NonFinite { index: usize, name: String, end: &'static str, at: Point },
}

/// Why a pose does not fit a skeleton.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum PoseError {
    /// Too many or too few rotations.
    #[error("the pose has {got} rotations for {expected} joints")]
    Count { got: usize, expected: usize },
    /// A number is NaN or infinite, or farther off than any place on Earth.
    #[error(
        "the pose moves the root by {0:?}; coordinates must be metres, and at most {FARTHEST:e}"
    )]
    Translation(Vector),
    /// A quaternion (w, x, y, z) is none of a rotation.
    #[error(
        "rotation {joint} is {rotation:?}, of length {length}; it must be a unit quaternion (w, x, y, z)"
    )]
    Rotation { joint: usize, rotation: [Real; 4], length: Real },
}

/// How far the length of a quaternion in a file may lie from 1. Files hold 4 to 7 decimals, which
/// is 2e-4 at worst; ten times more would take a quaternion for one that was never normalised.
const UNIT: Real = 2e-3;

/// How far a pose may move the root, in metres: the circumference of the Earth. What lies farther
/// off is no person before a camera, and overflows the single precision of files.
const FARTHEST: Real = 4e7;

impl Pose {
    /// A pose from quaternions (w, x, y, z), which are normalised.
    ///
    /// # Errors
    ///
    /// Numbers that are not finite or beyond any place on Earth, or a quaternion whose length is
    /// not 1 but for rounding in files.
    pub fn from_quaternions(
        root_translation: Vector,
        rotations: &[[Real; 4]],
    ) -> Result<Self, PoseError> {
        if !root_translation.iter().all(|x| x.abs() <= FARTHEST) {
            return Err(PoseError::Translation(root_translation));
        }
        let turn = |(joint, &rotation): (usize, &[Real; 4])| {
            let [w, x, y, z] = rotation;
            let q = Quaternion::new(w, x, y, z);
            let length = q.norm();
            // A NaN fails this, too.
            if (length - 1.0).abs() <= UNIT {
                Ok(UnitQuaternion::from_quaternion(q))
            } else {
                Err(PoseError::Rotation { joint, rotation, length })
            }
        };
        Ok(Self {
            root_translation,
            rotations: rotations.iter().enumerate().map(turn).collect::<Result<_, _>>()?,
        })
    }

    /// The quaternions (w, x, y, z).
    pub fn quaternions(&self) -> Vec<[Real; 4]> {
        self.rotations.iter().map(|q| [q.w, q.i, q.j, q.k]).collect()
    }
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
    /// Checks and takes joints.
    ///
    /// # Errors
    ///
    /// The first joint that does not fit.
    pub fn new(joints: Vec<Joint>) -> Result<Self, SkeletonError> {
        if joints.is_empty() {
            return Err(SkeletonError::Empty);
        }
        for (index, joint) in joints.iter().enumerate() {
            let name = || joint.name.clone();
            if let Some(parent) = joint.parent.filter(|p| *p >= index) {
                return Err(SkeletonError::Parent { index, name: name(), parent: parent as i64 });
            }
            if let Some(first) = joints[..index].iter().position(|j| j.name == joint.name) {
                return Err(SkeletonError::SameName { first, second: index, name: name() });
            }
            for (end, at) in [("head", joint.head), ("tail", joint.tail)] {
                if !at.iter().all(|x| x.is_finite()) {
                    return Err(SkeletonError::NonFinite { index, name: name(), end, at });
                }
            }
        }
        Ok(Self { joints })
    }

    /// Reads `skeleton.json` (docs/capture.md).
    ///
    /// # Errors
    ///
    /// [`SkeletonError`], with the joint.
    pub fn read(reader: impl Read) -> Result<Self, SkeletonError> {
        let file: File = serde_json::from_reader(reader)?;
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

    /// Reads the file at `path`.
    ///
    /// # Errors
    ///
    /// As [`Skeleton::read`].
    pub fn read_path(path: &Path) -> Result<Self, SkeletonError> {
        Self::read(io::BufReader::new(std::fs::File::open(path)?))
    }

    /// Writes what [`Skeleton::read`] reads.
    ///
    /// # Errors
    ///
    /// What the writer returns.
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

    /// The same joints with all coordinates times `factor`: from other units to metres.
    ///
    /// # Errors
    ///
    /// A coordinate that is not finite then.
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

    /// Never: a skeleton has a joint.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Their names.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.joints.iter().map(|j| j.name.as_str())
    }

    /// The frames G of all joints in a pose: the translation is where a joint is.
    ///
    /// # Errors
    ///
    /// A pose of another number of joints.
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

    /// The skin transforms S of all joints in a pose: where each takes a point that hangs on it
    /// alone. In rest they are all the identity.
    ///
    /// # Errors
    ///
    /// A pose of another number of joints.
    pub fn transforms(&self, pose: &Pose) -> Result<Vec<Isometry3<Real>>, PoseError> {
        let frames = self.frames(pose)?;
        Ok(frames
            .iter()
            .zip(&self.joints)
            .map(|(g, j)| g * Translation3::from(-j.head.coords))
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn joint(name: &str, parent: Option<usize>, head: [Real; 3]) -> Joint {
        Joint { name: name.into(), parent, head: head.into(), tail: head.into() }
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
    fn joints_that_make_no_skeleton_are_named() {
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

    #[test]
    fn quaternions_that_are_no_rotation_are_named() {
        let pose = |q| Pose::from_quaternions(Vector::zeros(), &[[1.0, 0.0, 0.0, 0.0], q]);
        assert!(pose([0.6, 0.0, 0.8, 0.0]).is_ok() && pose([0.6001, 0.0, 0.8, 0.0]).is_ok());
        for q in [[0.0; 4], [0.7, 0.0, 0.8, 0.0], [Real::NAN, 0.0, 0.0, 0.0]] {
            assert!(matches!(pose(q), Err(PoseError::Rotation { joint: 1, .. })), "{q:?}");
        }
        for far in [Real::INFINITY, -1e300, Real::NAN] {
            let error = Pose::from_quaternions(Vector::new(0.0, far, 0.0), &[]);
            assert!(matches!(error, Err(PoseError::Translation(_))), "{far}");
        }
    }
}
