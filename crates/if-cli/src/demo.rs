//! `ifg demo`: the built-in scene, written as files and resolved like any other outfit.
