//! One garment over the layers below it: contacts and cloth settle, exact verification says what is
//! left, and that is repaired.
//!
//! ```text
//! trouble ← vertices inside a layer below, or of triangles that intersect one
//! if there is none: return the input, bit for bit
//! hold every vertex that is further from trouble than `influence`
//! repeat
//!     find contacts with the layers below                          contacts.rs
//!     repeat `sweeps` times, quasi-statically
//!         anchors, bending, stretch (lines 16 to 22), ties of folds
//!         contacts (lines 6 to 15), parting planes, own separations   contacts last
//!     verify exactly: pairs with layers below, sides, new own pairs
//!     pairs left:     part the triangles by planes; in vain so far: widen the gap of their vertices
//!     own pairs new:  hold the two triangles on their sides from now on
//!     every 15th:     never clean so far: from the best state, push only, without the cloth, for 12 rounds
//!     tangled, or pushed in vain: smooth displacements there, lift out      untangle.rs
//!     after `settle_rounds`: hold all but the neighbourhood of what is left
//! until nothing is left, or `rounds` are over
//! drawn edges of a clean garment: rounds of which only what stays clean is taken             cloth/easing.rs
//! ```

use crate::cloth::Cloth;
use crate::inspector::{Inspector, State};
use crate::outfit::Layer;
use crate::progress::{GarmentProgress, REPAIR, SETTLE};
use crate::resolve::ResolveParams;
use crate::upper_layers::Ceilings;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Cancelled;
use if_mesh::index::Bvh;
use if_mesh::measure::{Strain, strain};
use if_mesh::outward::Outward;
use if_mesh::solid::ClosedLayer;
use if_xpbd::report::StepError;
use std::collections::BTreeSet;
use std::ops::ControlFlow;

/// Why a garment did not settle.
pub(crate) enum SettleError {
    /// The monitor cancelled.
    Cancelled(Cancelled),
    /// Repairs made no progress, and the cloth must not yield.
    Stuck,
    /// A step of the solver failed.
    Step(StepError),
}

impl From<StepError> for SettleError {
    fn from(error: StepError) -> Self {
        Self::Step(error)
    }
}

impl From<Cancelled> for SettleError {
    fn from(cancelled: Cancelled) -> Self {
        Self::Cancelled(cancelled)
    }
}

/// What became of a garment.
pub(crate) struct Settled {
    /// Its positions; those of the input where nothing had to move.
    pub(crate) positions: Vec<Point>,
    pub(crate) rounds: usize,
    pub(crate) repairs: usize,
    pub(crate) sweeps: usize,
    pub(crate) queries: usize,
    pub(crate) spared: usize,
    /// Vertices that stuck out of a layer above, before and after.
    pub(crate) tucked: [usize; 2],
    /// Largest strain before and after easing; zeros where nothing was eased.
    pub(crate) eased: [Real; 2],
    /// Vertices that were held throughout.
    pub(crate) held: usize,
}

impl Settled {
    /// Of a garment that needs nothing.
    pub(crate) fn as_it_is(garment: &Layer) -> Self {
        let positions = garment.mesh.vertices().to_vec();
        Self {
            held: positions.len(),
            positions,
            rounds: 0,
            repairs: 0,
            sweeps: 0,
            queries: 0,
            spared: 0,
            tucked: [0; 2],
            eased: [0.0; 2],
        }
    }
}

/// Brings `garment` outside the layers `below` (the body first), and as far as there is room below
/// those `above`.
///
/// # Errors
///
/// [`SettleError::Cancelled`] if the monitor cancels.
/// [`SettleError::Stuck`] instead of yielding, if `may_yield` is false.
pub(crate) fn settle(
    garment: &Layer,
    below: &[&ClosedLayer],
    above: Ceilings<'_>,
    may_yield: bool,
    params: &ResolveParams,
    progress: &mut GarmentProgress<'_>,
) -> Result<Settled, SettleError> {
    let tree = Bvh::new(&garment.mesh);
    let (inspector, input) = Inspector::new(&garment.mesh, &tree, below);
    let strays: Vec<bool> = garment.mesh.used_vertices().iter().map(|used| !used).collect();
    let sticking_out = above.sticking_out(garment.mesh.vertices(), &strays);
    if input.is_clean() && sticking_out.is_empty() {
        return Ok(Settled::as_it_is(garment));
    }
    let height = below[0].bvh().aabb().size().max();
    let outward = Outward::new(
        below,
        &garment.mesh.surface_aabb().inflated(0.02 * height),
        params.outward_cell,
    );
    let mut cloth = Cloth::new(garment, &tree, below, above, &outward, params);
    let mut trouble = input.trouble(garment.mesh.triangles());
    trouble.extend(sticking_out.iter().copied());
    cloth.free_near(&trouble, params.influence, below);
    let mut work = Settling {
        garment,
        below,
        may_yield,
        params,
        tree,
        inspector,
        cloth,
        state: input,
        trouble,
        local: BTreeSet::new(),
        best: None,
        polished: 0,
        relaxed_from: Real::INFINITY,
        yielding: 0,
        repairs: 0,
        pushes: 0,
    };
    let mut rounds = 0;
    for round in 0..params.rounds {
        rounds = round + 1;
        let stage = if work.is_repair(round) { REPAIR } else { SETTLE };
        progress.report(stage, round, Some(work.state.pairs.len()))?;
        if work.round(round)?.is_break() {
            break;
        }
    }
    let mut settled = work.finish(rounds, progress)?;
    settled.tucked = [sticking_out.len(), above.sticking_out(&settled.positions, &strays).len()];
    Ok(settled)
}

/// What is least, in this order: how much is left, how many vertices stick out of a layer above,
/// the rms strain.
type Rank = (usize, usize, Real);

/// A garment on its way.
struct Settling<'a> {
    garment: &'a Layer,
    below: &'a [&'a ClosedLayer],
    may_yield: bool,
    params: &'a ResolveParams,
    /// Holds the cloth's positions.
    tree: Bvh,
    inspector: Inspector<'a>,
    cloth: Cloth<'a>,
    /// What the last look found.
    state: State,
    /// All vertices that were ever in trouble while settling.
    trouble: BTreeSet<u32>,
    /// Those that the repair is about.
    local: BTreeSet<u32>,
    /// The best state so far, as it is stored.
    best: Option<(Rank, Vec<Point>)>,
    /// Looks since it is clean.
    polished: usize,
    /// Strain where the last attempt to untangle a clean garment began.
    relaxed_from: Real,
    /// Rounds left in which the cloth yields.
    yielding: usize,
    repairs: usize,
    /// Rounds in which the cloth yielded.
    pushes: usize,
}

impl Settling<'_> {
    /// Whether only what is left is worked on.
    fn is_repair(&self, round: usize) -> bool {
        round >= self.params.settle_rounds
    }

    /// One round; breaks when the garment is as good as it gets.
    fn round(&mut self, round: usize) -> Result<ControlFlow<()>, SettleError> {
        let repairing = self.is_repair(round);
        let moved = if self.yielding > 0 {
            self.cloth.push_out(&self.tree)?
        } else {
            self.cloth.round(&self.tree)?
        };
        self.tree.refit(&self.cloth.x);
        if moved >= self.params.tolerance && !repairing && !(round + 1).is_multiple_of(CHECK_EVERY)
        {
            return Ok(ControlFlow::Continue(()));
        }
        let mesh = self.verify(repairing);
        tracing::debug!(
            garment = self.garment.name,
            round,
            moved_mm = moved * 1e3,
            pairs = self.state.pairs.len(),
            inside = self.state.inside.len(),
            own = self.state.fresh.len()
        );
        let strained = strain(&self.garment.mesh, mesh.vertices());
        if self.keep(&mesh, &strained, moved, repairing).is_break() {
            return Ok(ControlFlow::Break(()));
        }
        if repairing {
            self.yield_if_stalled()?;
        }
        self.cloth.aim(&self.state);
        let yielded = self.yielding == 1;
        if self.goes_on_yielding() {
            return Ok(ControlFlow::Continue(()));
        }
        if self.untangle(round, yielded, &strained).is_break() {
            return Ok(ControlFlow::Break(()));
        }
        self.choose_free(round);
        Ok(ControlFlow::Continue(()))
    }

    /// The garment with its vertices at `x`.
    fn mesh(&self, x: Vec<Point>) -> TriMesh {
        self.garment.mesh.with_vertices(x).expect("the solver keeps positions finite")
    }

    /// The mesh as it would be stored, and what exact verification says of it.
    fn verify(&mut self, repairing: bool) -> TriMesh {
        let mut mesh = self.mesh(self.cloth.stored());
        self.tree.refit(mesh.vertices());
        self.state = self.inspector.inspect(&mesh, &self.tree);
        let few = !self.state.inside.is_empty() && self.state.inside.len() <= FEW;
        if repairing && few && self.state.pairs.is_empty() && self.state.excess == 0 {
            let before = self.cloth.x.clone();
            self.cloth.lead_out(&self.state.inside);
            let led = self.mesh(self.cloth.stored());
            self.tree.refit(led.vertices());
            let then = self.inspector.inspect(&led, &self.tree);
            if then.is_clean() {
                (self.state, mesh) = (then, led);
            } else {
                self.cloth.x = before;
            }
        }
        self.tree.refit(&self.cloth.x);
        mesh
    }

    /// Keeps the state if no other was as good; breaks when it is clean and will hardly get better.
    fn keep(
        &mut self,
        mesh: &TriMesh,
        strained: &Strain,
        moved: Real,
        repairing: bool,
    ) -> ControlFlow<()> {
        if repairing && !self.state.is_clean() {
            // What cannot be pressed in without trouble is not.
            self.cloth.release(&self.state.trouble(self.garment.mesh.triangles()));
        }
        let high = self.cloth.sticking_out(mesh.vertices()).len();
        let rank = (self.state.weight(), high, strained.rms);
        if self.best.as_ref().is_none_or(|(b, _)| rank < *b) {
            self.best = Some((rank, mesh.vertices().to_vec()));
        }
        if self.best.as_ref().is_some_and(|(b, _)| b.0 == 0) {
            // Clean. What the repair strained relaxes for some rounds more.
            self.polished += 1;
            let calm = high == 0 && strained.max < self.params.calm_strain;
            let done = self.state.is_clean() && (moved < self.params.tolerance || calm);
            if done || self.polished > self.params.polish_rounds {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }

    /// A garment that was never clean in [`STALLED`] repairs goes back to its best state, from
    /// where the cloth yields.
    fn yield_if_stalled(&mut self) -> Result<(), SettleError> {
        let stalled =
            self.yielding == 0 && self.repairs > 0 && self.repairs.is_multiple_of(STALLED);
        let Some(((1.., ..), x)) = self.best.as_ref().filter(|_| stalled) else { return Ok(()) };
        if !self.may_yield {
            return Err(SettleError::Stuck);
        }
        self.repairs += 1;
        self.cloth.go_to(x);
        self.tree.refit(x);
        let mesh = self.mesh(x.clone());
        self.state = self.inspector.inspect(&mesh, &self.tree);
        self.yielding = YIELDS + 1;
        Ok(())
    }

    /// Counts a round in which the cloth yields; whether the next is another.
    fn goes_on_yielding(&mut self) -> bool {
        if self.yielding == 0 {
            return false;
        }
        self.yielding = if self.state.is_clean() { 0 } else { self.yielding - 1 };
        if self.yielding == 0 {
            return false;
        }
        self.pushes += usize::from(self.yielding < YIELDS);
        self.cloth.hold_far_from(
            &self.state.trouble(self.garment.mesh.triangles()),
            self.params.repair_influence,
        );
        true
    }

    /// Smooths the displacements of what is strained too far, or still in trouble after the cloth
    /// has yielded; breaks where a clean garment no longer gains by it.
    fn untangle(&mut self, round: usize, yielded: bool, strained: &Strain) -> ControlFlow<()> {
        let repairing = self.is_repair(round);
        let tangled = strained.max > TANGLED;
        let is_clean = self.state.is_clean();
        if is_clean && repairing && tangled && strained.rms > WORTHWHILE * self.relaxed_from {
            return ControlFlow::Break(());
        }
        let again =
            if is_clean { repairing && tangled } else { tangled && round < EARLY || yielded };
        if !again {
            return ControlFlow::Continue(());
        }
        if is_clean {
            self.relaxed_from = strained.rms;
            self.polished = 0;
        }
        let mut vertices = self.state.trouble(self.garment.mesh.triangles());
        if tangled {
            vertices.extend(self.cloth.strained(0.5 * TANGLED));
        }
        self.cloth.untangle(&vertices);
        self.tree.refit(&self.cloth.x);
        ControlFlow::Continue(())
    }

    /// Which vertices are free in the next round.
    fn choose_free(&mut self, round: usize) {
        let here = self.state.trouble(self.garment.mesh.triangles());
        if !self.is_repair(round) {
            self.trouble.extend(here);
            self.cloth.free_near(&self.trouble, self.params.influence, self.below);
            return;
        }
        self.repairs += 1;
        if here.is_empty() {
            self.local.extend(self.cloth.strained(0.5 * self.params.calm_strain));
        } else {
            self.local = here;
        }
        let wider = self.params.repair_influence
            * (1.0 + (round - self.params.settle_rounds) as Real / 10.0);
        self.cloth.hold_far_from(&self.local, wider);
    }

    /// The best state, eased where it is clean.
    fn finish(
        mut self,
        rounds: usize,
        progress: &mut GarmentProgress<'_>,
    ) -> Result<Settled, SettleError> {
        let is_clean = self.best.as_ref().is_some_and(|(rank, _)| rank.0 == 0);
        let positions = self.best.map_or_else(|| self.cloth.stored(), |(_, x)| x);
        let mut settled = Settled {
            positions,
            rounds,
            repairs: self.repairs + self.pushes,
            sweeps: 0,
            queries: 0,
            spared: 0,
            tucked: [0; 2],
            eased: [0.0; 2],
            held: 0,
        };
        if is_clean {
            let mut report = |k| progress.report(REPAIR, rounds + k, Some(0));
            let eased = self.cloth.ease(&settled.positions, &mut self.inspector, &mut report)?;
            if let Some(eased) = eased {
                (settled.positions, settled.eased) = (eased.positions, eased.strain);
                settled.rounds += eased.rounds;
                settled.repairs += eased.rounds;
            }
        }
        settled.sweeps = self.cloth.sweeps;
        settled.queries = self.cloth.contacts.queries;
        settled.spared = self.cloth.contacts.spared;
        settled.held = self.cloth.ever_free.iter().filter(|f| !**f).count();
        Ok(settled)
    }
}

/// Edge strain beyond which a neighbourhood counts as tangled.
const TANGLED: Real = 0.5;
/// What is tangled is untangled at once in the first rounds.
const EARLY: usize = 12;
/// A clean garment is untangled again while its rms strain falls below this share of what it was.
const WORTHWHILE: Real = 0.9;
/// After so many rounds of repair, and again after as many more, a garment that was never clean
/// yields.
const STALLED: usize = 15;
/// Rounds in which the cloth yields before what is left counts as tangled.
const YIELDS: usize = 12;
/// So few vertices inside, with no triangle intersecting, are led out by themselves.
const FEW: usize = 12;
/// While settling, exact verification looks every so many rounds.
const CHECK_EVERY: usize = 5;
