//! The words that all crates of if-garments share.
//!
//! [`TriMesh`] is a triangle mesh that is checked once, at construction. [`SignedDistance`] and
//! [`ClosestPoint`] are what solids and surfaces compute, [`Masked`](masked::Masked) restricts a
//! field to a region, and [`intersect::triangles`] decides exactly what two triangles have in
//! common. Long work reports to a [`Monitor`], and every parameter that is out of range is a
//! [`ParameterError`]. [`shapes`] has solids and meshes with known answers.
//!
//! Units are metres, seconds and kilograms. Distances are negative inside. Triangles wind
//! counter-clockwise seen from outside.
//!
//! # Examples
//!
//! ```
//! use if_core::intersect::{Contact, triangles};
//! use if_core::shapes::{Sphere, meshes};
//! use if_core::{Point, SignedDistance};
//!
//! let ball = Sphere { center: Point::origin(), radius: 0.5 };
//! let mesh = meshes::icosphere(0.5, 3);
//! assert!(mesh.vertices().iter().all(|p| ball.distance(p).abs() < 1e-12));
//!
//! let p = Point::new;
//! let floor = [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.0, 1.0, 0.0)];
//! let wall = [p(0.2, 0.2, -1.0), p(0.2, 0.2, 1.0), p(2.0, 2.0, 0.0)];
//! assert_eq!(triangles(floor.each_ref(), wall.each_ref()), Contact::Crossing);
//! ```

pub mod aabb;
pub mod closest;
pub mod conformance;
pub mod distance;
pub mod edges;
pub mod field;
pub mod geodesic;
pub mod intersect;
pub mod masked;
pub mod math;
pub mod mesh;
pub mod monitor;
pub mod number_or_infinite;
pub mod parameter;
mod pointers;
pub mod random;
pub mod rows;
pub mod separating_axis;
pub mod shapes;
pub mod union_find;

pub use aabb::Aabb;
pub use closest::{Closest, ClosestPoint};
pub use field::{FieldSample, SignedDistance};
pub use masked::Mask;
pub use math::{Point, Real, Vector};
pub use mesh::{MeshError, TriMesh};
pub use monitor::{Cancelled, Monitor, Progress, Silent};
pub use nalgebra;
pub use parameter::ParameterError;

/// The example in the README is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
