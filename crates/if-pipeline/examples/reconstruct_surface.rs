//! The surface of a capture, from masks and normals alone, and how far it is from the truth.
//!
//! ```sh
//! cargo run --release -p if-pipeline --example reconstruct_surface -- CAPTURE BODY OUT.ply [TRUTH.ply]
//! ```

use if_mesh::index::Bvh;
use if_mesh::{measure, ply};
use if_pipeline::capture::Capture;
use if_pipeline::reconstruct::{SurfaceParams, fit_surface};
use if_pipeline::template::TemplateBody;
use std::ops::ControlFlow;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [capture, body, out, truth @ ..] = &args[..] else { return Err("give CAPTURE BODY OUT.ply [TRUTH.ply]".into()) };
    let capture = Capture::open(capture)?;
    let template = TemplateBody::read(body)?;
    let params = SurfaceParams::default();
    let start = std::time::Instant::now();
    let surface = fit_surface(&capture, &template, &params, None, &mut |p| {
        println!(
            "{:5.1} s  {:?} {}/{} loss {:?} left {:?}",
            start.elapsed().as_secs_f64(),
            p.stage,
            p.step,
            p.steps,
            p.loss,
            p.seconds_left
        );
        ControlFlow::Continue(())
    })?;
    println!("{:#?}", surface.report);
    ply::write_path(&ply::PlyMesh::new(surface.mesh.clone()), surface.mesh.vertices(), &ply::WriteParams::default(), out)?;
    if let [truth] = truth {
        let truth = ply::read_path(truth)?.mesh;
        let tree = Bvh::new(&truth);
        for (name, mesh) in [("template", &template.mesh), ("ours", &surface.mesh)] {
            let d = measure::surface_distance((mesh, &Bvh::new(mesh)), (&truth, &tree), 50_000, 0);
            println!("{name}: {d:?}");
        }
    }
    Ok(())
}
