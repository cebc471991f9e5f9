//! The words that all crates of if-garments share: points, checked triangle meshes, signed distance
//! fields and nearest points, analytic shapes with known answers, and exact predicates.
//!
//! Units are metres, seconds and kilograms. Distances are negative inside. Triangles wind
//! counter-clockwise seen from outside.

pub mod aabb;
pub mod closest;
#[cfg(feature = "conformance")]
pub mod conformance;
pub mod edges;
pub mod field;
pub mod intersect;
pub mod masked;
pub mod math;
pub mod mesh;
pub mod monitor;
pub mod parameter;
mod pointers;
pub mod rows;
pub mod shapes;
