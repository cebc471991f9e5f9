//! Surfaces of fields, queries of surfaces, bakes, votes, clean-up and files. Each result is checked.

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
use if_mesh::camera::Camera;
use if_mesh::cleanup::{CleanupParams, cleanup};
use if_mesh::extract::{ExtractParams, Resolution, Sampling, extract};
use if_mesh::index::Bvh;
use if_mesh::labels::{VoteParams, Voter};
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

fn bake(c: &mut Criterion) {
    let sdf = MeshSdf::closed(&surface()).expect("closed");
    let params = BakeParams::default();
    let run = || Baked::new(black_box(&sdf), &params, &mut Silent).expect("a torus bakes");
    let baked = run();
    let bound = baked.error_bound();
    for p in points().iter().filter(|p| sdf.distance(p).abs() < 0.5 * baked.band()) {
        assert!((baked.distance(p) - sdf.distance(p)).abs() <= bound);
    }
    let mut group = c.benchmark_group("if-mesh/bake");
    group.sample_size(10).bench_function("torus40k", |b| b.iter(|| run().bytes()));
    group.finish();
}

/// Votes of images of 256² on a mesh of 40,000 triangles, that of a half each for one label.
fn votes(c: &mut Criterion) {
    const FRAMES: usize = 4;
    let mesh = tube(0.2, 1.7, 200, 100, true);
    let (eye, middle) = (Point::new(0.0, 0.9, 3.3), Point::new(0.0, 0.85, 0.0));
    let camera = Camera::looking_at((256, 256), &eye, &middle, &Vector::y(), 0.56)
        .expect("a camera before the tube");
    // The upper half of the image has the label 1, the lower one the label 2.
    let labels: Vec<u8> = (0..256 * 256).map(|k| 1 + u8::from(k >= 256 * 128)).collect();
    let turned = |frame: usize| -> Vec<Point> {
        let (s, c) = (std::f64::consts::TAU * frame as Real / FRAMES as Real).sin_cos();
        let turn = |p: &Point| Point::new(c * p.x + s * p.z, p.y, c * p.z - s * p.x);
        mesh.vertices().iter().map(turn).collect()
    };
    let frames: Vec<Vec<Point>> = (0..FRAMES).map(turned).collect();
    let run = || {
        let params = VoteParams { enough: Real::INFINITY, ..Default::default() };
        let mut voter = Voter::new(black_box(&mesh), 3, &params).expect("three labels");
        for frame in &frames {
            voter.add(frame, &camera, &labels).expect("a frame of this mesh");
        }
        voter.finish().0
    };
    let found = run();
    let of = |v: usize| found.winner(v);
    let vertices = mesh.vertices().iter().enumerate();
    let wrong = vertices
        .filter(|(v, p)| {
            let wanted = if p.y > 0.85 { 1 } else { 2 };
            // Beside the border, and on the caps, which no camera sees, anything may win.
            (0.02..0.8).contains(&(p.y - 0.85).abs()) && of(*v) != wanted
        })
        .count();
    assert!(50 * wrong < mesh.vertices().len(), "{wrong} vertices have another label");
    let mut group = c.benchmark_group("if-mesh/votes");
    group.throughput(Throughput::Elements(FRAMES as u64)).sample_size(20);
    group.bench_function("tube40k", |b| b.iter(run));
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

criterion_group!(benches, extraction, queries, bake, votes, clean, files);
criterion_main!(benches);
