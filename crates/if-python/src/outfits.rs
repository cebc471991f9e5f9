//! `resolve` and `verify`.

use crate::errors::{Exception, no_json};
use crate::layers::{LayerArrays, faces, vertices};
use crate::work;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{own_pairs as pairs_within, pairs_between};
use if_mesh::seams::{weld, weld_all};
use if_outfit::unresolved::Unresolved;
use if_outfit::{
    Cleanness, Layer, Outfit, OutfitError, ResolveError, ResolveParams, Resolved, notes,
    with_parameter,
};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::json;

/// Positions, and triangles if they were split.
type Arrays<'py> = (Bound<'py, PyArray2<f64>>, Option<Bound<'py, PyArray2<i64>>>);

/// A resolved outfit for the Python part.
#[derive(IntoPyObject)]
pub(crate) struct ResolvedArrays<'py> {
    /// Of the garments.
    layers: Vec<Arrays<'py>>,
    /// Positions of a body that was drawn back.
    body: Option<Bound<'py, PyArray2<f64>>>,
    /// `ResolveReport` as JSON.
    report: String,
    state: String,
    notes: Vec<String>,
    /// What remains, as a sentence and as JSON; `None` if the outfit is as clean as asked for.
    unresolved: Option<(String, String)>,
}

/// A verified outfit for the Python part.
#[derive(IntoPyObject)]
pub(crate) struct VerifiedArrays {
    /// `Verification` as JSON.
    report: String,
    state: String,
    notes: Vec<String>,
}

/// Resolves an outfit; the first layer is the body. `params` are names and JSON values.
#[pyfunction]
#[pyo3(signature = (layers, params, clearance, strict, threads, progress))]
pub(crate) fn resolve<'py>(
    py: Python<'py>,
    layers: Vec<LayerArrays<'py>>,
    params: Vec<(String, String)>,
    clearance: Option<f64>,
    strict: bool,
    threads: Option<usize>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<ResolvedArrays<'py>> {
    let params = named(py, ResolveParams::default(), &params, clearance)?;
    layers.iter().skip(1).try_for_each(|layer| layer.check_split(py, &params))?;
    let layers = owned(&layers)?;
    let result = work::run(py, threads, progress.as_ref(), move |monitor| {
        let outfit = outfit(layers)?;
        let resolved = match if_outfit::resolve(&outfit, &params, monitor) {
            Err(ResolveError::Unresolved { result, triangles, .. }) => (*result, triangles),
            other => (other?, Vec::new()),
        };
        Ok((resolved, notes(&outfit)))
    })?;
    let ((resolved, triangles), of_meshes) = result.map_err(|e: ResolveError| e.raised(py))?;
    let arrays = resolved.outfit.garments.iter().zip(&resolved.splits).map(|(layer, split)| {
        let split = split.as_ref().map(|_| faces(py, layer.mesh.triangles())).transpose()?;
        Ok((vertices(py, layer.mesh.vertices())?, split))
    });
    let report = &resolved.report;
    let drawn_back = report.drawn_back.as_ref();
    let body =
        drawn_back.map(|_| vertices(py, resolved.outfit.body.mesh.vertices())).transpose()?;
    let mut notes = report.notes(&resolved.outfit.body.name);
    notes.extend(of_meshes);
    Ok(ResolvedArrays {
        layers: arrays.collect::<PyResult<_>>()?,
        body,
        report: serde_json::to_string(report).map_err(no_json)?,
        state: report.cleanness().to_string(),
        notes,
        unresolved: unresolved(&resolved, &triangles, strict),
    })
}

/// Verifies an outfit; the first layer is the body.
#[pyfunction]
#[pyo3(signature = (layers, threads))]
pub(crate) fn verify(
    py: Python<'_>,
    layers: Vec<LayerArrays<'_>>,
    threads: Option<usize>,
) -> PyResult<VerifiedArrays> {
    let layers = owned(&layers)?;
    let result = work::run(py, threads, None, move |_| {
        let outfit = outfit(layers)?;
        let found = if_outfit::verify(&outfit)?;
        let mut all = found.notes(&outfit.body.name);
        all.extend(notes(&outfit));
        Ok((found, all))
    })?;
    let (found, notes) = result.map_err(|e: OutfitError| e.raised(py))?;
    let report = serde_json::to_string(&found).map_err(no_json)?;
    Ok(VerifiedArrays { report, state: found.cleanness().to_string(), notes })
}

/// Two layers, and an array of the triangles of both in which they intersect.
type LayerPairs<'py> = ([usize; 2], Bound<'py, PyArray2<i64>>);

/// The intersecting triangle pairs of every two layers, and of each with itself.
#[pyfunction]
#[pyo3(signature = (layers, threads))]
pub(crate) fn intersections<'py>(
    py: Python<'py>,
    layers: Vec<LayerArrays<'py>>,
    threads: Option<usize>,
) -> PyResult<Vec<LayerPairs<'py>>> {
    let meshes: Vec<TriMesh> =
        layers.iter().map(|layer| Ok(layer.layer()?.mesh)).collect::<PyResult<_>>()?;
    let found = work::run(py, threads, None, move |_| {
        // As `verify` counts them: seams are closed, and of garments what is sewn on is one with the rest.
        // Triangles keep their order.
        let welded = meshes.into_par_iter().enumerate().map(|(layer, mesh)| {
            let welded = if layer == 0 { weld(&mesh) } else { weld_all(&mesh) };
            welded.map_or(mesh, |welded| welded.mesh)
        });
        let (meshes, trees): (Vec<TriMesh>, Vec<Bvh>) = welded
            .map(|mesh| {
                let tree = Bvh::new(&mesh);
                (mesh, tree)
            })
            .unzip();
        let own = meshes.iter().zip(&trees).enumerate();
        let own = own.map(|(k, (mesh, tree))| ([k, k], pairs_within(mesh, tree)));
        let own = own.filter(|(_, pairs)| !pairs.is_empty());
        pairs_between(&trees).into_iter().chain(own).collect::<Vec<_>>()
    })?;
    let arrays = found.into_iter().map(|(layers, pairs)| {
        let flat = pairs.iter().flat_map(|p| [i64::from(p.a), i64::from(p.b)]).collect();
        Ok((layers, PyArray1::from_vec(py, flat).reshape([pairs.len(), 2])?))
    });
    arrays.collect()
}

/// The default parameters, as JSON.
#[pyfunction]
pub(crate) fn default_params() -> PyResult<String> {
    serde_json::to_string(&ResolveParams::default()).map_err(no_json)
}

/// The parameters `default`, with those replaced that are given by name, as JSON. Ranges are not checked.
pub(crate) fn with_named<T: Clone + Serialize + DeserializeOwned>(
    py: Python<'_>,
    default: T,
    params: &[(String, String)],
) -> PyResult<T> {
    params.iter().try_fold(default, |found, (name, json)| {
        let value: serde_json::Value = serde_json::from_str(json)
            .map_err(|e| PyValueError::new_err(format!("params[{name:?}]: {e}")))?;
        with_parameter(&found, name, &value).map_err(|e| e.raised(py))
    })
}

/// Parameters of [`resolve`] by name; `default` for others.
pub(crate) fn named(
    py: Python<'_>,
    default: ResolveParams,
    params: &[(String, String)],
    clearance: Option<f64>,
) -> PyResult<ResolveParams> {
    let mut found = with_named(py, default, params)?;
    if let Some(clearance) = clearance {
        found.goal.clearance = clearance;
    }
    found.validate().map_err(|e| e.raised(py))?;
    Ok(found)
}

/// The body and the garments.
///
/// # Errors
///
/// `ValueError` that names argument, row and value.
pub(crate) fn owned(layers: &[LayerArrays<'_>]) -> PyResult<(Layer, Vec<Layer>)> {
    let mut layers = layers.iter().map(LayerArrays::layer).collect::<PyResult<Vec<Layer>>>()?;
    if layers.is_empty() {
        return Err(PyValueError::new_err("there is no body"));
    }
    Ok((layers.remove(0), layers))
}

/// The outfit of a body and garments.
///
/// # Errors
///
/// They are no valid outfit.
pub(crate) fn outfit((body, garments): (Layer, Vec<Layer>)) -> Result<Outfit, OutfitError> {
    Outfit::new(body, garments)
}

/// What remains, as a sentence and as JSON; `None` if the outfit is as clean as asked for.
fn unresolved(
    resolved: &Resolved,
    triangles: &[[u32; 2]],
    strict: bool,
) -> Option<(String, String)> {
    let report = &resolved.report;
    let (message, between, own) = if let Some(found) = Unresolved::in_report(report) {
        let between = found.between.as_ref().map(
            |b| json!({"pairs": b.pairs, "inside": b.inside, "outer": b.outer, "inner": b.inner}),
        );
        (found.to_string(), between, found.own)
    } else if strict && report.cleanness() != Cleanness::Everywhere {
        let own = own_pairs(resolved);
        let named: Vec<String> = own.iter().map(|(name, n)| format!("of `{name}`: {n}")).collect();
        let own_pairs = named.join(", ");
        (format!("clean between layers, but not everywhere: own pairs {own_pairs}"), None, own)
    } else {
        return None;
    };
    let own: serde_json::Map<_, _> = own.into_iter().map(|(k, n)| (k, json!(n))).collect();
    let json = json!({"between": between, "own": own, "triangles": triangles});
    Some((message, json.to_string()))
}

/// The layers that intersect themselves, and in how many triangle pairs.
fn own_pairs(resolved: &Resolved) -> Vec<(String, usize)> {
    let after = &resolved.report.after;
    let counts = std::iter::once(&after.body_own_pairs).chain(&after.own_pairs);
    let layers = resolved.outfit.layers().map(|layer| layer.name.clone());
    layers.zip(counts.copied()).filter(|(_, n)| *n > 0).collect()
}
