//! Neural fields on CPUs: the canonical signed distance field and the deformation of *IF-Garments*
//! (supplement, Appendix E), fitted and evaluated by fused kernels, without a GPU.

#[cfg(feature = "train")]
pub mod accuracy;
#[cfg(feature = "train")]
pub mod adam;
#[cfg(feature = "burn")]
pub mod burn;
#[cfg(feature = "train")]
pub mod cloud;
#[cfg(feature = "train")]
pub mod deform;
pub mod deformation;
mod deformation_tile;
pub mod encoding;
pub mod field;
pub mod files;
#[cfg(feature = "train")]
pub mod fit;
pub mod frame;
pub mod frozen;
pub mod grid;
mod init;
pub mod kernel;
#[cfg(feature = "train")]
pub mod loss;
pub mod mlp;
pub mod network;
#[cfg(feature = "train")]
pub mod parameter_error;
pub mod reference;
pub mod reference_deformation;
#[cfg(feature = "train")]
pub mod sampling;
#[cfg(feature = "train")]
pub mod schedule;
pub mod sdf;
mod step;
#[cfg(feature = "train")]
pub mod target;
pub mod trainable;
