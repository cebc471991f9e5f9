//! One garment over the layers below it: contacts and cloth settle, exact verification finds what
//! remains, and repair strategies work on that.
//!
//! ```text
//! sources ← vertices inside a layer below, or of triangles that intersect one, or out of a layer above
//! if there are none: return the input, bit for bit
//! method = paper: settle all vertices by Algorithm 1, and begin with repairs             algorithm1.rs
//! its triangles are small: settle large ones instead, and begin with repairs           coarse.rs
//! find other ways out where the nearest leads back under the garment          ways_out.rs
//! hold every vertex that is further from sources than `influence`
//! rounds as below, as many more as vertices far out of a layer above need
//! repeat
//!     find contacts with the layers below                                    contacts.rs
//!     repeat `sweeps` times, quasi-statically                                cloth.rs
//!         anchors, bending, stretch (lines 16 to 22), ties of folds, limit of strain
//!         layers above; contacts (lines 6 to 15), separating planes, own pairs held apart
//!     (while the cloth yields: contacts alone)
//!     every 5th round, or if nothing moved, or while repairing:
//!         verify exactly: pairs with layers below, sides, new own pairs      incremental_verification.rs
//!         strategies that change what is ranked                              repair.rs
//!         keep the state if it is the best; stop if it is clean and relaxed
//!         strategies that prepare the next round                             repair.rs
//!         free the vertices near all that was found;
//!         after `settle_rounds`: hold all but the neighbourhood of what remains
//! until nothing remains, or `rounds` are over
//! strategies for the best state, if it is clean                              repair.rs
//! ```

use crate::algorithm1;
use crate::coarse::Coarse;
use crate::incremental_verification::IncrementalVerification;
use crate::layer_fields::FieldOfGarment;
use crate::outfit::Layer;
use crate::params::{Method, ResolveParams};
use crate::prepared_body::PreparedBody;
use crate::progress::{GarmentProgress, REPAIR, SETTLE};
use crate::repair::{self, Repair};
use crate::report::{Algorithm1Report, RepairCounts};
use crate::upper_layers::UpperLayers;
use crate::ways_out::Reroute;
use crate::workpiece::{Eased, Scene, SettleError, Workpiece};
use if_core::math::Point;
use if_mesh::index::Bvh;
use if_mesh::outward::Outward;
use if_mesh::solid::ClosedLayer;
use std::ops::ControlFlow;
use tracing::trace_span;

/// While settling, every so many rounds are verified.
const VERIFY_EVERY: usize = 5;

/// A settled garment.
pub(crate) struct Settled {
    /// Its positions; those of the input if nothing had to move.
    pub(crate) positions: Vec<Point>,
    /// Rounds of settling, repair and easing.
    pub(crate) rounds: usize,
    /// Those of repair and easing.
    pub(crate) repairs: usize,
    pub(crate) counts: RepairCounts,
    pub(crate) sweeps: usize,
    /// Nearest-point queries made and skipped.
    pub(crate) queries: usize,
    pub(crate) skipped: usize,
    /// Vertices that stuck out of a layer above, before and after.
    pub(crate) tucked: [usize; 2],
    pub(crate) eased: Eased,
    /// Vertices that were held throughout.
    pub(crate) held: usize,
    /// Pairs and vertices inside that remain.
    pub(crate) remaining: usize,
    /// What Algorithm 1 did, if it ran.
    pub(crate) algorithm1: Option<Algorithm1Report>,
}

impl Settled {
    /// What was done to a garment that settled `earlier` and again.
    pub(crate) fn after(self, earlier: &Self) -> Self {
        Self {
            rounds: earlier.rounds + self.rounds,
            repairs: earlier.repairs + self.repairs,
            counts: earlier.counts.plus(&self.counts),
            sweeps: earlier.sweeps + self.sweeps,
            queries: earlier.queries + self.queries,
            skipped: earlier.skipped + self.skipped,
            tucked: earlier.tucked,
            eased: if self.eased.rounds > 0 { self.eased } else { earlier.eased },
            held: earlier.held.min(self.held),
            remaining: self.remaining,
            algorithm1: earlier.algorithm1.clone(),
            positions: self.positions,
        }
    }

    /// With what was done to its coarse triangles before.
    fn after_coarse(mut self, coarse: &Self) -> Self {
        self.counts.coarse_rounds += coarse.rounds;
        self.sweeps += coarse.sweeps;
        self.queries += coarse.queries;
        self.skipped += coarse.skipped;
        self
    }

    /// Of a garment that needs nothing.
    pub(crate) fn unchanged(garment: &Layer) -> Self {
        let positions = garment.mesh.vertices().to_vec();
        Self {
            held: positions.len(),
            positions,
            rounds: 0,
            repairs: 0,
            counts: RepairCounts::default(),
            sweeps: 0,
            queries: 0,
            skipped: 0,
            remaining: 0,
            tucked: [0; 2],
            eased: Eased::default(),
            algorithm1: None,
        }
    }
}

/// How a garment settles.
#[derive(Clone, Copy)]
pub(crate) struct Settings<'a> {
    pub(crate) params: &'a ResolveParams,
    /// Whether queries that cannot find a contact are skipped.
    pub(crate) skip: bool,
    /// The fields that garments come with, inner to outer; empty if none does.
    pub(crate) fields: &'a [FieldOfGarment<'a>],
    /// A body that was prepared, if it is that of the outfit.
    pub(crate) body: Option<&'a PreparedBody>,
}

/// Brings `garment` outside the layers `below` (the body first), and below those `above` as far as
/// there is room. With `start` it begins there, with repairs. Else, if something remains, it settles
/// once more where more vertices can be led round a limb ([`Reroute::Sideways`]).
///
/// # Errors
///
/// [`SettleError::Cancelled`] if the monitor cancels, [`SettleError::Stuck`] instead of yielding if
/// `may_yield` is false, and [`SettleError::Step`] if a step of the solver fails.
pub(crate) fn settle(
    garment: &Layer,
    start: Option<&[Point]>,
    below: &[&ClosedLayer],
    above: UpperLayers<'_>,
    may_yield: bool,
    settings: Settings<'_>,
    progress: &mut GarmentProgress<'_>,
) -> Result<Settled, SettleError> {
    let mut tried = Tried::default();
    let mut by = |begin, reroute, tried: &mut Tried| {
        settle_once(garment, begin, below, above, may_yield, settings, (reroute, tried), progress)
    };
    let is_finished = |result: &Result<Settled, SettleError>| match result {
        Ok(settled) => settled.remaining == 0,
        Err(error) => !matches!(error, SettleError::Stuck),
    };
    let begin = start.map_or(Begin::Coarse, Begin::At);
    let mut first = by(begin, Reroute::Back, &mut tried).transpose().expect(ALWAYS);
    if tried.coarse && !is_finished(&first) {
        let again = by(Begin::AsGiven, Reroute::Back, &mut tried).transpose().expect(ALWAYS);
        first = match (first, again) {
            (Ok(first), Ok(again)) if first.remaining <= again.remaining => Ok(first),
            (_, again) => again,
        };
    }
    if is_finished(&first) || tried.ways.is_none() {
        return first;
    }
    match (first, by(Begin::AsGiven, Reroute::Sideways, &mut tried)) {
        (first, Ok(None) | Err(SettleError::Stuck | SettleError::Step(_))) => first,
        (Err(_), Ok(Some(again))) if again.remaining == 0 => Ok(again),
        (Ok(first), Ok(Some(again))) if again.remaining < first.remaining => {
            Ok(again.after(&first))
        }
        (first, Ok(Some(_))) => first,
        (_, Err(error)) => Err(error),
    }
}

/// Why the first way of settling has a result.
const ALWAYS: &str = "ways that lead back are always tried";

/// Where a garment begins to settle.
#[derive(Clone, Copy)]
enum Begin<'a> {
    /// As given.
    AsGiven,
    /// Where it lies after it has settled in [coarse] triangles, with repairs; as given if its own are
    /// not small.
    ///
    /// [coarse]: Coarse
    Coarse,
    /// Here, with repairs.
    At(&'a [Point]),
}

/// What was tried so far.
#[derive(Default)]
struct Tried {
    /// Whether it was in coarse triangles.
    coarse: bool,
    /// How many ways round limbs; `None` if no vertex may need one.
    ways: Option<usize>,
}

/// As [`settle`], one time. Returns `None` if the sideways ways are as many as those `tried` before.
fn settle_once(
    garment: &Layer,
    begin: Begin<'_>,
    below: &[&ClosedLayer],
    above: UpperLayers<'_>,
    may_yield: bool,
    settings: Settings<'_>,
    (reroute, tried): (Reroute, &mut Tried),
    progress: &mut GarmentProgress<'_>,
) -> Result<Option<Settled>, SettleError> {
    let Settings { params, skip, fields, .. } = settings;
    let mesh = &garment.mesh;
    let _phase = trace_span!("settling").entered();
    let verifying = trace_span!("verification").entered();
    let tree = Bvh::new(mesh);
    let (verification, remaining) = IncrementalVerification::new(mesh, &tree, below);
    drop(verifying);
    let unused: Vec<bool> = mesh.used_vertices().iter().map(|used| !used).collect();
    let sticking_out = above.sticking_out(mesh.vertices(), &unused);
    let start = if let Begin::At(start) = begin { Some(start) } else { None };
    if start.is_none() && remaining.is_clean() && sticking_out.is_empty() {
        return Ok(Some(Settled::unchanged(garment)));
    }
    let height = below[0].bvh().aabb().size().max();
    let region = mesh.surface_aabb().inflated(0.02 * height);
    let outward = &trace_span!("outward grid")
        .in_scope(|| Outward::new(below, &region, params.effort.outward_cell));
    let scene = Scene { garment, below, above, outward, params, skip, may_yield };
    let mut sources = remaining.vertices(mesh.triangles());
    sources.extend(sticking_out.iter().copied());
    let mut work = trace_span!("cloth")
        .in_scope(|| Workpiece::new(scene, tree, (verification, remaining), sources));

    work.counts.ways_in = above.layers.iter().map(|layer| layer.ways_in.len()).sum();
    // In coarse triangles, Algorithm 1 and a state to start from replace the rounds of settling:
    // repairs follow, unless it was enough.
    let (mut first, mut end) = (0, params.effort.rounds);
    let (mut coarse, mut algorithm1) = (None, None);
    let mut begin = match begin {
        Begin::Coarse if params.effort.method == Method::Contacts && above.layers.is_empty() => {
            coarse = settled_in_coarse(&work, settings, progress)?;
            coarse.as_mut().map(|coarse| std::mem::take(&mut coarse.positions))
        }
        _ => start.map(<[Point]>::to_vec),
    };
    tried.coarse |= coarse.is_some();
    if begin.is_none() && params.effort.method == Method::Contacts {
        let before = std::mem::replace(&mut tried.ways, work.find_ways_out(reroute));
        if reroute == Reroute::Sideways && tried.ways == before {
            return Ok(None);
        }
    }
    if begin.is_none() && params.effort.method == Method::Paper {
        let (positions, report) = algorithm1::settled(garment, below, fields, params, progress)?;
        begin = Some(positions);
        algorithm1 = Some(report);
    }
    if let Some(positions) = begin {
        work.go_to(&positions);
        first = params.effort.settle_rounds.min(params.effort.rounds - 1);
        work.round = first;
        work.verify();
        if work.rank(0.0) {
            end = first;
        }
        work.choose_free();
    }
    let pressing =
        above.rounds(mesh.vertices(), &unused).saturating_sub(params.effort.settle_rounds);
    for round in 0..pressing {
        progress.report(SETTLE, round, None)?;
        work.cloth.round(&mut work.contacts, &work.tree)?;
        work.tree.refit(&work.cloth.x);
    }
    let mut strategies = repair::Strategies::new();
    let (mut rounds, mut repairs) = (first, 0);
    for round in first..end {
        rounds = round + 1;
        work.round = round;
        let stage = if work.is_repairing() { REPAIR } else { SETTLE };
        progress.report(stage, round, Some(work.remaining.pairs.len()))?;
        if one_round(&mut work, &mut strategies, progress)?.is_break() {
            break;
        }
        repairs += usize::from(work.is_repairing());
    }
    work.round = rounds;
    let _ = apply(&mut strategies.of_best, &mut work, progress)?;

    let (positions, remaining) = match work.best {
        Some(best) => {
            let remaining = best.remaining();
            (best.positions, remaining)
        }
        None => (work.cloth.stored(), work.remaining.count()),
    };
    let settled = Settled {
        tucked: [sticking_out.len(), above.sticking_out(&positions, &unused).len()],
        positions,
        rounds: pressing + rounds - first + work.eased.rounds,
        repairs: repairs + work.eased.rounds,
        counts: work.counts,
        sweeps: work.cloth.sweeps,
        queries: work.contacts.search.queries,
        skipped: work.contacts.search.skipped,
        eased: work.eased,
        // Algorithm 1 holds no vertex.
        held: match algorithm1 {
            Some(_) => 0,
            None => work.cloth.ever_free.iter().filter(|free| !**free).count(),
        },
        remaining,
        algorithm1,
    };
    Ok(Some(match &coarse {
        Some(coarse) => settled.after_coarse(coarse),
        None => settled,
    }))
}

/// What settling the garment of `work`, which is as given, in coarse triangles did, with the positions
/// to which that leads its own vertices: those that are free. `None` if its triangles are not small,
/// or the coarse ones cannot be settled.
fn settled_in_coarse(
    work: &Workpiece<'_>,
    settings: Settings<'_>,
    progress: &mut GarmentProgress<'_>,
) -> Result<Option<Settled>, SettleError> {
    let Scene { garment, below, .. } = work.scene;
    let Some(coarse) = Coarse::new(garment, &work.cloth.edges, &work.cloth.neighbours) else {
        return Ok(None);
    };
    let above = UpperLayers::default();
    let settled = match settle(&coarse.garment, None, below, above, true, settings, progress) {
        Err(SettleError::Stuck) => return Ok(None),
        Err(SettleError::Step(error)) => {
            tracing::warn!(%error, "coarse triangles cannot be settled");
            return Ok(None);
        }
        settled => settled?,
    };
    let moved = coarse.displacements(&settled.positions);
    let given = garment.mesh.vertices().iter().zip(&work.cloth.ever_free);
    let positions = given.zip(moved).map(|((p, free), d)| if *free { p + d } else { *p });
    Ok(Some(Settled { positions: positions.collect(), ..settled }))
}

/// One round; breaks when the garment is as good as it gets.
fn one_round(
    work: &mut Workpiece<'_>,
    strategies: &mut repair::Strategies,
    progress: &mut GarmentProgress<'_>,
) -> Result<ControlFlow<()>, SettleError> {
    let moved = if work.is_yielding {
        work.counts.yielding_rounds += 1;
        work.cloth.push_out(&mut work.contacts, &work.tree)?
    } else {
        work.cloth.round(&mut work.contacts, &work.tree)?
    };
    work.tree.refit(&work.cloth.x);
    let is_moving = moved >= work.scene.params.effort.tolerance;
    if is_moving && !work.is_repairing() && !(work.round + 1).is_multiple_of(VERIFY_EVERY) {
        return Ok(ControlFlow::Continue(()));
    }
    work.verify();
    if apply(&mut strategies.before_ranking, work, progress)?.is_break() {
        return Ok(ControlFlow::Break(()));
    }
    tracing::debug!(
        garment = work.scene.garment.name,
        round = work.round,
        moved_mm = moved * 1e3,
        pairs = work.remaining.pairs.len(),
        inside = work.remaining.inside.len(),
        own = work.remaining.new_own.len()
    );
    if work.rank(moved) || apply(&mut strategies.after_ranking, work, progress)?.is_break() {
        return Ok(ControlFlow::Break(()));
    }
    if !work.is_yielding {
        work.choose_free();
    }
    Ok(ControlFlow::Continue(()))
}

/// Applies the strategies in their order, up to the first that breaks.
fn apply(
    strategies: &mut [Box<dyn Repair>],
    work: &mut Workpiece<'_>,
    progress: &mut GarmentProgress<'_>,
) -> Result<ControlFlow<()>, SettleError> {
    let _phase = trace_span!("repair").entered();
    for strategy in strategies {
        if strategy.apply(work, progress)?.is_break() {
            return Ok(ControlFlow::Break(()));
        }
    }
    Ok(ControlFlow::Continue(()))
}
