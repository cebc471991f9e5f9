//! Layered outfits made intersection-free, and proven so: the façade of if-garments.

pub mod baselines;
mod contacts;
mod own;
mod retract;
mod settle;
pub mod mannequin;
pub mod outfit;
pub mod render;
pub mod report;
pub mod resolve;
pub mod verify;
