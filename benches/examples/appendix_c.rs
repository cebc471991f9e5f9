//! Appendix C in numbers: the jacket of Fig. 3 is corrected with the original field of the clothed
//! body and with the field masked by the boxes of the skirt and the T-shirt.
//!
//! ```text
//! cargo run --release -p if-benches --example appendix_c -- [FOLDER]
//! ```
//!
//! FOLDER is a data folder with the meshes of Fig. 3's scene, `../shared/data/body_a` where none is
//! given. Where there is none, the built-in scene takes its place, with the jacket 30 mm too far
//! back. The skirt and the T-shirt are made free of intersections first.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_benches::baselines::algorithm1::{ClothedBody, run};
use if_body::mannequin::{Garment, MannequinParams, body, garment};
use if_core::masked::{BoxesMask, Mask};
use if_core::math::{Point, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::file::MeshFile;
use if_mesh::measure::displacement;
use if_mesh::solid::{ClosedLayer, ClothedField};
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{ResolveError, ResolveParams, resolve};
use if_outfit::storage::Storage;
use if_xpbd::params::SolverParams;
use std::error::Error;
use std::path::{Path, PathBuf};

/// How far the built-in jacket is off its place, in metres.
const MISALIGNED: Vector = Vector::new(0.0, 0.0, -0.03);

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args()
        .nth(1)
        .map_or_else(|| PathBuf::from("../shared/data/body_a"), PathBuf::from);
    let outfit = if folder.join("body_clean.ply").is_file() {
        println!("Scene: {}", folder.display());
        let read = |name: &str, path: &str| -> Result<Layer, Box<dyn Error>> {
            let mesh = MeshFile::read(&folder.join(path))?.mesh().clone();
            Ok(Layer { storage: Storage::F32, ..Layer::new(name, mesh) })
        };
        let garments = ["pencil_skirt", "tshirt", "suit_jacket"]
            .map(|n| read(n, &format!("garments/{n}.ply")));
        Outfit::new(
            read("body", "body_clean.ply")?,
            garments.into_iter().collect::<Result<_, _>>()?,
        )?
    } else {
        println!(
            "Scene: the built-in mannequin ({} has no body_clean.ply)",
            Path::new(&folder).display()
        );
        let params = MannequinParams::default();
        let mut garments = [Garment::Skirt, Garment::Tshirt, Garment::Jacket]
            .map(|g| Layer::new(g.name(), garment(g, &params)));
        // Not aligned well: the sleeves cut through the arms.
        let jacket = &garments[2].mesh;
        let shifted = jacket.vertices().iter().map(|p| p + MISALIGNED).collect();
        garments[2].mesh = jacket.with_vertices(shifted)?;
        Outfit::new(Layer::new("body", body(&params)), garments.to_vec())?
    };
    let resolved = match resolve(&outfit, &ResolveParams::default(), &mut Silent) {
        Ok(resolved) => resolved,
        Err(ResolveError::Unresolved { result, .. }) => *result,
        Err(other) => return Err(other.into()),
    };
    let jacket = &outfit.garments[2].mesh;
    let closed_body = ClosedLayer::body(&outfit.body.mesh);
    let inner = [0, 1].map(|k| {
        ClosedLayer::garment(&resolved.outfit.garments[k].mesh, &closed_body, &outfit.body.mesh)
    });
    let mask = BoxesMask::new(inner.iter().map(|l| l.bvh().aabb()))?;
    let outside: Vec<usize> =
        (0..jacket.vertices().len()).filter(|v| !mask.binds(&jacket.vertices()[*v])).collect();
    println!(
        "{} of the jacket's {} vertices lie outside both boxes. How far they move:\n",
        outside.len(),
        jacket.vertices().len()
    );
    println!(
        "| method | field | outside: mean / p95 / max, mm | moved by more than 0.1 mm | inside the boxes: mean / p95 / max, mm |"
    );
    println!("|---|---|---|---|---|");
    let field = ClothedField::new(vec![&closed_body, &inner[0], &inner[1]]);
    let baked = field.baked(&jacket.aabb().inflated(0.03), 0.005, &mut Silent)?;
    // Without stretch the field alone moves vertices. As printed, a push leaves its speed behind:
    // one visit is enough to see.
    let once = SolverParams {
        compliance: f64::INFINITY,
        steps: 1,
        substeps: 1,
        ..SolverParams::literal()
    };
    let settled = SolverParams { compliance: f64::INFINITY, ..SolverParams::default() };
    let methods = [
        ("lines 6 to 10, one visit as printed", once),
        ("lines 6 to 10 corrected, until nothing moves", settled),
        ("Algorithm 1 as printed, no air", SolverParams::literal()),
        ("Algorithm 1 corrected", SolverParams::default()),
    ];
    for (name, params) in methods {
        for (kind, mask) in [("original", None), ("masked", Some(mask.clone()))] {
            let after = run(jacket, &ClothedBody { field: &baked, mask, air: None }, &params)?;
            print_row(name, kind, jacket, &after, &outside);
        }
    }
    print_row(
        "`resolve`",
        "exact; masked by three boxes: skirt, T-shirt, body",
        jacket,
        resolved.outfit.garments[2].mesh.vertices(),
        &outside,
    );
    Ok(())
}

fn print_row(method: &str, field: &str, jacket: &TriMesh, after: &[Point], outside: &[usize]) {
    let x = jacket.vertices();
    let of = |x: &[Point], outer: bool| -> Vec<Point> {
        (0..x.len()).filter(|v| outside.binary_search(v).is_ok() == outer).map(|v| x[v]).collect()
    };
    let out = displacement(&of(x, true), &of(after, true));
    let within = displacement(&of(x, false), &of(after, false));
    let far = outside.iter().filter(|v| (after[**v] - x[**v]).norm() > 1e-4).count();
    println!(
        "| {method} | {field} | {:.3} / {:.3} / {:.2} | {far} | {:.2} / {:.2} / {:.1} |",
        1e3 * out.mean,
        1e3 * out.p95,
        1e3 * out.max,
        1e3 * within.mean,
        1e3 * within.p95,
        1e3 * within.max
    );
}
