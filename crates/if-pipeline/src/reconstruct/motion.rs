//! The motion of single frames: their deviation from the posed surface.

mod joint;
mod mesh;
mod network;
mod params;
mod report;

pub use mesh::MeshMotion;
pub(super) use network::distil_into;
pub use network::{MotionNetwork, MotionNetworkParams, MotionNetworkReport, distil_motion};
pub use params::MotionParams;
pub use report::{FrameMotion, Motion, MotionReport, MotionRound};

use super::error::ReconstructError;
use super::evidence::gather;
use super::observe::observe_used;
use super::params::SurfaceParams;
use super::progress;
use super::refine::{self, Observed};
use super::report::Round;
use super::surface::Surface;
use crate::capture::Capture;
use if_body::Skeleton;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Monitor;
use joint::{Joint, Modes};
use rayon::prelude::*;

/// Frames per thread between two progress reports.
const TOGETHER: usize = 2;

/// Solves, for all frames of a capture at once, the motion d of the surface that
/// [`fit_surface`](super::fit_surface) fitted to them.
///
/// ```text
/// sᵢ ← 0
/// for each round
///     pose x + n sᵢ in frame i, for all i, and rasterise it
///     collect normals and silhouettes of each frame as for the surface
///     s ← the least of the evidence of all frames and of a prior in time
/// dᵢ = n sᵢ
/// ```
///
/// n are the surface's smoothed normals: motion *along* the surface is not observable, and stays
/// zero. The prior keeps d close to its mean over the frames, little bent and slow in time, so that
/// what a frame does not see follows from the frames before and after, as do frames that were skipped
/// (`surface.report`). The mean is free: the surface of all frames compromises where they differ. From
/// the second round on the prior is loosened for clothes that move. `read` are the parameters with
/// which images are read, as for the surface.
///
/// Stages: `read`, and `motion` with the measure
/// `silhouette_mm`.
///
/// # Errors
///
/// [`ReconstructError`].
pub fn fit_motion(
    capture: &Capture,
    skeleton: &Skeleton,
    surface: &Surface,
    read: &SurfaceParams,
    params: &MotionParams,
    monitor: &mut dyn Monitor,
) -> Result<Motion, ReconstructError> {
    read.validate()?;
    params.validate()?;
    capture.check_skeleton(skeleton)?;
    let frames = observe_used(capture, skeleton, &surface.report.skipped, read, monitor)?;
    let together = TOGETHER * rayon::current_num_threads();
    let count = capture.len();
    let numbers: Vec<u32> = (0..count).map(|k| capture.number(k)).collect();
    let rest = surface.mesh.vertices();
    let edges = Edges::new(&surface.mesh);
    let neighbours = edges.neighbours(rest.len());
    let directions = refine::directions(&surface.mesh, &neighbours);
    let weights = params.weights();

    let mut steps: Vec<Vec<Real>> = vec![vec![0.0; rest.len()]; count];
    let moved = |s: &[Real]| -> Vec<Point> {
        rest.iter().zip(&directions).zip(s).map(|((p, n), s)| p + n * *s).collect()
    };
    let mut rounds = Vec::with_capacity(params.rounds);
    let (n, total) = (frames.len(), params.rounds * frames.len());
    for round in 0..params.rounds {
        let mut seen: Vec<Option<Observed>> = (0..count).map(|_| None).collect();
        let mut done = 0;
        for group in frames.chunks(together) {
            let off = seen.iter().flatten().map(|s| s.round.silhouette_mm).sum::<Real>();
            let mean = (done > 0).then(|| ("silhouette_mm", off / done as Real));
            progress::report(monitor, "motion", (round * n + done, total), mean)?;
            let found: Vec<_> = group
                .par_iter()
                .map(|frame| {
                    let mesh = surface.mesh.with_vertices(moved(&steps[frame.frame]))?;
                    let one = std::slice::from_ref(frame);
                    let (skin, camera) = (&surface.skin, capture.camera());
                    let evidence = gather(&mesh, &edges, skin, camera, one, params.reach);
                    Ok(refine::observed(&mesh, &directions, &edges, &evidence, &weights))
                })
                .collect::<Result<_, ReconstructError>>()?;
            for (frame, found) in group.iter().zip(found) {
                seen[frame.frame] = Some(found);
            }
            done += group.len();
        }
        let mean = |of: fn(&Round) -> Real| {
            seen.iter().flatten().map(|s| of(&s.round)).sum::<Real>() / n.max(1) as Real
        };
        let (silhouette_mm, normal_degrees) =
            (mean(|r| r.silhouette_mm), mean(|r| r.normal_degrees));
        let modes = Modes::new(&numbers, &params.prior(spread(&steps)));
        let joint =
            Joint { edges: &edges, neighbours: &neighbours, modes: &modes, seen, so_far: &steps };
        let measure = Some(("silhouette_mm", silhouette_mm));
        let mut watch = || progress::report(monitor, "motion", ((round + 1) * n, total), measure);
        let further = joint.solve(&mut watch)?.ok_or(ReconstructError::MotionDiverged { round })?;
        let longest = params.longest_step;
        let mut squares = 0.0;
        for (s, f) in steps.iter_mut().flatten().zip(further.iter().flatten()) {
            let f = f.clamp(-longest, longest);
            *s += f;
            squares += f * f;
        }
        let step_mm = 1e3 * (squares / (count * rest.len()).max(1) as Real).sqrt();
        rounds.push(MotionRound { silhouette_mm, normal_degrees, step_mm });
    }
    let last = rounds.last().map(|r: &MotionRound| ("silhouette_mm", r.silhouette_mm));
    // Everything is done: cancelling has no effect any more.
    let _ = progress::report(monitor, "motion", (total, total), last);

    let along = |s: &Vec<Real>| directions.iter().zip(s).map(|(n, s)| n * *s).collect();
    let offsets: Vec<Vec<Vector>> = steps.iter().map(along).collect();
    let solved: Vec<bool> = (0..count).map(|k| frames.iter().any(|f| f.frame == k)).collect();
    let report = MotionReport::of(&offsets, &solved, rounds);
    Ok(Motion { offsets, report })
}

/// Root of the mean square motion about the mean over the frames.
fn spread(steps: &[Vec<Real>]) -> Real {
    let (n, size) = (steps.len().max(1) as Real, steps.first().map_or(0, Vec::len));
    let mut squares = 0.0;
    for v in 0..size {
        let mean = steps.iter().map(|s| s[v]).sum::<Real>() / n;
        squares += steps.iter().map(|s| (s[v] - mean).powi(2)).sum::<Real>();
    }
    (squares / (n * size.max(1) as Real)).sqrt()
}
