//! Giving way: garments below one that is left with intersections are pressed in where it meets them.
//!
//! Tucking presses a garment in below the one above, at that garment's input position. What then is
//! left of the two is often a corner of the lower one that pokes through triangles of the upper one, stretched over
//! it as far as they go: the upper one cannot yield any more, and the lower one can.
//!
//! ```text
//! unless the upper one meets the body, or the lower ones a layer below them
//! repeat while less remains than before, at most 6 times
//!     for each garment below, inner to outer
//!         it meets the upper one: press it in below that as it lies, near where they meet;
//!         if that did not help, once deeper
//!         or a layer below it has moved: settle it over that, from where it lies
//!     settle the upper one over them, from where it lies
//! ```

use crate::dressing::{Dressed, Dressing};
use crate::outfit::Layer;
use crate::params::{Method, Tuck};
use crate::progress::GarmentProgress;
use crate::settle::{Settings, Settled, settle};
use crate::upper_layers::{UpperLayer, UpperLayers, covered};
use crate::workpiece::SettleError;
use if_core::edges::Edges;
use if_core::geodesic::Neighbours;
use if_core::math::Real;
use if_mesh::solid::ClosedLayer;
use std::ops::Range;
use std::sync::Arc;

/// Most times that garments give way to one.
const TURNS: usize = 6;
/// How far along the surface from where it meets the upper one a garment is pressed in, in metres.
const REACH: Real = 0.03;
/// How far below the upper one vertices are pressed, and how far below they need not be pressed, in
/// metres. Edges of the upper one may cut through between them.
const GAP: Real = 2.5e-3;
const LEAST: Real = 1e-3;
/// If that does not help, they are pressed in this many times as far.
const DEEPER: Real = 3.0;

impl Dressing<'_> {
    /// Lets the garments below `index`, which was put on last, give way to it where they still meet.
    ///
    /// # Errors
    ///
    /// As [`put_on`](Self::put_on), but never stuck.
    pub(crate) fn give_way(
        &mut self,
        index: usize,
        progress: &mut GarmentProgress<'_>,
    ) -> Result<(), SettleError> {
        // Where the upper one meets the body as well, it is not the garments below that are in its way.
        let meets_body = !self.dressed[index].findings.below[0].is_clean();
        if self.settings.params.goal.tuck == Tuck::Never || meets_body {
            return Ok(());
        }
        let mut gap = GAP;
        for _ in 0..TURNS {
            let Some(first) = (0..index).find(|k| self.meets(index, *k)) else { break };
            // What a lower garment already failed at over its own layers below it would fail at again,
            // with less room.
            if self.remaining(first..index) > 0 {
                break;
            }
            let before = self.remaining(first..index + 1);
            let dressed = self.dressed.split_off(first);
            let below = self.below.split_off(first + 1);
            match self.press_in(first, &dressed, gap, progress) {
                Ok(()) if self.remaining(first..index + 1) < before => continue,
                Ok(()) => {}
                Err(SettleError::Step(error)) => {
                    tracing::warn!(%error, "garments below cannot give way");
                }
                Err(error) => return Err(error),
            }
            self.take_off(first);
            self.dressed.extend(dressed);
            self.below.extend(below);
            if gap > GAP {
                break;
            }
            gap *= DEEPER;
        }
        Ok(())
    }

    /// Whether garment `outer` still meets garment `inner`.
    fn meets(&self, outer: usize, inner: usize) -> bool {
        // The body comes first in the findings.
        !self.dressed[outer].findings.below[inner + 1].is_clean()
    }

    /// Pairs and vertices on a wrong side that remain of these garments.
    fn remaining(&self, garments: Range<usize>) -> usize {
        let both = self.dressed[garments.clone()].iter().zip(&self.given[garments]);
        both.map(|(dressed, given)| dressed.remaining(given)).sum()
    }

    /// Puts the garments `dressed`, which are those from `first` on, on again from where they lay; those
    /// that the last one met, pressed in.
    fn press_in(
        &mut self,
        first: usize,
        dressed: &[Dressed],
        gap: Real,
        progress: &mut GarmentProgress<'_>,
    ) -> Result<(), SettleError> {
        let Some((upper, lower)) = dressed.split_last() else { return Ok(()) };
        // Whatever settled before, these are repairs.
        let mut params = self.settings.params.clone();
        params.effort.method = Method::Contacts;
        let settings = Settings { params: &params, ..self.settings };
        let upper_layer = ClosedLayer::garment(&upper.mesh, &self.below[0], &self.outfit.body.mesh);
        for (k, was) in (first..).zip(lower) {
            let below: Vec<&ClosedLayer> = self.below.iter().map(Arc::as_ref).collect();
            // What it was pressed into before is its shape now.
            let garment = Layer { mesh: was.mesh.clone(), ..self.outfit.garments[k].clone() };
            let covered = met(&garment, upper, k, &upper_layer, below[0]);
            let layers =
                [UpperLayer { layer: &upper_layer, gap, least: LEAST, covered, ways_in: &[] }];
            let tuck_distance = params.goal.tuck_distance;
            let above = UpperLayers { layers: &layers, tuck_distance };
            let mut settled = settle(&garment, None, &below, above, true, settings, progress)?;
            settled.counts.gave_way = usize::from(settled.positions != was.mesh.vertices());
            self.put_on_again(k, was, settled);
        }
        let index = first + lower.len();
        let below: Vec<&ClosedLayer> = self.below.iter().map(Arc::as_ref).collect();
        let garment = &self.outfit.garments[index];
        let start = Some(upper.mesh.vertices());
        let above = UpperLayers::default();
        let settled = settle(garment, start, &below, above, true, settings, progress)?;
        self.put_on_again(index, upper, settled);
        Ok(())
    }

    fn put_on_again(&mut self, index: usize, was: &Dressed, settled: Settled) {
        let settled = settled.after(&was.settled);
        self.freeze(index, None, settled, None, std::time::Instant::now());
        let now = self.dressed.last_mut().expect("it was just put on");
        now.seconds += was.seconds;
        now.verify_seconds += was.verify_seconds;
    }
}

/// Which vertices of `garment`, the one with index `k`, belong below `upper` and lie near where they
/// meet.
fn met(
    garment: &Layer,
    upper: &Dressed,
    k: usize,
    upper_layer: &ClosedLayer,
    body: &ClosedLayer,
) -> Vec<bool> {
    let mesh = &garment.mesh;
    let pairs = upper.findings.below[k + 1].pairs.iter();
    let sources: Vec<u32> = pairs.flat_map(|pair| mesh.triangles()[pair.a as usize]).collect();
    if sources.is_empty() {
        return vec![false; mesh.vertices().len()];
    }
    let near = Neighbours::new(&Edges::new(mesh), mesh.vertices()).distances(sources, REACH);
    let below = covered(mesh.vertices(), upper_layer, body);
    below.iter().zip(near).map(|(below, near)| *below && near.is_finite()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outfit::Outfit;
    use crate::params::ResolveParams;
    use crate::verify::verify_layers;
    use if_core::math::Point;
    use if_core::mesh::TriMesh;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::{icosphere, tube};

    /// A band of `radius` round the y axis, on edges of 1 cm.
    fn band(radius: Real) -> TriMesh {
        let tube = tube(radius, 0.1, 96, 10, false);
        let low = tube.vertices().iter().map(|p| Point::new(p.x, p.y - 0.05, p.z)).collect();
        tube.with_vertices(low).unwrap()
    }

    /// The vertex of `mesh` that lies farthest out, and how far.
    fn farthest(mesh: &TriMesh) -> (usize, Real) {
        let far = |p: &Point| Real::hypot(p.x, p.z);
        let all = mesh.vertices().iter().map(far).enumerate();
        all.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
    }

    fn with_a_corner_out(tuck: Tuck, then: impl FnOnce(&TriMesh, &Dressing<'_>)) {
        let shirt = band(0.165);
        let mut x = shirt.vertices().to_vec();
        let corner = x.iter().position(|p| p.y.abs() < 6e-3).unwrap();
        x[corner] = Point::new(1.1 * x[corner].x, x[corner].y, 1.1 * x[corner].z);
        let shirt = shirt.with_vertices(x).unwrap();
        let outfit = Outfit {
            body: Layer::new("body", icosphere(0.15, 4)),
            garments: vec![Layer::new("shirt", shirt.clone()), Layer::new("coat", band(0.17))],
        };
        let mut params = ResolveParams::default();
        params.goal.tuck = tuck;
        let (given, closed) = verify_layers(&outfit, None);
        let settings = Settings { params: &params, skip: true, fields: &[], body: None };
        let mut dressing = Dressing::new([&outfit; 2], &given, &closed[0], settings);
        dressing.leave(0, Some(&closed[1]));
        dressing.leave(1, None);
        assert!(dressing.meets(1, 0));
        let mut monitor = Silent;
        let mut progress =
            GarmentProgress { monitor: &mut monitor, name: "coat", index: 1, count: 2 };
        assert!(dressing.give_way(1, &mut progress).is_ok());
        then(&shirt, &dressing);
    }

    #[test]
    fn a_corner_that_pokes_through_what_is_worn_over_it_is_pressed_in() {
        with_a_corner_out(Tuck::IfStuck, |shirt, dressing| {
            assert!(!dressing.meets(1, 0));
            assert_eq!(dressing.remaining(0..2), 0);
            let (corner, out) = farthest(shirt);
            let now = dressing.dressed[0].mesh.vertices()[corner];
            assert!(Real::hypot(now.x, now.z) < out - 3e-3, "{now}, {out}");
            assert_eq!(dressing.dressed[0].settled.counts.gave_way, 1);
            // Only near it.
            let moved = shirt.vertices().iter().zip(dressing.dressed[0].mesh.vertices());
            assert!(moved.filter(|(a, b)| a != b).count() < shirt.vertices().len() / 2);
        });
    }

    #[test]
    fn nothing_gives_way_if_only_the_outer_layer_may_move() {
        with_a_corner_out(Tuck::Never, |shirt, dressing| {
            assert!(dressing.meets(1, 0));
            assert_eq!(dressing.dressed[0].mesh.vertices(), shirt.vertices());
        });
    }
}
