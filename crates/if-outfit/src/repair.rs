//! Repair strategies: what is done about the intersections that contacts and cloth leave.
//!
//! Each strategy is a type with one method, in a file of its own, and what it did is counted in
//! [`RepairCounts`](crate::report::RepairCounts). [`Strategies`] states their order. Three more work
//! on whole outfits: garments that get stuck are tucked ([`crate::upper_layers`]), those below give
//! way ([`crate::giving_way`]), and triangles that are too large are split ([`crate::splitting`]).

mod easing;
mod exit_directions;
mod gap_growth;
mod self_separation;
mod separating_planes;
mod smoothing;
mod tuck_release;
mod vertex_escape;
mod yielding;

use crate::progress::GarmentProgress;
use crate::workpiece::{SettleError, Workpiece};
use if_core::math::{Point, Real};
use if_mesh::solid::ClosedLayer;
use std::ops::ControlFlow;

/// One repair strategy.
pub(crate) trait Repair {
    /// Changes the garment, or the constraints of its next round, where the strategy applies.
    /// Breaks if the garment is as good as it gets.
    fn apply(
        &mut self,
        work: &mut Workpiece<'_>,
        progress: &mut GarmentProgress<'_>,
    ) -> Result<ControlFlow<()>, SettleError>;
}

/// All strategies in the order in which they are applied.
pub(crate) struct Strategies {
    /// After each verification, before the state is ranked.
    pub(crate) before_ranking: [Box<dyn Repair>; 2],
    /// After the state was ranked: they prepare the next round.
    pub(crate) after_ranking: [Box<dyn Repair>; 6],
    /// On the best state, after the last round.
    pub(crate) of_best: [Box<dyn Repair>; 1],
}

impl Strategies {
    pub(crate) fn new() -> Self {
        Self {
            before_ranking: [
                Box::new(vertex_escape::VertexEscape),
                Box::new(tuck_release::TuckRelease),
            ],
            after_ranking: [
                Box::<yielding::Yielding>::default(),
                Box::<gap_growth::GapGrowth>::default(),
                Box::<separating_planes::SeparatingPlanes>::default(),
                Box::new(exit_directions::ExitDirections),
                Box::<self_separation::SelfSeparation>::default(),
                Box::<smoothing::Smoothing>::default(),
            ],
            of_best: [Box::new(easing::Easing)],
        }
    }
}

/// How far intersecting triangles are separated beyond contact, in metres. Ten times less is lost
/// when positions are rounded to single precision; ten times more is visible.
const SEPARATION: Real = 0.15e-3;
/// The same for triangles of one garment.
const OWN_SEPARATION: Real = 0.1e-3;

/// Whether `p` is at least `gap` metres outside all layers.
pub(crate) fn is_clear(p: &Point, below: &[&ClosedLayer], gap: Real) -> bool {
    below.iter().all(|l| l.sided(p, gap).is_none_or(|s| s.distance >= gap))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::incremental_verification::IncrementalVerification;
    use crate::outfit::Layer;
    use crate::params::ResolveParams;
    use crate::upper_layers::{UpperLayer, UpperLayers};
    use crate::workpiece::Scene;
    use if_core::mesh::TriMesh;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::{icosphere, tube};
    use if_mesh::index::Bvh;
    use if_mesh::outward::Outward;
    use std::collections::BTreeSet;

    pub(crate) fn unchanged(band: &TriMesh) -> TriMesh {
        band.clone()
    }

    pub(crate) fn try_apply(
        strategy: &mut dyn Repair,
        work: &mut Workpiece<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        let mut monitor = Silent;
        let mut progress =
            GarmentProgress { monitor: &mut monitor, name: "band", index: 0, count: 1 };
        strategy.apply(work, &mut progress)
    }

    /// Applies a strategy that neither fails nor breaks.
    pub(crate) fn apply(strategy: &mut dyn Repair, work: &mut Workpiece<'_>) {
        assert!(matches!(try_apply(strategy, work), Ok(ControlFlow::Continue(()))));
    }

    /// A band of `radius` round the y axis, 0.2 m high, on edges of 2 cm.
    fn band(radius: Real) -> TriMesh {
        let tube = tube(radius, 0.2, 96, 10, false);
        let low = tube.vertices().iter().map(|p| Point::new(p.x, p.y - 0.1, p.z)).collect();
        tube.with_vertices(low).unwrap()
    }

    /// A changed band round a ball of 0.3 m, all of it held.
    pub(crate) fn with_band(
        radius: Real,
        change: impl FnOnce(&TriMesh) -> TriMesh,
        then: impl FnOnce(&mut Workpiece<'_>),
    ) {
        on_a_ball(change(&band(radius)), UpperLayers::default(), then);
    }

    /// A band that cuts into a ball, with a layer above that is smaller than the ball.
    pub(crate) fn under_a_tight_band(then: impl FnOnce(&mut Workpiece<'_>)) {
        let ball = icosphere(0.3, 4);
        let tight = ClosedLayer::garment(&band(0.29), &ClosedLayer::body(&ball), &ball);
        let covered = vec![true; band(0.299).vertices().len()];
        let layers = [UpperLayer { layer: &tight, gap: 1e-3, least: 0.0, covered, ways_in: &[] }];
        let above = UpperLayers { layers: &layers, tuck_distance: 0.05 };
        on_a_ball(band(0.299), above, then);
    }

    fn on_a_ball(mesh: TriMesh, above: UpperLayers<'_>, then: impl FnOnce(&mut Workpiece<'_>)) {
        let (garment, ball) = (Layer::new("band", mesh), ClosedLayer::body(&icosphere(0.3, 4)));
        let (below, params) = ([&ball], ResolveParams::default());
        let (below, params, tree) = (&below[..], &params, Bvh::new(&garment.mesh));
        let region = garment.mesh.aabb().inflated(0.05);
        let outward = &Outward::new(below, &region, params.effort.outward_cell);
        let garment = &garment;
        let scene = Scene { garment, below, above, outward, params, skip: true, may_yield: true };
        let verified = IncrementalVerification::new(&garment.mesh, &tree, below);
        then(&mut Workpiece::new(scene, tree, verified, BTreeSet::new()));
    }
}
