//! The garment as the solver sees it: its cloth, its contacts, and what earlier rounds have found.

pub(crate) mod easing;

use crate::constraints::{hinge_edges, short_edges, stretch_groups};
use crate::contacts::{ContactParams, Contacts, Way};
use crate::geodesic::Neighbours;
use crate::inspector::State;
use crate::outfit::Layer;
use crate::resolve::ResolveParams;
use crate::self_contact::facing_sheets;
use crate::separating_plane::parting_plane;
use crate::untangle::{lead_out, lift, smooth};
use crate::upper_layers::Ceilings;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_mesh::index::Bvh;
use if_mesh::outward::Outward;
use if_mesh::solid::ClosedLayer;
use if_xpbd::attach::Attachments;
use if_xpbd::constraint::{Constraint, Stage};
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::fixed_offsets::FixedOffsets;
use if_xpbd::half_space::HalfSpaces;
use if_xpbd::params::{LambdaForm, Motion, SolverParams};
use if_xpbd::particles::Particles;
use if_xpbd::report::StepError;
use if_xpbd::separation::Separations;
use if_xpbd::solver::Solver;
use if_xpbd::strain_limit::StrainLimit;
use if_xpbd::stretch::Stretch;
use if_xpbd::tie::Ties;
use std::collections::{BTreeMap, BTreeSet};

/// The time step of the quasi-static solver, in seconds. Nothing moves on its own, so only β / h²
/// matters, and with h = 1 s and unit masses compliances are numbers: a visit removes a share k of
/// the violation for β = 2 / k − 2 on an edge, β = 1 / k − 1 on an anchor.
const TIME_STEP: Real = 1.0;
/// A clearance grows to this much at most, in metres.
const MAX_GAP: Real = 0.03;
/// Visits of the contacts alone after the last sweep.
const LAST_VISITS: u32 = 3;
/// Why parameters of the solver and its groups are valid.
const IN_RANGE: &str = "ResolveParams::validate checks its numbers";
/// How far triangles that intersect are parted beyond contact, in metres. Ten times less is lost
/// when positions are rounded to single precision; ten times more is seen.
const PART: Real = 0.15e-3;
/// The same for triangles of one garment.
const PART_OWN: Real = 0.1e-3;

/// The garment as the solver sees it.
pub(crate) struct Cloth<'a> {
    garment: &'a Layer,
    below: &'a [&'a ClosedLayer],
    above: Ceilings<'a>,
    outward: &'a Outward,
    params: &'a ResolveParams,
    pub(crate) x: Vec<Point>,
    /// 1, or 0 where held.
    inverse_masses: Vec<Real>,
    pub(crate) ever_free: Vec<bool>,
    gaps: Vec<Real>,
    edges: Edges,
    /// Edges so short that contacts cannot tell their ends apart: they only translate.
    short: FixedOffsets,
    neighbours: Neighbours,
    pub(crate) contacts: Contacts<'a>,
    anchors: Attachments,
    bending: Stretch,
    stretch: Vec<Stretch>,
    limit: StrainLimit,
    ties: Ties,
    planes: HalfSpaces,
    /// Planes that vertices are pressed behind, and vertices that no longer are.
    pressed: HalfSpaces,
    released: Vec<bool>,
    /// Planes that part intersecting triangles: vertex, normal, point.
    parting: Vec<(u32, Vector, Point)>,
    own: Separations,
    /// Own pairs that `own` holds apart.
    parted: BTreeSet<[u32; 2]>,
    /// Pairs (layer below, its triangle, triangle) that met lately, and for how many rounds they
    /// are still held apart: let go at once, they would meet again every other round.
    watched: BTreeMap<(usize, u32, u32), u32>,
    /// For each triangle how often it was found intersecting.
    found: BTreeMap<u32, u32>,
    /// For each vertex how often it was found inside, and how it is led out.
    stuck: Vec<u32>,
    ways: Vec<Way>,
    pub(crate) sweeps: usize,
    solver: Solver,
    /// The solver's memory: positions and masses are exchanged with `x` and `inverse_masses`.
    particles: Particles,
}

impl<'a> Cloth<'a> {
    pub(crate) fn new(
        garment: &'a Layer,
        tree: &Bvh,
        below: &'a [&'a ClosedLayer],
        above: Ceilings<'a>,
        outward: &'a Outward,
        params: &'a ResolveParams,
    ) -> Self {
        let mesh = &garment.mesh;
        let x = mesh.vertices().to_vec();
        let n = x.len();
        let edges = Edges::new(mesh);
        let mut ties = Ties::new();
        for f in facing_sheets(mesh, tree, params.fold) {
            let share = 0.7 * (1.0 - 0.7 * f.distance / params.fold);
            ties.push(f.vertex, mesh.triangles()[f.triangle as usize], f.barycentric, share, &x);
        }
        let mut anchors = Attachments::new();
        anchors.form = LambdaForm::Pbd;
        for (v, p) in x.iter().enumerate() {
            anchors.push(v as u32, *p, params.anchor_softness).expect(IN_RANGE);
        }
        let mut planes = HalfSpaces::new();
        planes.max_push = params.max_push;
        // Middles of edges and triangles land at once; a corner that alone is free is not thrown.
        planes.max_lever = 4.0;
        let mut pressed = planes.clone();
        pressed.stage = Stage::Elastic;
        let mut bending =
            Stretch::new(hinge_edges(mesh, &edges), params.bending_softness).expect(IN_RANGE);
        bending.form = LambdaForm::Pbd;
        let mut stretch = stretch_groups(&edges, &x, params.stretch_softness);
        stretch.iter_mut().for_each(|group| group.form = LambdaForm::Pbd);
        let lengths = ContactParams {
            step: params.step,
            margin: params.margin,
            reserve: RESERVE,
            long_edge: params.long_edge,
            skip: params.skip,
        };
        Self {
            contacts: Contacts::new(mesh, &edges, below, outward, lengths),
            neighbours: Neighbours::new(&edges, &x),
            bending,
            stretch,
            limit: StrainLimit::new(
                EdgeSet::of_mesh(mesh),
                (1.0 - params.strain_limit).max(0.0),
                1.0 + params.strain_limit,
            )
            .expect("a limit that was checked"),
            garment,
            below,
            above,
            pressed,
            // Vertices of no triangle stay, wherever they are.
            released: mesh.used_vertices().iter().map(|used| !used).collect(),
            outward,
            params,
            short: FixedOffsets::new(short_edges(&edges, &x), &x),
            x,
            inverse_masses: vec![0.0; n],
            ever_free: vec![false; n],
            gaps: vec![params.clearance; n],
            anchors,
            ties,
            edges,
            planes,
            parting: Vec::new(),
            own: Separations::new(),
            parted: BTreeSet::new(),
            watched: BTreeMap::new(),
            found: BTreeMap::new(),
            stuck: vec![0; n],
            ways: vec![Way::default(); n],
            sweeps: 0,
            solver: Solver::new(SolverParams::default()).expect("the defaults are in range"),
            particles: Particles { velocities: vec![Vector::zeros(); n], ..Particles::default() },
        }
    }

    /// Positions as they will be stored.
    pub(crate) fn stored(&self) -> Vec<Point> {
        self.garment.storage.round(&self.x)
    }

    /// Frees the vertices up to `influence` metres along the surface from `trouble`, and holds the
    /// rest: the further away, the stiffer the anchors. A vertex outside the boxes of all layers
    /// below is free only if it is in trouble itself.
    pub(crate) fn free_near(
        &mut self,
        trouble: &BTreeSet<u32>,
        influence: Real,
        below: &[&ClosedLayer],
    ) {
        let distances = self.neighbours.distances(trouble.iter().copied(), influence);
        let boxes: Vec<_> = below.iter().map(|l| l.bvh().aabb()).collect();
        let input = self.garment.mesh.vertices();
        for (v, d) in distances.iter().enumerate() {
            let masked = boxes.iter().all(|b| !b.contains(&input[v]));
            let free = *d == 0.0 || (d.is_finite() && !masked);
            self.inverse_masses[v] = Real::from(u8::from(free));
            self.ever_free[v] |= free;
            let near = 1.0 - (d / influence).min(1.0);
            let softness =
                STIFFEST_ANCHOR + (self.params.anchor_softness - STIFFEST_ANCHOR) * near * near;
            self.anchors.set_compliance(v, softness).expect("between two that are not negative");
        }
    }

    /// Of the vertices that were ever free, frees those up to `influence` metres from `trouble` and
    /// holds the rest where they are. Where there is no trouble, nothing changes.
    pub(crate) fn hold_far_from(&mut self, trouble: &BTreeSet<u32>, influence: Real) {
        if trouble.is_empty() {
            return;
        }
        let distances = self.neighbours.distances(trouble.iter().copied(), influence);
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

    /// Takes the positions `to`.
    pub(crate) fn go_to(&mut self, to: &[Point]) {
        let most = self.x.iter().zip(to).map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        self.x.copy_from_slice(to);
        self.contacts.moved(most);
    }

    /// Finds the half-spaces that vertices and samples are to be kept in.
    fn find_planes(&mut self, tree: &Bvh) {
        let Self { x, inverse_masses: w, planes, .. } = self;
        self.contacts.detect(
            x,
            self.garment.mesh.triangles(),
            tree,
            &self.gaps,
            w,
            &self.ways,
            planes,
        );
        for (v, normal, point) in &self.parting {
            planes.push_vertex(*v, *normal, point, 0.0);
        }
    }

    /// Vertices that stick out of a layer above and are still to be pressed in.
    pub(crate) fn sticking_out(&self, x: &[Point]) -> Vec<u32> {
        self.above.sticking_out(x, &self.released)
    }

    /// The `vertices` are no longer pressed in below the layers above.
    pub(crate) fn release(&mut self, vertices: &BTreeSet<u32>) {
        vertices.iter().for_each(|v| self.released[*v as usize] = true);
    }

    /// One round of contacts alone: the cloth yields. Returns the largest motion.
    ///
    /// # Errors
    ///
    /// As [`Cloth::round`].
    pub(crate) fn push_out(&mut self, tree: &Bvh) -> Result<Real, StepError> {
        self.find_planes(tree);
        let Self { x, inverse_masses, planes, own, solver, particles, .. } = self;
        solver.set_params(quasi_static(0, LAST_VISITS, 0)).expect(IN_RANGE);
        let moved = step(solver, particles, x, inverse_masses, &mut [planes, own])?;
        self.contacts.moved(moved);
        Ok(moved)
    }

    /// One round: contacts, and sweeps until they and the cloth agree. Returns the largest motion.
    ///
    /// # Errors
    ///
    /// If the step fails ([`Solver::step`]); the positions are then as before.
    pub(crate) fn round(&mut self, tree: &Bvh) -> Result<Real, StepError> {
        self.find_planes(tree);
        self.above.detect(&self.x, &self.inverse_masses, &self.released, &mut self.pressed);
        let Self { x, inverse_masses: w, planes, pressed, own, short, solver, particles, .. } =
            self;
        // Own separations disturb the planes, and need a visit more.
        let visits = if own.is_empty() { 1 } else { 2 };
        let params = quasi_static(self.params.sweeps as u32, visits, LAST_VISITS);
        solver.set_params(params).expect(IN_RANGE);
        // What is held on all its vertices does nothing, and is left out.
        let mut anchors = self.anchors.movable(w);
        let mut bending = self.bending.movable(w);
        let mut stretch: Vec<Stretch> = self.stretch.iter().map(|group| group.movable(w)).collect();
        let mut ties = self.ties.movable(w);
        let mut limit = self.limit.movable(w);
        // In the order of visiting. Planes of layers above come before those of layers below,
        // which win.
        let mut groups: Vec<&mut dyn Constraint> = vec![&mut anchors, &mut bending];
        groups.extend(stretch.iter_mut().map(|group| group as &mut dyn Constraint));
        groups.extend([&mut ties as &mut dyn Constraint, &mut limit, pressed, planes, own, short]);
        let moved = step(solver, particles, x, w, &mut groups)?;
        self.sweeps += self.params.sweeps;
        self.contacts.moved(moved);
        Ok(moved)
    }

    /// Leads each of the few vertices `inside` straight out of all layers.
    pub(crate) fn lead_out(&mut self, inside: &[u32]) {
        let mut most: Real = 0.0;
        for &v in inside {
            let around: Vec<Point> =
                self.neighbours.of(v).iter().map(|(u, _)| self.x[*u as usize]).collect();
            if let Some(q) = lead_out(
                &self.x[v as usize],
                &around,
                self.below,
                self.outward,
                PART,
                self.params.part_step,
            ) {
                most = most.max((q - self.x[v as usize]).norm());
                self.x[v as usize] = q;
            }
        }
        self.contacts.moved(most);
    }

    /// Around `tangled` vertices, displacements are smoothed, and what is then inside a layer is
    /// lifted out of it together with its neighbours.
    pub(crate) fn untangle(&mut self, tangled: &BTreeSet<u32>) {
        let rest = self.garment.mesh.vertices();
        let near = self.neighbours.distances(tangled.iter().copied(), SMOOTHED);
        let free = |v: &u32| near[*v as usize].is_finite() && self.ever_free[*v as usize];
        let chosen: Vec<u32> = (0..self.x.len() as u32).filter(free).collect();
        let mut to: Vec<Vector> = self.x.iter().zip(rest).map(|(a, b)| a - b).collect();
        smooth(&mut to, &chosen, &self.neighbours);
        to.iter_mut().zip(rest).for_each(|(d, r)| *d += r.coords);
        lift(
            &mut to,
            &chosen,
            &self.neighbours,
            self.below,
            self.outward,
            self.params.clearance,
            self.params.step,
        );
        let mut most: Real = 0.0;
        for v in chosen.into_iter().map(|v| v as usize) {
            most = most.max((to[v] - self.x[v].coords).norm());
            self.x[v] = Point::from(to[v]);
            self.gaps[v] = self.params.clearance;
            self.stuck[v] = 0;
        }
        self.contacts.moved(most);
    }

    /// Draws from what is left what the next rounds must do.
    pub(crate) fn aim(&mut self, state: &State) {
        let triangles = self.garment.mesh.triangles();
        self.parting.clear();
        self.watched.retain(|_, rounds| {
            *rounds -= 1;
            *rounds > 0
        });
        for (j, pair) in &state.pairs {
            self.watched.insert((*j, pair.a, pair.b), WATCHED);
            let found = self.found.entry(pair.b).or_insert(0);
            *found += 1;
            if *found > PATIENCE {
                for v in triangles[pair.b as usize] {
                    let gap = &mut self.gaps[v as usize];
                    *gap = (*gap * self.params.inflation).min(MAX_GAP);
                }
            }
        }
        for &(j, a, b) in self.watched.keys() {
            let tri = triangles[b as usize];
            let t = tri.map(|v| self.x[v as usize]);
            let middle = Point::from((t[0].coords + t[1].coords + t[2].coords) / 3.0);
            let layer = self.below[j];
            let out = self
                .outward
                .direction(&middle)
                .or_else(|| layer.sided(&middle, Real::INFINITY).map(|s| s.normal));
            if let Some(out) = out {
                let (normal, level) = parting_plane(&t, &layer.corners(a), &out);
                let step = self.params.part_step * Real::from(self.found[&b].min(HASTE));
                for v in tri {
                    let wanted = (level + PART).min(normal.dot(&self.x[v as usize].coords) + step);
                    self.parting.push((v, normal, Point::from(normal * wanted)));
                }
            }
        }
        self.contacts.forget(&state.inside);
        self.ways.fill(Way::Steps);
        for v in &state.inside {
            let stuck = &mut self.stuck[*v as usize];
            *stuck += 1;
            self.ways[*v as usize] = match *stuck / PATIENCE % 3 {
                0 => Way::Steps,
                1 => Way::Nearest,
                _ => Way::Outward,
            };
        }
        let rest = self.garment.mesh.vertices();
        for pair in &state.fresh {
            if self.parted.insert(*pair) {
                self.own.push(
                    triangles[pair[0] as usize],
                    triangles[pair[1] as usize],
                    PART_OWN,
                    rest,
                );
            }
        }
    }
}

/// One substep of [`TIME_STEP`] without inertia. A step that fails is not tried again with a
/// smaller one, which would be another cloth: its compliances are shares of a violation.
fn quasi_static(sweeps: u32, contact_visits: u32, final_contact_visits: u32) -> SolverParams {
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
fn step(
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

/// How far along the surface from what is tangled displacements are smoothed, in metres: a fold or
/// two.
const SMOOTHED: Real = 0.03;
/// How much further than needed a query looks, in metres, to spare later ones.
const RESERVE: Real = 0.012;
/// A triangle that was found intersecting this often keeps a wider gap.
const PATIENCE: u32 = 4;
/// Verifications over which triangles that met are held apart.
const WATCHED: u32 = 8;
/// A triangle that was found intersecting k times may part by k steps, up to this many.
const HASTE: u32 = 6;
/// Softness of the anchor of a vertex next to a held one: it goes a quarter of the way back at a
/// visit.
const STIFFEST_ANCHOR: Real = 3.0;
