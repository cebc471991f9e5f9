//! Hostile input of every kind for every crate: each case ends finite, bounded and with the same bits, or in a typed
//! error that names the cause. Nothing panics. What is run, how often and what it found: docs/stability.md.
//!
//! `STABILITY_CASE=name/number` runs one case of a property again.

mod cases;
mod equivariance;
mod fields;
mod meshes;
mod rest;
mod solver;
mod solver_scene;
