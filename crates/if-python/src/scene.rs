//! The built-in scene, and pictures.

use crate::errors::Exception;
use crate::layers::{LayerArrays, NamedArrays, named_arrays};
use crate::work;
use if_body::mannequin::{self, MannequinParams};
use if_core::mesh::TriMesh;
use if_render::{View, preview};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The views of pictures, as `ifg` draws them.
const VIEWS: [View; 4] = [View::FRONT, View::THREE_QUARTER, View::BACK, View::HALF];
/// Valid heights of pictures, in pixels.
const HEIGHTS: std::ops::RangeInclusive<u32> = 16..=4096;

/// The built-in scene: the body, then garments, inner to outer.
#[pyfunction]
#[pyo3(signature = (trousers, resolution, overlap))]
pub(crate) fn demo_scene(
    py: Python<'_>,
    trousers: bool,
    resolution: f64,
    overlap: f64,
) -> PyResult<Vec<NamedArrays<'_>>> {
    let params = MannequinParams { resolution, overlap };
    params.validate().map_err(|e| e.raised(py))?;
    let scene = if trousers { mannequin::layered_with_trousers } else { mannequin::layered };
    let layers = work::run(py, None, None, move |_| scene(&params))?;
    layers.into_iter().map(|(name, mesh)| named_arrays(py, name, &mesh)).collect()
}

/// A PNG file of layers, intersecting triangles in red; the first layer is the body.
#[pyfunction]
#[pyo3(signature = (layers, height))]
pub(crate) fn picture<'py>(
    py: Python<'py>,
    layers: Vec<LayerArrays<'py>>,
    height: u32,
) -> PyResult<Bound<'py, PyBytes>> {
    if !HEIGHTS.contains(&height) {
        let [least, most] = [HEIGHTS.start(), HEIGHTS.end()];
        let message = format!("height is {height}; it must be from {least} to {most} pixels");
        return Err(PyValueError::new_err(message));
    }
    let meshes: Vec<TriMesh> =
        layers.iter().map(|l| Ok(l.layer()?.mesh)).collect::<PyResult<_>>()?;
    let png = work::run(py, None, None, move |_| {
        let meshes: Vec<&TriMesh> = meshes.iter().collect();
        let mut png = Vec::new();
        let image = preview(&meshes, &VIEWS, [height * 5 / 8, height]);
        image.write_png(&mut png).map(|()| png)
    })?;
    match png {
        Ok(png) => Ok(PyBytes::new(py, &png)),
        Err(error) => Err(PyValueError::new_err(error.to_string())),
    }
}
