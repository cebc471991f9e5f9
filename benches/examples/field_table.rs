//! Garments settled by Algorithm 1 on one body in three forms: its mesh, a network fitted to it,
//! and that network baked.
//!
//! ```text
//! ifg fit BODY.ply --out body.safetensors --seconds 60
//! cargo run --release -p if-benches --example field_table -- BODY.ply body.safetensors GARMENT.ply …
//! ```
//!
//! Each garment is settled alone. A row: seconds to settle; intersecting pairs of triangles with
//! the body's mesh; vertices inside of that, and how deep; and how far its vertices end from where
//! the mesh's own field brings them.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_benches::baselines::algorithm1::{ClothedBody, run};
use if_core::field::SignedDistance;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::baked::{BakeParams, Baked};
use if_mesh::file::MeshFile;
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;
use if_mesh::sdf::MeshSdf;
use if_neural::field::NeuralField;
use if_neural::files::read_network;
use if_xpbd::params::SolverParams;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let [body, network, garments @ ..] = &files[..] else {
        return Err("usage: field_table BODY.ply body.safetensors GARMENT.ply …".into());
    };
    let body = MeshFile::read(Path::new(body))?.mesh().clone();
    let (network, frame) = read_network(std::fs::File::open(network)?)?;
    let start = Instant::now();
    let exact = MeshSdf::closed(&body)?;
    println!("the mesh's field: made in {:.2} s", start.elapsed().as_secs_f64());
    let learned = NeuralField::new(network, frame)?;
    let start = Instant::now();
    let baked = Baked::new(&learned, &BakeParams::default(), &mut Silent)?;
    let bound = baked.error_bound_within(BakeParams::default().reach);
    println!(
        "the network baked: in {:.2} s, {:.1} MB, within {:.3} mm of the network's distance",
        start.elapsed().as_secs_f64(),
        baked.bytes() as Real / 1e6,
        bound * 1e3
    );
    println!(
        "garment | field | seconds | pairs | vertices inside | deepest mm | mean mm from the mesh's | largest"
    );
    println!("--- | --- | --- | --- | --- | --- | --- | ---");
    for path in garments {
        let garment = MeshFile::read(Path::new(path))?.mesh().clone();
        let name = Path::new(path).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let scene = Scene { body: &Bvh::new(&body), exact: &exact, garment: &garment, name: &name };
        let first = scene.row("the mesh", &exact, None)?;
        scene.row("the network", &learned, Some(&first))?;
        scene.row("the network, baked", &baked, Some(&first))?;
    }
    Ok(())
}

struct Scene<'a> {
    body: &'a Bvh,
    exact: &'a MeshSdf,
    garment: &'a TriMesh,
    name: &'a str,
}

impl Scene<'_> {
    fn row<F: SignedDistance + Send>(
        &self,
        label: &str,
        field: &F,
        first: Option<&[Point]>,
    ) -> Result<Vec<Point>, Box<dyn Error>> {
        let start = Instant::now();
        let settled = run(
            self.garment,
            &ClothedBody { field, mask: None, air: None },
            &SolverParams::default(),
        )?;
        let seconds = start.elapsed().as_secs_f64();
        let mesh = self.garment.with_vertices(settled.clone())?;
        let met = pairs(self.body, &Bvh::new(&mesh)).len();
        let mut depths = vec![0.0; settled.len()];
        self.exact.distances(&settled, &mut depths);
        let inside = depths.iter().filter(|d| **d < 0.0).count();
        let deepest = depths.iter().fold(0.0, |m: Real, d| m.max(-d));
        let off: Vec<Real> =
            first.unwrap_or(&settled).iter().zip(&settled).map(|(a, b)| (a - b).norm()).collect();
        let mean = off.iter().sum::<Real>() / off.len().max(1) as Real;
        println!(
            "{} | {label} | {seconds:.2} | {met} | {inside} | {:.3} | {:.3} | {:.3}",
            self.name,
            deepest * 1e3,
            mean * 1e3,
            off.iter().fold(0.0, |m: Real, d| m.max(*d)) * 1e3
        );
        Ok(settled)
    }
}
