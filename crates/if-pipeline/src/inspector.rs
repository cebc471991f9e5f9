//! Exact verification of one garment over the layers below, again and again while it settles.

use crate::own::GivenPairs;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{TrianglePair, pairs};
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

/// Exact verification of one garment, again and again: the side of a vertex that has not moved is not
/// asked for twice.
pub(crate) struct Inspector<'a> {
    below: &'a [&'a ClosedLayer],
    given: GivenPairs,
    seen: Vec<Point>,
    inside: Vec<bool>,
}

impl<'a> Inspector<'a> {
    pub(crate) fn new(mesh: &TriMesh, tree: &Bvh, below: &'a [&'a ClosedLayer]) -> Self {
        let nowhere = Point::new(Real::NAN, Real::NAN, Real::NAN);
        let n = mesh.vertices().len();
        Self { below, given: GivenPairs::new(mesh, tree), seen: vec![nowhere; n], inside: vec![false; n] }
    }

    pub(crate) fn inspect(&mut self, mesh: &TriMesh, tree: &Bvh) -> State {
        let below = self.below;
        let found = below.iter().enumerate().flat_map(|(j, l)| pairs(l.bvh(), tree).into_iter().map(move |p| (j, p))).collect();
        (mesh.vertices(), &mut self.seen, &mut self.inside).into_par_iter().with_min_len(128).for_each(|(p, seen, inside)| {
            if p != seen {
                *seen = *p;
                *inside = below.iter().any(|l| l.sided(p, 0.0).is_some_and(|s| s.distance < 0.0));
            }
        });
        let inside = (0..self.inside.len() as u32).filter(|v| self.inside[*v as usize]).collect();
        let (fresh, excess) = self.given.fresh(mesh, tree);
        State { pairs: found, inside, fresh, excess }
    }
}
