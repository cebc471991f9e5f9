//! The last resort: triangles too large for where they have to go are split.

use crate::outfit::{Layer, Outfit};
use crate::resolve::{ResolveParams, Resolved, Split};
use if_core::edges::Edges;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{own_pairs, pairs};
use if_mesh::split::{self, split};

/// A triangle is split at most so often.
pub(crate) const ROUNDS: usize = 3;
/// Edge strain beyond which a triangle counts as too large, where its edges are long.
const STRAINED: Real = 0.5;
/// Edges that are to be split are longer than this many `long_edge`: none gets shorter than half of
/// it. Where cloth is that fine, smaller triangles are no help.
const LONG: Real = 2.0;

/// The outfit with the triangles split that gave trouble in `resolved`, and for each garment how,
/// or nothing where there are none.
pub(crate) fn finer(
    outfit: &Outfit,
    resolved: &Resolved,
    params: &ResolveParams,
) -> Option<(Outfit, Vec<Option<split::Split>>)> {
    let mut fine = outfit.clone();
    let mut splits = Vec::new();
    for (k, garment) in outfit.garments.iter().enumerate() {
        let after = &resolved.outfit.garments[k].mesh;
        let edges = Edges::new(&garment.mesh);
        let mut bad = in_the_way(resolved, k);
        let left = bad.iter().any(|b| *b);
        if left || params.split == Split::IfStrained {
            mark_strained(&garment.mesh, after, &edges, &mut bad);
        }
        let long = LONG * params.long_edge;
        let is_long = |e: u32| length(&garment.mesh, &edges, e) > long;
        let marked = with_neighbours(&garment.mesh, &bad);
        let marked: Vec<bool> = (0..bad.len())
            .map(|t| marked[t] && edges.of_triangle[t].iter().any(|e| is_long(*e)))
            .collect();
        let made = marked.iter().any(|m| *m).then(|| split(&garment.mesh, &marked).ok()).flatten();
        splits.push(made.map(|made| {
            let made = rounded(made, garment);
            fine.garments[k].mesh = made.mesh.clone();
            made
        }));
    }
    splits.iter().any(Option::is_some).then_some((fine, splits))
}

fn length(mesh: &TriMesh, edges: &Edges, e: u32) -> Real {
    let [a, b] = edges.vertices[e as usize].map(|v| mesh.vertices()[v as usize]);
    (a - b).norm()
}

/// For each triangle of garment `k` whether it still meets one below, or newly one of its own.
fn in_the_way(resolved: &Resolved, k: usize) -> Vec<bool> {
    let (outfit, report) = (&resolved.outfit, &resolved.report);
    let garment = &outfit.garments[k];
    let mut bad = vec![false; garment.mesh.triangles().len()];
    let tree = Bvh::new(&garment.mesh);
    for below in outfit.layers().take(k + 1) {
        let meets = |p: &&crate::report::PairReport| {
            p.outer == garment.name && p.inner == below.name && !p.is_clean()
        };
        if report.after.pairs.iter().find(meets).is_some() {
            pairs(&Bvh::new(&below.mesh), &tree).iter().for_each(|p| bad[p.b as usize] = true);
        }
    }
    if report.layers[k].own_pairs[1] > report.layers[k].own_pairs[0] {
        own_pairs(&garment.mesh, &tree)
            .iter()
            .for_each(|p| [p.a, p.b].iter().for_each(|t| bad[*t as usize] = true));
    }
    bad
}

fn mark_strained(before: &TriMesh, after: &TriMesh, edges: &Edges, bad: &mut [bool]) {
    let strained: Vec<bool> = (0..edges.len() as u32)
        .map(|e| (length(after, edges, e) / length(before, edges, e) - 1.0).abs() > STRAINED)
        .collect();
    for (t, of) in edges.of_triangle.iter().enumerate() {
        bad[t] |= of.iter().any(|e| strained[*e as usize]);
    }
}

/// The triangles, and all that share a vertex with one: cloth needs some room to follow.
fn with_neighbours(mesh: &TriMesh, bad: &[bool]) -> Vec<bool> {
    let mut near = vec![false; mesh.vertices().len()];
    for (tri, _) in mesh.triangles().iter().zip(bad).filter(|(_, b)| **b) {
        tri.iter().for_each(|v| near[*v as usize] = true);
    }
    mesh.triangles().iter().map(|tri| tri.iter().any(|v| near[*v as usize])).collect()
}

/// With new vertices as a file stores them: the surface to start from is that of the file.
fn rounded(mut made: split::Split, garment: &Layer) -> split::Split {
    let old = garment.mesh.vertices();
    let mut stored = garment.storage.round(made.mesh.vertices());
    stored[..old.len()].copy_from_slice(old);
    made.mesh = made.mesh.with_vertices(stored).expect("rounded positions are finite");
    made
}
