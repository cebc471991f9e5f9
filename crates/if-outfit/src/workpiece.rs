//! One garment on its way: its cloth, its contacts, and what verification last found.

use crate::cloth::Cloth;
use crate::contact_groups::ContactGroups;
use crate::incremental_verification::{IncrementalVerification, Remaining};
use crate::outfit::Layer;
use crate::params::ResolveParams;
use crate::report::RepairCounts;
use crate::upper_layers::UpperLayers;
use crate::ways_out::{Given, Reroute};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Cancelled;
use if_mesh::index::Bvh;
use if_mesh::measure::{Strain, strain_of};
use if_mesh::outward::Outward;
use if_mesh::solid::ClosedLayer;
use if_xpbd::report::StepError;
use std::collections::BTreeSet;
use tracing::trace_span;

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

/// What stays the same while a garment settles.
#[derive(Clone, Copy)]
pub(crate) struct Scene<'a> {
    /// The input.
    pub(crate) garment: &'a Layer,
    /// The layers below, the body first.
    pub(crate) below: &'a [&'a ClosedLayer],
    /// The layers above that the garment is pressed in below.
    pub(crate) above: UpperLayers<'a>,
    /// The way out of the layers below on the scale of centimetres.
    pub(crate) outward: &'a Outward,
    pub(crate) params: &'a ResolveParams,
    /// Whether queries that cannot find a contact are skipped.
    pub(crate) skip: bool,
    /// Whether the cloth may yield; else a garment that gets stuck is an error.
    pub(crate) may_yield: bool,
}

/// After so many verified rounds of repair in which no less remained than before, a garment is given
/// up: it has yielded at least twice then.
const IDLE: usize = 40;

/// The lower the better, in this order: how much remains, how many vertices stick out of a layer
/// above, the rms strain.
type Rank = (usize, usize, Real);

/// The best state so far.
pub(crate) struct Best {
    rank: Rank,
    /// As it is stored.
    pub(crate) positions: Vec<Point>,
    /// Whether it intersects another layer, or is on the wrong side of one.
    pub(crate) meets_others: bool,
}

impl Best {
    pub(crate) fn is_clean(&self) -> bool {
        self.remaining() == 0
    }

    /// Pairs and vertices inside that remain.
    pub(crate) fn remaining(&self) -> usize {
        self.rank.0
    }

    /// The same with other positions that are as clean.
    pub(crate) fn moved_to(self, positions: Vec<Point>) -> Self {
        Self { positions, ..self }
    }
}

/// Rounds and largest strain before and after easing.
#[derive(Clone, Copy, Default)]
pub(crate) struct Eased {
    pub(crate) rounds: usize,
    pub(crate) strain: [Real; 2],
}

/// A garment on its way.
pub(crate) struct Workpiece<'a> {
    pub(crate) scene: Scene<'a>,
    pub(crate) cloth: Cloth<'a>,
    pub(crate) contacts: ContactGroups<'a>,
    /// Holds the cloth's positions.
    pub(crate) tree: Bvh,
    pub(crate) verification: IncrementalVerification<'a>,
    /// What the last verification found.
    pub(crate) remaining: Remaining,
    /// The mesh that it verified, as it is stored.
    pub(crate) mesh: TriMesh,
    /// The strain of that mesh.
    pub(crate) strain: Strain,
    pub(crate) best: Option<Best>,
    /// The current round.
    pub(crate) round: usize,
    /// Verified rounds of repair so far.
    pub(crate) repair_rounds: usize,
    /// The least that remained after any round, and verified rounds of repair since.
    fewest: usize,
    pub(crate) idle_rounds: usize,
    /// Verified rounds since the garment was first clean, or last smoothed.
    pub(crate) clean_rounds: usize,
    /// Whether the cloth yields in the next round, and whether it did until this one.
    pub(crate) is_yielding: bool,
    pub(crate) has_yielded: bool,
    pub(crate) eased: Eased,
    pub(crate) counts: RepairCounts,
    /// Vertices of all that was found while settling.
    found: BTreeSet<u32>,
    /// Vertices near which repairs work.
    repaired: BTreeSet<u32>,
}

impl<'a> Workpiece<'a> {
    /// The input, in which `remaining` was found by `verification`; `tree` holds it. The vertices
    /// near `sources` are free.
    pub(crate) fn new(
        scene: Scene<'a>,
        tree: Bvh,
        (verification, remaining): (IncrementalVerification<'a>, Remaining),
        sources: BTreeSet<u32>,
    ) -> Self {
        let Scene { garment, below, above, outward, params, skip, .. } = scene;
        let mut cloth = Cloth::new(garment, &tree, params);
        let mesh = &garment.mesh;
        let contacts = ContactGroups::new(mesh, &cloth.edges, below, above, outward, params, skip);
        cloth.free_near(&sources, params.effort.influence, below);
        Self {
            scene,
            cloth,
            contacts,
            tree,
            verification,
            remaining,
            mesh: mesh.clone(),
            strain: Strain::default(),
            best: None,
            round: 0,
            repair_rounds: 0,
            fewest: usize::MAX,
            idle_rounds: 0,
            clean_rounds: 0,
            is_yielding: false,
            has_yielded: false,
            eased: Eased::default(),
            counts: RepairCounts::default(),
            found: sources,
            repaired: BTreeSet::new(),
        }
    }

    /// Finds the ways out of vertices whose nearest one leads back under the garment, which is still as
    /// given. Returns how many are on them; `None` if no vertex may need one.
    pub(crate) fn find_ways_out(&mut self, reroute: Reroute) -> Option<usize> {
        let _phase = trace_span!("contacts").entered();
        let Scene { garment, below, .. } = self.scene;
        let x = garment.mesh.vertices();
        let given =
            Given { x, tree: &self.tree, below, neighbours: &self.cloth.neighbours, reroute };
        let close = || ClosedLayer::garment(&garment.mesh, below[0], &below[0].to_mesh());
        self.contacts.ways_out = given.ways_out(&self.remaining.inside, close)?;
        self.counts.ways_out = self.contacts.ways_out.len();
        Some(self.counts.ways_out)
    }

    /// Whether only the neighbourhoods of what remains are free.
    pub(crate) fn is_repairing(&self) -> bool {
        self.round >= self.scene.params.effort.settle_rounds
    }

    /// Vertices of what remains.
    pub(crate) fn remaining_vertices(&self) -> BTreeSet<u32> {
        self.remaining.vertices(self.scene.garment.mesh.triangles())
    }

    /// The garment with its vertices at `x`.
    pub(crate) fn mesh_at(&self, x: Vec<Point>) -> TriMesh {
        self.scene.garment.mesh.with_vertices(x).expect("the solver keeps positions finite")
    }

    /// Verifies the cloth as it would be stored.
    pub(crate) fn verify(&mut self) {
        (self.mesh, self.remaining) = self.verified(self.cloth.stored());
        self.tree.refit(&self.cloth.x);
    }

    /// Verifies the positions `stored`, which the tree then holds.
    pub(crate) fn verified(&mut self, stored: Vec<Point>) -> (TriMesh, Remaining) {
        let _phase = trace_span!("verification").entered();
        let mesh = self.mesh_at(stored);
        self.tree.refit(mesh.vertices());
        let nearby = self.contacts.search.nearby_of_vertices();
        let remaining = self.verification.verify(&mesh, &self.tree, nearby);
        (mesh, remaining)
    }

    /// Moves the cloth to the positions `to`.
    pub(crate) fn go_to(&mut self, to: &[Point]) {
        let x = &mut self.cloth.x;
        let most = x.iter().zip(to).map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        x.copy_from_slice(to);
        self.contacts.moved(most);
    }

    /// Measures the strain, and keeps the state if none was as good. Returns whether the garment is
    /// finished: clean, or given up, and unlikely to get better. `moved` is the largest motion of the round.
    pub(crate) fn rank(&mut self, moved: Real) -> bool {
        let effort = &self.scene.params.effort;
        let rest = self.scene.garment.mesh.vertices();
        self.strain = strain_of(&self.cloth.edges.vertices, rest, self.mesh.vertices());
        let sticking_out = self.contacts.sticking_out(self.mesh.vertices()).len();
        let rank = (self.remaining.count(), sticking_out, self.strain.rms);
        if self.best.as_ref().is_none_or(|best| rank < best.rank) {
            let meets_others =
                !self.remaining.pairs.is_empty() || !self.remaining.inside.is_empty();
            let positions = self.mesh.vertices().to_vec();
            self.best = Some(Best { rank, positions, meets_others });
        }
        self.idle_rounds += usize::from(self.is_repairing());
        if rank.0 < self.fewest {
            (self.fewest, self.idle_rounds) = (rank.0, 0);
        }
        if !self.best.as_ref().is_some_and(Best::is_clean) {
            return self.idle_rounds >= IDLE;
        }
        // What repairs have strained relaxes for some more rounds.
        self.clean_rounds += 1;
        let is_relaxed = sticking_out == 0 && self.strain.max < effort.polish_strain;
        let is_done = self.remaining.is_clean() && (moved < effort.tolerance || is_relaxed);
        is_done || self.clean_rounds > effort.polish_rounds
    }

    /// Chooses the vertices that are free in the next round.
    pub(crate) fn choose_free(&mut self) {
        let effort = &self.scene.params.effort;
        let here = self.remaining_vertices();
        if !self.is_repairing() {
            self.found.extend(here);
            self.cloth.free_near(&self.found, effort.influence, self.scene.below);
            return;
        }
        self.repair_rounds += 1;
        if here.is_empty() {
            self.repaired.extend(self.cloth.strained(0.5 * effort.polish_strain));
        } else {
            self.repaired = here;
        }
        // The longer it takes, the larger the neighbourhood.
        let growth = 1.0 + (self.round - effort.settle_rounds) as Real / 10.0;
        self.cloth.hold_far_from(&self.repaired, effort.repair_influence * growth);
        self.contacts.search.refine(&self.cloth.inverse_masses);
    }
}
