//! One stretch sweep on a 100 × 100 cloth: 29,601 edges. `Throughput::Elements` gives the time for
//! each constraint. The result is checked: a sweep that does not relax the cloth fails.

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_xpbd::constraint::Constraint;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::stretch::Stretch;
use std::hint::black_box;

const N: u32 = 100;
/// The paper's substep, in seconds.
const H: f64 = 1e-3;

fn cloth() -> TriMesh {
    let at = |k: u32| f64::from(k) * 0.01;
    let vertices = (0..N * N).map(|k| Point::new(at(k % N), at(k / N), 0.0)).collect();
    let mut triangles = Vec::new();
    for j in 0..N - 1 {
        for i in 0..N - 1 {
            let v = j * N + i;
            triangles.push([v, v + 1, v + N + 1]);
            triangles.push([v, v + N + 1, v + N]);
        }
    }
    TriMesh::new(vertices, triangles).expect("a grid is a mesh")
}

fn sweep(c: &mut Criterion) {
    let mesh = cloth();
    let edges = EdgeSet::of_mesh(&mesh);
    let w = vec![1.0; mesh.vertices().len()];
    // 1 % stretched, and each vertex up to 2 mm off.
    let noise = |k: usize, s: f64| 0.002 * (k as f64 * s).sin();
    let start = mesh.vertices().iter().enumerate().map(|(k, p)| {
        Point::new(1.01 * p.x + noise(k, 12.9), 1.01 * p.y + noise(k, 78.2), noise(k, 37.7))
    });
    let start: Vec<Point> = start.collect();

    // Rigid: 200 sweeps must take most of the strain out.
    let mut stretch = Stretch::new(edges.clone(), 0.0).expect("a compliance of at least 0");
    let mut p = start.clone();
    stretch.begin_substep(&start, &start, &w, H);
    let first = stretch.project(&mut p, &w, H).rms();
    for _ in 0..200 {
        stretch.project(&mut p, &w, H);
    }
    let last = stretch.residual(&p, H).rms();
    assert!(last < 0.5 * first, "200 sweeps left {last} m of {first} m");

    let mut group = c.benchmark_group("if-xpbd/stretch");
    group.throughput(Throughput::Elements(edges.len() as u64));
    // What is timed: the first sweep of a substep, from the same cloth each time. One must not
    // leave more than there was.
    let mut stretch = Stretch::new(edges, 1e-5).expect("a compliance of at least 0");
    let once = |stretch: &mut Stretch, p: &mut Vec<Point>| {
        stretch.begin_substep(&start, &start, &w, H);
        stretch.project(p, &w, H)
    };
    let mut p = start.clone();
    let before = once(&mut stretch, &mut p).rms();
    let after = stretch.residual(&p, H).rms();
    assert!(p != start && after < before, "a sweep left {after} m of {before} m");
    group.bench_function("100x100", |b| {
        b.iter_batched_ref(
            || start.clone(),
            |p| black_box(once(&mut stretch, p)),
            BatchSize::LargeInput,
        );
    });
    group.finish();
}

criterion_group!(benches, sweep);
criterion_main!(benches);
