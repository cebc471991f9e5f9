//! φ in burn (feature `burn`): the network as a module on any backend, and the fused kernels as an
//! operation that burn differentiates by a hand-written backward pass.
//!
//! Nothing else in the workspace names burn: fits run on the kernels beside it. Here they serve
//! those who train with burn's optimisers, losses and records, and the plain graph is the slow
//! twin that the kernels are held against.

pub mod fused;
pub mod module;
