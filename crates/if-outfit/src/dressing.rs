//! The body with the garments put on so far, inner to outer: each settled, verified and frozen.

use crate::outfit::Outfit;
use crate::progress::{DONE, GarmentProgress, VERIFY};
use crate::report::{LayerReport, PairReport, ResolveReport, Skipped, Verification};
use crate::resolve::ResolveParams;
use crate::settle::{SettleError, Settled, settle};
use crate::upper_layers::{Above, Ceilings};
use crate::verify::against;
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;
use if_mesh::measure::{displacement, strain};
use if_mesh::solid::ClosedLayer;
use std::sync::Arc;
use std::time::Instant;

/// The layers put on so far.
pub(crate) struct Dressing<'a> {
    outfit: &'a Outfit,
    /// The outfit with the garments put on where they settled, and the others as they came.
    pub(crate) result: Outfit,
    /// What was found and done.
    pub(crate) report: ResolveReport,
    /// The layers put on, the body first.
    below: Vec<(String, Arc<ClosedLayer>)>,
}

impl<'a> Dressing<'a> {
    /// The naked body of `outfit`, which was found as `before` says.
    pub(crate) fn new(outfit: &'a Outfit, before: Verification, body: &Arc<ClosedLayer>) -> Self {
        Self {
            outfit,
            result: outfit.clone(),
            report: ResolveReport { before, ..Default::default() },
            below: vec![(outfit.body.name.clone(), Arc::clone(body))],
        }
    }

    /// Takes off the garments from `index` on.
    pub(crate) fn take_off(&mut self, index: usize) {
        self.below.truncate(index + 1);
        self.report.layers.truncate(index);
        self.report.after.own_pairs.truncate(index);
        let on: Vec<&str> = self.below.iter().skip(1).map(|(name, _)| name.as_str()).collect();
        self.report.after.pairs.retain(|p| on.contains(&p.outer.as_str()));
        for k in index..self.outfit.garments.len() {
            self.result.garments[k].mesh = self.outfit.garments[k].mesh.clone();
        }
    }

    /// Puts on the garment `index`, which `as_it_came` holds closed; those before it are on.
    ///
    /// # Errors
    ///
    /// [`SettleError::Cancelled`] if the monitor cancels; [`SettleError::Stuck`] if the garment makes
    /// no progress over others that it met, and `may_halt`; [`SettleError::Step`] if a step of the
    /// solver fails.
    pub(crate) fn put_on(
        &mut self,
        index: usize,
        as_it_came: Option<&Arc<ClosedLayer>>,
        above: &Above,
        may_halt: bool,
        params: &ResolveParams,
        progress: &mut GarmentProgress<'_>,
    ) -> Result<(), SettleError> {
        let (outfit, report, below) = (self.outfit, &mut self.report, &mut self.below);
        let garment = &outfit.garments[index];
        let begun = Instant::now();
        progress.report(VERIFY, 0, None)?;
        let reach = garment.mesh.aabb().inflated(params.clearance + params.margin);
        let apart = below.iter().filter(|(_, c)| !c.bvh().aabb().overlaps(&reach)).count();
        let near: Vec<&ClosedLayer> = below.iter().map(|(_, c)| c.as_ref()).collect();
        let found: Vec<PairReport> =
            report.before.pairs.iter().filter(|p| p.outer == garment.name).cloned().collect();
        let ceilings = above.of(index);
        // Where all layers so far lie as they came, what was found before holds.
        let as_they_came = report.layers.iter().all(|l| l.moved.vertices == 0);
        let needs_nothing =
            as_they_came && ceilings.is_empty() && found.iter().all(PairReport::is_clean);
        let settled = if needs_nothing {
            Settled::as_it_is(garment)
        } else {
            let above = Ceilings { layers: &ceilings, reach: above.reach() };
            let could_tuck = found.iter().any(|p| p.inner != outfit.body.name && !p.is_clean());
            let may_yield = !(may_halt && could_tuck);
            settle(garment, &near, above, may_yield, params, progress)?
        };
        let mesh =
            garment.mesh.with_vertices(settled.positions).expect("settled positions are finite");
        let own = if needs_nothing {
            report.after.pairs.extend(found);
            report.before.own_pairs[index]
        } else {
            let verifying = Instant::now();
            let tree = Bvh::new(&mesh);
            let names: Vec<(&str, &ClosedLayer)> =
                below.iter().map(|(n, c)| (n.as_str(), c.as_ref())).collect();
            report.after.pairs.extend(against(garment, &mesh, &tree, &names));
            let own = own_pairs(&mesh, &tree).len();
            report.after.seconds += verifying.elapsed().as_secs_f64();
            own
        };
        report.after.own_pairs.push(own);
        let moved = displacement(garment.mesh.vertices(), mesh.vertices());
        report.layers.push(LayerReport {
            name: garment.name.clone(),
            moved,
            strain: strain(&garment.mesh, mesh.vertices()),
            own_pairs: [report.before.own_pairs[index], own],
            rounds: settled.rounds,
            repairs: settled.repairs,
            sweeps: settled.sweeps,
            queries: settled.queries,
            tucked: settled.tucked,
            eased: settled.eased,
            split: 0,
            skipped: Skipped {
                layers: apart,
                vertices: settled.held,
                queries: settled.spared,
                sweeps: params.rounds.saturating_sub(settled.rounds) * params.sweeps,
            },
            seconds: begun.elapsed().as_secs_f64(),
        });
        if index + 1 < outfit.garments.len() {
            let layer = match as_it_came {
                Some(layer) if moved.vertices == 0 => Arc::clone(layer),
                _ => Arc::new(ClosedLayer::garment(&mesh, &below[0].1, &outfit.body.mesh)),
            };
            below.push((garment.name.clone(), layer));
        }
        self.result.garments[index].mesh = mesh;
        Ok(progress.report(DONE, settled.rounds, None)?)
    }
}
