//! The surface of the clothed person in canonical space, fitted to all frames.

use super::checkpoint::{self, Checkpoint};
use super::error::ReconstructError;
use super::evidence::{Evidence, gather};
use super::observe::{Observation, observe};
use super::params::SurfaceParams;
use super::report::SurfaceReport;
use super::skipped::Skipped;
use super::start::{Start, start};
use super::{progress, quality, refine};
use crate::capture::Capture;
use if_body::{SkinWeights, TemplateBody};
use if_core::edges::Edges;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_core::monitor::Monitor;
use rayon::prelude::*;
use std::path::Path;

/// The fitted surface.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The template's triangles, moved; in loose clothes those of its union with their inside.
    pub mesh: TriMesh,
    /// The weights of its vertices.
    pub skin: SkinWeights,
    /// Report.
    pub report: SurfaceReport,
}

/// Frames that are read in parallel.
const TOGETHER: usize = 8;
/// Bytes per pixel of a frame: distance and normal, and for the detection of loose clothes depth,
/// marks and labels.
pub(super) const BYTES_A_PIXEL: u64 = 16 + 6;

/// Fits the template body's surface to the masks and normals of a capture.
///
/// ```text
/// surface ← the template; for clothes that span gaps of the body, such as skirts, its union with their inside
/// for each round
///     pose the surface in each frame and rasterise it
///     collect, in canonical space, the observed normals of each triangle,
///         and the offset of each silhouette vertex from the border of the mask
///     move the vertices along their normals: one linear least-squares problem
/// ```
///
/// With a `checkpoint` path, the state is written there after each round. If the file exists and is
/// of the same capture, template and parameters, the fit continues from it, and its result has the
/// same bits as that of an uninterrupted run. The caller deletes the file.
///
/// Stages: `read`, `start`, and `surface` with the measure `silhouette_mm`.
///
/// # Source
///
/// Replaces the paper's φ and d by implicit differentiation: `docs/evidence/reconstruction.md` has
/// the reasons and the numbers.
///
/// # Errors
///
/// [`ReconstructError`].
pub fn fit_surface(
    capture: &Capture,
    template: &TemplateBody,
    params: &SurfaceParams,
    checkpoint: Option<&Path>,
    monitor: &mut dyn Monitor,
) -> Result<Surface, ReconstructError> {
    params.validate()?;
    check_input(capture, template, params, BYTES_A_PIXEL)?;
    let mut report = SurfaceReport { frames: capture.len(), ..Default::default() };
    let frames = read_frames(capture, template, params, &mut report, monitor)?;
    let look = |mesh: &TriMesh,
                edges: &Edges,
                skin: &SkinWeights,
                frames: &[Observation],
                round: usize| {
        // The closer the surface is, the closer are the borders that can belong to it.
        let reach = (params.reach * 0.5f64.powi(round as i32)).max(params.least_reach);
        gather(mesh, edges, skin, capture.camera(), frames, reach)
    };

    // Frames in which the template does not overlap the mask are skipped, once.
    let mut edges = Edges::new(&template.mesh);
    let mut evidence = look(&template.mesh, &edges, &template.skin, &frames, 0);
    let overlap = std::mem::take(&mut evidence.overlap);
    let frames = without_elsewhere(frames, &overlap, params.least_overlap, &mut report);
    if frames.len() < overlap.len() {
        evidence = look(&template.mesh, &edges, &template.skin, &frames, 0);
    }
    if frames.is_empty() {
        return Err(report.nothing_seen(capture));
    }

    report.normal_axes = evidence.axes.correlations();

    // The start: the template, or its union with loose clothes, or the state of a checkpoint.
    progress::report(monitor, "start", (0, 1), None)?;
    let start: Start = start(capture, template, params, &frames, monitor)?;
    report.start = start.report.clone();
    let (mut mesh, skin) = (start.mesh.clone(), &start.skin);
    let key = checkpoint.map(|_| checkpoint::key(capture, &start, params, &frames));
    let loose = params.in_loose_clothes();
    let params = if report.start.filled.is_some() { &loose } else { params };
    if report.start.filled.is_some() {
        edges = Edges::new(&mesh);
        evidence = look(&mesh, &edges, skin, &frames, 0);
    }
    if let (Some(path), Some(key)) = (checkpoint, &key)
        && let Some(known) = Checkpoint::read(path, key, params.rounds)?
    {
        mesh = mesh.with_vertices(known.vertices)?;
        report.rounds = known.rounds;
        evidence = look(&mesh, &edges, skin, &frames, report.rounds.len());
    }

    let off =
        |report: &SurfaceReport| report.rounds.last().map(|r| ("silhouette_mm", r.silhouette_mm));
    while report.rounds.len() < params.rounds {
        let round = report.rounds.len();
        progress::report(monitor, "surface", (round, params.rounds), off(&report))?;
        let (moved, done) = refine::step(&start.mesh, &mesh, &edges, &evidence, params)
            .ok_or(ReconstructError::SurfaceDiverged { round })?;
        mesh = mesh.with_vertices(moved)?;
        report.rounds.push(done);
        if let (Some(path), Some(key)) = (checkpoint, &key) {
            Checkpoint { vertices: mesh.vertices().to_vec(), rounds: report.rounds.clone() }
                .write(path, key)?;
        }
        evidence = look(&mesh, &edges, skin, &frames, report.rounds.len());
    }
    let Evidence { pixels, .. } = evidence;
    report.pixels = pixels;
    let (camera, skeleton) = (capture.camera(), &template.skeleton);
    report.quality = quality::measure(&mesh, &edges, skin, skeleton, camera, &frames);
    // Everything is done: cancelling has no effect any more.
    let _ = progress::report(monitor, "surface", (params.rounds, params.rounds), off(&report));
    Ok(Surface { mesh, skin: start.skin, report })
}

/// Checks that capture and template belong together, and that the images, of which `bytes_a_pixel` are
/// kept, fit into memory.
pub(super) fn check_input(
    capture: &Capture,
    template: &TemplateBody,
    params: &SurfaceParams,
    bytes_a_pixel: u64,
) -> Result<(), ReconstructError> {
    capture.check_skeleton(&template.skeleton)?;
    if template.mesh.triangles().is_empty() {
        return Err(ReconstructError::NoTemplate);
    }
    template.skin.check(template.mesh.vertices().len(), template.skeleton.len())?;
    let (camera, frames) = (capture.camera(), capture.len());
    let bytes = bytes_a_pixel * camera.width() as u64 * camera.height() as u64 * frames as u64;
    if bytes > params.memory {
        return Err(ReconstructError::Memory { frames, bytes, limit: params.memory });
    }
    Ok(())
}

/// Reads all frames in order; unusable ones are recorded in the report.
pub(super) fn read_frames(
    capture: &Capture,
    template: &TemplateBody,
    params: &SurfaceParams,
    report: &mut SurfaceReport,
    monitor: &mut dyn Monitor,
) -> Result<Vec<Observation>, ReconstructError> {
    let mut frames: Vec<Observation> = Vec::new();
    let numbers: Vec<usize> = (0..capture.len()).collect();
    for group in numbers.chunks(TOGETHER) {
        progress::report(monitor, "read", (group[0], capture.len()), None)?;
        let read: Vec<_> =
            group.par_iter().map(|k| observe(capture, &template.skeleton, *k, params)).collect();
        for frame in read {
            match frame? {
                Ok(frame) => frames.push(frame),
                Err(skipped) => report.skipped.push(skipped),
            }
        }
    }
    Ok(frames)
}

/// The frames whose `overlap` with the template is at least `least`; others are recorded in the
/// report.
pub(super) fn without_elsewhere(
    mut frames: Vec<Observation>,
    overlap: &[Real],
    least: Real,
    report: &mut SurfaceReport,
) -> Vec<Observation> {
    let elsewhere = frames.iter().zip(overlap).filter(|(_, o)| **o < least);
    report
        .skipped
        .extend(elsewhere.map(|(f, o)| Skipped::Elsewhere { frame: f.frame, overlap: *o }));
    let mut keep = overlap.iter().map(|o| *o >= least);
    frames.retain(|_| keep.next() == Some(true));
    frames
}
