//! Exact verification of one garment over the layers below, repeated while it settles: only
//! triangles and vertices that moved are checked again.

use crate::findings::new_pairs;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{
    MovedTriangles, TrianglePair, own_pairs, own_pairs_after_motion, pairs, pairs_after_motion,
};
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// What remains to be repaired, by exact verification.
pub(crate) struct Remaining {
    /// Intersecting pairs: (layer below, triangle pair).
    pub(crate) pairs: Vec<(usize, TrianglePair)>,
    /// Vertices inside a layer below.
    pub(crate) inside: Vec<u32>,
    /// Own intersecting pairs that the input did not have. Those of the input are allowed to stay.
    pub(crate) new_own: Vec<[u32; 2]>,
}

impl Remaining {
    pub(crate) fn is_clean(&self) -> bool {
        self.count() == 0
    }

    /// Number of pairs and vertices.
    pub(crate) fn count(&self) -> usize {
        self.pairs.len() + self.inside.len() + self.new_own.len()
    }

    /// The vertices of the pairs, and those inside.
    pub(crate) fn vertices(&self, triangles: &[[u32; 3]]) -> BTreeSet<u32> {
        let of_pairs = self.pairs.iter().flat_map(|(_, p)| triangles[p.b as usize]);
        let of_own = self.new_own.iter().flatten().flat_map(|t| triangles[*t as usize]);
        of_pairs.chain(of_own).chain(self.inside.iter().copied()).collect()
    }
}

/// Exact verification of one garment, with the results of the last one.
pub(crate) struct IncrementalVerification<'a> {
    below: &'a [&'a ClosedLayer],
    /// Own pairs of the input, sorted.
    given: Vec<[u32; 2]>,
    /// Vertices of triangles; others have no side.
    used: Vec<bool>,
    /// The positions of the last verification.
    verified: Vec<Point>,
    inside: Vec<bool>,
    /// Pairs with each layer below, and own ones, each sorted.
    pairs: Vec<Vec<TrianglePair>>,
    own: Vec<TrianglePair>,
}

/// Share of moved triangles beyond which all are checked: then that is faster.
const MANY: Real = 0.5;

impl<'a> IncrementalVerification<'a> {
    /// Verifies the input.
    pub(crate) fn new(
        mesh: &TriMesh,
        tree: &Bvh,
        below: &'a [&'a ClosedLayer],
    ) -> (Self, Remaining) {
        let n = mesh.vertices().len();
        let own = own_pairs(mesh, tree);
        let mut this = Self {
            below,
            given: own.iter().map(|p| [p.a, p.b]).collect(),
            used: mesh.used_vertices(),
            verified: mesh.vertices().to_vec(),
            inside: vec![false; n],
            pairs: all_pairs(below, tree),
            own,
        };
        let all = this.used.clone();
        this.update_sides(&all);
        let remaining = this.remaining();
        (this, remaining)
    }

    /// Verifies `mesh`, which `tree` holds.
    pub(crate) fn verify(&mut self, mesh: &TriMesh, tree: &Bvh) -> Remaining {
        let moved: Vec<bool> = mesh
            .vertices()
            .iter()
            .zip(&self.verified)
            .zip(&self.used)
            .map(|((p, verified), used)| *used && p != verified)
            .collect();
        self.verified.copy_from_slice(mesh.vertices());
        let triangles = MovedTriangles::new(mesh, &moved);
        if triangles.len() as Real > MANY * mesh.triangles().len() as Real {
            self.pairs = all_pairs(self.below, tree);
            self.own = own_pairs(mesh, tree);
        } else if !triangles.is_empty() {
            for (layer, pairs) in self.below.iter().zip(&mut self.pairs) {
                *pairs = pairs_after_motion(layer.bvh(), mesh, &triangles, pairs);
            }
            self.own = own_pairs_after_motion(mesh, tree, &triangles, &self.own);
        }
        self.update_sides(&moved);
        self.remaining()
    }

    fn update_sides(&mut self, moved: &[bool]) {
        let below = self.below;
        (&self.verified, moved, &mut self.inside).into_par_iter().with_min_len(128).for_each(
            |(p, moved, inside)| {
                if *moved {
                    *inside =
                        below.iter().any(|l| l.sided(p, 0.0).is_some_and(|s| s.distance < 0.0));
                }
            },
        );
    }

    fn remaining(&self) -> Remaining {
        let pairs = self
            .pairs
            .iter()
            .enumerate()
            .flat_map(|(j, found)| found.iter().map(move |p| (j, *p)))
            .collect();
        let inside = (0..self.inside.len() as u32).filter(|v| self.inside[*v as usize]).collect();
        let own: Vec<[u32; 2]> = self.own.iter().map(|p| [p.a, p.b]).collect();
        let new_own = new_pairs(&own, &self.given);
        Remaining { pairs, inside, new_own }
    }
}

/// The pairs of what `tree` holds with each layer, sorted.
fn all_pairs(below: &[&ClosedLayer], tree: &Bvh) -> Vec<Vec<TrianglePair>> {
    let with = |layer: &&ClosedLayer| {
        let mut found = pairs(layer.bvh(), tree);
        found.sort_unstable();
        found
    };
    below.iter().map(with).collect()
}
