//! Meshes of single frames, with all attributes of the layers' files, and without animations.

use super::Options;
use super::faults::AnimateFault;
use crate::cancel;
use crate::errors::ErrorChain;
use crate::outfit_file::{LayerSpec, OutfitSpec};
use crate::output_error::OutputError;
use crate::staging::Staging;
use if_core::math::Point;
use if_mesh::file::{MeshFile, WriteError};
use if_outfit::files::OutfitFiles;
use if_outfit::motion::{WalkError, WalkParams, Walker};
use if_outfit::outfit::Outfit;
use if_pipeline::animate::Frames;
use miette::{IntoDiagnostic, Report};
use std::path::Path;

/// What the meshes of frames are made of.
pub(super) struct Meshes<'a> {
    pub(super) spec: &'a OutfitSpec,
    pub(super) files: &'a OutfitFiles,
    /// The outfit at rest.
    pub(super) outfit: &'a Outfit,
    pub(super) walk: &'a WalkParams,
}

impl Meshes<'_> {
    /// Writes each layer of each frame, under these `names`, with the attributes of its file. Returns the
    /// names of the files, of which one may hold several layers, and the frames that are less clean as
    /// their files hold them ([`is_less_clean`]).
    pub(super) fn write(
        &self,
        (frames, names): (&Frames, &[Vec<String>]),
        (staging, args): (&Staging, &Options),
    ) -> Result<(Vec<String>, Vec<usize>), Report> {
        let mut written = Vec::new();
        let mut less_clean = Vec::new();
        let mut walker = None;
        for (frame, names) in names.iter().enumerate() {
            let all = frames.layers(frame).map_err(|source| AnimateFault::Animate { source })?;
            if self.is_less_clean(&all, &mut walker)? {
                less_clean.push(frame);
            }
            let mut by_file: Vec<(&LayerSpec, &String, Vec<LayerInFile<'_>>)> = Vec::new();
            for (((layer, positions), file), name) in
                self.spec.layers().zip(&all).zip(self.files.files()).zip(names)
            {
                match by_file.iter_mut().find(|(first, ..)| layer.is_in_file_of(first)) {
                    Some((.., layers)) => layers.push((file, positions)),
                    None => by_file.push((layer, name, vec![(file, positions)])),
                }
            }
            for (_, name, layers) in by_file {
                let path = staging.path(name);
                let folder = path.parent().unwrap_or(&path);
                std::fs::create_dir_all(folder)
                    .map_err(|source| OutputError::Folder { path: args.out.join(name), source })?;
                write_meshes_of_file(&layers, &path, &args.out.join(name))?;
                written.push(name.clone());
            }
            cancel::check().into_diagnostic()?;
        }
        Ok((written, less_clean))
    }

    /// Whether what is read back of these layers, which were proven, is less clean: in the coordinates of
    /// a glTF node that is scaled or turned, numbers of single precision are others. The walker, which
    /// verifies, is made where it is needed.
    fn is_less_clean(
        &self,
        proven: &[Vec<Point>],
        walker: &mut Option<Walker>,
    ) -> Result<bool, Report> {
        let files = self.files.files().zip(proven);
        let stored: Vec<Point> = files.flat_map(|(file, p)| file.positions_as_written(p)).collect();
        let proven = proven.concat();
        if stored == proven {
            return Ok(false);
        }
        let fault = |source: WalkError| AnimateFault::Animate { source: source.into() };
        let walker = match walker {
            Some(walker) => walker,
            None => walker.insert(Walker::new(self.outfit, *self.walk).map_err(fault)?),
        };
        is_less_clean(walker, &proven, &stored).map_err(|source| fault(source).into())
    }
}

/// Whether more intersects, or lies on a wrong side, in `stored` than in `proven`.
fn is_less_clean(walker: &Walker, proven: &[Point], stored: &[Point]) -> Result<bool, WalkError> {
    let [proven, stored] = [walker.prove(proven)?, walker.prove(stored)?];
    Ok(stored.pairs > proven.pairs
        || stored.inside > proven.inside
        || stored.new_own_pairs > proven.new_own_pairs)
}

/// A layer of a file, and its positions in a frame.
type LayerInFile<'a> = (&'a MeshFile, &'a [Point]);

/// Writes the layers of a file to `staged`, from where it goes to `path`; buffers that a `.gltf` file has in
/// other files are embedded.
fn write_meshes_of_file(
    layers: &[LayerInFile<'_>],
    staged: &Path,
    path: &Path,
) -> Result<(), OutputError> {
    MeshFile::write_frame(layers, staged).map_err(|error| match error {
        WriteError::Io { source, .. } => OutputError::File { path: path.into(), source },
        other => OutputError::Mesh { path: path.into(), source: ErrorChain::new(&other) },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::shapes::meshes::{icosphere, tube};
    use if_outfit::outfit::Layer;

    #[test]
    fn positions_that_pass_a_surface_by_rounding_are_less_clean() {
        let belt = Layer::new("belt", tube(0.16, 0.04, 48, 2, false));
        let outfit = Outfit::new(Layer::new("ball", icosphere(0.15, 3)), vec![belt]).unwrap();
        let walker = Walker::new(&outfit, WalkParams::default()).unwrap();
        let proven = walker.rest().to_vec();
        let belt = proven.len() - walker.layer(&proven, 1).len();
        let moved = |by: f64| {
            let mut moved = proven.clone();
            moved[belt..].iter_mut().for_each(|p| *p += Vector::x() * by);
            is_less_clean(&walker, &proven, &moved).unwrap()
        };
        assert!(!moved(1e-8) && moved(0.02));
    }
}
