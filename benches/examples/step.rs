//! Points per second of a training step with value, eikonal and normal terms.
//!
//! `cargo run --release -p if-benches --example step [fast|paper] [points] [seconds]`

use std::time::Duration;

use if_benches::timing::measure;
use if_neural::mlp::SdfConfig;
use if_neural::sdf::SdfNetwork;
use if_neural::trainable::{PointLoss, Sample32, TrainableField};
use rand::{RngExt, SeedableRng};

fn loss(_: usize, sample: Sample32) -> PointLoss {
    let g = sample.gradient;
    let length = g.iter().map(|g| g * g).sum::<f32>().sqrt().max(1e-6);
    let normal = [0.6, 0.0, 0.8];
    let mut at = PointLoss {
        loss: f64::from(sample.value * sample.value + (length - 1.0) * (length - 1.0)),
        d_value: 2.0 * sample.value,
        d_gradient: g.map(|g| 2.0 * (length - 1.0) * g / length),
    };
    for axis in 0..3 {
        let off = g[axis] - normal[axis];
        at.loss += f64::from(off * off);
        at.d_gradient[axis] += 2.0 * off;
    }
    at
}

#[allow(clippy::print_stdout)]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let preset = args.next().unwrap_or_else(|| "fast".into());
    let config = if preset == "paper" { SdfConfig::paper() } else { SdfConfig::fast() };
    let count: usize = args.next().map_or(Ok(4096), |text| text.parse())?;
    let seconds: f64 = args.next().map_or(Ok(2.0), |text| text.parse())?;
    let mut network = SdfNetwork::new(&config, 1)?;
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    let points: Vec<[f32; 3]> =
        (0..count).map(|_| std::array::from_fn(|_| 2.0 * rng.random::<f32>() - 1.0)).collect();
    let mut gradient = vec![0.0; network.parameters().len()];
    let layout = config.layout()?;
    let multiplications: usize = (layout.layers.iter().enumerate())
        .map(|(l, at)| if l == config.layers { at.columns } else { at.rows * at.columns })
        .sum();
    let timing = measure(Duration::from_secs_f64(seconds), || {
        network.refresh();
        network.loss_gradient(&points, &loss, &mut gradient);
    });
    println!(
        "{preset}, {count} points, {} threads: step {:.1}k points/s at best, {:.1}k per CPU s, {:.0} GFLOP per CPU s",
        rayon::current_num_threads(),
        count as f64 / timing.least / 1e3,
        count as f64 / timing.cpu / 1e3,
        12.0 * multiplications as f64 * count as f64 / timing.cpu / 1e9,
    );
    Ok(())
}
