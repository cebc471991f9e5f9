//! Time of the kernels on 1,024 points: value, value and gradient, and the training step; each is
//! held against its twin in f64, and the default grid against the ball that it begins with.
//!
//! `cargo bench -p if-benches --bench kernels`. Rates against the machine's peak and against
//! PyTorch: `benches/peers/neural.sh`.

#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use if_core::field::SignedDistance;
use if_core::math::Point;
use if_core::shapes::Sphere;
use if_neural::deformation::{DeformationNetwork, OffsetLoss, OffsetSample};
use if_neural::field::Samples32;
use if_neural::frozen::FrozenMlp;
use if_neural::mlp::{DeformationConfig, SdfConfig};
use if_neural::reference::{
    OffsetLoss64, PointLoss64, ReferenceDeformation, ReferenceSdf, band_weights,
};
use if_neural::sdf::SdfNetwork;
use if_neural::trainable::{PointLoss, Sample32, TrainableField};
use if_neural::{NetworkConfig, SamplingParams, Target};
use rand::{RngExt, SeedableRng};

const POINTS: usize = 1024;
/// Every so many points one is held against the twin in f64, which takes milliseconds for each.
const CHECK_EVERY: usize = 50;

fn points() -> Vec<[f32; 3]> {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    (0..POINTS).map(|_| std::array::from_fn(|_| 2.0 * rng.random::<f32>() - 1.0)).collect()
}

fn wide<const N: usize>(x: [f32; N]) -> [f64; N] {
    x.map(f64::from)
}

fn parameters64(theta: &[f32]) -> Vec<f64> {
    theta.iter().map(|&v| f64::from(v)).collect()
}

/// A fast wrong answer fails: some values and samples against the f64 twin, by
/// `docs/evidence/neural.md`'s bounds.
fn check(twin: &ReferenceSdf, points: &[[f32; 3]], values: &[f32], samples: &[Sample32]) {
    for k in (0..POINTS).step_by(CHECK_EVERY) {
        let (value, gradient) = twin.sample(wide(points[k]));
        assert!((f64::from(values[k]) - value).abs() < 2e-6, "value {k}");
        assert!((f64::from(samples[k].value) - value).abs() < 2e-6, "value {k}");
        for axis in 0..3 {
            assert!(
                (f64::from(samples[k].gradient[axis]) - gradient[axis]).abs() < 1e-5,
                "gradient {k}"
            );
        }
    }
}

/// Derivatives by the parameters against those of f64, by `docs/evidence/neural.md`'s bounds:
/// `share` of the largest.
fn check_gradient(gradient: &[f32], exact: &[f64], share: f64) {
    let largest = exact.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
    assert!(largest > 0.0);
    for (k, (a, b)) in gradient.iter().zip(exact).enumerate() {
        assert!(
            (f64::from(*a) - b).abs() <= share * largest,
            "parameter {k}: {a} is {b} in f64, the largest {largest}"
        );
    }
}

/// The loss at some of the points only: so a step on all of them has the derivatives of a twin's
/// step on these.
fn some<L: Default>(index: usize, loss: L) -> L {
    if index.is_multiple_of(CHECK_EVERY) { loss } else { L::default() }
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
        frozen.values(&points, &mut values);
        frozen.samples(&points, &mut samples);
        let twin =
            ReferenceSdf::new(&config, parameters64(network.parameters())).expect("the same shape");
        check(&twin, &points, &values, &samples);
        let mut gradient = vec![0.0; network.parameters().len()];
        group.bench_function(format!("step/{name}"), |bencher| {
            bencher.iter(|| network.loss_gradient(black_box(&points), &loss, &mut gradient));
        });
        network.loss_gradient(&points, &|n, sample| some(n, loss(n, sample)), &mut gradient);
        let checked: Vec<[f64; 3]> = points.iter().step_by(CHECK_EVERY).map(|x| wide(*x)).collect();
        let (_, exact) = twin.loss_gradient(&checked, |n, value, gradient| {
            let at =
                loss(n, Sample32 { value: value as f32, gradient: gradient.map(|g| g as f32) });
            PointLoss64 {
                loss: at.loss,
                d_value: at.d_value.into(),
                d_gradient: wide(at.d_gradient),
            }
        });
        check_gradient(&gradient, &exact, 2e-5);
    }
}

fn grid(criterion: &mut Criterion) {
    let ball = Sphere { center: Point::origin(), radius: 0.3 };
    let (set, network) = Target::Field(&ball)
        .begin(&NetworkConfig::grid(), &SamplingParams::default())
        .expect("a ball");
    let points = points();
    let mut group = criterion.benchmark_group("if-neural");
    group.throughput(Throughput::Elements(POINTS as u64)).sample_size(20);
    let mut values = vec![0.0; POINTS];
    group.bench_function("value/grid", |bencher| {
        bencher.iter(|| network.values32(black_box(&points), &mut values));
    });
    let mut samples = vec![Sample32::default(); POINTS];
    group.bench_function("value_gradient/grid", |bencher| {
        bencher.iter(|| TrainableField::samples32(&network, black_box(&points), &mut samples));
    });
    network.values32(&points, &mut values);
    TrainableField::samples32(&network, &points, &mut samples);
    let mut near = 0;
    for (k, x) in points.iter().enumerate() {
        assert_eq!(values[k], samples[k].value);
        let exact = ball.sample(&set.frame.to_metres(x));
        // Far from the surface the grid is coarse.
        if exact.distance.abs() > 0.02 {
            continue;
        }
        near += 1;
        let off = f64::from(values[k]) / set.frame.scale - exact.distance;
        assert!(off.abs() < 1e-3, "{off} m at {x:?}");
        let g = wide(samples[k].gradient);
        let along = (0..3).map(|axis| g[axis] * exact.gradient[axis]).sum::<f64>();
        assert!(along > 0.95, "{along} at {x:?}");
    }
    assert!(near > 20, "{near} points near the surface");
    let mut gradient = vec![0.0; network.parameters().len()];
    group.bench_function("step/grid", |bencher| {
        bencher.iter(|| network.loss_gradient(black_box(&points), &loss, &mut gradient));
    });
    let total = network.loss_gradient(&points, &loss, &mut gradient);
    let exact: f64 = samples.iter().map(|s| loss(0, *s).loss).sum();
    assert!((total - exact).abs() < 1e-4 * exact && gradient.iter().any(|g| *g != 0.0));
}

fn offset_loss(_: usize, sample: OffsetSample) -> OffsetLoss {
    OffsetLoss {
        loss: sample.offset.iter().map(|d| f64::from(d * d)).sum::<f64>(),
        d_offset: sample.offset.map(|d| 2.0 * d),
        d_jacobian: sample.jacobian,
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
    network.offsets(&points, &frames, &mut offsets);
    let bands = band_weights(network.config().bands, network.alpha());
    let twin =
        ReferenceDeformation::new(network.config(), parameters64(network.parameters()), bands)
            .expect("the same shape");
    for k in (0..POINTS).step_by(CHECK_EVERY) {
        let (offset, _) = twin.sample(wide(points[k]), frames[k] as usize);
        assert!(
            (0..3).all(|axis| (f64::from(offsets[k][axis]) - offset[axis]).abs() < 2e-6),
            "offset {k}"
        );
    }
    let mut gradient = vec![0.0; network.parameters().len()];
    group.bench_function("offset_step/512", |bencher| {
        bencher.iter(|| {
            network.loss_gradient(black_box(&points), &frames, &offset_loss, &mut gradient)
        });
    });
    network.loss_gradient(
        &points,
        &frames,
        &|n, sample| some(n, offset_loss(n, sample)),
        &mut gradient,
    );
    let checked: Vec<[f64; 3]> = points.iter().step_by(CHECK_EVERY).map(|x| wide(*x)).collect();
    let in_frames: Vec<u32> = frames.iter().step_by(CHECK_EVERY).copied().collect();
    let (_, exact) = twin.loss_gradient(&checked, &in_frames, |n, offset, jacobian| {
        let jacobian = jacobian.map(|row| row.map(|v| v as f32));
        let at = offset_loss(n, OffsetSample { offset: offset.map(|d| d as f32), jacobian });
        OffsetLoss64 {
            loss: at.loss,
            d_offset: wide(at.d_offset),
            d_jacobian: at.d_jacobian.map(wide),
        }
    });
    check_gradient(&gradient, &exact, 1e-5);
}

criterion_group!(benches, sdf, grid, deformation);
criterion_main!(benches);
