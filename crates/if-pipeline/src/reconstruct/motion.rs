//! The motion of single frames: their deviation from the posed surface.

mod mesh;
mod network;
mod params;
mod report;

pub use mesh::MeshMotion;
pub use network::{MotionNetwork, MotionNetworkParams, MotionNetworkReport, distil_motion};
pub use params::MotionParams;
pub use report::{FrameMotion, Motion, MotionReport, MotionRound};

use super::error::ReconstructError;
use super::evidence::gather;
use super::observe::{Observation, observe_used};
use super::params::SurfaceParams;
use super::progress;
use super::refine::{self, Weights};
use super::report::Round;
use super::surface::Surface;
use crate::capture::Capture;
use if_body::Skeleton;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Monitor;
use rayon::prelude::*;

/// Frames per thread between two progress reports.
const TOGETHER: usize = 2;

/// Solves, for each frame of a capture, the motion d of the surface that
/// [`fit_surface`](super::fit_surface) fitted to all frames, from that frame and its neighbours in
/// time.
///
/// ```text
/// dᵢ ← 0
/// for each round, for all frames i at once
///     pose x + dᵢ in each frame of i − window … i + window, and rasterise it
///     collect normals and silhouettes as for the surface
///     move x + dᵢ along its normals: the same least-squares problem, with more bending, and stay · dᵢ² for staying at x
/// ```
///
/// Motion along the surface is not observable, and stays zero. Regions that no frame of the window
/// sees move only by the bending term. Frames that were skipped (`surface.report`) interpolate d
/// between their neighbours in time. `read` are the parameters with which images are read, as for
/// the surface.
///
/// Stages: `read`, and `motion` with the measure `silhouette_mm`.
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

    // All frames of a round are solved from the offsets of the round before.
    let scene = Scene { capture, surface, edges: Edges::new(&surface.mesh), frames, params };
    let mut offsets: Vec<Vec<Vector>> = vec![Vec::new(); scene.frames.len()];
    let mut rounds = Vec::with_capacity(params.rounds);
    let (n, steps) = (offsets.len(), params.rounds * offsets.len());
    for round in 0..params.rounds {
        let mut found: Vec<(Vec<Vector>, Round)> = Vec::with_capacity(n);
        while found.len() < n {
            let off = found.iter().map(|(_, r)| r.silhouette_mm).sum::<Real>();
            let mean = (!found.is_empty()).then(|| ("silhouette_mm", off / found.len() as Real));
            progress::report(monitor, "motion", (round * n + found.len(), steps), mean)?;
            let group = found.len()..n.min(found.len() + together);
            let solved: Vec<_> = group.into_par_iter().map(|k| scene.solve(k, &offsets)).collect();
            for one in solved {
                let frame = scene.frames[found.len()].frame;
                found.push(one.ok_or(ReconstructError::MotionDiverged { frame, round })?);
            }
        }
        let mean = |of: fn(&Round) -> Real| {
            found.iter().map(|(_, r)| of(r)).sum::<Real>() / n.max(1) as Real
        };
        rounds.push(MotionRound {
            silhouette_mm: mean(|r| r.silhouette_mm),
            normal_degrees: mean(|r| r.normal_degrees),
            step_mm: mean(|r| r.step_mm),
        });
        offsets = found.into_iter().map(|(d, _)| d).collect();
    }
    let last = rounds.last().map(|r: &MotionRound| ("silhouette_mm", r.silhouette_mm));
    // Everything is done: cancelling has no effect any more.
    let _ = progress::report(monitor, "motion", (steps, steps), last);

    let known: Vec<usize> = scene.frames.iter().map(|f| f.frame).collect();
    let offsets = in_all_frames(&known, offsets, capture.len());
    let solved: Vec<bool> = (0..capture.len()).map(|k| known.binary_search(&k).is_ok()).collect();
    let report = MotionReport::of(&offsets, &solved, rounds);
    Ok(Motion { offsets, report })
}

/// The input of all frames.
struct Scene<'a> {
    capture: &'a Capture,
    surface: &'a Surface,
    edges: Edges,
    /// The usable frames.
    frames: Vec<Observation>,
    params: &'a MotionParams,
}

impl Scene<'_> {
    /// d of frame `k` after another round; `None` if its equations have no finite solution.
    fn solve(&self, k: usize, offsets: &[Vec<Vector>]) -> Option<(Vec<Vector>, Round)> {
        let (params, rest) = (self.params, self.surface.mesh.vertices());
        let window = self.window(k);
        let from: Vec<Point> = match &offsets[k][..] {
            [] => rest.to_vec(),
            d => rest.iter().zip(d).map(|(p, d)| p + d).collect(),
        };
        let mesh = self.surface.mesh.with_vertices(from).ok()?;
        let (skin, camera) = (&self.surface.skin, self.capture.camera());
        let evidence = gather(&mesh, &self.edges, skin, camera, &self.frames[window], params.reach);
        let MotionParams { normals, silhouettes, bending, stay, longest_step, .. } = *params;
        let weights = Weights { normals, silhouettes, bending, stay, longest_step };
        let home: Vec<Vector> = offsets[k].iter().map(|d| -d).collect();
        let (moved, _, round) = refine::solved(&mesh, &self.edges, &evidence, &weights, &home)?;
        Some((moved.iter().zip(rest).map(|(p, q)| p - q).collect(), round))
    }

    /// The frames within the window around frame `k`.
    fn window(&self, k: usize) -> std::ops::Range<usize> {
        let at = self.frames[k].frame;
        let near = |f: &Observation| f.frame.abs_diff(at) <= self.params.window;
        let first = self.frames[..k].iter().rposition(|f| !near(f)).map_or(0, |f| f + 1);
        let end =
            self.frames[k..].iter().position(|f| !near(f)).map_or(self.frames.len(), |f| k + f);
        first..end
    }
}

/// The motion of all `count` frames. Frames that are not `known` interpolate linearly in time between
/// the known ones before and after; before the first and after the last they copy the nearest one.
/// Without known frames all are zero.
fn in_all_frames(known: &[usize], offsets: Vec<Vec<Vector>>, count: usize) -> Vec<Vec<Vector>> {
    let mut all = vec![Vec::new(); count];
    for frame in 0..count {
        let after = known.partition_point(|k| *k < frame);
        all[frame] = match (after.checked_sub(1), known.get(after)) {
            (_, Some(k)) if *k == frame => offsets[after].clone(),
            (Some(before), Some(k)) => {
                let share = (frame - known[before]) as Real / (k - known[before]) as Real;
                offsets[before]
                    .iter()
                    .zip(&offsets[after])
                    .map(|(a, b)| a * (1.0 - share) + b * share)
                    .collect()
            }
            (Some(before), None) => offsets[before].clone(),
            (None, Some(_)) => offsets[after].clone(),
            (None, None) => Vec::new(),
        };
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skipped_frames_interpolate_between_their_neighbours() {
        let d = |x: Real| vec![Vector::new(x, 0.0, 0.0); 2];
        let all = in_all_frames(&[1, 4], vec![d(1.0), d(4.0)], 7);
        let x: Vec<Real> = all.iter().map(|d| d[1].x).collect();
        for (x, y) in x.iter().zip([1.0, 1.0, 2.0, 3.0, 4.0, 4.0, 4.0]) {
            approx::assert_relative_eq!(*x, y, epsilon = 1e-12);
        }
        assert_eq!(in_all_frames(&[], Vec::new(), 2), vec![Vec::<Vector>::new(); 2]);
    }
}
