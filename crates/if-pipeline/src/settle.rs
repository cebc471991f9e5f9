//! lab
use crate::cloth::{Cloth, Plane, planes};
use crate::outfit::Layer;
use crate::report::{LayerReport, Moved, Skipped, Strain};
use crate::resolve::ResolveParams;
use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::math::{Point, Real, barycentric_point};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{own_pairs, pairs};
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;

#[derive(Clone)]
struct Sample { t: u32, v: [u32; 3], b: [Real; 3], extra: Real }

fn env(k: &str, d: Real) -> Real { std::env::var(k).ok().and_then(|s| s.parse().ok()).unwrap_or(d) }

pub(crate) fn settle(garment: &Layer, below: &[(&str, &ClosedLayer)], params: &ResolveParams) -> (LayerReport, Vec<Point>) {
    let mesh = &garment.mesh;
    let x0 = mesh.vertices().to_vec();
    let mut x = x0.clone();
    let n = x.len();
    let edges = Edges::new(mesh);
    let cloth = Cloth::new(mesh, env("BEND", 0.3));
    let mut tree = Bvh::new(mesh);
    let delta = params.clearance * env("CL", 1.0);
    let margin = env("MARGIN", 2e-3);
    let step = env("STEP", 4e-3);
    let long = env("LONG", 8e-3);
    let sweeps = env("SWEEPS", 10.0) as usize;
    let max_rounds = env("ROUNDS", 60.0) as usize;
    let attach = env("ATT", 0.002);
    let w = vec![1.0; n];
    let own0 = own_pairs(mesh, &tree);
    let mut report = LayerReport { name: garment.name.clone(), moved: Moved::default(), strain: Strain::default(), own_pairs: [own0.len(); 2], rounds: 0, repairs: 0, sweeps: 0, queries: 0, skipped: Skipped::default(), seconds: 0.0 };
    // samples
    let mut samples: Vec<Sample> = Vec::new();
    let mut owner = vec![u32::MAX; n];
    for (t, tri) in mesh.triangles().iter().enumerate() { for v in tri { if owner[*v as usize] == u32::MAX { owner[*v as usize] = t as u32; } } }
    for v in 0..n { if owner[v] != u32::MAX { samples.push(Sample { t: owner[v], v: [v as u32; 3], b: [1.0, 0.0, 0.0], extra: 0.0 }); } }
    for (k, &[a, b]) in edges.vertices.iter().enumerate() {
        if (x[a as usize] - x[b as usize]).norm() > long { samples.push(Sample { t: edges.triangles[k][0], v: [a, b, b], b: [0.5, 0.5, 0.0], extra: 0.0 }); }
    }
    for (t, tri) in mesh.triangles().iter().enumerate() {
        let c = mesh.corners(t);
        if (0..3).any(|k| (c[k] - c[(k + 1) % 3]).norm() > long) { samples.push(Sample { t: t as u32, v: *tri, b: [1.0 / 3.0; 3], extra: 0.0 }); }
    }
    let mut inflate = vec![0.0; mesh.triangles().len()];
    let mut vin = vec![0.0f64; n];
    let debug = std::env::var("D").is_ok();
    let mut done = false;
    let mut settled_rounds = 0;
    for round in 0..max_rounds {
        report.rounds = round + 1;
        // detect
        let detect = |s: &Sample, x: &[Point]| -> Vec<Plane> {
            let p = barycentric_point([&x[s.v[0] as usize], &x[s.v[1] as usize], &x[s.v[2] as usize]], s.b);
            let mut out = Vec::new();
            let d = delta + s.extra + (0..3).map(|k| s.b[k] * vin[s.v[k] as usize]).sum::<Real>();
            for (_, l) in below {
                let reach = d + margin;
                if l.is_far(&p, reach) { continue; }
                if let Some(h) = l.sided(&p, reach) {
                    let target = d.min(h.distance + step);
                    out.push(Plane { v: s.v, b: s.b, n: h.normal, d: h.normal.dot(&h.point.coords) + target });
                }
            }
            out
        };
        let mut cons: Vec<Plane> = samples.par_iter().flat_map_iter(|s| detect(s, &x)).collect();
        report.queries += samples.len() * below.len();
        // vertices of lower layers against triangles
        tree.refit(&x);
        let obox = tree.aabb().inflated(margin + delta);
        for (_, l) in below {
            let found: Vec<Vec<Plane>> = (0..l.vertex_count()).into_par_iter().filter_map(|v| {
                let p = l.vertex(v);
                if !obox.contains(&p) { return None; }
                let c = tree.closest(&p, delta + margin)?;
                if c.barycentric.iter().any(|b| *b > 0.95) { return None; }
                let s = Sample { t: c.triangle, v: mesh.triangles()[c.triangle as usize], b: c.barycentric, extra: 0.0 };
                Some(detect(&s, &x))
            }).collect();
            cons.extend(found.into_iter().flatten());
        }
        let xs = x.clone();
        let mut worst = 0.0;
        for _ in 0..sweeps {
            for v in 0..n { let d = x0[v] - x[v]; x[v] += d * attach; }
            cloth.stretch(&mut x, &w);
            cloth.own(&mut x, &w);
            worst = planes(&cons, &mut x, &w);
            report.sweeps += 1;
        }
        for _ in 0..3 { worst = planes(&cons, &mut x, &w); if worst < 1e-6 { break; } }
        let moved = x.iter().zip(&xs).map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        tree.refit(&x);
        let mut total = 0;
        let mut byl = vec![];
        if moved < env("TOL", 3e-4) || round % 5 == 4 { settled_rounds += 1;
            for (_, l) in below {
                let ps = pairs(l.bvh(), &tree);
                total += ps.len();
                byl.push(ps.len());
                for p in ps {
                    let tri = mesh.triangles()[p.b as usize];
                    for v in tri { vin[v as usize] = (vin[v as usize].max(0.1e-3) * 1.05).min(0.03); }
                    inflate[p.b as usize] += 1.0;
                }
            }
            let own = own_pairs(&mesh.with_vertices(x.clone()).unwrap(), &tree);
            let inside: usize = below.iter().map(|(_, l)| x.iter().filter(|p| l.sided(p, 0.0).is_some_and(|s| s.distance < 0.0)).count()).sum();
            if debug { println!("     {} round {round} cons {} worst {:.3} moved {:.3} pairs {:?} inside {inside} own {}", garment.name, cons.len(), worst * 1e3, moved * 1e3, byl, own.len()); }
            if total == 0 && inside == 0 && moved < env("TOL", 3e-4) { done = true; }
        }
        if done { break; }
    }
    let _ = settled_rounds;
    finish(&mut report, &edges, &x0, &x);
    (report, x)
}

fn finish(r: &mut LayerReport, edges: &Edges, x0: &[Point], x: &[Point]) {
    let pct = |v: &mut Vec<Real>, q: Real| { v.sort_by(Real::total_cmp); if v.is_empty() { 0.0 } else { let f = q * (v.len() - 1) as Real; let i = f as usize; v[i] + (v[(i + 1).min(v.len() - 1)] - v[i]) * (f - i as Real) } };
    let mut d: Vec<Real> = x.iter().zip(x0).map(|(a, b)| (a - b).norm()).collect();
    r.moved.vertices = d.iter().filter(|d| **d > 0.0).count();
    r.moved.mean = d.iter().sum::<Real>() / d.len() as Real;
    r.moved.p95 = pct(&mut d, 0.95);
    r.moved.max = *d.last().unwrap();
    let l = |x: &[Point], e: &[u32; 2]| (x[e[0] as usize] - x[e[1] as usize]).norm();
    let mut s: Vec<Real> = edges.vertices.iter().map(|e| (l(x, e) / l(x0, e).max(1e-12) - 1.0).abs()).collect();
    r.strain.rms = (s.iter().map(|s| s * s).sum::<Real>() / s.len() as Real).sqrt();
    r.strain.p99 = pct(&mut s, 0.99);
    r.strain.max = *s.last().unwrap();
}
#[allow(unused)]
fn unused(_: &TriMesh) {}
