//! Where the body yields: near its own overlaps only, unless a step cannot be made clean otherwise.

use super::scene::Scene;
use if_core::math::{Point, Real};
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs_with;
use if_mesh::point_tree::PointTree;
use rayon::prelude::*;

/// Inverse masses of a step: zero for what is held.
#[derive(Clone, Debug)]
pub(super) struct Yielding {
    pub(super) inverse_mass: Vec<f64>,
    /// Whether a vertex of the body is held.
    pub(super) is_local: bool,
}

impl Yielding {
    /// All vertices yield.
    pub(super) fn everywhere(scene: &Scene) -> Self {
        Self { inverse_mass: scene.inverse_mass.clone(), is_local: false }
    }

    /// The body yields within `reach` metres of the triangles in which it meets itself at
    /// `reference`, by their corners. `tree` has the shape of the body's rest state.
    pub(super) fn near_overlaps(
        scene: &Scene,
        reference: &[Point],
        tree: &Bvh,
        reach: Real,
    ) -> Self {
        let body = scene.layer_mesh(reference, 0);
        let mut tree = tree.clone();
        tree.refit(body.vertices());
        let met = own_pairs_with(&body, &tree, &scene.fans);
        let mut held = Self { inverse_mass: scene.inverse_mass.clone(), is_local: true };
        held.inverse_mass[..scene.starts[1]].fill(0.0);
        held.free_near(scene, reference, met.iter().flat_map(|p| [p.a, p.b]), reach);
        held
    }

    /// Vertices of the body within `reach` of the corners of some triangles yield, too.
    pub(super) fn free_near(
        &mut self,
        scene: &Scene,
        reference: &[Point],
        triangles: impl Iterator<Item = u32>,
        reach: Real,
    ) {
        let mut corners: Vec<u32> =
            triangles.flat_map(|t| scene.mesh.triangles()[t as usize]).collect();
        corners.sort_unstable();
        corners.dedup();
        let places: Vec<Point> = corners.iter().map(|v| reference[*v as usize]).collect();
        let is_near = near(&reference[..scene.starts[1]], &places, reach);
        for v in (0..is_near.len()).filter(|v| is_near[*v]) {
            self.inverse_mass[v] = scene.inverse_mass[v];
        }
    }
}

/// Which vertices lie within `reach` of one of the `places`.
pub(super) fn near(x: &[Point], places: &[Point], reach: Real) -> Vec<bool> {
    if places.is_empty() {
        return vec![false; x.len()];
    }
    let tree = PointTree::new(places);
    let is_near = |p: &Point| {
        let mut nearest = Vec::new();
        tree.nearest(p, 1, &mut nearest);
        nearest.first().is_some_and(|n| n.0 <= reach * reach)
    };
    x.par_iter().with_min_len(256).map(is_near).collect()
}
