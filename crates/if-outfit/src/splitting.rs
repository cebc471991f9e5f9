//! Splitting, the last resort: triangles too large for where they have to go become smaller ones.

use crate::dressing::Dressed;
use crate::findings::Findings;
use crate::outfit::{Layer, Outfit};
use crate::params::{ResolveParams, Split};
use if_core::edges::Edges;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::split::{self, split};

/// Maximum number of times that a triangle is split.
pub(crate) const ROUNDS: usize = 3;
/// Edge strain beyond which a triangle counts as too large, where its edges are long.
const STRAINED: Real = 0.5;
/// Edges that are to be split are longer than this many `long_edge`: none gets shorter than half of
/// it. Where cloth is that fine, smaller triangles are no help.
const LONG: Real = 2.0;

/// An outfit with some triangles split, and for each garment how.
pub(crate) type Finer = (Outfit, Vec<Option<split::SplitMesh>>);

/// The outfit with the triangles split that intersect in `dressed`, and for each garment how.
/// `given` is what was found in the outfit. `None` if no triangle is to be split.
pub(crate) fn finer(
    outfit: &Outfit,
    given: &[Findings],
    dressed: &[Dressed],
    params: &ResolveParams,
) -> Option<Finer> {
    let mut fine = outfit.clone();
    let mut splits = Vec::new();
    for (k, garment) in outfit.garments.iter().enumerate() {
        let edges = Edges::new(&garment.mesh);
        let mut bad = intersecting(&dressed[k], &given[k]);
        if bad.iter().any(|b| *b) || params.goal.split == Split::IfStrained {
            mark_strained(&garment.mesh, &dressed[k].mesh, &edges, &mut bad);
        }
        let long = LONG * params.effort.long_edge;
        let is_long = |e: u32| length(&garment.mesh, &edges, e) > long;
        // Cloth needs some room to follow.
        let marked = garment.mesh.with_neighbours(&bad);
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

/// For each triangle whether it still intersects a layer below, or newly one of its own garment.
fn intersecting(dressed: &Dressed, given: &Findings) -> Vec<bool> {
    let mut bad = vec![false; dressed.mesh.triangles().len()];
    let below = dressed.findings.below.iter().flat_map(|layer| &layer.pairs).map(|p| p.b);
    let own = dressed.findings.new_own(given).into_iter().flatten();
    below.chain(own).for_each(|t| bad[t as usize] = true);
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

/// With new vertices as a file stores them: the surface to start from is that of the file.
fn rounded(mut made: split::SplitMesh, garment: &Layer) -> split::SplitMesh {
    let old = garment.mesh.vertices();
    let mut stored = garment.storage.round(made.mesh.vertices());
    stored[..old.len()].copy_from_slice(old);
    made.mesh = made.mesh.with_vertices(stored).expect("rounded positions are finite");
    made
}
