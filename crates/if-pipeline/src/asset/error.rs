//! The error of assets.

use if_body::SkinError;
use if_core::mesh::MeshError;
use if_mesh::baked::BakedFileError;
use if_mesh::ply;
use if_render::PngError;
use std::io;
use std::path::PathBuf;

/// An asset cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum AssetError {
    /// The name is invalid.
    #[error(
        "`{name}` is not a valid name of an asset; use up to 64 of a to z, A to Z, digits, `_`, `-` and `.`, without a dot at an end"
    )]
    Name { name: String },
    /// The garment has no triangles.
    #[error("garment `{name}` has no triangles")]
    Empty { name: String },
    /// The skinning weights are for another mesh.
    #[error("garment `{name}`: {source}")]
    SkinCount { name: String, source: SkinError },
    /// A position exceeds single precision.
    #[error(
        "garment `{name}` does not fit into single precision: {source}; everything is in metres"
    )]
    Rounding { name: String, source: MeshError },
    /// The mesh cannot be written.
    #[error("garment `{name}`: {source}")]
    Ply { name: String, source: Box<ply::WriteError> },
    /// The picture cannot be written.
    #[error("garment `{name}`: {source}")]
    Picture { name: String, source: PngError },
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    /// The folder cannot be written.
    #[error(transparent)]
    Folder(#[from] io::Error),
    /// `asset.json` is invalid.
    #[error("{}: {message}", path.display())]
    Json { path: PathBuf, message: String },
    /// The version of the format is missing or unknown.
    #[error(
        "{}: the version of the asset is {}, known is {known}; make the asset again with this program",
        path.display(), found.map_or("missing".to_owned(), |v| v.to_string())
    )]
    Version { path: PathBuf, found: Option<u64>, known: u32 },
    /// A file has changed.
    #[error("{}: the file has changed (SHA-256 is {found}, stated is {stated}); restore it, or make the asset again", path.display())]
    Changed { path: PathBuf, stated: String, found: String },
    /// The mesh is invalid.
    #[error("{}: {source}", path.display())]
    Garment { path: PathBuf, source: Box<ply::ReadError> },
    /// The mesh has other counts than `asset.json` states.
    #[error("{}: {found:?} vertices and triangles, stated are {stated:?}; make the asset again", path.display())]
    Counts { path: PathBuf, stated: (usize, usize), found: (usize, usize) },
    /// The skinning weights are invalid.
    #[error("{}: {source}", path.display())]
    Skin { path: PathBuf, source: SkinError },
    /// The network of φ is invalid.
    #[error("{}: {message}; make the asset again, or remove its φ", path.display())]
    Network { path: PathBuf, message: String },
    /// The grid is invalid.
    #[error("{}: {source}", path.display())]
    Baked { path: PathBuf, source: BakedFileError },
}
