//! The files that hold the numbers of `.gltf` files: read, hashed and written with them.

use crate::file_record::{InputFile, OutputFile};
use crate::outfit_file::{LayerSpec, OutfitSpec};
use crate::output_error::OutputError;
use crate::receipt;
use crate::staging::Staging;
use if_mesh::file::{Content, MeshFile};
use if_outfit::digest::{FileDigest, digest};
use std::path::{Path, PathBuf};

/// The buffers of an outfit's files.
pub(crate) struct Buffers {
    /// Of all layers, the body's first.
    pub(crate) inputs: Vec<InputFile>,
    /// The names that the garments' buffers will have in the output folder, with their contents
    /// before.
    written: Vec<(String, FileDigest)>,
}

/// A buffer of a layer's file.
struct Buffer<'f> {
    layer: &'f LayerSpec,
    is_garment: bool,
    /// From the folder of the layer's file.
    name: String,
    path: PathBuf,
    bytes: &'f [u8],
}

impl Buffers {
    /// Those of an outfit with these files, the body's first. The names `taken` are those of other
    /// outputs.
    ///
    /// # Errors
    ///
    /// Two outputs of one name, an output over an input, something in the way.
    pub(crate) fn find<'f>(
        spec: &'f OutfitSpec,
        files: impl Iterator<Item = &'f MeshFile>,
        taken: &[String],
        (out, in_place): (&Path, bool),
    ) -> Result<Self, OutputError> {
        let receipt = receipt::FILE.to_owned();
        let all: Vec<Buffer<'f>> =
            spec.layers().zip(files).enumerate().flat_map(|(k, (l, f))| of(k > 0, l, f)).collect();
        let input = |buffer: &Buffer<'_>| InputFile {
            layer: buffer.layer.name.clone(),
            file: buffer.name.clone(),
            content: digest(buffer.bytes),
        };
        let mut written: Vec<(String, FileDigest)> = Vec::new();
        for (k, buffer) in all.iter().enumerate().filter(|(_, buffer)| buffer.is_garment) {
            let same = |name: &String| name.eq_ignore_ascii_case(&buffer.name);
            let earlier = all[..k].iter().find(|b| b.is_garment && same(&b.name));
            if earlier.is_some_and(|b| b.layer.is_in_file_of(buffer.layer)) {
                continue; // another node of one file
            }
            let other = taken.iter().chain([&receipt]).find(|name| same(name));
            let first = earlier.map(|b| b.path.display().to_string()).or(other.cloned());
            if let Some(first) = first {
                let (second, name) = (buffer.path.display().to_string(), buffer.name.clone());
                return Err(OutputError::SameName { first, second, name });
            }
            check_target(buffer, spec, &all, (out, in_place))?;
            written.push((buffer.name.clone(), digest(buffer.bytes)));
        }
        Ok(Self { inputs: all.iter().map(input).collect(), written })
    }

    /// The names of those that are written.
    pub(crate) fn names(&self) -> impl Iterator<Item = &String> {
        self.written.iter().map(|(name, _)| name)
    }

    /// The records of what was written into the staging folder.
    pub(crate) fn describe(
        &self,
        (staging, out): (&Staging, &Path),
    ) -> Result<Vec<OutputFile>, OutputError> {
        let describe = |(name, before): &(String, FileDigest)| {
            let mut found = staging.describe(name, out)?;
            found.unchanged = Some(found.content == *before);
            Ok(found)
        };
        self.written.iter().map(describe).collect()
    }
}

fn of<'f>(is_garment: bool, layer: &'f LayerSpec, file: &'f MeshFile) -> Vec<Buffer<'f>> {
    let Content::Gltf(gltf) = file.content() else { return Vec::new() };
    let folder = layer.path.parent().unwrap_or(Path::new(""));
    let buffer = |(path, bytes): (&Path, &'f [u8])| Buffer {
        layer,
        is_garment,
        name: path.to_string_lossy().into_owned(),
        path: folder.join(path),
        bytes,
    };
    gltf.beside().map(buffer).collect()
}

/// Checks that a garment's buffer can be written: over no input, except its own with --in-place.
fn check_target(
    buffer: &Buffer<'_>,
    spec: &OutfitSpec,
    all: &[Buffer<'_>],
    (out, in_place): (&Path, bool),
) -> Result<(), OutputError> {
    let path = out.join(&buffer.name);
    let Ok(target) = path.canonicalize() else { return Ok(()) };
    if !target.is_file() {
        return Err(OutputError::InTheWay { path });
    }
    let is_target = |input: &Path| input.canonicalize().is_ok_and(|p| p == target);
    let of_layers = spec.layers().map(|layer| (layer, layer.path.as_path()));
    let of_buffers = all.iter().map(|b| (b.layer, b.path.as_path()));
    for (layer, input) in of_layers.chain(of_buffers).filter(|(_, input)| is_target(input)) {
        let is_own = std::ptr::eq(layer, buffer.layer) || layer.is_in_file_of(buffer.layer);
        if !(in_place && is_own) {
            let written = input.display().to_string();
            return Err(OutputError::OverInput { path, written, option: is_own });
        }
    }
    Ok(())
}
