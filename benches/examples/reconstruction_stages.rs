//! From a capture to garments, one library call for each stage, beside two baselines: the template
//! body as it is, and the visual hull.
//!
//! ```sh
//! cargo run --release -p if-benches --example reconstruction_stages -- CAPTURE BODY OUT [TRUTH.ply]
//! ```
//!
//! writes `template.ply`, `hull.ply`, `surface.ply`, `canonical.ply` (with its labels), a mesh for
//! each garment, the canonical mesh in each frame, and `report.json`. With a truth it prints
//! two-sided distances; `benches/reconstruction.py` judges the files with other people's code.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_body::TemplateBody;
use if_body::skinning::{WeightGrid, WeightGridParams};
use if_core::mesh::TriMesh;
use if_core::monitor::{Progress, Silent};
use if_mesh::extract::{ExtractParams, Resolution, extract};
use if_mesh::index::Bvh;
use if_mesh::ply::{Column, PlyMesh, Property, WriteParams};
use if_mesh::sdf::MeshSdf;
use if_mesh::{measure, ply};
use if_pipeline::capture::Capture;
use if_pipeline::reconstruct::{
    ClothedPerson, FloodedField, GarmentParams, MeshMotion, MotionParams, MotionReport,
    SurfaceParams, Underside, VisualHull, carried_weights, find_garments, fit_motion, fit_surface,
    largest_piece, write_frames,
};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Cells of the extractions, in metres.
const CELL: f64 = 0.008;
/// Masks that may contradict the visual hull at a point.
const ALLOWED: usize = 1;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [capture, body, out, truth @ ..] = &args[..] else {
        return Err("give CAPTURE BODY OUT [TRUTH.ply]".into());
    };
    std::fs::create_dir_all(out)?;
    let truth = truth.first().map(|t| ply::read_path(t)).transpose()?.map(|t| t.mesh);
    let judge = |name: &str, mesh: &TriMesh, seconds: f64| {
        print!("{name:<10} {seconds:6.2} s {:7} triangles", mesh.triangles().len());
        if let Some(truth) = &truth {
            let d = measure::surface_distance(
                (mesh, &Bvh::new(mesh)),
                (truth, &Bvh::new(truth)),
                50_000,
                0,
            );
            print!(
                "   mean {:5.2} and {:5.2} mm, Chamfer {:5.2} mm",
                d.mean_first_to_second_mm, d.mean_second_to_first_mm, d.chamfer_mm
            );
        }
        println!();
    };
    let write = |name: &str, mesh: &TriMesh, properties: Vec<Property>| {
        let file = PlyMesh { vertex_properties: properties, ..PlyMesh::new(mesh.clone()) };
        ply::write_path(
            &file,
            mesh.vertices(),
            &WriteParams::default(),
            &out.join(format!("{name}.ply")),
        )
    };

    // What the stages need.
    let capture = Capture::open(capture)?;
    let template = TemplateBody::read(body)?;
    let joints = template.skeleton.len();

    // Baselines.
    judge("template", &template.mesh, 0.0);
    write("template", &template.mesh, Vec::new())?;
    let mut start = Instant::now();
    let grid = WeightGrid::new(
        template.mesh.vertices(),
        &template.skin,
        joints,
        &WeightGridParams::default(),
    )?;
    println!("grid of weights {:.2} s", start.elapsed().as_secs_f64());
    start = Instant::now();
    let hull = VisualHull::new(&capture, &template.skeleton, &grid, ALLOWED)?;
    let cells = ExtractParams {
        resolution: Resolution::Cell(CELL),
        newton: 0,
        check: 0,
        ..ExtractParams::default()
    };
    let carved = largest_piece(&extract(&hull, &cells, &mut Silent)?.mesh);
    judge("hull", &carved, start.elapsed().as_secs_f64());
    write("hull", &carved, Vec::new())?;

    // The surface, from masks and normals.
    start = Instant::now();
    let mut print_rounds = |p: &Progress| {
        if let Some(mm) = p.measure("silhouette_mm") {
            println!("  {} rounds: silhouettes {mm:.2} mm", p.done);
        }
        ControlFlow::Continue(())
    };
    let params = SurfaceParams::default();
    let surface = fit_surface(&capture, &template, &params, None, &mut print_rounds)?;
    println!("  start: {:?}", surface.report.start);
    judge("surface", &surface.mesh, start.elapsed().as_secs_f64());
    write("surface", &surface.mesh, surface.skin.to_properties())?;

    // One mesh for all frames.
    start = Instant::now();
    let region = Some(surface.mesh.aabb().inflated(CELL));
    let cells = ExtractParams {
        region,
        resolution: Resolution::Cell(CELL),
        newton: 0,
        ..ExtractParams::default()
    };
    let mesh =
        largest_piece(&extract(&FloodedField::new(&surface.mesh)?, &cells, &mut Silent)?.mesh);
    let skin = carried_weights(&surface.mesh, &surface.skin, joints, mesh.vertices());
    judge("canonical", &mesh, start.elapsed().as_secs_f64());

    // What single frames show otherwise, and the same mesh in each of them.
    start = Instant::now();
    let (read, usual) = (SurfaceParams::default(), MotionParams::default());
    let skeleton = &template.skeleton;
    let motion = fit_motion(&capture, skeleton, &surface, &read, &usual, &mut Silent)?;
    let MotionReport { solved, mean_mm, max_mm, .. } = motion.report;
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "motion     {seconds:6.2} s for {solved} frames: {mean_mm:.1} mm on average, {max_mm:.1} mm at most"
    );
    let motion = MeshMotion::new(motion, &surface.mesh, mesh.vertices());
    write_frames(&out.join("frames"), &mesh, &skin, &template.skeleton, &capture, Some(&motion))?;

    // Garments.
    start = Instant::now();
    let field = MeshSdf::closed(&mesh)?;
    let underside = Underside::of(&surface, &template, &capture, (&mesh, &skin))?;
    let person = ClothedPerson {
        skeleton,
        mesh: &mesh,
        skin: &skin,
        field: &field,
        motion: Some(&motion),
        underside: underside.as_ref(),
        skipped: &surface.report.skipped,
    };
    let found = find_garments(&capture, &person, &GarmentParams::default(), &mut Silent)?;
    println!("garments {:.2} s; {:?}", start.elapsed().as_secs_f64(), found.votes);
    let mut properties = skin.to_properties();
    properties.push(Property::new("label", Column::U8(found.labels.clone())));
    write("canonical", &mesh, properties)?;
    for garment in &found.garments {
        let holes = &garment.cleanup.holes;
        println!(
            "  {}: {} triangles, {} openings, {} holes filled, {} left, {} pieces dropped",
            garment.name,
            garment.mesh.triangles().len(),
            holes.openings.len(),
            holes.filled.len(),
            holes.left.len(),
            garment.cleanup.components.dropped.len()
        );
        write(&format!("garment_{}", garment.name), &garment.mesh, garment.skin.to_properties())?;
    }
    save(&out.join("report.json"), &serde_json::to_vec_pretty(&surface.report)?)
}

fn save(path: &Path, bytes: &[u8]) -> Result<(), Box<dyn Error>> {
    Ok(std::fs::write(path, bytes)?)
}
