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
//!     after `settle_rounds`: hold all but the neighbourhood of what is left
//! until nothing is left, or `rounds` are over
//! ```

use crate::contacts::{ContactParams, Contacts, Way};
use crate::outfit::Layer;
use crate::own::{GivenPairs, facing_sheets};
use crate::parting::parting_plane;
use crate::reach::Neighbours;
use crate::resolve::ResolveParams;
use if_core::edges::{Edges, NONE};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{TrianglePair, pairs};
use if_mesh::measure::strain;
use if_mesh::outward::Outward;
use if_mesh::ply::{CoordinateType, quantise};
use if_mesh::solid::ClosedLayer;
use if_xpbd::attach::Attachments;
use if_xpbd::constraint::Constraint;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::half_space::HalfSpaces;
use if_xpbd::separation::Separations;
use if_xpbd::strain_limit::StrainLimit;
use if_xpbd::stretch::Stretch;
use if_xpbd::tie::Ties;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

/// What became of a garment.
pub(crate) struct Settled {
    /// Its positions; those of the input where nothing had to move.
    pub(crate) positions: Vec<Point>,
    pub(crate) rounds: usize,
    pub(crate) repairs: usize,
    pub(crate) sweeps: usize,
    pub(crate) queries: usize,
    pub(crate) spared: usize,
    /// Vertices that were held throughout.
    pub(crate) held: usize,
}

/// What exact verification found of the garment as it is.
struct State {
    /// Intersecting pairs: (layer below, triangle pair).
    pairs: Vec<(usize, TrianglePair)>,
    inside: Vec<u32>,
    /// Own intersecting pairs that the input did not have.
    fresh: Vec<[u32; 2]>,
}

impl State {
    fn is_clean(&self) -> bool {
        self.pairs.is_empty() && self.inside.is_empty() && self.fresh.is_empty()
    }

    fn weight(&self) -> usize {
        self.pairs.len() + self.inside.len() + self.fresh.len()
    }

    fn trouble(&self, triangles: &[[u32; 3]]) -> BTreeSet<u32> {
        let of_pairs = self.pairs.iter().flat_map(|(_, p)| triangles[p.b as usize]);
        let of_own = self.fresh.iter().flatten().flat_map(|t| triangles[*t as usize]);
        of_pairs.chain(of_own).chain(self.inside.iter().copied()).collect()
    }
}

/// The time step of the quasi-static solver. Nothing moves on its own, so only β / h² matters, and
/// with h = 1 s and unit masses compliances are numbers: a share k of the violation goes at a visit
/// for β = 2 / k − 2 on an edge, β = 1 / k − 1 on an anchor.
const H: Real = 1.0;
/// A clearance grows to this much at most, in metres.
const MAX_GAP: Real = 0.03;
/// Visits of the contacts alone after the last sweep.
const LAST_VISITS: usize = 3;
/// How far triangles that intersect are parted beyond contact, in metres. Ten times less is lost
/// when positions are rounded to single precision; ten times more is seen.
const PART: Real = 0.15e-3;
/// The same for triangles of one garment.
const PART_OWN: Real = 0.1e-3;

/// Brings `garment` outside the layers `below` (the body first).
///
/// # Errors
///
/// [`ControlFlow::Break`] as `Err(())`, when `watch` asked to stop. It is told the round, and the
/// pairs left where they were counted.
pub(crate) fn settle(
    garment: &Layer,
    below: &[&ClosedLayer],
    params: &ResolveParams,
    watch: &mut dyn FnMut(usize, bool, Option<usize>) -> ControlFlow<()>,
) -> Result<Settled, ()> {
    let mut tree = Bvh::new(&garment.mesh);
    let mut inspector = Inspector::new(&garment.mesh, &tree, below);
    let input = inspector.inspect(&garment.mesh, &tree);
    if input.is_clean() {
        return Ok(Settled {
            positions: garment.mesh.vertices().to_vec(),
            rounds: 0,
            repairs: 0,
            sweeps: 0,
            queries: 0,
            spared: 0,
            held: garment.mesh.vertices().len(),
        });
    }
    let height = below[0].bvh().aabb().size().max();
    let outward = Outward::new(below, &garment.mesh.aabb().inflated(0.02 * height), params.outward_cell);
    let mut cloth = Cloth::new(garment, &tree, below, &outward, params);
    let mut trouble = input.trouble(garment.mesh.triangles());
    cloth.free_near(&trouble, params.influence, below);
    let mut local = BTreeSet::new();
    // The best state so far: least left, then least strained.
    let mut best: Option<((usize, Real), Vec<Point>)> = None;
    let mut polished = 0;
    let mut state = input;
    let mut repairs = 0;
    let mut rounds = 0;
    for round in 0..params.rounds {
        rounds = round + 1;
        let repairing = round >= params.settle_rounds;
        if watch(round, repairing, Some(state.pairs.len())).is_break() {
            return Err(());
        }
        let moved = cloth.round(&tree);
        tree.refit(&cloth.x);
        let due = moved < params.tolerance || repairing || (round + 1) % CHECK_EVERY == 0;
        if !due {
            continue;
        }
        let mesh = garment.mesh.with_vertices(cloth.stored()).expect("the solver keeps positions finite");
        tree.refit(mesh.vertices());
        state = inspector.inspect(&mesh, &tree);
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
        let rank = (state.weight(), strained.rms_percent);
        if best.as_ref().is_none_or(|(b, _)| rank < *b) {
            best = Some((rank, mesh.vertices().to_vec()));
        }
        if best.as_ref().is_some_and(|(b, _)| b.0 == 0) {
            // Clean. What the repair strained relaxes for some rounds more.
            polished += 1;
            let calm = strained.max_percent < 100.0 * params.calm_strain;
            if state.is_clean() && (moved < params.tolerance || calm) || polished > params.polish_rounds {
                break;
            }
        }
        cloth.aim(&state);
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
    let positions = match best {
        Some((_, x)) => x,
        None => cloth.stored(),
    };
    Ok(Settled {
        positions,
        rounds,
        repairs,
        sweeps: cloth.sweeps,
        queries: cloth.contacts.queries,
        spared: cloth.contacts.spared,
        held: cloth.ever_free.iter().filter(|f| !**f).count(),
    })
}

/// While settling, exact verification looks every so many rounds.
const CHECK_EVERY: usize = 5;

/// Exact verification of one garment, again and again: the side of a vertex that has not moved is not
/// asked for twice.
struct Inspector<'a> {
    below: &'a [&'a ClosedLayer],
    given: GivenPairs,
    seen: Vec<Point>,
    inside: Vec<bool>,
}

impl<'a> Inspector<'a> {
    fn new(mesh: &TriMesh, tree: &Bvh, below: &'a [&'a ClosedLayer]) -> Self {
        let nowhere = Point::new(Real::NAN, Real::NAN, Real::NAN);
        let n = mesh.vertices().len();
        Self { below, given: GivenPairs::new(mesh, tree), seen: vec![nowhere; n], inside: vec![false; n] }
    }

    fn inspect(&mut self, mesh: &TriMesh, tree: &Bvh) -> State {
        let below = self.below;
        let found = below.iter().enumerate().flat_map(|(j, l)| pairs(l.bvh(), tree).into_iter().map(move |p| (j, p))).collect();
        (mesh.vertices(), &mut self.seen, &mut self.inside).into_par_iter().with_min_len(128).for_each(|(p, seen, inside)| {
            if p != seen {
                *seen = *p;
                *inside = below.iter().any(|l| l.sided(p, 0.0).is_some_and(|s| s.distance < 0.0));
            }
        });
        let inside = (0..self.inside.len() as u32).filter(|v| self.inside[*v as usize]).collect();
        State { pairs: found, inside, fresh: self.given.fresh(mesh, tree) }
    }
}

/// The garment as the solver sees it.
struct Cloth<'a> {
    garment: &'a Layer,
    below: &'a [&'a ClosedLayer],
    outward: &'a Outward,
    params: &'a ResolveParams,
    x: Vec<Point>,
    /// 1, or 0 where held.
    inverse_masses: Vec<Real>,
    ever_free: Vec<bool>,
    gaps: Vec<Real>,
    edges: Edges,
    /// Edges so short that contacts cannot tell their ends apart: they only translate.
    short: Vec<[u32; 2]>,
    neighbours: Neighbours,
    contacts: Contacts<'a>,
    anchors: Attachments,
    bending: Stretch,
    stretch: Vec<Stretch>,
    limit: StrainLimit,
    ties: Ties,
    planes: HalfSpaces,
    /// Planes that part intersecting triangles: vertex, normal, point.
    parting: Vec<(u32, Vector, Point)>,
    own: Separations,
    /// Own pairs that `own` holds apart.
    parted: BTreeSet<[u32; 2]>,
    /// For each triangle how often it was found intersecting.
    found: BTreeMap<u32, u32>,
    /// For each vertex how often it was found inside, and how it is led out.
    stuck: Vec<u32>,
    ways: Vec<Way>,
    sweeps: usize,
}

impl<'a> Cloth<'a> {
    fn new(
        garment: &'a Layer,
        tree: &Bvh,
        below: &'a [&'a ClosedLayer],
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
        (0..n).for_each(|v| anchors.push(v as u32, x[v], params.anchor_softness));
        let mut planes = HalfSpaces::new();
        planes.max_push = params.max_push;
        let lengths = ContactParams { step: params.step, margin: params.margin, reserve: RESERVE, long_edge: params.long_edge };
        Self {
            contacts: Contacts::new(mesh, &edges, below, outward, lengths),
            neighbours: Neighbours::new(&edges, &x),
            bending: Stretch::new(hinge_edges(mesh, &edges), params.bending_softness),
            stretch: stretch_groups(&edges, &x, params.stretch_softness),
            limit: StrainLimit::new(EdgeSet::of_mesh(mesh), (1.0 - params.strain_limit).max(0.0), 1.0 + params.strain_limit)
                .expect("a limit that was checked"),
            garment,
            below,
            outward,
            params,
            short: short_edges(&edges, &x),
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
            found: BTreeMap::new(),
            stuck: vec![0; n],
            ways: vec![Way::default(); n],
            sweeps: 0,
        }
    }

    /// Positions as they will be stored.
    fn stored(&self) -> Vec<Point> {
        if self.garment.single_precision { quantise(&self.x, CoordinateType::Float) } else { self.x.clone() }
    }

    /// Frees the vertices up to `influence` metres along the surface from `trouble`, and holds the
    /// rest: the further away, the stiffer the anchors. A vertex outside the boxes of all layers below
    /// is free only if it is in trouble itself.
    fn free_near(&mut self, trouble: &BTreeSet<u32>, influence: Real, below: &[&ClosedLayer]) {
        let distances = self.neighbours.distances(trouble.iter().copied(), influence);
        let boxes: Vec<_> = below.iter().map(|l| l.bvh().aabb()).collect();
        let input = self.garment.mesh.vertices();
        for (v, d) in distances.iter().enumerate() {
            let masked = boxes.iter().all(|b| !b.contains(&input[v]));
            let free = *d == 0.0 || (d.is_finite() && !masked);
            self.inverse_masses[v] = Real::from(u8::from(free));
            self.ever_free[v] |= free;
            let near = 1.0 - (d / influence).min(1.0);
            self.anchors.compliances_mut()[v] = STIFFEST_ANCHOR + (self.params.anchor_softness - STIFFEST_ANCHOR) * near * near;
        }
    }

    /// Of the vertices that were ever free, frees those up to `influence` metres from `trouble` and holds
    /// the rest where they are. Where there is no trouble, nothing changes.
    fn hold_far_from(&mut self, trouble: &BTreeSet<u32>, influence: Real) {
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
    fn strained(&self, limit: Real) -> Vec<u32> {
        let rest = self.garment.mesh.vertices();
        let length = |x: &[Point], [a, b]: [u32; 2]| (x[a as usize] - x[b as usize]).norm();
        let off = |e: &[u32; 2]| (length(&self.x, *e) - length(rest, *e)).abs() > limit * length(rest, *e);
        self.edges.vertices.iter().filter(|e| off(e)).flatten().copied().collect()
    }

    /// One round: contacts, and sweeps until they and the cloth agree. Returns the largest motion.
    fn round(&mut self, tree: &Bvh) -> Real {
        let Self { x, inverse_masses: w, planes, .. } = self;
        self.contacts.detect(x, self.garment.mesh.triangles(), tree, &self.gaps, w, &self.ways, planes);
        for (v, normal, point) in &self.parting {
            planes.push_vertex(*v, *normal, point, 0.0);
        }
        let start = x.clone();
        let visits = if self.own.is_empty() { 1 } else { 2 };
        for _ in 0..self.params.sweeps {
            self.anchors.begin_substep(&start, x, w, H);
            self.anchors.project(x, w, H);
            self.bending.begin_substep(&start, x, w, H);
            self.bending.project(x, w, H);
            for group in &mut self.stretch {
                group.begin_substep(&start, x, w, H);
                group.project(x, w, H);
            }
            self.ties.project(x, w, H);
            self.limit.project(x, w, H);
            for _ in 0..visits {
                planes.project(x, w);
                self.own.project(x, w, H);
            }
            self.sweeps += 1;
        }
        for _ in 0..LAST_VISITS {
            planes.project(x, w);
            self.own.project(x, w, H);
        }
        let rest = self.garment.mesh.vertices();
        for &[a, b] in &self.short {
            let (a, b) = (a as usize, b as usize);
            let sum = w[a] + w[b];
            if sum > 0.0 {
                let off = (x[b] - x[a]) - (rest[b] - rest[a]);
                x[a] += off * (w[a] / sum);
                x[b] -= off * (w[b] / sum);
            }
        }
        let moved = x.iter().zip(&start).map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        self.contacts.moved(moved);
        moved
    }

    /// Draws from what is left what the next rounds must do.
    fn aim(&mut self, state: &State) {
        let triangles = self.garment.mesh.triangles();
        self.parting.clear();
        for (j, pair) in &state.pairs {
            let tri = triangles[pair.b as usize];
            let t = tri.map(|v| self.x[v as usize]);
            let middle = Point::from((t[0].coords + t[1].coords + t[2].coords) / 3.0);
            let layer = self.below[*j];
            let out = self.outward.direction(&middle).or_else(|| layer.sided(&middle, Real::INFINITY).map(|s| s.normal));
            if let Some(out) = out {
                let (normal, level) = parting_plane(&t, &layer.corners(pair.a), &out);
                for v in tri {
                    let wanted = (level + PART).min(normal.dot(&self.x[v as usize].coords) + self.params.part_step);
                    self.parting.push((v, normal, Point::from(normal * wanted)));
                }
            }
            let found = self.found.entry(pair.b).or_insert(0);
            *found += 1;
            if *found > PATIENCE {
                for v in tri {
                    let gap = &mut self.gaps[v as usize];
                    *gap = (*gap * self.params.inflation).min(MAX_GAP);
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
                self.own.push(triangles[pair[0] as usize], triangles[pair[1] as usize], PART_OWN, rest);
            }
        }
    }
}

/// How much further than needed a query looks, in metres, to spare later ones.
const RESERVE: Real = 0.012;
/// A triangle that was found intersecting this often keeps a wider gap.
const PATIENCE: u32 = 4;
/// Softness of the anchor of a vertex next to a held one: it goes a quarter of the way back at a visit.
const STIFFEST_ANCHOR: Real = 3.0;

/// The edges in groups of similar length, the shorter the stiffer: β ~ ℓ², so that what is spread
/// evenly is strain, and not the change of length.
fn stretch_groups(edges: &Edges, x: &[Point], softness: Real) -> Vec<Stretch> {
    /// Bounds of the groups, relative to the mean length.
    const BOUNDS: [Real; 5] = [0.25, 0.5, 0.8, 1.2, 1.8];
    let length = |e: &[u32; 2]| (x[e[0] as usize] - x[e[1] as usize]).norm();
    let mean = edges.vertices.iter().map(length).sum::<Real>() / edges.len().max(1) as Real;
    let group_of = |l: Real| BOUNDS.iter().take_while(|b| l > **b * mean).count();
    (0..=BOUNDS.len())
        .filter_map(|g| {
            let ends: Vec<[u32; 2]> = edges.vertices.iter().filter(|e| group_of(length(e)) == g).copied().collect();
            let rests: Vec<Real> = ends.iter().map(length).collect();
            let typical = rests.iter().sum::<Real>() / (rests.len().max(1) as Real * mean);
            let set = EdgeSet::new(&ends, &rests, x.len()).expect("two different vertices of a mesh, and a finite length");
            (!ends.is_empty()).then(|| Stretch::new(set, softness * typical * typical))
        })
        .collect()
}

/// Share of the mean length below which an edge counts as a point that was doubled. Ten times less
/// leaves a 0.1 mm edge of the test data strained by 150 %; ten times more stiffens fine details.
const SHORT: Real = 0.03;

fn short_edges(edges: &Edges, x: &[Point]) -> Vec<[u32; 2]> {
    let length = |e: &[u32; 2]| (x[e[0] as usize] - x[e[1] as usize]).norm();
    let mean = edges.vertices.iter().map(length).sum::<Real>() / edges.len().max(1) as Real;
    edges.vertices.iter().filter(|e| length(e) < SHORT * mean).copied().collect()
}

/// For each inner edge the two corners across it: kept at their distance, they keep the fold's angle.
fn hinge_edges(mesh: &TriMesh, edges: &Edges) -> EdgeSet {
    let x = mesh.vertices();
    let mut across = Vec::new();
    let mut rest = Vec::new();
    for (e, &[a, b]) in edges.vertices.iter().enumerate() {
        let [t, u] = edges.triangles[e];
        if u == NONE {
            continue;
        }
        let opposite = |t: u32| mesh.triangles()[t as usize].into_iter().find(|v| *v != a && *v != b);
        if let (Some(c), Some(d)) = (opposite(t), opposite(u))
            && c != d
        {
            across.push([c, d]);
            rest.push((x[c as usize] - x[d as usize]).norm());
        }
    }
    EdgeSet::new(&across, &rest, x.len()).expect("two different vertices of a mesh, and a finite length")
}
