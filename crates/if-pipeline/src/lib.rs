//! From videos to wardrobes of layered garments: the whole way of IF-Garments.
//!
//! [`capture`] reads what off-the-shelf tools make of a video of a turning person, [`reconstruct`]
//! makes single garments of it, [`asset`] and [`wardrobe`] keep garments and combine them on any
//! body, free of intersections.
//!
//! # Features
//!
//! All are on by default.
//!
//! - `wardrobe`: [`asset`], [`wardrobe`].
//! - `reconstruct` (with `wardrobe`): [`capture`], [`reconstruct`], [`fitting`]; needs `if-neural`.

#[cfg(feature = "wardrobe")]
pub mod asset;
#[cfg(feature = "reconstruct")]
pub mod capture;
#[cfg(feature = "reconstruct")]
pub mod fitting;
#[cfg(feature = "reconstruct")]
pub mod reconstruct;
#[cfg(feature = "wardrobe")]
pub mod wardrobe;
