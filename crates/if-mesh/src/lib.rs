//! Surfaces of garments and bodies: files, spatial index, signed distances, extraction, clean-up.
//!
//! | to | use |
//! |---|---|
//! | read and write PLY, OBJ and glTF, with everything that the file stores | [`MeshFile`] |
//! | find nearest points, overlaps and hits | [`Bvh`] |
//! | find intersecting triangles, exactly | [`intersections`] |
//! | measure the signed distance to a mesh | [`MeshSdf`], [`Winding`] |
//! | close a garment over a body, and unite layers | [`ClosedLayer`], [`ClothedField`] |
//! | store a field in a sparse grid with a bounded error | [`Baked`] |
//! | turn a field into a mesh | [`extract()`], then [`marching`] |
//! | repair a mesh | [`cleanup()`], [`validate`] |
//! | label and cut a surface into garments | [`labels`] |
//! | rasterise it | [`camera`], [`raster`] |
//! | compare surfaces | [`measure`] |
//! | write positions of many frames | [`point_cache`] |
//!
//! Lengths are in metres, distances negative inside, and triangles counter-clockwise seen from
//! outside.
//!
//! # Examples
//!
//! ```
//! use if_core::shapes::Sphere;
//! use if_core::{ClosestPoint, Point, SignedDistance, Silent};
//! use if_mesh::{Bvh, ExtractParams, MeshSdf, Resolution, extract};
//!
//! // A field becomes a mesh, and the mesh a field again.
//! let ball = Sphere { center: Point::origin(), radius: 0.2 };
//! let params = ExtractParams { resolution: Resolution::Cell(0.02), ..Default::default() };
//! let mesh = extract(&ball, &params, &mut Silent)?.mesh;
//! let field = MeshSdf::closed(&mesh)?;
//! let p = Point::new(0.0, 0.3, 0.0);
//! assert!((field.distance(&p) - ball.distance(&p)).abs() < 1e-3);
//!
//! let nearest = Bvh::new(&mesh).closest(&p, 1.0).expect("the surface is within a metre");
//! assert!((nearest.distance - 0.1).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[doc(hidden)]
pub mod atomic;
pub mod attributes;
pub mod baked;
pub mod body_surface;
pub mod camera;
pub mod cleanup;
pub mod extract;
pub mod file;
mod float_of_c;
pub mod gltf;
pub mod grid;
pub mod index;
pub mod intersections;
pub mod inverted;
pub mod labels;
pub mod least_distance;
pub mod marching;
pub mod measure;
mod normals;
pub mod obj;
mod orient;
#[doc(hidden)]
pub mod outward;
pub mod ply;
pub mod point_cache;
pub mod point_tree;
#[doc(hidden)]
pub mod polygons;
pub mod primitive_distance;
#[doc(hidden)]
pub mod pseudo_normals;
pub mod raster;
pub mod regular_file;
pub mod sdf;
pub mod seams;
#[doc(hidden)]
pub mod sheet;
pub mod solid;
pub mod split;
pub mod validate;
#[doc(hidden)]
pub mod voxels;
pub mod winding;

pub use baked::{BakeParams, Baked};
pub use cleanup::{CleanupParams, cleanup};
pub use extract::{ExtractParams, Extraction, Resolution, extract};
pub use file::MeshFile;
pub use index::Bvh;
pub use sdf::MeshSdf;
pub use solid::{ClosedLayer, ClothedField};
pub use winding::Winding;
