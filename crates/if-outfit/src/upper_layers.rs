//! Tucking: a loose garment is pressed in below a tight one worn over it.
//!
//! Otherwise only the outer of two layers moves, as in the paper. If the inner one is the larger of
//! the two, the outer one is then stretched wide. With tucking ([`Tuck`](crate::params::Tuck)) the
//! inner one is first pressed in below it, as far as the body and the layers below leave room:
//! contacts with those come later in every sweep, and win.

use crate::findings::Findings;
use crate::geodesic::Neighbours;
use crate::outfit::Outfit;
use crate::params::GoalParams;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::solid::{ClosedLayer, Sided};
use if_xpbd::constraint::Stage;
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
    /// The garment's vertices that belong below it ([`covered`]).
    pub(crate) covered: Vec<bool>,
}

/// The layers above a garment that it is pressed in below.
#[derive(Clone, Copy, Default)]
pub(crate) struct UpperLayers<'a> {
    /// The layers.
    pub(crate) layers: &'a [UpperLayer<'a>],
    /// The garment's own inward normals ([`inward_normals`]); empty if they are not known.
    pub(crate) inward: &'a [Vector],
    /// Vertices that stick out of a layer by up to this much, in metres, are pressed in.
    pub(crate) tuck_distance: Real,
}

/// A plane that a vertex is pressed behind.
struct Plane {
    inward: Vector,
    point: Point,
    /// Whether it leads along the garment's own normal.
    as_a_whole: bool,
}

/// The half-spaces below the layers above, for vertices that are pressed in the nearest way and for
/// those that are pressed in as a whole.
pub(crate) struct Pressed {
    pub(crate) nearest: HalfSpaces,
    pub(crate) whole: HalfSpaces,
}

impl Pressed {
    /// None yet; they push like `planes`. What is far from all layers is in nobody's way, and is
    /// pushed as far as it is to go: by less, the cloth would pull it back in every sweep.
    pub(crate) fn new(planes: &HalfSpaces) -> Self {
        let mut nearest = planes.clone();
        nearest.stage = Stage::Elastic;
        let mut whole = nearest.clone();
        whole.max_push = STEP;
        Self { nearest, whole }
    }
}

impl UpperLayers<'_> {
    /// The planes that `p` must stay behind: the inward normal and a point, one for each layer it
    /// sticks out of or lies closely below.
    ///
    /// Beyond the end of a layer nothing is pressed: a hem, a cuff or an open front covers nothing
    /// there. In an armpit the nearest ways lead apart, through the walls to its sides; the garment's
    /// own normal takes it in as a whole.
    fn planes<'a>(&'a self, v: usize, p: &'a Point) -> impl Iterator<Item = Plane> + 'a {
        self.layers.iter().filter(move |c| c.covered[v]).filter_map(move |c| {
            let s = c
                .layer
                .sided(p, self.tuck_distance)
                .filter(|s| !s.boundary && s.distance > -c.gap - MARGIN)?;
            let own = self.inward.get(v).filter(|own| leads_aside(&s, own));
            let inward = own.copied().unwrap_or(-s.normal);
            let point = p + inward * (s.distance + c.gap).min(STEP);
            Some(Plane { inward, point, as_a_whole: own.is_some() })
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

    /// How far the vertices of `x` stick out that are pressed in along their own normals, as the
    /// nearest ways lead elsewhere: the sum, in metres, unless `released`.
    pub(crate) fn pressed_as_a_whole(&self, x: &[Point], released: &[bool]) -> Real {
        let height = |v: usize| {
            let layers = self.layers.iter().filter(|c| c.covered[v] && !released[v]);
            let sides = layers.filter_map(|c| c.layer.sided(&x[v], self.tuck_distance));
            let aside = sides.filter(|s| !s.boundary && leads_aside(s, &self.inward[v]));
            aside.map(|s| s.distance).fold(0.0, Real::max)
        };
        let known = 0..self.inward.len();
        let heights: Vec<Real> = known.into_par_iter().with_min_len(128).map(height).collect();
        heights.iter().sum()
    }

    /// Vertices that stick out, and how far, in metres.
    fn heights(&self, x: &[Point], released: &[bool]) -> Vec<(u32, Real)> {
        if self.layers.is_empty() {
            return Vec::new();
        }
        let height = |v: u32| {
            let pressing = self.layers.iter().filter(|c| c.covered[v as usize]);
            let sides = pressing.filter_map(|c| c.layer.sided(&x[v as usize], self.tuck_distance));
            sides.filter(|s| !s.boundary).map(|s| s.distance).fold(0.0, Real::max)
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
        planes: &mut Pressed,
    ) {
        planes.nearest.clear();
        planes.whole.clear();
        if self.layers.is_empty() {
            return;
        }
        let pressed = |v: &usize| inverse_masses[*v] > 0.0 && !released[*v];
        let found: Vec<Vec<Plane>> = (0..x.len())
            .into_par_iter()
            .with_min_len(128)
            .map(|v| if pressed(&v) { self.planes(v, &x[v]).collect() } else { Vec::new() })
            .collect();
        for (v, of_vertex) in found.iter().enumerate() {
            for Plane { inward, point, as_a_whole } in of_vertex {
                let group = if *as_a_whole { &mut planes.whole } else { &mut planes.nearest };
                group.push_vertex(v as u32, *inward, point, 0.0);
            }
        }
    }
}

/// The garments of an outfit that others are pressed in below, closed, as in the input.
pub(crate) struct TightGarments {
    /// One for each garment: closed if it meets garments below it, and the indices of those.
    garments: Vec<Option<(Arc<ClosedLayer>, Vec<usize>)>>,
    clearance: Real,
    tuck_distance: Real,
}

impl TightGarments {
    /// The garments `outer` are those that others are pressed in below. `before` is what was found
    /// in the input; `closed` are its body and garments, from the innermost on.
    pub(crate) fn new(
        outfit: &Outfit,
        before: &[Findings],
        closed: &[Arc<ClosedLayer>],
        outer: &BTreeSet<usize>,
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
        Self { garments, clearance: params.clearance, tuck_distance: params.tuck_distance }
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
        let of = |(k, layer): (usize, _)| UpperLayer {
            layer,
            gap: ROOM * self.clearance * (k - index) as Real,
            covered: covered(x, layer, body),
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

/// Up to this far out of a layer the nearest way in is taken, in metres.
const NEAR: Real = 5e-3;
/// Cosine between the nearest way in and a garment's own normal under which that way leads aside.
const ASIDE: Real = 0.5;
/// Times that normals are averaged: over 3 cm of the test data's meshes.
const NORMAL_SMOOTHINGS: usize = 10;

/// A segment through an edge may miss both triangles there. Then another one ends this far beside it,
/// in metres.
const BESIDE: Real = 1e-4;
/// How deep below the skin a layer above may lie, in metres, and cover what is over it all the same.
const BELOW_SKIN: Real = 0.03;

/// Whether the nearest way into a layer leads aside of a garment's `own` inward normal, from `s`.
fn leads_aside(s: &Sided, own: &Vector) -> bool {
    s.distance > NEAR && *own != Vector::zeros() && -s.normal.dot(own) < ASIDE
}

/// The inward normals of a garment, which `layer` is, smoothed along its surface; zero where
/// neither side of its triangles is outside.
pub(crate) fn inward_normals(mesh: &TriMesh, layer: &ClosedLayer) -> Vec<Vector> {
    let neighbours = Neighbours::new(&Edges::new(mesh), mesh.vertices());
    let count = mesh.vertices().len() as u32;
    let mut normals: Vec<Vector> = (0..count).map(|v| -layer.vertex_normal(v as usize)).collect();
    for _ in 0..NORMAL_SMOOTHINGS {
        let around = |v: u32| neighbours.of(v).iter().map(|(u, _)| normals[*u as usize]);
        normals = (0..count)
            .map(|v| unit_or_zero(&(normals[v as usize] + around(v).sum::<Vector>())))
            .collect();
    }
    normals
}

/// Which of the vertices `x` of a garment belong below `layer`: those inside it, and those for
/// which it lies on the way to the nearest point of the `body`, or a little below that.
///
/// A sleeve beside the trunk sticks out of a waistcoat, which it is not worn under.
fn covered(x: &[Point], layer: &ClosedLayer, body: &ClosedLayer) -> Vec<bool> {
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
    fn what_lies_between_two_tubes_of_the_layer_above_is_pressed_in_as_a_whole() {
        let limbs =
            joined(&moved(&icosphere(0.1, 4), -0.13, 0.0), &moved(&icosphere(0.1, 4), 0.13, 0.0));
        let body = ClosedLayer::body(&limbs);
        let tubes = joined(&ring(0.11, -0.13), &ring(0.11, 0.13));
        let tubes = ClosedLayer::garment(&tubes, &body, &limbs);
        // Beside the middle of the gap: the nearest ways lead to both sides.
        let x = [Point::new(-0.006, 0.0, 0.06), Point::new(0.006, 0.0, 0.06)];
        let layers = [UpperLayer { layer: &tubes, gap: 1e-3, covered: vec![true; 2] }];
        let planes = |inward: &[Vector]| {
            let above = UpperLayers { layers: &layers, inward, tuck_distance: 0.25 };
            let normals = [0, 1].map(|v| above.planes(v, &x[v]).next().unwrap().inward);
            let left =
                if inward.is_empty() { 0.0 } else { above.pressed_as_a_whole(&x, &[false; 2]) };
            (normals, left)
        };
        let ([a, b], _) = planes(&[]);
        assert!(a.x < -0.5 && b.x > 0.5, "{a} {b}");
        let (normals, left) = planes(&[-Vector::z(); 2]);
        assert_eq!(normals, [-Vector::z(); 2]);
        assert!(left > 0.02, "{left}");
        // A normal that is not known leads nowhere.
        assert_eq!(planes(&[Vector::zeros(); 2]), ([a, b], 0.0));
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
        let layers = [UpperLayer { layer: &waistcoat, gap: 1e-3, covered }];
        let above = UpperLayers { layers: &layers, inward: &[], tuck_distance: goal.tuck_distance };
        let rounds = above.rounds(&x, &[false]);
        assert!(rounds >= 25, "{rounds}");
        for _ in 0..rounds + 1 {
            let Plane { inward: normal, point, .. } = above.planes(0, &x[0]).next().unwrap();
            let step = normal.dot(&(point - x[0])).max(0.0);
            assert!(step < STEP + 1e-12);
            x[0] += normal * step;
        }
        assert!(above.sticking_out(&x, &[false]).is_empty());
    }
}
