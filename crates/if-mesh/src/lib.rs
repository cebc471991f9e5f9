//! Triangle meshes of garments: files, spatial index, exact intersections, signed distance fields
//! of meshes, the closed clothed-body field, and measures.

pub mod atomic;
pub mod attributes;
pub mod baked;
pub mod camera;
pub mod cleanup;
pub mod cut;
#[cfg(feature = "decimate")]
pub mod decimate;
pub mod expansion;
pub mod extract;
pub mod file;
pub mod index;
pub mod intersections;
pub mod inverted;
pub mod marching;
pub mod measure;
mod normals;
pub mod obj;
pub mod outward;
pub mod ply;
pub mod point_tree;
pub mod polygons;
pub mod pseudo_normals;
pub mod raster;
pub mod sdf;
pub mod seams;
pub mod smooth_labels;
pub mod solid;
pub mod split;
pub mod subdivide;
pub mod taubin;
pub mod validate;
pub mod votes;
pub mod voxels;
pub mod whole_folder;
pub mod winding;
