//! The state before a step, and what is known of the states that its solves lead to.

use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{
    Fans, MovedTriangles, TrianglePair, own_pairs_after_motion, own_pairs_with,
};
use std::borrow::Cow;

/// The state before a step.
#[derive(Clone, Debug)]
pub(super) struct Clean {
    pub(super) x: Vec<Point>,
    pub(super) tree: Bvh,
    /// Whether all that intersects is known to be tolerated.
    pub(super) is_verified: bool,
}

impl Clean {
    /// What is known before a step: of pairs none, if all that intersects is tolerated.
    pub(super) fn known(&self) -> Known<'_> {
        let positions = self.is_verified.then_some(Cow::Borrowed(&self.x[..]));
        Known { positions, pairs: Vec::new() }
    }
}

/// Positions whose intersecting pairs are known.
pub(super) struct Known<'a> {
    /// `None` if nothing is known of any.
    positions: Option<Cow<'a, [Point]>>,
    /// The pairs, sorted; without those that are tolerated, where these are not needed.
    pub(super) pairs: Vec<TrianglePair>,
}

impl Known<'_> {
    /// Goes on to `mesh`, which `tree` holds: only triangles that have moved are compared again.
    pub(super) fn update(&mut self, mesh: &TriMesh, tree: &Bvh, fans: &Fans) {
        self.pairs = match &self.positions {
            None => own_pairs_with(mesh, tree, fans),
            Some(x) => {
                let moved: Vec<bool> =
                    mesh.vertices().iter().zip(&**x).map(|(a, b)| a != b).collect();
                let moved = MovedTriangles::new(mesh, &moved);
                own_pairs_after_motion(mesh, tree, fans, &moved, &self.pairs)
            }
        };
        self.positions = Some(Cow::Owned(mesh.vertices().to_vec()));
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::arm;
    use super::super::{WalkParams, Walker};
    use super::*;

    #[test]
    fn what_is_known_after_motions_is_what_a_new_search_finds() {
        let walker = Walker::new(&arm(), WalkParams::default()).unwrap();
        let (scene, rest) = (&walker.scene, walker.rest());
        let skin = scene.starts[1];
        // A patch of the sleeve goes through the skin, 6 mm below, and other patches after it.
        let pushed = |from: &[Point], low: f64| {
            let mut x = from.to_vec();
            let is_there = |p: &&mut Point| p.y > low && p.y < low + 0.08 && p.x > 0.03;
            x[skin..].iter_mut().filter(is_there).for_each(|p| p.x -= 9e-3);
            x
        };
        let mut known = walker.clean.known();
        assert!(known.pairs.is_empty());
        let (mut x, mut counts) = (rest.to_vec(), Vec::new());
        for low in [-0.05, -0.05, 0.05, -0.2] {
            x = pushed(&x, low);
            let mesh = scene.mesh.with_vertices(x.clone()).unwrap();
            let tree = Bvh::new(&mesh);
            known.update(&mesh, &tree, &scene.fans);
            assert_eq!(known.pairs, own_pairs_with(&mesh, &tree, &scene.fans), "{low}");
            counts.push(known.pairs.len());
        }
        assert!(counts[0] > 10 && counts.windows(2).all(|c| c[0] != c[1]), "{counts:?}");
    }
}
