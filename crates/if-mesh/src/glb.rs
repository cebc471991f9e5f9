//! Binary glTF files (`.glb`): read for their surface as it stands in the scene, and written with
//! nothing changed except the vertices that moved.
//!
//! The mesh is the union of all triangles of the default scene, or those of one of its nodes
//! ([`read_layer()`]), in the order of the nodes, as a viewer shows it before any animation: moved
//! by the transforms of the nodes, by the joints of skins and by morph targets with a weight.
//! [`write()`] carries a moved vertex back through them, and replaces its 12 bytes, its normal, and
//! the bounds that the file states for its accessor; [`write_layers()`] does so for several nodes.
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
pub use read::{read, read_layer};
pub use write::{write, write_layers};

#[cfg(test)]
mod tests;
