//! Resolving: layer by layer, inner to outer, each garment settles over those below and is verified
//! exactly. The result is returned as proven only if nothing remains.

use crate::attempt::{Attempt, AttemptError};
use crate::distances;
use crate::layer_fields::{self, FieldOfGarment};
use crate::outfit::{Outfit, OutfitError};
use crate::pinch::{draw_back, in_pinches};
use crate::prepared_body::PreparedBody;
use crate::report::{ResolveReport, Verification};
use crate::settle::Settings;
use crate::sewn::Sewn;
use crate::splitting;
use crate::unresolved::Unresolved;
use crate::verify::{body_own_pairs, verified, verify_result};
use crate::welded::{Welded, seams_hold};
use if_core::math::Point;
use if_core::monitor::{Cancelled, Monitor};
use if_core::parameter::ParameterError;
use if_xpbd::report::StepError;
use std::sync::Arc;
use std::time::Instant;
use tracing::trace_span;

pub use crate::params::{
    ClothParams, EffortParams, GoalParams, Method, Own, PaperParams, Pinch, ResolveParams, Split,
    Tuck,
};

/// An outfit free of intersections, and what it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolved {
    /// The same layers with the same triangles, unless [`GoalParams::split`] allowed otherwise;
    /// garments that needed nothing are bit-identical, but for rounding to their
    /// [`Layer::storage`](crate::Layer::storage), and so is the body unless it was drawn back ([`Pinch::Yield`]).
    pub outfit: Outfit,
    /// For each garment how the triangles of the input were split; `None` if they were not.
    pub splits: Vec<Option<if_mesh::split::SplitMesh>>,
    /// What was found and done.
    pub report: ResolveReport,
}

/// No proven outfit can be returned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResolveError {
    /// The outfit is invalid.
    #[error(transparent)]
    Outfit(#[from] OutfitError),
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Intersections remain.
    #[error(
        "{} intersecting triangle pairs, {} vertices on a wrong side and {} new intersections of a garment with itself \
         remain; the worst is `{}` {}",
        result.report.after.total_pairs(), result.report.after.total_inside(), result.report.new_own_pairs(), outer,
        if outer == inner { "with itself".to_owned() } else { format!("over `{inner}`") }
    )]
    Unresolved {
        /// The upper layer of the worst pair of layers; or the garment that intersects itself, if
        /// nothing remains between layers.
        outer: String,
        /// The lower layer; the same garment if it intersects itself.
        inner: String,
        /// Some of the triangle pairs that remain there: (triangle of the inner layer, of the
        /// outer layer). Empty if only vertices are on a wrong side.
        triangles: Vec<[u32; 2]>,
        /// The best outfit reached, and its report.
        result: Box<Resolved>,
    },
    /// A step of the cloth solver failed.
    #[error("`{layer}` cannot be settled: {source}; check the positions and units of its vertices")]
    Step {
        /// The garment at work.
        layer: String,
        /// What the solver reports.
        source: StepError,
    },
    /// A field that a garment comes with is NaN near it.
    #[error("the field of `{layer}` is NaN at {at} m; leave it out, or fit or bake it again")]
    Field {
        /// The garment.
        layer: String,
        /// Where.
        at: Point,
    },
    /// The monitor cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Makes an outfit free of intersections, moving garments as little as possible.
///
/// Vertices at the same position along a seam ([`if_mesh::seams`]) move as one; the report counts them
/// once. Vertices of no triangle stay.
///
/// `monitor` receives the stages `"untangle"`, `"verify"`, `"settle"`, `"repair"` and `"done"` of
/// each garment, and `"apart"` where [`GoalParams::least_distance`] is set; with [`Method::Paper`]
/// also `"algorithm 1"`, and within it those of [`Baked::part`](if_mesh::baked::Baked::part) and
/// [`run_algorithm1`](if_xpbd::algorithm1::run_algorithm1). `done` is the round; the measures are
/// `"garment"` of `"garments"`, counted from 1, and `"pairs"`, the intersecting triangle pairs that
/// remain.
///
/// # Errors
///
/// See [`ResolveError`].
pub fn resolve(
    outfit: &Outfit,
    params: &ResolveParams,
    monitor: &mut dyn Monitor,
) -> Result<Resolved, ResolveError> {
    resolve_with(outfit, Settings { params, skip: true, fields: &[], body: None }, monitor)
}

/// [`resolve`] of garments that come with fields, inner to outer, such as a trained φ.
///
/// With [`Method::Paper`] Algorithm 1 reads these instead of distances to the
/// meshes, each masked by the box of its garment. Nothing rests on their accuracy: verification and
/// repair read the meshes. They describe the garments as given, also where those have moved since.
/// With the other method they are not read. [`LayerReport::algorithm1`] reports what was read.
///
/// [`LayerReport::algorithm1`]: crate::report::LayerReport::algorithm1
///
/// # Errors
///
/// As [`resolve`], and [`ResolveError::Field`].
///
/// # Panics
///
/// If there is not one entry for each garment.
pub fn resolve_on_fields(
    outfit: &Outfit,
    fields: &[FieldOfGarment<'_>],
    params: &ResolveParams,
    monitor: &mut dyn Monitor,
) -> Result<Resolved, ResolveError> {
    resolve_over(outfit, None, fields, params, monitor)
}

/// [`resolve_on_fields`] over a body that may be prepared.
pub(crate) fn resolve_over(
    outfit: &Outfit,
    body: Option<&PreparedBody>,
    fields: &[FieldOfGarment<'_>],
    params: &ResolveParams,
    monitor: &mut dyn Monitor,
) -> Result<Resolved, ResolveError> {
    assert_eq!(fields.len(), outfit.garments.len(), "one entry for each garment");
    resolve_with(outfit, Settings { params, skip: true, fields, body }, monitor)
}

/// The slow twin of [`resolve`]: every nearest point is computed, needed or not. The same bits.
///
/// # Errors
///
/// As [`resolve`].
#[doc(hidden)]
pub fn resolve_without_skipping(
    outfit: &Outfit,
    params: &ResolveParams,
    monitor: &mut dyn Monitor,
) -> Result<Resolved, ResolveError> {
    resolve_with(outfit, Settings { params, skip: false, fields: &[], body: None }, monitor)
}

fn resolve_with(
    outfit: &Outfit,
    settings: Settings<'_>,
    monitor: &mut dyn Monitor,
) -> Result<Resolved, ResolveError> {
    settings.params.validate()?;
    outfit.check()?;
    if settings.params.effort.method == Method::Paper
        && let Some((k, at)) = layer_fields::undefined(outfit, settings.fields)
    {
        return Err(ResolveError::Field { layer: outfit.garments[k].name.clone(), at });
    }
    match settings.params.goal.pinch {
        Pinch::Keep => resolve_on_body(outfit, settings, monitor),
        Pinch::Yield => resolve_on_drawn_back(outfit, settings, monitor),
    }
}

/// Resolves on a body that is drawn back where it leaves no room, if it has to be.
fn resolve_on_drawn_back(
    outfit: &Outfit,
    settings: Settings<'_>,
    monitor: &mut dyn Monitor,
) -> Result<Resolved, ResolveError> {
    let start = Instant::now();
    let drawn = trace_span!("drawing back").in_scope(|| draw_back(outfit, &settings.params.goal));
    let Some((body, drawn)) = drawn else {
        return resolve_on_body(outfit, settings, monitor);
    };
    let before = verified(outfit);
    let yielded = Outfit { body, garments: outfit.garments.clone() };
    let complete = |resolved: &mut Resolved| {
        resolved.report.before = before;
        resolved.report.drawn_back = Some(drawn);
        resolved.report.seconds = start.elapsed().as_secs_f64();
    };
    match resolve_on_body(&yielded, settings, monitor) {
        Ok(mut resolved) => {
            complete(&mut resolved);
            Ok(resolved)
        }
        Err(ResolveError::Unresolved { outer, inner, triangles, mut result }) => {
            complete(&mut result);
            Err(ResolveError::Unresolved { outer, inner, triangles, result })
        }
        Err(error) => Err(error),
    }
}

fn resolve_on_body(
    outfit: &Outfit,
    settings: Settings<'_>,
    monitor: &mut dyn Monitor,
) -> Result<Resolved, ResolveError> {
    let params = settings.params;
    let start = Instant::now();
    let phase = trace_span!("seams").entered();
    let sewn = Sewn::new(outfit);
    let outfit = sewn.outfit.as_ref().unwrap_or(outfit);
    let mut welded = Welded::new(outfit);
    drop(phase);
    let solved = welded.as_ref().map_or(outfit, |w| &w.outfit);
    let mut attempt = Attempt::new(solved.clone(), settings, monitor)?;
    let body = &attempt.closed[0];
    let own_pairs = match settings.body.filter(|prepared| Arc::ptr_eq(&prepared.closed, body)) {
        Some(prepared) => prepared.own_pairs,
        None => body_own_pairs(solved, body),
    };
    let body = (body.body_report(), own_pairs);
    let before = Verification::new(solved, body, &attempt.given, attempt.verify_seconds);
    if params.goal.split != Split::Never {
        attempt = split_where_needed(attempt, settings, monitor)?;
    }

    let moved_apart = match params.goal.least_distance {
        0.0 => None,
        distance => attempt.move_apart(distance, monitor)?,
    };

    let mut report = attempt.report(before, params);
    report.moved_apart = moved_apart;
    let mut found = attempt.reached();
    distances::measure(&found, &attempt.closed, &mut report.after);
    if let Some(welded) = &mut welded {
        found = welded.unweld(outfit, found, &mut attempt.splits);
        welded.measure_rounded([outfit, &found], &mut report.layers);
    }
    if !seams_hold(welded.as_ref(), outfit, &found) {
        let is_split = attempt.splits.iter().any(Option::is_some);
        let given = if is_split { &attempt.outfit } else { outfit };
        verify_result(&mut report, given, &found);
    }
    if params.goal.least_distance > 0.0 {
        // A tenth of the time of three garments.
        distances::measure_primitives(&found, &mut report.after);
    }
    report.compare_distances(params.goal.clearance);
    report.seams = sewn.report(&found);
    if !report.is_proven() && params.goal.pinch == Pinch::Keep {
        report.pinch = in_pinches(&found, &attempt.closed[0], &params.goal);
    }
    report.seconds = start.elapsed().as_secs_f64();
    let resolved = Resolved { outfit: found, splits: attempt.splits, report };
    let remains = |given| Unresolved::of(&given, (&resolved.outfit, &resolved.report));
    match (!resolved.report.is_proven()).then_some(attempt.outfit).and_then(remains) {
        None => Ok(resolved),
        Some(unresolved) => Err(remaining(unresolved, resolved)),
    }
}

fn remaining(unresolved: Unresolved, resolved: Resolved) -> ResolveError {
    let [outer, inner] = unresolved.worst().map(str::to_owned);
    let triangles = unresolved.triangles;
    ResolveError::Unresolved { outer, inner, triangles, result: Box::new(resolved) }
}

impl From<AttemptError> for ResolveError {
    fn from(error: AttemptError) -> Self {
        match error {
            AttemptError::Cancelled(cancelled) => cancelled.into(),
            AttemptError::Step(layer, source) => Self::Step { layer, source },
        }
    }
}

/// Splits the triangles that intersect and resolves anew, as long as that helps.
fn split_where_needed(
    mut best: Attempt,
    settings: Settings<'_>,
    monitor: &mut dyn Monitor,
) -> Result<Attempt, AttemptError> {
    for _ in 0..splitting::ROUNDS {
        let Some((finer, splits)) = best.finer(settings.params) else { break };
        tracing::debug!(garments = splits.iter().flatten().count(), "large triangles are split");
        let mut next = Attempt::new(finer, settings, monitor)?;
        if next.rank() >= best.rank() {
            break;
        }
        let both = best.splits.into_iter().zip(splits);
        let joined = both.map(|(so_far, more)| match (so_far, more) {
            (Some(so_far), Some(more)) => Some(so_far.then(more)),
            (so_far, more) => so_far.or(more),
        });
        next.splits = joined.collect();
        best = next;
    }
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outfit::Layer;
    use crate::verify::verify_layers;
    use if_core::math::{Point, Real};
    use if_core::mesh::TriMesh;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::icosphere;

    #[test]
    fn a_garment_that_alone_intersects_itself_is_named_with_what_is_new() {
        let corner = |x: Real, y: Real, z: Real| Point::new(x, y, z);
        // Two triangles that cross in the input, and one that crosses the first in the result.
        let flat = [corner(0.0, 2.0, 0.0), corner(1.0, 2.0, 0.0), corner(0.0, 2.0, 1.0)];
        let upright = |x| [corner(x, 1.5, 0.2), corner(x, 2.5, 0.2), corner(x, 2.5, 0.3)];
        let with = |x| {
            let vertices = [flat, upright(0.2), upright(x)].concat();
            TriMesh::new(vertices, vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]]).unwrap()
        };
        let outfit = |shirt| Outfit {
            body: Layer::new("body", icosphere(1.0, 1)),
            garments: vec![Layer::new("vest", icosphere(1.1, 1)), Layer::new("shirt", shirt)],
        };
        let params = ResolveParams::default();
        let settings = Settings { params: &params, skip: true, fields: &[], body: None };
        let Ok(mut attempt) = Attempt::new(outfit(with(1.5)), settings, &mut Silent) else {
            panic!("not cancelled")
        };
        assert_eq!(attempt.remaining(), 0);
        // As if the third triangle had moved.
        let moved = outfit(with(0.3));
        attempt.dressed[1].findings.own = verify_layers(&moved, None).0[1].own.clone();
        assert_eq!(attempt.remaining(), 1);
        let report = attempt.report(Verification::default(), &params);
        assert!(!report.is_proven());
        assert_eq!(report.layers[1].own_pairs, crate::report::OwnPairs::new(1, 2, 1));
        let unresolved = Unresolved::of(&attempt.outfit, (&moved, &report)).unwrap();
        let resolved = Resolved { outfit: moved, splits: vec![None, None], report };
        let ResolveError::Unresolved { outer, inner, triangles, .. } =
            remaining(unresolved, resolved)
        else {
            panic!("another error")
        };
        assert_eq!((outer.as_str(), inner.as_str(), triangles), ("shirt", "shirt", vec![[0, 2]]));
    }
}
