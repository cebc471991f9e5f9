//! Errors of outfits as files.

use super::ResolvedFiles;
use crate::outfit::OutfitError;
use crate::resolve::ResolveError;
use crate::unresolved::Unresolved;
use if_core::math::Real;
use if_core::mesh::MeshError;
use if_mesh::file::{ReadError, SplitError, WriteError};
use if_mesh::gltf;
use std::path::PathBuf;

/// An outfit cannot be read, resolved or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // The messages name the fields.
pub enum FilesError {
    /// The factor to metres is out of range.
    #[error(
        "the scale is {scale}; it must be a positive number, such as 0.001 for files in millimetres"
    )]
    ScaleRange { scale: Real },
    /// A file cannot be read.
    #[error("cannot read {role} `{layer}`: {source}")]
    Read {
        /// `body` or `garment`.
        role: &'static str,
        layer: String,
        source: ReadError,
    },
    /// The vertices of a garment cannot move.
    #[error("garment `{layer}` cannot move: {source}")]
    Fixed { layer: String, source: gltf::WriteError },
    /// A mesh is not finite in metres, or in the units of its file.
    #[error("`{}` ({layer}) cannot be scaled by {scale}: {source}", path.display())]
    Scale { layer: String, path: PathBuf, scale: Real, source: MeshError },
    /// The layers are not a valid outfit.
    #[error("`{}` ({layer}) does not fit into an outfit: {source}", path.display())]
    Outfit { layer: String, path: PathBuf, source: OutfitError },
    /// A parameter is out of range, the monitor cancelled, or the outfit is invalid.
    #[error(transparent)]
    Resolve(ResolveError),
    /// A file cannot hold its triangles split.
    #[error("the triangles of `{}` ({layer}) cannot be split: {source}", path.display())]
    Split { layer: String, path: PathBuf, source: SplitError },
    /// Intersections remain in what would be stored.
    #[error("{unresolved}")]
    Unresolved {
        /// Which.
        unresolved: Box<Unresolved>,
        /// The result as far as it came.
        result: Box<ResolvedFiles>,
    },
    /// A garment cannot be written.
    #[error("cannot write garment `{layer}`: {source}")]
    Write { layer: String, source: WriteError },
    /// Two layers are the same vertices of a file.
    #[error(
        "`{first}` and `{second}` have vertices of `{}` in common; give each its own node, as in \
         scene.glb#NODE, with position accessors of its own",
        path.display()
    )]
    SharedVertices { first: String, second: String, path: PathBuf },
    /// Two layers have one file name, so that one output would replace the other.
    #[error("`{first}` and `{second}` would both be written to `{}`; rename a file", file.display())]
    SameFile { first: String, second: String, file: PathBuf },
    /// A garment from memory has a name that is no file's.
    #[error(
        "garment `{layer}` has no file, and its name cannot be that of one; give it a name without folders"
    )]
    FileName { layer: String },
    /// The output folder cannot be made.
    #[error("cannot make folder `{}`: {source}", path.display())]
    Folder { path: PathBuf, source: std::io::Error },
}
