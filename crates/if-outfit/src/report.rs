//! What was found, what was done and what it cost. Lengths are in metres, strains are fractions.
//!
//! Reports are computed from results. No algorithm reads them.

use crate::cleanness::Cleanness;
use crate::findings::{Findings, LayerFindings};
use crate::motion::OWN;
use crate::moving_apart::ENOUGH;
use crate::obstacle::Obstacle;
use crate::outfit::{Layer, Outfit};
use if_core::intersect::Contact;
use if_core::math::Real;
pub use if_mesh::body_surface::{BodyReport, Hole};
pub use if_mesh::least_distance::LeastDistance;
use if_mesh::measure::{Displacement, Strain};
pub use if_mesh::primitive_distance::{PrimitiveDistance, Primitives};
use serde::{Deserialize, Serialize};

/// How an outer layer lies against one below it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Default)]
pub struct PairCount {
    /// Triangle pairs that pass through one another.
    pub crossing: usize,
    /// Triangle pairs that meet in single points or along an edge.
    pub touching: usize,
    /// Triangle pairs of one plane that overlap.
    pub coplanar: usize,
}

impl PairCount {
    /// All pairs that share a point.
    pub fn total(&self) -> usize {
        self.crossing + self.touching + self.coplanar
    }
}

/// How one layer lies against one below it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct PairReport {
    /// The layer below.
    pub inner: String,
    /// The layer above.
    pub outer: String,
    /// Intersecting triangle pairs, by exact predicates.
    pub pairs: PairCount,
    /// Vertices of the outer layer on the wrong side of the inner one, by its closed field.
    pub vertices_inside: usize,
    /// Vertices of the outer layer.
    pub vertices: usize,
    /// Depth of the deepest of them, in metres.
    pub deepest: Real,
    /// The least distance of the two layers, triangles of the inner one first; `None` if it was not
    /// measured.
    #[serde(default)]
    pub least_distance: Option<LeastDistance>,
}

impl PairReport {
    fn new(inner: &Layer, outer: &Layer, found: &LayerFindings) -> Self {
        let count = |contact| found.pairs.iter().filter(|p| p.contact == contact).count();
        Self {
            inner: inner.name.clone(),
            outer: outer.name.clone(),
            pairs: PairCount {
                crossing: count(Contact::Crossing),
                touching: count(Contact::Touching),
                coplanar: count(Contact::Coplanar),
            },
            vertices_inside: found.inside,
            vertices: outer.mesh.vertices().len(),
            deepest: found.deepest,
            least_distance: None,
        }
    }

    /// No intersecting pair and no vertex on a wrong side.
    pub fn is_clean(&self) -> bool {
        self.pairs.total() == 0 && self.vertices_inside == 0
    }
}

/// The state of an outfit: every layer against every layer below it, and against itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct Verification {
    /// One entry for each ordered pair of layers, outer layers in order.
    pub pairs: Vec<PairReport>,
    /// For each garment its own intersecting triangle pairs.
    pub own_pairs: Vec<usize>,
    /// Intersecting triangle pairs of the body with itself.
    #[serde(default)]
    pub body_own_pairs: usize,
    /// What was assumed of the body; `None` if it is one closed part that does not intersect itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<BodyReport>,
    /// For each garment the least distance of two of its triangles that share no vertex; `None` if
    /// there are no such two. Empty if it was not measured.
    #[serde(default)]
    pub own_least_distances: Vec<Option<LeastDistance>>,
    /// For each garment the least distance of a vertex and a triangle, or of two edges, that share no vertex:
    /// at most its own least distance, and less where a sliver is thinner. `None` if there are no such two,
    /// or triangles that share no vertex intersect. Empty if it was not measured:
    /// [`verify`](crate::verify()) does, and [`resolve`](crate::resolve::resolve) with
    /// [`GoalParams::least_distance`](crate::GoalParams::least_distance).
    #[serde(default)]
    pub own_primitive_distances: Vec<Option<PrimitiveDistance>>,
    /// Seconds that the check took.
    pub seconds: Real,
}

/// Share of a garment's vertices inside another one beyond which their order is doubted.
const MOSTLY: Real = 0.6;
/// Depth, in metres, from which a garment mostly inside the body is doubted: tight ones are so by
/// millimetres.
const DEEP: Real = 0.02;
/// Strain of the hundredth part of a garment's edges from which it is doubted.
const DRAWN: Real = 0.5;
/// Mean motion of a garment, in metres, from which it is doubted if nothing of it lay as deep: those
/// that have to give way move by less than their deepest vertex in the mean.
const SLID: Real = 0.01;

/// Distance of two primitives of a garment from which on it is too near for simulators with a barrier, in
/// metres: those take contacts of some 0.01 to 1 mm.
const THIN: Real = 1e-6;
/// Share of what a garment opened to itself below which its primitives are noted: two of five garments come to
/// 0.998 of it.
const NEARLY: Real = 0.9;

/// Whether a garment is strained so much that it may be made for another body: one edge in a hundred by
/// more than half.
fn is_drawn(strain: &Strain) -> bool {
    strain.p99 > DRAWN
}

impl Verification {
    /// The report of what was found in `outfit`: what was assumed of its body and how many own pairs
    /// that has, and the findings of each garment.
    pub(crate) fn new<'a>(
        outfit: &Outfit,
        (body, body_own_pairs): (Option<&BodyReport>, usize),
        findings: impl IntoIterator<Item = &'a Findings>,
        seconds: Real,
    ) -> Self {
        let body = body.cloned();
        let mut verification = Self { body_own_pairs, body, seconds, ..Self::default() };
        for (outer, found) in outfit.garments.iter().zip(findings) {
            let below = outfit.layers().zip(&found.below);
            let reports = below.map(|(inner, found)| PairReport::new(inner, outer, found));
            verification.pairs.extend(reports);
            verification.own_pairs.push(found.own.len());
        }
        verification
    }

    /// Intersecting triangle pairs between all layers and the body.
    pub fn total_pairs(&self) -> usize {
        self.pairs.iter().map(|p| p.pairs.total()).sum()
    }

    /// Vertices on the wrong side of a layer below, counted once for each such layer.
    pub fn total_inside(&self) -> usize {
        self.pairs.iter().map(|p| p.vertices_inside).sum()
    }

    /// What was assumed of the body, in sentences; `name` is what it is called.
    pub fn body_notes(&self, name: &str) -> Vec<String> {
        let notes = self.body.as_ref().map_or(Vec::new(), BodyReport::notes);
        notes.iter().map(|note| format!("`{name}`: {note}")).collect()
    }

    /// What a person should know, in sentences: [`Verification::body_notes`], garments that lie
    /// mostly and deep inside the body, or mostly inside one that is given below them, so that their
    /// place or order may be wrong, and those with primitives less than 1 µm apart. `body` is what the body
    /// is called.
    pub fn notes(&self, body: &str) -> Vec<String> {
        [self.body_notes(body), self.place_notes(body), self.thin_notes(THIN)].concat()
    }

    /// Garments of which two primitives that share no vertex are nearer than `least` metres.
    fn thin_notes(&self, least: Real) -> Vec<String> {
        let mut names: Vec<&str> = self.pairs.iter().map(|pair| pair.outer.as_str()).collect();
        names.dedup();
        let note = |(name, found): (&str, &Option<PrimitiveDistance>)| {
            let PrimitiveDistance { distance, primitives, are_neighbours, .. } =
                found.filter(|found| found.distance < least)?;
            let two = match primitives {
                Primitives::VertexTriangle(v, t) => format!("vertex {v} and triangle {t:?}"),
                Primitives::Edges(e, f) => format!("edges {e:?} and {f:?}"),
            };
            let what = if are_neighbours { ", a sliver" } else { "" };
            Some(format!(
                "`{name}`: {two} are {:.1e} mm apart{what}: too near for simulators with a barrier",
                1e3 * distance
            ))
        };
        names.into_iter().zip(&self.own_primitive_distances).filter_map(note).collect()
    }

    fn place_notes(&self, body: &str) -> Vec<String> {
        let note = |pair: &PairReport| {
            let PairReport { inner, outer, .. } = pair;
            let share = pair.vertices_inside as Real / pair.vertices.max(1) as Real;
            let percent = format!("{:.0} %", 1e2 * share);
            if share <= MOSTLY || (inner == body && pair.deepest < DEEP) {
                None
            } else if inner == body {
                Some(format!(
                    "`{outer}`: {percent} of it lies inside the body, {:.0} mm deep; is it for this body, and in place?",
                    1e3 * pair.deepest
                ))
            } else {
                Some(format!(
                    "`{outer}`: {percent} of it lies inside `{inner}`, which is given below it; is the order right (`check --order auto`)?"
                ))
            }
        };
        self.pairs.iter().filter_map(note).collect()
    }

    /// No intersecting pair and no vertex on a wrong side.
    pub fn is_clean(&self) -> bool {
        self.pairs.iter().all(PairReport::is_clean)
    }

    /// The least distance of two layers, in metres; `None` if it was not measured.
    pub fn least_distance(&self) -> Option<Real> {
        self.pairs.iter().filter_map(|p| p.least_distance).map(|d| d.distance).reduce(Real::min)
    }

    /// How clean the outfit is.
    pub fn cleanness(&self) -> Cleanness {
        let own = self.body_own_pairs + self.own_pairs.iter().sum::<usize>();
        match (self.is_clean(), own) {
            (false, _) => Cleanness::NotClean,
            (true, 0) => Cleanness::Everywhere,
            (true, _) => Cleanness::BetweenLayers,
        }
    }
}

/// What a layer did not need, and so did not cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct Skipped {
    /// Lower layers whose boxes this layer does not meet.
    pub layers: usize,
    /// Vertices that no constraint reached.
    pub vertices: usize,
    /// Nearest-point queries saved by the Lipschitz bound.
    pub queries: usize,
    /// Sweeps saved by stopping early.
    pub sweeps: usize,
}

/// Intersecting triangle pairs of a garment with itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct OwnPairs {
    /// Of the input.
    pub before: usize,
    /// Of the result.
    pub after: usize,
    /// Pairs of the result that are not among those of the input. A pair that takes the place of
    /// another is new.
    pub new: usize,
}

impl OwnPairs {
    /// The numbers of pairs.
    pub fn new(before: usize, after: usize, new: usize) -> Self {
        Self { before, after, new }
    }
}

/// Two intersecting triangles of one garment that were kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeptOwnPair {
    /// The triangles, the smaller index first.
    pub triangles: [u32; 2],
    /// Why they were kept.
    pub reason: KeptReason,
}

/// Why an intersection of a garment with itself was not removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum KeptReason {
    /// The triangles overlap in one plane: sheets that coincide have no sides.
    Coincident,
    /// More than two triangles meet at an edge of one of them.
    NonManifold,
    /// The contour along which the sheets pass through one another did not vanish in any way tried.
    Contour,
    /// The pair was removed, and came back while the garment settled between its layers.
    Layers,
    /// The sheets come apart only where the cloth is strained by more than
    /// [`EffortParams::untangle_strain`](crate::EffortParams::untangle_strain), or moved by more than three times
    /// [`EffortParams::repair_influence`](crate::EffortParams::repair_influence).
    Strain,
}

/// How often each repair strategy changed something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(default)]
#[non_exhaustive]
pub struct RepairCounts {
    /// Rounds of untangling, in which intersections of the garment with itself are removed.
    pub untangling_rounds: usize,
    /// Own pairs of the input that untangling removed before the garment settled over others.
    pub untangled_own_pairs: usize,
    /// Rounds in which coarse triangles settled in place of a garment's own small ones.
    pub coarse_rounds: usize,
    /// Single vertices that were moved straight out of the layers below.
    pub escaped_vertices: usize,
    /// Vertices that were no longer pressed in below the layers above.
    pub released_vertices: usize,
    /// Rounds of contacts alone, in which the cloth yielded.
    pub yielding_rounds: usize,
    /// Times that the gap of the vertices of a triangle grew.
    pub grown_gaps: usize,
    /// Triangle pairs that were separated by planes.
    pub separating_planes: usize,
    /// Times that a vertex was led out another way than the nearest.
    pub exit_directions: usize,
    /// Vertices that were led round a limb, because the nearest way out led back under the garment or
    /// would have parted it.
    pub ways_out: usize,
    /// Vertices that were led towards an armpit or the crotch to be pressed in below a layer above,
    /// because the nearest ways would have parted the garment.
    pub ways_in: usize,
    /// Pairs of the garment's own triangles that were held apart.
    pub separated_own_pairs: usize,
    /// Times that the displacements of a neighbourhood were smoothed and lifted.
    pub smoothings: usize,
    /// Rounds of easing.
    pub easing_rounds: usize,
    /// Times that it gave way to a garment over it that was left with intersections.
    pub gave_way: usize,
}

impl RepairCounts {
    /// The sums with those of a later time.
    pub(crate) fn plus(&self, later: &Self) -> Self {
        Self {
            untangling_rounds: self.untangling_rounds + later.untangling_rounds,
            untangled_own_pairs: self.untangled_own_pairs + later.untangled_own_pairs,
            coarse_rounds: self.coarse_rounds + later.coarse_rounds,
            escaped_vertices: self.escaped_vertices + later.escaped_vertices,
            released_vertices: self.released_vertices + later.released_vertices,
            yielding_rounds: self.yielding_rounds + later.yielding_rounds,
            grown_gaps: self.grown_gaps + later.grown_gaps,
            separating_planes: self.separating_planes + later.separating_planes,
            exit_directions: self.exit_directions + later.exit_directions,
            ways_out: self.ways_out + later.ways_out,
            ways_in: self.ways_in + later.ways_in,
            separated_own_pairs: self.separated_own_pairs + later.separated_own_pairs,
            smoothings: self.smoothings + later.smoothings,
            easing_rounds: self.easing_rounds + later.easing_rounds,
            gave_way: self.gave_way + later.gave_way,
        }
    }
}

/// What was done to one garment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct LayerReport {
    /// The garment.
    pub name: String,
    /// Displacement from the input.
    pub moved: Displacement,
    /// Edge strain against the input.
    pub strain: Strain,
    /// Its own intersecting triangle pairs.
    pub own_pairs: OwnPairs,
    /// The first of those that the result has, and why; empty with [`crate::Own::Keep`].
    #[serde(default)]
    pub kept_own_pairs: Vec<KeptOwnPair>,
    /// All rounds: of settling, of repair and of easing.
    pub rounds: usize,
    /// Those of them that repaired what exact verification found, in which the cloth yielded, or
    /// that eased drawn edges.
    pub repairs: usize,
    /// What each repair strategy did.
    pub strategies: RepairCounts,
    /// Sweeps of the solver over all constraints that can move something.
    pub sweeps: usize,
    /// Nearest-point queries made.
    pub queries: usize,
    /// Vertices that stuck out of a layer above, before and after the garment was pressed in below
    /// it ([`crate::Tuck`]); zeros if it was not.
    #[serde(default)]
    pub tucked: [usize; 2],
    /// Largest edge strain before and after strained edges of the clean garment were eased
    /// ([`crate::EffortParams::ease_strain`]); zeros if none were.
    #[serde(default)]
    pub eased: [Real; 2],
    /// Triangles of the input that were split ([`crate::Split`]).
    #[serde(default)]
    pub split: usize,
    /// What Algorithm 1 did ([`crate::Method::Paper`]); `None` if it did not run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub algorithm1: Option<Algorithm1Report>,
    /// What was skipped.
    pub skipped: Skipped,
    /// Wall time, in seconds.
    pub seconds: Real,
}

/// What Algorithm 1 read of a layer below.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LayerField {
    /// The exact distance to its mesh, baked.
    Mesh,
    /// The field that it came with, masked by its box
    /// ([`resolve_on_fields`](crate::resolve_on_fields)).
    Given,
}

/// What Algorithm 1 did with a garment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Algorithm1Report {
    /// What it read of each layer below, the body first.
    pub below: Vec<LayerField>,
    /// Steps made.
    pub steps: u32,
    /// Queries of the field and of nearest points.
    pub queries: u64,
    /// Queries that a bound on the motion made unnecessary.
    pub skipped_by_bound: u64,
    /// Queries that the mask made unnecessary.
    pub skipped_by_mask: u64,
}

/// How the layers of a clean result were moved apart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct MovedApart {
    /// The distance that was the goal, in metres.
    pub goal: Real,
    /// The distance that was reached: [`Verification::least_distance`] of the result, in metres. It is less
    /// than the goal where there is no room.
    #[serde(default)]
    pub reached: Real,
    /// The largest motion of a vertex by it, in metres; 0 if none could move.
    pub moved: Real,
}

/// How a body was drawn back where it met itself or left no room for cloth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct DrawnBackReport {
    /// Intersecting triangle pairs of the body with itself, near garments: of the input.
    pub own_pairs_before: usize,
    /// The same of the result.
    pub own_pairs_after: usize,
    /// Displacement of its vertices.
    pub moved: Displacement,
    /// Where it moved.
    #[serde(flatten)]
    pub extent: Extent,
}

/// What intersects a body that is kept in its pinches: where it meets itself or leaves no room for the
/// cloth between ([`crate::Pinch::Keep`]).
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PinchReport {
    /// Triangles of the body that lie in pinches.
    pub body_faces: usize,
    /// Intersecting triangle pairs of garments with these.
    pub pairs: usize,
    /// Vertices on the wrong side of the body, nearest to these.
    pub inside: usize,
    /// The garments in them, without those of which nothing intersects.
    pub garments: Vec<PinchedGarment>,
}

impl PinchReport {
    /// The report of triangle pairs (of the body, of the garment) and vertices inside of each garment,
    /// by name.
    pub fn new<'a>(
        body_faces: usize,
        garments: impl Iterator<Item = (&'a str, Vec<[u32; 2]>, usize)>,
    ) -> Self {
        let garment = |(name, pairs, inside): (&str, Vec<[u32; 2]>, usize)| {
            let mut faces: Vec<u32> = pairs.iter().map(|[_, t]| *t).collect();
            faces.sort_unstable();
            faces.dedup();
            PinchedGarment { name: name.into(), pairs: pairs.len(), inside, faces }
        };
        let garments: Vec<PinchedGarment> =
            garments.map(garment).filter(|g| g.pairs + g.inside > 0).collect();
        let pairs = garments.iter().map(|g| g.pairs).sum();
        let inside = garments.iter().map(|g| g.inside).sum();
        Self { body_faces, pairs, inside, garments }
    }
}

/// A garment in a pinch.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PinchedGarment {
    /// Its name.
    pub name: String,
    /// Its intersecting triangle pairs with the body there.
    pub pairs: usize,
    /// Its vertices on the wrong side of the body there.
    pub inside: usize,
    /// Its triangles in those pairs.
    pub faces: Vec<u32>,
}

/// Where a body yields by more than 1 mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct Extent {
    /// Its area, as a share of the surface.
    pub area: Real,
    /// Largest distance from a triangle where the body meets itself or leaves no room, in metres, by
    /// corners; `None` if it yields by less everywhere, or there is no such triangle.
    pub reach: Option<Real>,
}

/// What [`crate::resolve::resolve`] found and did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct ResolveReport {
    /// The input.
    pub before: Verification,
    /// The result.
    pub after: Verification,
    /// One entry a garment, inner to outer.
    pub layers: Vec<LayerReport>,
    /// Why garments of which intersections are left cannot lie over others, where that is known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<Obstacle>,
    /// How the body was drawn back ([`crate::Pinch::Yield`]); `None` if it stayed as it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drawn_back: Option<DrawnBackReport>,
    /// What of the result intersects the body in its pinches, if it is kept and intersections remain; all
    /// of it counts in `after` as well.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pinch: Option<PinchReport>,
    /// Seams of garments whose sides did not lie at the same positions: those that were closed, as no more
    /// than rounding parted them, and those that have opened.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seams: Vec<SeamReport>,
    /// How layers were moved apart ([`crate::GoalParams::least_distance`]); `None` if none were nearer, or
    /// intersections are left.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moved_apart: Option<MovedApart>,
    /// The least distance of two layers of the result, as a share of the clearance that is the goal
    /// ([`crate::GoalParams::clearance`]): 1 is all of it. `None` if there is no garment. In metres it
    /// is [`Verification::least_distance`].
    #[serde(default)]
    pub clearance_reached: Option<Real>,
    /// Wall time, in seconds.
    pub seconds: Real,
}

/// A seam of a garment, of boundary edges that run beside others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SeamReport {
    /// The garment.
    pub name: String,
    /// Number of boundary edges.
    pub edges: usize,
    /// The largest distance of the two sides as given, in metres.
    pub given: Real,
    /// The same in the result; 0 if the seam was closed.
    pub now: Real,
}

impl SeamReport {
    fn note(&self) -> String {
        let Self { name, edges, given, now } = self;
        if *now == 0.0 {
            return format!(
                "`{name}`: the sides of seams were up to {:.2} µm apart at {edges} boundary edges, and were joined",
                1e6 * given
            );
        }
        format!(
            "`{name}`: {edges} boundary edges lay within {:.2} mm of others, and are {:.1} mm apart now; if that is a seam, merge its vertices by distance first",
            1e3 * given,
            1e3 * now
        )
    }
}

impl ResolveReport {
    /// Computes [`ResolveReport::clearance_reached`] for a goal of `clearance` metres, and
    /// [`MovedApart::reached`].
    pub(crate) fn compare_distances(&mut self, clearance: Real) {
        let least = self.after.least_distance();
        self.clearance_reached = least.map(|least| least / clearance);
        if let (Some(apart), Some(least)) = (&mut self.moved_apart, least) {
            apart.reached = least;
        }
    }

    /// A note if layers stay nearer than they were moved apart to.
    fn nearer(&self) -> Option<String> {
        /// More pairs than these do not help a person.
        const NAMED: usize = 4;
        let MovedApart { goal, reached, .. } = self.moved_apart?;
        let mm = |length: Real| format!("{:.4} mm", 1e3 * length);
        let least = |pair: &PairReport| pair.least_distance.map_or(goal, |least| least.distance);
        let mut nearer: Vec<&PairReport> =
            self.after.pairs.iter().filter(|pair| least(pair) < ENOUGH * goal).collect();
        nearer.sort_by(|a, b| least(a).total_cmp(&least(b)));
        let name = |pair: &&PairReport| {
            format!("`{}` over `{}` ({})", pair.outer, pair.inner, mm(least(pair)))
        };
        let named: Vec<String> = nearer.iter().take(NAMED).map(name).collect();
        let more = match nearer.len() - named.len() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        (!named.is_empty()).then(|| {
            format!(
                "layers were moved apart to {} of {}; nearer are {}{more}",
                mm(reached),
                mm(goal),
                named.join(", ")
            )
        })
    }

    /// A note if the garment moved farther than what it lay in asks for.
    fn slid(&self, layer: &LayerReport) -> Option<String> {
        let own = self.before.pairs.iter().filter(|pair| pair.outer == layer.name);
        let deepest = own.map(|pair| pair.deepest).fold(0.0, Real::max);
        let mean = layer.moved.mean;
        (mean > SLID && mean > deepest).then(|| {
            format!(
                "`{}`: moved by {:.0} mm in the mean, and nothing of it was deeper than {:.0} mm in a layer; did it slide?",
                layer.name,
                1e3 * mean,
                1e3 * deepest
            )
        })
    }

    /// What a person should know, in sentences: [`Verification::notes`] of the input, garments that
    /// are drawn so much that they may be for another body, those that moved farther than they lay
    /// deep, layers that stay nearer than [`MovedApart::goal`], and primitives of garments that do, or are less
    /// than 1 µm apart. `body` is what the body is called.
    pub fn notes(&self, body: &str) -> Vec<String> {
        let mut notes = self.before.notes(body);
        notes.extend(self.seams.iter().map(SeamReport::note));
        let drawn = self.layers.iter().filter(|layer| is_drawn(&layer.strain));
        notes.extend(drawn.map(|layer| {
            format!(
                "`{}`: one edge in a hundred is strained by {:.0} % or more; is it for this body?",
                layer.name,
                1e2 * layer.strain.p99
            )
        }));
        notes.extend(self.layers.iter().filter_map(|layer| self.slid(layer)));
        notes.extend(self.nearer());
        let opened = self.moved_apart.map_or(0.0, |apart| NEARLY * apart.goal.min(OWN));
        notes.extend(self.after.thin_notes(THIN.max(opened)));
        notes
    }

    /// Intersecting pairs of garments with themselves that the input did not have.
    pub fn new_own_pairs(&self) -> usize {
        self.layers.iter().map(|l| l.own_pairs.new).sum()
    }

    /// Whether the result is clean, and no garment has an intersection with itself that the input
    /// did not have.
    pub fn is_proven(&self) -> bool {
        self.after.is_clean() && self.new_own_pairs() == 0
    }

    /// How clean the result is. It is [`Cleanness::NotClean`] if it is not proven.
    pub fn cleanness(&self) -> Cleanness {
        if self.is_proven() { self.after.cleanness() } else { Cleanness::NotClean }
    }

    /// The report with all seconds set to zero: equal for equal results.
    pub fn without_seconds(mut self) -> Self {
        self.seconds = 0.0;
        self.before.seconds = 0.0;
        self.after.seconds = 0.0;
        self.layers.iter_mut().for_each(|l| l.seconds = 0.0);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_garment_mostly_inside_one_below_it_is_noted() {
        let pair = |inner: &str, vertices_inside| PairReport {
            inner: inner.into(),
            outer: "shirt".into(),
            vertices_inside,
            vertices: 100,
            ..PairReport::default()
        };
        let pairs = vec![pair("skin", 90), pair("vest", 60), pair("coat", 61)];
        let notes = Verification { pairs, ..Verification::default() }.notes("skin");
        let [note] = &notes[..] else { panic!("{notes:?}") };
        assert!(note.contains("`shirt`: 61 % of it lies inside `coat`"), "{note}");
    }

    #[test]
    fn garments_that_are_deep_inside_the_body_or_drawn_are_noted() {
        let pair = |vertices_inside, deepest| PairReport {
            inner: "skin".into(),
            outer: "tights".into(),
            vertices_inside,
            vertices: 100,
            deepest,
            ..PairReport::default()
        };
        let notes = |pair, p99| {
            let strain = Strain { p99, ..Strain::default() };
            let layer = LayerReport { name: "tights".into(), strain, ..LayerReport::default() };
            let before = Verification { pairs: vec![pair], ..Verification::default() };
            ResolveReport { before, layers: vec![layer], ..ResolveReport::default() }.notes("skin")
        };
        assert!(notes(pair(90, 0.005), 0.3).is_empty());
        assert!(notes(pair(50, 0.05), 0.3).is_empty());
        let found = notes(pair(90, 0.05), 0.77);
        let [inside, drawn] = &found[..] else { panic!("{found:?}") };
        assert!(inside.starts_with("`tights`: 90 % of it lies inside the body, 50 mm deep"));
        assert!(drawn.starts_with("`tights`: one edge in a hundred is strained by 77 % or more"));
    }

    #[test]
    fn layers_that_stay_nearer_than_the_goal_are_noted_with_what_was_reached() {
        let least = |distance| Some(LeastDistance { distance, error: 0.0, triangles: [0, 1] });
        let pair = |inner: &str, outer: &str, distance| PairReport {
            inner: inner.into(),
            outer: outer.into(),
            least_distance: least(distance),
            ..PairReport::default()
        };
        let pairs = vec![
            pair("skin", "vest", 0.2997e-3),
            pair("skin", "coat", 0.28e-3),
            pair("vest", "coat", 0.26e-3),
        ];
        let after = Verification { pairs, ..Verification::default() };
        let moved_apart = Some(MovedApart { goal: 0.3e-3, reached: 0.26e-3, moved: 1e-3 });
        let report = ResolveReport { after, moved_apart, ..ResolveReport::default() };
        assert_eq!(
            report.notes("skin"),
            ["layers were moved apart to 0.2600 mm of 0.3000 mm; nearer are `coat` over `vest` \
              (0.2600 mm), `coat` over `skin` (0.2800 mm)"]
        );
    }

    #[test]
    fn slivers_are_noted_below_a_micrometre_or_what_a_garment_opens_to() {
        let pair = |outer: &str| PairReport { outer: outer.into(), ..PairReport::default() };
        let thin = |distance, are_neighbours| {
            let primitives = Primitives::VertexTriangle(3919, [3918, 4007, 3980]);
            Some(PrimitiveDistance { distance, error: 0.0, primitives, are_neighbours })
        };
        let found = Verification {
            pairs: vec![pair("vest"), pair("coat"), pair("coat")],
            own_primitive_distances: vec![thin(2e-5, true), thin(4e-8, true)],
            ..Verification::default()
        };
        let notes = found.notes("skin");
        let [note] = &notes[..] else { panic!("{notes:?}") };
        assert_eq!(
            note,
            "`coat`: vertex 3919 and triangle [3918, 4007, 3980] are 4.0e-5 mm apart, a sliver: too \
             near for simulators with a barrier"
        );
        let moved_apart = Some(MovedApart { goal: 1e-3, ..MovedApart::default() });
        let mut report = ResolveReport { after: found, moved_apart, ..ResolveReport::default() };
        assert_eq!(report.notes("skin").len(), 2);
        report.after.own_primitive_distances[0] = thin(0.998e-4, true);
        assert_eq!(report.notes("skin").len(), 1, "it opened to all but rounding");
    }

    #[test]
    fn garments_that_moved_farther_than_they_lay_deep_are_noted() {
        let pair = |inner: &str, outer: &str, deepest| PairReport {
            inner: inner.into(),
            outer: outer.into(),
            deepest,
            ..PairReport::default()
        };
        let notes = |deepest, mean| {
            let moved = Displacement { mean, ..Displacement::default() };
            let layer = LayerReport { name: "sock".into(), moved, ..LayerReport::default() };
            let pairs = vec![
                pair("skin", "sock", deepest),
                pair("tights", "sock", 0.001),
                pair("skin", "shoe", 0.1),
            ];
            let before = Verification { pairs, ..Verification::default() };
            ResolveReport { before, layers: vec![layer], ..ResolveReport::default() }.notes("skin")
        };
        assert!(notes(0.025, 0.024).is_empty(), "it had to come out");
        assert!(notes(0.002, 0.009).is_empty());
        let found = notes(0.004, 0.027);
        let [note] = &found[..] else { panic!("{found:?}") };
        assert!(
            note.starts_with(
                "`sock`: moved by 27 mm in the mean, and nothing of it was deeper than 4 mm"
            ),
            "{note}"
        );
    }
}
