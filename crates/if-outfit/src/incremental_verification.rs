//! Exact verification of one garment over the layers below, repeated while it settles: only
//! triangles and vertices that moved are checked again.

use crate::findings::new_pairs;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::index::{Bvh, Nearby};
use if_mesh::intersections::{
    Fans, MovedTriangles, TrianglePair, own_pairs_after_motion, own_pairs_with, pairs,
    pairs_after_motion,
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
    fans: Fans,
    /// Own pairs of the input, sorted.
    given: Vec<[u32; 2]>,
    /// Vertices of triangles, ascending; others have no side.
    used: Vec<u32>,
    /// The positions of the last verification.
    verified: Vec<Point>,
    inside: Vec<bool>,
    /// Pairs with each layer below, and own ones, each sorted.
    pairs: Vec<Vec<TrianglePair>>,
    own: Vec<TrianglePair>,
}

/// Share of moved triangles beyond which all are checked: then that is faster.
const MANY: Real = 0.5;
/// Vertices per task whose sides are found: those that moved lie together.
const MIN_TASK: usize = 32;
const MAX_TASK: usize = 128;

impl<'a> IncrementalVerification<'a> {
    /// Verifies the input.
    pub(crate) fn new(
        mesh: &TriMesh,
        tree: &Bvh,
        below: &'a [&'a ClosedLayer],
    ) -> (Self, Remaining) {
        let n = mesh.vertices().len();
        let fans = Fans::new(mesh);
        let own = || own_pairs_with(mesh, tree, &fans);
        let (pairs, own) = rayon::join(|| all_pairs(below, tree), own);
        let is_used = mesh.used_vertices();
        let mut this = Self {
            below,
            fans,
            given: own.iter().map(|p| [p.a, p.b]).collect(),
            used: (0..n as u32).filter(|v| is_used[*v as usize]).collect(),
            verified: mesh.vertices().to_vec(),
            inside: vec![false; n],
            pairs,
            own,
        };
        let mut nearby = vec![None; this.used.len() * below.len()];
        let sides = this.sides(&is_used, &mut nearby);
        this.set_sides(sides);
        let remaining = this.remaining();
        (this, remaining)
    }

    /// Verifies `mesh`, which `tree` holds. `nearby` are for each used vertex and each layer
    /// triangles near it, if they are known: sides are the same without them.
    pub(crate) fn verify(
        &mut self,
        mesh: &TriMesh,
        tree: &Bvh,
        nearby: &mut [Option<Box<Nearby>>],
    ) -> Remaining {
        let mut moved = vec![false; mesh.vertices().len()];
        for v in &self.used {
            moved[*v as usize] = mesh.vertices()[*v as usize] != self.verified[*v as usize];
        }
        self.verified.copy_from_slice(mesh.vertices());
        let triangles = MovedTriangles::new(mesh, &moved);
        let (below, fans, before) = (self.below, &self.fans, (&self.pairs, &self.own));
        let are_many = triangles.len() as Real > MANY * mesh.triangles().len() as Real;
        let others = || {
            if are_many {
                return all_pairs(below, tree);
            }
            let after = |(layer, before): (&&ClosedLayer, &Vec<TrianglePair>)| {
                pairs_after_motion(layer.bvh(), mesh, &triangles, before)
            };
            below.par_iter().zip(before.0).map(after).collect()
        };
        let own = || {
            if are_many {
                own_pairs_with(mesh, tree, fans)
            } else {
                own_pairs_after_motion(mesh, tree, fans, &triangles, before.1)
            }
        };
        if !triangles.is_empty() {
            let sides = || self.sides(&moved, nearby);
            let (sides, (pairs, own)) = rayon::join(sides, || rayon::join(others, own));
            (self.pairs, self.own) = (pairs, own);
            self.set_sides(sides);
        }
        self.remaining()
    }

    /// For each used vertex whether it is inside a layer below; those that have not `moved` are as
    /// before.
    fn sides(&self, moved: &[bool], nearby: &mut [Option<Box<Nearby>>]) -> Vec<bool> {
        let below = self.below;
        let is_inside = |(v, nearby): (&u32, &mut [Option<Box<Nearby>>])| {
            let (v, p) = (*v as usize, &self.verified[*v as usize]);
            let is_in = |(layer, nearby): (&&ClosedLayer, &mut Option<Box<Nearby>>)| {
                let sided = match nearby {
                    Some(nearby) => layer.sided_nearby(p, 0.0, None, (nearby, false)),
                    None => layer.sided(p, 0.0),
                };
                sided.is_some_and(|s| s.distance < 0.0)
            };
            if moved[v] { below.iter().zip(nearby).any(is_in) } else { self.inside[v] }
        };
        let of_vertices = self.used.par_iter().zip(nearby.par_chunks_mut(below.len()));
        of_vertices.with_min_len(MIN_TASK).with_max_len(MAX_TASK).map(is_inside).collect()
    }

    fn set_sides(&mut self, found: Vec<bool>) {
        for (v, is_inside) in self.used.iter().zip(found) {
            self.inside[*v as usize] = is_inside;
        }
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
    below.par_iter().map(with).collect()
}
