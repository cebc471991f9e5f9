//! Intersection-free layered garments: the whole of if-garments behind one name.
//!
//! [`outfit::resolve`] takes an [`outfit::Outfit`] (a closed body and its garments, inner to outer)
//! and returns it without intersections between its layers, proven by exact predicates.
//! [`pipeline`] makes garments from videos and matches them on other bodies.

pub use if_body as body;
pub use if_core as core;
pub use if_mesh as mesh;
#[cfg(feature = "reconstruct")]
pub use if_neural as neural;
pub use if_outfit as outfit;
pub use if_pipeline as pipeline;
pub use if_render as render;
pub use if_xpbd as xpbd;

/// The example in the project's README is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
