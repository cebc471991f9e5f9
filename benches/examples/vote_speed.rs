//! Seconds for rasterising and voting of 120 frames of 512² of a mesh of 400,000 triangles that
//! turns.
//!
//! ```text
//! cargo run --release -p if-benches --example vote_speed [FRAMES [votes]]
//! ```
//!
//! The label images are made from what a rasterising of its own sees, which is timed too; with
//! `votes` the first frame's serves for all, so that the time of the whole program is that of
//! rasterising and voting.

#![allow(clippy::print_stdout)] // that is what it is for

use if_core::math::{Point, Real, Vector};
use if_core::shapes::meshes::tube;
use if_mesh::camera::Camera;
use if_mesh::labels::{VoteParams, Voter};
use if_mesh::raster::{IdBuffer, NOTHING, RasterParams, Rasteriser};
use std::error::Error;
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let frames: usize = std::env::args().nth(1).map_or(Ok(120), |n| n.parse())?;
    let alone = std::env::args().nth(2).is_some_and(|w| w == "votes");
    // As high and as wide as a person, as many pixels as one.
    let mesh = tube(0.2, 1.7, 640, 312, true);
    let camera = Camera::looking_at(
        (512, 512),
        &Point::new(0.0, 0.9, 3.3),
        &Point::new(0.0, 0.85, 0.0),
        &Vector::y(),
        0.56,
    )?;
    // No frame is left out: this measures work.
    let mut voter =
        Voter::new(&mesh, 5, &VoteParams { enough: Real::INFINITY, ..Default::default() })?;
    let mut rasteriser = Rasteriser::default();
    let (mut raster, mut both) = (Duration::ZERO, Duration::ZERO);
    let mut out = IdBuffer::default();
    for frame in 0..frames {
        let (s, c) = (std::f64::consts::TAU * frame as Real / frames as Real).sin_cos();
        let turned: Vec<Point> = mesh
            .vertices()
            .iter()
            .map(|p| Point::new(c * p.x + s * p.z, p.y + 0.02 * s, c * p.z - s * p.x))
            .collect();
        if frame == 0 || !alone {
            let start = Instant::now();
            rasteriser.rasterise(&mesh, &turned, &camera, &RasterParams::default(), &mut out);
            raster += start.elapsed();
        }
        let labels: Vec<u8> = out
            .triangle
            .iter()
            .map(|t| if *t == NOTHING { 0 } else { 1 + (t / 100_000 % 4) as u8 })
            .collect();
        let start = Instant::now();
        voter.add(&turned, &camera, &labels)?;
        both += start.elapsed();
    }
    let (votes, report) = voter.finish();
    let wrong = (0..mesh.vertices().len()).filter(|v| votes.winner(*v) != 0).count();
    assert!(
        report.cast == frames && wrong * 2 > mesh.vertices().len(),
        "{report:?}, {wrong} vertices have a label"
    );
    println!(
        "{} triangles, {frames} frames: rasterising {:.2} s, rasterising and voting {:.2} s on {} threads; {} pixels a frame",
        mesh.triangles().len(),
        raster.as_secs_f64(),
        both.as_secs_f64(),
        rayon::current_num_threads(),
        report.pixels / frames.max(1)
    );
    Ok(())
}
