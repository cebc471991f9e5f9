//! PLY files: text and binary, with everything that they hold.
//!
//! [`read`] accepts what any program writes: the three formats, all names of types with `int64` and
//! `uint64`, elements and properties in any order, unknown elements, lists of any kind, faces of
//! any number of corners, line ends of Unix and Windows. Its peak memory is the result and one block
//! of input: 1.4 times the file for the usual million triangles, and below four times if every
//! number takes at least four bytes (a `0` and a space of a text file become eight bytes in any
//! reader). Counts in the header are not trusted: they are checked against the size of the file if
//! that is known, else memory is reserved as records arrive.
//!
//! [`write()`] writes `binary_little_endian` in the order that meshio 5.3.5 requires: vertices
//! first, coordinates first among their properties, then faces. [`Keep`] selects what else is
//! written.
//!
//! The grammar of the header is parsed by `ply-rs-bw`. Its payload reader is not used: it takes
//! thirty times as long, stores each record as a map, and cannot read `nan` or 64-bit integers. The
//! tests use it as an independent reader.

mod ascii;
mod binary;
mod error;
mod header;
mod params;
mod ply_mesh;
mod read;
mod rows;
mod scalar;
mod source;
mod split;
mod table;
mod write;

pub use crate::attributes::{Column, Property, ScalarType};
pub use error::{At, ReadError, WriteError};
pub use params::{CoordinateType, Keep, WriteParams};
pub use ply_mesh::{Element, PlyMesh};
pub use read::{read, read_bytes, read_path};
pub use split::split;
pub use write::{quantise, write, write_path};
