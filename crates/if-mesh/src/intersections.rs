//! Intersecting triangle pairs of meshes.
