//! Points per second of value, and of value and gradient, and their error against f64.
//!
//! `cargo run --release -p if-benches --example evaluate [fast|paper] [points] [seconds] [steps]`:
//! with `steps`, the network is first trained on a torus for so many steps of 1,024 points, since
//! the rounding of a network with detail is larger than that of the initial sphere.

use std::time::Duration;

use if_benches::timing::{Timing, measure};
use if_neural::Isa;
use if_neural::frozen::FrozenMlp;
use if_neural::mlp::SdfConfig;
use if_neural::reference::ReferenceSdf;
use if_neural::sdf::SdfNetwork;
use if_neural::trainable::{PointLoss, Sample32, TrainableField};
use rand::{RngExt, SeedableRng};

/// Distance from a torus with ripples of 2 cm.
fn torus(x: [f32; 3]) -> f32 {
    let ring = (x[0] * x[0] + x[2] * x[2]).sqrt() - 0.55;
    (ring * ring + x[1] * x[1]).sqrt() - 0.22 - 0.02 * (20.0 * x[0]).sin() * (20.0 * x[1]).cos()
}

/// Adam on the squared error of the distance and the eikonal term, 1e-3 at the start, 5e-5 at the
/// end.
fn train(network: &mut SdfNetwork, steps: usize) {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(2);
    let count = network.parameters().len();
    let (mut gradient, mut m, mut v) =
        (vec![0.0; count], vec![0.0_f32; count], vec![0.0_f32; count]);
    for step in 1..=steps {
        let points: Vec<[f32; 3]> =
            (0..1024).map(|_| std::array::from_fn(|_| 2.0 * rng.random::<f32>() - 1.0)).collect();
        let total = network.loss_gradient(
            &points,
            &|n, sample| {
                let off = sample.value - torus(points[n]);
                let length = sample.gradient.iter().map(|g| g * g).sum::<f32>().sqrt().max(1e-6);
                let weight = 0.2 * (length - 1.0);
                PointLoss {
                    loss: f64::from(off * off + 0.5 * weight * (length - 1.0)),
                    d_value: 2.0 * off,
                    d_gradient: sample.gradient.map(|g| weight * g / length),
                }
            },
            &mut gradient,
        );
        assert!(total.is_finite(), "training diverged at step {step}");
        let rate = 1e-3 * 0.05_f32.powf(step as f32 / steps as f32);
        let (by_m, by_v) = (1.0 - 0.9_f32.powi(step as i32), 1.0 - 0.999_f32.powi(step as i32));
        for (k, theta) in network.parameters_mut().iter_mut().enumerate() {
            m[k] = 0.9 * m[k] + 0.1 * gradient[k];
            v[k] = 0.999 * v[k] + 0.001 * gradient[k] * gradient[k];
            *theta -= rate * (m[k] / by_m) / ((v[k] / by_v).sqrt() + 1e-8);
        }
        network.refresh();
    }
}

#[allow(clippy::print_stdout)]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let preset = args.next().unwrap_or_else(|| "fast".into());
    let config = if preset == "paper" { SdfConfig::paper() } else { SdfConfig::fast() };
    let count: usize = args.next().map_or(Ok(4096), |text| text.parse())?;
    let seconds: f64 = args.next().map_or(Ok(2.0), |text| text.parse())?;
    let time = Duration::from_secs_f64(seconds);
    let steps: usize = args.next().map_or(Ok(0), |text| text.parse())?;
    let mut network = SdfNetwork::new(&config, 1)?;
    train(&mut network, steps);
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    let points: Vec<[f32; 3]> =
        (0..count).map(|_| std::array::from_fn(|_| 2.0 * rng.random::<f32>() - 1.0)).collect();

    let layout = config.layout()?;
    let multiplications: usize = (layout.layers.iter().enumerate())
        .map(|(l, at)| if l == config.layers { at.columns } else { at.rows * at.columns })
        .sum();
    let threads = rayon::current_num_threads();
    println!("{preset} after {steps} steps, {count} points, {threads} threads");
    let theta = network.parameters();
    let reference = ReferenceSdf::new(&config, theta.iter().map(|&v| f64::from(v)).collect())?;
    let checked = count.min(2000);
    let exact: Vec<_> =
        points[..checked].iter().map(|p| reference.sample(p.map(f64::from))).collect();
    for isa in Isa::all() {
        let frozen = FrozenMlp::with_isa(&config, theta, isa)?;
        let mut values = vec![0.0; count];
        let mut samples = vec![Sample32::default(); count];
        let value = measure(time, || frozen.values(&points, &mut values));
        let both = measure(time, || frozen.samples(&points, &mut samples));
        let (mut by_value, mut by_gradient, mut mean) = (0.0_f64, 0.0_f64, 0.0);
        for (sample, (value, gradient)) in samples.iter().zip(&exact) {
            by_value = by_value.max((f64::from(sample.value) - value).abs());
            let squares = (0..3).map(|k| (f64::from(sample.gradient[k]) - gradient[k]).powi(2));
            let error = squares.sum::<f64>().sqrt();
            by_gradient = by_gradient.max(error);
            mean += error / checked as f64;
        }
        let rate = |timing: Timing, passes: f64| {
            let flops = 2.0 * passes * multiplications as f64 * count as f64 / timing.cpu / 1e9;
            format!(
                "{:.1}k points/s at best, {:.1}k per CPU s, {flops:.0} GFLOP per CPU s",
                count as f64 / timing.least / 1e3,
                count as f64 / timing.cpu / 1e3,
            )
        };
        println!(
            "{:9} value {}; value + gradient {}; largest error of {checked}: {by_value:.1e}, {by_gradient:.1e} (mean {mean:.0e})",
            isa.name(),
            rate(value, 1.0),
            rate(both, 2.0),
        );
    }
    Ok(())
}
