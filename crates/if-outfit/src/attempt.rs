//! One attempt at an outfit: its garments are put on layer by layer, inner to outer.
//!
//! ```text
//! untangle each garment that intersects itself                              untangle.rs
//! from the first garment on that cannot lie over another: nothing           obstacle.rs
//! for each garment before it, inner to outer
//!     settle it over those below, verify it exactly, freeze it       dressing.rs
//!     stuck over garments that it met, and tucking is allowed:
//!         press those in below it, and go back to the innermost      upper_layers.rs
//!     left with intersections all the same: those give way to it as it lies      giving_way.rs
//! untangle garments of which own pairs are left, where layers stay clean
//! something remains:
//!     all of this once more, with denser samples and a finer grid, if less remains then
//! something remains, and a loose garment bridges what one over it encloses:
//!     all of this once more, with the loose one pressed in and lifted there, if less remains then      ways_in.rs
//! ```

use crate::contacts::COARSE;
use crate::dressing::{Dressed, Dressing};
use crate::findings::Findings;
use crate::obstacle::{Obstacle, obstacles};
use crate::outfit::Outfit;
use crate::params::{Own, ResolveParams, Tuck};
use crate::progress::{GarmentProgress, UNTANGLE, VERIFY};
use crate::report::{LayerReport, OwnPairs, ResolveReport, Skipped, Verification};
use crate::settle::Settings;
use crate::splitting::{self, Finer};
use crate::untangle::{Untangled, kept, untangle, untangle_settled};
use crate::upper_layers::TightGarments;
use crate::verify::{verify_changed, verify_layers};
use crate::ways_in::{WaysIn, ways_in};
use crate::workpiece::SettleError;
use if_core::math::Real;
use if_core::monitor::{Cancelled, Monitor};
use if_mesh::solid::ClosedLayer;
use if_mesh::split::SplitMesh;
use if_xpbd::report::StepError;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Instant;
use tracing::trace_span;

/// Why an attempt ended early.
pub(crate) enum AttemptError {
    /// The monitor cancelled.
    Cancelled(Cancelled),
    /// A step of the solver failed for the garment with this name.
    Step(String, StepError),
}

/// An outfit and what came of it.
pub(crate) struct Attempt {
    /// The input of this attempt.
    pub(crate) outfit: Outfit,
    /// What was found in it, for each garment.
    pub(crate) given: Vec<Findings>,
    /// Seconds that this took.
    pub(crate) verify_seconds: Real,
    /// What untangling did to each garment.
    untangled: Untangling,
    /// What hinders garments from lying over others.
    obstacles: Vec<Obstacle>,
    /// For each garment where it settled.
    pub(crate) dressed: Vec<Dressed>,
    /// The closed layers there, the body first, without the outermost garment's.
    pub(crate) closed: Vec<Arc<ClosedLayer>>,
    /// For each garment how its triangles were split before the attempt, if they were.
    pub(crate) splits: Vec<Option<SplitMesh>>,
}

/// What untangling did to each garment.
struct Untangling {
    /// Own pairs left before it settled, sorted.
    left: Vec<Vec<[u32; 2]>>,
    /// Own pairs that come apart at too high a cost.
    costly: Vec<BTreeSet<[u32; 2]>>,
    /// Rounds made, before and after.
    rounds: Vec<usize>,
}

impl Attempt {
    /// Resolves `outfit` as far as it goes.
    pub(crate) fn new(
        outfit: Outfit,
        settings: Settings<'_>,
        monitor: &mut dyn Monitor,
    ) -> Result<Self, AttemptError> {
        let start = Instant::now();
        let count = outfit.garments.len();
        if let Some(first) = outfit.garments.first() {
            // Before anything that takes time, so that it can be cancelled at once.
            let mut progress = GarmentProgress { monitor, name: &first.name, index: 0, count };
            progress.report(VERIFY, 0, None).map_err(AttemptError::Cancelled)?;
        }
        let (given, closed) = verify_layers(&outfit, settings.body);
        let verify_seconds = start.elapsed().as_secs_f64();
        let mut costly = vec![BTreeSet::new(); count];
        let untangled = untangle_garments(&outfit, &given, settings.params, &mut costly, monitor)?;
        let changed: Vec<bool> = untangled.iter().map(Option::is_some).collect();
        let mut worked = outfit.clone();
        for (garment, untangled) in worked.garments.iter_mut().zip(&untangled) {
            if let Some(Untangled { positions, .. }) = untangled {
                let mesh = garment.mesh.with_vertices(positions.clone());
                garment.mesh = mesh.expect("the solver keeps positions finite");
            }
        }
        let verified = verify_changed(&worked, &changed, given.clone(), closed);
        let obstacles =
            trace_span!("obstacles").in_scope(|| obstacles(&worked, &verified.0, &verified.1));
        let mut wear = |tight, ways_in: &[WaysIn], settings| {
            let (outfits, hindrances) = ([&outfit, &worked], (&obstacles[..], ways_in));
            wear(outfits, &verified, hindrances, tight, &costly, settings, monitor)
        };
        let always = settings.params.goal.tuck == Tuck::Always;
        let tight: BTreeSet<usize> = if always { (0..count).collect() } else { BTreeSet::new() };
        let mut worn = wear(tight.clone(), &[], settings)?;
        let mut left = remaining(&worn.dressed, &given);
        let finer = finer(settings.params);
        let finer = Settings { params: &finer, ..settings };
        let is_hopeless = obstacles.iter().any(Obstacle::is_hopeless);
        if left > 0 && !is_hopeless {
            tracing::debug!(left, "put on once more, with denser samples");
            let again = tried(wear(tight, &[], finer))?;
            let again = again.map(|again| (remaining(&again.dressed, &given), again));
            if let Some(better) = again.filter(|(then, _)| *then < left) {
                (left, worn) = better;
            }
        }
        let may_lift = settings.params.goal.tuck != Tuck::Never && !obstacles.is_empty();
        if may_lift && !is_hopeless && left > 0 {
            let ways_in =
                trace_span!("obstacles").in_scope(|| ways_in(&worked, &obstacles, &verified.1));
            tracing::debug!(
                lifted = ways_in.len(),
                "put on once more, lifted to armpits and crotch"
            );
            let tight = worn.tight.iter().copied().chain(ways_in.iter().map(|ways| ways.outer));
            let again = tried(wear(tight.collect(), &ways_in, finer))?;
            if let Some(again) = again.filter(|again| remaining(&again.dressed, &given) < left) {
                worn = again;
            }
        }
        let Worn { dressed, closed, untangling_rounds, costly, .. } = worn;
        let rounds = untangled.iter().zip(untangling_rounds);
        let rounds = rounds.map(|(u, more)| u.as_ref().map_or(0, |u| u.rounds) + more).collect();
        let left = |(given, untangled): (&Findings, Option<Untangled>)| match untangled {
            Some(untangled) => untangled.pairs,
            None => given.own.clone(),
        };
        let left = given.iter().zip(untangled).map(left).collect();
        let untangled = Untangling { left, costly, rounds };
        let splits = vec![None; count];
        Ok(Self { outfit, given, verify_seconds, untangled, obstacles, dressed, closed, splits })
    }

    /// Intersecting pairs and vertices on a wrong side that remain.
    pub(crate) fn remaining(&self) -> usize {
        remaining(&self.dressed, &self.given)
    }

    /// The lower the better: that nothing remains is more important than little strain.
    pub(crate) fn rank(&self) -> (usize, Real) {
        let strain = self.dressed.iter().map(|dressed| dressed.strain.rms).fold(0.0, Real::max);
        (self.remaining(), strain)
    }

    /// What this attempt was at with the triangles split that are too large ([`splitting::finer`]).
    pub(crate) fn finer(&self, params: &ResolveParams) -> Option<Finer> {
        splitting::finer(&self.outfit, &self.given, &self.dressed, params)
    }

    /// The report, where `before` is that of the outfit before any splitting. Its seconds are 0.
    pub(crate) fn report(&self, before: Verification, params: &ResolveParams) -> ResolveReport {
        let findings = self.dressed.iter().map(|dressed| &dressed.findings);
        let seconds = self.dressed.iter().map(|dressed| dressed.verify_seconds).sum();
        // The body does not move.
        let body = (self.closed[0].body_report(), before.body_own_pairs);
        let after = Verification::new(&self.outfit, body, findings, seconds);
        let layers = (0..self.dressed.len()).map(|k| self.layer_report(k, params)).collect();
        let left = |o: &&Obstacle| {
            let mut pairs = after.pairs.iter();
            pairs.any(|p| (&p.inner, &p.outer) == (&o.inner, &o.outer) && !p.is_clean())
        };
        let obstacles = self.obstacles.iter().filter(left).cloned().collect();
        ResolveReport { before, after, layers, obstacles, ..ResolveReport::default() }
    }

    fn layer_report(&self, index: usize, params: &ResolveParams) -> LayerReport {
        let (dressed, given) = (&self.dressed[index], &self.given[index]);
        let Dressed { findings, settled, moved, strain, layers_apart, seconds, .. } = dressed;
        let new = findings.new_own(given).len();
        let unused_rounds =
            (params.effort.rounds + settled.eased.rounds).saturating_sub(settled.rounds);
        let mut strategies = settled.counts;
        let (left, costly) = (&self.untangled.left[index], &self.untangled.costly[index]);
        strategies.untangling_rounds = self.untangled.rounds[index];
        strategies.untangled_own_pairs = given.own.len() - left.len();
        let removes = params.goal.own == Own::Remove && !findings.own.is_empty();
        let kept_own_pairs =
            if removes { kept(&dressed.mesh, &given.own, left, costly) } else { Vec::new() };
        LayerReport {
            name: self.outfit.garments[index].name.clone(),
            moved: *moved,
            strain: *strain,
            own_pairs: OwnPairs { before: given.own.len(), after: findings.own.len(), new },
            kept_own_pairs,
            rounds: settled.rounds,
            repairs: settled.repairs,
            strategies,
            sweeps: settled.sweeps,
            queries: settled.queries,
            tucked: settled.tucked,
            eased: settled.eased.strain,
            algorithm1: settled.algorithm1.clone(),
            split: self.splits[index].as_ref().map_or(0, SplitMesh::split_triangles),
            skipped: Skipped {
                layers: *layers_apart,
                vertices: settled.held,
                queries: settled.skipped,
                sweeps: unused_rounds * params.effort.sweeps,
            },
            seconds: *seconds,
        }
    }
}

/// Parameters with contacts at all middles that would be sampled during repairs alone, and a finer grid
/// of outward directions. It takes a fifth more time, and some outfits that are hard to put on end
/// clean.
fn finer(params: &ResolveParams) -> ResolveParams {
    let mut finer = params.clone();
    finer.effort.long_edge /= COARSE;
    finer.effort.outward_cell /= 1.5;
    finer
}

/// Garments that were put on.
struct Worn {
    dressed: Vec<Dressed>,
    /// As [`Attempt::closed`].
    closed: Vec<Arc<ClosedLayer>>,
    /// Those that garments below were pressed in under.
    tight: BTreeSet<usize>,
    /// For each garment the rounds of untangling after it settled.
    untangling_rounds: Vec<usize>,
    /// For each garment own pairs that come apart at too high a cost, before it settled or after.
    costly: Vec<BTreeSet<[u32; 2]>>,
}

/// Intersecting pairs and vertices on a wrong side that remain; `given` is what was found in the input.
fn remaining(dressed: &[Dressed], given: &[Findings]) -> usize {
    dressed.iter().zip(given).map(|(dressed, given)| dressed.remaining(given)).sum()
}

/// What one more try made; `None` if a step of the solver failed in it: then what is there already
/// counts.
fn tried<T>(result: Result<T, AttemptError>) -> Result<Option<T>, AttemptError> {
    match result {
        Err(AttemptError::Step(garment, error)) => {
            tracing::warn!(garment, %error, "what was tried once more failed");
            Ok(None)
        }
        result => result.map(Some),
    }
}

/// [Dresses](dress) an outfit, and untangles what is left, but for what is `costly`.
fn wear(
    [input, outfit]: [&Outfit; 2],
    verified: &(Vec<Findings>, Vec<Arc<ClosedLayer>>),
    hindrances: (&[Obstacle], &[WaysIn]),
    mut tight: BTreeSet<usize>,
    costly: &[BTreeSet<[u32; 2]>],
    settings: Settings<'_>,
    monitor: &mut dyn Monitor,
) -> Result<Worn, AttemptError> {
    let (mut dressed, mut closed) =
        dress([input, outfit], verified, hindrances, &mut tight, settings, monitor)?;
    let mut untangling_rounds = vec![0; dressed.len()];
    let mut costly = costly.to_vec();
    if settings.params.goal.own == Own::Remove {
        let _phase = trace_span!("untangling").entered();
        untangling_rounds = untangle_settled(
            input,
            &mut dressed,
            &mut closed,
            settings.params,
            &mut costly,
            monitor,
        )
        .map_err(AttemptError::Cancelled)?;
    }
    Ok(Worn { dressed, closed, tight, untangling_rounds, costly })
}

/// Dresses `outfit`, the untangled form of `input`: returns the garments and all closed layers but the
/// outermost. `given` is what was found in `outfit`, and `closed` are its layers; garments below those
/// in `tight` are pressed in, to which those are added that get stuck.
fn dress(
    [input, outfit]: [&Outfit; 2],
    (given, closed): &(Vec<Findings>, Vec<Arc<ClosedLayer>>),
    (obstacles, ways_in): (&[Obstacle], &[WaysIn]),
    tight: &mut BTreeSet<usize>,
    settings: Settings<'_>,
    monitor: &mut dyn Monitor,
) -> Result<(Vec<Dressed>, Vec<Arc<ClosedLayer>>), AttemptError> {
    let goal = &settings.params.goal;
    let count = outfit.garments.len();
    // From the first garment on that cannot lie over another, all stay as they came.
    let is_hopeless = |name: &str| obstacles.iter().any(|o| o.outer == name && o.is_hopeless());
    let end = outfit.garments.iter().position(|g| is_hopeless(&g.name)).unwrap_or(count);
    let mut above = TightGarments::new(outfit, given, closed, tight, ways_in, goal);
    let mut dressing = Dressing::new([input, outfit], given, &closed[0], settings);
    let mut index = 0;
    while index < count {
        let name = &outfit.garments[index].name;
        let mut progress = GarmentProgress { monitor, name, index, count };
        let tucking_helps = goal.tuck == Tuck::IfStuck && !tight.contains(&index);
        let layer = closed.get(index + 1);
        if index >= end {
            dressing.leave(index, layer);
            index += 1;
            continue;
        }
        let put_on = dressing.put_on(index, layer, &above, tucking_helps, &mut progress);
        match put_on.and_then(|()| dressing.give_way(index, &mut progress)) {
            Ok(()) => index += 1,
            Err(SettleError::Cancelled(cancelled)) => {
                return Err(AttemptError::Cancelled(cancelled));
            }
            Err(SettleError::Step(error)) => {
                return Err(AttemptError::Step(name.clone(), error));
            }
            Err(SettleError::Stuck) => {
                tracing::debug!(garment = name, "stuck: the layers below are pressed in");
                tight.insert(index);
                above = TightGarments::new(outfit, given, closed, tight, ways_in, goal);
                index = (0..index).find(|k| above.press(*k)).unwrap_or(index);
                dressing.take_off(index);
            }
        }
    }
    Ok((dressing.dressed, dressing.below))
}

/// Untangles the garments that intersect themselves, in which `given` was found; `None` for those in
/// which nothing changes. `costly` receives for each what [`untangle`] finds so.
fn untangle_garments(
    outfit: &Outfit,
    given: &[Findings],
    params: &ResolveParams,
    costly: &mut [BTreeSet<[u32; 2]>],
    monitor: &mut dyn Monitor,
) -> Result<Vec<Option<Untangled>>, AttemptError> {
    let _phase = trace_span!("untangling").entered();
    let count = outfit.garments.len();
    let mut all = Vec::with_capacity(count);
    for (index, (garment, found)) in outfit.garments.iter().zip(given).enumerate() {
        if found.own.is_empty() || params.goal.own == Own::Keep {
            all.push(None);
            continue;
        }
        let mut progress = GarmentProgress { monitor, name: &garment.name, index, count };
        let mut report = |pairs| progress.report(UNTANGLE, 0, Some(pairs));
        let start = garment.mesh.vertices();
        let costly = &mut costly[index];
        let untangled = untangle(garment, start, params, costly, &mut |_| true, &mut report);
        all.push(untangled.map_err(AttemptError::Cancelled)?);
    }
    Ok(all)
}
