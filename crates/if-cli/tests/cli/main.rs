//! The binary as a user meets it: exit codes, messages, files.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod animate;
mod bad_input;
mod batch;
mod bodies;
mod chain;
mod clean;
mod commands;
mod cut;
mod extract;
mod fit;
mod folder;
mod gltf;
mod own;
mod pinch;
mod reconstruct;
mod same_bytes;
mod wardrobe;
