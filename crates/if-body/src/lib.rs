//! People who wear garments: skeletons, poses, skinning, and alignment of garments between bodies.
//!
//! A [`TemplateBody`] is a mesh with [`SkinWeights`] for the joints of a [`Skeleton`]; a [`Pose`]
//! moves it by linear blend [`skinning`]. A [`BodyMap`] aligns garments from one [`BodyShape`] to
//! another. The [`mannequin`] is a built-in dressed person to try all of this on.
//!
#![doc = include_str!("../README.md")]

pub mod align;
mod left_out;
pub mod mannequin;
mod motion;
mod pose;
mod sequence;
mod skeleton;
mod skin_weights;
pub mod skinning;
mod surface;
mod template;
mod upright;

pub use align::{AlignError, AlignParams, BodyMap, BodyShape};
pub use left_out::LeftOut;
pub use motion::{BvhError, Motion, MotionError, is_rate};
pub use pose::{Pose, PoseError};
pub use sequence::{BodySequence, FrameSource, SequenceError};
pub use skeleton::{Joint, Skeleton, SkeletonError};
pub use skin_weights::{SkinError, SkinWeights};
pub use surface::BodySurface;
pub use template::{TemplateBody, TemplateError};
pub use upright::{NotUpright, check_upright};
