//! Foreign tools in Python, for whoever asks: `IF_PYTHON` names one with numpy and meshio 5.3.5.
//!
//! ```sh
//! cargo build -p if-mesh --example ply_roundtrip
//! IF_PYTHON=/path/to/python cargo test -p if-mesh --test files meshio -- --ignored
//! ```
//!
//! `IFG_DATA` may name a folder whose `.ply` files all make the round trip too.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // also in what the tests share

use if_core::math::{Point, Vector};
use if_mesh::{measure, ply};
use std::path::{Path, PathBuf};
use std::process::Command;

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/files/meshio_interop.py");

/// A Python with what the script needs.
fn python() -> String {
    let python = std::env::var("IF_PYTHON")
        .unwrap_or_else(|_| panic!("name a Python with numpy and meshio 5.3.5 in IF_PYTHON"));
    let found = Command::new(&python).args(["-c", "import numpy, meshio"]).output();
    let found = found.unwrap_or_else(|e| {
        panic!("`{python}` does not start ({e}); name another Python in IF_PYTHON")
    });
    let said = String::from_utf8_lossy(&found.stderr);
    assert!(
        found.status.success(),
        "`{python}` lacks a module; install numpy and meshio==5.3.5 for it:\n{said}"
    );
    python
}

/// The example, which `cargo test` builds beside the tests.
fn roundtrip() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let built = test.parent().and_then(Path::parent).unwrap().join("examples/ply_roundtrip");
    let release = if cfg!(debug_assertions) { "" } else { "--release " };
    assert!(
        built.exists(),
        "{} is not there: cargo build {release}-p if-mesh --example ply_roundtrip",
        built.display()
    );
    built
}

#[test]
#[ignore = "needs Python with meshio: IF_PYTHON=/path/to/python"]
fn meshio_reads_what_we_write_and_we_read_what_it_writes() {
    let output = Command::new(python())
        .arg(SCRIPT)
        .arg(roundtrip())
        .args(std::env::var("IFG_DATA").ok())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
    println!("{text}");
    assert!(output.status.success(), "{text}");
}

#[test]
#[ignore = "needs Python with meshio: IF_PYTHON=/path/to/python"]
fn displacement_and_strain_are_those_of_the_referee() {
    let side = 20u32;
    let mut header = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n",
        side * side
    );
    header += &format!(
        "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        (side - 1) * (side - 1)
    );
    for k in 0..side * side {
        let (x, y) = (f64::from(k % side), f64::from(k / side));
        header += &format!("{} {} {}\n", 0.01 * x, 0.013 * y, 0.002 * (x * y).sin());
    }
    for k in (0..side * (side - 1)).filter(|k| k % side != side - 1) {
        header += &format!("3 {k} {} {}\n", k + 1, k + side);
    }
    let mut before = ply::read_bytes(header.as_bytes()).unwrap();
    let wave = |p: &Point| {
        p + Vector::new(0.001 * (90.0 * p.y).sin(), 0.002 * p.x, 0.0005 * (200.0 * p.x).cos())
    };
    let after: Vec<Point> = before.mesh.vertices().iter().map(wave).collect();
    before.polygons = None;
    let folder = tempfile::tempdir().unwrap();
    let paths = ["before.ply", "after.ply"].map(|n| folder.path().join(n));
    let params =
        ply::WriteParams { coordinates: ply::CoordinateType::Double, ..Default::default() };
    ply::write_path(&before, before.mesh.vertices(), &params, &paths[0]).unwrap();
    ply::write_path(&before, &after, &params, &paths[1]).unwrap();
    let output = Command::new(python()).arg(SCRIPT).arg("--cost").args(&paths).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let theirs: Vec<f64> = String::from_utf8_lossy(&output.stdout)
        .split_whitespace()
        .map(|w| w.parse().unwrap())
        .collect();
    let (d, s) = (
        measure::displacement(before.mesh.vertices(), &after),
        measure::strain(&before.mesh, &after),
    );
    let ours =
        [1e3 * d.mean, 1e3 * d.p95, 1e3 * d.max, 100.0 * s.rms, 100.0 * s.p99, 100.0 * s.max];
    // The sums run in another order, and l′ / l − 1 cancels: 1e-16 of a ratio near 1 against
    // strains near 0.1.
    approx::assert_relative_eq!(theirs[..], ours[..], max_relative = 1e-12);
}
