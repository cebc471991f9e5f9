//! Pinches: where a body meets itself, or leaves no room for the cloth between.

use crate::motion::{DrawnBack, drawn_back, pinched};
use crate::outfit::{Layer, Outfit};
use crate::params::GoalParams;
use crate::report::{DrawnBackReport, Extent, PinchReport};
use if_core::math::{Point, Real, area_vector};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;
use if_mesh::measure::displacement;
use if_mesh::point_tree::PointTree;

/// Displacement of a body above which it counts as yielding, in metres.
const YIELDS: Real = 1e-3;
/// Room for each sheet of cloth in a pinch, as a multiple of the clearance: cloth is not flat there.
const SHEET: Real = 2.0;

/// The body of `outfit` drawn back, and how; `None` if it leaves room for the garments as it is.
pub(crate) fn draw_back(outfit: &Outfit, goal: &GoalParams) -> Option<(Layer, DrawnBackReport)> {
    let needed = room(outfit, goal);
    let DrawnBack { positions, met, narrow, left } = drawn_back(outfit, needed, goal.pinch_depth)?;
    let body = &outfit.body;
    let corners = met.iter().flatten().flat_map(|t| body.mesh.triangles()[*t as usize]);
    let places: Vec<Point> =
        corners.chain(narrow).map(|v| body.mesh.vertices()[v as usize]).collect();
    let report = DrawnBackReport {
        own_pairs_before: met.len(),
        own_pairs_after: left.len(),
        moved: displacement(body.mesh.vertices(), &positions),
        extent: extent(&body.mesh, body.mesh.vertices(), &positions, &places),
    };
    let mesh = body.mesh.with_vertices(positions).expect("solutions are finite");
    Some((Layer { mesh, ..body.clone() }, report))
}

/// Room that the sheets of cloth in a pinch need: each garment lies there twice.
fn room(outfit: &Outfit, goal: &GoalParams) -> Real {
    (2 * outfit.garments.len() + 1) as Real * SHEET * goal.clearance
}

/// What of `outfit` intersects its body in pinches; `None` if nothing does.
pub(crate) fn in_pinches(outfit: &Outfit, goal: &GoalParams) -> Option<PinchReport> {
    let pinched = pinched(&outfit.body.mesh, room(outfit, goal));
    if !pinched.contains(&true) {
        return None;
    }
    let body = Bvh::new(&outfit.body.mesh);
    let garment = |layer: &Layer| {
        let found = pairs(&body, &Bvh::new(&layer.mesh));
        found.iter().filter(|p| pinched[p.a as usize]).map(|p| [p.a, p.b]).collect()
    };
    let garments = outfit.garments.iter().map(|layer| (layer.name.as_str(), garment(layer), 0));
    let report = PinchReport::new(pinched.iter().filter(|is| **is).count(), garments);
    (report.pairs > 0).then_some(report)
}

/// Where a body with the triangles of `mesh` yields that was at `given` and is `now`; `places` are
/// where it meets itself.
pub fn extent(mesh: &TriMesh, given: &[Point], now: &[Point], places: &[Point]) -> Extent {
    let moved: Vec<Real> = given.iter().zip(now).map(|(a, b)| (b - a).norm()).collect();
    let (mut area, mut whole) = (0.0, 0.0);
    for corners in mesh.triangles() {
        let [a, b, c] = corners.map(|v| &given[v as usize]);
        let size = area_vector(a, b, c).norm();
        let yields = corners.iter().filter(|v| moved[**v as usize] > YIELDS).count();
        area += size * yields as Real / 3.0;
        whole += size;
    }
    let tree = PointTree::new(places);
    let mut nearest = Vec::new();
    let mut reach: Option<Real> = None;
    for v in (0..moved.len()).filter(|v| moved[*v] > YIELDS) {
        tree.nearest(&given[v], 1, &mut nearest);
        if let Some((squared, _)) = nearest.first() {
            reach = Some(reach.unwrap_or(0.0).max(squared.sqrt()));
        }
    }
    Extent { area: if whole > 0.0 { area / whole } else { 0.0 }, reach }
}
