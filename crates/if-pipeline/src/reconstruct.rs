//! From a capture to the clothed person in canonical space, and to garments.
//!
//! [`reconstruct`] does all of it. Its stages are calls of their own:
//!
//! | stage | call |
//! |---|---|
//! | the surface, from masks, normals and poses | [`fit_surface`] |
//! | one canonical mesh, closed, with weights | [`FloodedField`], [`if_mesh::extract`], [`largest_piece`], [`carried_weights`] |
//! | the motion of single frames, by which each is another than the pose alone makes it | [`fit_motion`], [`MeshMotion`] |
//! | the same mesh in each frame | [`posed`], [`write_frames`] |
//! | φ as a network | [`fit_phi`] |
//! | the motion as a network with an embedding for each frame | [`distil_motion`] |
//! | garments, from label images | [`find_garments`] |
//! | a baseline: the visual hull | [`VisualHull`] |
//!
//! What was measured stands in `docs/reconstruction.md`; the stages one after the other, with
//! baselines, in the example `reconstruction_stages`.

mod canonical;
mod checkpoint;
pub(crate) mod distance_image;
mod evidence;
mod fair;
mod frames;
mod garments;
mod hull;
mod loose;
mod motion;
mod observe;
mod params;
mod phi;
mod progress;
mod refine;
mod report;
mod start;
mod surface;
mod underside;
mod whole;
mod whole_report;

pub use canonical::{FloodedField, carried_weights, largest_piece};
pub use checkpoint::CheckpointError;
pub use frames::{FramesError, posed, write_frames};
pub use garments::{Garment, GarmentParams, Garments, GarmentsError, find_garments, openings_of};
pub use hull::{HullError, VisualHull};
pub use motion::{
    FrameMotion, MeshMotion, Motion, MotionError, MotionNetwork, MotionNetworkError,
    MotionNetworkParams, MotionNetworkReport, MotionParams, MotionReport, MotionRound,
    distil_motion, fit_motion,
};
pub use params::{ParamError, SurfaceParams};
pub use phi::{PhiError, PhiNetwork, PhiParams, PhiReport, fit_phi};
pub use progress::{Progress, Stage};
pub use report::{Filled, Pixels, Round, Skipped, StartReport, SurfaceReport};
pub use surface::{Surface, SurfaceError, fit_surface};
pub use underside::Underside;
pub use whole::{ReconstructError, ReconstructParams, Reconstruction, reconstruct};
pub use whole_report::{GarmentReport, LabelReport, ReconstructReport, Seconds};
