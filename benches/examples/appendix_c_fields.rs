//! Algorithm 1 over bakes of meshes and over networks, masked and not, on whole outfits.
//!
//! ```text
//! cargo run --release -p if-benches --example appendix_c_fields -- [FOLDER] [OUTFIT …]
//! ```
//!
//! FOLDER holds `body_clean.ply`, `garments/*.ply` and `outfits.json`; `../shared/data/body_a` where
//! none is given, of which o1, o3 (Fig. 3's scene) and o5 are taken. For each garment but the
//! outermost a network of the grid encoding is fitted to the person who wears it and all garments
//! below, as `resolve` left them. Two tables:
//!
//! - whole outfits: contacts, Algorithm 1 on bakes of meshes, and on the networks, each verified and
//!   repaired as always;
//! - each garment, as it came, over those below as `resolve` left them: Algorithm 1 alone on the
//!   field of all layers below, baked or as a network, with the mask of Appendix C and without.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_benches::timing::cpu_seconds;
use if_core::field::SignedDistance;
use if_core::masked::{BoxesMask, Mask, Masked};
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::extract::{ExtractParams, Resolution, extract};
use if_mesh::file::MeshFile;
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;
use if_mesh::sdf::MeshSdf;
use if_mesh::solid::{ClosedLayer, ClothedField};
use if_neural::field::NeuralField;
use if_neural::network::Network;
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{EffortParams, Method, ResolveError, ResolveParams, Resolved};
use if_outfit::resolve::{resolve, resolve_on_fields};
use if_outfit::storage::Storage;
use if_pipeline::reconstruct::{PhiParams, fit_phi};
use if_xpbd::air::AirParams;
use if_xpbd::algorithm1::{Below, run_algorithm1};
use if_xpbd::inner_surface::InnerSurface;
use if_xpbd::params::SolverParams;
use std::error::Error;
use std::path::{Path, PathBuf};

/// Cells of bakes and how far they reach beyond what they are for, in metres: those of
/// `--method paper`.
const CELL: Real = 0.005;
const AROUND: Real = 0.03;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let folder = args.next().map_or_else(|| PathBuf::from("../shared/data/body_a"), PathBuf::from);
    let mut names: Vec<String> = args.collect();
    if names.is_empty() {
        names = ["o1_casual", "o3_fig3", "o5_five_layers"].map(String::from).to_vec();
    }
    for name in names {
        let outfit = read(&folder, &name)?;
        let before = cpu_seconds();
        let base = resolved(resolve(&outfit, &ResolveParams::default(), &mut Silent))?;
        let seconds = cpu_seconds() - before;
        let body = ClosedLayer::body(&outfit.body.mesh);
        let garments: Vec<ClosedLayer> = base.outfit.garments[..outfit.garments.len() - 1]
            .iter()
            .map(|g| ClosedLayer::garment(&g.mesh, &body, &outfit.body.mesh))
            .collect();
        let before = cpu_seconds();
        let networks = networks(&body, &garments)?;
        println!(
            "\n{name}: {} networks in {:.0} s of processor\n",
            networks.len(),
            cpu_seconds() - before
        );
        println!(
            "| outfit by | pairs left | repair rounds | moved mean of each / max, mm | strain rms / max, % | queries / skipped by bound / by mask, thousands | processor, s |"
        );
        println!("|---|---|---|---|---|---|---|");
        print_outfit("contacts", &base, seconds);
        let effort = EffortParams { method: Method::Paper, ..Default::default() };
        let paper = ResolveParams { effort, ..Default::default() };
        let before = cpu_seconds();
        let found = resolved(resolve(&outfit, &paper, &mut Silent))?;
        print_outfit("Algorithm 1 on bakes", &found, cpu_seconds() - before);
        let mut fields: Vec<Option<&dyn SignedDistance>> =
            networks.iter().map(|n| Some(n as &dyn SignedDistance)).collect();
        fields.push(None);
        let before = cpu_seconds();
        let found = resolved(resolve_on_fields(&outfit, &fields, &paper, &mut Silent))?;
        print_outfit("Algorithm 1 on networks", &found, cpu_seconds() - before);

        println!(
            "\n| garment | field of all below | mask | steps | queries / skipped by bound / by mask, thousands | pairs left | processor, s |"
        );
        println!("|---|---|---|---|---|---|---|");
        for k in 1..outfit.garments.len() {
            let garment = &outfit.garments[k];
            let below: Vec<&ClosedLayer> = [&body].into_iter().chain(&garments[..k]).collect();
            let region = garment.mesh.surface_aabb().inflated(AROUND);
            let baked = ClothedField::new(below.clone()).baked(&region, CELL, &mut Silent)?;
            for (of, field) in
                [("bake", &baked as &dyn SignedDistance), ("network", &networks[k - 1])]
            {
                for masked in [true, false] {
                    print_garment(garment, &below, (of, field), masked)?;
                }
            }
        }
    }
    Ok(())
}

/// An outfit of a data folder.
fn read(folder: &Path, name: &str) -> Result<Outfit, Box<dyn Error>> {
    let layer = |name: &str, path: PathBuf| -> Result<Layer, Box<dyn Error>> {
        let mesh = MeshFile::read(&path)?.mesh().clone();
        Ok(Layer { storage: Storage::F32, ..Layer::new(name, mesh) })
    };
    let list: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.join("outfits.json"))?)?;
    let layers = list[name]["layers_inner_to_outer"].as_array();
    let garments = layers.ok_or_else(|| format!("outfits.json has no outfit {name}"))?.iter();
    let garments = garments.filter_map(|n| n.as_str());
    let garments = garments.map(|n| layer(n, folder.join(format!("garments/{n}.ply"))));
    let garments = garments.collect::<Result<_, _>>()?;
    Ok(Outfit::new(layer("body", folder.join("body_clean.ply"))?, garments)?)
}

/// The outfit as far as it came.
fn resolved(found: Result<Resolved, ResolveError>) -> Result<Resolved, ResolveError> {
    match found {
        Err(ResolveError::Unresolved { result, .. }) => Ok(*result),
        other => other,
    }
}

/// For each garment φ of the person who wears it and all below.
fn networks(
    body: &ClosedLayer,
    garments: &[ClosedLayer],
) -> Result<Vec<NeuralField<Network>>, Box<dyn Error>> {
    (1..=garments.len())
        .map(|worn| {
            let layers: Vec<&ClosedLayer> = [body].into_iter().chain(&garments[..worn]).collect();
            let field = ClothedField::new(layers);
            let region = field.bounds().ok_or("layers without a box")?.inflated(AROUND);
            let baked = field.baked(&region, CELL, &mut Silent)?;
            let resolution = Resolution::Cell(CELL);
            let cells = ExtractParams { region: Some(region), resolution, ..Default::default() };
            let person = MeshSdf::closed(&extract(&baked, &cells, &mut Silent)?.mesh)?;
            let found = fit_phi(&person, &PhiParams::default(), &mut Silent)?;
            Ok(found.field()?)
        })
        .collect()
}

fn print_outfit(by: &str, found: &Resolved, seconds: f64) {
    let (layers, after) = (&found.report.layers, &found.report.after);
    let joined = |text: &dyn Fn(&if_outfit::report::LayerReport) -> String| {
        layers.iter().map(text).collect::<Vec<_>>().join(", ")
    };
    let worst = |value: &dyn Fn(&if_outfit::report::LayerReport) -> Real| {
        layers.iter().map(value).fold(0.0, Real::max)
    };
    let counted: Vec<_> = layers.iter().filter_map(|l| l.algorithm1.as_ref()).collect();
    let sum = |value: &dyn Fn(&if_outfit::report::Algorithm1Report) -> u64| {
        counted.iter().map(|r| value(r)).sum::<u64>() / 1000
    };
    println!(
        "| {by} | {} | {} | {} / {:.1} | {:.1} / {:.0} | {} / {} / {} | {seconds:.1} |",
        after.total_pairs(),
        joined(&|l| l.repairs.to_string()),
        joined(&|l| format!("{:.2}", 1e3 * l.moved.mean)),
        1e3 * worst(&|l| l.moved.max),
        100.0 * worst(&|l| l.strain.rms),
        100.0 * worst(&|l| l.strain.max),
        sum(&|r| r.queries),
        sum(&|r| r.skipped_by_bound),
        sum(&|r| r.skipped_by_mask),
    );
}

/// Algorithm 1 alone, as `--method paper` wires it.
fn print_garment(
    garment: &Layer,
    below: &[&ClosedLayer],
    (of, field): (&str, &dyn SignedDistance),
    masked: bool,
) -> Result<(), Box<dyn Error>> {
    let clearance = ResolveParams::default().goal.clearance;
    let params = SolverParams { clearance, ..SolverParams::default() };
    let boxes = BoxesMask::new(below[1..].iter().map(|layer| layer.bvh().aabb()))?;
    let vertices = garment.mesh.vertices();
    let weights: Vec<Real> =
        vertices.iter().map(|p| if masked { Real::from(boxes.binds(p)) } else { 1.0 }).collect();
    let next = below[below.len() - 1];
    let surface: TriMesh = next.to_mesh();
    let inner = InnerSurface::new(&surface, next.bvh());
    let air = AirParams { min_gap: clearance, ..AirParams::default() };
    let within = Masked { field, mask: boxes };
    let field: &dyn SignedDistance = if masked { &within } else { field };
    let before = cpu_seconds();
    let below_it = Below { field, mask: &weights, air: Some((&inner, air)) };
    let (settled, report) = run_algorithm1(&garment.mesh, &below_it, &params, &mut Silent)?;
    let seconds = cpu_seconds() - before;
    let after = Bvh::new(&garment.mesh.with_vertices(settled)?);
    let left: usize = below.iter().map(|layer| pairs(layer.bvh(), &after).len()).sum();
    let counters = report.counters;
    println!(
        "| {} | {of} | {} | {} | {} / {} / {} | {left} | {seconds:.1} |",
        garment.name,
        if masked { "boxes" } else { "none" },
        report.steps,
        counters.queries / 1000,
        counters.skipped_by_bound / 1000,
        counters.skipped_by_mask / 1000,
    );
    Ok(())
}
