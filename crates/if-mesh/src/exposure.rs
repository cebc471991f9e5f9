//! Points in the open: what is certainly not between a body and a layer of clothes over it.
//!
//! Where a pose presses a layer into a fold of the body, as at a raised thigh, the nearest surface may face
//! the wrong way, and the fold is no wider than the voxels that close the layer. Two other witnesses do not
//! depend on what is near:
//!
//! ```text
//! winding   the winding number of the layer, with a fan over each opening, is 0
//! sight     a share of all directions leads out without meeting the body or the layer
//! ```
//!
//! Each errs alone: the fan over a collar that is folded down lies below its stand, and near an opening one
//! sees out.
//!
//! # Source
//!
//! Winding numbers: Jacobson et al. 2013.

use crate::body_surface::fanned;
use crate::index::Bvh;
use crate::winding::Winding;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use std::f64::consts::PI;

/// Directions that are looked in.
const DIRECTIONS: usize = 256;
/// Directions that must lead out. Of points 5 mm under the cloth of posed outfits half see out in none of
/// 512 (`benches/peers/sides.py`).
const LEAST: usize = 8;
/// Winding number from which on a point is under the layer. With its openings closed it is a whole number,
/// but for the error of [`Winding`].
const UNDER: Real = 0.5;

/// A layer of clothes and the body under it.
#[derive(Clone, Debug)]
pub struct Exposure<'a> {
    winding: Winding,
    occluders: [&'a Bvh; 2],
    /// As long as the whole scene.
    ways: Vec<Vector>,
}

impl<'a> Exposure<'a> {
    /// Takes a layer and the trees of its triangles and of the body's.
    pub fn new(mesh: &TriMesh, layer: &'a Bvh, body: &'a Bvh) -> Self {
        let reach = 2.0 * layer.aabb().merged(&body.aabb()).diagonal();
        // Points of equal area on a sphere, turned by the golden angle.
        let way = |k: usize| {
            let height = 1.0 - (2.0 * k as Real + 1.0) / DIRECTIONS as Real;
            let (turn, radius) =
                (PI * (3.0 - Real::sqrt(5.0)) * k as Real, (1.0 - height * height).sqrt());
            Vector::new(radius * turn.cos(), radius * turn.sin(), height) * reach
        };
        Self {
            winding: Winding::new(&fanned(mesh)),
            occluders: [layer, body],
            ways: (0..DIRECTIONS).map(way).collect(),
        }
    }

    /// Whether `p`, within the box around the layer and the body, lies in the open.
    pub fn is_exposed(&self, p: &Point) -> bool {
        let leads_out = |way: &&Vector| {
            self.occluders.iter().all(|tree| tree.first_hit(p, &(p + **way), |_| true).is_none())
        };
        self.winding.at(p) < UNDER
            && self.ways.iter().filter(leads_out).take(LEAST).count() == LEAST
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::ClosedLayer;
    use if_core::shapes::meshes::tube;

    /// A tube along y about the origin.
    fn about(radius: Real, length: Real, is_closed: bool) -> TriMesh {
        let tube = tube(radius, length, 64, 48, is_closed);
        let vertices = tube.vertices().iter().map(|p| p - Vector::y() * (0.5 * length)).collect();
        tube.with_vertices(vertices).unwrap()
    }

    fn torso() -> TriMesh {
        about(0.1, 1.6, true)
    }

    fn is_exposed(body: &TriMesh, layer: &TriMesh, x: Real, y: Real) -> bool {
        let (layer_tree, body_tree) = (Bvh::new(layer), Bvh::new(body));
        Exposure::new(layer, &layer_tree, &body_tree).is_exposed(&Point::new(x, y, 0.0))
    }

    #[test]
    fn under_cloth_nothing_is_exposed_though_it_sees_out_beside_a_hem() {
        let (body, shirt) = (torso(), about(0.12, 0.6, false));
        for y in [0.0, 0.25, 0.295] {
            assert!(!is_exposed(&body, &shirt, 0.11, y), "{y}");
            assert!(is_exposed(&body, &shirt, 0.125, y), "{y}");
        }
        assert!(is_exposed(&body, &shirt, 0.11, 0.305), "beyond the hem");
    }

    #[test]
    fn behind_a_folded_collar_nothing_is_exposed_but_at_the_opening() {
        let straight = about(0.11, 0.6, false);
        let fold = |p: &Point| {
            let over = p.y - 0.2;
            let r = if over > 0.0 { 0.12 / 0.11 } else { 1.0 };
            Point::new(p.x * r, 0.2 - over.abs(), p.z * r)
        };
        let shirt = straight.vertices().iter().map(fold).collect();
        let shirt = straight.with_vertices(shirt).unwrap();
        let winding = Winding::new(&fanned(&shirt));
        // The fan lies at the edge of the collar, 10 cm below the fold.
        assert!(winding.at(&Point::new(0.105, 0.15, 0.0)) < UNDER);
        assert!(winding.at(&Point::new(0.105, 0.05, 0.0)) > UNDER);
        for (x, y, expected) in
            [(0.105, 0.15, false), (0.105, 0.05, false), (0.105, 0.198, true), (0.125, 0.15, true)]
        {
            assert_eq!(is_exposed(&torso(), &shirt, x, y), expected, "{x} {y}");
        }
    }

    #[test]
    fn between_cloth_and_another_limb_is_the_open() {
        let (trunk, shirt) = (torso(), about(0.12, 0.6, false));
        // An arm beside the shirt, 8 mm away from it.
        let arm = about(0.05, 0.5, true);
        let n = trunk.vertices().len() as u32;
        let beside = arm.vertices().iter().map(|p| p + Vector::x() * 0.178);
        let vertices = trunk.vertices().iter().copied().chain(beside).collect();
        let of_arm = arm.triangles().iter().map(|t| t.map(|v| v + n));
        let body =
            TriMesh::new(vertices, trunk.triangles().iter().copied().chain(of_arm).collect());
        let body = body.unwrap();
        let layer = ClosedLayer::garment(&shirt, &ClosedLayer::body(&body), &body);
        let between = Point::new(0.124, 0.05, 0.0);
        assert!(layer.sided(&between, 0.0).is_some_and(|s| s.distance < 0.0), "voxels err there");
        assert!(is_exposed(&body, &shirt, between.x, between.y));
        assert!(!is_exposed(&body, &shirt, 0.116, between.y));
    }
}
