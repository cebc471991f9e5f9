//! Points in the open: what is certainly not between a body and a garment over it.
//!
//! Where a pose presses a garment into a fold of the body, as at a raised thigh, the nearest surface may face
//! the wrong way, and the fold is no wider than the voxels that close the garment. Sight does not depend on
//! what is near: a point from which straight ways lead out that meet neither the garment nor the body, nor
//! the curtains and caps that close the openings, lies outside of what they enclose.
//!
//! One way would do but for two reasons: a ray may slip through an edge, and into the top of a collar that is
//! folded down one sees from above, as its edge, and so its curtain, is on the other side.
//!
//! Cloth with thickness has no edge that a curtain could hang from. Under it, nothing counts as in the open.

use super::ClosedLayer;
use super::closing::{caps, curtains_and_caps};
use crate::index::Bvh;
use crate::sheet::Sheet;
use if_core::edges::{Edges, parts};
use if_core::math::{Point, Real, Vector, area_vector};
use if_core::mesh::TriMesh;
use std::f64::consts::PI;

/// Directions that are looked in, evenly around a point.
const DIRECTIONS: usize = 256;
/// Every so many-th direction is tried first: if none of these leads out, the others are not tried.
const FIRST: usize = 4;
/// Directions that must lead out. Of points 5 mm under the cloth of posed outfits half see out in none of
/// 512, without curtains (`benches/peers/sides.py`).
const LEAST: usize = 8;
/// Share of the area of a garment up to which parts of it may have no edge, such as buttons.
const WITHOUT_EDGE: Real = 0.1;

/// What hides points under a garment.
#[derive(Clone, Debug)]
pub struct Exposure<'a> {
    garment: &'a Bvh,
    body: &'a Bvh,
    closing: Bvh,
    /// As long as the whole scene.
    ways: Vec<Vector>,
    /// Whether openings are not closed: of cloth with thickness.
    is_blind: bool,
}

impl<'a> Exposure<'a> {
    /// Takes a garment and its tree, over `body`.
    pub fn new(mesh: &TriMesh, garment: &'a Bvh, body: &'a ClosedLayer) -> Self {
        let edges = Edges::new(mesh);
        let sheet = Sheet::new(mesh, &edges);
        Self::closed_by(curtains_and_caps(&sheet, body), &sheet, garment, body)
    }

    /// As [`new`](Self::new) without curtains, for garments that followed the body from a pose in which
    /// nothing was under them: from a hem in a fold a curtain leads to the limb that lies against it.
    pub fn in_pose(mesh: &TriMesh, garment: &'a Bvh, body: &'a ClosedLayer) -> Self {
        let edges = Edges::new(mesh);
        let sheet = Sheet::new(mesh, &edges);
        Self::closed_by(caps(&sheet, body), &sheet, garment, body)
    }

    fn closed_by(
        closing: Vec<[Point; 3]>,
        sheet: &Sheet,
        garment: &'a Bvh,
        body: &'a ClosedLayer,
    ) -> Self {
        let corners: Vec<Point> = closing.into_iter().flatten().collect();
        let triangles = (0..corners.len() as u32 / 3).map(|k| [0, 1, 2].map(|c| 3 * k + c));
        let closing = TriMesh::new(corners, triangles.collect());
        let closing = Bvh::new(&closing.expect("points of a garment and its body are finite"));
        let reach = 2.0 * garment.aabb().merged(&body.bvh.aabb()).diagonal();
        // Each has an equal share of the sphere, and is turned by the golden angle.
        let way = |k: usize| {
            let height = 1.0 - (2.0 * k as Real + 1.0) / DIRECTIONS as Real;
            let (turn, radius) =
                (PI * (3.0 - Real::sqrt(5.0)) * k as Real, (1.0 - height * height).sqrt());
            Vector::new(radius * turn.cos(), radius * turn.sin(), height) * reach
        };
        let ways = (0..DIRECTIONS).map(way).collect();
        let is_blind = area_without_edge(sheet) > WITHOUT_EDGE * sheet.mesh.area();
        Self { garment, body: &body.bvh, closing, ways, is_blind }
    }

    /// Whether `p` lies in the open.
    pub fn is_exposed(&self, p: &Point) -> bool {
        let leads_out = |way: &&Vector| {
            let to = p + **way;
            ![self.garment, &self.closing, self.body].iter().any(|tree| tree.is_hit(p, &to))
        };
        !self.is_blind
            && self.ways.iter().step_by(FIRST).any(|way| leads_out(&way))
            && self.ways.iter().filter(leads_out).take(LEAST).count() == LEAST
    }
}

/// The area of the parts that have no boundary.
fn area_without_edge(Sheet { mesh, edges, .. }: &Sheet) -> Real {
    let part_of = parts(mesh);
    let mut has_edge = vec![false; mesh.vertices().len()];
    let boundary = edges.vertices.iter().zip(&edges.valence).filter(|(_, n)| **n == 1);
    boundary.for_each(|([a, _], _)| has_edge[part_of[*a as usize] as usize] = true);
    let closed = mesh.triangles().iter().filter(|t| !has_edge[part_of[t[0] as usize] as usize]);
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| &mesh.vertices()[v as usize]);
        0.5 * area_vector(a, b, c).norm()
    };
    closed.map(area).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes::tube;

    /// A tube along y about the origin.
    fn about(radius: Real, length: Real, is_closed: bool) -> TriMesh {
        let tube = tube(radius, length, 72, 48, is_closed);
        let vertices = tube.vertices().iter().map(|p| p - Vector::y() * (0.5 * length)).collect();
        tube.with_vertices(vertices).unwrap()
    }

    fn torso() -> TriMesh {
        about(0.1, 1.6, true)
    }

    /// The triangles of both, those of `other` moved along x, and wound the other way if `is_turned`.
    fn united(mesh: &TriMesh, other: &TriMesh, x: Real, is_turned: bool) -> TriMesh {
        let n = mesh.vertices().len() as u32;
        let moved = other.vertices().iter().map(|p| p + Vector::x() * x);
        let vertices = mesh.vertices().iter().copied().chain(moved).collect();
        let turn = |[a, b, c]: [u32; 3]| if is_turned { [a, c, b] } else { [a, b, c] };
        let others = other.triangles().iter().map(|t| turn(t.map(|v| v + n)));
        TriMesh::new(vertices, mesh.triangles().iter().copied().chain(others).collect()).unwrap()
    }

    fn is_exposed(body: &TriMesh, garment: &TriMesh, [x, y]: [Real; 2]) -> bool {
        let (tree, body) = (Bvh::new(garment), ClosedLayer::body(body));
        Exposure::new(garment, &tree, &body).is_exposed(&Point::new(x, y, 0.0))
    }

    #[test]
    fn under_a_garment_nothing_is_in_the_open_however_it_is_wound() {
        let shirt = about(0.12, 0.6, false);
        let turned = shirt.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let inwards = TriMesh::new(shirt.vertices().to_vec(), turned).unwrap();
        // Open in front of x > 0, by 40 degrees: hem, fronts and neck are one loop.
        let is_kept = |t: &[u32; 3]| {
            let middle = t.map(|v| shirt.vertices()[v as usize].coords).iter().sum::<Vector>();
            middle.z.atan2(-middle.x).abs() < 160_f64.to_radians()
        };
        let kept = shirt.triangles().iter().copied().filter(is_kept).collect();
        let jacket = TriMesh::new(shirt.vertices().to_vec(), kept).unwrap();
        let mixed = shirt.triangles().iter().zip(inwards.triangles()).enumerate();
        let mixed = mixed.map(|(t, (a, b))| if t % 3 == 0 { *a } else { *b }).collect();
        let mixed = TriMesh::new(shirt.vertices().to_vec(), mixed).unwrap();
        let both = [shirt.triangles(), inwards.triangles()].concat();
        let both = TriMesh::new(shirt.vertices().to_vec(), both).unwrap();
        for garment in [&shirt, &inwards, &mixed, &both, &jacket] {
            for y in [-0.295, -0.25, 0.0, 0.25, 0.295] {
                assert!(!is_exposed(&torso(), garment, [-0.11, y]), "{y}");
                assert!(is_exposed(&torso(), garment, [-0.125, y]), "{y}");
            }
            assert!(is_exposed(&torso(), garment, [-0.11, 0.305]), "beyond the hem");
        }
        assert!(is_exposed(&torso(), &jacket, [0.11, 0.0]), "between the fronts");
        let (tree, body) = (Bvh::new(&shirt), ClosedLayer::body(&torso()));
        let in_pose = Exposure::in_pose(&shirt, &tree, &body);
        for y in [-0.295, 0.0, 0.25] {
            assert!(!in_pose.is_exposed(&Point::new(-0.11, y, 0.0)), "under its caps: {y}");
            assert!(in_pose.is_exposed(&Point::new(-0.125, y, 0.0)), "{y}");
        }
        let with_button = united(&shirt, &about(0.005, 0.01, true), 0.13, false);
        assert!(is_exposed(&torso(), &with_button, [-0.125, 0.0]));
    }

    #[test]
    fn under_cloth_with_thickness_nothing_is_in_the_open() {
        let cloth = about(0.12, 0.6, false);
        let n = cloth.vertices().len() as u32;
        let both = united(&cloth, &about(0.119, 0.6, false), 0.0, true);
        let edges = Edges::new(&cloth);
        let rims = edges.boundary_loops(&cloth).into_iter().flat_map(|walk| {
            let next = [&walk[1..], &walk[..1]].concat();
            let sides = walk.into_iter().zip(next);
            sides.flat_map(|(a, b)| [[a + n, b, a], [b, a + n, b + n]]).collect::<Vec<_>>()
        });
        let triangles = both.triangles().iter().copied().chain(rims).collect();
        let thick = TriMesh::new(both.vertices().to_vec(), triangles).unwrap();
        assert!(Edges::new(&thick).boundary_loops(&thick).is_empty());
        for y in [-0.295, 0.0, 0.25] {
            assert!(!is_exposed(&torso(), &thick, [0.11, y]), "{y}");
        }
    }

    #[test]
    fn behind_a_folded_collar_nothing_is_in_the_open_but_at_the_top() {
        let straight = about(0.11, 0.6, false);
        let fold = |p: &Point| {
            let over = p.y - 0.2;
            let r = if over > 0.0 { 0.12 / 0.11 } else { 1.0 };
            Point::new(p.x * r, 0.2 - over.abs(), p.z * r)
        };
        let shirt = straight.vertices().iter().map(fold).collect();
        let shirt = straight.with_vertices(shirt).unwrap();
        let points = [([0.105, 0.15], false), ([0.105, 0.05], false), ([0.115, 0.15], false)];
        for (place, expected) in
            points.into_iter().chain([([0.105, 0.198], true), ([0.125, 0.15], true)])
        {
            assert_eq!(is_exposed(&torso(), &shirt, place), expected, "{place:?}");
        }
    }

    #[test]
    fn between_a_garment_and_another_limb_is_the_open() {
        // An arm beside the shirt, 8 mm away from it.
        let shirt = about(0.12, 0.6, false);
        let body = united(&torso(), &about(0.05, 0.5, true), 0.178, false);
        let layer = ClosedLayer::garment(&shirt, &ClosedLayer::body(&body), &body);
        let between = layer.sided(&Point::new(0.124, 0.05, 0.0), 0.0);
        assert!(between.is_some_and(|s| s.distance < 0.0), "voxels err there");
        assert!(is_exposed(&body, &shirt, [0.124, 0.05]));
        assert!(!is_exposed(&body, &shirt, [0.116, 0.05]));
    }
}
