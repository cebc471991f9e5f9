//! The proof of one state: exact intersections of all layers with one another and with themselves,
//! and sides by the nearest surface.

use super::scene::Scene;
use crate::findings::new_pairs;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{own_pairs, pairs};
use if_mesh::sdf::MeshSdf;
use rayon::prelude::*;

/// Distance up to which a vertex has a side of a layer below, in metres: as the project's referee.
const REACH: Real = 0.06;

/// What exact verification finds in one state.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Proof {
    /// Intersecting triangle pairs between layers.
    pub pairs: usize,
    /// Vertices on the wrong side of the surface of a layer below, once for each layer. A vertex
    /// whose nearest point lies on a boundary has no side.
    ///
    /// The closed layers of [`verify`](crate::verify()) also close the pockets that a pose makes, as
    /// in an armpit, where cloth lies on the right side.
    pub inside: usize,
    /// For each layer, the body first, its intersecting triangle pairs with itself.
    pub own_pairs: Vec<usize>,
    /// Own pairs that the rest state does not have.
    pub new_own_pairs: usize,
}

/// Verifies `positions` with trees of its own. `tolerated` are the own pairs of the rest state.
pub(super) fn prove(scene: &Scene, positions: &[Point], tolerated: &[[u32; 2]]) -> Proof {
    let layers: Vec<(TriMesh, Bvh)> = (0..scene.layers())
        .into_par_iter()
        .map(|layer| {
            let mesh = scene.layer_mesh(positions, layer);
            let tree = Bvh::new(&mesh);
            (mesh, tree)
        })
        .collect();
    let mut proof = Proof::default();
    for (k, (mesh, tree)) in layers.iter().enumerate() {
        let first = scene.triangle_starts[k] as u32;
        let own: Vec<[u32; 2]> =
            own_pairs(mesh, tree).iter().map(|p| [p.a + first, p.b + first]).collect();
        proof.own_pairs.push(own.len());
        proof.new_own_pairs += new_pairs(&own, tolerated).len();
        for (_, below) in &layers[..k] {
            proof.pairs += pairs(below, tree).len();
        }
    }
    for (below, (mesh, _)) in layers.iter().enumerate().take(scene.layers() - 1) {
        // An empty mesh is the only other error, and layers have triangles.
        let Ok(field) = MeshSdf::open(mesh, REACH) else { continue };
        let above = &positions[scene.starts[below + 1]..];
        let is_inside = |p: &&Point| field.signed(p).is_some_and(|s| s.distance < 0.0);
        proof.inside += above.par_iter().with_min_len(256).filter(is_inside).count();
    }
    proof
}
