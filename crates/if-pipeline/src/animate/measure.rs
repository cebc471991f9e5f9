//! What is measured in a frame.

use super::error::AnimateError;
use super::movement::Movement;
use super::report::{FrameReport, NamedPair, NamedVertex, Spread, Yielding};
use if_core::math::{Point, Real};
use if_core::monitor::Monitor;
use if_mesh::measure::strain;
use if_outfit::Layer;
use if_outfit::motion::{Pinched, Proof, VertexInside, Walker};
use if_outfit::pinch::extent;
use if_outfit::report::{Extent, PinchReport};

/// Measures frames.
#[derive(Debug)]
pub(super) struct Measurer<'a> {
    movement: Movement<'a>,
    /// The clean outfit, before layers were moved apart.
    rest: Vec<Point>,
}

impl<'a> Measurer<'a> {
    pub(super) fn new(movement: Movement<'a>) -> Self {
        Self { movement, rest: movement.positions() }
    }

    /// The row of a frame, but for how it was reached and its jitter. `walker` verifies.
    pub(super) fn verify(
        &self,
        walker: &Walker,
        positions: &[Point],
    ) -> Result<FrameReport, AnimateError> {
        Ok(self.row(walker, positions, walker.prove(positions)?))
    }

    /// The frame over a body that is displaced by at most `depth` metres, and its row; `None` if it
    /// is not displaced by more, unless it is to be exactly as skinned.
    pub(super) fn within(
        &self,
        walker: &mut Walker,
        frame: usize,
        (positions, depth): (&[Point], Real),
        monitor: &mut dyn Monitor,
    ) -> Result<Option<(Vec<Point>, FrameReport)>, AnimateError> {
        let skinned = self.movement.posed(frame, &self.rest)?;
        let moves = skinned.iter().zip(positions).map(|(a, b)| b - a);
        let body = walker.layer(&skinned, 0).len();
        let largest = moves.clone().take(body).map(|u| u.norm()).fold(0.0, Real::max);
        if depth > 0.0 && largest <= depth {
            return Ok(None);
        }
        let capped = skinned.iter().zip(moves).map(|(p, u)| p + u.cap_magnitude(depth));
        let reference: Vec<Point> = capped.collect();
        let (kept, found) = walker.keep(positions, &reference, monitor)?;
        let row = self.row(walker, &kept, found);
        Ok(Some((kept, row)))
    }

    fn row(&self, walker: &Walker, positions: &[Point], found: Proof) -> FrameReport {
        let names: Vec<&str> = self.movement.outfit().layers().map(|l| l.name.as_str()).collect();
        let pair = |pair: &[(usize, u32); 2]| NamedPair {
            layers: pair.map(|(layer, _)| names[layer].to_owned()),
            triangles: pair.map(|(_, triangle)| triangle),
        };
        let vertex = |v: &VertexInside| NamedVertex {
            layer: names[v.layer].to_owned(),
            below: names[v.below].to_owned(),
            vertex: v.vertex,
            place: walker.layer(positions, v.layer)[v.vertex as usize].into(),
        };
        let (body_own, own) = found.own_pairs.split_first().map_or((0, &[][..]), |(b, o)| (*b, o));
        FrameReport {
            pairs: found.pairs,
            inside: found.inside,
            own_pairs: own.iter().sum(),
            body_own_pairs: body_own,
            new_own_pairs: found.new_own_pairs,
            first_pairs: found.first_pairs.iter().map(pair).collect(),
            first_inside: found.first_inside.iter().map(vertex).collect(),
            pinch: found.pinched.map(|pinched| self.pinch(&pinched)),
            ..FrameReport::default()
        }
    }

    /// What lies in pinches, by the names of garments.
    fn pinch(&self, pinched: &Pinched) -> PinchReport {
        let garments = self.movement.outfit().garments.iter();
        let found = garments.zip(&pinched.pairs).zip(&pinched.inside);
        let found = found.map(|((g, pairs), inside)| (g.name.as_str(), pairs.clone(), *inside));
        PinchReport::new(pinched.body.len(), found)
    }

    /// Adds what is measured of a frame that is kept, but for its jitter.
    pub(super) fn measure(
        &self,
        walker: &Walker,
        frame: usize,
        positions: &[Point],
        row: &mut FrameReport,
    ) -> Result<(), AnimateError> {
        let skinned = self.movement.posed(frame, &self.rest)?;
        let garments = walker.layer(&skinned, 0).len();
        let moved = skinned[garments..].iter().zip(&positions[garments..]);
        let strains = |x: &[Point]| {
            let of =
                |(k, garment): (usize, &Layer)| strain(&garment.mesh, walker.layer(x, k + 1)).p99;
            self.movement.outfit().garments.iter().enumerate().map(of).fold(0.0, Real::max)
        };
        let before = walker.intersections(&skinned)?;
        row.pairs_before = before.len();
        row.moved = Spread::of(moved.map(|(a, b)| (b - a).norm()).collect());
        row.strain_p99 = strains(positions);
        row.strain_p99_skinned = strains(&skinned);
        let met: Vec<u32> = before
            .iter()
            .filter(|[a, b]| a.0 == 0 && b.0 == 0)
            .flat_map(|[a, b]| [a.1, b.1])
            .collect();
        let body = [&skinned[..], positions].map(|x| walker.layer(x, 0));
        row.body = self.yielding(body, &met);
        Ok(())
    }

    /// How the body yields that meets itself in the triangles `met`, in pairs.
    fn yielding(&self, [skinned, now]: [&[Point]; 2], met: &[u32]) -> Yielding {
        let mesh = &self.movement.outfit().body.mesh;
        let moved = skinned.iter().zip(now).map(|(a, b)| (b - a).norm()).collect();
        let corners = met.iter().flat_map(|t| mesh.triangles()[*t as usize]);
        let places: Vec<Point> = corners.map(|v| skinned[v as usize]).collect();
        let Extent { area, reach, .. } = extent(mesh, skinned, now, &places);
        let own_pairs_before = met.len() / 2;
        Yielding { own_pairs_before, reach, area, moved: Spread::of(moved), ..Yielding::default() }
    }
}
