//! Draws the built-in scene, or mesh files, to a PNG file.
//!
//! ```text
//! cargo run --release -p if-pipeline --example show -- OUT.png [--trousers] [--overlap 0.5] [--resolution 2]
//! cargo run --release -p if-pipeline --example show -- OUT.png body.ply shirt.ply coat.obj
//! ```
//!
//! Views: front, three-quarter, back, and the left half cut away. Intersecting triangles are red.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_body::mannequin::{MannequinParams, body, layered, layered_with_trousers};
use if_core::aabb::Aabb;
use if_core::intersect::{Contact, triangles};
use if_core::mesh::TriMesh;
use if_mesh::file::MeshFile;
use if_mesh::index::Bvh;
use if_render::render::{PALETTE, RenderLayer, View, side_by_side};
use std::error::Error;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = None;
    let mut files = Vec::new();
    let mut params = MannequinParams::default();
    let (mut trousers, mut naked) = (false, false);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut number = || {
            args.next().ok_or("a number is missing")?.parse::<f64>().map_err(Box::<dyn Error>::from)
        };
        match arg.as_str() {
            "--trousers" => trousers = true,
            "--naked" => naked = true,
            "--overlap" => params.overlap = number()?,
            "--resolution" => params.resolution = number()?,
            path if out.is_none() => out = Some(path.to_owned()),
            path => files.push(path.to_owned()),
        }
    }
    let out = out.ok_or(
        "usage: show OUT.png [--trousers] [--naked] [--overlap X] [--resolution X] [FILES]",
    )?;
    params.validate()?;

    let start = Instant::now();
    let scene: Vec<(String, TriMesh)> = match files.as_slice() {
        [] if naked => vec![("body".into(), body(&params))],
        [] if trousers => layered_with_trousers(&params),
        [] => layered(&params),
        files => files
            .iter()
            .map(|f| Ok((f.clone(), MeshFile::read(Path::new(f))?.mesh().clone())))
            .collect::<Result<_, Box<dyn Error>>>()?,
    };
    let made = start.elapsed();
    let red: Vec<Vec<u32>> = intersecting(&scene);
    for ((name, mesh), red) in scene.iter().zip(&red) {
        let (v, t) = (mesh.vertices().len(), mesh.triangles().len());
        println!(
            "{name}: {v} vertices, {t} triangles, {} of them intersect other layers",
            red.len()
        );
    }
    let layers: Vec<RenderLayer> = scene
        .iter()
        .zip(&red)
        .enumerate()
        .map(|(k, ((_, mesh), red))| RenderLayer {
            mesh,
            color: PALETTE[k % PALETTE.len()],
            highlight: red,
        })
        .collect();
    let start = Instant::now();
    let image = side_by_side(
        &layers,
        &[View::FRONT, View::THREE_QUARTER, View::BACK, View::HALF],
        800,
        1200,
    );
    let drawn = start.elapsed();
    let start = Instant::now();
    image.write_png(std::io::BufWriter::new(std::fs::File::create(&out)?))?;
    println!("made in {made:.1?}, drawn in {drawn:.1?}, {out} written in {:.1?}", start.elapsed());
    Ok(())
}

/// For each layer its triangles that meet one of another layer.
fn intersecting(scene: &[(String, TriMesh)]) -> Vec<Vec<u32>> {
    let mut out = vec![Vec::new(); scene.len()];
    let trees: Vec<Bvh> = scene.iter().map(|(_, mesh)| Bvh::new(mesh)).collect();
    for i in 0..scene.len() {
        for j in i + 1..scene.len() {
            let (a, b) = (&scene[i].1, &scene[j].1);
            for t in 0..b.triangles().len() {
                let mut met = false;
                trees[i].overlapping(&Aabb::from_points(b.corners(t)), |u| {
                    if triangles(a.corners(u as usize), b.corners(t)) != Contact::Disjoint {
                        met = true;
                        out[i].push(u);
                    }
                });
                if met {
                    out[j].push(t as u32);
                }
            }
        }
    }
    out.iter_mut().for_each(|l| {
        l.sort_unstable();
        l.dedup();
    });
    out
}
