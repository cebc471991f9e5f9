//! Which build this is, for keys of caches.

/// The version, and a hash of the sources of this crate and of the project's crates that it depends
/// on. Keys of results and checkpoints hold it, so that a rebuilt program never returns old ones.
pub const BUILD: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("IF_SOURCES"));
