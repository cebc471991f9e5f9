//! Which build this is, for keys of caches.

/// The version, and a hash of the sources of this crate and of the project's crates that it depends
/// on. A cache of resolved outfits has it in its keys, so that a rebuilt resolver never returns old
/// results.
pub const BUILD: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("IF_SOURCES"));
