//! Mesh files from outside, and parameters as text.

mod malformed_ply;
mod meshio;
mod obj;
mod params_as_text;
mod ply;
