//! Hashes the sources of this crate and of the project's crates that it depends on, for keys of
//! caches: a rebuilt program never takes the results of another build for its own.
//!
//! In a checkout these crates are beside this one. In a package only this crate is there; the
//! others are pinned to exactly its version by the workspace's `Cargo.toml`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn main() {
    let own = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    println!("cargo::rerun-if-changed=build.rs");
    let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
    for folder in with_dependencies(&own) {
        let sources = folder.join("src");
        println!("cargo::rerun-if-changed={}", sources.display());
        println!("cargo::rerun-if-changed={}", folder.join("Cargo.toml").display());
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        for file in files(&sources) {
            let inner = file.strip_prefix(&sources).unwrap_or(&file).to_string_lossy();
            hash.update(format!("{name}/{}\n", inner.replace('\\', "/")).as_bytes());
            hash.update(&std::fs::read(&file).unwrap_or_default());
        }
    }
    println!("cargo::rustc-env=IF_SOURCES={:016x}", hash.0);
}

/// The folder of this crate and those of the project's crates that it depends on, as far as they
/// are beside it, in order.
fn with_dependencies(own: &Path) -> BTreeSet<PathBuf> {
    let (mut found, mut open) = (BTreeSet::new(), vec![own.to_path_buf()]);
    while let Some(folder) = open.pop() {
        let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap_or_default();
        let used = manifest.split("\n[").find(|section| section.starts_with("dependencies]"));
        for line in used.unwrap_or_default().lines().filter(|line| line.starts_with("if-")) {
            let name: String =
                line.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '-').collect();
            open.extend(
                folder
                    .parent()
                    .map(|crates| crates.join(name))
                    .filter(|f| f.join("src").is_dir() && !found.contains(f)),
            );
        }
        found.insert(folder);
    }
    found
}

/// All files below a folder, in order.
fn files(folder: &Path) -> BTreeSet<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .flat_map(|entry| {
            let path = entry.path();
            if path.is_dir() { files(&path) } else { BTreeSet::from([path]) }
        })
        .collect()
}

/// FNV-1a, 64 bits.
struct Fnv(u64);

impl Fnv {
    /// Adds bytes; line ends count as `\n` on all systems.
    fn update(&mut self, bytes: &[u8]) {
        for byte in bytes.iter().filter(|byte| **byte != b'\r') {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}
