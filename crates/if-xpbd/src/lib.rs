//! Extended position-based dynamics for cloth: a [`Solver`] that moves [`Particles`] under groups
//! of constraints ([`Constraint`]), and Algorithm 1 of IF-Garments on top of it
//! ([`run_algorithm1`]).
//!
//! There is one loop, [`Solver::step`]: substeps, sweeps over the groups, guards and roll-back.
//! Algorithm 1, as printed or corrected, and the cloth of `if-outfit`'s `resolve` are
//! configurations of it ([`SolverParams`]).
//!
//! # Groups
//!
//! | group | constraint |
//! |---|---|
//! | [`Stretch`] | edge lengths with compliance; also distances across edges, which resist bending |
//! | [`StrainLimit`] | bounds on edge lengths |
//! | [`Attachments`] | particles and target positions |
//! | [`Ties`] | vertices and triangles with one displacement: the sheets of a fold |
//! | [`FixedOffsets`] | pairs of particles that only translate |
//! | [`HalfSpaces`] | contacts of points on the cloth with fixed planes |
//! | [`Separations`] | triangles of one garment that keep their sides |
//! | [`SdfCollision`] | contacts with a signed distance field |
//! | [`Air`] | gaps to the layer below, in four interpretations |
//!
//! A group is one object behind [`Constraint`]: one dynamic call per group and sweep, and plain
//! loops inside. The order of visiting and the bits of the result depend on the input alone, not on
//! the number of threads. To add a constraint, implement the trait and pass it to
//! [`Solver::step`]: `src/fixed_offsets.rs` is a short example.
//!
//! # Algorithm 1
//!
//! The supplement's Algorithm 1 settles one garment on the layer below it:
//!
//! | lines | step | where |
//! |---|---|---|
//! | 1 to 3, 23 to 26 | substeps, prediction, velocities | [`solver`] |
//! | 4, 5 | λ ← 0, β̃ = β / h² | [`Constraint::begin_substep`] and `project` of each group |
//! | 6 to 10 | collision with a field | [`collision`]; with fixed planes [`half_space`] |
//! | 11 to 15 | air between two layers, in four readings | [`air`] |
//! | 16 to 22 | stretch | [`stretch`] |
//! | all | one garment over one field | [`algorithm1`] |
//!
//! [`SolverParams::literal`], with [`AirReading::Literal`](air::AirReading::Literal) for line 13, is the text as
//! printed, for comparisons. The default departs from it
//! where the text does harm, and documents it at each place: `C + β̃ λ` for `C + β λ` (18),
//! contacts after the stretch and not before (6 to 22), a division by |∇φ|² and a clearance (8),
//! velocities without the speed of pushes (24), or none at all (quasi-static).
//!
//! # Examples
//!
//! A square of cloth, 1 cm inside a ball, is moved out of it:
//!
//! ```
//! use if_core::{Point, Silent, SignedDistance, shapes::{Sphere, meshes}};
//! use if_xpbd::{Below, SolverParams, run_algorithm1};
//!
//! let cloth = meshes::cloth(0.1, 0.1, 10, 10);
//! let ball = Sphere { center: Point::new(0.05, 0.05, -0.19), radius: 0.2 };
//! let mask = vec![1.0; cloth.vertices().len()];
//! let below = Below { field: &ball, mask: &mask, air: None };
//! let (after, report) = run_algorithm1(&cloth, &below, &SolverParams::default(), &mut Silent)?;
//! assert!(after.iter().all(|p| ball.distance(p) >= 0.0));
//! assert!(report.steps < 360);
//! # Ok::<(), if_xpbd::Algorithm1Error>(())
//! ```

pub mod air;
pub mod algorithm1;
pub mod attach;
pub mod collision;
#[doc(hidden)]
pub mod coloring;
pub mod constraint;
pub mod edge_set;
pub mod fixed_offsets;
pub mod half_space;
pub mod inner_surface;
pub mod params;
pub mod particles;
pub mod report;
pub mod separation;
pub mod solver;
pub mod strain_limit;
pub mod stretch;
pub mod tie;

pub use air::{Air, AirParams};
pub use algorithm1::{Algorithm1Error, Below, run_algorithm1};
pub use attach::Attachments;
pub use collision::SdfCollision;
pub use constraint::{Constraint, Residual, Stage};
pub use edge_set::EdgeSet;
pub use fixed_offsets::FixedOffsets;
pub use half_space::HalfSpaces;
pub use inner_surface::InnerSurface;
pub use params::{Motion, SolverParams};
pub use particles::Particles;
pub use report::{RunError, RunReport, StepError, StepReport};
pub use separation::Separations;
pub use solver::Solver;
pub use strain_limit::StrainLimit;
pub use stretch::Stretch;
pub use tie::Ties;

/// The example in the README is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
