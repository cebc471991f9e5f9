//! An outfit with what moves it, for callers that take either kind.

use super::bound::BoundOutfit;
use super::movement::Movement;
use super::outfit::SkinnedOutfit;
use if_body::{LeftOut, Motion};
use if_core::math::Real;

/// An outfit with what moves it.
#[derive(Debug)]
pub enum MovingOutfit {
    /// The poses of a skeleton.
    Poses(Box<SkinnedOutfit>, Motion),
    /// A body that is given in every frame.
    Bodies(Box<BoundOutfit>),
}

impl MovingOutfit {
    /// Its movement.
    pub fn movement(&self) -> Movement<'_> {
        match self {
            Self::Poses(outfit, motion) => Movement::poses(outfit, motion),
            Self::Bodies(bound) => Movement::bodies(bound),
        }
    }

    /// Garments whose weights were taken from the body.
    pub fn without_weights(&self) -> &[String] {
        match self {
            Self::Poses(outfit, _) => &outfit.without_weights,
            Self::Bodies(_) => &[],
        }
    }

    /// Layers of whose weights some are left out, and how many.
    pub fn left_out(&self) -> &[(String, LeftOut)] {
        match self {
            Self::Poses(outfit, _) => &outfit.left_out,
            Self::Bodies(_) => &[],
        }
    }

    /// How far the skeleton lies from the body, in metres, if it may be another one's.
    pub fn misplaced_skeleton(&self) -> Option<Real> {
        match self {
            Self::Poses(outfit, _) => outfit.misplaced_skeleton(),
            Self::Bodies(_) => None,
        }
    }

    /// Joints of the skeleton that the motion lacks.
    pub fn unmatched(&self) -> &[String] {
        self.motion().map_or(&[], |motion| &motion.unmatched)
    }

    /// Joints of the motion that no joint of the skeleton follows.
    pub fn left_over(&self) -> &[String] {
        self.motion().map_or(&[], |motion| &motion.left_over)
    }

    /// Large bones of limbs that the motion lacks while it has others of the limb, in words.
    pub fn still(&self) -> &[String] {
        self.motion().map_or(&[], |motion| &motion.still)
    }

    /// Where the motion's file has the hips of the first frame, if they are moved to the origin from there, in metres.
    pub fn moved_to_origin(&self) -> Option<[Real; 2]> {
        self.motion()?.moved_to_origin
    }

    /// The frame that stands for the rest pose of the motion.
    pub fn rest_frame(&self) -> Option<usize> {
        self.motion()?.rest_frame
    }

    fn motion(&self) -> Option<&Motion> {
        match self {
            Self::Poses(_, motion) => Some(motion),
            Self::Bodies(_) => None,
        }
    }
}
