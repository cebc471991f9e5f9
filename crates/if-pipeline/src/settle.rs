//! lab
use crate::contacts::{Contacts, Obstacle, Sample};
use crate::retract::RetractedLayer;
use crate::outfit::Layer;
use crate::own::OwnContacts;
use crate::report::{LayerReport, Moved, Skipped, Strain};
use crate::resolve::ResolveParams;
use if_core::edges::{Edges, NONE};
use if_core::intersect::segment_triangle;
use if_core::math::{Point, Real};
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;
use if_mesh::solid::ClosedLayer;
use if_xpbd::attach::Attachments;
use if_xpbd::constraint::Constraint;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::half_space::HalfSpaces;
use if_xpbd::pair_contact::PairContacts;
use if_xpbd::separation::Separations;
use if_xpbd::stretch::Stretch;
use if_xpbd::tie::Ties;
use rayon::prelude::*;

fn env(k: &str, d: Real) -> Real { std::env::var(k).ok().and_then(|s| s.parse().ok()).unwrap_or(d) }

pub(crate) fn settle(garment: &Layer, below: &[(&str, &ClosedLayer)], tris: &[&[[u32; 3]]], params: &ResolveParams) -> (LayerReport, Vec<Point>) {
    let mesh = &garment.mesh;
    let x0 = mesh.vertices().to_vec();
    let mut x = x0.clone();
    let n = x.len();
    let edges = Edges::new(mesh);
    let mut tree = Bvh::new(mesh);
    let delta = params.clearance * env("CL", 1.0);
    let long = env("LONG", 8e-3);
    let sweeps = env("SWEEPS", 10.0) as usize;
    let max_rounds = env("ROUNDS", 60.0) as usize;
    let w = vec![1.0; n];
    let own = OwnContacts::new(mesh, &tree);
    let mut report = LayerReport { name: garment.name.clone(), moved: Moved::default(), strain: Strain::default(), own_pairs: [own.given(); 2], rounds: 0, repairs: 0, sweeps: 0, queries: 0, skipped: Skipped::default(), seconds: 0.0 };
    // depth
    let deep: Vec<Real> = below.iter().skip(1).map(|(_, l)| x.par_iter().filter_map(|p| l.sided(p, 0.0)).map(|s| -s.distance).collect::<Vec<_>>().into_iter().fold(0.0, Real::max)).collect();
    let deepest = deep.iter().copied().fold(0.0, Real::max);
    let dr = env("DR", 2.5e-3);
    let back = if deepest > 2e-3 && env("RETR", 1.0) > 0.0 { (1.2 * deepest + 3e-3).min(0.08) } else { 0.0 };
    let mut stages: Vec<Real> = (0..(back / dr).ceil() as usize).map(|k| back - k as Real * dr).collect();
    for _ in 0..env("EXTRA", 0.0) as usize { stages.push(0.0); }
    stages.reverse();
    let closed = || below.iter().enumerate().map(|(j, (_, l))| Obstacle::Closed(l, if j == 0 { vec![1.0; l.vertex_count()] } else { crate::retract::vertex_orientations(l.vertex_count(), tris[j - 1], &l.orientations()) })).collect::<Vec<_>>();
    let obstacles = if back > 0.0 { below.iter().enumerate().map(|(j, (_, l))| if j == 0 { Obstacle::Closed(l, vec![1.0; l.vertex_count()]) } else { Obstacle::Retracted(RetractedLayer::new(l, tris[j - 1], below[0].1, back, 2.5 * dr + 1e-3)) }).collect() } else { closed() };
    let mut contacts = Contacts::new(mesh, &edges, obstacles, long);
    let mut retracted = back > 0.0;
    let tt = std::time::Instant::now();
    let outward = if_mesh::outward::Outward::new(&below.iter().map(|b| b.1).collect::<Vec<_>>(), &mesh.aabb().inflated(0.03), env("OCELL", 6e-3));
    if std::env::var("D").is_ok() { println!("     outward {:.1} ms", tt.elapsed().as_secs_f64() * 1e3); }
    if !retracted && env("OUTW", 1.0) > 0.0 { contacts.outward = Some(&outward); }
    contacts.step = env("STEP", 4e-3);
    contacts.margin = env("MARGIN", 2e-3);
    let mut stretch = Stretch::new(EdgeSet::of_mesh(mesh), env("STR", 0.0));
    let bend = {
        let mut pairs = Vec::new();
        let mut rest = Vec::new();
        for (e, &[a, b]) in edges.vertices.iter().enumerate() {
            let [t, u] = edges.triangles[e];
            if u == NONE { continue; }
            let opp = |t: u32| mesh.triangles()[t as usize].into_iter().find(|v| *v != a && *v != b);
            if let (Some(c), Some(d)) = (opp(t), opp(u)) && c != d {
                pairs.push([c, d]);
                rest.push((x[c as usize] - x[d as usize]).norm());
            }
        }
        EdgeSet::new(&pairs, &rest, n).expect("edges")
    };
    let mut bend = Stretch::new(bend, env("BEND", 4.67));
    let mut attach = Attachments::new();
    for v in 0..n { attach.push(v as u32, x0[v], env("ATT", 500.0)); }
    let mut planes = HalfSpaces::new();
    let mut ties = Ties::new();
    let tier = env("TIER", 10e-3);
    let prox = own.proximity(&x, mesh.triangles(), &tree, tier);
    for &(v, t, b, d) in &prox { ties.push(v, mesh.triangles()[t as usize], b, env("TIEK", 0.7) * (1.0 - 0.7 * d / tier), &x); }
    if std::env::var("D").is_ok() { println!("     ties {}", ties.len()); }
    planes.max_push = env("PUSH", 2e-3);
    let mut extra_planes: Vec<(u32, if_core::math::Vector, Point)> = Vec::new();
    let mut age = std::collections::BTreeMap::new();
    let mut last_total = usize::MAX;
    let mut sep = Separations::new();
    let mut parted = std::collections::BTreeSet::new();
    let mut near = PairContacts::new();
    near.max_push = env("PUSH", 2e-3);
    let mut gap = vec![delta; n];
    let mut outer = vec![false; n];
    for &(v, t, b, _) in &prox {
        let tri = mesh.triangles()[t as usize];
        let q = if_core::math::barycentric_point(tri.map(|u| &x[u as usize]), b);
        if let Some(o) = outward.direction(&x[v as usize]) && (x[v as usize] - q).dot(&o) > 0.0 { outer[v as usize] = true; }
    }
    if env("STACK", 0.0) > 0.0 {
        let mut extra = vec![0.0f64; n];
        for _ in 0..4 {
            for &(v, t, b, _) in &prox {
                let tri = mesh.triangles()[t as usize];
                let q = if_core::math::barycentric_point(tri.map(|u| &x[u as usize]), b);
                let Some(o) = outward.direction(&x[v as usize]) else { continue };
                let h = (x[v as usize] - q).dot(&o);
                if h > 0.0 { extra[v as usize] = extra[v as usize].max((0..3).map(|k| b[k] * extra[tri[k] as usize]).sum::<Real>() + env("STACKK", 0.9) * h).min(15e-3); }
            }
        }
        for v in 0..n { gap[v] += extra[v]; }
    }
    let debug = std::env::var("D").is_ok();
    let tol = env("TOL", 3e-4);
    for round in 0..max_rounds {
        report.rounds = round + 1;
        if retracted {
            match stages.pop() {
                Some(r) => contacts.stand_back(r, dr),
                None => { retracted = false; let (q, s) = (contacts.queries, contacts.spared); contacts = Contacts::new(mesh, &edges, closed(), long); contacts.queries = q; if env("OUTW", 1.0) > 0.0 { contacts.outward = Some(&outward); } contacts.spared = s; contacts.step = env("STEP", 4e-3); contacts.margin = env("MARGIN", 2e-3); }
            }
        }
        let t0 = std::time::Instant::now();
        contacts.skip = if round < env("DEFER", 0.0) as usize { outer.clone() } else { vec![false; n] };
        contacts.detect(&x, mesh.triangles(), &tree, &gap, &mut planes);
        for (v, normal, point) in &extra_planes { planes.push_vertex(*v, *normal, point, env("PAIRGAP", 0.15e-3)); }
        let t1 = std::time::Instant::now();
        if !planes.is_empty() && env("OWNR", 8e-3) > 0.0 { own.detect(&x, mesh.triangles(), &tree, env("OWNR", 8e-3), 0.3e-3, &mut near); }
        let t2 = std::time::Instant::now();
        let mut wo = vec![1.0; n];
        for v in planes.vertices() { for k in v { wo[*k as usize] = env("SHOCK", 0.05); } }
        let start = x.clone();
        let mut worst = 0.0;
        for _ in 0..sweeps {
            attach.begin_substep(&start, &x, &w, 1.0);
            attach.project(&mut x, &w, 1.0);
            bend.begin_substep(&start, &x, &w, 1.0);
            bend.project(&mut x, &w, 1.0);
            stretch.begin_substep(&start, &x, &w, 1.0);
            stretch.project(&mut x, &w, 1.0);
            ties.project(&mut x, &wo, 1.0);
            for _ in 0..(if near.is_empty() && sep.is_empty() { 1 } else { 2 }) {
                worst = planes.project(&mut x, &w).max;
                near.project(&mut x, &wo);
                sep.project(&mut x, &w, 1.0);
            }
            report.sweeps += 1;
        }
        for _ in 0..3 { worst = planes.project(&mut x, &w).max; near.project(&mut x, &wo); sep.project(&mut x, &w, 1.0); if worst < 1e-6 { break; } }
        if debug && !retracted && worst > 1e-3 {
            let mut v: Vec<(Real, usize)> = (0..planes.len()).map(|k| (planes.clearance(k, &x), k)).collect();
            v.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (c, k) in v.iter().take(4) {
                let (vs, bs, nn) = planes.contact(*k);
                let p0 = Sample { vertices: vs, weights: bs }.at(&start);
                let p1 = Sample { vertices: vs, weights: bs }.at(&x);
                println!("       viol {:.2} n {:.2?} at ({:.3} {:.3} {:.3}) w {:.2?} v {:?} moved ({:.1} {:.1} {:.1}) d {:?}", c * 1e3, (nn.x, nn.y, nn.z), p0.x, p0.y, p0.z, bs, vs, (p1 - p0).x*1e3, (p1-p0).y*1e3, (p1-p0).z*1e3, below.iter().map(|(_, l)| l.sided(&p0, 0.02).map(|s| (s.distance * 1e4).round() / 10.0)).collect::<Vec<_>>());
            }
        }
        let t3 = std::time::Instant::now();
        let held = if near.is_empty() || env("FILTER", 1.0) == 0.0 { 0 } else { own.filter(mesh, &start, &mut x, &mut tree) };
        let moved = x.iter().zip(&start).map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        contacts.moved(moved);
        tree.refit(&x);
        let t4 = std::time::Instant::now();
        if debug && (round % 5 == 4 || retracted) { println!("     {} round {round} cons {} own {} held {held} worst {:.3} moved {:.3} | {:.1} {:.1} {:.1} {:.1} ms", garment.name, planes.len(), near.len(), worst * 1e3, moved * 1e3, (t1-t0).as_secs_f64()*1e3, (t2-t1).as_secs_f64()*1e3, (t3-t2).as_secs_f64()*1e3, (t4-t3).as_secs_f64()*1e3); }
        extra_planes.clear();
        let check = moved < tol || round % 5 == 4 || (round > 8 && last_total < 500);
        if check {
            let mut byl = vec![];
            let mut total = 0;
            for (_, l) in below {
                let ps = pairs(l.bvh(), &tree);
                total += ps.len();
                byl.push(ps.len());
                if env("PAIRP", 1.0) > 0.0 { for p in &ps {
                    let tri = mesh.triangles()[p.b as usize];
                    let t = tri.map(|v| x[v as usize]);
                    let mid = Point::from((t[0].coords + t[1].coords + t[2].coords) / 3.0);
                    let Some(out) = outward.direction(&mid).or_else(|| l.sided(&mid, 0.05).map(|s| s.normal)) else { continue };
                    let o = l.corners(p.a);
                    if let Some((n, level)) = crate::contacts::parting(&t, &o, &out) {
                        for v in tri { extra_planes.push((v, n, Point::from(n * level))); }
                    }
                } }
                for p in ps {
                    let tri = mesh.triangles()[p.b as usize];
                    let a = age.entry(p.b).or_insert(0u32);
                    *a += 1;
                    if *a > env("AGE", 4.0) as u32 { for v in tri { gap[v as usize] = (gap[v as usize] * env("INFL", 1.1)).min(0.03); } }
                    let _ = (segment_triangle, Sample { vertices: tri, weights: [0.0; 3] });
                }
            }
            let fresh = own.fresh(&mesh.with_vertices(x.clone()).expect("finite"), &tree);
            for [a, b] in &fresh { if parted.insert([*a, *b]) { sep.push(mesh.triangles()[*a as usize], mesh.triangles()[*b as usize], env("SEPGAP", 0.1e-3), &x0); } }
            let inside: usize = below.iter().map(|(_, l)| x.par_iter().filter(|p| l.sided(p, 0.0).is_some_and(|s| s.distance < 0.0)).count()).sum();
            last_total = total;
            if debug { println!("     {} round {round} pairs {:?} inside {inside} own {}", garment.name, byl, if_mesh::intersections::own_pairs(&mesh.with_vertices(x.clone()).unwrap(), &tree).len()); }
            if debug && round > 50 { for (name, l) in below { for (v, p) in x.iter().enumerate() { if let Some(s) = l.sided(p, 0.0) { if s.distance < 0.0 { println!("       inside {name} v {v} at ({:.3} {:.3} {:.3}) d {:.2} n ({:.2} {:.2} {:.2}) boundary {} voxel {:?} out {:?} neighbours d {:?}", p.x, p.y, p.z, s.distance * 1e3, s.normal.x, s.normal.y, s.normal.z, s.boundary, l.voxel(p), outward.direction(p).map(|d| [0,1,2].map(|k| (d[k] * 100.0).round() / 100.0)), edges.vertices.iter().filter(|e| e.contains(&(v as u32))).map(|e| { let o = if e[0] == v as u32 { e[1] } else { e[0] }; l.sided(&x[o as usize], 0.03).map(|s| (s.distance * 1e4).round() / 10.) }).collect::<Vec<_>>()); } } } } }
            if total == 0 && inside == 0 && fresh.is_empty() && round > env("DEFER", 0.0) as usize * usize::from(outer.iter().any(|o| *o)) { break; }
        }
    }
    report.queries = contacts.queries;
    report.skipped.queries = contacts.spared;
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
