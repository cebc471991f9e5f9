//! From captures to moving people and garments.

mod motion;
mod poses;
mod reconstruct;
