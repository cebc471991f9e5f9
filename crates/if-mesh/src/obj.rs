//! OBJ files: read for their surface, and written with nothing changed except the vertices that
//! moved.
//!
//! [`read`] keeps the whole text. [`write()`] copies it, and replaces the coordinates on `v` lines of
//! vertices that moved (and, see [`Normals`], the normals that rotate with them) by the shortest
//! decimals that are read back as the same `f64`. So UVs, groups, materials, smoothing groups,
//! polygons, comments, colours after the coordinates, line ends and the order of everything survive
//! byte for byte.
//!
//! The vertices of the mesh are all `v` lines in the file's order, used by a face or not.
//!
//! `tobj` is the independent reader in the tests. It is not used here: it renumbers vertices in the
//! order of their use and drops unused ones, rounds to `f32`, does not support continued lines,
//! rejects a `vt` of one number, names no line in its errors, and overflows on some relative
//! indices.

mod error;
mod listing;
mod materials;
mod numbers;
mod obj_mesh;
mod parse;
mod read;
mod split;
mod to_ply;
mod words;
mod write;

pub use crate::normals::Normals;
pub use error::{Index, ReadError, WriteError};
pub use materials::textures;
pub use obj_mesh::ObjMesh;
pub use read::read;
pub(crate) use read::read_text;
pub use split::split;
pub use to_ply::{Lost, to_ply};
pub use write::write;
