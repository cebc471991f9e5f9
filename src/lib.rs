//! Intersection-free layered garments: all crates of if-garments behind one name.
//!
//! [`resolve()`] takes an [`Outfit`] (a body and its garments, inner to outer) and returns it
//! without intersections between its layers, proven by exact predicates. [`verify()`] is the proof
//! alone. [`OutfitFiles`] does the same for mesh files, and proves exactly what it writes. With the
//! feature `reconstruct` (on by default), [`pipeline`] makes garments from captures
//! of videos and combines them on other bodies.
//!
//! | module | what is in it |
//! |---|---|
//! | [`core`] | points, [`TriMesh`], signed distance fields, exact intersection, [`Monitor`] |
//! | [`mesh`] | files, spatial index, closed layers, baked fields, extraction, clean-up, measures |
//! | [`xpbd`] | the cloth solver: particles, constraint groups, Algorithm 1 of the paper |
//! | `neural` | networks as signed distance fields, and their fits; feature `reconstruct` |
//! | [`outfit`] | [`resolve()`], [`verify()`], reports, outfits of files |
//! | [`body`] | skeletons, skinning, alignment between bodies, the built-in mannequin |
//! | [`render`] | pictures in software, report pages |
//! | [`pipeline`] | captures, reconstruction, wardrobes |
//!
//! # Examples
//!
//! A T-shirt that goes through the body, before and after:
//!
//! ```
//! use if_garments::body::mannequin::{self, Garment, MannequinParams};
//! use if_garments::{GoalParams, Layer, Outfit, ResolveParams, Silent, resolve, verify};
//!
//! let scene = MannequinParams { resolution: 0.7, ..Default::default() };
//! let body = Layer::new("body", mannequin::body(&scene));
//! let tshirt = Layer::new("tshirt", mannequin::garment(Garment::Tshirt, &scene));
//! let outfit = Outfit::new(body, vec![tshirt])?;
//! assert!(!verify(&outfit)?.is_clean());
//!
//! let goal = GoalParams { clearance: 0.0005, ..Default::default() };
//! let params = ResolveParams { goal, ..Default::default() };
//! let resolved = resolve(&outfit, &params, &mut Silent)?;
//! assert!(verify(&resolved.outfit)?.is_clean());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use if_body as body;
pub use if_core as core;
pub use if_mesh as mesh;
#[cfg(feature = "reconstruct")]
pub use if_neural as neural;
pub use if_outfit as outfit;
pub use if_pipeline as pipeline;
pub use if_render as render;
pub use if_xpbd as xpbd;

pub use if_core::{Cancelled, Monitor, ParameterError, Progress, Silent, TriMesh, nalgebra};
pub use if_mesh::MeshFile;
pub use if_outfit::files::{FilesError, LayerFile, OutfitFiles, ResolvedFiles};
pub use if_outfit::{
    Cleanness, ClothParams, EffortParams, GoalParams, Layer, Method, Outfit, OutfitError, Own,
    Pinch, ResolveError, ResolveParams, ResolveReport, Resolved, Split, Storage, Tuck,
    Verification, resolve, verify,
};

/// The examples in the README and in the guides are tests.
#[cfg(doctest)]
mod guides {
    #[doc = include_str!("../README.md")]
    struct Readme;
    #[doc = include_str!("../docs/get-started.md")]
    struct GetStarted;
    #[doc = include_str!("../docs/resolve-an-outfit.md")]
    struct ResolveAnOutfit;
    #[doc = include_str!("../docs/neural-fields.md")]
    struct NeuralFields;
}
