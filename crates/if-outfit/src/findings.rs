//! What exact verification found of garments: the triangle pairs themselves. Algorithms decide on
//! these; reports are computed from them.

use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{Fans, TrianglePair, own_pairs_with};
use std::collections::BTreeSet;

/// One garment against one layer below it.
#[derive(Clone, Debug, Default)]
pub(crate) struct LayerFindings {
    /// Intersecting triangle pairs: of the layer below, of the garment.
    pub(crate) pairs: Vec<TrianglePair>,
    /// Number of vertices on the wrong side, without those that are [`alone`] there or lie in the open
    /// while no pair intersects.
    pub(crate) inside: usize,
    /// Depth of the deepest of them, in metres.
    pub(crate) deepest: Real,
}

impl LayerFindings {
    /// Whether no pair intersects and no vertex is on the wrong side.
    pub(crate) fn is_clean(&self) -> bool {
        self.pairs.is_empty() && self.inside == 0
    }
}

/// One garment against all layers below it, and against itself.
#[derive(Clone, Debug, Default)]
pub(crate) struct Findings {
    /// The body first, then the garments below, inner to outer.
    pub(crate) below: Vec<LayerFindings>,
    /// Pairs of its own triangles that intersect, sorted.
    pub(crate) own: Vec<[u32; 2]>,
}

impl Findings {
    /// Whether nothing intersects a layer below or is on the wrong side of it.
    pub(crate) fn is_clean(&self) -> bool {
        self.below.iter().all(LayerFindings::is_clean)
    }

    /// Own pairs that the garment did not have in the state `given`.
    pub(crate) fn new_own(&self, given: &Self) -> Vec<[u32; 2]> {
        new_pairs(&self.own, &given.own)
    }
}

/// The pairs of triangles of the mesh, which `tree` holds, that intersect, sorted.
pub(crate) fn own_of(mesh: &TriMesh, tree: &Bvh) -> Vec<[u32; 2]> {
    own_with(mesh, tree, &Fans::new(mesh))
}

/// As [`own_of`], with the fans of the mesh.
pub(crate) fn own_with(mesh: &TriMesh, tree: &Bvh, fans: &Fans) -> Vec<[u32; 2]> {
    own_pairs_with(mesh, tree, fans).iter().map(|p| [p.a, p.b]).collect()
}

/// Those of the own pairs `now` that `given`, sorted, does not have.
pub(crate) fn new_pairs(now: &[[u32; 2]], given: &[[u32; 2]]) -> Vec<[u32; 2]> {
    now.iter().filter(|pair| given.binary_search(pair).is_err()).copied().collect()
}

/// Of `inside`, vertices of `triangles` in ascending order, those that have triangles but no other of
/// `inside` in them. Where nothing intersects, they cannot have passed the surface: they lie in what
/// closes a layer.
pub(crate) fn alone(triangles: &[[u32; 3]], inside: &[usize]) -> BTreeSet<usize> {
    let (mut alone, mut joined) = (BTreeSet::new(), BTreeSet::new());
    if inside.is_empty() {
        return alone;
    }
    for triangle in triangles {
        let corners = triangle.iter().map(|v| *v as usize);
        let here: Vec<usize> = corners.filter(|v| inside.binary_search(v).is_ok()).collect();
        if here.len() > 1 { joined.extend(here) } else { alone.extend(here) }
    }
    &alone - &joined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alone_is_what_shares_no_triangle_with_another_and_has_one() {
        let triangles = [[0, 1, 2], [2, 1, 3], [3, 4, 5]];
        assert_eq!(alone(&triangles, &[0, 1, 4, 9]), BTreeSet::from([4]));
        assert_eq!(alone(&triangles, &[0, 3]), BTreeSet::from([0, 3]));
    }

    #[test]
    fn a_pair_in_place_of_another_is_new() {
        let with = |own: &[[u32; 2]]| Findings { own: own.to_vec(), ..Findings::default() };
        let given = with(&[[0, 4], [2, 3]]);
        assert_eq!(with(&[[2, 3], [5, 9]]).new_own(&given), [[5, 9]]);
        assert!(with(&[[2, 3]]).new_own(&given).is_empty());
    }
}
