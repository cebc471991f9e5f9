//! Reads the files of an outfit, and writes garments back in the units they came in.

use crate::hash::{self, Content};
use crate::mesh_file::{MeshFile, MeshFileError};
use crate::outfit_file::{LayerSpec, OutfitSpec};
use if_core::math::Point;
use if_core::mesh::{MeshError, TriMesh};
use if_pipeline::outfit::{Layer, Outfit, OutfitError};
use miette::Diagnostic;
use rayon::prelude::*;
use std::io;
use std::path::{Path, PathBuf};

/// An outfit and the files it came from.
pub(crate) struct Loaded {
    /// In metres.
    pub(crate) outfit: Outfit,
    /// The garments' files, inner to outer.
    files: Vec<MeshFile>,
    scale: f64,
}

/// Why files make no outfit.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub(crate) enum LoadError {
    #[error("cannot read `{}` ({layer})", path.display())]
    #[diagnostic(code(ifg::input::read), help("look at the path; relative paths in an outfit file start at its folder"))]
    Read { layer: String, path: PathBuf, source: io::Error },
    #[error("`{}` ({layer}) is not a usable mesh", path.display())]
    #[diagnostic(code(ifg::input::mesh), help("export it again as .ply or .obj"))]
    Mesh { layer: String, path: PathBuf, source: MeshFileError },
    #[error("`{}` ({layer}) cannot be scaled by {scale}", path.display())]
    #[diagnostic(code(ifg::input::scale), help("look at --scale, or `scale` in the outfit file"))]
    Scale { layer: String, path: PathBuf, scale: f64, source: MeshError },
    #[error("`{}` ({layer}) does not fit into an outfit", path.display())]
    #[diagnostic(code(ifg::input::outfit), help("{}", advice(source)))]
    Outfit { layer: String, path: PathBuf, source: OutfitError },
}

fn advice(error: &OutfitError) -> String {
    match error {
        OutfitError::Units { unit, scale, .. } => {
            format!("if the files are in {unit}, add --scale {scale}; outputs then keep {unit}")
        }
        OutfitError::DuplicateName { .. } => "give one of them another `name` in an outfit file".into(),
        OutfitError::OpenBody { .. } => "the body must be one closed surface; garments may be open".into(),
        OutfitError::InsideOut { .. } => "reverse the order of the corners of all its triangles".into(),
        OutfitError::FarFromBody { .. } => "all layers must be in the same units and the same place".into(),
        _ => "leave it out, or give a mesh that has triangles".into(),
    }
}

/// Size and hash of every input file, the body first. Refuses what is not a file, such as a pipe,
/// which might never end.
pub(crate) fn contents(spec: &OutfitSpec) -> Result<Vec<Content>, LoadError> {
    let one = |layer: &LayerSpec| {
        let found = std::fs::metadata(&layer.path).and_then(|m| {
            if m.is_file() { hash::content(&layer.path) } else { Err(io::Error::other("it is not a file")) }
        });
        found.map_err(|source| LoadError::Read { layer: layer.name.clone(), path: layer.path.clone(), source })
    };
    in_order(spec, one)
}

/// Reads all layers and checks that they make an outfit.
pub(crate) fn load(spec: &OutfitSpec) -> Result<Loaded, LoadError> {
    let mut files = in_order(spec, |layer| {
        MeshFile::read(&layer.path).map_err(|source| LoadError::Mesh {
            layer: layer.name.clone(),
            path: layer.path.clone(),
            source,
        })
    })?;
    let mut layers = std::iter::once(&spec.body)
        .chain(&spec.garments)
        .zip(&files)
        .map(|(layer, file)| to_layer(layer, file, spec.scale))
        .collect::<Result<Vec<_>, _>>()?;
    let body = layers.remove(0);
    files.remove(0);
    let outfit = Outfit::new(body, layers).map_err(|source| {
        let layer = named(spec, &source);
        LoadError::Outfit { layer: layer.name.clone(), path: layer.path.clone(), source }
    })?;
    Ok(Loaded { outfit, files, scale: spec.scale })
}

impl Loaded {
    /// Whether garment `k` has the very positions of its file.
    pub(crate) fn is_unchanged(&self, k: usize, outfit: &Outfit) -> bool {
        let bits = |m: &TriMesh| m.vertices().iter().map(|p| p.coords.map(f64::to_bits)).collect::<Vec<_>>();
        bits(&self.outfit.garments[k].mesh) == bits(&outfit.garments[k].mesh)
    }

    /// Writes garment `k` of `outfit` in the format and the units of its file.
    pub(crate) fn write(&self, k: usize, outfit: &Outfit, path: &Path) -> Result<(), MeshFileError> {
        self.files[k].write(path, &self.positions(k, outfit))
    }

    /// An outfit as a reader of the written files will see it, in metres.
    pub(crate) fn as_written(&self, outfit: &Outfit) -> Result<Outfit, MeshError> {
        let mut written = outfit.clone();
        for (k, garment) in written.garments.iter_mut().enumerate() {
            let (before, positions) = (&self.outfit.garments[k].mesh, self.positions(k, outfit));
            let positions = self.files[k].positions_as_written(&positions);
            garment.mesh = before.with_vertices(positions.iter().map(|p| p * self.scale).collect())?;
        }
        Ok(written)
    }

    /// The positions of garment `k` in the units of its file. Vertices that did not move have the
    /// very bits of the file.
    fn positions(&self, k: usize, outfit: &Outfit) -> Vec<Point> {
        let (before, after) = (&self.outfit.garments[k].mesh, &outfit.garments[k].mesh);
        let original = self.files[k].mesh().vertices();
        let back = |i: usize| {
            let (p, q) = (before.vertices()[i], after.vertices()[i]);
            if p == q { original[i] } else { q / self.scale }
        };
        (0..original.len()).map(back).collect()
    }
}

fn to_layer(layer: &LayerSpec, file: &MeshFile, scale: f64) -> Result<Layer, LoadError> {
    let mesh = file.mesh();
    let mesh = if scale == 1.0 {
        mesh.clone()
    } else {
        mesh.with_vertices(mesh.vertices().iter().map(|p| p * scale).collect()).map_err(|source| LoadError::Scale {
            layer: layer.name.clone(),
            path: layer.path.clone(),
            scale,
            source,
        })?
    };
    Ok(Layer { name: layer.name.clone(), mesh, single_precision: false })
}

/// The layer that the error is about.
fn named<'a>(spec: &'a OutfitSpec, error: &OutfitError) -> &'a LayerSpec {
    let garment = |name: &String| spec.garments.iter().rfind(|l| l.name == *name);
    match error {
        OutfitError::Empty { layer } | OutfitError::DuplicateName { layer } | OutfitError::FarFromBody { layer, .. } => {
            garment(layer).unwrap_or(&spec.body)
        }
        _ => &spec.body,
    }
}

/// Something for the body and each garment, in parallel; the first fault in the order of layers.
fn in_order<T: Send, E: Send>(spec: &OutfitSpec, f: impl Fn(&LayerSpec) -> Result<T, E> + Sync + Send) -> Result<Vec<T>, E> {
    let layers: Vec<&LayerSpec> = std::iter::once(&spec.body).chain(&spec.garments).collect();
    layers.into_par_iter().map(f).collect::<Vec<_>>().into_iter().collect()
}
