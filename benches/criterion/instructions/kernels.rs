//! What is counted: each kernel makes its input, and then works on it so many times.

use if_core::closest::ClosestPoint;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Silent;
use if_core::shapes::Torus;
use if_core::shapes::meshes::{cloth, torus};
use if_mesh::baked::{BakeParams, Baked};
use if_mesh::extract::{ExtractParams, extract};
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;
use if_neural::mlp::SdfConfig;
use if_neural::sdf::SdfNetwork;
use if_neural::trainable::{Sample32, TrainableField};
use if_xpbd::constraint::Constraint;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::stretch::Stretch;
use std::hint::black_box;

/// Its name, and what runs it so many times.
type Kernel = (&'static str, fn(u32));

pub(crate) const KERNELS: [Kernel; 6] = [
    ("mesh/closest/2000", closest),
    ("mesh/pairs/20k", intersecting),
    ("mesh/extract/torus", extracted),
    ("mesh/baked/20000", baked),
    ("xpbd/stretch/100x100", stretched),
    ("neural/samples/512", sampled),
];

const TORUS: Torus = Torus { center: Point::new(0.0, 0.0, 0.0), major: 0.3, minor: 0.1 };

/// Points round about the torus.
fn points(count: u32) -> Vec<Point> {
    let at = |k: u32, f: Real| (f * Real::from(k + 1)).sin();
    (0..count)
        .map(|k| Point::new(0.4 * at(k, 12.9898), 0.4 * at(k, 78.233), 0.12 * at(k, 37.719)))
        .collect()
}

fn closest(times: u32) {
    let tree = Bvh::new(&torus(0.3, 0.1, 200, 100));
    let points = points(2000);
    for _ in 0..times {
        let sum: Real =
            points.iter().filter_map(|p| tree.closest(p, Real::INFINITY)).map(|c| c.distance).sum();
        assert!(black_box(sum) > 0.0);
    }
}

fn intersecting(times: u32) {
    let mesh = torus(0.3, 0.1, 100, 100);
    let moved = mesh.vertices().iter().map(|p| p + Vector::new(0.013, 0.021, 0.017)).collect();
    let trees = [Bvh::new(&mesh), Bvh::new(&mesh.with_vertices(moved).unwrap())];
    for _ in 0..times {
        assert!(black_box(pairs(&trees[0], &trees[1])).len() > 100);
    }
}

fn extracted(times: u32) {
    for _ in 0..times {
        assert!(
            black_box(extract(&TORUS, &ExtractParams::default(), &mut Silent).unwrap())
                .mesh
                .triangles()
                .len()
                > 1000
        );
    }
}

fn baked(times: u32) {
    let baked =
        Baked::new(&TORUS, &BakeParams { cell: 0.02, ..Default::default() }, &mut Silent).unwrap();
    let points = points(20_000);
    let mut out = vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; points.len()];
    for _ in 0..times {
        baked.samples(&points, &mut out);
        assert!(black_box(&out).iter().any(|s| s.distance < 0.0));
    }
}

fn stretched(times: u32) {
    let mesh = cloth(1.0, 1.0, 100, 100);
    let mut group =
        Stretch::new(EdgeSet::of_mesh(&mesh), 1e-5).expect("a compliance of at least 0");
    let mut p: Vec<Point> = mesh.vertices().iter().map(|p| p * 1.01).collect();
    let weights = vec![1.0; p.len()];
    group.begin_substep(mesh.vertices(), mesh.vertices(), &weights, 1e-3);
    for _ in 0..times {
        assert!(black_box(group.project(&mut p, &weights, 1e-3)).max > 0.0);
    }
}

fn sampled(times: u32) {
    let network = SdfNetwork::new(&SdfConfig::fast(), 1).unwrap();
    let points: Vec<[f32; 3]> =
        points(512).iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect();
    let mut out = vec![Sample32::default(); points.len()];
    for _ in 0..times {
        network.samples32(&points, &mut out);
        assert!(black_box(&out).iter().any(|s| s.value < 0.0));
    }
}
