//! Clothing matching by library calls: a wardrobe of one body, worn on another, in a folder that is
//! removed at the end.
//!
//! ```text
//! cargo run --release -p if-pipeline --example clothing_matching
//! ```

#![allow(clippy::print_stdout)] // a program for the terminal

use if_body::align::{AlignParams, carried_field};
use if_body::mannequin::{Garment, MannequinParams, body, garment};
use if_core::math::Point;
use if_core::monitor::Silent;
use if_mesh::baked::BakeParams;
use if_mesh::ply::{PlyMesh, WriteParams, write_path};
use if_pipeline::asset::{LayerHint, Parts, Provenance};
use if_pipeline::wardrobe::combination::Combination;
use if_pipeline::wardrobe::dresser::Dresser;
use if_pipeline::wardrobe::matching::{MatchParams, run};
use if_pipeline::wardrobe::{NewBody, Wardrobe};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let mut wardrobe = Wardrobe::open(&folder.path().join("wardrobe"))?;

    // Two bodies. Here the second is the first, taller and wider; elsewhere it comes from another
    // capture.
    let scene = MannequinParams { resolution: 0.7, ..Default::default() };
    let slim = body(&scene);
    let large = slim.with_vertices(
        slim.vertices().iter().map(|p| Point::new(p.x * 1.08, p.y * 1.04, p.z * 1.1)).collect(),
    )?;
    let mut made_on = None;
    for (name, mesh) in [("slim", &slim), ("large", &large)] {
        let path = folder.path().join(format!("{name}.ply"));
        write_path(&PlyMesh::new(mesh.clone()), mesh.vertices(), &WriteParams::default(), &path)?;
        let added = wardrobe.add_body(&NewBody::new(name, &path))?;
        made_on.get_or_insert(added);
    }
    let made_on = made_on.ok_or("no body")?;

    // Garments made on the first body, as assets.
    for kind in Garment::ALL {
        let mesh = garment(kind, &scene);
        let provenance = Provenance { source: "mannequin".into(), ..Default::default() };
        let parts = Parts {
            name: kind.name(),
            hint: LayerHint::of_name(kind.name()),
            body: &made_on,
            mesh: &mesh,
            skin: None,
            beside: None,
            provenance: &provenance,
            network: None,
            baked: None,
        };
        let info = wardrobe.add(&parts)?;
        println!("{}: {:?}, {} openings", info.name, info.layer.class, info.openings.len());
    }

    // Three of them on the second body: aligned, resolved, proven.
    let dresser = Dresser::new(&wardrobe, AlignParams::default());
    let garments = ["trousers", "tshirt", "jacket"].map(str::to_owned).to_vec();
    let combination = Combination { body: "large".into(), garments };
    let params = MatchParams { picture_height: 0, ..Default::default() };
    let matched = run(&dresser, &combination, &params, &mut Silent)?.ok_or("cancelled")?;
    println!("{combination}: {:?}", matched.result.state);
    for (name, a) in combination.garments.iter().zip(&matched.result.alignments) {
        println!(
            "  {name}: by {:?}, {:.1} mm on average, {:.1} % inside",
            a.method,
            a.moved.mean * 1e3,
            a.inside[1] * 1e2
        );
    }
    let report = matched.result.report.ok_or("not resolved")?;
    println!(
        "  {} pairs before, {} after",
        report.before.total_pairs(),
        report.after.total_pairs()
    );

    // φ of the second body in the aligned T-shirt, for whoever asks for a field.
    let tshirt = dresser.aligned("tshirt", "large")?;
    let phi = carried_field(&large, &tshirt.mesh, &BakeParams::default())?;
    println!(
        "  φ of the T-shirt: {:.1} MiB, within {:.2} mm near the surface",
        phi.bytes() as f64 / 1048576.0,
        phi.error_bound_within(0.01) * 1e3
    );
    Ok(())
}
