//! Poses: the rotations of all joints, and the translation of the root.

use if_core::math::{Real, Vector};
use nalgebra::{Quaternion, UnitQuaternion};

/// The pose of a skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// Translation of the roots from their rest positions, in metres.
    pub root_translation: Vector,
    /// Rotation of each joint in the frame of its parent.
    pub rotations: Vec<UnitQuaternion<Real>>,
}

impl Pose {
    /// The rest pose: no rotation, no translation.
    pub fn rest(joints: usize) -> Self {
        Self {
            root_translation: Vector::zeros(),
            rotations: vec![UnitQuaternion::identity(); joints],
        }
    }
}

/// A pose is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum PoseError {
    /// Not one rotation for each joint.
    #[error("the pose has {got} rotations for {expected} joints")]
    Count { got: usize, expected: usize },
    /// The translation is not finite, or too large.
    #[error(
        "the pose moves the root by {0:?}; coordinates must be metres, and at most {FARTHEST:e}"
    )]
    Translation(Vector),
    /// A quaternion (w, x, y, z) is not of unit length.
    #[error(
        "rotation {joint} is {rotation:?}, of length {length}; it must be a unit quaternion (w, x, y, z)"
    )]
    Rotation { joint: usize, rotation: [Real; 4], length: Real },
}

/// Tolerance of the length of a quaternion. Files hold 4 to 7 decimals, so lengths differ from 1 by
/// at most 2e-4; ten times more would accept quaternions that were never normalised.
const UNIT: Real = 2e-3;

/// Largest translation of the root, in metres: the circumference of the Earth. Larger values are
/// mistakes, and overflow the single precision of files.
const FARTHEST: Real = 4e7;

impl Pose {
    /// A pose from quaternions (w, x, y, z), which this function normalises.
    ///
    /// # Errors
    ///
    /// [`PoseError`]: a translation that is not finite or too large, or a quaternion whose length
    /// differs from 1 by more than the rounding of files.
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
            // Also rejects NaN.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quaternions_that_are_not_of_unit_length_are_errors() {
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
