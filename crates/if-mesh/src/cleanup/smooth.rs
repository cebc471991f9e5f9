//! Laplacian smoothing of the boundary.

use super::boundary_loop::{LoopShape, length};
use super::curve::{roughness, taubin_loop};
use super::ears::{MIN_LOOP_EDGES, trim};
use super::edit_mesh::{Derived, EditMesh};
use super::error::CleanupError;
use super::falloff::Falloff;
use super::half_edges::{HalfEdges, NONE, boundary_loops, ends, one_ring_into, outgoing};
use super::manifold::make_manifold_in_place;
use super::params::SmoothParams;
use super::project::project_back;
use super::report::{SmoothReport, SmoothedLoop};
use super::safe_move::{Paths, move_safely};
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::{Cancelled, Monitor, Progress};

/// Smooths all rough boundary loops of `mesh`: Taubin's filter along the loop, with a falloff over
/// some rings of vertices, projected back to the zero set of `field` if there is one. No move turns
/// a triangle over, takes its area or adds an intersection. A mesh that is not manifold is made so
/// first ([`make_manifold`](super::make_manifold)).
///
/// # Source
///
/// Supplement, Appendix B, Figure 2 (b); Taubin 1995.
///
/// # Errors
///
/// Parameters out of range, or cancelled.
pub fn smooth_boundary(
    mesh: &TriMesh,
    field: Option<&dyn SignedDistance>,
    params: &SmoothParams,
    monitor: &mut dyn Monitor,
) -> Result<(Derived, SmoothReport), CleanupError> {
    params.validate()?;
    let mut work = EditMesh::new(mesh);
    let (_, half_edges) = make_manifold_in_place(&mut work);
    let loops = boundary_loops(&work.triangles, &half_edges);
    let report = smooth(&mut work, &half_edges, &loops, field, params, false, monitor)?;
    work.compact(); // tips of ears that were removed
    Ok((work.finish(), report))
}

const STAGE: Progress<'static> =
    Progress { stage: "boundary", item: "", done: 0, total: None, measures: &[] };

/// A further round is made if the last one removed at least this share of the loops' roughness: of
/// the clean extractions' loops the second round removes a third, the fourth a tenth.
const GAIN: Real = 0.05;

/// In further rounds, only vertices at most this many places along the loop from one that was held
/// back move on. The others have reached their targets.
const AGAIN: usize = 10;

/// [`smooth_boundary`] in place, of the given loops. Vertices of no triangle may remain.
///
/// ```text
/// trim ears and notches of rough loops
/// repeat
///     Taubin along each rough loop (after the first round, near vertices that were held back)
///     falloff over rings → surface passes (first round) → project to φ = 0
///     move as far as no triangle turns over or adds an intersection
/// until no vertex was held back, no loop is rough, or no loop gets smoother
/// ```
pub(super) fn smooth(
    work: &mut EditMesh,
    half_edges: &HalfEdges,
    loops: &[Vec<u32>],
    field: Option<&dyn SignedDistance>,
    params: &SmoothParams,
    single_precision: bool,
    monitor: &mut dyn Monitor,
) -> Result<SmoothReport, Cancelled> {
    let mut report = SmoothReport::default();
    let line = |work: &EditMesh, boundary: &[u32]| -> Vec<u32> {
        boundary.iter().map(|&h| ends(&work.triangles, h)[0]).collect()
    };
    let at = |work: &EditMesh, line: &[u32]| -> Vec<Point> {
        line.iter().map(|v| work.points[*v as usize]).collect()
    };
    let measure = |work: &EditMesh, boundary: &[u32]| {
        let points = at(work, &line(work, boundary));
        (length(&points), roughness(&points))
    };
    let is_rough = |boundary: &[u32], rough: Real| {
        params.boundary && boundary.len() >= MIN_LOOP_EDGES && rough > params.roughness
    };
    let before: Vec<(Real, Real)> = loops.iter().map(|boundary| measure(work, boundary)).collect();
    let rough: Vec<bool> =
        loops.iter().zip(&before).map(|(boundary, b)| is_rough(boundary, b.1)).collect();
    let (mut half_edges, mut loops) = (half_edges.clone(), loops.to_vec());
    if params.trim && rough.contains(&true) {
        (half_edges, loops) = trim(work, half_edges, loops, &rough, &mut report);
    }
    let start = work.points.clone();
    let mut fixed = vec![false; start.len()];
    half_edges.boundary().for_each(|h| fixed[ends(&work.triangles, h)[0] as usize] = true);
    let outgoing = outgoing(start.len(), &work.triangles, &half_edges);
    let mut passes = vec![0; loops.len()];
    let mut last_sum = Real::INFINITY; // of the loops' roughness, a round ago
    let mut held: Option<Vec<bool>> = None;
    let (mut old, mut target) = (start.clone(), start.clone());
    let mut falloff = Falloff::new(&half_edges, &outgoing, &fixed);
    for round in 0..params.rounds {
        let progress = Progress { done: round, total: Some(params.rounds), ..STAGE };
        monitor.report(&progress)?;
        // Targets of the vertices on rough loops: the seeds of this round's moves.
        let mut seeds = Vec::new();
        let mut sum = 0.0;
        for (k, boundary) in loops.iter().enumerate().filter(|(k, _)| rough[*k]) {
            let line = line(work, boundary);
            let mut points = at(work, &line);
            let now = roughness(&points);
            if !is_rough(boundary, now) {
                continue;
            }
            sum += now;
            let goes_on = held.as_ref().map(|held| near_held_back(&line, held));
            for _ in 0..params.passes {
                if roughness(&points) <= params.roughness {
                    break;
                }
                let before = goes_on.as_ref().map(|goes_on| (goes_on, points.clone()));
                taubin_loop(&mut points, params);
                if let Some((goes_on, before)) = before {
                    (0..points.len()).filter(|k| !goes_on[*k]).for_each(|k| points[k] = before[k]);
                }
                passes[k] += 1;
            }
            line.iter().zip(&points).for_each(|(v, p)| target[*v as usize] = *p);
            seeds.extend(
                line.iter()
                    .zip(&points)
                    .filter(|(v, p)| work.points[**v as usize] != **p)
                    .map(|(v, _)| *v),
            );
        }
        let surface_passes = if round == 0 { params.surface_passes } else { 0 };
        if (seeds.is_empty() && surface_passes == 0) || sum > (1.0 - GAIN) * last_sum {
            break;
        }
        last_sum = sum;
        let mut moving = falloff.apply(work, &mut target, &seeds, params.rings);
        if surface_passes > 0 {
            smooth_surface(work, &half_edges, &outgoing, &mut target, &fixed, params, monitor)?;
            moving = (0..start.len() as u32).collect();
        }
        if let Some(field) = field {
            project_back(work, field, &mut target, &moving);
        }
        moving.retain(|v| old[*v as usize] != target[*v as usize]);
        moving.sort_unstable();
        let mut touched = Vec::new();
        moving
            .iter()
            .for_each(|v| half_edges.around(outgoing[*v as usize], |h| touched.push(h / 3)));
        touched.sort_unstable();
        touched.dedup();
        let paths =
            Paths { start: &start, old: &old, target: &target, moving: &moving, touched: &touched };
        let held_back = move_safely(work, &paths, single_precision, monitor)?;
        for v in moving.iter().map(|v| *v as usize) {
            old[v] = work.points[v];
            target[v] = work.points[v];
        }
        report.held_back = held_back.iter().filter(|h| **h).count();
        if report.held_back == 0 {
            break;
        }
        held = Some(held_back);
    }
    for (p, q) in work.points.iter().zip(&start).filter(|(p, q)| p != q) {
        report.moved += 1;
        report.farthest = report.farthest.max((p - q).norm());
    }
    report.loops = loops
        .iter()
        .enumerate()
        .map(|(k, boundary)| SmoothedLoop {
            boundary: LoopShape::new(work, &half_edges, boundary),
            length_before: before[k].0,
            roughness: [before[k].1, measure(work, boundary).1],
            passes: passes[k],
        })
        .collect();
    Ok(report)
}

/// Laplacian smoothing of the vertices that are not `fixed`, starting from their targets.
fn smooth_surface(
    work: &EditMesh,
    half_edges: &HalfEdges,
    outgoing: &[u32],
    target: &mut [Point],
    fixed: &[bool],
    params: &SmoothParams,
    monitor: &mut dyn Monitor,
) -> Result<(), Cancelled> {
    let mut ring = Vec::new();
    for _ in 0..params.surface_passes {
        monitor.report(&STAGE)?;
        let old = target.to_vec();
        for v in (0..target.len()).filter(|v| !fixed[*v] && outgoing[*v] != NONE) {
            one_ring_into(&work.triangles, half_edges, outgoing[v], &mut ring);
            let mean = ring.iter().fold(Vector::zeros(), |s, u| s + old[*u as usize].coords)
                / ring.len().max(1) as Real;
            target[v] = old[v] + (Point::from(mean) - old[v]) * params.lambda;
        }
    }
    Ok(())
}

/// For each vertex of a loop, whether one at most [`AGAIN`] places away was held back.
fn near_held_back(line: &[u32], held: &[bool]) -> Vec<bool> {
    let n = line.len();
    let mut near = vec![false; n];
    for k in (0..n).filter(|k| held[line[*k] as usize]) {
        (0..=2 * AGAIN.min(n)).for_each(|j| near[(k + n + j - AGAIN.min(n)) % n] = true);
    }
    near
}
