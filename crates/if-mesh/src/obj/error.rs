//! Errors of the OBJ reader and writer.

use if_core::mesh::MeshError;
use std::{fmt, io};

/// What an index of a face refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Index {
    /// A `v` line.
    Vertex,
    /// A `vt` line.
    Texture,
    /// A `vn` line.
    Normal,
}

impl fmt::Display for Index {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Vertex => "vertex",
            Self::Texture => "texture coordinate",
            Self::Normal => "normal",
        })
    }
}

/// Errors of [`super::read`] and [`super::split`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum ReadError {
    /// The source returned an error.
    #[error("cannot read the file: {0}")]
    Io(#[from] io::Error),
    /// The file is not text.
    #[error("byte {byte} is zero: this is not an OBJ file, or one in UTF-16; store it as UTF-8")]
    Binary { byte: u64 },
    /// The file is too large for offsets of 32 bits.
    #[error("the file is larger than 4 GiB; split it")]
    TooLarge,
    /// There are no vertices.
    #[error("the file has no `v` line; it is empty or not an OBJ file")]
    NoVertices,
    /// A statement has too few or too many numbers.
    #[error("line {line}: `{keyword}` has {found} numbers, expected {expected}")]
    ValueCount { line: u64, keyword: &'static str, expected: &'static str, found: usize },
    /// A value is not a valid number.
    #[error("line {line}: {text:?} after `{keyword}` is not a valid number")]
    Value { line: u64, keyword: &'static str, text: String },
    /// A coordinate is NaN or infinite.
    #[error(
        "line {line}: vertex {vertex} (0 is the first) has the coordinate {text}; every coordinate must be finite"
    )]
    NonFinite { line: u64, vertex: usize, text: String },
    /// A corner does not have the form v, v/vt, v//vn or v/vt/vn.
    #[error(
        "line {line}: corner {text:?} of the face is not of the form v, v/vt, v//vn or v/vt/vn, with integers"
    )]
    Corner { line: u64, text: String },
    /// An index is out of range.
    #[error(
        "line {line}: {what} {index} does not exist; there are {count}, and 1 is the first (−1 the one before this line)"
    )]
    Index { line: u64, what: Index, index: i64, count: usize },
    /// A face has fewer than three corners.
    #[error("line {line}: the face has {corners} corners; a face needs at least 3")]
    FaceTooShort { line: u64, corners: usize },
    /// The surface is not a valid mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// An `l` or `p` line has relative indices, which new vertices would shift.
    #[error(
        "line {line} counts vertices backwards; store the file with positive indices, or without lines and points"
    )]
    RelativeLine { line: u64 },
}

/// Errors of [`super::write()`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The destination returned an error.
    #[error("cannot write the file: {0}")]
    Io(#[from] io::Error),
    /// The positions do not belong to the mesh, or are not finite.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}
