//! Layer by layer, inner to outer: order, project, settle, verify exactly, repair, freeze.

use crate::dressing::Dressing;
use crate::outfit::{Outfit, OutfitError};
use crate::progress::GarmentProgress;
use crate::report::ResolveReport;
use crate::settle::SettleError;
use crate::splitting;
use crate::upper_layers::Above;
use crate::verify::verify_layers;
use crate::welded::Sewn;
use if_core::math::Real;
use if_core::monitor::{Cancelled, Monitor};
use if_core::parameter::ParameterError;
use if_mesh::index::Bvh;
use if_mesh::intersections::{own_pairs, pairs};
use if_xpbd::report::StepError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::time::Instant;

/// What [`resolve`] aims at, and how hard it tries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ResolveParams {
    /// Gap to keep between a layer and those below it, in metres.
    pub clearance: Real,
    /// Vertices up to this far along the surface from an intersection may move, in metres.
    pub influence: Real,
    /// The same while what is left is repaired.
    pub repair_influence: Real,
    /// A violated contact is mended by at most this much in a round, in metres.
    pub step: Real,
    /// A corner of an intersecting triangle is asked to part by at most this much in a round, in
    /// metres.
    pub part_step: Real,
    /// Contacts are kept for samples up to this far beyond the clearance, in metres.
    pub margin: Real,
    /// The most that one visit of a contact pushes, in metres.
    pub max_push: Real,
    /// Edges longer than this are sampled in the middle, and their triangles too, in metres.
    pub long_edge: Real,
    /// Sheets of a garment that face each other within this distance move together, in metres.
    pub fold: Real,
    /// Cell of the grid that tells the way out on the scale of centimetres, in metres.
    pub outward_cell: Real,
    /// Sweeps of the solver in a round.
    pub sweeps: usize,
    /// Rounds before all but the neighbourhoods of what is left are held.
    pub settle_rounds: usize,
    /// Rounds at most.
    pub rounds: usize,
    /// Rounds that a clean garment may relax in, where an edge is strained more than `calm_strain`.
    pub polish_rounds: usize,
    /// Largest edge strain of a garment that needs no relaxing.
    pub calm_strain: Real,
    /// Edges of a clean garment that changed their length by more than this share are eased by
    /// guarded rounds, which end clean.
    pub drawn_strain: Real,
    /// Guarded rounds at most; 0 leaves drawn edges as they are.
    pub ease_rounds: usize,
    /// A round that moves no vertex further than this has settled, in metres.
    pub tolerance: Real,
    /// Compliance of edges: 0 is inextensible; at a visit a share 2 / (2 + s) of the violation
    /// goes.
    pub stretch_softness: Real,
    /// Edges that changed their length by more than this share are brought back to it.
    pub strain_limit: Real,
    /// Compliance of the distances across edges, which resist bending.
    pub bending_softness: Real,
    /// Compliance of the anchors to the input: at a visit a share 1 / (1 + s) of the way goes.
    pub anchor_softness: Real,
    /// Factor on the gap of vertices whose triangles intersect again and again.
    pub inflation: Real,
    /// When garments are pressed in below the layers above them.
    pub tuck: Tuck,
    /// Vertices that stick out of a layer above by up to this much are pressed in, in metres.
    pub tuck_reach: Real,
    /// Whether triangles may be split, as a last resort.
    pub split: Split,
    /// Nearest points that a bound on the motion makes unnecessary are not looked for. Off is the
    /// slow twin, for tests and benchmarks: the same bits, later.
    pub skip: bool,
}

impl Default for ResolveParams {
    fn default() -> Self {
        Self {
            clearance: 0.3e-3,
            influence: 0.12,
            repair_influence: 0.04,
            step: 2e-3,
            part_step: 0.5e-3,
            margin: 2e-3,
            max_push: 2e-3,
            long_edge: 8e-3,
            fold: 6e-3,
            outward_cell: 6e-3,
            sweeps: 15,
            settle_rounds: 16,
            rounds: 100,
            polish_rounds: 12,
            calm_strain: 0.25,
            drawn_strain: 0.5,
            ease_rounds: 40,
            tolerance: 3e-4,
            stretch_softness: 4.0,
            strain_limit: 0.12,
            bending_softness: 10.0,
            anchor_softness: 200.0,
            inflation: 1.1,
            tuck: Tuck::IfStuck,
            tuck_reach: 0.05,
            split: Split::Never,
            skip: true,
        }
    }
}

impl ResolveParams {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        const METRES: &str = "above 0 and at most 10 m";
        const SHARE: &str = "a share from 0 to 1e12";
        const COMPLIANCE: &str = "from 0 (rigid) to 1e12";
        const COUNT: &str = "from 1 to 10,000";
        let length = |name, v: Real| ParameterError::check(name, v, v > 0.0 && v <= 10.0, METRES);
        let from_zero =
            |name, v, range| ParameterError::check(name, v, (0.0..=1e12).contains(&v), range);
        let count = |name, n: usize| {
            ParameterError::check(name, n as Real, (1..=10_000).contains(&n), COUNT)
        };
        let below = |name, v: Real, limit, range| {
            ParameterError::check(name, v, v > 0.0 && v < limit, range)
        };
        below("clearance", self.clearance, 0.1, "between 0 and 0.1 m")?;
        length("influence", self.influence)?;
        length("repair_influence", self.repair_influence)?;
        length("step", self.step)?;
        length("part_step", self.part_step)?;
        length("margin", self.margin)?;
        length("max_push", self.max_push)?;
        length("long_edge", self.long_edge)?;
        length("fold", self.fold)?;
        length("outward_cell", self.outward_cell)?;
        length("tolerance", self.tolerance)?;
        count("sweeps", self.sweeps)?;
        count("rounds", self.rounds)?;
        from_zero("calm_strain", self.calm_strain, SHARE)?;
        from_zero("drawn_strain", self.drawn_strain, SHARE)?;
        from_zero("strain_limit", self.strain_limit, SHARE)?;
        from_zero("stretch_softness", self.stretch_softness, COMPLIANCE)?;
        from_zero("bending_softness", self.bending_softness, COMPLIANCE)?;
        from_zero("anchor_softness", self.anchor_softness, COMPLIANCE)?;
        below("tuck_reach", self.tuck_reach, 0.2, "between 0 and 0.2 m")?;
        let inflation = (1.0..=2.0).contains(&self.inflation);
        ParameterError::check("inflation", self.inflation, inflation, "from 1 to 2")
    }
}

/// When the inner of two garments gives way to the outer one.
///
/// Layers are settled from the body outwards, and as in the paper only the outer of two garments
/// moves. That cannot go well where the outer one is the smaller: it is stretched over what it
/// should hold together. Then the inner garments, as far as the body leaves room, are pressed in
/// below the layers above first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tuck {
    /// Never: a garment that gets stuck yields, stretched as far as it takes.
    Never,
    /// When a garment got stuck over others that it met: those are settled again, below it.
    #[default]
    IfStuck,
    /// In any outfit whose garments meet.
    Always,
}

/// When triangles are split into smaller ones.
///
/// A garment of large triangles cannot lie round a body or a layer of fine ones without standing
/// off, or stretching: a chord cuts through. Split, it can. Then it has more vertices and triangles
/// than it came with: [`Resolved::splits`] says where they come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    /// Never: the triangles are those of the input.
    #[default]
    Never,
    /// Those of a garment that cannot be made clean otherwise.
    IfLeft,
    /// Also large ones with an edge that would be strained by more than half.
    IfStrained,
}

/// An outfit free of intersections, and what it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolved {
    /// The same layers with the same triangles, unless [`ResolveParams::split`] allowed otherwise;
    /// garments that needed nothing are bit-identical.
    pub outfit: Outfit,
    /// For each garment how its triangles were split, as it came: `None` where they are those of
    /// the input.
    pub splits: Vec<Option<if_mesh::split::Split>>,
    /// What was found and done.
    pub report: ResolveReport,
}

/// Why no proven outfit is returned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResolveError {
    /// The outfit is not usable.
    #[error(transparent)]
    Outfit(#[from] OutfitError),
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Intersections are left.
    #[error(
        "{} intersecting triangle pairs, {} vertices on a wrong side and {} new intersections of a garment with itself \
         are left; the worst is `{}` {}",
        result.report.after.total_pairs(), result.report.after.total_inside(), result.report.new_own_pairs(), outer,
        if outer == inner { "with itself".to_owned() } else { format!("over `{inner}`") }
    )]
    Remaining {
        /// The layer above of the worst pair of layers; or the garment that meets itself, where
        /// that alone is left.
        outer: String,
        /// The layer below of it; the same garment, where it meets itself.
        inner: String,
        /// Some of the triangle pairs that are left there: (triangle of the inner layer, of the
        /// outer layer). None where only vertices are on a wrong side.
        triangles: Vec<[u32; 2]>,
        /// The outfit as far as it came, and its report.
        result: Box<Resolved>,
    },
    /// A step of the cloth solver failed.
    #[error("`{layer}` cannot be settled: {source}; check the positions and units of its vertices")]
    Step {
        /// The garment that was being settled.
        layer: String,
        /// The solver's error.
        source: StepError,
    },
    /// The monitor cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Makes an outfit free of intersections, moving garments as little as it can.
///
/// Vertices that stand in one place along a seam ([`if_mesh::seams`]) move as one, unless triangles
/// may be split; the report counts them once. Vertices of no triangle stay.
///
/// `monitor` receives the stages `"verify"`, `"settle"`, `"repair"` and `"done"` of each garment. `done`
/// is the round; the measures are `"garment"` of `"garments"`, counted from 1, and `"pairs"`, the
/// intersecting triangle pairs that remain.
///
/// # Errors
///
/// See [`ResolveError`].
pub fn resolve(
    outfit: &Outfit,
    params: &ResolveParams,
    monitor: &mut dyn Monitor,
) -> Result<Resolved, ResolveError> {
    params.validate()?;
    outfit.check()?;
    let start = Instant::now();
    let sewn = Sewn::new(outfit, params.split == Split::Never);
    let solved = sewn.as_ref().map_or(outfit, |s| &s.outfit);
    let mut resolved = attempt(solved, params, monitor)?;
    if params.split != Split::Never {
        resolved = split_where_needed(solved, resolved, params, monitor)?;
    }
    if let Some(sewn) = sewn {
        resolved.outfit = sewn.spread(outfit, resolved.outfit);
    }
    resolved.report.seconds = start.elapsed().as_secs_f64();
    if resolved.report.is_proven() { Ok(resolved) } else { Err(remaining(outfit, resolved)) }
}

/// Splits what gives trouble and resolves anew, as long as that helps.
fn split_where_needed(
    outfit: &Outfit,
    mut best: Resolved,
    params: &ResolveParams,
    monitor: &mut dyn Monitor,
) -> Result<Resolved, ResolveError> {
    // Nothing left before little strain.
    let rank = |r: &Resolved| {
        let worst = r.report.layers.iter().map(|l| l.strain.rms).fold(0.0, Real::max);
        (
            r.report.after.total_pairs() + r.report.after.total_inside() + r.report.new_own_pairs(),
            worst,
        )
    };
    let mut came = outfit.clone();
    for _ in 0..splitting::ROUNDS {
        let Some((finer, made)) = splitting::finer(&came, &best, params) else { break };
        tracing::debug!(garments = made.iter().flatten().count(), "large triangles are split");
        let mut next = attempt(&finer, params, monitor)?;
        if rank(&next) >= rank(&best) {
            break;
        }
        next.splits = best
            .splits
            .into_iter()
            .zip(made)
            .map(|(so_far, more)| match (so_far, more) {
                (Some(so_far), Some(more)) => Some(so_far.then(more)),
                (so_far, more) => so_far.or(more),
            })
            .collect();
        for (layer, split) in next.report.layers.iter_mut().zip(&next.splits) {
            layer.split = split.as_ref().map_or(0, if_mesh::split::Split::parents);
        }
        next.report.before = best.report.before;
        (best, came) = (next, finer);
    }
    Ok(best)
}

/// Resolves as far as it goes.
fn attempt(
    outfit: &Outfit,
    params: &ResolveParams,
    monitor: &mut dyn Monitor,
) -> Result<Resolved, ResolveError> {
    let (before, closed) = verify_layers(outfit);
    let layers = outfit.garments.len();
    // The garments that those below are pressed in under.
    let mut tight: BTreeSet<usize> =
        if params.tuck == Tuck::Always { (0..layers).collect() } else { BTreeSet::new() };
    let mut above = Above::new(outfit, &before, &closed, &tight, params);
    let mut dressing = Dressing::new(outfit, before, &closed[0]);
    let mut index = 0;
    while index < layers {
        let name = &outfit.garments[index].name;
        let mut progress = GarmentProgress { monitor, name, index, count: layers };
        let may_halt = params.tuck == Tuck::IfStuck && !tight.contains(&index);
        let as_it_came = closed.get(index + 1);
        match dressing.put_on(index, as_it_came, &above, may_halt, params, &mut progress) {
            Ok(()) => index += 1,
            Err(SettleError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(SettleError::Step(source)) => {
                return Err(ResolveError::Step { layer: name.clone(), source });
            }
            Err(SettleError::Stuck) => {
                tracing::debug!(garment = name, "stuck: the layers below are pressed in");
                tight.insert(index);
                above = Above::new(outfit, &dressing.report.before, &closed, &tight, params);
                index = (0..index).find(|k| !above.of(*k).is_empty()).unwrap_or(index);
                dressing.take_off(index);
            }
        }
    }
    let Dressing { result, report, .. } = dressing;
    Ok(Resolved { outfit: result, splits: vec![None; layers], report })
}

/// The most triangle pairs that an error names.
const NAMED: usize = 16;

/// The error that names the worst pair of layers, or the garment with the most new intersections
/// with itself.
fn remaining(came: &Outfit, resolved: Resolved) -> ResolveError {
    if resolved.report.after.is_clean() {
        return meets_itself(came, resolved);
    }
    let worst =
        resolved.report.after.pairs.iter().max_by_key(|p| (p.pairs.total(), p.vertices_inside));
    let (inner, outer) = worst.map(|p| (p.inner.clone(), p.outer.clone())).unwrap_or_default();
    let tree =
        |name: &str| resolved.outfit.layers().find(|l| l.name == name).map(|l| Bvh::new(&l.mesh));
    let triangles = match (tree(&inner), tree(&outer)) {
        (Some(a), Some(b)) => pairs(&a, &b).iter().take(NAMED).map(|p| [p.a, p.b]).collect(),
        _ => Vec::new(),
    };
    ResolveError::Remaining { outer, inner, triangles, result: Box::new(resolved) }
}

/// The error that names the garment with the most new intersections with itself.
fn meets_itself(came: &Outfit, resolved: Resolved) -> ResolveError {
    let layers = &resolved.report.layers;
    let new = |k: &usize| layers[*k].own_pairs[1].saturating_sub(layers[*k].own_pairs[0]);
    let worst = (0..layers.len()).max_by_key(new).unwrap_or_default();
    let own = |outfit: &Outfit| -> Vec<[u32; 2]> {
        let mesh = &outfit.garments[worst].mesh;
        own_pairs(mesh, &Bvh::new(mesh)).iter().map(|p| [p.a, p.b]).collect()
    };
    // Triangles that were split have other numbers than those that came.
    let given: BTreeSet<[u32; 2]> = if resolved.splits[worst].is_none() {
        own(came).into_iter().collect()
    } else {
        BTreeSet::new()
    };
    let triangles =
        own(&resolved.outfit).into_iter().filter(|p| !given.contains(p)).take(NAMED).collect();
    let name = layers[worst].name.clone();
    ResolveError::Remaining {
        outer: name.clone(),
        inner: name,
        triangles,
        result: Box::new(resolved),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outfit::Layer;
    use crate::report::LayerReport;
    use if_core::math::Point;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::icosphere;

    #[test]
    fn a_garment_that_alone_meets_itself_is_named_with_what_is_new() {
        let corner = |x: Real, y: Real, z: Real| Point::new(x, y, z);
        // Two triangles that cross as they came, and one that crosses the first in the result.
        let flat = |y| [corner(0.0, y, 0.0), corner(1.0, y, 0.0), corner(0.0, y, 1.0)];
        let upright = |x| [corner(x, -0.5, 0.2), corner(x, 0.5, 0.2), corner(x, 0.5, 0.3)];
        let with = |x| {
            TriMesh::new(
                [flat(0.0), upright(0.2), upright(x)].concat(),
                vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]],
            )
            .unwrap()
        };
        let outfit = |shirt| Outfit {
            body: Layer::new("body", icosphere(1.0, 1)),
            garments: vec![Layer::new("vest", icosphere(1.1, 1)), Layer::new("shirt", shirt)],
        };
        let layer = |name: &str, own_pairs| LayerReport {
            name: name.into(),
            own_pairs,
            ..LayerReport::default()
        };
        let report = ResolveReport {
            layers: vec![layer("vest", [0, 0]), layer("shirt", [1, 2])],
            ..ResolveReport::default()
        };
        let resolved = Resolved { outfit: outfit(with(0.3)), splits: vec![None, None], report };
        let error = remaining(&outfit(with(5.0)), resolved);
        let text = error.to_string();
        assert!(
            text.ends_with("1 new intersections of a garment with itself are left; the worst is `shirt` with itself"),
            "{text}"
        );
        let ResolveError::Remaining { outer, inner, triangles, .. } = error else {
            panic!("{error}")
        };
        assert_eq!((outer.as_str(), inner.as_str(), triangles), ("shirt", "shirt", vec![[0, 2]]));
    }
}
