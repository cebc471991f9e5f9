//! Hole filling.

use super::boundary_loop::LoopShape;
use super::broad_phase::Bounded;
use super::classify::{LoopKind, kinds};
use super::edit_mesh::{Derived, EditMesh};
use super::error::CleanupError;
use super::half_edges::{HalfEdges, boundary_loops};
use super::hole::Hole;
use super::intersection_query::{bounds, intersecting_pairs};
use super::manifold::{make_manifold_in_place, remove_triangles};
use super::openings::Openings;
use super::params::FillParams;
use super::parted::parted;
use super::patch::Patch;
use super::report::{FillReport, FilledHole, PatchShape};
use crate::validate::is_flat;
use if_core::field::SignedDistance;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_core::monitor::{Cancelled, Monitor, Progress};
use rayon::prelude::*;

/// Fills the loops of `mesh` that `openings` classifies as holes: minimum-weight triangulation,
/// refinement to the edge length of the boundary, and a biharmonic shape or, with a `field`,
/// projection to its zero set. No added triangle intersects another one. A mesh that is not manifold
/// is made so first ([`make_manifold`](super::make_manifold)).
///
/// New vertices are blends of the boundary's, by inverse squared distance.
///
/// # Source
///
/// Supplement, Appendix B, Figure 2 (a); Liepa 2003.
///
/// # Errors
///
/// Parameters out of range, or cancelled.
pub fn fill_holes(
    mesh: &TriMesh,
    field: Option<&dyn SignedDistance>,
    openings: &Openings,
    params: &FillParams,
    monitor: &mut dyn Monitor,
) -> Result<(Derived, FillReport), CleanupError> {
    params.validate()?;
    openings.validate()?;
    let mut work = EditMesh::new(mesh);
    let (_, mut half_edges) = make_manifold_in_place(&mut work);
    let (report, _) = fill(&mut work, &mut half_edges, field, openings, params, false, monitor)?;
    Ok((work.finish(), report))
}

/// The largest share of the area that is cut away to widen holes.
const MAX_CUT: Real = 0.01;

/// [`fill_holes`] in place; updates the half-edges and returns the loops of the openings.
pub(super) fn fill(
    work: &mut EditMesh,
    half_edges: &mut HalfEdges,
    field: Option<&dyn SignedDistance>,
    openings: &Openings,
    params: &FillParams,
    single_precision: bool,
    monitor: &mut dyn Monitor,
) -> Result<(FillReport, Vec<Vec<u32>>), Cancelled> {
    let mut once =
        |work: &mut EditMesh, half_edges: &mut HalfEdges| -> Result<Attempt, Cancelled> {
            let before = work.triangles.len() as u32;
            let found =
                fill_once(work, half_edges, field, openings, params, single_precision, monitor)?;
            let added: Vec<u32> = (before..work.triangles.len() as u32).collect();
            if !added.is_empty() {
                half_edges.update(&work.triangles, &added);
            }
            Ok(found)
        };
    let Attempt { mut report, mut open, mut left } = once(work, half_edges)?;
    if left.is_empty() || params.widenings == 0 {
        return Ok((report, open));
    }
    let area: Real = (0..work.triangles.len()).map(|t| work.area(t)).sum();
    let mut tried = FillReport { cut_away: 0, ..report.clone() };
    // Widen the holes that are left, as long as that reduces their number.
    let mut best = None; // mesh and half-edges of the best attempt, unless that is the last one
    for _ in 0..params.widenings {
        let mut boundary: Vec<u32> = left.iter().flatten().map(|h| h / 3).collect();
        boundary.sort_unstable();
        boundary.dedup();
        if boundary.iter().map(|t| work.area(*t as usize)).sum::<Real>() > MAX_CUT * area {
            break;
        }
        best.get_or_insert_with(|| (work.clone(), half_edges.clone()));
        tried.cut_away += boundary.len();
        *half_edges = remove_triangles(work, half_edges, &boundary);
        let Attempt { report: found, open: new_open, left: new_left } = once(work, half_edges)?;
        left = new_left;
        tried.filled.extend(found.filled);
        (tried.left, tried.openings, tried.parted) = (found.left, found.openings, found.parted);
        if left.len() < report.left.len() && new_open.len() <= open.len() {
            (report, open, best) = (tried.clone(), new_open, None);
        }
        if left.is_empty() {
            break;
        }
    }
    if let Some(best) = best {
        (*work, *half_edges) = best;
    }
    if report.cut_away > 0 {
        work.compact();
    }
    Ok((report, open))
}

/// What is found where nothing is filled: sides of parted seams in the report, and the other loops.
pub(super) fn unfilled(work: &EditMesh, half_edges: &HalfEdges) -> (FillReport, Vec<Vec<u32>>) {
    let (mut report, mut open) = (FillReport::default(), Vec::new());
    let loops = boundary_loops(&work.triangles, half_edges);
    let is_parted = parted(work, &loops);
    for (boundary, is_parted) in loops.into_iter().zip(is_parted) {
        match is_parted {
            true => report.parted.push(LoopShape::new(work, half_edges, &boundary)),
            false => open.push(boundary),
        }
    }
    (report, open)
}

/// Result of one attempt.
struct Attempt {
    report: FillReport,
    /// Loops of openings.
    open: Vec<Vec<u32>>,
    /// Loops of holes that stay open.
    left: Vec<Vec<u32>>,
}

/// Classifies the loops and fills holes once; old half-edges keep their numbers.
fn fill_once(
    work: &mut EditMesh,
    half_edges: &HalfEdges,
    field: Option<&dyn SignedDistance>,
    openings: &Openings,
    params: &FillParams,
    single_precision: bool,
    monitor: &mut dyn Monitor,
) -> Result<Attempt, Cancelled> {
    let loops = boundary_loops(&work.triangles, half_edges);
    if work.broad_phase.is_empty() {
        let corners = |h: &u32| work.triangles[*h as usize / 3].map(|v| &work.points[v as usize]);
        let bounded: Vec<Bounded> =
            loops.iter().flatten().map(|h| (h / 3, bounds(corners(h)))).collect();
        work.broad_phase.rebuild(&work.points, &work.triangles, &bounded);
    }
    let shapes: Vec<LoopShape> =
        loops.par_iter().map(|boundary| LoopShape::new(work, half_edges, boundary)).collect();
    let kinds = kinds(openings, work, &loops, &shapes);
    let mut report = FillReport::default();
    let mut jobs = Vec::new();
    for (k, kind) in kinds.iter().enumerate() {
        match kind {
            LoopKind::Opening => report.openings.push(shapes[k]),
            LoopKind::Seam => report.parted.push(shapes[k]),
            LoopKind::Hole => jobs.push((k, Hole::new(work, half_edges, &loops[k]))),
        }
    }
    // The best shape for each hole, at first; simpler ones where it intersects something.
    let first = if field.is_some() { PatchShape::Projected } else { PatchShape::Fair };
    let make = |hole: &Hole, shape: PatchShape| {
        let mut patch = hole.patch(shape, field, params)?;
        if single_precision {
            patch.0.points[hole.points.len()..]
                .iter_mut()
                .for_each(|p| *p = p.map(|x| Real::from(x as f32)));
        }
        Some(patch)
    };
    let mut patches: Vec<Option<(Patch, PatchShape)>> =
        jobs.par_iter().map(|(_, hole)| make(hole, first)).collect();
    let (points, base) = (work.points.len(), work.triangles.len());
    loop {
        monitor.report(&Progress::stage("holes"))?;
        // Add all patches, and find those that are flat or intersect something.
        let mut owner = Vec::new();
        for (job, patch) in patches.iter().enumerate() {
            if let Some((patch, _)) = patch {
                jobs[job].1.add_patch(work, patch);
                owner.resize(work.triangles.len() - base, job);
            }
        }
        let added: Vec<u32> = (base as u32..work.triangles.len() as u32).collect();
        let flat = added
            .iter()
            .filter(|t| is_flat(work.triangles[**t as usize].map(|v| &work.points[v as usize])));
        let pairs =
            intersecting_pairs(&work.points, &work.triangles, &added, &mut work.broad_phase);
        let mut bad: Vec<usize> = flat
            .chain(pairs.iter().flatten())
            .filter(|t| **t as usize >= base)
            .map(|t| owner[*t as usize - base])
            .collect();
        bad.sort_unstable();
        bad.dedup();
        if bad.is_empty() {
            break;
        }
        work.truncate(points, base);
        let again: Vec<(usize, Option<(Patch, PatchShape)>)> = bad
            .par_iter()
            .map(|&job| {
                let shape = patches[job].as_ref().and_then(|p| simpler(p.1));
                (job, shape.and_then(|shape| make(&jobs[job].1, shape)))
            })
            .collect();
        again.into_iter().for_each(|(job, patch)| patches[job] = patch);
    }
    for ((k, hole), patch) in jobs.iter().zip(&patches) {
        match patch {
            None => report.left.push(shapes[*k]),
            Some((patch, shape)) => report.filled.push(FilledHole {
                boundary: shapes[*k],
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
        .map(|((k, _), _)| loops[*k].clone())
        .collect();
    let open = loops
        .into_iter()
        .zip(&kinds)
        .filter(|(_, v)| **v == LoopKind::Opening)
        .map(|(boundary, _)| boundary)
        .collect();
    Ok(Attempt { report, open, left })
}

/// The next simpler shape.
fn simpler(shape: PatchShape) -> Option<PatchShape> {
    match shape {
        PatchShape::Projected => Some(PatchShape::Fair),
        PatchShape::Fair => Some(PatchShape::Refined),
        PatchShape::Refined => Some(PatchShape::Plain),
        PatchShape::Plain => None,
    }
}
