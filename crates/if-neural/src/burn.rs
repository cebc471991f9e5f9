//! φ and d in burn (feature `burn`): the networks as modules on any backend, their fits by burn's
//! automatic differentiation, and the fused kernels as an operation that burn differentiates by a
//! hand-written backward pass.
//!
//! [`fit`] and [`fit_deformation`] are the slow twins of [`Fit`](crate::Fit) and
//! [`fit_deformation`](crate::fit_deformation): batches, loss, optimiser, schedule and checks are the
//! same, and the steps run on the backend of the module, such as a GPU. Our own fits run on the
//! kernels without burn. The comparisons are in `tests/burn.rs`.
//!
//! # Examples
//!
//! `examples/train_with_burn.rs` trains both networks, generic over the backend.

mod deformation;
mod encoding;
mod fit;
mod fused;
mod losses;
mod sdf;
mod tensors;

pub use deformation::DeformationModule;
pub use fit::{fit, fit_deformation};
pub use fused::FusedSdf;
pub use sdf::SdfModule;
