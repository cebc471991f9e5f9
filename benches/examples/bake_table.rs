//! Baking a fitted network: time, memory, bound, the largest error at a million points, and the
//! time of a query.
//!
//! ```text
//! cargo run --release -p if-benches --example bake_table -- body.safetensors [--points 1000000] \
//!     [--accuracy 1e-3,3e-4] [--redistance]
//! ```
//!
//! The first row is that of `BakeParams::default()`. Each accuracy is then baked as it is, which is
//! compared with the network itself, and, where that is asked for, re-distanced. What is
//! re-distanced is compared with the distance to a mesh of the network's zero set with edges of 1.5
//! mm, itself off by some hundredths of a millimetre. Queries are timed on one thread: one by one
//! and in batches, each at points in random order, which waits for memory, and at the same points
//! in the order of a curve through cells of 2 cm, as those of a mesh are.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Silent;
use if_mesh::baked::{BakeParams, Baked, Redistance};
use if_mesh::extract::{ExtractParams, Resolution, extract};
use if_mesh::sdf::MeshSdf;
use if_neural::field::NeuralField;
use if_neural::files::read_network;
use std::error::Error;
use std::time::Instant;

/// Points no farther than this from the surface are judged, in metres.
const REACH: Real = 0.02;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let (mut file, mut count, mut accuracies) = (None, 1_000_000, vec![1e-3, 3e-4]);
    let mut ways = vec![Redistance::Never];
    while let Some(word) = words.next() {
        match word.as_str() {
            "--points" => count = words.next().ok_or("--points needs a number")?.parse()?,
            "--accuracy" => {
                let text = words.next().ok_or("--accuracy needs lengths in metres")?;
                accuracies = text.split(',').map(str::parse).collect::<Result<_, _>>()?;
            }
            "--redistance" => ways.push(Redistance::Always),
            path => file = Some(path.to_owned()),
        }
    }
    let (network, frame) =
        read_network(std::fs::File::open(file.ok_or("usage: bake_table FILE.safetensors")?)?)?;
    let start = Instant::now();
    let field = NeuralField::new(network, frame)?;
    println!(
        "lipschitz {:.2}, box {:?}, measured in {:.1?}",
        field.lipschitz(),
        field.bounds(),
        start.elapsed()
    );
    let points = near(&field, count)?;
    let nothing = FieldSample { distance: 0.0, gradient: Vector::zeros() };
    let mut truth = vec![nothing; points.len()];
    let start = Instant::now();
    field.samples(&points, &mut truth);
    let asked = start.elapsed().as_secs_f64() / points.len() as Real * 1e9;
    println!(
        "{} points within {REACH} m of the surface; the network takes {asked:.0} ns a point",
        points.len()
    );
    let start = Instant::now();
    let mesh = extract(
        &field,
        &ExtractParams { resolution: Resolution::Cell(0.0015), ..ExtractParams::default() },
        &mut Silent,
    )?
    .mesh;
    let exact = MeshSdf::closed(&mesh)?;
    let mut distances = vec![0.0; points.len()];
    exact.distances(&points, &mut distances);
    println!(
        "{} triangles of the zero set, and their distances, in {:.1?}",
        mesh.triangles().len(),
        start.elapsed()
    );
    let ordered = in_order(&points);
    println!(
        "asked, mm | re-distanced | seconds | cells mm | bricks by level | MB | bound mm | largest error mm | p99.9 | mean | \
         query ns, random | in order | in batches, random | in order | file MB | load ms"
    );
    println!(
        "--- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | ---"
    );
    let asked = accuracies.iter().flat_map(|a| ways.iter().map(|w| (Some(*a), *w)));
    for (accuracy, redistance) in [(None, Redistance::WhenNeeded)].into_iter().chain(asked) {
        let name = accuracy.map_or_else(|| "default".into(), |a| format!("{:.3}", a * 1e3));
        let start = Instant::now();
        let baked = match accuracy {
            None => Baked::new(&field, &BakeParams::default(), &mut Silent),
            Some(a) => {
                let params = BakeParams {
                    redistance,
                    band: 1.5 * REACH,
                    depth: 1.5 * REACH,
                    memory: 8 << 30,
                    ..BakeParams::default()
                };
                Baked::with_accuracy(&field, a, REACH, &params, &mut Silent)
            }
        };
        let baked = match baked {
            Ok(baked) => baked,
            Err(error) => {
                println!("{name} | {redistance:?} | | | | | | | {error}");
                continue;
            }
        };
        let seconds = start.elapsed().as_secs_f64();
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let time = |points: &[Point]| {
            let mut out = vec![nothing; points.len()];
            let start = Instant::now();
            out.iter_mut().zip(points).for_each(|(o, p)| *o = baked.sample(p));
            let single = start.elapsed();
            let start = Instant::now();
            one.install(|| {
                points.chunks(4096).zip(out.chunks_mut(4096)).for_each(|(p, o)| baked.samples(p, o))
            });
            let ns = |t: std::time::Duration| t.as_secs_f64() / points.len() as Real * 1e9;
            ([ns(single), ns(start.elapsed())], out)
        };
        let bytes = baked.to_bytes();
        let start = Instant::now();
        let again = Baked::from_bytes(&bytes)?;
        let load = start.elapsed().as_secs_f64() * 1e3;
        assert_eq!(again.error_bound(), baked.error_bound());
        drop(again);
        let (random, got) = time(&points);
        let (coherent, _) = time(&ordered);
        let expected =
            |k: usize| if baked.is_redistanced() { distances[k] } else { truth[k].distance };
        let mut errors: Vec<Real> = (0..points.len())
            .filter(|k| expected(*k).abs() <= REACH)
            .map(|k| (got[k].distance - expected(k)).abs())
            .collect();
        errors.sort_unstable_by(Real::total_cmp);
        println!(
            "{name} | {} | {seconds:.1} | {:.2}–{:.2} | {:?} | {:.1} | {:.4} | {:.4} | {:.4} | {:.4} | {:.0} | {:.0} | {:.0} | {:.0} | {:.1} | {load:.1}",
            baked.is_redistanced(),
            baked.cell() * 1e3,
            baked.smallest_cell() * 1e3,
            baked.bricks_by_level(),
            baked.bytes() as Real / 1e6,
            baked.error_bound_within(REACH) * 1e3,
            errors[errors.len() - 1] * 1e3,
            errors[errors.len() / 1000 * 999] * 1e3,
            errors.iter().sum::<Real>() / errors.len() as Real * 1e3,
            random[0],
            coherent[0],
            random[1],
            coherent[1],
            bytes.len() as Real / 1e6,
        );
    }
    Ok(())
}

/// The points sorted by cells of 2 cm along a Morton curve.
fn in_order(points: &[Point]) -> Vec<Point> {
    let low = points
        .iter()
        .fold(Point::new(Real::INFINITY, Real::INFINITY, Real::INFINITY), |l, p| l.inf(p));
    let code = |p: &Point| {
        let cell = ((p - low) / 0.02).map(|x| x as u64);
        (0..20).fold(0u64, |code, bit| {
            (0..3).fold(code, |code, k| code | (cell[k] >> bit & 1) << (3 * bit + k))
        })
    };
    let mut sorted: Vec<(u64, Point)> = points.iter().map(|p| (code(p), *p)).collect();
    sorted.sort_by_key(|(code, _)| *code);
    sorted.into_iter().map(|(_, p)| p).collect()
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
        let some: Vec<Point> = (0..values.len())
            .map(|_| bounds.min + bounds.size().component_mul(&Vector::new(next(), next(), next())))
            .collect();
        field.distances(&some, &mut values);
        out.extend(some.iter().zip(&values).filter(|(_, v)| v.abs() <= REACH).map(|(p, _)| *p));
        if out.len() >= count {
            break;
        }
    }
    out.truncate(count);
    Ok(out)
}
