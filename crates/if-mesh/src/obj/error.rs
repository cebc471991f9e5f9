//! Why an OBJ file cannot be read or written.

use if_core::mesh::MeshError;
use std::{fmt, io};

/// What an index of a face names.
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

/// Why [`super::read`] returns no mesh.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum ReadError {
    /// The system could not deliver the bytes.
    #[error("cannot read the file: {0}")]
    Io(#[from] io::Error),
    /// The file is no text.
    #[error("byte {byte} is zero, so this is no OBJ file, or one in UTF-16: store it as UTF-8")]
    Binary { byte: u64 },
    /// More bytes than offsets of 32 bits reach.
    #[error("the file is larger than 4 GiB; split it")]
    TooLarge,
    /// There is no vertex.
    #[error("the file has no `v` line; it is empty or no OBJ file")]
    NoVertices,
    /// A statement has too few or too many numbers.
    #[error("line {line}: `{keyword}` has {found} numbers, expected {expected}")]
    ValueCount { line: u64, keyword: &'static str, expected: &'static str, found: usize },
    /// Something is not a number.
    #[error("line {line}: {text:?} behind `{keyword}` is not a number")]
    Value { line: u64, keyword: &'static str, text: String },
    /// A coordinate is NaN or infinite.
    #[error(
        "line {line}: vertex {vertex} (0 is the first) has the coordinate {text}; every coordinate must be finite"
    )]
    NonFinite { line: u64, vertex: usize, text: String },
    /// A corner is not written as v, v/vt, v//vn or v/vt/vn.
    #[error(
        "line {line}: corner {text:?} of the face is none of v, v/vt, v//vn and v/vt/vn, with whole numbers"
    )]
    Corner { line: u64, text: String },
    /// An index names nothing.
    #[error(
        "line {line}: {what} {index} does not exist; there are {count}, and 1 is the first (−1 the one before this line)"
    )]
    Index { line: u64, what: Index, index: i64, count: usize },
    /// A face of one or two corners.
    #[error("line {line}: the face has {corners} corners; a face needs at least 3")]
    FaceTooShort { line: u64, corners: usize },
    /// The surface is no mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Why [`super::write()`] has not written a mesh.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The system did not take the bytes.
    #[error("cannot write the file: {0}")]
    Io(#[from] io::Error),
    /// The positions do not fit the mesh, or are not finite.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}
