//! Pictures of layered meshes, and pages that show them.
//!
//! [`preview::preview`] draws the layers of an outfit with intersections in red; [`render`] has the
//! rasteriser, [`page`] the one-file HTML reports.

pub mod page;
pub mod preview;
pub mod render;
