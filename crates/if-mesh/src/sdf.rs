//! Signed distance of a mesh.
