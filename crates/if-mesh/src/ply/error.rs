//! Errors of the PLY reader and writer.

use crate::attributes::ScalarType;
use if_core::mesh::MeshError;
use std::fmt;
use std::io;

/// A place in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum At {
    /// Line of a text file, counted from 1.
    Line(u64),
    /// Byte of a binary file, counted from 0.
    Byte(u64),
}

/// Which vertices a face may name.
fn there_are(vertices: u64) -> String {
    match vertices.checked_sub(1) {
        None => "there are no vertices".to_owned(),
        Some(last) => format!("the vertices are 0 to {last}"),
    }
}

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(n) => write!(f, "line {n}"),
            Self::Byte(n) => write!(f, "byte {n}"),
        }
    }
}

/// Errors of [`super::read`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum ReadError {
    /// The source returned an error.
    #[error("cannot read the file: {0}")]
    Io(#[from] io::Error),
    /// The file is empty.
    #[error("the file is empty")]
    Empty,
    /// The first line is not `ply`.
    #[error("line 1 is {found:?}, but a PLY file begins with a line `ply`")]
    NotPly { found: String },
    /// The header has no end.
    #[error(
        "the header has no line `end_header` within {bytes} bytes ({lines} lines); the file is cut off or no PLY file"
    )]
    HeaderEnd { bytes: u64, lines: u64 },
    /// A line of the header is invalid.
    #[error("line {line} of the header is invalid: {text:?}")]
    HeaderLine { line: u64, text: String },
    /// The line `format` is missing, or names another version.
    #[error(
        "the header needs a line `format ascii 1.0`, `format binary_little_endian 1.0` or `format binary_big_endian 1.0`"
    )]
    Format,
    /// Two elements have the same name.
    #[error("line {line}: the header has a second element `{name}`; each needs its own name")]
    DuplicateElement { line: u64, name: String },
    /// Two properties have the same name.
    #[error(
        "line {line}: element `{element}` has a second property `{name}`; each needs its own name"
    )]
    DuplicateProperty { line: u64, element: String, name: String },
    /// Records of zero bytes: any count would fit.
    #[error(
        "element `{element}` has no property, but claims {count} records; remove it, or set its count to 0"
    )]
    NoProperties { element: String, count: u64 },
    /// The length of a list is not an integer.
    #[error(
        "list `{property}` of element `{element}` has its length as {found}; it must be an integer type"
    )]
    ListLengthType { element: String, property: String, found: ScalarType },
    /// The file is too short for the number of records.
    #[error(
        "the header claims {count} records of element `{element}`, at least {needed} bytes, but only {left} bytes follow; \
         the file is cut off or its header is wrong"
    )]
    Claim { element: String, count: u64, needed: u128, left: u64 },
    /// The file ends too early.
    #[error(
        "the file ends at {at}, in record {record} of element `{element}`, whose count is {count}; it is cut off or the count is wrong"
    )]
    Truncated { at: At, element: String, record: u64, count: u64 },
    /// Data follows the last record.
    #[error(
        "{at}: data follows the last record; the counts in the header are too small, or the file is damaged"
    )]
    Trailing { at: At },
    /// A line of values is too short or too long.
    #[error("{at}: record {record} of element `{element}` has {found} values, expected {expected}")]
    ValueCount { at: At, element: String, record: u64, expected: u64, found: u64 },
    /// A value is not a valid number of its type.
    #[error(
        "{at}: `{property}` of record {record} of element `{element}` is {text:?}, which is not a valid number of type {expected}"
    )]
    Value {
        at: At,
        element: String,
        record: u64,
        property: String,
        text: String,
        expected: ScalarType,
    },
    /// A list has a negative length.
    #[error(
        "{at}: list `{property}` of record {record} of element `{element}` has the length {length}; it cannot be negative"
    )]
    ListLength { at: At, element: String, record: u64, property: String, length: i64 },
    /// A coordinate is missing.
    #[error(
        "element `vertex` needs the properties x, y and z, each one number, but has none for {axis}"
    )]
    NoCoordinate { axis: char },
    /// The element `vertex` is missing.
    #[error("the file has no element `vertex`")]
    NoVertices,
    /// The faces have no vertex indices.
    #[error("element `face` has {count} records, but no list `vertex_indices` or `vertex_index`")]
    NoIndices { count: u64 },
    /// The surface is stored as triangle strips.
    #[error(
        "the surface is stored as `tristrips`, which are not supported; store it as element `face` with a list `vertex_indices`"
    )]
    TriangleStrips,
    /// The vertex indices are not integers.
    #[error(
        "list `{property}` of element `face` has values of type {found}; vertex indices need an integer type"
    )]
    IndexType { property: String, found: ScalarType },
    /// A face has fewer than three corners.
    #[error("{at}: face {face} has {corners} corners; a face needs at least 3")]
    FaceTooShort { at: At, face: u64, corners: u64 },
    /// A vertex index is out of range.
    #[error("{at}: corner {corner} of face {face} names vertex {index}, but {}", there_are(*vertices))]
    Index { at: At, face: u64, corner: u64, index: i64, vertices: u64 },
    /// A coordinate is not finite, or there are too many vertices.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// There are more values than 32 bits can count.
    #[error("element `{element}` holds more than 2³² list values; split the file")]
    TooLarge { element: String },
}

/// Errors of [`super::write()`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum WriteError {
    /// The destination returned an error.
    #[error("cannot write the file: {0}")]
    Io(#[from] io::Error),
    /// The positions do not belong to the mesh, or are not finite.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A coordinate is too large for `f32`.
    #[error(
        "vertex {vertex}: coordinate {value:?} is too large for a 4-byte float; write `double` instead"
    )]
    TooLarge { vertex: usize, value: f64 },
    /// A property does not have one value or list per record.
    #[error(
        "property `{property}` of element `{element}` has {found} records, expected {expected}"
    )]
    PropertyLength { element: String, property: String, expected: usize, found: usize },
    /// The lists of a property do not divide its values.
    #[error(
        "the lists of property `{property}` of element `{element}` do not divide its {values} values; they must ascend from 0 to that number"
    )]
    Lists { element: String, property: String, values: usize },
    /// A name is invalid in a header.
    #[error("`{name}` cannot name an element or property: a name must be one word, and unique")]
    Name { name: String },
    /// The polygons do not belong to the mesh.
    #[error(
        "the polygons do not belong to the mesh ({polygon_triangles} triangles against {triangles}, or other ones); set `polygons` to None"
    )]
    Polygons { polygon_triangles: usize, triangles: usize },
}
