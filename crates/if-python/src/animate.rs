//! Outfits that follow motions.

use crate::errors::{Exception, chain, exception, no_json};
use crate::layers::LayerArrays;
use crate::outfits;
use crate::work;
use if_body::{BodySequence, Motion, Skeleton, SkinError, SkinWeights};
use if_core::math::{Point, Real};
use if_mesh::file::MeshFile;
use if_outfit::Outfit;
use if_pipeline::animate::{
    AnimateError, AnimateParams, BoundOutfit, MovingOutfit, SkinnedOutfit, follow,
};
use numpy::{PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::error::Error;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The weights of a layer: joints and weights, four of each for a vertex, or a mesh file that has them.
#[derive(FromPyObject)]
pub(crate) enum Weights<'py> {
    Arrays(PyReadonlyArray2<'py, u16>, PyReadonlyArray2<'py, f32>),
    #[pyo3(transparent)]
    File(PathBuf),
}

/// A skeleton: JSON, or a glTF file.
#[derive(FromPyObject)]
pub(crate) enum Joints {
    #[pyo3(transparent)]
    Json(Vec<u8>),
    #[pyo3(transparent)]
    File(PathBuf),
}

/// A motion: JSON or BVH of a skeleton; or the body in each frame, in the files of a folder or as
/// positions, shape (frames, vertices, 3).
#[derive(FromPyObject)]
pub(crate) enum Frames<'py> {
    #[pyo3(transparent)]
    Positions(PyReadonlyArray3<'py, f64>),
    #[pyo3(transparent)]
    Poses(Vec<u8>),
    #[pyo3(transparent)]
    Folder(PathBuf),
}

/// What moves the outfit.
enum Moving {
    Poses { skeleton: Joints, motion: Vec<u8>, skins: Vec<(String, Option<Skin>)> },
    Folder(PathBuf, Real),
    Positions(Vec<Vec<Point>>, Real),
}

/// The weights of a layer, not yet checked.
enum Skin {
    Records(Vec<[u16; 4]>, Vec<[f32; 4]>),
    File(PathBuf),
}

/// Report as JSON, what was noticed of the files, as JSON and as notes, and positions of each layer, the body
/// first: shape (frames, vertices, 3).
type Animated<'py> = (String, String, Vec<String>, Vec<Bound<'py, PyArray3<f32>>>);

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

/// Moves a clean outfit through a motion; the first layer is the body. Of a body that is given in each
/// frame there is no skeleton, and `rate` is its frames per second. `params` are names and JSON values.
/// Frames are kept in `folder`; if it is `None`, in a temporary folder, which is removed when the
/// work ends. That may be after this call, if it was interrupted.
#[pyfunction]
#[pyo3(signature = (layers, motion, skeleton, weights, rate, folder, params, threads, progress))]
pub(crate) fn animate<'py>(
    py: Python<'py>,
    layers: Vec<LayerArrays<'py>>,
    motion: Frames<'py>,
    skeleton: Option<Joints>,
    weights: Vec<Option<Weights<'py>>>,
    rate: Real,
    folder: Option<PathBuf>,
    params: Vec<(String, String)>,
    threads: Option<usize>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Animated<'py>> {
    let params = outfits::with_named(py, AnimateParams::default(), &params)?;
    params.validate().map_err(|e| e.raised(py))?;
    let moving = match (motion, skeleton) {
        (Frames::Poses(motion), Some(skeleton)) => {
            let skins = weights.iter().map(|w| w.as_ref().map(Skin::of));
            let names = layers.iter().map(|layer| layer.name().to_owned());
            Moving::Poses { skeleton, motion, skins: names.zip(skins).collect() }
        }
        (Frames::Poses(_), None) => {
            return Err(exception(
                py,
                "AnimateError",
                "skeleton: a motion of poses needs one".into(),
            ));
        }
        (Frames::Folder(folder), _) => Moving::Folder(folder, rate),
        (Frames::Positions(positions), _) => Moving::Positions(points(&positions)?, rate),
    };
    let layers = outfits::owned(&layers)?;
    let folder =
        folder.map_or_else(|| TempDir::new().map(Folder::Temporary), |f| Ok(Folder::Given(f)))?;
    let temporary = folder.temporary().map(Path::to_owned);
    let found = work::run(py, threads, progress.as_ref(), move |monitor| {
        let outfit = outfits::outfit(layers).map_err(|e| failed(&e))?;
        let moved = moving.moved(outfit)?;
        let done = follow(moved.movement(), &params, folder.path(), monitor);
        let done = done.map_err(|e| failed(&e))?;
        let counts: Vec<usize> =
            moved.movement().outfit().layers().map(|layer| layer.mesh.vertices().len()).collect();
        let mut positions: Vec<Vec<f32>> = vec![Vec::new(); counts.len()];
        for frame in 0..done.frames.len() {
            let layers = done.frames.layers(frame).map_err(|e| failed(&e))?;
            for (layer, flat) in layers.iter().zip(&mut positions) {
                flat.extend(layer.iter().flat_map(|p| p.iter()).map(|x| *x as f32));
            }
        }
        Ok((done.report, moved.noticed(), counts, positions, done.frames.len()))
    });
    if let (Err(_), Some(temporary)) = (&found, temporary) {
        // The process may end before the work does.
        let _ = std::fs::remove_dir_all(temporary); // What the work writes meanwhile, it removes.
    }
    let (report, noticed, counts, positions, frames) =
        found?.map_err(|(class, message): Failure| exception(py, class, message))?;
    let arrays = counts.into_iter().zip(positions);
    let arrays =
        arrays.map(|(count, flat)| PyArray1::from_vec(py, flat).reshape([frames, count, 3]));
    let report = serde_json::to_string(&report).map_err(no_json)?;
    let notes = noticed.notes();
    let noticed = serde_json::to_string(&noticed).map_err(no_json)?;
    Ok((report, noticed, notes, arrays.collect::<PyResult<_>>()?))
}

impl Skin {
    fn of(weights: &Weights<'_>) -> Self {
        match weights {
            Weights::Arrays(joints, weights) => Self::Records(rows(joints), rows(weights)),
            Weights::File(path) => Self::File(path.clone()),
        }
    }

    fn read(self, skeleton: &Skeleton) -> Result<SkinWeights, Box<dyn Error + Send + Sync>> {
        Ok(match self {
            Self::Records(joints, weights) => SkinWeights::new(joints, weights, skeleton.len())?,
            Self::File(path) => SkinWeights::from_file(&MeshFile::read(&path)?, skeleton)?
                .ok_or(SkinError::NoWeights)?,
        })
    }
}

impl Moving {
    /// The outfit with what moves it.
    fn moved(self, outfit: Outfit) -> Result<MovingOutfit, Failure> {
        let body = &outfit.body.mesh;
        let sequence = match self {
            Self::Poses { skeleton, motion, skins } => {
                let skeleton = match skeleton {
                    Joints::Json(text) => Skeleton::read(&*text),
                    Joints::File(path) => Skeleton::read_path(&path),
                };
                let skeleton = skeleton.map_err(|e| unusable("skeleton", &e))?;
                let motion =
                    Motion::read(&*motion, &skeleton).map_err(|e| unusable("motion", &e))?;
                let skin = |(name, skin): (String, Option<Skin>)| {
                    let skin = skin.map(|skin| skin.read(&skeleton)).transpose();
                    skin.map_err(|e| unusable(&format!("weights['{name}']"), &*e))
                };
                let skins = skins.into_iter().map(skin).collect::<Result<Vec<_>, _>>()?;
                let skinned = SkinnedOutfit::new(outfit, skeleton, skins)
                    .map_err(|e| failed(&AnimateError::from(e)))?;
                return Ok(MovingOutfit::Poses(Box::new(skinned), motion));
            }
            Self::Folder(folder, rate) => BodySequence::open(&folder, body, rate),
            Self::Positions(frames, rate) => BodySequence::from_positions(frames, body, rate),
        };
        let sequence = sequence.map_err(|e| unusable("motion", &e))?;
        let bound = BoundOutfit::new(outfit, sequence);
        Ok(MovingOutfit::Bodies(Box::new(bound.map_err(|e| failed(&AnimateError::from(e)))?)))
    }
}

/// Rows of four.
fn rows<T: numpy::Element + Copy>(array: &PyReadonlyArray2<'_, T>) -> Vec<[T; 4]> {
    let rows = array.as_array();
    rows.rows().into_iter().map(|r| [r[0], r[1], r[2], r[3]]).collect()
}

/// The positions of each frame.
fn points(array: &PyReadonlyArray3<'_, f64>) -> PyResult<Vec<Vec<Point>>> {
    let array = array.as_array();
    if array.shape()[2] != 3 {
        let message =
            format!("motion has the shape {:?}; it must be (frames, n, 3)", array.shape());
        return Err(PyValueError::new_err(message));
    }
    let of = |frame: numpy::ndarray::ArrayView2<'_, f64>| -> Vec<Point> {
        frame.rows().into_iter().map(|p| Point::new(p[0], p[1], p[2])).collect()
    };
    Ok(array.outer_iter().map(of).collect())
}
