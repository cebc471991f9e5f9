//! Layered outfits made intersection-free, and proven so: the façade of if-garments.
//!
//! An [`outfit::Outfit`] is a closed body and its garments, inner to outer. [`resolve::resolve`]
//! settles one garment after the other over all that lies below it, moves as little as it can, and
//! returns the outfit only when exact predicates find no intersecting triangles between its layers;
//! else it returns an error that names those left. [`verify::verify`] only looks. What was found
//! and done is in [`report`].
//!
//! [`mannequin`] makes an outfit to try this on, [`render`] draws one, and [`baselines`] holds the
//! simpler methods that `resolve` is measured against.
//!
//! # Features
//!
//! All are on by default. With `default-features = false` what is named above is left, without pictures.
//!
//! - `pictures`: [`render`], [`preview`].
//! - `wardrobe` (with `pictures`): [`asset`], [`align`], [`skinning`], [`template`], [`wardrobe`], [`page`], [`whole_folder`], [`content`].
//! - `reconstruct` (with `wardrobe`): [`capture`], [`reconstruct`], [`fitting`]; needs `if-neural`.
//!
//! # Examples
//!
//! A T-shirt that goes through the body, before and after:
//!
//! ```
//! use if_pipeline::{mannequin, outfit::{Layer, Outfit}, resolve::{ResolveParams, resolve}, verify::verify};
//! use std::ops::ControlFlow;
//!
//! let scene = mannequin::MannequinParams { resolution: 0.7, ..Default::default() };
//! let tshirt = mannequin::garment(mannequin::Garment::Tshirt, &scene);
//! let outfit = Outfit::new(Layer::new("body", mannequin::body(&scene)), vec![Layer::new("tshirt", tshirt)])?;
//! assert!(!verify(&outfit)?.is_clean());
//!
//! let resolved = resolve(&outfit, &ResolveParams::default(), &mut |_| ControlFlow::Continue(()))?;
//! assert!(verify(&resolved.outfit)?.is_clean());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "wardrobe")]
pub mod align;
#[cfg(feature = "wardrobe")]
pub mod asset;
pub mod baselines;
#[cfg(feature = "reconstruct")]
pub mod capture;
mod ceiling;
mod cloth;
mod contacts;
#[cfg(feature = "wardrobe")]
pub mod content;
mod dressing;
#[cfg(feature = "reconstruct")]
pub mod fitting;
mod inspector;
pub mod mannequin;
pub mod outfit;
mod own;
#[cfg(feature = "wardrobe")]
pub mod page;
mod parting;
#[cfg(feature = "pictures")]
pub mod preview;
mod reach;
#[cfg(feature = "reconstruct")]
pub mod reconstruct;
#[cfg(feature = "pictures")]
pub mod render;
pub mod report;
pub mod resolve;
mod settle;
mod sewn;
pub mod skeleton;
pub mod skin_weights;
#[cfg(feature = "wardrobe")]
pub mod skinning;
mod splitting;
#[cfg(feature = "wardrobe")]
pub mod template;
mod untangle;
pub mod verify;
#[cfg(feature = "wardrobe")]
pub mod wardrobe;
mod weave;
#[cfg(feature = "wardrobe")]
pub mod whole_folder;

/// The example in the project's README is a test.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;

/// And that in `docs/fitting.md`, which is compiled and not run: it takes a minute.
#[cfg(all(doctest, feature = "reconstruct"))]
#[doc = include_str!("../../../docs/fitting.md")]
struct Fitting;
