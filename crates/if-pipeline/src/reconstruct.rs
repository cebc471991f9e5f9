//! From a capture to the clothed person in canonical space.
//!
//! [`fit_surface`] finds the surface from masks, normals and poses.

mod checkpoint;
pub(crate) mod distance_image;
mod evidence;
mod observe;
mod params;
mod progress;
mod refine;
mod report;
mod seen;
mod surface;

pub use checkpoint::CheckpointError;
pub use params::{ParamError, SurfaceParams};
pub use progress::{Progress, Stage};
pub use report::{Pixels, Round, Skipped, SurfaceReport};
pub use surface::{Surface, SurfaceError, fit_surface};
