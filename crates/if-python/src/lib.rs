//! The native part of the Python package `ifgarments`: a thin client of the libraries.
//!
//! Arrays become meshes (`layers`), work runs without the interpreter's lock and can be cancelled
//! (`work`), errors become the exceptions of `ifgarments.errors` (`errors`). What depends on
//! kinds of Python objects (trimesh, Open3D, meshio) stands in `python/ifgarments`.
//!
#![doc = include_str!("../README.md")]

mod animate;
mod capture;
mod command;
mod errors;
mod fields;
mod layers;
mod outfits;
mod scene;
mod wardrobe;
mod work;

use pyo3::prelude::pymodule;

#[pymodule(gil_used = true)]
mod _ifgarments {
    #[pymodule_export]
    use crate::animate::animate;
    #[pymodule_export]
    use crate::capture::reconstruct;
    #[pymodule_export]
    use crate::command::ifg;
    #[pymodule_export]
    use crate::fields::{extract, fit};
    #[pymodule_export]
    use crate::outfits::{default_params, intersections, resolve, verify};
    #[pymodule_export]
    use crate::scene::{demo_scene, picture};
    #[pymodule_export]
    use crate::wardrobe::{
        wardrobe_add_body, wardrobe_batch, wardrobe_body, wardrobe_dress, wardrobe_garment,
        wardrobe_list, wardrobe_match,
    };
    #[pymodule_export]
    const BUILD: &str = if_outfit::BUILD;
}
