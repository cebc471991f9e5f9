//! Garments of one body worn on another: a wardrobe, aligned, resolved and proven, in a folder that
//! is removed at the end.
//!
//! ```text
//! cargo run --release --example dress_another_body
//! ```

#![allow(clippy::print_stdout)] // a program for the terminal

use if_garments::body::AlignParams;
use if_garments::body::mannequin::{Garment, MannequinParams, body, garment};
use if_garments::core::Point;
use if_garments::mesh::ply::{PlyMesh, WriteParams, write_path};
use if_garments::pipeline::asset::{LayerHint, Parts, Provenance};
use if_garments::pipeline::wardrobe::NewBody;
use if_garments::pipeline::wardrobe::combination::Combination;
use if_garments::pipeline::wardrobe::matching::{MatchParams, run};
use if_garments::pipeline::{Dresser, Wardrobe};
use if_garments::{Silent, TriMesh};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let mut wardrobe = Wardrobe::open(&folder.path().join("wardrobe"))?;

    // Two bodies. Here the second is the first, taller and wider.
    let scene = MannequinParams { resolution: 0.7, ..Default::default() };
    let slim = body(&scene);
    let wider = slim.vertices().iter().map(|p| Point::new(p.x * 1.08, p.y * 1.04, p.z * 1.1));
    let large = slim.with_vertices(wider.collect())?;
    let mut add = |name: &str, mesh: &TriMesh| {
        let path = folder.path().join(format!("{name}.ply"));
        write_path(&PlyMesh::new(mesh.clone()), mesh.vertices(), &WriteParams::default(), &path)?;
        Ok::<_, Box<dyn std::error::Error>>(wardrobe.add_body(&NewBody::new(name, &path))?)
    };
    let (made_on, _) = (add("slim", &slim)?, add("large", &large)?);

    // Garments made on the first body, as assets.
    for kind in [Garment::Trousers, Garment::Tshirt, Garment::Jacket] {
        let mesh = garment(kind, &scene);
        let provenance = Provenance { source: "mannequin".into(), ..Default::default() };
        wardrobe.add(&Parts {
            name: kind.name(),
            hint: LayerHint::of_name(kind.name()),
            body: &made_on,
            mesh: &mesh,
            skin: None,
            beside: None,
            provenance: &provenance,
            network: None,
            baked: None,
        })?;
    }

    // Worn on the second body, inner to outer.
    let dresser = Dresser::new(&wardrobe, AlignParams::default());
    let garments = ["trousers", "tshirt", "jacket"].map(str::to_owned).to_vec();
    let combination = Combination { body: "large".into(), garments };
    let params = MatchParams { picture_height: 0, ..Default::default() };
    let matched = run(&dresser, &combination, &params, &mut Silent)?;
    let report = matched.result.report.ok_or("not resolved")?;
    println!("{} pairs -> {}", report.before.total_pairs(), report.after.total_pairs());
    assert!(report.before.total_pairs() > 0 && report.is_proven());
    Ok(())
}
