//! Holes closed.

use super::guard::{bounds, meeting};
use super::hole::Hole;
use super::manifold::{resolve, take_out};
use super::openings::{Openings, Verdict};
use super::patch::Patch;
use super::rim::LoopShape;
use super::twins::{Twins, loops};
use super::watch::{Cancelled, Watch, unwatched};
use super::work::{Derived, Work};
use super::{CleanupError, Step, range};
use crate::validate::is_flat;
use if_core::aabb::Aabb;
use if_core::field::SignedDistance;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use rayon::prelude::*;
use serde::Serialize;

/// How holes are closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FillParams {
    /// Loops of up to this many edges get the best of all triangulations, in O(n³); longer ones are
    /// closed ear by ear.
    pub exact_up_to: usize,
    /// Whether the patch gets vertices until its edges are as long as those round it.
    pub refine: bool,
    /// Whether the patch is bent so that it goes on as the surface round it does (biharmonic).
    /// Needs `refine`.
    pub fair: bool,
    /// New vertices of one hole, at most.
    pub most_vertices: usize,
    /// Times that a hole, into which no patch fits, is widened by the triangles on its rim and
    /// tried again. What a scan has at the border of what nobody saw is often bent inwards or
    /// through itself.
    pub widenings: usize,
}

impl Default for FillParams {
    fn default() -> Self {
        Self { exact_up_to: 128, refine: true, fair: true, most_vertices: 20_000, widenings: 3 }
    }
}

/// Loops up to so many edges may get the best triangulation: it takes 46 MB and some seconds.
const MOST_EXACT: Real = 1024.0;

impl FillParams {
    /// Whether all numbers make sense.
    ///
    /// # Errors
    ///
    /// The first that does not.
    pub fn validate(&self) -> Result<(), CleanupError> {
        let exact = self.exact_up_to as Real;
        range(
            "the number of edges up to which a loop gets the best triangulation",
            exact,
            0.0,
            MOST_EXACT,
            "at most 1,024",
        )?;
        range(
            "the number of new vertices of a hole",
            self.most_vertices as Real,
            0.0,
            1e7,
            "at most 10 million",
        )?;
        range("the number of widenings", self.widenings as Real, 0.0, 1000.0, "at most 1,000")
    }
}

/// What shape a patch has. The first that adds no intersection is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// On the zero of the field.
    Projected,
    /// Biharmonic.
    Fair,
    /// With new vertices on the triangles that close the loop.
    Refined,
    /// The triangles that close the loop.
    Plain,
}

/// A hole that was closed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FilledHole {
    /// The loop.
    pub rim: LoopShape,
    /// What shape its patch has.
    pub shape: Shape,
    /// Triangles added.
    pub triangles: usize,
    /// Vertices added.
    pub vertices: usize,
    /// Area added, in square metres.
    pub area: Real,
}

/// What was closed, and what stays open.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct FillReport {
    /// Holes that were closed.
    pub filled: Vec<FilledHole>,
    /// Holes that stay as they are, because every patch tried meets the mesh or repeats an edge of
    /// it.
    pub left: Vec<LoopShape>,
    /// Triangles cut away round holes so that a patch fits.
    pub cut_away: usize,
    /// Openings.
    pub openings: Vec<LoopShape>,
}

/// Closes the loops of `mesh` that `openings` takes for holes: triangulation by the smallest
/// sharpest fold, refinement to the edge length of the rim, and a biharmonic shape or, where there
/// is a `field`, its zero. No triangle is added that meets another one. A mesh that is not manifold
/// is made so first ([`super::manifold::make_manifold`]).
///
/// New vertices are blends of the rim's, by inverse squared distance.
///
/// # Source
///
/// Supplement, Appendix B, Figure 2 (a); Liepa 2003.
///
/// # Errors
///
/// Parameters out of range.
pub fn fill_holes(
    mesh: &TriMesh,
    field: Option<&dyn SignedDistance>,
    openings: &Openings,
    params: &FillParams,
) -> Result<(Derived, FillReport), CleanupError> {
    params.validate()?;
    openings.validate()?;
    let mut work = Work::new(mesh);
    let (_, mut twins) = resolve(&mut work);
    let (report, _) =
        unwatched(|watch| fill(&mut work, &mut twins, field, openings, params, false, watch));
    Ok((work.finish(), report))
}

/// The largest share of the area that is cut away to widen holes.
const MOST_CUT: Real = 0.01;

/// [`fill_holes`] in place, with the new twins and the rims of the openings.
pub(super) fn fill(
    work: &mut Work,
    twins: &mut Twins,
    field: Option<&dyn SignedDistance>,
    openings: &Openings,
    params: &FillParams,
    single_precision: bool,
    watch: &mut Watch<'_>,
) -> Result<(FillReport, Vec<Vec<u32>>), Cancelled> {
    let mut once = |work: &mut Work, twins: &mut Twins| -> Result<Try, Cancelled> {
        let before = work.triangles.len() as u32;
        let found = fill_once(work, twins, field, openings, params, single_precision, watch)?;
        let added: Vec<u32> = (before..work.triangles.len() as u32).collect();
        if !added.is_empty() {
            twins.update(&work.triangles, &added);
        }
        Ok(found)
    };
    let Try { mut report, mut open, mut left } = once(work, twins)?;
    if left.is_empty() || params.widenings == 0 {
        return Ok((report, open));
    }
    let area: Real = (0..work.triangles.len()).map(|t| work.area(t)).sum();
    let mut tried = FillReport { cut_away: 0, ..report.clone() };
    let mut best = None; // what `work` was when it was best, if it is not now
    for _ in 0..params.widenings {
        let mut rim: Vec<u32> = left.iter().flatten().map(|h| h / 3).collect();
        rim.sort_unstable();
        rim.dedup();
        if rim.iter().map(|t| work.area(*t as usize)).sum::<Real>() > MOST_CUT * area {
            break;
        }
        best.get_or_insert_with(|| (work.clone(), twins.clone()));
        tried.cut_away += rim.len();
        *twins = take_out(work, twins, &rim);
        let Try { report: found, open: new_open, left: new_left } = once(work, twins)?;
        left = new_left;
        tried.filled.extend(found.filled);
        (tried.left, tried.openings) = (found.left, found.openings);
        if left.len() < report.left.len() && new_open.len() <= open.len() {
            (report, open, best) = (tried.clone(), new_open, None);
        }
        if left.is_empty() {
            break;
        }
    }
    if let Some(best) = best {
        (*work, *twins) = best;
    }
    if report.cut_away > 0 {
        work.compact();
    }
    Ok((report, open))
}

/// What filling once gave.
struct Try {
    report: FillReport,
    /// The rims of openings.
    open: Vec<Vec<u32>>,
    /// And of holes that are left.
    left: Vec<Vec<u32>>,
}

/// Judges the loops and fills holes once; old half-edges keep their numbers.
fn fill_once(
    work: &mut Work,
    twins: &Twins,
    field: Option<&dyn SignedDistance>,
    openings: &Openings,
    params: &FillParams,
    single_precision: bool,
    watch: &mut Watch<'_>,
) -> Result<Try, Cancelled> {
    let rims = loops(&work.triangles, twins);
    if work.vicinity.is_unknown() {
        let corners = |h: &u32| work.triangles[*h as usize / 3].map(|v| &work.points[v as usize]);
        let places: Vec<(u32, Aabb)> =
            rims.iter().flatten().map(|h| (h / 3, bounds(corners(h)))).collect();
        work.vicinity.find(&work.points, &work.triangles, &places);
    }
    let shapes: Vec<LoopShape> =
        rims.par_iter().map(|rim| LoopShape::new(work, twins, rim)).collect();
    let verdicts = openings.judge(work, &rims, &shapes);
    let mut report = FillReport::default();
    let mut jobs = Vec::new();
    for (k, verdict) in verdicts.iter().enumerate() {
        match verdict {
            Verdict::Opening => report.openings.push(shapes[k]),
            Verdict::Hole => jobs.push((k, Hole::new(work, twins, &rims[k]))),
        }
    }
    let first = if field.is_some() { Shape::Projected } else { Shape::Fair };
    let make = |hole: &Hole, shape: Shape| {
        let mut patch = hole.patch(shape, field, params)?;
        if single_precision {
            patch.0.points[hole.points.len()..]
                .iter_mut()
                .for_each(|p| *p = p.map(|x| Real::from(x as f32)));
        }
        Some(patch)
    };
    let mut patches: Vec<Option<(Patch, Shape)>> =
        jobs.par_iter().map(|(_, hole)| make(hole, first)).collect();
    let (points, base) = (work.points.len(), work.triangles.len());
    loop {
        watch.at(Step::Holes)?;
        let mut owner = Vec::new();
        for (job, patch) in patches.iter().enumerate() {
            if let Some((patch, _)) = patch {
                jobs[job].1.sew(work, patch);
                owner.resize(work.triangles.len() - base, job);
            }
        }
        let added: Vec<u32> = (base as u32..work.triangles.len() as u32).collect();
        let flat = added
            .iter()
            .filter(|t| is_flat(work.triangles[**t as usize].map(|v| &work.points[v as usize])));
        let meets = meeting(&work.points, &work.triangles, &added, &mut work.vicinity);
        let mut bad: Vec<usize> = flat
            .chain(meets.iter().flatten())
            .filter(|t| **t as usize >= base)
            .map(|t| owner[*t as usize - base])
            .collect();
        bad.sort_unstable();
        bad.dedup();
        if bad.is_empty() {
            break;
        }
        work.truncate(points, base);
        let again: Vec<(usize, Option<(Patch, Shape)>)> = bad
            .par_iter()
            .map(|&job| {
                let shape = patches[job].as_ref().and_then(|p| worse(p.1));
                (job, shape.and_then(|shape| make(&jobs[job].1, shape)))
            })
            .collect();
        again.into_iter().for_each(|(job, patch)| patches[job] = patch);
    }
    for ((k, hole), patch) in jobs.iter().zip(&patches) {
        match patch {
            None => report.left.push(shapes[*k]),
            Some((patch, shape)) => report.filled.push(FilledHole {
                rim: shapes[*k],
                shape: *shape,
                triangles: patch.triangles.len(),
                vertices: patch.points.len() - hole.points.len(),
                area: patch.area(),
            }),
        }
    }
    let left = jobs
        .iter()
        .zip(&patches)
        .filter(|(_, p)| p.is_none())
        .map(|((k, _), _)| rims[*k].clone())
        .collect();
    let open = rims
        .into_iter()
        .zip(&verdicts)
        .filter(|(_, v)| **v == Verdict::Opening)
        .map(|(rim, _)| rim)
        .collect();
    Ok(Try { report, open, left })
}

fn worse(shape: Shape) -> Option<Shape> {
    match shape {
        Shape::Projected => Some(Shape::Fair),
        Shape::Fair => Some(Shape::Refined),
        Shape::Refined => Some(Shape::Plain),
        Shape::Plain => None,
    }
}
