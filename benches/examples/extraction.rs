//! Extraction measured: `extraction MODE [CELLS…]` prints CSV.
//!
//! `errors` runs the matrix of fields: evaluations, time, two-sided errors, normals, angles,
//! topology. `curves` the error of a few fields against evaluations and time, for cells from coarse
//! to fine. `evaluations` the number of evaluations on the four fields of
//! `benches/peers/lipschitz_octree.py`. `grid FILE` the time of marching the 256³ nodes of a sphere
//! in FILE (raw f32, x fastest), for `benches/peers/flying_edges.py`.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

#[path = "../../crates/if-mesh/tests/fields/mod.rs"]
mod fields;

use fields::{BOX, Case, cases, flaws, region};
use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, barycentric_point};
use if_core::monitor::Silent;
use if_mesh::extract::{ExtractParams, Extraction, Resolution, Sampling, extract, surface_of_grid};
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;
use if_mesh::measure::smallest_angles;
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let numbers = |default: &[u32]| -> Vec<u32> {
        let given: Vec<u32> = args.iter().skip(1).filter_map(|a| a.parse().ok()).collect();
        if given.is_empty() { default.to_vec() } else { given }
    };
    match args.first().map(String::as_str) {
        Some("errors") => errors(&numbers(&[64])),
        Some("curves") => curves(&numbers(&[16, 24, 32, 48, 64, 96, 128, 192, 256])),
        Some("evaluations") => evaluations(&numbers(&[256])),
        Some("grid") => grid(&args[1]),
        _ => println!(
            "usage: extraction errors|curves|evaluations [CELLS…], or extraction grid FILE"
        ),
    }
}

fn params(case: &Case, cells: u32) -> ExtractParams {
    ExtractParams {
        region: Some(region()),
        resolution: Resolution::Cells(cells),
        phase: case.phase,
        noise: case.noise,
        ..ExtractParams::default()
    }
}

/// Distances and angles of a mesh against its field.
struct Errors {
    vertex: Real,
    center: Real,
    /// From the surface to the mesh.
    back: Real,
    /// Root mean square and largest angle between triangles and the field's normal at their
    /// centres, in degrees.
    normal: [Real; 2],
}

fn measure(field: &dyn SignedDistance, found: &Extraction, truth: &[Point]) -> Errors {
    let mesh = &found.mesh;
    let off = |p: &Point| {
        let s = field.sample(p);
        s.distance.abs() / s.gradient.norm().max(0.1)
    };
    let vertex = mesh.vertices().iter().map(off).fold(0.0, Real::max);
    let (mut center, mut squares, mut most) = (0.0, 0.0, 0.0);
    for (t, normal) in mesh.face_normals().iter().enumerate() {
        let c = barycentric_point(mesh.corners(t), [1.0 / 3.0; 3]);
        let s = field.sample(&c);
        center = Real::max(center, s.distance.abs() / s.gradient.norm().max(0.1));
        let angle = normal.angle(&s.gradient).to_degrees();
        squares += angle * angle;
        most = Real::max(most, angle);
    }
    let bvh = Bvh::new(mesh);
    let back = truth
        .iter()
        .filter_map(|p| bvh.closest(p, Real::INFINITY))
        .map(|c| c.distance)
        .fold(0.0, Real::max);
    Errors {
        vertex,
        center,
        back,
        normal: [(squares / mesh.triangles().len().max(1) as Real).sqrt(), most],
    }
}

/// Points on the surface: vertices of a finer mesh on another lattice, after two Newton steps.
fn truth(case: &Case, cells: u32) -> Vec<Point> {
    let fine =
        ExtractParams { phase: [0.21, 0.43, 0.87], newton: 2, check: 0, ..params(case, 2 * cells) };
    let mesh = extract(&*case.field, &fine, &mut Silent).unwrap().mesh;
    let inside = region().inflated(-BOX / Real::from(cells));
    mesh.vertices().iter().copied().filter(|p| inside.contains(p)).collect()
}

fn errors(sizes: &[u32]) {
    println!(
        "cells,field,relax,triangles,evaluations,polish,skipped,same as dense,seconds,vertex,center,back,normal rms,normal max,\
         least angle,below 10 deg,euler,border edges,fins,bow-ties,holes,self-intersections,warnings"
    );
    for cells in sizes {
        for case in cases(*cells) {
            let dense = extract(
                &*case.field,
                &ExtractParams { sampling: Sampling::Dense, ..params(&case, *cells) },
                &mut Silent,
            )
            .unwrap();
            let truth = truth(&case, *cells);
            for relax in [0, 3, 5] {
                let found = extract(
                    &*case.field,
                    &ExtractParams { relax, ..params(&case, *cells) },
                    &mut Silent,
                )
                .unwrap();
                let (mesh, report) = (&found.mesh, &found.report);
                let same = relax > 0 || *mesh == dense.mesh;
                let e = measure(&*case.field, &found, &truth);
                let angles = smallest_angles(mesh);
                let least = angles.iter().copied().fold(Real::INFINITY, Real::min);
                let slivers = angles.iter().filter(|a| **a < 10.0).count() as Real
                    / angles.len().max(1) as Real;
                let edges = Edges::new(mesh);
                let euler = mesh.vertices().len() as i64 + mesh.triangles().len() as i64
                    - edges.len() as i64;
                let border = edges.valence.iter().filter(|v| **v == 1).count();
                let [fins, bow_ties, holes] = flaws(mesh, &report.region, report.cell);
                let own = own_pairs(mesh, &Bvh::new(mesh)).len();
                println!(
                    "{cells},\"{}\",{relax},{},{},{},{:.4},{same},{:.3},{:.2e},{:.2e},{:.2e},{:.3},{:.2},{least:.2},{slivers:.4},{euler},{border},{fins},\
                     {bow_ties},{holes},{own},\"{}\"",
                    case.name,
                    mesh.triangles().len(),
                    report.evaluations.refine,
                    report.evaluations.polish,
                    report.skipped,
                    report.seconds.total(),
                    e.vertex,
                    e.center,
                    e.back,
                    e.normal[0],
                    e.normal[1],
                    report.warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
                );
            }
        }
    }
}

fn curves(sizes: &[u32]) {
    println!("field,cells,sampling,relax,evaluations,seconds,vertex,center,back,normal rms");
    for cells in sizes {
        for case in cases(*cells)
            .into_iter()
            .filter(|c| ["sphere", "torus", "gyroid", "layers, gap 4 h"].contains(&&*c.name))
        {
            let truth = truth(&case, *cells);
            for (sampling, relax) in
                [(Sampling::Sparse, 0), (Sampling::Sparse, 3), (Sampling::Dense, 0)]
            {
                if sampling == Sampling::Dense && *cells > 128 {
                    continue;
                }
                let found = extract(
                    &*case.field,
                    &ExtractParams { sampling, relax, check: 0, ..params(&case, *cells) },
                    &mut Silent,
                )
                .unwrap();
                let e = measure(&*case.field, &found, &truth);
                println!(
                    "\"{}\",{cells},{sampling:?},{relax},{},{:.4},{:.3e},{:.3e},{:.3e},{:.4}",
                    case.name,
                    found.report.evaluations.total,
                    found.report.seconds.total(),
                    e.vertex,
                    e.center,
                    e.back,
                    e.normal[0]
                );
            }
        }
    }
}

fn evaluations(sizes: &[u32]) {
    println!("cells,field,evaluations,vertices,seconds");
    for cells in sizes {
        let h = BOX / Real::from(*cells);
        let fields: [(&str, Box<dyn SignedDistance>); 4] = [
            ("sphere", Box::new(fields::sphere())),
            ("torus", Box::new(fields::torus())),
            ("two layers", Box::new(fields::layers(2.0 * h))),
            ("shell 8 mm", Box::new(fields::shell())),
        ];
        for (name, field) in fields {
            let params = ExtractParams {
                region: Some(region()),
                resolution: Resolution::Cells(*cells),
                phase: [0.0; 3],
                check: 0,
                ..ExtractParams::default()
            };
            let found = extract(&*field, &params, &mut Silent).unwrap();
            let r = &found.report;
            println!(
                "{cells},{name},{},{},{:.3}",
                r.evaluations.refine,
                found.mesh.vertices().len(),
                r.seconds.refine
            );
        }
    }
}

fn grid(path: &str) {
    let bytes = std::fs::read(path).unwrap();
    let values: Vec<f32> =
        bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    let n = (values.len() as f64).cbrt().round() as u32;
    let mut times = Vec::new();
    let mut triangles = 0;
    for _ in 0..7 {
        let start = Instant::now();
        let mesh = surface_of_grid(&values, [n; 3], Point::origin(), 1.0).unwrap();
        times.push(start.elapsed().as_secs_f64() * 1e3);
        triangles = mesh.triangles().len();
    }
    times.sort_by(f64::total_cmp);
    println!(
        "{n} nodes along a side, {triangles} triangles: median {:.1} ms, least {:.1} ms",
        times[3], times[0]
    );
}
