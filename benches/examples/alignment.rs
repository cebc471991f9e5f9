//! Moves every garment of one body to another and back, and tells what it cost.
//!
//! ```text
//! cargo run --release -p if-benches --example alignment -- WARDROBE FROM TO [--register | --similar]
//! ```
//!
//! WARDROBE is a folder made by `ifg wardrobe add`. `--register` leaves out what the bodies' meshes
//! share, so that one surface must be bent onto the other, and tells how far that is from what they
//! share; `--similar` takes the fallback alone.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_body::align::{AlignError, AlignParams, BodyMap, BodyShape, inside};
use if_core::closest::ClosestPoint;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::measure::{displacement, strain};
use if_mesh::solid::ClosedLayer;
use if_pipeline::wardrobe::Wardrobe;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [root, from, to, flags @ ..] = args.as_slice() else {
        return Err("usage: alignment WARDROBE FROM TO [--register | --similar]".into());
    };
    let flag = |name: &str| flags.iter().any(|f| f == name);
    let wardrobe = Wardrobe::open(Path::new(root))?;
    let (from, to) = (wardrobe.body(from)?, wardrobe.body(to)?);
    let (solid_from, solid_to) = (ClosedLayer::body(&from.mesh), ClosedLayer::body(&to.mesh));
    let params = AlignParams::default();
    let map = |mut a: BodyShape, mut b: BodyShape| -> Result<BodyMap, AlignError> {
        if flag("--similar") {
            return BodyMap::similar(&a, &b, &params);
        }
        if flag("--register") {
            (a.template, b.template) = (None, None);
        }
        BodyMap::new(&a, &b, &params)
    };
    let start = Instant::now();
    let there = map(from.shape(), to.shape())?;
    let seconds = start.elapsed().as_secs_f64();
    let back = map(to.shape(), from.shape())?;
    println!(
        "{} to {}: {:?}, residual {:.2} mm, {seconds:.2} s; back {:?}, {:.2} mm",
        from.name,
        to.name,
        there.method(),
        there.residual() * 1e3,
        back.method(),
        back.residual() * 1e3
    );
    if let (true, Some((a, skin)), Some((b, _))) =
        (flag("--register"), from.template.as_ref(), to.template.as_ref())
    {
        // Where the vertices of one template are on the other is known.
        let carried = there.map_points(a.vertices(), skin.as_ref())?;
        let off = displacement(b.vertices(), &carried);
        let similar = BodyMap::similar(&from.shape(), &to.shape(), &params)?
            .map_points(a.vertices(), None)?;
        let similar = displacement(b.vertices(), &similar);
        println!(
            "template carried by the registration: {:.2} mm from the truth on average, p95 {:.2}, max {:.2} (similarity {:.2}, {:.2}, {:.2})",
            1e3 * off.mean,
            1e3 * off.p95,
            1e3 * off.max,
            1e3 * similar.mean,
            1e3 * similar.p95,
            1e3 * similar.max
        );
    }
    println!(
        "{:<18} {:>6} {:>21} {:>14} {:>8} {:>20} {:>22}",
        "garment",
        "verts",
        "round trip mean/p95/max",
        "inside % own/to",
        "seconds",
        "strain % rms/p99/max",
        "twin mean/p95/surface/its strain"
    );
    for (name, info) in wardrobe.garments() {
        if wardrobe.body_like(name, &info.body)?.name != from.name {
            continue;
        }
        let asset = wardrobe.garment(name)?;
        let (mesh, skin) = (&asset.mesh, asset.skin.as_ref());
        let start = Instant::now();
        let moved = there.align(mesh, skin)?;
        let seconds = start.elapsed().as_secs_f64();
        let again = back.align(&moved, skin)?;
        let round = displacement(mesh.vertices(), again.vertices());
        let s = strain(mesh, moved.vertices());
        let twin = twin(&wardrobe, mesh, &to.name)?.map_or(String::new(), |twin| {
            let d = displacement(twin.vertices(), moved.vertices());
            let surface = Bvh::new(&twin);
            let off = moved
                .vertices()
                .iter()
                .filter_map(|p| surface.closest(p, 1.0))
                .map(|c| c.distance * 1e3)
                .sum::<f64>();
            let (off, own) = (off / moved.vertices().len() as f64, strain(mesh, twin.vertices()));
            format!("{:.1}/{:.1}/{off:.1}/{:.0}", 1e3 * d.mean, 1e3 * d.p95, 100.0 * own.rms)
        });
        println!(
            "{name:<18} {:>6} {:>12.2}/{:.2}/{:.2} {:>9.1}/{:.1} {seconds:>8.3} {:>12.1}/{:.0}/{:.0} {twin:>22}",
            mesh.vertices().len(),
            1e3 * round.mean,
            1e3 * round.p95,
            1e3 * round.max,
            inside(mesh, &solid_from) * 1e2,
            inside(&moved, &solid_to) * 1e2,
            100.0 * s.rms,
            100.0 * s.p99,
            100.0 * s.max,
        );
    }
    Ok(())
}

/// The garment of as many vertices, in the same order in the test data, that its makers fitted to
/// the other body.
fn twin(wardrobe: &Wardrobe, mesh: &TriMesh, to: &str) -> Result<Option<TriMesh>, Box<dyn Error>> {
    for (name, info) in wardrobe.garments() {
        if wardrobe.body_like(name, &info.body)?.name == to
            && info.vertices == mesh.vertices().len()
        {
            return Ok(Some(wardrobe.garment(name)?.mesh));
        }
    }
    Ok(None)
}
