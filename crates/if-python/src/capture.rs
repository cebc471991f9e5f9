//! Reconstruction of garments from a capture.

use crate::errors::{chain, exception, no_json};
use crate::layers::{NamedArrays, named_arrays};
use crate::work;
use if_body::{TemplateBody, check_upright};
use if_pipeline::capture::Capture;
use if_pipeline::reconstruct::{self as stages, ReconstructParams, Reconstruction};
use numpy::PyArray1;
use pyo3::prelude::*;
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// A reconstruction for the Python part.
#[derive(IntoPyObject)]
pub(crate) struct ReconstructionArrays<'py> {
    /// The clothed person.
    person: NamedArrays<'py>,
    /// Of each vertex of the person.
    labels: Bound<'py, PyArray1<u8>>,
    /// Inner to outer.
    garments: Vec<NamedArrays<'py>>,
    /// `ReconstructReport` as JSON.
    report: String,
}

/// Reconstructs a clothed person and garments from the folder of a capture.
#[pyfunction]
#[pyo3(signature = (capture, body, cell, every, checkpoint, threads, progress))]
pub(crate) fn reconstruct<'py>(
    py: Python<'py>,
    capture: PathBuf,
    body: PathBuf,
    cell: Option<f64>,
    every: NonZeroUsize,
    checkpoint: Option<PathBuf>,
    threads: Option<usize>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<ReconstructionArrays<'py>> {
    let found = work::run(py, threads, progress.as_ref(), move |monitor| {
        let capture = Capture::open(&capture).map_err(|e| chain(&e))?.every(every);
        let template = TemplateBody::read(&body).map_err(|e| chain(&e))?;
        check_upright(&template.mesh, Some(&template.skeleton))
            .map_err(|e| format!("{}: {e}", body.display()))?;
        let mut params = ReconstructParams::default();
        if let Some(cell) = cell {
            params.cell = cell;
        }
        stages::reconstruct(&capture, &template, &params, checkpoint.as_deref(), monitor)
            .map_err(|e| chain(&e))
    })?;
    let found: Reconstruction =
        found.map_err(|message: String| exception(py, "ReconstructError", message))?;
    let garments = found.garments.iter().map(|g| named_arrays(py, g.name.clone(), &g.mesh));
    Ok(ReconstructionArrays {
        person: named_arrays(py, "person".into(), &found.mesh)?,
        labels: PyArray1::from_slice(py, &found.labels),
        garments: garments.collect::<PyResult<_>>()?,
        report: serde_json::to_string(&found.report).map_err(no_json)?,
    })
}
