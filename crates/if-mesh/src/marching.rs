//! Isosurface of a sampled field.
