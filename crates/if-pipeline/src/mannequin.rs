//! The built-in scene.
