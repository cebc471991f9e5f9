//! Baselines beside `resolve`, on the outfits of data folders.
//!
//! ```text
//! cargo run --release -p if-benches --example baselines -- [FOLDER …] [--outfit NAME] [--layers] \
//!     [--quick]
//! ```
//!
//! A FOLDER holds `body_clean.ply`, `garments/*.ply` and `outfits.json`; without one,
//! `../shared/data/body_a` and `body_b` are taken. Every method gets the same problem: the layer as
//! it came, over the layers below as `resolve` left them. `--outfit` takes the outfits whose name
//! begins so; `--layers` prints a row for each layer and not only one for each outfit; `--quick`
//! leaves Algorithm 1 out.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_benches::baselines::Left;
use if_benches::baselines::algorithm1::{ClothedBody, run};
use if_benches::baselines::laplacian::{LaplacianParams, deform};
use if_benches::baselines::push::{Inflate, InflateParams, inflated, naive};
use if_core::masked::BoxesMask;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::file::MeshFile;
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;
use if_mesh::measure::{displacement, strain};
use if_mesh::solid::{ClosedLayer, ClothedField};
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{ResolveError, ResolveParams, resolve};
use if_outfit::storage::Storage;
use if_xpbd::air::{AirParams, AirReading};
use if_xpbd::inner_surface::InnerSurface;
use if_xpbd::params::SolverParams;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

const METHODS: [&str; 9] = [
    "as it came",
    "naive push",
    "push, inflated everywhere",
    "push, inflated where pairs are left",
    "Laplacian solve",
    "Algorithm 1 as printed",
    "Algorithm 1 as printed, no air",
    "Algorithm 1 corrected",
    "resolve",
];
const RESOLVE: usize = METHODS.len() - 1;
/// Cells of the grid that Algorithm 1 collides with, in metres.
const CELL: f64 = 0.008;
/// How far the grid reaches beyond the garment, in metres.
const AROUND: f64 = 0.03;

/// What a method made of one layer.
struct Outcome {
    method: usize,
    outfit: String,
    layer: String,
    before: TriMesh,
    /// Positions, or why there are none.
    after: Result<Vec<Point>, String>,
    pairs: usize,
    inside: usize,
    own: [usize; 2],
    seconds: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut folders = Vec::new();
    let (mut only, mut layers, mut quick) = (None, false, false);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--outfit" => only = args.next(),
            "--layers" => layers = true,
            "--quick" => quick = true,
            folder => folders.push(PathBuf::from(folder)),
        }
    }
    if folders.is_empty() {
        folders = ["a", "b"].map(|b| PathBuf::from(format!("../shared/data/body_{b}"))).to_vec();
    }
    println!(
        "| outfit | method | pairs left | vertices inside | moved mean / p95 / max, mm | strain rms / p99 / max, % | own pairs | seconds |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut all = Vec::new();
    for folder in &folders {
        for (name, outfit) in outfits(folder)? {
            if only.as_ref().is_some_and(|o| !name.starts_with(o.as_str())) {
                continue;
            }
            let outcomes = compare(&name, &outfit, quick)?;
            for method in 0..METHODS.len() {
                let rows: Vec<&Outcome> = outcomes.iter().filter(|o| o.method == method).collect();
                if rows.is_empty() {
                    continue;
                }
                if layers {
                    rows.iter().for_each(|o| print_row(&format!("{name}: {}", o.layer), &[o]));
                } else {
                    print_row(&name, &rows);
                }
            }
            all.extend(outcomes);
        }
    }
    print_claim(&all);
    Ok(())
}

/// The outfits of a data folder, in the order of its file.
fn outfits(folder: &Path) -> Result<Vec<(String, Outfit)>, Box<dyn Error>> {
    let layer = |name: &str, path: PathBuf| -> Result<Layer, Box<dyn Error>> {
        let mesh = MeshFile::read(&path)?.mesh().clone();
        Ok(Layer { storage: Storage::F32, ..Layer::new(name, mesh) })
    };
    let body = layer("body", folder.join("body_clean.ply"))?;
    let list: serde_json::Map<String, serde_json::Value> =
        serde_json::from_slice(&std::fs::read(folder.join("outfits.json"))?)?;
    let mut found = Vec::new();
    for (name, about) in &list {
        let names = about["layers_inner_to_outer"]
            .as_array()
            .ok_or("an outfit has no layers_inner_to_outer")?;
        let garments = names
            .iter()
            .map(|n| {
                let n = n.as_str().ok_or("the name of a layer is no text")?;
                layer(n, folder.join("garments").join(format!("{n}.ply")))
            })
            .collect::<Result<_, _>>()?;
        found.push((name.clone(), Outfit::new(body.clone(), garments)?));
    }
    Ok(found)
}

/// Every method on every layer.
fn compare(name: &str, outfit: &Outfit, quick: bool) -> Result<Vec<Outcome>, Box<dyn Error>> {
    let resolved = match resolve(outfit, &ResolveParams::default(), &mut Silent) {
        Ok(resolved) => resolved,
        Err(ResolveError::Unresolved { result, .. }) => *result,
        Err(other) => return Err(other.into()),
    };
    let mut outcomes = Vec::new();
    let mut below = vec![ClosedLayer::body(&outfit.body.mesh)];
    let mut inner = &outfit.body.mesh;
    for (k, garment) in outfit.garments.iter().enumerate() {
        let before = &garment.mesh;
        let near: Vec<&ClosedLayer> = below.iter().collect();
        let field = ClothedField::new(near.clone());
        let own_before = own_pairs(before, &Bvh::new(before)).len();
        let mut push = |method: usize, seconds: f64, after: Result<Vec<Point>, String>| {
            let mesh = after.as_ref().ok().and_then(|x| before.with_vertices(x.clone()).ok());
            let (left, own) = mesh.as_ref().map_or((Left::default(), 0), |m| {
                (Left::new(m, &near), own_pairs(m, &Bvh::new(m)).len())
            });
            outcomes.push(Outcome {
                method,
                outfit: name.to_owned(),
                layer: garment.name.clone(),
                before: before.clone(),
                after,
                pairs: left.pairs.len(),
                inside: left.inside.len(),
                own: [own_before, own],
                seconds,
            });
        };
        push(0, 0.0, Ok(before.vertices().to_vec()));
        let start = Instant::now();
        let after = naive(before, &field);
        push(1, start.elapsed().as_secs_f64(), Ok(after));
        for (method, inflate) in [(2, Inflate::Everywhere), (3, Inflate::WhereLeft)] {
            let start = Instant::now();
            let result = inflated(before, &near, &InflateParams { inflate, ..Default::default() });
            push(method, start.elapsed().as_secs_f64(), Ok(result.positions));
        }
        let start = Instant::now();
        let after = deform(before, &field, &LaplacianParams::default()).map_err(|e| e.to_string());
        push(4, start.elapsed().as_secs_f64(), after);
        if !quick {
            for (method, seconds, after) in algorithm1(before, &near, inner)? {
                push(method, seconds, after);
            }
        }
        push(
            RESOLVE,
            resolved.report.layers[k].seconds,
            Ok(resolved.outfit.garments[k].mesh.vertices().to_vec()),
        );
        inner = &resolved.outfit.garments[k].mesh;
        let closed = ClosedLayer::garment(inner, &below[0], &outfit.body.mesh);
        below.push(closed);
    }
    Ok(outcomes)
}

/// Method, seconds, and positions or why there are none.
type Attempt = (usize, f64, Result<Vec<Point>, String>);

/// Algorithm 1 over the baked clothed body, masked by the boxes of the layers below. The body's is
/// among them: the data's garments go through the body itself, and the other methods must mend that
/// too.
fn algorithm1(
    garment: &TriMesh,
    below: &[&ClosedLayer],
    inner: &TriMesh,
) -> Result<Vec<Attempt>, Box<dyn Error>> {
    let start = Instant::now();
    let field = ClothedField::new(below.to_vec());
    let baked = field.baked(&garment.aabb().inflated(AROUND), CELL, &mut Silent)?;
    let baking = start.elapsed().as_secs_f64();
    let mask = BoxesMask::new(below.iter().map(|l| l.bvh().aabb()))?;
    let tree = Bvh::new(inner);
    let surface = InnerSurface::new(inner, &tree);
    let literal_air = AirParams { reading: AirReading::Literal, ..AirParams::default() };
    let variants = [
        (5, SolverParams::literal(), Some((&surface, literal_air))),
        (6, SolverParams::literal(), None),
        (7, SolverParams::default(), None),
    ];
    Ok(variants
        .into_iter()
        .map(|(method, params, air)| {
            let start = Instant::now();
            let body = ClothedBody { field: &baked, mask: Some(mask.clone()), air };
            let after = run(garment, &body, &params).map_err(|e| e.to_string());
            (method, baking + start.elapsed().as_secs_f64(), after)
        })
        .collect())
}

/// One row: the layers of an outfit, or one layer, taken together.
fn print_row(title: &str, rows: &[&Outcome]) {
    let method = METHODS[rows[0].method];
    if let Some(error) = rows.iter().find_map(|o| o.after.as_ref().err()) {
        println!("| {title} | {method} | fails: {error} | | | | | |");
        return;
    }
    let (mesh, after) = together(rows);
    let (d, s) = (displacement(mesh.vertices(), &after), strain(&mesh, &after));
    let sum = |f: fn(&Outcome) -> usize| rows.iter().map(|o| f(o)).sum::<usize>();
    let seconds: f64 = rows.iter().map(|o| o.seconds).sum();
    let [mean, p95, max] = [1e3 * d.mean, 1e3 * d.p95, 1e3 * d.max].map(short);
    let [rms, p99, most] = [100.0 * s.rms, 100.0 * s.p99, 100.0 * s.max].map(short);
    let (pairs, inside) = (sum(|o| o.pairs), sum(|o| o.inside));
    let (own, now) = (sum(|o| o.own[0]), sum(|o| o.own[1]));
    println!(
        "| {title} | {method} | {pairs} | {inside} | {mean} / {p95} / {max} | {rms} / {p99} / {most} | {own} → {now} | {seconds:.2} |"
    );
}

/// Three digits or so: some methods throw a garment kilometres away.
fn short(value: f64) -> String {
    match value {
        v if v >= 1e4 => format!("{v:.0e}"),
        v if v >= 100.0 => format!("{v:.0}"),
        v if v >= 10.0 => format!("{v:.1}"),
        v => format!("{v:.2}"),
    }
}

/// All layers as one mesh, before and after.
fn together(rows: &[&Outcome]) -> (TriMesh, Vec<Point>) {
    let (mut v, mut t, mut after) = (Vec::new(), Vec::new(), Vec::new());
    for o in rows {
        let first = v.len() as u32;
        v.extend_from_slice(o.before.vertices());
        t.extend(o.before.triangles().iter().map(|tri| tri.map(|k| k + first)));
        after.extend(o.after.iter().flatten());
    }
    (TriMesh::new(v, t).expect("parts are meshes"), after)
}

/// Where a baseline that ends clean moves or strains less than `resolve`.
fn print_claim(all: &[Outcome]) {
    println!(
        "\nLayers that a baseline ends clean, and where it then moves or strains less than `resolve`:\n"
    );
    println!(
        "| method | clean layers of those that were not | more own pairs | moves less (mean) | strains less (rms) | does both, adds no own pairs |"
    );
    println!("|---|---|---|---|---|---|");
    let mut exceptions = Vec::new();
    let ours = |o: &Outcome| {
        all.iter().find(|r| r.method == RESOLVE && r.outfit == o.outfit && r.layer == o.layer)
    };
    let touched = |o: &&Outcome| {
        all.iter().any(|r| {
            r.method == 0 && r.outfit == o.outfit && r.layer == o.layer && r.pairs + r.inside > 0
        })
    };
    for method in 1..METHODS.len() {
        let rows: Vec<&Outcome> =
            all.iter().filter(|o| o.method == method).filter(touched).collect();
        if rows.is_empty() {
            continue;
        }
        let (mut clean, mut own, mut moves, mut strains, mut both) = (0, 0, 0, 0, 0);
        for o in &rows {
            let (Ok(after), Some(r)) = (&o.after, ours(o)) else { continue };
            if o.pairs + o.inside > 0 {
                continue;
            }
            let Ok(resolved) = &r.after else { continue };
            let moved = |x: &[Point]| 1e3 * displacement(o.before.vertices(), x).mean;
            let strained = |x: &[Point]| 100.0 * strain(&o.before, x).rms;
            let (dm, ds) = ([moved(after), moved(resolved)], [strained(after), strained(resolved)]);
            let adds = o.own[1] > o.own[0];
            clean += 1;
            own += usize::from(adds);
            moves += usize::from(dm[0] < dm[1]);
            strains += usize::from(ds[0] < ds[1]);
            both += usize::from(dm[0] < dm[1] && ds[0] < ds[1] && !adds);
            if dm[0] < dm[1] || ds[0] < ds[1] {
                exceptions.push(format!(
                    "| {} {} | {} | {:.2} against {:.2} | {:.2} against {:.2} | {} → {} against {} |",
                    o.outfit, o.layer, METHODS[method], dm[0], dm[1], ds[0], ds[1], o.own[0], o.own[1], r.own[1]
                ));
            }
        }
        println!(
            "| {} | {clean} of {} | {own} | {moves} | {strains} | {both} |",
            METHODS[method],
            rows.len()
        );
    }
    println!(
        "\n| layer | baseline | moved mean, mm | strain rms, % | own pairs |\n|---|---|---|---|---|"
    );
    exceptions.iter().for_each(|e| println!("{e}"));
}
