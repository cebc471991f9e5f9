//! Binary glTF files (`.glb`): read for their surface as it stands in the scene, and written with
//! nothing changed except the vertices that moved.
//!
//! The mesh is the union of all triangles of the default scene, in the order of its nodes, as a
//! viewer shows it before any animation: moved by the transforms of the nodes, by the joints of
//! skins and by morph targets with a weight. [`write()`] carries a moved vertex back through them,
//! and replaces its 12 bytes, its normal, and the bounds that the file states for its accessor.
//! Everything else survives: materials, textures, texture coordinates, joints and weights,
//! animations, cameras, extensions, and what this version does not know.
//!
//! What cannot be written back is refused with an error that says what to export instead: external
//! buffers, compressed, quantised or sparse positions, one mesh in two nodes.
//!
//! # Source
//!
//! Khronos Group, *glTF 2.0 Specification*, version 2.0.1.

mod accessor;
mod container;
mod document;
mod error;
mod glb_mesh;
mod placing;
mod read;
mod scene;
mod write;

pub use crate::normals::Normals;
pub use error::{ReadError, WriteError};
pub use glb_mesh::GlbMesh;
pub use read::read;
pub use write::write;

#[cfg(test)]
mod tests;
