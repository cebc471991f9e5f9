//! Tucking: a loose garment is pressed in below a tight one worn over it.
//!
//! Otherwise only the outer of two layers moves, as in the paper. If the inner one is the larger of
//! the two, the outer one is then stretched wide. With tucking ([`Tuck`](crate::params::Tuck)) the
//! inner one is first pressed in below it, as far as the body and the layers below leave room:
//! contacts with those come later in every sweep, and win.

use crate::findings::Findings;
use crate::outfit::Outfit;
use crate::params::GoalParams;
use crate::way::Way;
use crate::ways_in::WaysIn;
use if_core::math::{Point, Real, Vector};
use if_mesh::solid::ClosedLayer;
use if_xpbd::half_space::HalfSpaces;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::Arc;

/// A layer above a garment, as in the input.
#[derive(Clone)]
pub(crate) struct UpperLayer<'a> {
    /// The layer, closed over the body.
    pub(crate) layer: &'a ClosedLayer,
    /// How far below it vertices are pressed, in metres.
    pub(crate) gap: Real,
    /// Vertices less than this far below it stick out as well, in metres.
    pub(crate) least: Real,
    /// The garment's vertices that belong below it ([`covered`]).
    pub(crate) covered: Vec<bool>,
    /// Vertices that do not take the nearest way in, ascending, with the way that they take.
    pub(crate) ways_in: &'a [Way],
}

impl UpperLayer<'_> {
    /// The rest of the way of vertex `v` at `p`, and how far it still is to below the layer;
    /// `None` if it takes the nearest one, or is there.
    fn way_in(&self, v: u32, p: &Point) -> Option<(Vector, Real)> {
        let k = self.ways_in.binary_search_by_key(&v, |way| way.vertex).ok()?;
        let left = self.ways_in[k].left(p) + self.gap;
        (left > 0.0).then_some((self.ways_in[k].direction, left))
    }
}

/// The layers above a garment that it is pressed in below.
#[derive(Clone, Copy, Default)]
pub(crate) struct UpperLayers<'a> {
    /// The layers.
    pub(crate) layers: &'a [UpperLayer<'a>],
    /// Vertices that stick out of a layer by up to this much, in metres, are pressed in.
    pub(crate) tuck_distance: Real,
}

impl UpperLayers<'_> {
    /// The planes that vertex `v` at `p` must stay behind: the inward normal, or the direction of its way
    /// in, and a point, one for each layer it sticks out of or lies closely below.
    ///
    /// Beyond the end of a layer nothing is pressed: a hem, a cuff or an open front covers nothing
    /// there.
    fn planes<'a>(&'a self, v: usize, p: &'a Point) -> impl Iterator<Item = (Vector, Point)> + 'a {
        self.layers.iter().filter(move |c| c.covered[v]).filter_map(move |c| {
            if let Some((direction, left)) = c.way_in(v as u32, p) {
                return Some((direction, p + direction * left.min(STEP)));
            }
            let s = c
                .layer
                .sided(p, self.tuck_distance)
                .filter(|s| !s.boundary && s.distance > -c.gap - MARGIN)?;
            Some((-s.normal, p - s.normal * (s.distance + c.gap).min(STEP)))
        })
    }

    /// Vertices of `x` that stick out of a layer by no more than the tuck distance, unless `released`.
    pub(crate) fn sticking_out(&self, x: &[Point], released: &[bool]) -> Vec<u32> {
        self.heights(x, released).into_iter().map(|(v, _)| v).collect()
    }

    /// Rounds in which all vertices of `x` that stick out can be pressed in.
    pub(crate) fn rounds(&self, x: &[Point], released: &[bool]) -> usize {
        let highest = self.heights(x, released).into_iter().map(|h| h.1).fold(0.0, Real::max);
        (highest / STEP).ceil() as usize
    }

    /// Vertices that stick out, and how far, in metres.
    fn heights(&self, x: &[Point], released: &[bool]) -> Vec<(u32, Real)> {
        if self.layers.is_empty() {
            return Vec::new();
        }
        let height = |v: u32| {
            let pressing = self.layers.iter().filter(|c| c.covered[v as usize]);
            let p = &x[v as usize];
            let heights = pressing.filter_map(|c| {
                if let Some((_, left)) = c.way_in(v, p) {
                    return Some(left);
                }
                let s = c.layer.sided(p, self.tuck_distance)?;
                (!s.boundary).then_some(s.distance + c.least)
            });
            heights.fold(0.0, Real::max)
        };
        (0..x.len() as u32)
            .into_par_iter()
            .with_min_len(128)
            .filter(|v| !released[*v as usize])
            .map(|v| (v, height(v)))
            .filter(|(_, height)| *height > 0.0)
            .collect()
    }

    /// Fills `planes` with those that the free vertices of `x` must be pressed behind, unless
    /// `released`.
    pub(crate) fn detect(
        &self,
        x: &[Point],
        inverse_masses: &[Real],
        released: &[bool],
        planes: &mut HalfSpaces,
    ) {
        planes.clear();
        if self.layers.is_empty() {
            return;
        }
        let pressed = |v: &usize| inverse_masses[*v] > 0.0 && !released[*v];
        let found: Vec<Vec<(Vector, Point)>> = (0..x.len())
            .into_par_iter()
            .with_min_len(128)
            .map(|v| if pressed(&v) { self.planes(v, &x[v]).collect() } else { Vec::new() })
            .collect();
        for (v, of_vertex) in found.iter().enumerate() {
            for (normal, point) in of_vertex {
                planes.push_vertex(v as u32, *normal, point, 0.0);
            }
        }
    }
}

/// The garments of an outfit that others are pressed in below, closed, as in the input.
pub(crate) struct TightGarments<'a> {
    /// One for each garment: closed if it meets garments below it, and the indices of those.
    garments: Vec<Option<(Arc<ClosedLayer>, Vec<usize>)>>,
    ways_in: &'a [WaysIn],
    clearance: Real,
    tuck_distance: Real,
}

impl<'a> TightGarments<'a> {
    /// The garments `outer` are those that others are pressed in below. `before` is what was found
    /// in the input; `closed` are its body and garments, from the innermost on, and `ways_in` the
    /// ways of vertices that do not take the nearest.
    pub(crate) fn new(
        outfit: &Outfit,
        before: &[Findings],
        closed: &[Arc<ClosedLayer>],
        outer: &BTreeSet<usize>,
        ways_in: &'a [WaysIn],
        params: &GoalParams,
    ) -> Self {
        // The body comes first in the findings.
        let meet = |inner: usize, outer: usize| !before[outer].below[inner + 1].is_clean();
        let close = |k: usize| match closed.get(k + 1) {
            Some(layer) => Arc::clone(layer),
            None => Arc::new(ClosedLayer::garment(
                &outfit.garments[k].mesh,
                &closed[0],
                &outfit.body.mesh,
            )),
        };
        let garments = (0..outfit.garments.len())
            .into_par_iter()
            .map(|k| {
                let below: Vec<usize> =
                    (0..k).filter(|inner| outer.contains(&k) && meet(*inner, k)).collect();
                (!below.is_empty()).then(|| (close(k), below))
            })
            .collect();
        let GoalParams { clearance, tuck_distance, .. } = *params;
        Self { garments, ways_in, clearance, tuck_distance }
    }

    /// The numbers of the garments that garment `index` is pressed in below, and their layers.
    fn above(&self, index: usize) -> impl Iterator<Item = (usize, &ClosedLayer)> {
        let over = self.garments.iter().enumerate().skip(index + 1);
        over.filter_map(move |(k, g)| {
            g.as_ref().filter(|(_, below)| below.contains(&index)).map(|(layer, _)| (k, &**layer))
        })
    }

    /// Whether garment `index` is pressed in below another.
    pub(crate) fn press(&self, index: usize) -> bool {
        self.above(index).next().is_some()
    }

    /// The layers that garment `index`, at `x` over the `body`, is pressed in below, each
    /// with room for the layers between.
    pub(crate) fn over(
        &self,
        index: usize,
        x: &[Point],
        body: &ClosedLayer,
    ) -> Vec<UpperLayer<'_>> {
        let ways_in = |outer: usize| -> &[Way] {
            let mut all = self.ways_in.iter();
            all.find(|w| [w.inner, w.outer] == [index, outer]).map_or(&[], |found| &found.ways)
        };
        let of = |(k, layer): (usize, _)| UpperLayer {
            layer,
            gap: ROOM * self.clearance * (k - index) as Real,
            least: 0.0,
            covered: covered(x, layer, body),
            ways_in: ways_in(k),
        };
        self.above(index).map(of).collect()
    }

    /// How far out of a layer above a vertex may stick to be pressed in, in metres.
    pub(crate) fn tuck_distance(&self) -> Real {
        self.tuck_distance
    }
}

/// Vertices that lie less than this below the gap are kept in, too, in metres: otherwise they
/// buckle out in the next round.
const MARGIN: Real = 0.01;
/// Clearances between a layer and one above it: one for each of the two when they settle, and one to
/// spare for chords.
const ROOM: Real = 3.0;
/// How far a vertex is pressed in one round, in metres. The cloth must follow: a wide flap that is
/// pressed in at once is crumpled at the edge of the layer above.
const STEP: Real = 6e-3;

/// A segment through an edge may miss both triangles there. Then another one ends this far beside it,
/// in metres.
const BESIDE: Real = 1e-4;
/// How deep below the skin a layer above may lie, in metres, and cover what is over it all the same.
const BELOW_SKIN: Real = 0.03;

/// Which of the vertices `x` of a garment belong below `layer`: those inside it, and those for
/// which it lies on the way to the nearest point of the `body`, or a little below that.
///
/// A sleeve beside the trunk sticks out of a waistcoat, which it is not worn under.
pub(crate) fn covered(x: &[Point], layer: &ClosedLayer, body: &ClosedLayer) -> Vec<bool> {
    let is_covered = |p: &Point| {
        let is_inside = || layer.sided(p, 0.0).is_some_and(|s| s.distance < 0.0);
        let hits = |end: &Point| layer.bvh().first_hit(p, end, |_| true).is_some();
        let lies_between = |end: &Point| hits(end) || hits(&(end + Vector::repeat(BESIDE)));
        let foot = body.sided(p, Real::INFINITY).map(|s| s.point - s.normal * BELOW_SKIN);
        is_inside() || foot.is_some_and(|foot| lies_between(&foot))
    };
    x.par_iter().with_min_len(64).map(is_covered).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outfit::Layer;
    use crate::params::{ResolveParams, Tuck};
    use crate::resolve::resolve;
    use if_core::mesh::TriMesh;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::{icosphere, tube};

    fn joined(a: &TriMesh, b: &TriMesh) -> TriMesh {
        let n = a.vertices().len() as u32;
        let more = b.triangles().iter().map(|t| t.map(|v| v + n));
        let triangles = a.triangles().iter().copied().chain(more).collect();
        TriMesh::new([a.vertices(), b.vertices()].concat(), triangles).unwrap()
    }

    fn moved(mesh: &TriMesh, x: Real, y: Real) -> TriMesh {
        let vertices = mesh.vertices().iter().map(|p| Point::new(p.x + x, p.y + y, p.z));
        mesh.with_vertices(vertices.collect()).unwrap()
    }

    /// A ring of cloth round the y axis, moved along x.
    fn ring(radius: Real, x: Real) -> TriMesh {
        moved(&tube(radius, 0.1, 64, 8, false), x, -0.05)
    }

    /// A trunk and an arm 5 cm beside it; a shirt with a sleeve, wider than the waistcoat over it.
    fn scene() -> (Outfit, usize) {
        let body = joined(&icosphere(0.15, 4), &moved(&icosphere(0.05, 3), 0.27, 0.0));
        let (trunk, sleeve) = (ring(0.175, 0.0), ring(0.06, 0.27));
        let shirt = Layer::new("shirt", joined(&trunk, &sleeve));
        let garments = vec![shirt, Layer::new("waistcoat", ring(0.165, 0.0))];
        (Outfit { body: Layer::new("body", body), garments }, trunk.vertices().len())
    }

    #[test]
    fn a_sleeve_beside_a_waistcoat_is_not_pressed_in_below_it() {
        let (outfit, trunk) = scene();
        let body = ClosedLayer::body(&outfit.body.mesh);
        let waistcoat = ClosedLayer::garment(&outfit.garments[1].mesh, &body, &outfit.body.mesh);
        let covered = covered(outfit.garments[0].mesh.vertices(), &waistcoat, &body);
        let beside = |p: &Point| p.y.abs() < 0.045;
        for (v, p) in outfit.garments[0].mesh.vertices().iter().enumerate().filter(|v| beside(v.1))
        {
            assert_eq!(covered[v], v < trunk, "{p}");
        }
        let mut params = ResolveParams::default();
        params.goal.tuck = Tuck::Always;
        let resolved = resolve(&outfit, &params, &mut Silent).unwrap();
        let shirts = [&outfit, &resolved.outfit].map(|o| o.garments[0].mesh.vertices());
        assert!(shirts[0][..trunk] != shirts[1][..trunk]);
        assert_eq!(shirts[0][trunk..], shirts[1][trunk..]);
    }

    #[test]
    fn a_flap_far_out_of_the_layer_above_is_pressed_in_step_by_step() {
        let (outfit, _) = scene();
        let body = ClosedLayer::body(&outfit.body.mesh);
        let waistcoat = ClosedLayer::garment(&outfit.garments[1].mesh, &body, &outfit.body.mesh);
        let goal = ResolveParams::default().goal;
        // 15 cm in front of the waistcoat.
        let mut x = vec![Point::new(0.0, 0.0, 0.165 + 0.15)];
        let covered = covered(&x, &waistcoat, &body);
        let layers =
            [UpperLayer { layer: &waistcoat, gap: 1e-3, least: 0.0, covered, ways_in: &[] }];
        let above = UpperLayers { layers: &layers, tuck_distance: goal.tuck_distance };
        let rounds = above.rounds(&x, &[false]);
        assert!(rounds >= 25, "{rounds}");
        for _ in 0..rounds + 1 {
            let (normal, point) = above.planes(0, &x[0]).next().unwrap();
            let step = normal.dot(&(point - x[0])).max(0.0);
            assert!(step < STEP + 1e-12);
            x[0] += normal * step;
        }
        assert!(above.sticking_out(&x, &[false]).is_empty());
    }
}
