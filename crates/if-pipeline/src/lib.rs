//! From captures of videos to garments, and to wardrobes of garments that fit any body.
//!
//! A [`Capture`] holds the masks, labels, normals and poses that off-the-shelf tools extract from a
//! video of a turning person; [`reconstruct()`] makes a clothed person and single garments of it. A
//! [`Wardrobe`] stores bodies and garments ([`Asset`]); a [`Dresser`] aligns garments on a body, and
//! [`wardrobe::matching`] resolves the outfit. [`animate()`] moves a clean outfit through the frames
//! of a motion.
//!
#![doc = include_str!("../README.md")]

pub mod animate;
pub mod asset;
mod build;
#[cfg(feature = "reconstruct")]
pub mod capture;
#[cfg(feature = "reconstruct")]
pub mod fitting;
pub mod outfit_page;
#[cfg(feature = "reconstruct")]
pub mod reconstruct;
pub mod wardrobe;

pub use animate::{AnimateParams, SkinnedOutfit, animate};
pub use asset::{Asset, AssetError};
pub use build::BUILD;
#[cfg(feature = "reconstruct")]
pub use capture::{Capture, CaptureError};
#[cfg(feature = "reconstruct")]
pub use fitting::MeshTarget;
#[cfg(feature = "reconstruct")]
pub use reconstruct::{ReconstructError, ReconstructParams, Reconstruction, reconstruct};
pub use wardrobe::dresser::Dresser;
pub use wardrobe::{Wardrobe, WardrobeError};

pub use if_body::{Pose, Skeleton, TemplateBody};
pub use if_core::mesh::TriMesh;
pub use if_core::monitor::{Cancelled, Monitor, Progress, Silent};
pub use if_outfit::resolve::ResolveParams;
