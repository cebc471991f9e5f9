//! The garment as the solver sees it: positions, which vertices are free, and constraint groups.

use crate::contact_groups::ContactGroups;
use crate::elastic_groups::ElasticGroups;
use crate::outfit::Layer;
use crate::params::ResolveParams;
use if_core::edges::Edges;
use if_core::geodesic::Neighbours;
use if_core::math::{Point, Real, Vector};
use if_mesh::index::Bvh;
use if_mesh::solid::ClosedLayer;
use if_xpbd::constraint::Constraint;
use if_xpbd::params::{Motion, SolverParams};
use if_xpbd::particles::Particles;
use if_xpbd::report::StepError;
use if_xpbd::solver::Solver;
use std::collections::BTreeSet;
use tracing::trace_span;

/// The time step of the quasi-static solver, in seconds. Nothing moves on its own, so only β / h²
/// matters, and with h = 1 s and unit masses compliances are numbers: a visit removes a share k of
/// the violation for β = 2 / k − 2 on an edge, β = 1 / k − 1 on an anchor.
const TIME_STEP: Real = 1.0;
/// Visits of the contacts alone after the last sweep.
const LAST_VISITS: u32 = 3;
/// Why the parameters of [`quasi_static`] are valid.
const IN_RANGE: &str = "ResolveParams::validate checks the number of sweeps";
/// Compliance of the anchor of a vertex next to a held one: a visit moves it a quarter of the way
/// back.
pub(crate) const STIFFEST_ANCHOR: Real = 3.0;

/// The garment as the solver sees it.
pub(crate) struct Cloth<'a> {
    garment: &'a Layer,
    params: &'a ResolveParams,
    /// Positions.
    pub(crate) x: Vec<Point>,
    /// 1 for free vertices, 0 for held ones.
    pub(crate) inverse_masses: Vec<Real>,
    /// Vertices that were free in some round.
    pub(crate) ever_free: Vec<bool>,
    pub(crate) edges: Edges,
    pub(crate) neighbours: Neighbours,
    groups: ElasticGroups,
    movable: Option<Movable>,
    solver: Solver,
    /// The solver's memory: positions and masses are exchanged with `x` and `inverse_masses`.
    particles: Particles,
    /// Sweeps made.
    pub(crate) sweeps: usize,
}

/// The constraints that can move something, of the last round.
struct Movable {
    groups: ElasticGroups,
    inverse_masses: Vec<Real>,
    compliances: Vec<Real>,
}

impl Movable {
    /// Those of `all`, taken from the `last` ones if nothing has changed since.
    fn of<'m>(
        last: &'m mut Option<Self>,
        all: &ElasticGroups,
        inverse_masses: &[Real],
    ) -> &'m mut ElasticGroups {
        let compliances = all.anchors.compliances();
        let is_current =
            |m: &Self| m.inverse_masses == inverse_masses && m.compliances == compliances;
        if !last.as_ref().is_some_and(is_current) {
            *last = None;
        }
        let new = || Self {
            groups: all.movable(inverse_masses),
            inverse_masses: inverse_masses.to_vec(),
            compliances: compliances.to_vec(),
        };
        &mut last.get_or_insert_with(new).groups
    }
}

impl<'a> Cloth<'a> {
    /// The input of `garment`, which `tree` holds, with all vertices held.
    pub(crate) fn new(garment: &'a Layer, tree: &Bvh, params: &'a ResolveParams) -> Self {
        let mesh = &garment.mesh;
        let x = mesh.vertices().to_vec();
        let n = x.len();
        let edges = Edges::new(mesh);
        Self {
            garment,
            params,
            groups: ElasticGroups::new(mesh, tree, &edges, &params.cloth),
            neighbours: Neighbours::new(&edges, &x),
            edges,
            x,
            inverse_masses: vec![0.0; n],
            ever_free: vec![false; n],
            movable: None,
            solver: Solver::new(SolverParams::default()).expect("the defaults are in range"),
            particles: Particles { velocities: vec![Vector::zeros(); n], ..Particles::default() },
            sweeps: 0,
        }
    }

    /// Positions as they will be stored.
    pub(crate) fn stored(&self) -> Vec<Point> {
        self.garment.storage.round(&self.x)
    }

    /// Frees the vertices up to `influence` metres along the surface from `sources`, and holds the
    /// rest: the further away, the stiffer the anchors. A vertex outside the boxes of all layers
    /// below is free only if it is a source itself.
    pub(crate) fn free_near(
        &mut self,
        sources: &BTreeSet<u32>,
        influence: Real,
        below: &[&ClosedLayer],
    ) {
        let distances = self.neighbours.distances(sources.iter().copied(), influence);
        let boxes: Vec<_> = below.iter().map(|l| l.bvh().aabb()).collect();
        let input = self.garment.mesh.vertices();
        let softest = self.params.cloth.anchor_compliance;
        for (v, d) in distances.iter().enumerate() {
            let masked = boxes.iter().all(|b| !b.contains(&input[v]));
            let free = *d == 0.0 || (d.is_finite() && !masked);
            self.inverse_masses[v] = Real::from(u8::from(free));
            self.ever_free[v] |= free;
            let near = 1.0 - (d / influence).min(1.0);
            let compliance = STIFFEST_ANCHOR + (softest - STIFFEST_ANCHOR) * near * near;
            let anchors = &mut self.groups.anchors;
            anchors.set_compliance(v, compliance).expect("between two that are not negative");
        }
    }

    /// Of the vertices that were ever free, frees those up to `influence` metres from `sources` and
    /// holds the rest where they are. Without sources nothing changes.
    pub(crate) fn hold_far_from(&mut self, sources: &BTreeSet<u32>, influence: Real) {
        if sources.is_empty() {
            return;
        }
        let distances = self.neighbours.distances(sources.iter().copied(), influence);
        for (v, d) in distances.iter().enumerate() {
            let free = *d == 0.0 || (d.is_finite() && self.ever_free[v]);
            self.inverse_masses[v] = Real::from(u8::from(free));
            self.ever_free[v] |= free;
        }
    }

    /// Ends of edges that changed their length by more than the share `limit`.
    pub(crate) fn strained(&self, limit: Real) -> Vec<u32> {
        let rest = self.garment.mesh.vertices();
        let length = |x: &[Point], [a, b]: [u32; 2]| (x[a as usize] - x[b as usize]).norm();
        let off = |e: &[u32; 2]| {
            (length(&self.x, *e) - length(rest, *e)).abs() > limit * length(rest, *e)
        };
        self.edges.vertices.iter().filter(|e| off(e)).flatten().copied().collect()
    }

    /// One round of contacts alone: the cloth yields. Returns the largest motion.
    ///
    /// # Errors
    ///
    /// As [`Cloth::round`].
    pub(crate) fn push_out(
        &mut self,
        contacts: &mut ContactGroups<'_>,
        tree: &Bvh,
    ) -> Result<Real, StepError> {
        contacts.detect(&self.x, &self.inverse_masses, tree);
        let [planes, own] = contacts.below_and_own();
        let _phase = trace_span!("sweeps").entered();
        let Self { x, inverse_masses, solver, particles, .. } = self;
        solver.set_params(quasi_static(0, LAST_VISITS, 0)).expect(IN_RANGE);
        let moved = step(solver, particles, x, inverse_masses, &mut [planes, own])?;
        contacts.moved(moved);
        Ok(moved)
    }

    /// One round: contacts, and sweeps until they and the cloth agree. Returns the largest motion.
    ///
    /// # Errors
    ///
    /// If the step fails ([`Solver::step`]); the positions are then as before.
    pub(crate) fn round(
        &mut self,
        contacts: &mut ContactGroups<'_>,
        tree: &Bvh,
    ) -> Result<Real, StepError> {
        contacts.detect(&self.x, &self.inverse_masses, tree);
        contacts.detect_above(&self.x, &self.inverse_masses);
        let Self { x, inverse_masses, solver, particles, groups, movable, .. } = self;
        // Own separations disturb the planes, and need a visit more.
        let visits = if contacts.self_separations.is_empty() { 1 } else { 2 };
        let sweeps = self.params.effort.sweeps;
        solver.set_params(quasi_static(sweeps as u32, visits, LAST_VISITS)).expect(IN_RANGE);
        let _phase = trace_span!("sweeps").entered();
        let mut groups = Movable::of(movable, groups, inverse_masses).in_order();
        // Planes of layers above come before those of layers below, which win.
        groups.extend(contacts.in_order());
        let moved = step(solver, particles, x, inverse_masses, &mut groups)?;
        self.sweeps += sweeps;
        contacts.moved(moved);
        Ok(moved)
    }
}

/// One substep of [`TIME_STEP`] without inertia. A step that fails is not tried again with a
/// smaller one, which would be another cloth: its compliances are shares of a violation.
pub(crate) fn quasi_static(
    sweeps: u32,
    contact_visits: u32,
    final_contact_visits: u32,
) -> SolverParams {
    SolverParams {
        time_step: TIME_STEP,
        substeps: 1,
        sweeps,
        contact_visits,
        final_contact_visits,
        motion: Motion::QuasiStatic,
        retries: 0,
        ..SolverParams::default()
    }
}

/// One step of `solver`; `particles` lends its memory. Returns the largest motion.
pub(crate) fn step(
    solver: &mut Solver,
    particles: &mut Particles,
    x: &mut Vec<Point>,
    inverse_masses: &mut Vec<Real>,
    groups: &mut [&mut dyn Constraint],
) -> Result<Real, StepError> {
    std::mem::swap(&mut particles.positions, x);
    std::mem::swap(&mut particles.inverse_masses, inverse_masses);
    let report = solver.step(particles, groups);
    std::mem::swap(&mut particles.positions, x);
    std::mem::swap(&mut particles.inverse_masses, inverse_masses);
    Ok(report?.moved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes::cloth;

    #[test]
    fn constraints_are_taken_from_the_last_round_only_if_nothing_has_changed() {
        let mesh = cloth(0.3, 0.2, 6, 4);
        let params = ResolveParams::default();
        let (tree, edges) = (Bvh::new(&mesh), Edges::new(&mesh));
        let mut all = ElasticGroups::new(&mesh, &tree, &edges, &params.cloth);
        let mut masses = vec![1.0; 35];
        let mut last = None;
        // A mark that a new one does not have.
        let mark = |groups: &mut ElasticGroups| groups.anchors.set_compliance(0, 77.0).unwrap();
        let is_marked = |groups: &ElasticGroups| groups.anchors.compliances()[0] == 77.0;
        mark(Movable::of(&mut last, &all, &masses));
        assert!(is_marked(Movable::of(&mut last, &all, &masses)));
        masses[3] = 0.0;
        let groups = Movable::of(&mut last, &all, &masses);
        assert!(!is_marked(groups) && groups.anchors.len() == 34);
        mark(groups);
        all.anchors.set_compliance(5, 2.5).unwrap();
        let groups = Movable::of(&mut last, &all, &masses);
        assert!(!is_marked(groups) && groups.anchors.compliances()[4] == 2.5);
    }
}
