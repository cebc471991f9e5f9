//! Hostile input of every kind for every crate: each case ends finite, bounded and with the same
//! bits, or in a typed error that names the cause. Nothing panics. What is run, how often and what
//! it found: docs/evidence/stability.md.
//!
//! `STABILITY_CASE=name/number` runs one case of a property again; `STABILITY_SEED=number` draws
//! all cases anew.

mod cases;
mod driven;
mod equivariance;
mod fields;
mod files;
mod index;
mod meshes;
mod networks;
mod numbers;
mod outfits;
mod people;
mod rest;
#[path = "../behaviour/scenes.rs"]
mod scenes;
mod solver;
mod solver_scene;
mod surfaces;
