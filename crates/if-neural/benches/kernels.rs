//! Time of the kernels on 1,024 points: value, value and gradient, and the training step.
//!
//! `cargo bench -p if-neural --bench kernels`. Rates against the machine's peak and against PyTorch:
//! `benches/peers/neural.sh`.

#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use if_neural::deformation::{DeformationNetwork, OffsetLoss, OffsetSample};
use if_neural::frozen::FrozenMlp;
use if_neural::mlp::{DeformationConfig, SdfConfig};
use if_neural::reference::ReferenceSdf;
use if_neural::sdf::SdfNetwork;
use if_neural::trainable::{PointLoss, Sample32, TrainableField};
use rand::{RngExt, SeedableRng};

const POINTS: usize = 1024;

fn points() -> Vec<[f32; 3]> {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    (0..POINTS).map(|_| std::array::from_fn(|_| 2.0 * rng.random::<f32>() - 1.0)).collect()
}

/// A fast wrong answer fails: 20 samples against the f64 twin, by `docs/neural.md`'s bounds.
fn check(network: &SdfNetwork, points: &[[f32; 3]], samples: &[Sample32]) {
    let theta = network.parameters().iter().map(|&v| f64::from(v)).collect();
    let twin = ReferenceSdf::new(network.config(), theta).expect("the same shape");
    for (x, sample) in points.iter().zip(samples).take(20) {
        let (value, gradient) = twin.sample(x.map(f64::from));
        assert!((f64::from(sample.value) - value).abs() < 2e-6);
        for axis in 0..3 {
            assert!((f64::from(sample.gradient[axis]) - gradient[axis]).abs() < 1e-5);
        }
    }
}

fn loss(_: usize, sample: Sample32) -> PointLoss {
    let g = sample.gradient;
    let length = g.iter().map(|g| g * g).sum::<f32>().sqrt().max(1e-6);
    PointLoss {
        loss: f64::from(sample.value * sample.value + (length - 1.0) * (length - 1.0)),
        d_value: 2.0 * sample.value,
        d_gradient: g.map(|g| 2.0 * (length - 1.0) * g / length),
    }
}

fn sdf(criterion: &mut Criterion) {
    let points = points();
    for (name, config) in [("256", SdfConfig::fast()), ("512", SdfConfig::paper())] {
        let network = SdfNetwork::new(&config, 1).expect("a preset");
        let frozen = FrozenMlp::new(&config, network.parameters()).expect("a preset");
        let mut group = criterion.benchmark_group("if-neural");
        group.throughput(Throughput::Elements(POINTS as u64)).sample_size(20);
        let mut values = vec![0.0; POINTS];
        group.bench_function(format!("value/{name}"), |bencher| {
            bencher.iter(|| frozen.values(black_box(&points), &mut values));
        });
        let mut samples = vec![Sample32::default(); POINTS];
        group.bench_function(format!("value_gradient/{name}"), |bencher| {
            bencher.iter(|| frozen.samples(black_box(&points), &mut samples));
        });
        // A filter on the command line may have left the bench above out.
        frozen.samples(&points, &mut samples);
        check(&network, &points, &samples);
        let mut gradient = vec![0.0; network.parameters().len()];
        group.bench_function(format!("step/{name}"), |bencher| {
            bencher.iter(|| network.loss_gradient(black_box(&points), &loss, &mut gradient));
        });
    }
}

fn deformation(criterion: &mut Criterion) {
    let points = points();
    let frames: Vec<u32> = (0..POINTS as u32).map(|n| n % 60).collect();
    let network = DeformationNetwork::new(&DeformationConfig::paper(60), 1).expect("a preset");
    let mut group = criterion.benchmark_group("if-neural");
    group.throughput(Throughput::Elements(POINTS as u64)).sample_size(20);
    let mut offsets = vec![[0.0; 3]; POINTS];
    group.bench_function("offset/512", |bencher| {
        bencher.iter(|| network.offsets(black_box(&points), &frames, &mut offsets));
    });
    let mut gradient = vec![0.0; network.parameters().len()];
    let loss = |_: usize, sample: OffsetSample| OffsetLoss {
        loss: sample.offset.iter().map(|d| f64::from(d * d)).sum::<f64>(),
        d_offset: sample.offset.map(|d| 2.0 * d),
        d_jacobian: sample.jacobian,
    };
    group.bench_function("offset_step/512", |bencher| {
        bencher.iter(|| network.loss_gradient(black_box(&points), &frames, &loss, &mut gradient));
    });
}

criterion_group!(benches, sdf, deformation);
criterion_main!(benches);
