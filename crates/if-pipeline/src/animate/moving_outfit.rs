//! An outfit with what moves it, for callers that take either kind.

use super::bound::BoundOutfit;
use super::movement::Movement;
use super::noticed::{Noticed, WeightsLeftOut};
use super::outfit::SkinnedOutfit;
use if_body::{LeftOut, Motion};

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

    /// What was noticed of its files.
    pub fn noticed(&self) -> Noticed {
        let Self::Poses(outfit, motion) = self else { return Noticed::default() };
        let left_out =
            |(layer, of): &(String, LeftOut)| WeightsLeftOut { layer: layer.clone(), of: *of };
        Noticed {
            weights_from_body: outfit.without_weights.clone(),
            weights_left_out: outfit.left_out.iter().map(left_out).collect(),
            joints_not_in_motion: motion.unmatched.clone(),
            joints_of_motion_left_over: motion.left_over.clone(),
            limbs_not_moved: motion.still.clone(),
            moved_to_origin: motion.moved_to_origin,
            rest_frame: motion.rest_frame,
            skeleton_from_skin: outfit.misplaced_skeleton(),
        }
    }
}
