//! Triangle meshes of garments: files, spatial index, exact intersections, signed distance fields of
//! meshes, the closed clothed-body field, and measures.

pub mod baked;
pub mod index;
pub mod intersections;
pub mod marching;
pub mod measure;
pub mod obj;
pub mod ply;
pub mod pseudo_normals;
pub mod sdf;
pub mod solid;
pub mod voxels;
