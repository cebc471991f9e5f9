//! Tells the binary what it was built with: target, compiler, and the versions of the crates that
//! its numbers depend on, for receipts.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Crates whose version can change a result.
const CRATES: [&str; 15] = [
    "if-core",
    "if-sparse",
    "if-mesh",
    "if-xpbd",
    "if-neural",
    "if-body",
    "if-outfit",
    "if-pipeline",
    "if-cli",
    "faer",
    "nalgebra",
    "ply-rs-bw",
    "pulp",
    "rayon",
    "robust",
];

fn main() {
    let manifest = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    // The workspace's lock file, or that of a published package.
    let locks = [manifest.join("../../Cargo.lock"), manifest.join("Cargo.lock")];
    let lock = locks.iter().find(|path| path.is_file());
    println!("cargo::rerun-if-changed=build.rs");
    if let Some(path) = lock {
        println!("cargo::rerun-if-changed={}", path.display());
    }
    println!("cargo::rustc-env=IFG_CRATES={}", lock.map(|path| versions(path)).unwrap_or_default());
    println!("cargo::rustc-env=IFG_TARGET={}", std::env::var("TARGET").unwrap_or_default());
    println!("cargo::rustc-env=IFG_RUSTC={}", rustc().unwrap_or_default());
}

/// `name version` of each of [`CRATES`] that the lock file has, joined by commas.
fn versions(lock: &Path) -> String {
    let text = std::fs::read_to_string(lock).unwrap_or_default();
    let field = |package: &str, key: &str| {
        let line = package.lines().find(|line| line.starts_with(key))?;
        line.split('"').nth(1).map(str::to_owned)
    };
    let found = text.split("[[package]]").filter_map(|package| {
        let name = field(package, "name = ")?;
        let version = field(package, "version = ")?;
        CRATES.contains(&name.as_str()).then(|| format!("{name} {version}"))
    });
    found.collect::<Vec<_>>().join(",")
}

fn rustc() -> Option<String> {
    let out = Command::new(std::env::var_os("RUSTC")?).arg("--version").output().ok()?;
    Some(String::from_utf8(out.stdout).ok()?.trim().to_owned())
}
