//! The canonical surface of a capture.

use super::checkpoint::{self, Checkpoint, CheckpointError};
use super::evidence::{Evidence, gather};
use super::observe::{Observation, ObserveError, observe};
use super::params::{ParamError, SurfaceParams};
use super::progress::{Clock, Progress, Stage};
use super::refine;
use super::report::{Skipped, SurfaceReport};
use super::start::{Start, start};
use crate::capture::{Capture, CaptureError};
use if_body::PoseError;
use if_body::SkinError;
use if_body::SkinWeights;
use if_body::TemplateBody;
use if_core::edges::Edges;
use if_core::math::Real;
use if_core::mesh::{MeshError, TriMesh};
use if_mesh::extract::ExtractError;
use if_mesh::sdf::SdfError;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::path::Path;

/// Why no surface was found.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// A parameter is out of range.
    #[error(transparent)]
    Params(#[from] ParamError),
    /// The capture is at fault.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A pose does not fit the skeleton.
    #[error("frame {frame}: {source}")]
    Pose {
        /// Its place in the capture.
        frame: usize,
        /// What is wrong with it.
        source: PoseError,
    },
    /// The template has no triangles.
    #[error("the template body has no triangles")]
    NoTemplate,
    /// The template's weights do not match its mesh or skeleton.
    #[error("the template body: {0}")]
    Skin(#[from] SkinError),
    /// The capture is too large.
    #[error(
        "the images of {frames} frames would take {bytes} bytes at once, {limit} are allowed; take fewer frames or smaller images, or \
         allow more (`memory`)"
    )]
    Memory {
        /// Frames of the capture.
        frames: usize,
        /// What they would take.
        bytes: u64,
        /// What is allowed.
        limit: u64,
    },
    /// No frame brings anything.
    #[error("none of the {frames} frames can be used: {first}; check masks, poses and camera")]
    NothingSeen {
        /// Frames of the capture.
        frames: usize,
        /// Why the first was skipped.
        first: Skipped,
    },
    /// The template has no inside, which its union with loose clothes needs.
    #[error("the template has no inside: {0}; make it closed, or set `least_loose` to 1")]
    Inside(#[from] SdfError),
    /// The union of template and loose clothes cannot be extracted.
    #[error(transparent)]
    Extract(#[from] ExtractError),
    /// The equations of a round have no finite solution.
    #[error("round {round} has no finite solution; normals or weights are out of any scale")]
    Singular {
        /// Which round, from 0.
        round: usize,
    },
    /// The surface of a checkpoint is another one.
    #[error("the checkpoint's surface does not fit: {0}")]
    Mesh(#[from] MeshError),
    /// The checkpoint cannot be read or written.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// `watch` asked to stop. What was reached is in the checkpoint.
    #[error("cancelled after {rounds} rounds")]
    Cancelled {
        /// Rounds that were finished.
        rounds: usize,
    },
}

impl From<ObserveError> for SurfaceError {
    fn from(error: ObserveError) -> Self {
        match error {
            ObserveError::Capture(source) => Self::Capture(source),
            ObserveError::Pose { frame, source } => Self::Pose { frame, source },
        }
    }
}

/// The clothed person in canonical space, and how it was found.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The template's triangles at the places that were seen; or, in loose clothes, those of its
    /// union with what they fill.
    pub mesh: TriMesh,
    /// The weights of its vertices.
    pub skin: SkinWeights,
    /// What was used, left out and reached.
    pub report: SurfaceReport,
}

/// Frames that are read together.
const TOGETHER: usize = 8;
/// Of a frame: its distances and normals, and while loose clothes are looked for depth, marks and
/// labels.
const BYTES_A_PIXEL: u64 = 16 + 6;

/// Fits the template body's surface to the masks and normals of a capture.
///
/// ```text
/// surface ← the template; in clothes that span what it has apart, such as skirts, its union with the inside of the clothes
/// for each round
///     pose the surface in each frame and rasterise it
///     collect, in canonical space, the normals that each triangle was seen with,
///         and the way of each silhouette vertex to the border of the mask
///     move the vertices along their normals: one linear least-squares problem
/// ```
///
/// `watch` is told of progress before each frame group and round, and stops the work with
/// [`ControlFlow::Break`]. With a `checkpoint` path, the state is written there after each round,
/// and taken up from there where the file is of the same capture, template and parameters: the
/// result has the same bits as that of an uninterrupted run. The file is left there for the caller
/// to remove.
///
/// # Source
///
/// Instead of the paper's φ and d by implicit differentiation: see `docs/reconstruction.md` for the
/// reasons and the numbers.
///
/// # Errors
///
/// [`SurfaceError`].
pub fn fit_surface(
    capture: &Capture,
    template: &TemplateBody,
    params: &SurfaceParams,
    checkpoint: Option<&Path>,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Surface, SurfaceError> {
    params.validate()?;
    capture.check_skeleton(&template.skeleton)?;
    if template.mesh.triangles().is_empty() {
        return Err(SurfaceError::NoTemplate);
    }
    let vertices = template.mesh.vertices().len();
    let joints = template.skeleton.len();
    template.skin.check(vertices, joints)?;
    let (camera, count) = (capture.camera(), capture.len());
    let bytes = BYTES_A_PIXEL * camera.width() as u64 * camera.height() as u64 * count as u64;
    if bytes > params.memory {
        return Err(SurfaceError::Memory { frames: count, bytes, limit: params.memory });
    }
    let mut clock = Clock::new();
    let mut frames: Vec<Observation> = Vec::new();
    let mut report = SurfaceReport { frames: capture.len(), ..Default::default() };
    let numbers: Vec<usize> = (0..capture.len()).collect();
    for group in numbers.chunks(TOGETHER) {
        if watch(&clock.at(Stage::Read, group[0], capture.len(), None)).is_break() {
            return Err(SurfaceError::Cancelled { rounds: 0 });
        }
        let read: Vec<_> =
            group.par_iter().map(|k| observe(capture, &template.skeleton, *k, params)).collect();
        for frame in read {
            match frame? {
                Ok(frame) => frames.push(frame),
                Err(skipped) => report.skipped.push(skipped),
            }
        }
    }
    // The nearer the surface is, the less far away a border can be its own.
    let look = |mesh: &TriMesh,
                edges: &Edges,
                skin: &SkinWeights,
                frames: &[Observation],
                round: usize| {
        let reach = (params.reach * 0.5f64.powi(round as i32)).max(params.least_reach);
        gather(mesh, edges, skin, capture.camera(), frames, reach)
    };

    // Frames in which the template lies elsewhere are left out, once.
    let mut edges = Edges::new(&template.mesh);
    let mut evidence = look(&template.mesh, &edges, &template.skin, &frames, 0);
    let overlap = std::mem::take(&mut evidence.overlap);
    if overlap.iter().any(|o| *o < params.least_overlap) {
        let elsewhere = frames.iter().zip(&overlap).filter(|(_, o)| **o < params.least_overlap);
        report
            .skipped
            .extend(elsewhere.map(|(f, o)| Skipped::Elsewhere { frame: f.frame, overlap: *o }));
        let mut keep = overlap.iter().map(|o| *o >= params.least_overlap);
        frames.retain(|_| keep.next() == Some(true));
        evidence = look(&template.mesh, &edges, &template.skin, &frames, 0);
    }
    if frames.is_empty() {
        let first = report
            .skipped
            .into_iter()
            .min_by_key(Skipped::frame)
            .expect("a capture has frames, and all were skipped");
        return Err(SurfaceError::NothingSeen { frames: capture.len(), first });
    }
    if watch(&clock.at(Stage::Start, 0, 1, None)).is_break() {
        return Err(SurfaceError::Cancelled { rounds: 0 });
    }
    let start: Start = start(capture, template, params, &frames)?;
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

    clock.restart();
    while report.rounds.len() < params.rounds {
        let round = report.rounds.len();
        let loss = report.rounds.last().map(|r| r.silhouette_mm);
        if watch(&clock.at(Stage::Surface, round, params.rounds, loss)).is_break() {
            return Err(SurfaceError::Cancelled { rounds: round });
        }
        let (moved, done) = refine::step(&start.mesh, &mesh, &edges, &evidence, params)
            .ok_or(SurfaceError::Singular { round })?;
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
    let loss: Option<Real> = report.rounds.last().map(|r| r.silhouette_mm);
    let _ = watch(&clock.at(Stage::Surface, params.rounds, params.rounds, loss));
    Ok(Surface { mesh, skin: start.skin, report })
}
