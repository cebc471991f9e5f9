//! The built-in scene, resolved: `cargo bench -p if-benches --bench resolve`. The result is
//! checked.

#![allow(missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use if_body::mannequin::{MannequinParams, layered};
use if_core::monitor::Silent;
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{ResolveParams, resolve};
use if_outfit::verify::verify;
use std::hint::black_box;
use std::time::Duration;

fn scene(resolution: f64) -> Outfit {
    let params = MannequinParams { resolution, ..MannequinParams::default() };
    let mut layers = layered(&params).into_iter().map(|(name, mesh)| Layer::new(name, mesh));
    let body = layers.next().expect("the scene begins with the body");
    Outfit::new(body, layers.collect()).expect("the scene is an outfit")
}

fn bench(c: &mut Criterion) {
    let mut group = c.benchmark_group("if-pipeline/resolve");
    group.sample_size(10).measurement_time(Duration::from_secs(20));
    for (name, resolution) in [("coarse", 0.7), ("demo", 1.0)] {
        let outfit = scene(resolution);
        let run = || resolve(black_box(&outfit), &ResolveParams::default(), &mut Silent);
        let first = run().expect("the built-in scene comes out clean");
        assert!(verify(&first.outfit).expect("it is an outfit").is_clean());
        group.bench_function(name, |b| {
            b.iter(|| assert!(run().expect("clean").outfit == first.outfit))
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
