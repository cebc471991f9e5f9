//! Pictures of layered meshes by software rasterisation, and report pages.
//!
//! [`preview`] draws the layers of an outfit with intersecting triangles in red. [`render`] and
//! [`side_by_side`] draw any [`RenderLayer`]s from any [`View`] into an [`Image`], which writes
//! itself as PNG. A [`Page`] is a report as one HTML file, a [`Viewer`] its meshes to turn.
//!
#![doc = include_str!("../README.md")]

mod backdrop;
mod color;
mod image;
mod intersections;
mod light;
mod occlusion;
mod page;
mod preview;
mod raster;
mod render;
mod scene;
mod section;
mod view;
mod viewer;

pub use image::{Image, PngError, write_animation};
pub use intersections::Intersections;
pub use page::Page;
pub use preview::{layer_color, preview};
pub use render::{render, side_by_side};
pub use view::{Cut, PALETTE, RenderLayer, View};
pub use viewer::Viewer;
