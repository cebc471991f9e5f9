//! Extraction and clean-up on known and on hostile surfaces.

mod cleanup;
mod extraction;
#[path = "../fields/mod.rs"]
mod fields;
mod voxels;
