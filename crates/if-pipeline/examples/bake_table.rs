//! Baking a fitted network: time, memory, bound, the largest error at a million points, and the time of a query.
//!
//! ```text
//! cargo run --release -p if-pipeline --example bake_table -- body.safetensors [--points 1000000] [--accuracy 1e-3,1e-4,1e-5]
//! ```
//!
//! Each accuracy is baked twice: as it is, which is compared with the network itself; and re-distanced, whose zero set is
//! compared with the network's.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_mesh::baked::{BakeParams, Baked, Redistance};
use if_neural::field::NeuralField;
use if_neural::files::read_network;
use std::error::Error;
use std::time::Instant;

/// Points no farther than this from the surface are judged, in metres.
const REACH: Real = 0.02;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let (mut file, mut count, mut accuracies) = (None, 1_000_000, vec![1e-3, 1e-4, 1e-5]);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--points" => count = words.next().ok_or("--points needs a number")?.parse()?,
            "--accuracy" => {
                let text = words.next().ok_or("--accuracy needs lengths in metres")?;
                accuracies = text.split(',').map(str::parse).collect::<Result<_, _>>()?;
            }
            path => file = Some(path.to_owned()),
        }
    }
    let (network, frame) = read_network(std::fs::File::open(file.ok_or("usage: bake_table FILE.safetensors")?)?)?;
    let start = Instant::now();
    let field = NeuralField::new(network, frame)?;
    println!("lipschitz {:.2}, box {:?}, measured in {:.1?}", field.lipschitz(), field.bounds(), start.elapsed());
    let points = near(&field, count)?;
    let nothing = FieldSample { distance: 0.0, gradient: Vector::zeros() };
    let mut truth = vec![nothing; points.len()];
    let start = Instant::now();
    field.samples(&points, &mut truth);
    let asked = start.elapsed().as_secs_f64() / points.len() as Real * 1e9;
    println!("{} points within {REACH} m of the surface; the network takes {asked:.0} ns a point", points.len());
    println!("accuracy mm | re-distanced | seconds | cell mm | MB | bound mm | largest error mm | query ns");
    println!("--- | --- | --- | --- | --- | --- | --- | ---");
    for accuracy in accuracies {
        for redistance in [Redistance::Never, Redistance::Always] {
            let params = BakeParams { redistance, depth: 0.05, ..BakeParams::default() };
            let start = Instant::now();
            let baked = Baked::with_accuracy(&field, accuracy, REACH, &params)?;
            let seconds = start.elapsed().as_secs_f64();
            let start = Instant::now();
            let got: Vec<Real> = points.iter().map(|p| baked.sample(p).distance).collect();
            let query = start.elapsed().as_secs_f64() / points.len() as Real * 1e9;
            let errors = got.iter().zip(&truth).filter(|(_, t)| t.distance.abs() <= REACH).map(|(g, t)| match redistance {
                Redistance::Never => (g - t.distance).abs(),
                // Near the zero set both are the distance but for a few percent of itself.
                _ if t.distance.abs() < 1e-4 => (g - t.distance / t.gradient.norm().max(0.1)).abs(),
                _ => 0.0,
            });
            let largest = errors.fold(0.0, Real::max);
            println!(
                "{:.3} | {} | {seconds:.1} | {:.2} | {:.1} | {:.4} | {:.4} | {query:.0}",
                accuracy * 1e3,
                baked.is_redistanced(),
                baked.cell() * 1e3,
                baked.bytes() as Real / 1e6,
                baked.error_bound_within(REACH) * 1e3,
                largest * 1e3
            );
        }
    }
    Ok(())
}

/// Random points of the box that the network puts near the surface.
fn near(field: &impl SignedDistance, count: usize) -> Result<Vec<Point>, Box<dyn Error>> {
    let bounds = field.bounds().ok_or("no bounds")?;
    let mut state = 7u64;
    let mut next = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as Real / (1u64 << 53) as Real
    };
    let mut out = Vec::with_capacity(count);
    let mut values = vec![0.0; 1 << 15];
    for _ in 0..1000 {
        let some: Vec<Point> =
            (0..values.len()).map(|_| bounds.min + bounds.size().component_mul(&Vector::new(next(), next(), next()))).collect();
        field.distances(&some, &mut values);
        out.extend(some.iter().zip(&values).filter(|(_, v)| v.abs() <= REACH).map(|(p, _)| *p));
        if out.len() >= count {
            break;
        }
    }
    out.truncate(count);
    Ok(out)
}
