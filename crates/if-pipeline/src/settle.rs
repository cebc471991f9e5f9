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

use crate::ceiling::Ceilings;
use crate::cloth::Cloth;
use crate::inspector::Inspector;
use crate::outfit::Layer;
use crate::resolve::ResolveParams;
use if_core::math::{Point, Real};
use if_mesh::index::Bvh;
use if_mesh::measure::strain;
use if_mesh::outward::Outward;
use if_mesh::solid::ClosedLayer;
use std::collections::BTreeSet;
use std::ops::ControlFlow;

/// Why a garment did not settle.
pub(crate) enum Halt {
    /// The caller asked to stop.
    Cancelled,
    /// Repairs came to a standstill, and the cloth may not yield.
    Stuck,
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

/// Brings `garment` outside the layers `below` (the body first), and as far as there is room below those `above`.
///
/// # Errors
///
/// [`Halt::Cancelled`] when `watch` asked to stop; it is told the round, and the pairs left where they were counted.
/// [`Halt::Stuck`] instead of yielding, where `may_yield` forbids that.
pub(crate) fn settle(
    garment: &Layer,
    below: &[&ClosedLayer],
    above: Ceilings<'_>,
    may_yield: bool,
    params: &ResolveParams,
    watch: &mut dyn FnMut(usize, bool, Option<usize>) -> ControlFlow<()>,
) -> Result<Settled, Halt> {
    let mut tree = Bvh::new(&garment.mesh);
    let (mut inspector, input) = Inspector::new(&garment.mesh, &tree, below);
    let sticking_out = above.sticking_out(garment.mesh.vertices(), &vec![false; garment.mesh.vertices().len()]);
    if input.is_clean() && sticking_out.is_empty() {
        return Ok(Settled::as_it_is(garment));
    }
    let height = below[0].bvh().aabb().size().max();
    let outward = Outward::new(below, &garment.mesh.aabb().inflated(0.02 * height), params.outward_cell);
    let mut cloth = Cloth::new(garment, &tree, below, above, &outward, params);
    let mut trouble = input.trouble(garment.mesh.triangles());
    trouble.extend(sticking_out.iter().copied());
    cloth.free_near(&trouble, params.influence, below);
    let mut local = BTreeSet::new();
    // The best state so far: least left, then least above a ceiling, then least strained.
    let mut best: Option<((usize, usize, Real), Vec<Point>)> = None;
    let mut polished = 0;
    // Strain where the last attempt to untangle a clean garment began.
    let mut relaxed_from = Real::INFINITY;
    let mut state = input;
    let mut repairs = 0;
    // Rounds left in which the cloth yields, and rounds in which it did.
    let mut yielding = 0;
    let mut pushes = 0;
    let mut rounds = 0;
    for round in 0..params.rounds {
        rounds = round + 1;
        let repairing = round >= params.settle_rounds;
        if watch(round, repairing, Some(state.pairs.len())).is_break() {
            return Err(Halt::Cancelled);
        }
        let moved = if yielding > 0 { cloth.push_out(&tree) } else { cloth.round(&tree) };
        tree.refit(&cloth.x);
        let due = moved < params.tolerance || repairing || (round + 1) % CHECK_EVERY == 0;
        if !due {
            continue;
        }
        let mut mesh = garment.mesh.with_vertices(cloth.stored()).expect("the solver keeps positions finite");
        tree.refit(mesh.vertices());
        state = inspector.inspect(&mesh, &tree);
        if repairing && state.pairs.is_empty() && state.excess == 0 && !state.inside.is_empty() && state.inside.len() <= FEW {
            let before = cloth.x.clone();
            cloth.lead_out(&state.inside);
            let led = garment.mesh.with_vertices(cloth.stored()).expect("the solver keeps positions finite");
            tree.refit(led.vertices());
            let then = inspector.inspect(&led, &tree);
            if then.is_clean() {
                (state, mesh) = (then, led);
            } else {
                cloth.x = before;
            }
        }
        tree.refit(&cloth.x);
        tracing::debug!(
            garment = garment.name,
            round,
            moved_mm = moved * 1e3,
            pairs = state.pairs.len(),
            inside = state.inside.len(),
            own = state.fresh.len()
        );
        let strained = strain(&garment.mesh, mesh.vertices());
        if repairing && !state.is_clean() {
            // What cannot be pressed in without trouble is not.
            cloth.release(&state.trouble(garment.mesh.triangles()));
        }
        let high = cloth.sticking_out(mesh.vertices()).len();
        let rank = (state.weight(), high, strained.rms_percent);
        if best.as_ref().is_none_or(|(b, _)| rank < *b) {
            best = Some((rank, mesh.vertices().to_vec()));
        }
        if best.as_ref().is_some_and(|(b, _)| b.0 == 0) {
            // Clean. What the repair strained relaxes for some rounds more.
            polished += 1;
            let calm = high == 0 && strained.max_percent < 100.0 * params.calm_strain;
            if state.is_clean() && (moved < params.tolerance || calm) || polished > params.polish_rounds {
                break;
            }
        }
        let stalled = repairing && yielding == 0 && repairs > 0 && repairs % STALLED == 0;
        if let Some(((1.., ..), x)) = best.as_ref().filter(|_| stalled) {
            if !may_yield {
                return Err(Halt::Stuck);
            }
            repairs += 1;
            cloth.go_to(x);
            tree.refit(x);
            let mesh = garment.mesh.with_vertices(x.clone()).expect("the solver keeps positions finite");
            state = inspector.inspect(&mesh, &tree);
            yielding = YIELDS + 1;
        }
        cloth.aim(&state);
        let yielded = yielding == 1;
        if yielding > 0 {
            yielding = if state.is_clean() { 0 } else { yielding - 1 };
            if yielding > 0 {
                pushes += usize::from(yielding < YIELDS);
                cloth.hold_far_from(&state.trouble(garment.mesh.triangles()), params.repair_influence);
                continue;
            }
        }
        let tangled = strained.max_percent > 100.0 * TANGLED;
        let again = if state.is_clean() {
            if repairing && tangled && strained.rms_percent > WORTHWHILE * relaxed_from {
                break;
            }
            repairing && tangled
        } else {
            tangled && round < EARLY || yielded
        };
        if again {
            if state.is_clean() {
                relaxed_from = strained.rms_percent;
                polished = 0;
            }
            let mut vertices = state.trouble(garment.mesh.triangles());
            if tangled {
                vertices.extend(cloth.strained(0.5 * TANGLED));
            }
            cloth.untangle(&vertices);
            tree.refit(&cloth.x);
        }
        let here = state.trouble(garment.mesh.triangles());
        if repairing {
            repairs += 1;
            if !here.is_empty() {
                local = here;
            } else {
                local.extend(cloth.strained(0.5 * params.calm_strain));
            }
            let wider = params.repair_influence * (1.0 + (round - params.settle_rounds) as Real / 10.0);
            cloth.hold_far_from(&local, wider);
        } else {
            trouble.extend(here);
            cloth.free_near(&trouble, params.influence, below);
        }
    }
    let is_clean = best.as_ref().is_some_and(|(rank, _)| rank.0 == 0);
    let mut positions = best.map_or_else(|| cloth.stored(), |(_, x)| x);
    let mut largest = [0.0; 2];
    if is_clean {
        let ControlFlow::Continue(eased) = cloth.ease(&positions, &mut inspector, &mut |k| watch(rounds + k, true, Some(0)))
        else {
            return Err(Halt::Cancelled);
        };
        if let Some(eased) = eased {
            (positions, largest) = (eased.positions, eased.strain);
            rounds += eased.rounds;
            repairs += eased.rounds;
        }
    }
    let none = vec![false; positions.len()];
    let tucked = [sticking_out.len(), above.sticking_out(&positions, &none).len()];
    Ok(Settled {
        positions,
        rounds,
        repairs: repairs + pushes,
        sweeps: cloth.sweeps,
        queries: cloth.contacts.queries,
        spared: cloth.contacts.spared,
        tucked,
        eased: largest,
        held: cloth.ever_free.iter().filter(|f| !**f).count(),
    })
}

/// Edge strain beyond which a neighbourhood counts as tangled.
const TANGLED: Real = 0.5;
/// What is tangled is untangled at once in the first rounds.
const EARLY: usize = 12;
/// A clean garment is untangled again while its rms strain falls below this share of what it was.
const WORTHWHILE: Real = 0.9;
/// After so many rounds of repair, and again after as many more, a garment that was never clean yields.
const STALLED: usize = 15;
/// Rounds in which the cloth yields before what is left counts as tangled.
const YIELDS: usize = 12;
/// So few vertices inside, with no triangle intersecting, are led out by themselves.
const FEW: usize = 12;
/// While settling, exact verification looks every so many rounds.
const CHECK_EVERY: usize = 5;
