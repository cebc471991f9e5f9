//! Outfits that follow motions.

use crate::errors::{Exception, chain, exception, no_json};
use crate::layers::LayerArrays;
use crate::outfits;
use crate::work;
use if_body::{Motion, Skeleton, SkinWeights};
use if_pipeline::animate::{AnimateError, AnimateParams, SkinnedOutfit, animate as follow};
use numpy::{PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use std::error::Error;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Joints and weights of a layer, four of each for a vertex.
type Weights<'py> = (PyReadonlyArray2<'py, u16>, PyReadonlyArray2<'py, f32>);

/// Joints that the motion lacks, and how far the skeleton lies from the body, if it may be another one's.
type Noticed = (Vec<String>, Option<f64>);

/// Report as JSON, names of layers whose weights were taken from the body, what was noticed, and positions
/// of each layer, the body first: shape (frames, vertices, 3).
type Animated<'py> = (String, Vec<String>, Noticed, Vec<Bound<'py, PyArray3<f32>>>);

/// The class of an exception in `ifgarments.errors`, and its message.
type Failure = (&'static str, String);

fn failed<E: Exception + Error>(error: &E) -> Failure {
    (error.class(), chain(error))
}

/// An argument that does not belong to the outfit.
fn unusable(argument: &str, error: &dyn Error) -> Failure {
    ("AnimateError", format!("{argument}: {}", chain(error)))
}

/// Where frames are kept.
enum Folder {
    Given(PathBuf),
    /// Removed when this value is dropped.
    Temporary(TempDir),
}

impl Folder {
    fn path(&self) -> &Path {
        match self {
            Self::Given(path) => path,
            Self::Temporary(folder) => folder.path(),
        }
    }

    fn temporary(&self) -> Option<&Path> {
        matches!(self, Self::Temporary(_)).then(|| self.path())
    }
}

/// Moves a clean outfit through a motion; the first layer is the body. `skeleton` and `motion` are
/// JSON, `params` names and JSON values. Frames are kept in `folder`; if it is `None`, in a temporary folder, which is removed when the
/// work ends. That may be after this call, if it was interrupted.
#[pyfunction]
#[pyo3(signature = (layers, weights, skeleton, motion, folder, params, threads, progress))]
pub(crate) fn animate<'py>(
    py: Python<'py>,
    layers: Vec<LayerArrays<'py>>,
    weights: Vec<Option<Weights<'py>>>,
    skeleton: Vec<u8>,
    motion: Vec<u8>,
    folder: Option<PathBuf>,
    params: Vec<(String, String)>,
    threads: Option<usize>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Animated<'py>> {
    let params: AnimateParams = outfits::with_named(py, &params)?;
    params.validate().map_err(|e| e.raised(py))?;
    let weights = weights.iter().map(|w| w.as_ref().map(records));
    let weights: Vec<_> = layers.iter().map(|layer| layer.name().to_owned()).zip(weights).collect();
    let layers = outfits::owned(&layers)?;
    let folder =
        folder.map_or_else(|| TempDir::new().map(Folder::Temporary), |f| Ok(Folder::Given(f)))?;
    let temporary = folder.temporary().map(Path::to_owned);
    let found = work::run(py, threads, progress.as_ref(), move |monitor| {
        let skeleton = Skeleton::read(&*skeleton).map_err(|e| unusable("skeleton", &e))?;
        let motion = Motion::read(&*motion, &skeleton).map_err(|e| unusable("motion", &e))?;
        let skins = weights.into_iter().map(|(name, records)| {
            let skin = records.map(|(j, w)| SkinWeights::new(j, w, skeleton.len())).transpose();
            skin.map_err(|e| unusable(&format!("weights['{name}']"), &e))
        });
        let skins = skins.collect::<Result<Vec<_>, _>>()?;
        let outfit = outfits::outfit(layers).map_err(|e| failed(&e))?;
        let skinned = SkinnedOutfit::new(outfit, skeleton, skins)
            .map_err(|e| failed(&AnimateError::from(e)))?;
        let done =
            follow(&skinned, &motion, &params, folder.path(), monitor).map_err(|e| failed(&e))?;
        let counts: Vec<usize> =
            skinned.outfit.layers().map(|layer| layer.mesh.vertices().len()).collect();
        let mut positions: Vec<Vec<f32>> = vec![Vec::new(); counts.len()];
        for frame in 0..done.frames.len() {
            let layers = done.frames.layers(frame).map_err(|e| failed(&e))?;
            for (layer, flat) in layers.iter().zip(&mut positions) {
                flat.extend(layer.iter().flat_map(|p| p.iter()).map(|x| *x as f32));
            }
        }
        let noticed = (motion.unmatched, skinned.misplaced_skeleton());
        let weights = skinned.without_weights;
        Ok((done.report, (weights, noticed), counts, positions, done.frames.len()))
    });
    if let (Err(_), Some(temporary)) = (&found, temporary) {
        // The process may end before the work does.
        let _ = std::fs::remove_dir_all(temporary); // What the work writes meanwhile, it removes.
    }
    let (report, (without, noticed), counts, positions, frames) =
        found?.map_err(|(class, message): Failure| exception(py, class, message))?;
    let arrays = counts.into_iter().zip(positions);
    let arrays =
        arrays.map(|(count, flat)| PyArray1::from_vec(py, flat).reshape([frames, count, 3]));
    let report = serde_json::to_string(&report).map_err(no_json)?;
    Ok((report, without, noticed, arrays.collect::<PyResult<_>>()?))
}

/// Rows of four.
fn records((joints, weights): &Weights<'_>) -> (Vec<[u16; 4]>, Vec<[f32; 4]>) {
    fn rows<T: numpy::Element + Copy>(array: &PyReadonlyArray2<'_, T>) -> Vec<[T; 4]> {
        let rows = array.as_array();
        rows.rows().into_iter().map(|r| [r[0], r[1], r[2], r[3]]).collect()
    }
    (rows(joints), rows(weights))
}
