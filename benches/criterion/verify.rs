//! Exact verification of two layers of 100 000 triangles each: both trees built, all pairs found.
//!
//! `cargo bench -p if-benches --bench verify`; with IFG_PEER_MESHES=DIR it writes the meshes there
//! instead, times itself as `peers/igl_predicates.py` does, and prints the medians.

#![allow(missing_docs, clippy::print_stdout)]

use criterion::{Criterion, criterion_group, criterion_main};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::tube;
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;
use if_mesh::ply::{PlyMesh, WriteParams, write_path};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

/// A tube of cloth, 0.8 m long, with folds. No pairs where two are 3 mm apart.
fn layer(radius: f64, phase: f64) -> TriMesh {
    let smooth = tube(radius, 0.8, 500, 100, false);
    let folds = |p: &Point| {
        let angle = p.z.atan2(p.x);
        let fold = 0.008 * (9.0 * angle + 14.0 * p.y).sin()
            + 0.001 * (61.0 * angle + 90.0 * p.y + phase).cos();
        let r = (radius + fold) / radius;
        // In single precision, as files hold it.
        Point::new(p.x * r, p.y + 0.002 * (31.0 * angle + phase).sin(), p.z * r)
            .map(|x| f64::from(x as f32))
    };
    smooth.with_vertices(smooth.vertices().iter().map(folds).collect()).expect("finite")
}

/// Name, layer below, layer above, fewest and most pairs: 3 mm apart, and pushed into each other.
fn scenes() -> [(&'static str, TriMesh, TriMesh, [usize; 2]); 2] {
    [
        ("100k", layer(0.2, 0.0), layer(0.203, 1.3), [0, 0]),
        ("100k_dirty", layer(0.2, 0.0), layer(0.2005, 1.3), [10_000, 200_000]),
    ]
}

fn verify(below: &TriMesh, above: &TriMesh) -> usize {
    let (below, above) = rayon::join(|| Bvh::new(below), || Bvh::new(above));
    pairs(&below, &above).len()
}

fn bench(c: &mut Criterion) {
    if let Some(folder) = std::env::var_os("IFG_PEER_MESHES") {
        return beside_peers(Path::new(&folder));
    }
    for (name, below, above, [fewest, most]) in scenes() {
        let found = verify(&below, &above);
        assert!((fewest..=most).contains(&found), "{name}: {found} pairs");
        c.bench_function(&format!("if-pipeline/verify/{name}"), |b| {
            b.iter(|| assert_eq!(verify(black_box(&below), black_box(&above)), found));
        });
        let (ta, tb) = (Bvh::new(&below), Bvh::new(&above));
        c.bench_function(&format!("if-pipeline/verify_built/{name}"), |b| {
            b.iter(|| assert_eq!(pairs(black_box(&ta), black_box(&tb)).len(), found));
        });
    }
}

/// Writes the meshes, and one line a scene: name, pairs, median seconds of 11 runs.
fn beside_peers(folder: &Path) {
    for (name, below, above, _) in scenes() {
        for (part, mesh) in [("below", &below), ("above", &above)] {
            let ply = PlyMesh::new(mesh.clone());
            let path = folder.join(format!("{name}_{part}.ply"));
            write_path(&ply, ply.mesh.vertices(), &WriteParams::default(), &path)
                .expect("a folder that takes files");
        }
        let found = verify(&below, &above);
        let mut seconds: Vec<f64> = (0..11)
            .map(|_| {
                let start = Instant::now();
                assert_eq!(verify(black_box(&below), black_box(&above)), found);
                start.elapsed().as_secs_f64()
            })
            .collect();
        seconds.sort_by(f64::total_cmp);
        println!("{name} {found} {:.6}", seconds[5]);
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
