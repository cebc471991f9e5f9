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

impl Pose {
    /// The pose at `share` of the way from this one, 0, to `other`, 1: joints turn the shorter way
    /// about one axis each, at constant speed.
    ///
    /// # Panics
    ///
    /// If the poses have different numbers of joints.
    pub fn toward(&self, other: &Self, share: Real) -> Self {
        assert_eq!(self.rotations.len(), other.rotations.len(), "poses of one skeleton");
        let turn = |(a, b): (&UnitQuaternion<Real>, &UnitQuaternion<Real>)| {
            // Opposite rotations have no shorter way; then the axis is arbitrary.
            a.try_slerp(b, share, Real::EPSILON).unwrap_or(if share < 0.5 { *a } else { *b })
        };
        Self {
            root_translation: self.root_translation.lerp(&other.root_translation, share),
            rotations: self.rotations.iter().zip(&other.rotations).map(turn).collect(),
        }
    }

    /// The largest angle by which a joint turns from this pose to `other`, in radians.
    ///
    /// # Panics
    ///
    /// If the poses have different numbers of joints.
    pub fn largest_turn(&self, other: &Self) -> Real {
        assert_eq!(self.rotations.len(), other.rotations.len(), "poses of one skeleton");
        let angles = self.rotations.iter().zip(&other.rotations).map(|(a, b)| a.angle_to(b));
        angles.fold(0.0, Real::max)
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
    /// Nearly all joints are turned half round, as if the quaternions were (x, y, z, w).
    #[error(
        "{half_turns} of {joints} rotations are half turns about z: are they (x, y, z, w)? Write the scalar first, (w, x, y, z)"
    )]
    Order { half_turns: usize, joints: usize },
}

/// Tolerance of the length of a quaternion. Files hold 4 to 7 decimals, so lengths differ from 1 by
/// at most 2e-4; ten times more would accept quaternions that were never normalised.
const UNIT: Real = 2e-3;

/// Fewest joints whose quaternions say in which order their numbers are.
const JOINTS: usize = 4;
/// |z| from which on a quaternion is a half turn about z, or one with its scalar at the end that turns by
/// less than 52°.
const HALF_TURN: Real = 0.9;

/// Largest translation of the root, and coordinate of a joint, in metres: the circumference of the
/// Earth. Larger values are mistakes, and overflow the single precision of files.
pub(crate) const FARTHEST: Real = 4e7;

impl Pose {
    /// A pose from quaternions (w, x, y, z), which this function normalises.
    ///
    /// # Errors
    ///
    /// [`PoseError`]: a translation that is not finite or too large, a quaternion whose length differs
    /// from 1 by more than the rounding of files, or three quarters of four joints or more turned half
    /// round about z, as no person is.
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
        let turns = rotations.iter().enumerate().map(turn).collect::<Result<_, _>>()?;
        let half_turns = rotations.iter().filter(|q| q[3].abs() > HALF_TURN).count();
        let joints = rotations.len();
        if joints >= JOINTS && 4 * half_turns >= 3 * joints {
            return Err(PoseError::Order { half_turns, joints });
        }
        Ok(Self { root_translation, rotations: turns })
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
    fn scalars_at_the_end_are_an_error() {
        let pose = |rotations: &[[Real; 4]]| Pose::from_quaternions(Vector::zeros(), rotations);
        let (last, first) = ([0.1, -0.2, 0.0, 0.95_f64.sqrt()], [0.95_f64.sqrt(), 0.1, -0.2, 0.0]);
        let error = pose(&[last, last, last, first]).unwrap_err();
        assert_eq!(error, PoseError::Order { half_turns: 3, joints: 4 });
        assert!(pose(&[last, last, first, first]).is_ok());
        // A few joints may well be turned so.
        assert!(pose(&[last; 3]).is_ok() && pose(&[first; 4]).is_ok());
    }

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

    #[test]
    #[should_panic(expected = "poses of one skeleton")]
    fn poses_of_two_skeletons_have_no_turn() {
        Pose::rest(3).largest_turn(&Pose::rest(2));
    }

    #[test]
    fn poses_between_two_turn_evenly_and_end_at_both() {
        let to = UnitQuaternion::from_axis_angle(&Vector::y_axis(), 1.0);
        let (a, mut b) = (Pose::rest(2), Pose::rest(2));
        b.rotations[1] = to;
        b.root_translation.x = 2.0;
        approx::assert_relative_eq!(a.toward(&b, 0.25).rotations[1].angle(), 0.25, epsilon = 1e-12);
        assert_eq!(a.toward(&b, 0.25).root_translation.x, 0.5);
        approx::assert_relative_eq!(a.toward(&b, 1.0).rotations[1], to, epsilon = 1e-12);
        approx::assert_relative_eq!(a.largest_turn(&b), 1.0, epsilon = 1e-12);
        assert_eq!(a.toward(&a, 0.7), a);
    }
}
