//! Wardrobes: folders of bodies and garments. Each call reads the folder anew.

use crate::errors::{Exception, no_json};
use crate::layers::{NamedArrays, named_arrays};
use crate::outfits::named;
use crate::work;
use if_body::AlignParams;
use if_core::mesh::TriMesh;
use if_core::monitor::Progress;
use if_pipeline::wardrobe::batch::{self, BatchParams, Event, shard_folder};
use if_pipeline::wardrobe::combination::Combination;
use if_pipeline::wardrobe::dresser::Dresser;
use if_pipeline::wardrobe::matching::{MatchParams, Placed, run_into_folder};
use if_pipeline::wardrobe::{NewBody, Wardrobe, WardrobeError};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use serde_json::json;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Bodies, garments and unreadable folders, as JSON.
#[pyfunction]
pub(crate) fn wardrobe_list(py: Python<'_>, root: PathBuf) -> PyResult<String> {
    let listed = work::run(py, None, None, move |_| {
        Wardrobe::open(&root).map(|wardrobe| {
            let fault = |f: &if_pipeline::wardrobe::Unreadable| {
                let (part, error) = (f.part.to_string(), f.error.to_string());
                json!({"part": part, "name": f.name, "error": error})
            };
            json!({
                "bodies": wardrobe.bodies(),
                "garments": wardrobe.garments(),
                "faults": wardrobe.faults().iter().map(fault).collect::<Vec<_>>(),
            })
        })
    })?;
    Ok(listed.map_err(|e| e.raised(py))?.to_string())
}

/// Adds a body of files unless the wardrobe has it, and returns the name it has there.
#[pyfunction]
#[pyo3(signature = (root, name, mesh, template, skeleton, scale))]
pub(crate) fn wardrobe_add_body(
    py: Python<'_>,
    root: PathBuf,
    name: String,
    mesh: PathBuf,
    template: Option<PathBuf>,
    skeleton: Option<PathBuf>,
    scale: f64,
) -> PyResult<String> {
    let added = work::run(py, None, None, move |_| {
        let (template, skeleton) = (template.as_deref(), skeleton.as_deref());
        let new = NewBody { template, skeleton, scale, ..NewBody::new(&name, &mesh) };
        Wardrobe::open(&root)?.add_body_once(&new)
    })?;
    Ok(added.map_err(|e: WardrobeError| e.raised(py))?.name)
}

/// The mesh of a body.
#[pyfunction]
pub(crate) fn wardrobe_body(
    py: Python<'_>,
    root: PathBuf,
    name: String,
) -> PyResult<NamedArrays<'_>> {
    read(py, move || {
        let mesh = Wardrobe::open_existing(&root)?.body(&name)?.mesh;
        Ok((name, mesh))
    })
}

/// The mesh of a garment, in the canonical pose of the body it was made on.
#[pyfunction]
pub(crate) fn wardrobe_garment(
    py: Python<'_>,
    root: PathBuf,
    name: String,
) -> PyResult<NamedArrays<'_>> {
    read(py, move || {
        let mesh = Wardrobe::open_existing(&root)?.garment(&name)?.mesh;
        Ok((name, mesh))
    })
}

fn read(
    py: Python<'_>,
    read: impl FnOnce() -> Result<(String, TriMesh), WardrobeError> + Send + 'static,
) -> PyResult<NamedArrays<'_>> {
    let found = work::run(py, None, None, move |_| read())?;
    let (name, mesh) = found.map_err(|e| e.raised(py))?;
    named_arrays(py, name, &mesh)
}

/// A body, and garments aligned on it: not resolved.
#[pyfunction]
#[pyo3(signature = (root, body, garments, threads))]
pub(crate) fn wardrobe_dress(
    py: Python<'_>,
    root: PathBuf,
    body: String,
    garments: Vec<String>,
    threads: Option<usize>,
) -> PyResult<Vec<NamedArrays<'_>>> {
    let dressed = work::run(py, threads, None, move |_| {
        let wardrobe = Wardrobe::open_existing(&root)?;
        let dresser = Dresser::new(&wardrobe, AlignParams::default());
        dresser.dress(&Combination { body, garments }).map(|dressed| dressed.outfit)
    })?;
    let outfit = dressed.map_err(|e: WardrobeError| e.raised(py))?;
    outfit.layers().map(|layer| named_arrays(py, layer.name.clone(), &layer.mesh)).collect()
}

/// Resolves a combination (body, garments) into a folder: `result.json`, and where the result is.
/// `params` are those by name and the clearance; `options` whether unproven results are written,
/// whether it is done again, and the height of pictures.
#[pyfunction]
#[pyo3(signature = (root, combination, out, params, options, threads, progress))]
pub(crate) fn wardrobe_match(
    py: Python<'_>,
    root: PathBuf,
    combination: (String, Vec<String>),
    out: PathBuf,
    params: (Vec<(String, String)>, Option<f64>),
    options: (bool, bool, u32),
    threads: Option<usize>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<(String, &'static str)> {
    let (body, garments) = combination;
    let (unproven, again, picture_height) = options;
    let default = MatchParams::default();
    let resolve = named(py, default.resolve, &params.0, params.1)?;
    let params = MatchParams {
        body: true,
        unproven,
        picture_height,
        resolve,
        tool: if_cli::versions(),
        ..default
    };
    let matched = work::run(py, threads, progress.as_ref(), move |monitor| {
        let wardrobe = Wardrobe::open_existing(&root)?;
        let dresser = Dresser::new(&wardrobe, AlignParams::default());
        let combination = Combination { body, garments };
        run_into_folder(&out, &dresser, &combination, &params, again, monitor)
    })?;
    let (result, placed) = matched.map_err(|e: WardrobeError| e.raised(py))?;
    let placed = match placed {
        Placed::Before => "before",
        Placed::Written => "written",
        Placed::Nowhere => "nowhere",
    };
    Ok((serde_json::to_string(&result).map_err(no_json)?, placed))
}

/// Resolves many combinations into a folder, or a named part of them: the entries of the summary as
/// JSON. `options` are whether meshes are written, whether all is done again, the height of
/// pictures, and how many are done at once.
#[pyfunction]
#[pyo3(signature = (root, combinations, out, params, options, threads, progress))]
pub(crate) fn wardrobe_batch(
    py: Python<'_>,
    root: PathBuf,
    combinations: Vec<(String, Vec<String>)>,
    out: (PathBuf, Option<String>),
    params: (Vec<(String, String)>, Option<f64>),
    options: (bool, bool, u32, usize),
    threads: Option<usize>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<String> {
    let (meshes, again, picture_height, at_once) = options;
    let default = MatchParams::default();
    let resolve = named(py, default.resolve, &params.0, params.1)?;
    let tool = if_cli::versions();
    let params = MatchParams { meshes, picture_height, resolve, tool, ..default };
    let (out, part) = out;
    let out = part.map_or(out.clone(), |part| shard_folder(&out, &part));
    let done = work::run(py, threads, progress.as_ref(), move |monitor| {
        let wardrobe = Wardrobe::open_existing(&root)?;
        let dresser = Dresser::new(&wardrobe, AlignParams::default());
        let combinations: Vec<Combination> = combinations
            .into_iter()
            .map(|(body, garments)| Combination { body, garments })
            .collect();
        let state = Mutex::new((0, monitor));
        let watch = |event: &Event<'_>| {
            let (done, monitor) = &mut *state.lock().unwrap_or_else(PoisonError::into_inner);
            let reported = match event {
                Event::Working(_, progress) => monitor.report(progress),
                Event::Done(k, ..) => {
                    *done += 1;
                    let item = combinations[*k].to_string();
                    let total = Some(combinations.len());
                    let stage = Progress::stage("combination").of(&item);
                    monitor.report(&Progress { done: *done, total, ..stage })
                }
            };
            if reported.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let batch = BatchParams { at_once, again };
        batch::run(&out, &dresser, &combinations, &params, &batch, &watch)
    })?;
    let summary = done.map_err(|e: WardrobeError| e.raised(py))?;
    let summary = summary.ok_or_else(|| PyRuntimeError::new_err("cancelled"))?;
    serde_json::to_string(&summary.entries).map_err(no_json)
}
