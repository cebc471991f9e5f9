//! φ and d trained by burn, generic over its backends.
//!
//! ```text
//! cargo run --release -p if-neural --features burn --example train_with_burn
//! ```
//!
//! For a GPU, add burn 0.20 with its feature `wgpu` or `cuda`, and name `Autodiff<Wgpu>` or
//! `Autodiff<Cuda>` in `main`.

#![allow(clippy::print_stdout)] // a program for the terminal

use burn::tensor::backend::AutodiffBackend;
use if_core::shapes::Sphere;
use if_core::{Point, Silent, Vector};
use if_neural::burn::{DeformationModule, SdfModule, fit, fit_deformation};
use if_neural::schedule::Schedule;
use if_neural::sdf::SdfNetwork;
use if_neural::{DeformParams, DeformationConfig, DeformationNetwork, FitParams, NetworkConfig};
use if_neural::{SamplingParams, SdfConfig, TrainingSet};

/// Trains both networks on `device`, and returns their mean errors, in metres.
pub(crate) fn train<B: AutodiffBackend>(
    device: &B::Device,
) -> Result<[f64; 2], Box<dyn std::error::Error>> {
    // φ of a ball: training points, a network, and 60 steps.
    let ball = Sphere { center: Point::new(0.0, 1.0, 0.0), radius: 0.3 };
    let sampling = SamplingParams { near: 5000, far: 500, held_out: 500, ..Default::default() };
    let set = TrainingSet::of_field(&ball, &sampling)?;
    let config = SdfConfig { width: 64, layers: 3, skip: None, features: 0, ..SdfConfig::fast() };
    let recipe = NetworkConfig::Sdf(config.clone()).fit_params();
    let params = FitParams { batch: 256, steps: Some(60), seconds: None, ..recipe };
    let module = SdfModule::<B>::from_network(&SdfNetwork::new(&config, 1)?, device);
    let (module, field) = fit(module, &set, &params, &mut Silent)?;
    module.to_network()?; // a network for files::write_network, NeuralField, …

    // d of three frames in which the ball's points sway.
    let points = set.held_out.beside().0;
    let sway = |x: f64| points.iter().map(|p| p + Vector::x() * (x * p.y)).collect();
    let frames: Vec<Vec<Point>> = [-0.05, 0.0, 0.05].map(sway).into();
    let config = DeformationConfig { width: 32, layers: 2, ..DeformationConfig::fast(3) };
    let module =
        DeformationModule::<B>::from_network(&DeformationNetwork::new(&config, 1)?, device);
    let schedule = Schedule { rate: 5e-3, ..DeformParams::default().schedule };
    let params = DeformParams { batch: 256, steps: 150, schedule, ..Default::default() };
    let (_, motion) = fit_deformation(module, &set.frame, points, &frames, &params, &mut Silent)?;
    Ok([field.error.mean, motion.error.mean])
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    type Backend = burn_autodiff::Autodiff<burn_ndarray::NdArray>;
    let [field, motion] = train::<Backend>(&Default::default())?;
    println!("mean errors: φ {:.2} mm, d {:.2} mm", 1e3 * field, 1e3 * motion);
    Ok(())
}
