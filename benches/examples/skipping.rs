//! What skipping saves: outfits resolved with and without it, one after the other, and whether the
//! results have the same bits.
//!
//! ```text
//! # ../shared/data/body_a and body_b
//! cargo run --release -p if-benches --example skipping [-- DATA_DIR…]
//! ```
//!
//! Prints a row for each outfit of DATA_DIR/outfits.json, or one for the built-in scene where there
//! is no data: queries made and skipped, vertices that nothing reached, time with and without
//! skipping; and the same outfit once clean, beside the time that verifying it takes.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_body::mannequin::{MannequinParams, layered};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::file::MeshFile;
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{
    ResolveError, ResolveParams, Resolved, resolve, resolve_without_skipping,
};
use if_outfit::verify::verify;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut folders: Vec<PathBuf> = std::env::args().skip(1).map(PathBuf::from).collect();
    if folders.is_empty() {
        folders = ["../shared/data/body_a", "../shared/data/body_b"].map(PathBuf::from).to_vec();
        folders.retain(|f| f.is_dir());
    }
    println!(
        "| outfit | queries | skipped | vertices skipped | s | s without skipping | factor | same bits | clean already, s | verify alone, s |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---|---:|---:|");
    if folders.is_empty() {
        let mut layers =
            layered(&MannequinParams::default()).into_iter().map(|(n, m)| Layer::new(n, m));
        let body = layers.next().ok_or("the scene has no body")?;
        row("demo", &Outfit::new(body, layers.collect())?)?;
    }
    for folder in folders {
        let text = std::fs::read_to_string(folder.join("outfits.json"))?;
        let outfits: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&text)?;
        for (name, outfit) in outfits {
            let Some(layers) = outfit["layers_inner_to_outer"].as_array() else { continue };
            let garments = layers.iter().filter_map(|l| l.as_str());
            let garments = garments.map(|g| {
                Ok(Layer::new(g, load(&folder.join("garments").join(format!("{g}.ply")))?))
            });
            let garments = garments.collect::<Result<_, Box<dyn Error>>>()?;
            row(
                &name,
                &Outfit::new(Layer::new("body", load(&folder.join("body_clean.ply"))?), garments)?,
            )?;
        }
    }
    Ok(())
}

fn load(path: &Path) -> Result<TriMesh, Box<dyn Error>> {
    Ok(MeshFile::read(path)?.mesh().clone())
}

fn run(outfit: &Outfit, skip: bool) -> Result<(f64, Resolved), Box<dyn Error>> {
    let start = Instant::now();
    let resolve = if skip { resolve } else { resolve_without_skipping };
    let found = resolve(outfit, &ResolveParams::default(), &mut Silent);
    let seconds = start.elapsed().as_secs_f64();
    match found {
        Err(ResolveError::Unresolved { result, .. }) => Ok((seconds, *result)),
        other => Ok((seconds, other?)),
    }
}

fn row(name: &str, outfit: &Outfit) -> Result<(), Box<dyn Error>> {
    let (with_s, with) = run(outfit, true)?;
    let (without_s, without) = run(outfit, false)?;
    let same = if with.outfit == without.outfit { "yes" } else { "NO" };
    let sum = |f: fn(&if_outfit::report::LayerReport) -> usize| {
        with.report.layers.iter().map(f).sum::<usize>()
    };
    let vertices: usize = outfit.garments.iter().map(|g| g.mesh.vertices().len()).sum();
    let (again, _) = run(&with.outfit, true)?;
    let start = Instant::now();
    verify(&with.outfit)?;
    let verified = start.elapsed().as_secs_f64();
    println!(
        "| {name} | {} | {} | {} of {vertices} | {with_s:.2} | {without_s:.2} | {:.2} | {same} | {again:.2} | {verified:.2} |",
        sum(|l| l.queries),
        sum(|l| l.skipped.queries),
        sum(|l| l.skipped.vertices),
        without_s / with_s
    );
    Ok(())
}
