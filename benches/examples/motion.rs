//! The motion of single frames by several parameters, for judging by `benches/motion.py`.
//!
//! ```sh
//! cargo run --release -p if-benches --example motion -- CAPTURE BODY OUT [PARAMS.json]
//! ```
//!
//! PARAMS.json is a list of parameters, such as `[{}, {"stay": 0.01}]`; those that are not named
//! have their defaults. Writes the fitted surface to `OUT/canonical.ply`, and in each frame to
//! `OUT/none`, without motion, and to `OUT/0`, `OUT/1` and so on, and prints what each took.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_body::TemplateBody;
use if_core::monitor::Silent;
use if_mesh::ply::{self, PlyMesh, WriteParams};
use if_pipeline::capture::Capture;
use if_pipeline::reconstruct::{
    MeshMotion, MotionParams, SurfaceParams, fit_motion, fit_surface, write_frames,
};
use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [capture, body, out, params @ ..] = &args[..] else {
        return Err("give CAPTURE BODY OUT [PARAMS.json]".into());
    };
    let several: Vec<MotionParams> = match params.first() {
        Some(path) => serde_json::from_slice(&std::fs::read(path)?)?,
        None => vec![MotionParams::default()],
    };
    let (capture, template) = (Capture::open(capture)?, TemplateBody::read(body)?);
    let (read, skeleton) = (SurfaceParams::default(), &template.skeleton);
    let mut start = Instant::now();
    let surface = fit_surface(&capture, &template, &read, None, &mut Silent)?;
    println!(
        "surface: {:.2} s, {} vertices",
        start.elapsed().as_secs_f64(),
        surface.mesh.vertices().len()
    );
    std::fs::create_dir_all(out)?;
    let file = PlyMesh::new(surface.mesh.clone());
    ply::write_path(
        &file,
        surface.mesh.vertices(),
        &WriteParams::default(),
        &out.join("canonical.ply"),
    )?;
    write_frames(&out.join("none"), &surface.mesh, &surface.skin, skeleton, &capture, None)?;
    for (k, params) in several.iter().enumerate() {
        start = Instant::now();
        let motion = fit_motion(&capture, skeleton, &surface, &read, params, &mut Silent)?;
        let seconds = start.elapsed().as_secs_f64();
        let (r, mesh) = (&motion.report, &surface.mesh);
        println!(
            "{k}: {seconds:.2} s for {} frames, {:.2} mm on average, {:.1} at most; {:?}; {params:?}",
            r.solved, r.mean_mm, r.max_mm, r.rounds
        );
        let motion = MeshMotion::new(motion, mesh, mesh.vertices());
        write_frames(
            &out.join(k.to_string()),
            mesh,
            &surface.skin,
            skeleton,
            &capture,
            Some(&motion),
        )?;
    }
    Ok(())
}
