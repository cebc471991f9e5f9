//! Layered outfits made intersection-free, and proven so: the façade of if-garments.

pub mod baselines;
mod contacts;
pub mod mannequin;
pub mod outfit;
mod own;
mod parting;
mod reach;
pub mod render;
pub mod report;
pub mod resolve;
mod settle;
pub mod verify;
