//! From a capture to the clothed person in canonical space, and to garments.
//!
//! [`reconstruct`] runs all stages. Each is a function of its own; all return [`ReconstructError`]
//! and report the stages in the last column to their monitor:
//!
//! | stage | functions | reported as |
//! |---|---|---|
//! | refinement of poses that are estimates | [`refine_poses`] | `read`, `start`, `poses` |
//! | the surface, from masks, normals and poses | [`fit_surface`] | `read`, `start`, `surface` |
//! | one closed canonical mesh with weights | [`FloodedField`], [`if_mesh::extract()`], [`largest_piece`], [`carried_weights`] | `extract` |
//! | φ and d as networks, trained on all frames, if requested | [`fit_fields`] | `read`, `phi`, `fields` |
//! | the motion of single frames | [`fit_motion`], [`MeshMotion`] | `read`, `motion` |
//! | that motion as a network with an embedding for each frame | [`distil_motion`] | `motion_network` |
//! | φ as a network | [`fit_phi`] | `phi` |
//! | garments, from label images | [`find_garments`] | `garments` |
//! | the mesh in each frame | [`posed`], [`write_frames`] | |
//!
//! Measurements are in `docs/evidence/reconstruction.md`; the benches' program
//! `reconstruction_stages` runs the stages one by one and compares them with a visual hull.

mod canonical;
mod checkpoint;
mod crumpled;
mod distance_image;
mod embedded;
mod error;
mod evidence;
mod fair;
mod fields;
mod figure;
mod frames;
mod garments;
mod hems;
mod hull;
mod lattice;
mod lids;
mod loose;
mod mask_rim;
mod motion;
mod observe;
mod params;
mod phi;
mod poses;
mod progress;
mod projection;
mod quality;
mod refine;
mod report;
mod sealed;
mod shown;
mod skipped;
mod start;
mod struts;
mod surface;
mod underside;
mod whole;
mod whole_report;

pub use canonical::{FloodedField, carried_weights, largest_piece};
pub use error::ReconstructError;
pub use fields::{
    Fields, FieldsParams, FieldsReport, FieldsRound, FieldsWeights, Rays, fit_fields,
};
pub use frames::{posed, write_frames};
pub use garments::{ClothedPerson, Garment, GarmentParams, Garments, find_garments};
#[doc(hidden)] // a baseline, for the benches
pub use hull::VisualHull;
pub use motion::{
    FrameMotion, MeshMotion, Motion, MotionNetwork, MotionNetworkParams, MotionNetworkReport,
    MotionParams, MotionReport, MotionRound, distil_motion, fit_motion,
};
pub use params::SurfaceParams;
pub use phi::{PhiNetwork, PhiParams, PhiReport, fit_phi};
pub use poses::{JointCorrection, PoseParams, PoseReport, PoseRound, RefinedPoses, refine_poses};
pub use quality::{Doubt, FrameQuality, JointQuality, QualityReport, Residual};
pub use report::{Filled, Pixels, Round, StartReport, SurfaceReport};
pub use shown::LabelShown;
pub use skipped::Skipped;
pub use surface::{Surface, fit_surface};
pub use underside::Underside;
pub use whole::{ReconstructParams, Reconstruction, fields_checkpoint, reconstruct};
pub use whole_report::{
    GarmentReport, LabelContradiction, LabelReport, ReconstructReport, Seconds,
};
