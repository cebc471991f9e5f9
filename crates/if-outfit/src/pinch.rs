//! Pinches: where a body meets itself, or leaves no room for the cloth between.

use crate::motion::{DrawnBack, drawn_back, pinched, room};
use crate::outfit::{Layer, Outfit};
use crate::params::GoalParams;
use crate::report::{DrawnBackReport, Extent, PinchReport};
use if_core::closest::ClosestPoint;
use if_core::math::{Point, Real, area_vector};
use if_core::mesh::TriMesh;
use if_mesh::body_surface::turned_outwards;
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;
use if_mesh::measure::displacement;
use if_mesh::point_tree::PointTree;
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;

/// Displacement of a body above which it counts as yielding, in metres.
const YIELDS: Real = 1e-3;
/// Room for each sheet of cloth in a pinch, as a multiple of the clearance: cloth is not flat there.
const SHEET: Real = 2.0;

/// The body of `outfit` drawn back, and how; `None` if it leaves room for the garments as it is.
pub(crate) fn draw_back(outfit: &Outfit, goal: &GoalParams) -> Option<(Layer, DrawnBackReport)> {
    let needed = room(outfit.garments.len(), SHEET * goal.clearance);
    let DrawnBack { positions, met, narrow, left } = drawn_back(outfit, needed, goal.body_depth)?;
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

/// What of `outfit` intersects its body, whose closed surface is `closed`, in pinches, or is inside
/// there; `None` if nothing is.
pub(crate) fn in_pinches(
    outfit: &Outfit,
    closed: &ClosedLayer,
    goal: &GoalParams,
) -> Option<PinchReport> {
    let needed = room(outfit.garments.len(), SHEET * goal.clearance);
    let turned = turned_outwards(&outfit.body.mesh);
    let pinched = pinched(turned.as_ref().unwrap_or(&outfit.body.mesh), needed);
    if !pinched.contains(&true) {
        return None;
    }
    let body = Bvh::new(&outfit.body.mesh);
    let garment = |layer: &Layer| {
        let found = pairs(&body, &Bvh::new(&layer.mesh));
        found.iter().filter(|p| pinched[p.a as usize]).map(|p| [p.a, p.b]).collect()
    };
    let inside = |layer: &Layer| {
        let used = layer.mesh.used_vertices();
        let is_inside = |v: &usize| {
            let p = &layer.mesh.vertices()[*v];
            let nearest = || body.closest(p, Real::INFINITY);
            // The way out may lead elsewhere.
            closed.sided(p, 0.0).is_some_and(|sided| sided.distance < 0.0)
                && nearest().is_some_and(|near| pinched[near.triangle as usize])
        };
        (0..used.len()).into_par_iter().filter(|v| used[*v]).filter(is_inside).count()
    };
    let garments = outfit.garments.iter();
    let garments = garments.map(|layer| (layer.name.as_str(), garment(layer), inside(layer)));
    let report = PinchReport::new(pinched.iter().filter(|is| **is).count(), garments);
    (report.pairs + report.inside > 0).then_some(report)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::resolve::{ResolveError, ResolveParams, resolve};
    use crate::{Pinch, Storage};
    use if_core::math::Vector;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::icosphere;

    /// Two balls as a body, whose surfaces lie `2 x − 0.2` m apart, and a sheet of cloth between.
    fn balls(x: Real) -> Outfit {
        let ball = icosphere(0.1, 3);
        let n = ball.vertices().len() as u32;
        let at = |x: Real| ball.vertices().iter().map(move |p| p + Vector::x() * x);
        let vertices: Vec<Point> = at(-x).chain(at(x)).collect();
        let second = ball.triangles().iter().map(|t| t.map(|v| v + n));
        let triangles = ball.triangles().iter().copied().chain(second).collect();
        let body = TriMesh::new(vertices, triangles).unwrap();
        let place = |k: u32| 0.3 * (f64::from(k) / 20.0 - 0.5);
        let sheet = (0..441).map(|k| Point::new(0.0, place(k % 21), place(k / 21))).collect();
        let corners = (0..400).map(|k| k / 20 * 21 + k % 20);
        let cells = corners.flat_map(|a| [[a, a + 1, a + 21], [a + 1, a + 22, a + 21]]);
        let sheet = TriMesh::new(sheet, cells.collect()).unwrap();
        let body = Layer { storage: Storage::F32, ..Layer::new("balls", body) };
        Outfit::new(body, vec![Layer::new("sheet", sheet)]).unwrap()
    }

    fn params(pinch: Pinch) -> ResolveParams {
        let mut params = ResolveParams::default();
        params.goal.pinch = pinch;
        params.effort.rounds = 8;
        params
    }

    #[test]
    fn a_body_that_meets_itself_is_drawn_back_for_cloth_that_has_no_room() {
        let outfit = balls(0.096);
        let error = resolve(&outfit, &params(Pinch::Keep), &mut Silent).unwrap_err();
        let ResolveError::Unresolved { result, .. } = error else { panic!("{error}") };
        let pinch = result.report.pinch.clone().unwrap();
        assert!(pinch.pairs > 0 && pinch.pairs <= result.report.after.total_pairs());
        let closed = ClosedLayer::body(&outfit.body.mesh);
        let given = in_pinches(&outfit, &closed, &GoalParams::default()).unwrap();
        assert!(given.inside > 0 && given.inside <= result.report.before.total_inside());
        assert_eq!(pinch.garments[0].name, "sheet");
        // Also of a body that is inside out.
        let body = &outfit.body.mesh;
        let turned = body.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let mut turned_body = result.outfit.clone();
        turned_body.body.mesh = TriMesh::new(body.vertices().to_vec(), turned).unwrap();
        let found = in_pinches(&turned_body, &ClosedLayer::body(body), &GoalParams::default());
        assert_eq!(found.unwrap().body_faces, pinch.body_faces);
        assert!(!pinch.garments[0].faces.is_empty() && pinch.body_faces > 10);

        let resolved = resolve(&outfit, &params(Pinch::Yield), &mut Silent).unwrap();
        let report = resolved.report;
        assert!(report.is_proven() && report.pinch.is_none());
        assert!(report.before.body_own_pairs > 0 && report.after.body_own_pairs == 0);
        let drawn = report.drawn_back.unwrap();
        assert_eq!(
            (drawn.own_pairs_before, drawn.own_pairs_after),
            (report.before.body_own_pairs, 0)
        );
        assert!(drawn.moved.max > 3e-3 && drawn.moved.max <= 0.015 + 1e-6, "{drawn:?}");
        assert!(drawn.extent.area > 0.01 && drawn.extent.area < 0.3, "{drawn:?}");
        assert!(drawn.extent.reach.unwrap() <= 0.05, "{drawn:?}");
        // It is stored as it was verified, and moved near the other ball alone.
        let body = resolved.outfit.body.mesh.vertices();
        assert_eq!(body, Storage::F32.round(body));
        let moved = outfit.body.mesh.vertices().iter().zip(body);
        let far = moved.filter(|(p, _)| p.x.abs() > 0.1);
        assert!(far.map(|(p, q)| (q - p).norm()).fold(0.0, Real::max) < 1e-7);
        let center = resolved.outfit.garments[0].mesh.vertices()[220];
        assert!(center.coords.norm() < 2e-3, "on the middle surface: {center}");
    }

    #[test]
    fn a_body_is_drawn_back_by_at_most_the_depth_that_is_given() {
        let outfit = balls(0.09);
        let goal = GoalParams { body_depth: 1e-3, ..GoalParams::default() };
        let (_, drawn) = draw_back(&outfit, &goal).unwrap();
        assert!(drawn.moved.max < 1e-3 + 1e-6 && drawn.own_pairs_after > 0, "{drawn:?}");
    }

    #[test]
    fn a_body_with_room_stays_as_it_is() {
        let outfit = balls(0.11);
        let [kept, yielded] = [Pinch::Keep, Pinch::Yield]
            .map(|pinch| resolve(&outfit, &params(pinch), &mut Silent).unwrap());
        assert_eq!(kept.outfit, yielded.outfit);
        assert_eq!(kept.report.without_seconds(), yielded.report.without_seconds());
        assert!(kept.outfit == outfit);
    }
}
