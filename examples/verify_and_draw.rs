//! The proof alone, and a picture of what it finds: intersecting triangles in red.
//!
//! ```text
//! cargo run --release --example verify_and_draw [OUT.png]
//! ```

#![allow(clippy::print_stdout)] // a program for the terminal

use if_garments::body::mannequin::{MannequinParams, layered};
use if_garments::render::{View, preview};
use if_garments::{Layer, Outfit, TriMesh, verify};
use std::fs::File;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = layered(&MannequinParams { resolution: 0.7, ..Default::default() });
    let mut layers = scene.iter().map(|(name, mesh)| Layer::new(name, mesh.clone()));
    let outfit = Outfit::new(layers.next().ok_or("no body")?, layers.collect())?;

    // Nothing is changed; each pair of layers that meets is counted.
    let found = verify(&outfit)?;
    for pair in found.pairs.iter().filter(|pair| !pair.is_clean()) {
        let (pairs, inside) = (pair.pairs.total(), pair.vertices_inside);
        println!("{} over {}: {pairs} pairs, {inside} vertices inside", pair.outer, pair.inner);
    }
    assert!(!found.is_clean() && found.total_pairs() > 0);

    let out =
        std::env::args_os().nth(1).map_or(std::env::temp_dir().join("layers.png"), Into::into);
    let meshes: Vec<&TriMesh> = scene.iter().map(|(_, mesh)| mesh).collect();
    let picture = preview(&meshes, &[View::FRONT, View::HALF], [400, 640]);
    picture.write_png(File::create(&out)?)?;
    println!("{}", out.display());
    Ok(())
}
