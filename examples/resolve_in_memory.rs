//! Meshes in, resolved meshes out, with progress and a proof: `resolve` and its report.
//!
//! ```text
//! cargo run --release --example resolve_in_memory
//! ```

#![allow(clippy::print_stdout)] // a program for the terminal

use if_garments::body::mannequin::{MannequinParams, body, layered};
use if_garments::{GoalParams, Layer, Outfit, Progress, ResolveParams, resolve, verify};
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The built-in scene: T-shirt, skirt, jacket and coat that intersect one another.
    let scene = MannequinParams { resolution: 0.7, ..Default::default() };
    let garments = layered(&scene).into_iter().skip(1).map(|(name, mesh)| Layer::new(name, mesh));
    let outfit = Outfit::new(Layer::new("body", body(&scene)), garments.collect())?;

    // `Break` would cancel; a window would draw a bar here.
    let mut rounds = 0;
    let mut monitor = |_: &Progress<'_>| {
        rounds += 1;
        ControlFlow::Continue(())
    };
    let params = ResolveParams {
        goal: GoalParams { clearance: 0.0005, ..Default::default() },
        ..Default::default()
    };
    let resolved = resolve(&outfit, &params, &mut monitor)?;

    let report = &resolved.report;
    println!("{} pairs -> {}", report.before.total_pairs(), report.after.total_pairs());
    for layer in &report.layers {
        println!("{}: moved by at most {:.1} mm", layer.name, 1e3 * layer.moved.max);
    }
    assert!(rounds > 0 && report.is_proven() && verify(&resolved.outfit)?.is_clean());
    Ok(())
}
