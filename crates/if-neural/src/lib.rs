//! Neural fields on CPUs: the canonical signed distance field and the deformation of *IF-Garments*
//! (supplement, Appendix E), fitted and evaluated by fused kernels, without a GPU.

#[cfg(feature = "burn")]
pub mod burn;
pub mod deformation;
mod deformation_tile;
pub mod encoding;
pub mod frozen;
mod init;
pub mod kernel;
pub mod mlp;
pub mod reference;
pub mod reference_deformation;
pub mod sdf;
mod step;
pub mod trainable;
