//! The other ways to hold edges, and contacts with a field, on a 100 × 100 cloth; the air constraint
//! and the whole of Algorithm 1 on a tube about a ball. Each result is checked.

#![allow(missing_docs)]

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use if_benches::comparators::direct::DirectStretch;
use if_benches::comparators::global::GlobalStretch;
use if_core::field::SignedDistance;
use if_core::math::{Point, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::meshes::{cloth, icosphere, tube};
use if_core::shapes::{Sphere, Torus};
use if_mesh::index::Bvh;
use if_xpbd::air::{Air, AirParams};
use if_xpbd::algorithm1::{Below, run_algorithm1};
use if_xpbd::collision::SdfCollision;
use if_xpbd::constraint::Constraint;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::inner_surface::InnerSurface;
use if_xpbd::params::SolverParams;
use std::hint::black_box;

const N: u32 = 100;
/// The paper's substep, in seconds.
const H: f64 = 1e-3;

/// A cloth of a square metre, pinned along one side, and 1 % too large with each vertex up to 0.2
/// mm off.
fn scene() -> (TriMesh, Vec<Point>, Vec<f64>) {
    let mesh = cloth(1.0, 1.0, N - 1, N - 1);
    let noise = |k: usize, s: f64| 0.0002 * (k as f64 * s).sin();
    let start = mesh.vertices().iter().enumerate();
    let start = start.map(|(k, p)| {
        p + p.coords * 0.01 + Vector::new(noise(k, 12.9), noise(k, 78.2), noise(k, 37.7))
    });
    let start: Vec<Point> = start.collect();
    let weights =
        (0..mesh.vertices().len()).map(|k| f64::from(u8::from(k >= N as usize))).collect();
    (mesh, start, weights)
}

fn solves(c: &mut Criterion) {
    let (mesh, start, weights) = scene();
    let edges = EdgeSet::of_mesh(&mesh);
    let mut group = c.benchmark_group("if-xpbd/solve");
    group.throughput(Throughput::Elements(edges.len() as u64)).sample_size(10);
    let mut bench = |name: &str, constraint: &mut dyn Constraint| {
        let once = |constraint: &mut dyn Constraint, p: &mut Vec<Point>| {
            constraint.begin_substep(&start, &start, &weights, H);
            constraint.project(p, &weights, H)
        };
        let mut p = start.clone();
        let strains = |p: &[Point]| edges.strains(p).iter().map(|s| s * s).sum::<f64>();
        once(constraint, &mut p);
        assert!(
            strains(&p) < 0.5 * strains(&start),
            "{name}: {} of {}",
            strains(&p),
            strains(&start)
        );
        group.bench_function(name, |b| {
            b.iter_batched_ref(
                || start.clone(),
                |p| black_box(once(constraint, p)),
                BatchSize::LargeInput,
            );
        });
    };
    bench("direct100x100", &mut DirectStretch::new(&edges, 1e-7).expect("a positive compliance"));
    bench(
        "global100x100",
        &mut GlobalStretch::new(edges.clone(), 1e-7).expect("a positive compliance"),
    );
    group.finish();
}

fn contacts(c: &mut Criterion) {
    let (_, start, weights) = scene();
    let field = Torus { center: Point::new(0.5, 0.5, 0.0), major: 0.3, minor: 0.1 };
    let (masks, clearances) = (vec![1.0; start.len()], vec![0.0; start.len()]);
    let mut group = c.benchmark_group("if-xpbd/collision");
    group.throughput(Throughput::Elements(start.len() as u64)).sample_size(20);
    let once = |p: &mut Vec<Point>| {
        let mut contacts = SdfCollision::new(&field, &masks, &clearances).expect("sound numbers");
        contacts.begin_substep(&start, &start, &weights, H);
        contacts.project(p, &weights, H)
    };
    let mut p = start.clone();
    once(&mut p);
    let inside = |p: &[Point]| {
        p.iter().zip(&weights).filter(|(p, w)| **w > 0.0 && field.distance(p) < -1e-9).count()
    };
    assert!(inside(&start) > 500 && inside(&p) == 0, "{} -> {}", inside(&start), inside(&p));
    group.bench_function("torus10k", |b| {
        b.iter_batched_ref(|| start.clone(), |p| black_box(once(p)), BatchSize::LargeInput)
    });
    group.finish();
}

/// A ball, and a tube of `sides` × `rows` cells about it that passes 5 mm inside at the equator.
fn tube_in_ball(sides: u32, rows: u32) -> (TriMesh, TriMesh) {
    let tube = tube(0.295, 0.2, sides, rows, false);
    let lowered = tube.vertices().iter().map(|p| p - Vector::y() * 0.1).collect();
    (icosphere(0.3, 5), tube.with_vertices(lowered).expect("finite"))
}

/// Height above the ball of the lowest vertex, in metres.
fn lowest(p: &[Point]) -> f64 {
    p.iter().map(|p| p.coords.norm() - 0.3).fold(f64::INFINITY, f64::min)
}

fn air(c: &mut Criterion) {
    let (ball, tube) = tube_in_ball(200, 50);
    let tree = Bvh::new(&ball);
    let inner = InnerSurface::new(&ball, &tree);
    let start = tube.vertices();
    let (masks, weights) = (vec![1.0; start.len()], vec![1.0; start.len()]);
    let once = |p: &mut Vec<Point>| {
        let mut air = Air::new(&inner, start, &masks, AirParams::default()).expect("sound numbers");
        air.begin_substep(start, start, &weights, H);
        air.project(p, &weights, H)
    };
    let mut p = start.to_vec();
    once(&mut p);
    assert!(lowest(start) < -4e-3 && lowest(&p) > 0.0, "{} -> {}", lowest(start), lowest(&p));
    let mut group = c.benchmark_group("if-xpbd/air");
    group.throughput(Throughput::Elements(start.len() as u64)).sample_size(20);
    group.bench_function("tube10k", |b| {
        b.iter_batched_ref(|| start.to_vec(), |p| black_box(once(p)), BatchSize::LargeInput)
    });
    group.finish();
}

fn algorithm1(c: &mut Criterion) {
    let (ball, tube) = tube_in_ball(48, 12);
    let tree = Bvh::new(&ball);
    let inner = InnerSurface::new(&ball, &tree);
    let field = Sphere { center: Point::origin(), radius: 0.3 };
    let mask = vec![1.0; tube.vertices().len()];
    let params = SolverParams::default();
    let run = || {
        let air = Some((&inner, AirParams::default()));
        let below = Below { field: &field, mask: &mask, air };
        run_algorithm1(black_box(&tube), &below, &params, &mut Silent).expect("a sound scene").0
    };
    let found = run();
    assert!(lowest(&found) > 0.0, "{} m", lowest(&found));
    let mut group = c.benchmark_group("if-xpbd/algorithm1");
    group.sample_size(10).bench_function("tube600", |b| b.iter(run));
    group.finish();
}

criterion_group!(benches, solves, contacts, air, algorithm1);
criterion_main!(benches);
