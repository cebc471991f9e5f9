//! Layered outfits made intersection-free, and proven so.
//!
//! An [`outfit::Outfit`] is a closed body and its garments, inner to outer. [`resolve::resolve`]
//! settles one garment after the other over all layers below it, moves as little as it can, and
//! returns the outfit only when exact predicates find no intersecting triangles between its layers;
//! else it returns an error that names those left. [`verify::verify`] checks and changes nothing.
//! [`report`] holds what was found and done.
//!
//! # Examples
//!
//! A T-shirt that goes through the body, before and after:
//!
//! ```
//! use if_body::mannequin;
//! use if_outfit::{outfit::{Layer, Outfit}, resolve::{ResolveParams, resolve}, verify::verify};
//! use if_core::monitor::Silent;
//!
//! let scene = mannequin::MannequinParams { resolution: 0.7, ..Default::default() };
//! let tshirt = mannequin::garment(mannequin::Garment::Tshirt, &scene);
//! let outfit = Outfit::new(Layer::new("body", mannequin::body(&scene)), vec![Layer::new("tshirt", tshirt)])?;
//! assert!(!verify(&outfit)?.is_clean());
//!
//! let resolved = resolve(&outfit, &ResolveParams::default(), &mut Silent)?;
//! assert!(verify(&resolved.outfit)?.is_clean());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod attempt;
mod build;
mod cloth;
mod constraints;
mod contact_groups;
mod contacts;
pub mod content;
mod dressing;
mod facing_sheets;
pub mod files;
mod findings;
mod geodesic;
mod incremental_verification;
pub mod outfit;
mod params;
mod progress;
mod repair;
pub mod report;
pub mod resolve;
mod separating_plane;
mod settle;
mod splitting;
pub mod storage;
pub mod unresolved;
mod upper_layers;
pub mod verify;
mod welded;
mod workpiece;

pub use build::BUILD;
pub use outfit::{Layer, Outfit, OutfitError};
pub use params::{ClothParams, EffortParams, GoalParams, ResolveParams, Split, Tuck};
pub use report::{ResolveReport, Verification};
pub use resolve::{ResolveError, Resolved, resolve};
pub use storage::Storage;
pub use verify::verify;
