//! Behaviour across crates: what `resolve` and `verify` promise.

mod asset_fields;
mod bad_input;
mod build_scripts;
mod determinism;
mod distances;
mod easing;
mod guarantee;
mod own;
mod paper;
mod scenes;
mod skipping;
mod split;
mod tuck;
