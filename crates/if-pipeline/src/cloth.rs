//! lab prototype
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;

pub(crate) struct Cloth {
    springs: Vec<(u32, u32, Real, Real)>,
    pub(crate) own: Vec<OwnContact>,
}
pub(crate) struct Plane { pub v: [u32; 3], pub b: [Real; 3], pub n: Vector, pub d: Real }
pub(crate) struct OwnContact { pub v: [u32; 4], pub b: [Real; 4], pub side: Real, pub gap: Real, pub edge: bool }

impl Cloth {
    pub(crate) fn new(mesh: &TriMesh, bend: Real) -> Self {
        let e = Edges::new(mesh);
        let x = mesh.vertices();
        let len = |a: u32, b: u32| (x[a as usize] - x[b as usize]).norm();
        let mut s: Vec<(u32, u32, Real, Real)> = Vec::new();
        for (k, &[a, b]) in e.vertices.iter().enumerate() {
            s.push((a, b, len(a, b), 1.0));
            let [t, u] = e.triangles[k];
            if u != u32::MAX && bend > 0.0 {
                let opp = |t: u32| mesh.triangles()[t as usize].into_iter().find(|v| *v != a && *v != b).unwrap();
                let (c, d) = (opp(t), opp(u));
                if c != d { s.push((c, d, len(c, d), bend)); }
            }
        }
        // colour
        let n = x.len();
        let mut used: Vec<u64> = vec![0; n];
        let mut col: Vec<(u32, usize)> = Vec::new();
        for (k, c) in s.iter().enumerate() {
            let m = used[c.0 as usize] | used[c.1 as usize];
            let f = (!m).trailing_zeros().min(63);
            used[c.0 as usize] |= 1 << f;
            used[c.1 as usize] |= 1 << f;
            col.push((f, k));
        }
        col.sort();
        Self { springs: col.iter().map(|&(_, k)| s[k]).collect(), own: Vec::new() }
    }
    pub(crate) fn stretch(&self, x: &mut [Point], w: &[Real]) {
        for &(a, b, l, k) in &self.springs {
            let (a, b) = (a as usize, b as usize);
            let ws = w[a] + w[b];
            if ws == 0.0 { continue; }
            let d = x[b] - x[a];
            let len = d.norm();
            if len == 0.0 { continue; }
            let c = d * (k * (len - l) / (len * ws));
            x[a] += c * w[a];
            x[b] -= c * w[b];
        }
    }
    pub(crate) fn own(&self, x: &mut [Point], w: &[Real]) -> Real {
        let mut worst: Real = 0.0;
        for c in &self.own {
            let v = c.v.map(|v| v as usize);
            let p = v.map(|v| x[v]);
            let n = if c.edge { (p[1] - p[0]).cross(&(p[3] - p[2])) } else { (p[2] - p[1]).cross(&(p[3] - p[1])) };
            let l = n.norm();
            if l == 0.0 { continue; }
            let n = n * (c.side / l);
            let g: Real = (0..4).map(|k| c.b[k] * n.dot(&p[k].coords)).sum();
            let viol = c.gap - g;
            if viol <= 0.0 { continue; }
            worst = worst.max(viol);
            let s: Real = (0..4).map(|k| w[v[k]] * c.b[k] * c.b[k]).sum();
            if s == 0.0 { continue; }
            for k in 0..4 { x[v[k]] += n * (viol * w[v[k]] * c.b[k] / s); }
        }
        worst
    }
}
pub(crate) fn planes(c: &[Plane], x: &mut [Point], w: &[Real]) -> Real {
    let mut worst: Real = 0.0;
    for c in c {
        let v = c.v.map(|v| v as usize);
        let g: Real = (0..3).map(|k| c.b[k] * c.n.dot(&x[v[k]].coords)).sum::<Real>() - c.d;
        if g >= 0.0 { continue; }
        worst = worst.max(-g);
        let s: Real = (0..3).map(|k| w[v[k]] * c.b[k] * c.b[k]).sum();
        if s == 0.0 { continue; }
        for k in 0..3 { x[v[k]] += c.n * (-g * w[v[k]] * c.b[k] / s); }
    }
    worst
}
