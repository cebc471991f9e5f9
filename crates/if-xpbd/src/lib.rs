//! Extended position-based dynamics for cloth: Algorithm 1 of IF-Garments, made robust.

pub mod air;
pub mod algorithm1;
pub mod attach;
pub mod bending;
pub mod collision;
pub mod coloring;
pub mod constraint;
pub mod direct;
pub mod edge_set;
pub mod global;
pub mod half_space;
pub mod pair_contact;
pub mod params;
pub mod particles;
pub mod strain_limit;
pub mod separation;
pub mod solver;
pub mod stretch;
pub mod tie;
