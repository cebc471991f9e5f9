//! What [`if_outfit::resolve::resolve`] is compared with: simpler ways to bring one garment outside
//! the layers below it.
//!
//! | baseline | file |
//! |---|---|
//! | one push of every vertex to φ = 0 | [`push::naive`] |
//! | pushes to a gap that grows until exact verification finds nothing | [`push::inflated`] |
//! | a Laplacian solve with pushed targets | [`laplacian::deform`] |
//! | Algorithm 1, literal or corrected, over the masked field of the clothed body | [`algorithm1::run`] |
//!
//! All take the garment as it came and return positions. None looks at the garment's intersections
//! with itself. The union of the layers below is [`if_mesh::solid::ClothedField`].

pub mod algorithm1;
pub mod laplacian;
pub mod push;

use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{TrianglePair, pairs};
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;

/// What exact verification finds of a garment against the layers below it.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Left {
    /// Intersecting triangle pairs: the number of the layer below, then its triangle and the
    /// garment's.
    pub pairs: Vec<(usize, TrianglePair)>,
    /// Vertices on the wrong side of a layer below.
    pub inside: Vec<u32>,
}

impl Left {
    /// Verifies the garment with the positions of `mesh`.
    pub fn new(mesh: &TriMesh, below: &[&ClosedLayer]) -> Self {
        let tree = Bvh::new(mesh);
        let found = below
            .iter()
            .enumerate()
            .flat_map(|(k, l)| pairs(l.bvh(), &tree).into_iter().map(move |p| (k, p)));
        let is_inside =
            |p: &Point| below.iter().any(|l| l.sided(p, 0.0).is_some_and(|s| s.distance < 0.0));
        let numbered = mesh.vertices().par_iter().enumerate().with_min_len(256);
        let inside = numbered.filter(|(_, p)| is_inside(p)).map(|(v, _)| v as u32).collect();
        Self { pairs: found.collect(), inside }
    }

    /// Nothing is left.
    pub fn is_clean(&self) -> bool {
        self.pairs.is_empty() && self.inside.is_empty()
    }
}

#[cfg(test)]
pub(crate) mod scene {
    //! A ball, and a tube round its equator that goes through it.

    use if_core::math::{Point, Real};
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::{icosphere, tube};
    use if_mesh::solid::ClosedLayer;

    /// Radius of the ball, in metres.
    pub(crate) const RADIUS: Real = 0.2;

    pub(crate) fn ball() -> ClosedLayer {
        ClosedLayer::body(&icosphere(RADIUS, 4))
    }

    /// 0.16 m high about the equator. Its radius is 5 mm less than the ball's, so that its middle
    /// is inside.
    pub(crate) fn belt() -> TriMesh {
        let open = tube(RADIUS - 0.005, 0.16, 60, 8, false);
        let lowered = open.vertices().iter().map(|p| Point::new(p.x, p.y - 0.08, p.z)).collect();
        open.with_vertices(lowered).unwrap()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_of_the_scene_is_what_one_expects() {
        let (ball, belt) = (scene::ball(), scene::belt());
        let left = Left::new(&belt, &[&ball]);
        // 195 mm from the axis a ball of 200 mm ends 44 mm above the equator: the rings at 0, ±20
        // and ±40 mm.
        assert_eq!(left.inside.len(), 5 * 60);
        assert!(!left.pairs.is_empty() && !left.is_clean());
        assert!(Left::new(&belt, &[]).is_clean());
    }
}
