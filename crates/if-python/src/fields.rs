//! Signed distance fields of meshes and of networks: their surfaces, and fits.

use crate::errors::{Exception, chain, exception, no_json};
use crate::layers::{LayerArrays, NamedArrays, named_arrays};
use crate::work;
use if_mesh::extract::{self as surface, ExtractParams, Extraction};
use if_mesh::sdf::MeshSdf;
use if_neural::files::{WeightNorm, read_network, write_network};
use if_neural::{Fit, FitParams, NetworkConfig, NeuralField, SamplingParams};
use if_outfit::NamedParameterError;
use if_pipeline::fitting::{MeshTarget, Take};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The surface of a field as a mesh, and `ExtractReport` as JSON. The field is the signed distance
/// of a closed mesh, or a network (the bytes of its file). `params` are those of `ExtractParams`, by name
/// and as JSON.
#[pyfunction]
#[pyo3(signature = (mesh, network, params, threads, progress))]
pub(crate) fn extract<'py>(
    py: Python<'py>,
    mesh: Option<LayerArrays<'py>>,
    network: Option<Vec<u8>>,
    params: Vec<(String, String)>,
    threads: Option<usize>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<(NamedArrays<'py>, String)> {
    let params = with_given(&params).map_err(|e| e.raised(py))?;
    params.validate().map_err(|e| exception(py, "ParameterError", e.to_string()))?;
    let argument = mesh.as_ref().map_or("field".to_owned(), |m| m.argument().to_owned());
    let mesh = mesh.map(|mesh| mesh.layer()).transpose()?.map(|layer| layer.mesh);
    let found = work::run(py, threads, progress.as_ref(), move |monitor| {
        let extraction: Result<Extraction, _> = match (mesh, network) {
            (Some(mesh), _) => {
                let field = MeshSdf::sewn(&mesh).map_err(|e| chain(&e))?;
                surface::extract(&field, &params, monitor)
            }
            (None, network) => {
                let bytes = network.unwrap_or_default();
                let (network, frame) = read_network(&bytes[..]).map_err(|e| chain(&e))?;
                let field = NeuralField::new(network, frame).map_err(|e| chain(&e))?;
                surface::extract(&field, &params, monitor)
            }
        };
        extraction.map_err(|e| chain(&e))
    })?;
    let Extraction { mesh, report, .. } =
        found.map_err(|message: String| PyValueError::new_err(format!("{argument}: {message}")))?;
    let report = serde_json::to_string(&report).map_err(no_json)?;
    Ok((named_arrays(py, argument, &mesh)?, report))
}

/// Default parameters, with those replaced that are given by name, as JSON. Ranges are not checked. (For
/// `with_parameter` a map is a group of parameters; here it is a choice, such as `{"cells": 6}`.)
fn with_given(given: &[(String, String)]) -> Result<ExtractParams, NamedParameterError> {
    let mut params = ExtractParams::default();
    for (name, json) in given {
        let invalid = |e: serde_json::Error| {
            let (name, message) = (name.clone(), e.to_string());
            NamedParameterError::Value { name, message }
        };
        let mut all = serde_json::to_value(params).map_err(invalid)?;
        let Some(place) = all.get_mut(name) else {
            let valid = all.as_object().into_iter().flatten().map(|(name, _)| format!("`{name}`"));
            let valid = valid.collect::<Vec<_>>().join(", ");
            return Err(NamedParameterError::Unknown { name: name.clone(), valid });
        };
        *place = serde_json::from_str(json).map_err(invalid)?;
        params = serde_json::from_value(all).map_err(invalid)?;
    }
    Ok(params)
}

/// Fits a network to the signed distance of a mesh: the bytes of its file, and `FitReport` as JSON.
#[pyfunction]
#[pyo3(signature = (mesh, steps, seconds, accuracy, threads, progress))]
pub(crate) fn fit<'py>(
    py: Python<'py>,
    mesh: LayerArrays<'py>,
    steps: Option<u64>,
    seconds: Option<f64>,
    accuracy: Option<f64>,
    threads: Option<usize>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyBytes>, String)> {
    let argument = mesh.argument().to_owned();
    let config = NetworkConfig::grid();
    let params = FitParams { steps, seconds, accuracy, ..config.fit_params() };
    params.validate().map_err(|e| e.raised(py))?;
    let mesh = mesh.layer()?.mesh;
    let fitted = work::run(py, threads, progress.as_ref(), move |monitor| {
        let target = MeshTarget::new(&mesh, Take::Either).map_err(|e| chain(&e))?;
        let target = target.target();
        let (set, mut network) =
            target.begin(&config, &SamplingParams::default()).map_err(|e| chain(&e))?;
        let params = FitParams { loss: target.loss(), ..params };
        let report = Fit::new(params)
            .map_err(|e| chain(&e))?
            .run(&mut network, &set, monitor)
            .map_err(|e| chain(&e))?;
        let mut file = Vec::new();
        write_network(&mut file, &network, &set.frame, WeightNorm::Kept).map_err(|e| chain(&e))?;
        Ok((file, report))
    })?;
    let (file, report) = fitted
        .map_err(|message: String| PyValueError::new_err(format!("{argument}: {message}")))?;
    Ok((PyBytes::new(py, &file), serde_json::to_string(&report).map_err(no_json)?))
}
