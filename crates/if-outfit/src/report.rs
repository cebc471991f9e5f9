//! What was found, what was done and what it cost. Lengths are in metres, strains are fractions.

use if_core::math::Real;
use if_mesh::measure::{Displacement, Strain};
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
}

impl PairReport {
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
    /// Seconds that the check took.
    pub seconds: Real,
}

impl Verification {
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
    /// Its own intersecting triangle pairs before and after.
    pub own_pairs: [usize; 2],
    /// All rounds: of settling, of repair and of easing.
    pub rounds: usize,
    /// Those of them that repaired what exact verification found, in which the cloth yielded, or
    /// that eased drawn edges.
    pub repairs: usize,
    /// Sweeps of the solver over all constraints that can move something.
    pub sweeps: usize,
    /// Nearest-point queries made.
    pub queries: usize,
    /// Vertices that stuck out of a layer above, before and after the garment was pressed in below
    /// it ([`crate::resolve::Tuck`]); zeros where it was not.
    #[serde(default)]
    pub tucked: [usize; 2],
    /// Largest edge strain before and after drawn edges of the clean garment were eased
    /// ([`crate::resolve::ResolveParams::drawn_strain`]); zeros where none were.
    #[serde(default)]
    pub eased: [Real; 2],
    /// Triangles of the input that were split ([`crate::resolve::Split`]).
    #[serde(default)]
    pub split: usize,
    /// What was skipped.
    pub skipped: Skipped,
    /// Wall time, in seconds.
    pub seconds: Real,
}

/// What [`crate::resolve::resolve`] found and did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct ResolveReport {
    /// The outfit as it came.
    pub before: Verification,
    /// The outfit as it is returned.
    pub after: Verification,
    /// One entry a garment, inner to outer.
    pub layers: Vec<LayerReport>,
    /// Wall time, in seconds.
    pub seconds: Real,
}

impl ResolveReport {
    /// How many more own intersections the garments have than they came with.
    pub fn new_own_pairs(&self) -> usize {
        self.layers.iter().map(|l| l.own_pairs[1].saturating_sub(l.own_pairs[0])).sum()
    }

    /// Whether what is returned is clean, and no garment intersects itself more than it did.
    pub fn is_proven(&self) -> bool {
        self.after.is_clean() && self.new_own_pairs() == 0
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
