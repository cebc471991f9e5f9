//! A neural signed distance field: fitted to a mesh, saved, and read again.
//!
//! ```text
//! cargo run --release --example fit_a_field
//! ```

#![allow(clippy::print_stdout)] // a program for the terminal

use if_garments::Silent;
use if_garments::core::shapes::meshes::torus;
use if_garments::core::{Point, SignedDistance};
use if_garments::mesh::MeshSdf;
use if_garments::neural::files::{WeightNorm, read_network, write_network};
use if_garments::neural::{Fit, FitParams, NetworkConfig, NeuralField, SamplingParams, Target};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let truth = MeshSdf::closed(&torus(0.3, 0.1, 96, 48))?;

    // Training points and a network with its first values, then 50 steps.
    let config = NetworkConfig::grid();
    let sampling =
        SamplingParams { near: 20_000, far: 5_000, held_out: 2_000, ..Default::default() };
    let target = Target::Field(&truth);
    let (set, mut network) = target.begin(&config, &sampling)?;
    let params = FitParams { steps: Some(50), loss: target.loss(), ..config.fit_params() };
    let report = Fit::new(params)?.run(&mut network, &set, &mut Silent)?;
    println!("{} steps, mean error {:.3} mm", report.steps, 1e3 * report.error.mean);
    assert!(report.error.mean < 1e-3);

    // safetensors, in PyTorch's layout.
    let mut file = Vec::new();
    write_network(&mut file, &network, &set.frame, WeightNorm::Kept)?;
    let (network, frame) = read_network(file.as_slice())?;
    let field = NeuralField::new(network, frame)?;
    let p = Point::new(0.41, 0.02, 0.0);
    assert!((field.distance(&p) - truth.distance(&p)).abs() < 5e-3);
    Ok(())
}
