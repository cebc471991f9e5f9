//! Points per second of value, and of value and gradient, and their error against f64.
//!
//! `cargo run --release -p if-neural --example evaluate [fast|paper] [points] [seconds]`

use std::time::Duration;

use if_neural::frozen::FrozenMlp;
use if_neural::kernel::isa::Isa;
use if_neural::mlp::SdfConfig;
use if_neural::reference::ReferenceSdf;
use if_neural::sdf::SdfNetwork;
use if_neural::trainable::{Sample32, TrainableField};
use rand::{RngExt, SeedableRng};
use timing::{Timing, measure};

mod timing;

#[allow(clippy::print_stdout)]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let preset = args.next().unwrap_or_else(|| "fast".into());
    let config = if preset == "paper" { SdfConfig::paper() } else { SdfConfig::fast() };
    let count: usize = args.next().map_or(Ok(4096), |text| text.parse())?;
    let seconds: f64 = args.next().map_or(Ok(2.0), |text| text.parse())?;
    let time = Duration::from_secs_f64(seconds);
    let network = SdfNetwork::new(&config, 1)?;
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    let points: Vec<[f32; 3]> = (0..count).map(|_| std::array::from_fn(|_| 2.0 * rng.random::<f32>() - 1.0)).collect();

    let layout = config.layout()?;
    let multiplications: usize = (layout.layers.iter().enumerate())
        .map(|(l, at)| if l == config.layers { at.columns } else { at.rows * at.columns })
        .sum();
    let threads = rayon::current_num_threads();
    println!("{preset}, {count} points, {threads} threads");
    let theta = network.parameters();
    let reference = ReferenceSdf::new(&config, theta.iter().map(|&v| f64::from(v)).collect())?;
    let checked = count.min(2000);
    let exact: Vec<_> = points[..checked].iter().map(|p| reference.sample(p.map(f64::from))).collect();
    for isa in Isa::all() {
        let frozen = FrozenMlp::with_isa(&config, theta, isa)?;
        let mut values = vec![0.0; count];
        let mut samples = vec![Sample32::default(); count];
        let value = measure(time, || frozen.values(&points, &mut values));
        let both = measure(time, || frozen.samples(&points, &mut samples));
        let (mut by_value, mut by_gradient) = (0.0_f64, 0.0_f64);
        for (sample, (value, gradient)) in samples.iter().zip(&exact) {
            by_value = by_value.max((f64::from(sample.value) - value).abs());
            let squares = (0..3).map(|k| (f64::from(sample.gradient[k]) - gradient[k]).powi(2));
            by_gradient = by_gradient.max(squares.sum::<f64>().sqrt());
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
            "{:9} value {}; value + gradient {}; largest error of {checked}: {by_value:.1e}, {by_gradient:.1e}",
            isa.name(),
            rate(value, 1.0),
            rate(both, 2.0),
        );
    }
    Ok(())
}
