//! lab
#![allow(clippy::print_stdout)]
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_pipeline::outfit::{Layer, Outfit};
fn load(p: &str) -> TriMesh {
    let b = std::fs::read(p).expect(p);
    let n = |k: usize| u32::from_le_bytes(b[k..k + 4].try_into().unwrap());
    let (nv, nf) = (n(0) as usize, n(4) as usize);
    let f = |k: usize| f64::from_le_bytes(b[8 + 8 * k..16 + 8 * k].try_into().unwrap());
    let v = (0..nv).map(|i| Point::new(f(3 * i), f(3 * i + 1), f(3 * i + 2))).collect();
    let t = (0..nf).map(|i| [0, 1, 2].map(|k| n(8 + 24 * nv + 12 * i + 4 * k))).collect();
    TriMesh::new(v, t).unwrap()
}
fn save(p: &str, m: &TriMesh) {
    let mut s = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nelement face {}\nproperty list uint8 int32 vertex_indices\nend_header\n", m.vertices().len(), m.triangles().len()).into_bytes();
    for v in m.vertices() { for k in 0..3 { s.extend(v[k].to_le_bytes()); } }
    for t in m.triangles() { s.push(3); for k in 0..3 { s.extend((t[k] as i32).to_le_bytes()); } }
    std::fs::write(p, s).unwrap();
}
fn table(v: &if_pipeline::report::Verification) {
    for p in &v.pairs { println!("   {:>14} over {:<14} pairs {:>6} inside {:>5} deepest {:.2}", p.outer, p.inner, p.pairs.total(), p.vertices_inside, p.deepest * 1e3); }
    println!("   own {:?}  {:.0} ms", v.own_pairs, v.seconds * 1e3);
}
fn main() {
    if std::env::var("D").is_ok() { tracing_subscriber::fmt().with_max_level(tracing::Level::DEBUG).without_time().init(); }
    let want: Vec<String> = std::env::args().skip(1).collect();
    let verbose = std::env::var("V").is_ok();
    for b in ["body_a", "body_b"] {
        let d = format!("/work/scratch/labdata/{b}");
        for line in std::fs::read_to_string(format!("{d}/outfits.txt")).unwrap().lines() {
            let w: Vec<&str> = line.split(' ').collect();
            if !want.is_empty() && !want.iter().any(|x| w[0].starts_with(x.as_str())) { continue; }
            let outfit = Outfit::new(Layer::new("body", load(&format!("{d}/body_clean.raw"))), w[1..].iter().map(|g| Layer::new(*g, load(&format!("{d}/{g}.raw")))).collect()).unwrap();
            println!("{line}");
            let t = std::time::Instant::now();
            let mut params = if_pipeline::resolve::ResolveParams::default();
            if let Ok(p) = std::env::var("P") { let mut v = serde_json::to_value(&params).unwrap(); for kv in p.split(',') { let (k, x) = kv.split_once('=').unwrap(); assert!(v.get(k).is_some(), "{k}"); v[k] = serde_json::from_str(x).unwrap(); } params = serde_json::from_value(v).unwrap(); }
            let r = if_pipeline::resolve::resolve(&outfit, &params, &mut |_| std::ops::ControlFlow::Continue(()));
            let s = t.elapsed().as_secs_f64();
            let r = match r { Ok(r) => r, Err(if_pipeline::resolve::ResolveError::Remaining { result, .. }) => { println!("   REMAINING"); *result } Err(e) => { println!("   {e}"); continue } };
            if verbose { table(&r.report.before); }
            table(&r.report.after);
            for l in &r.report.layers { println!("   {:>14}: moved {:.2}/{:.2}/{:.1} strain {:.2}/{:.2}/{:.0}% own {:?} rounds {} repairs {} sweeps {} q {} {:.0} ms", l.name, l.moved.mean*1e3, l.moved.p95*1e3, l.moved.max*1e3, l.strain.rms*100., l.strain.p99*100., l.strain.max*100., l.own_pairs, l.rounds, l.repairs, l.sweeps, l.queries, l.seconds*1e3); }
            println!("   total {:.2} s, pairs {}", s, r.report.after.total_pairs());
            let o = format!("/work/scratch/labout/{}", w[0]);
            std::fs::create_dir_all(&o).unwrap();
            for l in &r.outfit.garments { save(&format!("{o}/{}.ply", l.name), &l.mesh); }
        }
    }
}
