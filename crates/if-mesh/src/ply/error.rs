//! Why a PLY file cannot be read or written.

use super::scalar::ScalarType;
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

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(n) => write!(f, "line {n}"),
            Self::Byte(n) => write!(f, "byte {n}"),
        }
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
    /// There are no bytes at all.
    #[error("the file is empty")]
    Empty,
    /// The first line is another one.
    #[error("line 1 is {found:?}, but a PLY file begins with a line `ply`")]
    NotPly { found: String },
    /// The header does not end.
    #[error(
        "the header has no line `end_header` within {bytes} bytes ({lines} lines); the file is cut off or no PLY file"
    )]
    HeaderEnd { bytes: u64, lines: u64 },
    /// A line of the header is none of PLY.
    #[error("line {line} of the header is not understood: {text:?}")]
    HeaderLine { line: u64, text: String },
    /// There is no line `format`, or it names another version.
    #[error(
        "the header needs a line `format ascii 1.0`, `format binary_little_endian 1.0` or `format binary_big_endian 1.0`"
    )]
    Format,
    /// Two elements of one name.
    #[error("line {line}: the header has a second element `{name}`; each needs its own name")]
    DuplicateElement { line: u64, name: String },
    /// Two properties of one name.
    #[error(
        "line {line}: element `{element}` has a second property `{name}`; each needs its own name"
    )]
    DuplicateProperty { line: u64, element: String, name: String },
    /// Records of no bytes, so that any count would fit.
    #[error(
        "element `{element}` has no property, yet claims {count} records; remove it, or set its count to 0"
    )]
    NoProperties { element: String, count: u64 },
    /// The length of a list must be a whole number.
    #[error(
        "list `{property}` of element `{element}` has its length as {found}; it must be an integer type"
    )]
    ListLengthType { element: String, property: String, found: ScalarType },
    /// More records than the bytes that follow can hold.
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
    /// Something follows after the last record.
    #[error(
        "{at}: something follows the last record; the counts in the header are too small, or the file is damaged"
    )]
    Trailing { at: At },
    /// A line of values is too short or too long.
    #[error("{at}: record {record} of element `{element}` has {found} values, expected {expected}")]
    ValueCount { at: At, element: String, record: u64, expected: u64, found: u64 },
    /// A value is not a number of its type.
    #[error(
        "{at}: `{property}` of record {record} of element `{element}` is {text:?}, which is not a number of type {expected}"
    )]
    Value {
        at: At,
        element: String,
        record: u64,
        property: String,
        text: String,
        expected: ScalarType,
    },
    /// A list of less than no values.
    #[error(
        "{at}: list `{property}` of record {record} of element `{element}` has the length {length}; it cannot be negative"
    )]
    ListLength { at: At, element: String, record: u64, property: String, length: i64 },
    /// The vertices lack a coordinate.
    #[error(
        "element `vertex` needs the properties x, y and z, each one number, but has none for {axis}"
    )]
    NoCoordinate { axis: char },
    /// No element `vertex`.
    #[error("the file has no element `vertex`")]
    NoVertices,
    /// The faces have no vertices.
    #[error("element `face` has {count} records, but no list `vertex_indices` or `vertex_index`")]
    NoIndices { count: u64 },
    /// The surface stands in another form.
    #[error(
        "the surface stands in `tristrips`, which are not read; store it as element `face` with a list `vertex_indices`"
    )]
    TriangleStrips,
    /// Vertex indices that are no whole numbers.
    #[error(
        "list `{property}` of element `face` has values of type {found}; vertex indices need an integer type"
    )]
    IndexType { property: String, found: ScalarType },
    /// A face of one or two corners.
    #[error("{at}: face {face} has {corners} corners; a face needs at least 3")]
    FaceTooShort { at: At, face: u64, corners: u64 },
    /// A face names a vertex that does not exist.
    #[error("{at}: corner {corner} of face {face} names vertex {index}, but the vertices are 0 to {}", vertices.saturating_sub(1))]
    Index { at: At, face: u64, corner: u64, index: i64, vertices: u64 },
    /// A coordinate is not finite, or there are too many vertices.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// More values than 32 bits can count.
    #[error("element `{element}` holds more than 2³² list values; split the file")]
    TooLarge { element: String },
}

/// Why [`super::write()`] has not written a mesh.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum WriteError {
    /// The system did not take the bytes.
    #[error("cannot write the file: {0}")]
    Io(#[from] io::Error),
    /// The positions do not fit the mesh, or are not finite.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A coordinate that is finite in `f64` and not in `f32`.
    #[error(
        "vertex {vertex}: coordinate {value:?} is too large for a 4-byte float; write `double` instead"
    )]
    TooLarge { vertex: usize, value: f64 },
    /// A property does not have one value or list for each record.
    #[error(
        "property `{property}` of element `{element}` has {found} records, expected {expected}"
    )]
    PropertyLength { element: String, property: String, expected: usize, found: usize },
    /// A name that a header cannot hold.
    #[error(
        "`{name}` cannot name an element or property: names are one word of printable ASCII, and each stands once"
    )]
    Name { name: String },
    /// The faces kept from the file are not those of the mesh.
    #[error(
        "the polygons do not belong to the mesh ({polygon_triangles} triangles against {triangles}, or other ones); set `polygons` to None"
    )]
    Polygons { polygon_triangles: usize, triangles: usize },
}
