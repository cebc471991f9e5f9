//! Surfaces of fields, queries of surfaces, clean-up and files. Each result is checked.

#![allow(missing_docs)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use if_core::closest::ClosestPoint;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::Torus;
use if_core::shapes::meshes::{torus, tube};
use if_mesh::attributes::VertexAttributes;
use if_mesh::baked::{BakeParams, Baked};
use if_mesh::cleanup::{CleanupParams, cleanup};
use if_mesh::extract::{ExtractParams, Resolution, Sampling, extract};
use if_mesh::index::Bvh;
use if_mesh::ply::{PlyMesh, WriteParams, read_bytes, write_path};
use if_mesh::sdf::MeshSdf;
use if_mesh::winding::Winding;
use std::hint::black_box;

const TORUS: Torus = Torus { center: Point::new(0.0, 0.0, 0.0), major: 0.3, minor: 0.1 };
const POINTS: usize = 20_000;
/// How far the facets of [`surface`] lie below the torus, in metres.
const CHORD: Real = 2e-4;

/// 40,000 triangles.
fn surface() -> TriMesh {
    torus(TORUS.major, TORUS.minor, 200, 100)
}

/// Points round about the torus.
fn points() -> Vec<Point> {
    let at = |k: usize, f: Real| (f * (k as Real + 1.0)).sin();
    (0..POINTS)
        .map(|k| Point::new(0.4 * at(k, 12.9898), 0.4 * at(k, 78.233), 0.12 * at(k, 37.719)))
        .collect()
}

fn extraction(c: &mut Criterion) {
    let mut group = c.benchmark_group("if-mesh/extract");
    group.sample_size(20);
    for (sampling, name, cells) in [
        (Sampling::Sparse, "sparse", 64),
        (Sampling::Sparse, "sparse", 128),
        (Sampling::Dense, "dense", 64),
    ] {
        let params =
            ExtractParams { resolution: Resolution::Cells(cells), sampling, ..Default::default() };
        let run = || {
            extract(black_box(&TORUS), &params, &mut Silent).expect("a torus has a surface").mesh
        };
        let mesh = run();
        assert!(
            mesh.triangles().len() > 1000
                && mesh.vertices().iter().all(|p| TORUS.distance(p).abs() < 1e-6)
        );
        group.bench_function(format!("{name}{cells}"), |b| {
            b.iter(|| assert_eq!(run().triangles().len(), mesh.triangles().len()))
        });
    }
    group.finish();
}

fn queries(c: &mut Criterion) {
    let (mesh, points) = (surface(), points());
    let tree = Bvh::new(&mesh);
    let sdf = MeshSdf::closed(&mesh).expect("closed");
    let winding = Winding::new(&mesh);
    let baked = Baked::new(&TORUS, &BakeParams { cell: 0.01, ..Default::default() }, &mut Silent)
        .expect("a torus bakes");
    let mut out = vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; POINTS];
    sdf.samples(&points, &mut out);
    for (p, s) in points.iter().zip(&out) {
        let truth = TORUS.distance(p);
        assert!((s.distance - truth).abs() < CHORD);
        assert!(
            (tree.closest(p, Real::INFINITY).expect("there are triangles").distance - truth.abs())
                .abs()
                < CHORD
        );
        assert!(truth.abs() < CHORD || (winding.at(p) > 0.5) == (truth < 0.0));
        assert!(
            truth.abs() > baked.band() || (baked.distance(p) - truth).abs() <= baked.error_bound()
        );
    }
    let mut group = c.benchmark_group("if-mesh/queries");
    group.throughput(Throughput::Elements(POINTS as u64)).sample_size(20);
    let closest = |p: &Point| tree.closest(p, Real::INFINITY).map_or(0.0, |c| c.distance);
    group.bench_function("closest", |b| {
        b.iter(|| black_box(&points).iter().map(closest).sum::<Real>())
    });
    group.bench_function("signed_distance", |b| {
        b.iter(|| sdf.samples(black_box(&points), &mut out))
    });
    group.bench_function("winding", |b| b.iter(|| winding.of(black_box(&points))));
    group.bench_function("baked", |b| b.iter(|| baked.samples(black_box(&points), &mut out)));
    group.bench_function("build_index", |b| b.iter(|| Bvh::new(black_box(&mesh)).len()));
    group.finish();
}

fn clean(c: &mut Criterion) {
    let whole = tube(0.15, 0.6, 100, 100, false);
    // A tube with a hole of two by four cells in every tenth row.
    let holed: Vec<[u32; 3]> = whole
        .triangles()
        .iter()
        .enumerate()
        .filter(|(t, _)| {
            let (row, column) = (t / 200, t / 2 % 100);
            !(row % 10 >= 5 && row % 10 < 7 && (20..24).contains(&column))
        })
        .map(|(_, t)| *t)
        .collect();
    let holed = TriMesh::new(whole.vertices().to_vec(), holed).expect("a part of a mesh");
    let attributes = VertexAttributes::none(holed.vertices().len());
    let run = || {
        cleanup(black_box(&holed), &attributes, None, &CleanupParams::default(), &mut Silent)
            .expect("a tube is cleaned")
    };
    let report = run().report;
    assert_eq!((report.holes.filled.len(), report.holes.openings.len()), (10, 2));
    let mut group = c.benchmark_group("if-mesh/cleanup");
    group.sample_size(20).bench_function("tube20k", |b| b.iter(run));
    group.finish();
}

fn files(c: &mut Criterion) {
    let ply = PlyMesh::new(surface());
    let path = std::env::temp_dir().join(format!("if-mesh-bench-{}.ply", std::process::id()));
    let write = || {
        write_path(&ply, ply.mesh.vertices(), &WriteParams::default(), &path)
            .expect("a folder that takes files")
    };
    write();
    let bytes = std::fs::read(&path).expect("just written");
    let back = read_bytes(&bytes).expect("what we write we read");
    assert_eq!(back.mesh.triangles(), ply.mesh.triangles());
    let mut group = c.benchmark_group("if-mesh/ply");
    group.throughput(Throughput::Bytes(bytes.len() as u64)).sample_size(20);
    group.bench_function("read40k", |b| {
        b.iter(|| read_bytes(black_box(&bytes)).expect("as before"))
    });
    group.bench_function("write40k", |b| b.iter(write));
    group.finish();
    std::fs::remove_file(&path).expect("it is there");
}

criterion_group!(benches, extraction, queries, clean, files);
criterion_main!(benches);
