//! What was found, what was done and what it cost. Lengths are in metres, strains are fractions.
//!
//! Reports are computed from results. No algorithm reads them.

mod notes;

use crate::cleanness::Cleanness;
use crate::findings::{Findings, LayerFindings};
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
    /// Queries that the mask, or the bounds of the field, made unnecessary.
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
