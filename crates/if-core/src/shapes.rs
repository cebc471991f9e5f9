//! Analytic fields, and meshes with known answers: what tests and benchmarks measure against.

mod combine;
pub mod meshes;
mod solids;

pub use combine::{Intersection, Offset, ScaledGradient, Subtraction, Translated, Union};
pub use solids::{Capsule, Cuboid, Cylinder, Gyroid, Plane, Sphere, Torus};
