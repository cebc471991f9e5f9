//! Parameters of the PLY writer.

use crate::normals::Normals;

/// Type of the coordinates of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum CoordinateType {
    /// 4 bytes, as in nearly all garment files. The rounding error is 0.1 µm at 1 m.
    #[default]
    Float,
    /// 8 bytes: no rounding.
    Double,
}

/// What is written besides vertices and triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Keep {
    /// Every property and element, with its type; only vertex properties of type `int16`, which
    /// meshio cannot read, become `int32`. meshio reads the file unless it has lists other than the
    /// faces, properties of faces, or other elements.
    #[default]
    All,
    /// What other programs can read: one number per vertex and property, 64-bit integers as
    /// `double`; no properties of faces, no lists, no other elements.
    Portable,
}

/// Parameters of [`write()`](super::write()).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct WriteParams {
    /// Type of the coordinates.
    pub coordinates: CoordinateType,
    /// What is kept besides vertices and triangles.
    pub keep: Keep,
    /// Treatment of the vertex properties nx, ny and nz, if all three exist.
    pub normals: Normals,
}
