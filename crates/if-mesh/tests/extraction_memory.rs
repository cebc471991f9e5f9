//! An extraction takes no more memory than it says before it takes it, and says not much more than
//! it takes.
//!
//! ```text
//! # prints the table of docs/evidence/surfaces.md
//! cargo test --release -p if-mesh --test extraction_memory -- --include-ignored --nocapture
//! ```

#![allow(clippy::print_stdout)] // a table for the docs

mod fields;

use fields::{Case, cases, region};
use if_core::monitor::Silent;
use if_mesh::extract::{ExtractError, ExtractParams, Resolution, Sampling, extract};
use peak_alloc::PeakAlloc;
use std::sync::Mutex;

/// All of this program's blocks are counted: tests take turns.
#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;
static TURN: Mutex<()> = Mutex::new(());

/// Where an extraction of less than this is looked at, threads and warnings count as much.
const LITTLE: usize = 1 << 20;

/// What an extraction says that it takes, and what it takes at most at once, in bytes; and its
/// triangles.
fn told_and_taken(case: &Case, base: ExtractParams) -> (usize, usize, usize) {
    let params =
        ExtractParams { region: Some(region()), phase: case.phase, noise: case.noise, ..base };
    let mut told = 0;
    while let Err(error) =
        extract(&*case.field, &ExtractParams { memory: told, ..params }, &mut Silent)
    {
        match error {
            ExtractError::TooLarge { bytes, .. } => told = bytes,
            other => panic!("{}: {other}", case.name),
        }
    }
    let before = HEAP.current_usage();
    HEAP.reset_peak_usage();
    let found = extract(&*case.field, &ExtractParams { memory: told, ..params }, &mut Silent)
        .expect("it is enough");
    (told, HEAP.peak_usage() - before, found.mesh.triangles().len())
}

fn check(sizes: &[u32]) {
    let turn = TURN.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    println!(
        "| field | cells | way | triangles | told MB | taken MB | |\n| --- | --- | --- | --- | --- | --- | --- |"
    );
    let mut faults = Vec::new();
    for cells in sizes {
        for case in cases(*cells) {
            for (way, sampling, relax) in [
                ("sparse", Sampling::Sparse, 0),
                ("relaxed", Sampling::Sparse, 3),
                ("dense", Sampling::Dense, 0),
            ] {
                if sampling == Sampling::Dense && *cells > 256 {
                    continue;
                }
                let base = ExtractParams {
                    resolution: Resolution::Cells(*cells),
                    sampling,
                    relax,
                    ..ExtractParams::default()
                };
                let (told, taken, triangles) = told_and_taken(&case, base);
                let (ratio, mb) = (told as f64 / taken as f64, |bytes: usize| bytes as f64 / 1e6);
                let row = format!(
                    "| {} | {cells} | {way} | {triangles} | {:.1} | {:.1} | {ratio:.2} |",
                    case.name,
                    mb(told),
                    mb(taken)
                );
                println!("{row}");
                if taken > told.max(LITTLE) || told > 4 * taken.max(LITTLE) {
                    faults.push(row);
                }
            }
        }
    }
    drop(turn);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn an_extraction_takes_what_it_says() {
    check(&[64]);
}

#[test]
#[ignore = "ten minutes"]
fn large_extractions_take_what_they_say() {
    check(&[256, 512]);
}
