//! How time grows with size: one outfit as it is, and with 4 and 16 times the triangles.
//!
//! ```text
//! cargo run --release -p if-benches --example scaling [-- --data ../shared/data/body_a]
//! ```
//!
//! The outfit is o1 (jeans, T-shirt, cardigan) where the data is there, else the built-in scene.
//! Each triangle is split into four at the middles of its edges, garments and body alike. Prints a
//! table.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_body::mannequin::{MannequinParams, layered};
use if_core::edges::Edges;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::file::MeshFile;
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{ResolveError, ResolveParams, resolve};
use if_outfit::verify::verify;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let data = match args.as_slice() {
        [] => PathBuf::from("../shared/data/body_a"),
        [flag, folder] if flag == "--data" => folder.into(),
        _ => return Err("usage: scaling [--data DIR]".into()),
    };
    let mut outfit = if data.is_dir() { real(&data)? } else { built_in()? };
    println!(
        "| triangles | pairs before | left | resolve, s | exponent | verify, s | exponent | trees and pairs alone, s | exponent |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut last: Option<[f64; 4]> = None;
    for _ in 0..3 {
        let triangles: usize = outfit.layers().map(|l| l.mesh.triangles().len()).sum();
        let start = Instant::now();
        verify(&outfit)?;
        let verified = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let trees: Vec<Bvh> = outfit.layers().map(|l| Bvh::new(&l.mesh)).collect();
        let found: usize = (0..trees.len())
            .flat_map(|b| (0..b).map(move |a| (a, b)))
            .map(|(a, b)| pairs(&trees[a], &trees[b]).len())
            .sum();
        let alone = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let result = match resolve(&outfit, &ResolveParams::default(), &mut Silent) {
            Err(ResolveError::Unresolved { result, .. }) => *result,
            other => other?,
        };
        let now = [triangles as f64, start.elapsed().as_secs_f64(), verified, alone];
        // Time grows as triangles to this power.
        let exponent = |k: usize| {
            last.map_or("".to_owned(), |l| {
                format!("{:.2}", (now[k] / l[k]).ln() / (now[0] / l[0]).ln())
            })
        };
        println!(
            "| {triangles} | {found} | {} | {:.2} | {} | {verified:.3} | {} | {alone:.4} | {} |",
            result.report.after.total_pairs() + result.report.after.total_inside(),
            now[1],
            exponent(1),
            exponent(2),
            exponent(3),
        );
        last = Some(now);
        outfit = Outfit {
            body: finer(&outfit.body)?,
            garments: outfit.garments.iter().map(finer).collect::<Result<_, _>>()?,
        };
    }
    Ok(())
}

fn real(data: &Path) -> Result<Outfit, Box<dyn Error>> {
    let load = |file: &str| {
        Ok::<_, Box<dyn Error>>(Layer::new(file, MeshFile::read(&data.join(file))?.mesh().clone()))
    };
    let garments = ["garments/jeans.ply", "garments/tshirt.ply", "garments/cardigan.ply"];
    Ok(Outfit::new(
        load("body_clean.ply")?,
        garments.into_iter().map(load).collect::<Result<_, _>>()?,
    )?)
}

fn built_in() -> Result<Outfit, Box<dyn Error>> {
    let mut layers =
        layered(&MannequinParams::default()).into_iter().map(|(name, mesh)| Layer::new(name, mesh));
    let body = layers.next().ok_or("the scene has a body")?;
    Ok(Outfit::new(body, layers.collect())?)
}

/// The layer with each triangle split into four.
fn finer(layer: &Layer) -> Result<Layer, Box<dyn Error>> {
    let mesh = &layer.mesh;
    let mut vertices = mesh.vertices().to_vec();
    let mut middles = BTreeMap::new();
    for &[a, b] in &Edges::new(mesh).vertices {
        middles.insert([a.min(b), a.max(b)], vertices.len() as u32);
        let sum = mesh.vertices()[a as usize].coords + mesh.vertices()[b as usize].coords;
        vertices.push(Point::from(sum * 0.5));
    }
    let middle = |a: u32, b: u32| middles[&[a.min(b), a.max(b)]];
    let split = |&[a, b, c]: &[u32; 3]| {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    let triangles = mesh.triangles().iter().flat_map(split).collect();
    Ok(Layer { mesh: TriMesh::new(vertices, triangles)?, ..layer.clone() })
}
