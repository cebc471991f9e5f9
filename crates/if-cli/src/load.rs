//! Reads the files of an outfit, and writes garments back in the units they came in.

use crate::errors::Told;
use crate::outfit_file::{LayerSpec, OutfitSpec};
use if_core::math::Point;
use if_core::mesh::MeshError;
use if_mesh::file::{MeshFile, ReadError};
use if_mesh::split::Split;
use if_mesh::validate::faults;
use if_outfit::outfit::{Layer, Outfit, OutfitError};
use if_outfit::storage::Storage;
use miette::Diagnostic;
use rayon::prelude::*;
use std::path::PathBuf;

/// An outfit and the files it came from.
pub(crate) struct Loaded {
    /// In metres.
    pub(crate) outfit: Outfit,
    /// The body's file, then the garments', inner to outer.
    pub(crate) files: Vec<MeshFile>,
    scale: f64,
}

/// Why files make no outfit.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub(crate) enum LoadError {
    #[error("cannot read layer `{layer}`")]
    #[diagnostic(code(ifg::input::mesh), help("{}", advice))]
    Mesh { layer: String, advice: &'static str, source: Told },
    #[error("`{}` ({layer}) cannot be scaled by {scale}", path.display())]
    #[diagnostic(code(ifg::input::scale), help("look at --scale, or `scale` in the outfit file"))]
    Scale { layer: String, path: PathBuf, scale: f64, source: MeshError },
    #[error("the triangles of `{}` ({layer}) cannot be split", path.display())]
    #[diagnostic(
        code(ifg::input::split),
        help("leave `split` at \"never\", or store the file again as this asks for")
    )]
    Split { layer: String, path: PathBuf, source: Told },
    #[error("`{}` ({layer}) does not fit into an outfit", path.display())]
    #[diagnostic(code(ifg::input::outfit), help("{}", outfit_advice(source)))]
    Outfit { layer: String, path: PathBuf, source: OutfitError },
}

fn outfit_advice(error: &OutfitError) -> String {
    match error {
        OutfitError::Units { unit, scale, .. } => {
            format!("if the files are in {unit}, add --scale {scale}; outputs then keep {unit}")
        }
        OutfitError::DuplicateName { .. } => {
            "give one of them another `name` in an outfit file".into()
        }
        OutfitError::OpenBody { .. } => {
            "the body must be one closed surface; garments may be open".into()
        }
        OutfitError::InsideOut { .. } => {
            "reverse the order of the corners of all its triangles".into()
        }
        OutfitError::Winding { .. } => {
            "turn those triangles, or use what `ifg clean` writes".into()
        }
        OutfitError::TooLarge { .. } => {
            "repair that vertex, or give the garment in the units of the body".into()
        }
        OutfitError::PartInsideOut { .. } => {
            "reverse the order of the corners of that part's triangles, or take the part out".into()
        }
        OutfitError::FarFromBody { .. } => {
            "all layers must be in the same units and the same place".into()
        }
        _ => "leave it out, or give a mesh that has triangles".into(),
    }
}

pub(crate) fn reading_advice(error: &ReadError) -> &'static str {
    match error {
        ReadError::Extension { .. } => "give a .ply or .obj file",
        ReadError::Io { .. } => {
            "look at the path; relative paths in an outfit file start at its folder"
        }
        ReadError::NotAFile { .. } => "give the path of a file",
        _ => "repair it at the place named, or export it again",
    }
}

/// Reads all layers and checks that they make an outfit.
pub(crate) fn load(spec: &OutfitSpec) -> Result<Loaded, LoadError> {
    let layers: Vec<&LayerSpec> = spec.layers().collect();
    let read = |layer: &&LayerSpec| {
        MeshFile::read(&layer.path).map_err(|e| {
            let (layer, advice, source) = (layer.name.clone(), reading_advice(&e), Told::new(&e));
            LoadError::Mesh { layer, advice, source }
        })
    };
    // All are read before the first fault is looked for, so that it is the same on any number of
    // threads.
    let files: Vec<_> = layers.par_iter().map(read).collect();
    let files = files.into_iter().collect::<Result<Vec<_>, _>>()?;
    let scaled = layers.iter().zip(&files).map(|(layer, file)| to_layer(layer, file, spec.scale));
    let mut garments = scaled.collect::<Result<Vec<_>, _>>()?;
    let body = garments.remove(0); // `layers` starts with the body.
    let outfit = Outfit::new(body, garments).map_err(|source| {
        let layer = named(spec, &source);
        LoadError::Outfit { layer: layer.name.clone(), path: layer.path.clone(), source }
    })?;
    Ok(Loaded { outfit, files, scale: spec.scale })
}

impl Loaded {
    /// What a person should know about the meshes; none of it stops the work.
    pub(crate) fn notes(&self) -> Vec<String> {
        let layers: Vec<(&Layer, &MeshFile)> = self.outfit.layers().zip(&self.files).collect();
        layers.into_par_iter().flat_map_iter(|(layer, file)| notes_on(layer, file)).collect()
    }

    /// The file of garment `k`, counted from the innermost.
    pub(crate) fn garment_file(&self, k: usize) -> &MeshFile {
        &self.files[k + 1]
    }

    /// Splits the triangles of garment `k` as `split` says, in its file and here.
    pub(crate) fn split(
        &mut self,
        spec: &OutfitSpec,
        k: usize,
        split: &Split,
    ) -> Result<(), LoadError> {
        let layer = &spec.garments[k];
        self.files[k + 1] = self.files[k + 1].split(split).map_err(|e| LoadError::Split {
            layer: layer.name.clone(),
            path: layer.path.clone(),
            source: Told::new(&e),
        })?;
        self.outfit.garments[k].mesh = split.mesh.clone();
        Ok(())
    }

    /// The positions of each garment of `outfit` as a reader of its file will get them, in the
    /// units of the file. Vertices that did not move have the very bits of the file.
    pub(crate) fn positions(&self, outfit: &Outfit) -> Vec<Vec<Point>> {
        let one = |(k, garment): (usize, &Layer)| {
            let (file, before) = (self.garment_file(k), self.outfit.garments[k].mesh.vertices());
            let original = file.mesh().vertices().iter();
            let moved = original.zip(before).zip(garment.mesh.vertices());
            let back = moved.map(|((o, p), q)| if p == q { *o } else { q / self.scale });
            file.positions_as_written(&back.collect::<Vec<_>>())
        };
        outfit.garments.iter().enumerate().map(one).collect()
    }

    /// The outfit in metres that such positions make.
    pub(crate) fn outfit_of(&self, positions: &[Vec<Point>]) -> Result<Outfit, MeshError> {
        let mut outfit = self.outfit.clone();
        for (garment, positions) in outfit.garments.iter_mut().zip(positions) {
            garment.mesh =
                garment.mesh.with_vertices(positions.iter().map(|p| p * self.scale).collect())?;
        }
        Ok(outfit)
    }
}

fn notes_on(layer: &Layer, file: &MeshFile) -> Vec<String> {
    let mut notes: Vec<String> = faults(&layer.mesh).iter().map(ToString::to_string).collect();
    if let [first, ..] = file.collapsed_faces() {
        let n = file.collapsed_faces().len();
        notes.push(format!(
            "{n} faces use a vertex twice (the first is face {first}); they are written as they are"
        ));
    }
    if file.shared_normals() > 0 {
        notes.push(format!(
            "{} normals are shared by several vertices; they are written as they are",
            file.shared_normals()
        ));
    }
    notes.iter().map(|note| format!("`{}`: {note}", layer.name)).collect()
}

fn to_layer(layer: &LayerSpec, file: &MeshFile, scale: f64) -> Result<Layer, LoadError> {
    let mesh = file.mesh().scaled(scale).map_err(|source| LoadError::Scale {
        layer: layer.name.clone(),
        path: layer.path.clone(),
        scale,
        source,
    })?;
    // Elsewhere the pipeline would round in metres what is written in other units.
    let storage = if scale == 1.0 { Storage::of(file) } else { Storage::F64 };
    Ok(Layer { name: layer.name.clone(), mesh, storage })
}

/// The layer that the error is about.
fn named<'a>(spec: &'a OutfitSpec, error: &OutfitError) -> &'a LayerSpec {
    let garment = |name: &String| spec.garments.iter().rfind(|l| l.name == *name);
    match error {
        OutfitError::Empty { layer }
        | OutfitError::DuplicateName { layer }
        | OutfitError::TooLarge { layer, .. }
        | OutfitError::FarFromBody { layer, .. } => garment(layer).unwrap_or(&spec.body),
        _ => &spec.body,
    }
}
