//! From a capture to the clothed person in canonical space.
//!
//! [`fit_surface`] finds the surface from masks, normals and poses.

mod canonical;
mod checkpoint;
pub(crate) mod distance_image;
mod evidence;
mod fair;
mod frames;
mod hull;
mod observe;
mod params;
mod progress;
mod refine;
mod report;
mod surface;

pub use canonical::{carried_weights, largest_piece};
pub use checkpoint::CheckpointError;
pub use frames::{FramesError, posed, write_frames};
pub use hull::{HullError, VisualHull};
pub use params::{ParamError, SurfaceParams};
pub use progress::{Progress, Stage};
pub use report::{Pixels, Round, Skipped, SurfaceReport};
pub use surface::{Surface, SurfaceError, fit_surface};
