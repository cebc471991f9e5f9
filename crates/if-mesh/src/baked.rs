//! A narrow-band grid of any signed distance field: tens of nanoseconds a query, whatever the
//! source costs, and a known bound on the error. Cells are as small as that error requires, each
//! where it is.
//!
//! [`Baked::new`] bakes a field; [`Baked::to_bytes`] and [`Baked::from_bytes`] store it.

mod accuracy;
mod bake;
mod band;
mod blend;
mod bricks;
mod directory;
mod error;
mod field;
mod file;
mod index;
mod join;
mod params;
mod refine;
mod samples;
mod zero_set;

pub use error::BakeError;
pub use field::Baked;
pub use file::BakedFileError;
pub use params::{BakeParams, Redistance};

#[cfg(test)]
mod tests;
