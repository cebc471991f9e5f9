//! People who wear garments: skeletons, skinning, and garments brought from one body to another.
//!
//! [`template::TemplateBody`] is a body with a [`skeleton`] and [`skin_weights`]; [`skinning`] poses
//! and unposes it; [`align`] maps garments between bodies; [`mannequin`] makes a dressed body to
//! try all of this on.

pub mod align;
pub mod mannequin;
pub mod skeleton;
pub mod skin_weights;
pub mod skinning;
pub mod template;
