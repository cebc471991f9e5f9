//! Alignment of a garment between bodies, and the stages of a reconstruction:
//! `cargo bench -p if-benches --bench capture`. Each result is checked.

#![allow(missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use if_body::TemplateBody;
use if_body::align::{AlignParams, BodyMap, BodyShape, Method};
use if_body::mannequin::{Garment, MannequinParams, body, garment};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::extract::{ExtractParams, Resolution, extract};
use if_mesh::measure::displacement;
use if_mesh::sdf::MeshSdf;
use if_pipeline::capture::synth::{BODY, SynthParams, synth};
use if_pipeline::capture::{Capture, PoseSigma};
use if_pipeline::reconstruct::{
    ClothedPerson, FieldsParams, FloodedField, GarmentParams, MotionParams, PhiParams, PoseParams,
    SurfaceParams, carried_weights, find_garments, fit_fields, fit_motion, fit_surface,
    largest_piece, refine_poses,
};
use std::hint::black_box;

const COARSE: MannequinParams = MannequinParams { resolution: 0.7, overlap: 0.0 };

fn shape(mesh: &TriMesh) -> BodyShape<'_> {
    BodyShape { mesh, skin: None, template: None, skeleton: None }
}

fn alignment(c: &mut Criterion) {
    let slim = body(&COARSE);
    let wider = |p: &Point| Point::new(p.x * 1.06, p.y * 1.03, p.z * 1.08);
    let scaled = |mesh: &TriMesh| {
        mesh.with_vertices(mesh.vertices().iter().map(wider).collect()).expect("finite")
    };
    let (large, shirt) = (scaled(&slim), garment(Garment::Tshirt, &COARSE));
    // Without its last triangle a body shares no topology, and is registered.
    let mut fewer = large.triangles().to_vec();
    fewer.pop();
    let holed = TriMesh::new(large.vertices().iter().rev().copied().collect(), {
        let last = large.vertices().len() as u32 - 1;
        fewer.iter().map(|t| t.map(|v| last - v)).collect()
    })
    .expect("the same body");
    let params = AlignParams::default();
    let mut group = c.benchmark_group("if-body/align");
    group.sample_size(10);
    for (name, to, method) in
        [("topology", &large, Method::Topology), ("registered", &holed, Method::Registered)]
    {
        let map = || BodyMap::new(&shape(black_box(&slim)), &shape(to), &params).expect("bodies");
        let found = map();
        assert_eq!(found.method(), method);
        let moved = found.align(&shirt, None).expect("a finite garment");
        let off = displacement(scaled(&shirt).vertices(), moved.vertices());
        // The ease is kept, not scaled; a registration slides along the surface.
        assert!(off.mean < 0.02, "{name}: {off:?}");
        group.bench_function(format!("map/{name}"), |b| b.iter(|| map().residual()));
        group.bench_function(format!("garment/{name}"), |b| {
            b.iter(|| found.align(black_box(&shirt), None).expect("a finite garment"))
        });
    }
    group.finish();
}

/// Cells of the canonical mesh, in metres.
const CELL: f64 = 0.012;

fn stages(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder for the capture");
    let path = folder.path().join("capture");
    let scene = SynthParams {
        garments: vec![Garment::Trousers, Garment::Tshirt],
        frames: 8,
        size: 96,
        mannequin: COARSE,
        ..SynthParams::default()
    };
    synth(&scene, &path, &mut Silent).expect("the mannequin is rendered");
    let capture = Capture::open(&path).expect("just written");
    let template = TemplateBody::read(&path.join(BODY)).expect("just written");
    let (read, skeleton) = (SurfaceParams::default(), &template.skeleton);
    let mut group = c.benchmark_group("if-pipeline/reconstruct");
    group.sample_size(10);

    let noise = PoseParams::of(PoseSigma { degrees: 1.0, translation: 0.003 });
    let poses =
        || refine_poses(&capture, &template, &read, &noise, &mut Silent).expect("a sound capture");
    assert_eq!(poses().poses.len(), 8);
    group.bench_function("poses", |b| b.iter(poses));

    let surface = || {
        fit_surface(black_box(&capture), &template, &read, None, &mut Silent).expect("a capture")
    };
    let fitted = surface();
    assert!(!fitted.mesh.triangles().is_empty());
    group.bench_function("surface", |b| b.iter(surface));

    let canonical = || {
        let cells = ExtractParams {
            region: Some(fitted.mesh.aabb().inflated(CELL)),
            resolution: Resolution::Cell(CELL),
            newton: 0,
            ..ExtractParams::default()
        };
        let field = FloodedField::new(&fitted.mesh).expect("a closed surface");
        largest_piece(&extract(&field, &cells, &mut Silent).expect("it has a surface").mesh)
    };
    let mesh = canonical();
    assert!(mesh.triangles().len() > 5000, "{} triangles", mesh.triangles().len());
    group.bench_function("canonical", |b| b.iter(canonical));

    let usual = MotionParams::default();
    let motion =
        || fit_motion(&capture, skeleton, &fitted, &read, &usual, &mut Silent).expect("frames");
    assert_eq!(motion().offsets.len(), 8);
    group.bench_function("motion", |b| b.iter(motion));

    let skin = carried_weights(&fitted.mesh, &fitted.skin, skeleton.len(), mesh.vertices());
    let field = MeshSdf::closed(&mesh).expect("closed");
    let person = ClothedPerson {
        skeleton,
        mesh: &mesh,
        skin: &skin,
        field: &field,
        motion: None,
        underside: None,
        skipped: &[],
    };
    let garments = || {
        find_garments(&capture, &person, &GarmentParams::default(), &mut Silent)
            .expect("labels of two garments")
    };
    let names: Vec<String> = garments().garments.into_iter().map(|g| g.name).collect();
    assert_eq!(names.len(), 2, "{names:?}");
    group.bench_function("garments", |b| b.iter(garments));

    // φ and d start at the solved surface and motion; the difference of the two is 20 steps.
    let solved = motion();
    let fields = |steps: u64| {
        let phi = PhiParams { steps: 20, ..FieldsParams::default().phi };
        let params = FieldsParams { phi, motion_steps: 20, steps, ..FieldsParams::default() };
        let begin = (&mesh, &skin, &field);
        let all = (&capture, skeleton, &fitted, Some(&solved));
        let (capture, skeleton, fitted, solved) = black_box(all);
        fit_fields(capture, skeleton, fitted, begin, solved, &read, &params, None, &mut Silent)
            .expect("a sound capture")
    };
    for (name, steps) in [("fields/start", 0), ("fields/20 steps", 20)] {
        let report = fields(steps).report;
        assert!(report.start_mm < 2.0 && report.rounds.is_empty() == (steps == 0), "{report:?}");
        group.bench_function(name, |b| b.iter(|| fields(steps).report.start_mm));
    }
    group.finish();
}

criterion_group!(benches, alignment, stages);
criterion_main!(benches);
