//! φ in burn (feature `burn`): the network as a module on any backend, and the fused kernels as an
//! operation that burn differentiates by a hand-written backward pass.
//!
//! Only this module uses burn: fits run on the kernels without it. It is for those who train with
//! burn's optimisers, losses and records. The plain graph is the slow twin that the kernels are
//! compared with, in `tests/burn.rs`.

mod fused;
mod module;

pub use fused::FusedSdf;
pub use module::SdfModule;
