//! `motion.glb`: all layers and frames in one file.

use super::AnimateFault;
use crate::cancel;
use crate::output_error::OutputError;
use crate::staging::Staging;
use if_core::monitor::Cancelled;
use if_mesh::file::MeshFile;
use if_mesh::gltf::{MotionError, MotionLayer, check_motion, write_motion};
use if_outfit::outfit::{Layer, Outfit};
use if_pipeline::animate::{AnimateError, Frames};
use if_render::layer_color;
use miette::{IntoDiagnostic, Report};
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

pub(super) const FILE: &str = "motion.glb";

/// Why writing ends.
enum Fault {
    Frame(AnimateError),
    Motion(MotionError),
    Cancelled(Cancelled),
}

impl From<MotionError> for Fault {
    fn from(error: MotionError) -> Self {
        Self::Motion(error)
    }
}

/// Whether the file can hold so many frames at this rate.
pub(super) fn check(outfit: &Outfit, motion: (usize, f64)) -> Result<(), MotionError> {
    check_motion(&layers(outfit, &[]), motion)
}

/// The layers with their texture coordinates, where there are some.
fn layers<'a>(outfit: &'a Outfit, textures: &'a [Option<Vec<[f32; 2]>>]) -> Vec<MotionLayer<'a>> {
    let layer = |(k, layer): (usize, &'a Layer)| MotionLayer {
        name: &layer.name,
        mesh: &layer.mesh,
        texture: textures.get(k).and_then(|texture| texture.as_deref()),
        colour: layer_color(k),
    };
    outfit.layers().enumerate().map(layer).collect()
}

/// Writes the file, and returns its name. The layers are those of the files, in order.
pub(super) fn write<'a>(
    (outfit, files): (&Outfit, impl Iterator<Item = &'a MeshFile>),
    (frames, rate): (&Frames, f64),
    (staging, out): (&Staging, &Path),
) -> Result<String, Report> {
    let fault = |source| OutputError::File { path: out.join(FILE), source };
    let textures: Vec<Option<Vec<[f32; 2]>>> = files.map(MeshFile::texture_coordinates).collect();
    let layers = layers(outfit, &textures);
    let mut file = BufWriter::new(File::create(staging.path(FILE)).map_err(fault)?);
    let mut positions = |frame: usize| {
        cancel::check().map_err(Fault::Cancelled)?;
        frames.positions(frame).map_err(Fault::Frame)
    };
    match write_motion(&mut file, &layers, (frames.len(), rate), &mut positions) {
        Ok(()) => Ok(FILE.into()),
        Err(Fault::Frame(source)) => Err(AnimateFault::Animate { source }.into()),
        Err(Fault::Motion(MotionError::Io(error))) => Err(fault(error).into()),
        Err(Fault::Motion(source)) => Err(AnimateFault::Gltf { source }.into()),
        Err(Fault::Cancelled(cancelled)) => Err(cancelled).into_diagnostic(),
    }
}
