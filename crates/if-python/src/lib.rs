//! The native part of the Python package `ifgarments`: a thin client of the libraries.
//!
//! Arrays become meshes ([`layers`]), work runs without the interpreter's lock and can be cancelled
//! ([`work`]), errors become the exceptions of `ifgarments.errors` ([`errors`]). What depends on
//! kinds of Python objects (trimesh, Open3D, meshio) stands in `python/ifgarments`.
//!
#![doc = include_str!("../README.md")]

mod errors;
mod layers;
mod outfits;
mod scene;
mod work;

use pyo3::prelude::pymodule;

#[pymodule(gil_used = true)]
mod _ifgarments {
    #[pymodule_export]
    use crate::outfits::{default_params, resolve, verify};
    #[pymodule_export]
    use crate::scene::{demo_scene, picture};
    #[pymodule_export]
    const BUILD: &str = if_outfit::BUILD;
}
