//! glTF files, binary (`.glb`) and JSON (`.gltf`): read for their surface as it is in the scene, and
//! written with nothing changed except the vertices that moved.
//!
//! The mesh is the union of all triangles of the default scene, or those of one of its nodes
//! ([`read_layer()`]), in the order of the nodes, as a viewer shows it before any animation: moved
//! by the transforms of the nodes, by the joints of skins and by morph targets with a weight; triangles
//! of a node that mirrors have their corners in the other order.
//! [`write()`] carries a moved vertex back through them, and replaces its 12 bytes, its normal, and
//! the bounds that the file states for its accessor; [`write_layers()`] does so for several nodes.
//! Everything else survives: materials, textures, texture coordinates, joints and weights,
//! animations, cameras, extensions, and what this version does not know.
//!
//! Positions that are quantised (`KHR_mesh_quantization`) or sparse become single-precision numbers
//! if one of them moves, so that what was proven is what is stored. Quantised normals keep their
//! form. Buffers are in the file, in data URIs, or in files of the same folder or below; they are
//! written in the same form, or embedded ([`Beside`]).
//!
//! What cannot be read is refused with an error that says what to export instead: compressed meshes
//! (Draco, meshopt) and GPU instances. Vertices that two nodes show are read, but cannot move.
//!
//! [`write_motion()`] writes a new file, in which layers move.
//!
//! # Source
//!
//! Khronos Group, *glTF 2.0 Specification*, version 2.0.1.

mod accessor;
mod data;
mod document;
mod edit;
mod error;
mod gltf_mesh;
mod joints;
mod motion;
mod placing;
mod read;
mod scene;
mod skin;
mod source;
mod uri;
mod write;

pub use crate::normals::Normals;
pub use edit::{Beside, GltfFiles};
pub use error::{ReadError, WriteError};
pub use gltf_mesh::{GltfMesh, Influences};
pub use motion::{MotionError, MotionLayer, check_motion, write_motion};
pub use read::{read, read_layer};
pub use scene::SkinJoint;
pub use write::{write, write_frame, write_layers};

#[cfg(test)]
mod tests;
