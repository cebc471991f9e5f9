//! Tucking: a loose garment is pressed in below a tight one worn over it.
//!
//! Otherwise only the outer of two layers moves, as in the paper. If the inner one is the larger of
//! the two, the outer one is then stretched wide. With tucking ([`Tuck`](crate::params::Tuck)) the
//! inner one is first pressed in below it, as far as the body and the layers below leave room:
//! contacts with those come later in every sweep, and win.

use crate::findings::Findings;
use crate::outfit::Outfit;
use crate::params::GoalParams;
use if_core::math::{Point, Real, Vector};
use if_mesh::solid::ClosedLayer;
use if_xpbd::half_space::HalfSpaces;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::Arc;

/// A layer above, as in the input.
#[derive(Clone, Copy)]
pub(crate) struct UpperLayer<'a> {
    /// The layer, closed over the body.
    pub(crate) layer: &'a ClosedLayer,
    /// How far below it vertices are pressed, in metres.
    pub(crate) gap: Real,
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
    /// The planes that `p` must stay behind: the inward normal and a point, one for each layer it
    /// sticks out of or lies closely below.
    ///
    /// Beyond the end of a layer nothing is pressed: a hem, a cuff or an open front covers nothing
    /// there.
    fn planes<'a>(&'a self, p: &'a Point) -> impl Iterator<Item = (Vector, Point)> + 'a {
        self.layers.iter().filter_map(move |c| {
            let s = c
                .layer
                .sided(p, self.tuck_distance)
                .filter(|s| !s.boundary && s.distance > -c.gap - MARGIN)?;
            Some((-s.normal, s.point - s.normal * c.gap))
        })
    }

    /// Vertices of `x` that stick out of a layer by no more than the tuck distance, unless `released`.
    pub(crate) fn sticking_out(&self, x: &[Point], released: &[bool]) -> Vec<u32> {
        if self.layers.is_empty() {
            return Vec::new();
        }
        let out = |p: &Point| {
            self.layers.iter().any(|c| {
                c.layer
                    .sided(p, self.tuck_distance)
                    .is_some_and(|s| !s.boundary && s.distance > 0.0)
            })
        };
        let n = 0..x.len() as u32;
        n.into_par_iter()
            .with_min_len(128)
            .filter(|v| !released[*v as usize] && out(&x[*v as usize]))
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
            .map(|v| if pressed(&v) { self.planes(&x[v]).collect() } else { Vec::new() })
            .collect();
        for (v, of_vertex) in found.iter().enumerate() {
            for (normal, point) in of_vertex {
                planes.push_vertex(v as u32, *normal, point, 0.0);
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

    /// The layers that garment `index` is pressed in below, each with room for the layers between.
    pub(crate) fn over(&self, index: usize) -> Vec<UpperLayer<'_>> {
        let over = self.garments.iter().enumerate().skip(index + 1);
        over.filter_map(|(k, g)| {
            g.as_ref().filter(|(_, below)| below.contains(&index)).map(|(layer, _)| (k, layer))
        })
        .map(|(k, layer)| UpperLayer { layer, gap: ROOM * self.clearance * (k - index) as Real })
        .collect()
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
