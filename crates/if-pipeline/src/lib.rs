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

pub mod align;
pub mod asset;
pub mod baselines;
pub mod capture;
mod ceiling;
mod cloth;
mod contacts;
pub mod content;
mod dressing;
pub mod fitting;
mod inspector;
pub mod mannequin;
pub mod outfit;
mod own;
pub mod page;
mod parting;
pub mod preview;
mod reach;
pub mod reconstruct;
pub mod render;
pub mod report;
pub mod resolve;
mod settle;
pub mod skeleton;
pub mod skin_weights;
pub mod skinning;
mod splitting;
pub mod template;
mod untangle;
pub mod verify;
pub mod wardrobe;
mod weave;
pub mod whole_folder;

/// The example in the project's README is a test.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
