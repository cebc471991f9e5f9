//! What can be at fault with an asset.

use if_body::SkinError;
use if_core::mesh::MeshError;
use if_mesh::baked::BakedFileError;
use if_mesh::ply;
use if_render::PngError;
use std::io;
use std::path::PathBuf;

/// Why an asset is not read or not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum AssetError {
    /// A name that cannot be a folder's.
    #[error(
        "`{name}` is no name for an asset: take up to 64 letters, digits, `_`, `-` and `.`, without a dot at an end"
    )]
    Name { name: String },
    /// A garment without triangles.
    #[error("garment `{name}` has no triangles")]
    Empty { name: String },
    /// Weights for another mesh.
    #[error(
        "garment `{name}` has {vertices} vertices, but {records} records of skinning weights; one each is needed"
    )]
    SkinCount { name: String, vertices: usize, records: usize },
    /// A position beyond single precision.
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
    /// The system does not give or take a file.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    /// The system does not give the folder.
    #[error(transparent)]
    Folder(#[from] io::Error),
    /// `asset.json` is at fault.
    #[error("{}: {message}", path.display())]
    Json { path: PathBuf, message: String },
    /// Another version of the format, or no asset.
    #[error(
        "{}: the version of the asset is {}, known is {known}; make the asset again with this program",
        path.display(), found.map_or("missing".to_owned(), |v| v.to_string())
    )]
    Version { path: PathBuf, found: Option<u64>, known: u32 },
    /// A file is not the one that was written.
    #[error("{}: the file has changed (SHA-256 is {found}, stated is {stated}); restore it, or make the asset again", path.display())]
    Changed { path: PathBuf, stated: String, found: String },
    /// The mesh is at fault.
    #[error("{}: {source}", path.display())]
    Garment { path: PathBuf, source: Box<ply::ReadError> },
    /// The mesh has other counts than stated.
    #[error("{}: {found:?} vertices and triangles, stated are {stated:?}; make the asset again", path.display())]
    Counts { path: PathBuf, stated: (usize, usize), found: (usize, usize) },
    /// The weights are at fault.
    #[error("{}: {source}", path.display())]
    Skin { path: PathBuf, source: SkinError },
    /// The grid is at fault.
    #[error("{}: {source}", path.display())]
    Baked { path: PathBuf, source: BakedFileError },
}
