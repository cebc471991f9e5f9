//! The solver on problems with known answers, and on hostile ones.

mod algorithm1;
mod physics;
mod stress;
