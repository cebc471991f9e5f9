//! From a capture of a turning person to single garments. The capture is rendered here, with noise
//! in masks and labels, into a folder that is removed at the end.
//!
//! ```text
//! cargo run --release --example capture_to_garments
//! ```

#![allow(clippy::print_stdout)] // a program for the terminal

use if_garments::Silent;
use if_garments::body::TemplateBody;
use if_garments::body::mannequin::Garment;
use if_garments::pipeline::capture::synth::{SynthParams, synth};
use if_garments::pipeline::{Capture, ReconstructParams, reconstruct};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let turn = folder.path().join("turn");
    let garments = vec![Garment::Trousers, Garment::Tshirt];
    let scene = SynthParams { garments, frames: 12, size: 192, ..Default::default() };
    synth(&scene, &turn, &mut Silent)?;

    let capture = Capture::open(&turn)?;
    let template = TemplateBody::read(&turn.join("body"))?;
    let params = ReconstructParams::default();
    let found = reconstruct(&capture, &template, &params, None, &mut Silent)?;

    for garment in &found.garments {
        let openings = garment.cleanup.holes.openings.len();
        println!(
            "{}: {} triangles, {openings} openings",
            garment.name,
            garment.mesh.triangles().len()
        );
    }
    let names: Vec<&str> = found.garments.iter().map(|g| g.name.as_str()).collect();
    assert_eq!(names, ["trousers", "tshirt"]);
    Ok(())
}
