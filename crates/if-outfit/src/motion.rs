//! Outfits in motion: a clean outfit follows its skinned targets from one clean state to the next.
//!
//! A [`Walker`] holds body and garments in one problem. For a path of targets, such as the skinned
//! positions between two poses, it repeats:
//!
//! ```text
//! C = vertex–triangle and edge–edge pairs near in the last clean state, directions turned with the target
//! x = target + u,  u = argmin E(u)  subject to  n · Σ cᵢ xᵢ ≥ gap for all of C
//! x has intersecting pairs: hold these triangles apart as well, solve again; then halve the step
//! else: accept x
//! ```
//!
//! [`Walker::approach`] leads from a clean state towards another one in the same way, as far as
//! contacts permit: frames whose displacements were smoothed over time come out clean again.
//!
//! [`Crossings`] says what passes through what between two states: small steps make that rare, and
//! nothing else forbids it.
//!
//! No accepted state has an intersecting pair that the rest state does not have, but for those of a body
//! that was [let go](Walker::set_letting_go), so a walk can end at any step. Targets come from the caller: this module sees no skeleton.

mod active;
mod approach;
mod attempt;
mod clean;
mod concerned;
mod contact;
mod crossings;
mod drawn_back;
mod equilibrium;
mod facing;
mod keep;
mod let_go;
mod locality;
mod opening;
mod params;
mod proof;
mod scene;
mod sides;
mod snapshot;
mod step;
mod tolerated;
mod turn;
mod walk;

#[cfg(test)]
mod tests;

pub use crossings::{Crossing, Crossings};
pub(crate) use drawn_back::{DrawnBack, drawn_back};
pub(crate) use facing::{pinched, room};
pub(crate) use opening::{OWN, moved_apart};
pub use params::WalkParams;
pub use proof::{Pinched, Proof, VertexInside};
pub use snapshot::SnapshotError;
pub use walk::{WalkError, Walked, Walker};
