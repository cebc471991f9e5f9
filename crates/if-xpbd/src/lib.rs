//! Extended position-based dynamics for cloth: Algorithm 1 of IF-Garments, made robust.
//!
//! The supplement's Algorithm 1 settles one garment on the layer below it. Its lines are here:
//!
//! | lines | what | where |
//! |---|---|---|
//! | 1 to 3, 23 to 26 | substeps, prediction, velocities | [`solver`] |
//! | 4, 5 | λ ← 0, β̃ = β / h² | `begin_substep` of each [`constraint::Constraint`] |
//! | 6 to 10 | collision with a field | [`collision`]; with fixed planes [`half_space`] |
//! | 11 to 15 | air between two layers, in four readings | [`air`] |
//! | 16 to 22 | stretch | [`stretch`] by sweeps, [`direct`] and [`global`] at once |
//! | all, wired | one garment over one field | [`algorithm1`] |
//!
//! [`params::SolverParams::literal`] is the text as printed. The default departs from it where the
//! text does harm, and says so at each place: `C + β̃ λ` for `C + β λ` (18), contacts after the
//! stretch and not before (6 to 22), a division by |∇φ|² and a clearance (8), velocities that
//! a push does not feed (24), or none at all (quasi-static).
//!
//! Beyond the paper: [`bending`], [`strain_limit`], [`attach`], contacts of moving vertices, faces
//! and edges in [`pair_contact`], friction, early stop, and steps that are taken back when they go
//! wrong.
//!
//! A group of constraints is one object behind [`constraint::Constraint`]: a call through a vtable
//! per group and sweep, and plain loops inside. Order and bits depend on the input alone, not on
//! the number of threads. [`coloring`] and [`edge_set`] lay constraints out for speed.
//!
//! # Examples
//!
//! A square of cloth, 1 cm inside a ball, comes out:
//!
//! ```
//! use if_core::{field::SignedDistance, math::{Point, Vector}, shapes::{Sphere, meshes}};
//! use if_xpbd::{algorithm1::{Below, settle}, params::SolverParams};
//! use std::ops::ControlFlow;
//!
//! let cloth = meshes::cloth(0.1, 0.1, 10, 10);
//! let ball = Sphere { center: Point::new(0.05, 0.05, -0.19), radius: 0.2 };
//! let mask = vec![1.0; cloth.vertices().len()];
//! let below = Below { field: &ball, mask: &mask, air: None };
//! let (after, report) = settle(&cloth, &below, &SolverParams::default(), |_, _| ControlFlow::Continue(()))?;
//! assert!(after.iter().all(|p| ball.distance(p) >= 0.0));
//! assert!(report.steps < 360);
//! # Ok::<(), if_xpbd::algorithm1::SettleError>(())
//! ```

pub mod air;
pub mod algorithm1;
pub mod attach;
pub mod bending;
pub mod collision;
pub mod coloring;
pub mod constraint;
pub mod direct;
pub mod edge_set;
pub mod fixed_offsets;
pub mod global;
pub mod half_space;
pub mod inner_surface;
pub mod pair_contact;
pub mod params;
pub mod particles;
pub mod report;
pub mod separation;
pub mod solver;
pub mod strain_limit;
pub mod stretch;
pub mod tie;
