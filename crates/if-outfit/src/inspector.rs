//! Exact verification of one garment over the layers below, again and again while it settles.

use crate::self_contact::GivenPairs;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{
    MovedTriangles, TrianglePair, own_pairs, own_pairs_after_motion, pairs, pairs_after_motion,
};
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// What exact verification found of the garment as it is.
pub(crate) struct State {
    /// Intersecting pairs: (layer below, triangle pair).
    pub(crate) pairs: Vec<(usize, TrianglePair)>,
    /// Vertices inside a layer below.
    pub(crate) inside: Vec<u32>,
    /// Own intersecting pairs that the input did not have.
    pub(crate) fresh: Vec<[u32; 2]>,
    /// Own intersecting pairs more than the input has.
    pub(crate) excess: usize,
}

impl State {
    pub(crate) fn is_clean(&self) -> bool {
        self.weight() == 0
    }

    pub(crate) fn weight(&self) -> usize {
        self.pairs.len() + self.inside.len() + self.excess
    }

    pub(crate) fn trouble(&self, triangles: &[[u32; 3]]) -> BTreeSet<u32> {
        let of_pairs = self.pairs.iter().flat_map(|(_, p)| triangles[p.b as usize]);
        let of_own = self.fresh.iter().flatten().flat_map(|t| triangles[*t as usize]);
        of_pairs.chain(of_own).chain(self.inside.iter().copied()).collect()
    }
}

/// Exact verification of one garment, again and again: what has not moved is not looked at twice.
pub(crate) struct Inspector<'a> {
    below: &'a [&'a ClosedLayer],
    given: GivenPairs,
    /// Vertices of triangles; others have no side.
    used: Vec<bool>,
    /// The positions of the last look.
    seen: Vec<Point>,
    inside: Vec<bool>,
    /// Pairs with each layer below, and own ones, each sorted.
    pairs: Vec<Vec<TrianglePair>>,
    own: Vec<TrianglePair>,
}

/// Share of the triangles beyond which all are looked at rather than those that have moved.
const MANY: Real = 0.5;

impl<'a> Inspector<'a> {
    /// Looks at the garment as it came.
    pub(crate) fn new(mesh: &TriMesh, tree: &Bvh, below: &'a [&'a ClosedLayer]) -> (Self, State) {
        let n = mesh.vertices().len();
        let own = own_pairs(mesh, tree);
        let mut this = Self {
            below,
            given: GivenPairs::new(&own),
            used: mesh.used_vertices(),
            seen: mesh.vertices().to_vec(),
            inside: vec![false; n],
            pairs: all_pairs(below, tree),
            own,
        };
        let all = this.used.clone();
        this.look_at_sides(&all);
        let state = this.state();
        (this, state)
    }

    /// Looks at the garment as it is now; `tree` holds it.
    pub(crate) fn inspect(&mut self, mesh: &TriMesh, tree: &Bvh) -> State {
        let moved: Vec<bool> = mesh
            .vertices()
            .iter()
            .zip(&self.seen)
            .zip(&self.used)
            .map(|((p, seen), used)| *used && p != seen)
            .collect();
        self.seen.copy_from_slice(mesh.vertices());
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
        self.look_at_sides(&moved);
        self.state()
    }

    fn look_at_sides(&mut self, moved: &[bool]) {
        let below = self.below;
        (&self.seen, moved, &mut self.inside).into_par_iter().with_min_len(128).for_each(
            |(p, moved, inside)| {
                if *moved {
                    *inside =
                        below.iter().any(|l| l.sided(p, 0.0).is_some_and(|s| s.distance < 0.0));
                }
            },
        );
    }

    fn state(&self) -> State {
        let pairs = self
            .pairs
            .iter()
            .enumerate()
            .flat_map(|(j, found)| found.iter().map(move |p| (j, *p)))
            .collect();
        let inside = (0..self.inside.len() as u32).filter(|v| self.inside[*v as usize]).collect();
        let (fresh, excess) = self.given.fresh(&self.own);
        State { pairs, inside, fresh, excess }
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
