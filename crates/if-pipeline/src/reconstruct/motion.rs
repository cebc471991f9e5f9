//! The motion of single frames: what a frame shows otherwise than the pose alone makes it.

mod mesh;
mod network;
mod params;
mod report;

pub use mesh::MeshMotion;
pub use network::{
    MotionNetwork, MotionNetworkError, MotionNetworkParams, MotionNetworkReport, distil_motion,
};
pub use params::MotionParams;
pub use report::{FrameMotion, MotionReport, MotionRound};

use super::evidence::gather;
use super::observe::{Observation, ObserveError, observe};
use super::params::{ParamError, SurfaceParams};
use super::progress::{Clock, Progress, Stage};
use super::refine::{self, Weights};
use super::report::Round;
use super::surface::Surface;
use crate::capture::{Capture, CaptureError};
use if_body::{PoseError, Skeleton};
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// d: where each vertex of the fitted surface lies in each frame, beside where the pose alone puts
/// it.
#[derive(Clone, Debug)]
pub struct Motion {
    /// For each frame of the capture d of each vertex of the surface, in metres of canonical space:
    /// vertices of the frame are LBS(x + d). Empty where it is zero.
    pub offsets: Vec<Vec<Vector>>,
    /// What was used, left out and reached.
    pub report: MotionReport,
}

/// Why no motion was found.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MotionError {
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
    /// The equations of a frame have no finite solution.
    #[error(
        "the motion of frame {frame} has no finite solution in round {round}; normals or weights are out of any scale"
    )]
    Singular {
        /// Its place in the capture.
        frame: usize,
        /// Which round, from 0.
        round: usize,
    },
    /// `watch` asked to stop.
    #[error("cancelled after {rounds} rounds of the motion")]
    Cancelled {
        /// Rounds that were finished.
        rounds: usize,
    },
}

impl From<ObserveError> for MotionError {
    fn from(error: ObserveError) -> Self {
        match error {
            ObserveError::Capture(source) => Self::Capture(source),
            ObserveError::Pose { frame, source } => Self::Pose { frame, source },
        }
    }
}

/// Frames for each thread between two reports of progress.
const TOGETHER: usize = 2;

/// Solves, for each frame of a capture, how the surface that [`fit_surface`](super::fit_surface)
/// found for all frames together moves there, from that frame and its neighbours in time alone.
///
/// ```text
/// dᵢ ← 0
/// for each round, for all frames i at once
///     pose x + dᵢ in each frame of i − window … i + window, and rasterise it
///     collect normals and silhouettes as for the surface
///     move x + dᵢ along its normals: the same least-squares problem, with more bending, and stay · dᵢ² for staying at x
/// ```
///
/// Motion along the surface is not seen, and stays zero. Places that no frame of the window sees
/// stay, but for what bending carries there. Frames that `surface.report` names as left out get
/// what lies between their neighbours' d in time. `read` says how pictures are read, as for the
/// surface.
///
/// `watch` is told of progress every few frames, and stops the work with [`ControlFlow::Break`].
///
/// # Errors
///
/// [`MotionError`].
pub fn fit_motion(
    capture: &Capture,
    skeleton: &Skeleton,
    surface: &Surface,
    read: &SurfaceParams,
    params: &MotionParams,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Motion, MotionError> {
    read.validate()?;
    params.validate()?;
    capture.check_skeleton(skeleton)?;
    let left_out: Vec<usize> = surface.report.skipped.iter().map(|s| s.frame()).collect();
    let numbers: Vec<usize> = (0..capture.len()).filter(|k| !left_out.contains(k)).collect();
    let together = TOGETHER * rayon::current_num_threads();
    let mut clock = Clock::new();
    let mut frames: Vec<Observation> = Vec::with_capacity(numbers.len());
    for group in numbers.chunks(together) {
        if watch(&clock.at(Stage::Read, group[0], capture.len(), None)).is_break() {
            return Err(MotionError::Cancelled { rounds: 0 });
        }
        let seen: Vec<_> = group.par_iter().map(|k| observe(capture, skeleton, *k, read)).collect();
        for frame in seen {
            frames.extend(frame?); // none that the surface could not use either
        }
    }

    let scene = Scene { capture, surface, edges: Edges::new(&surface.mesh), frames, params };
    let mut offsets: Vec<Vec<Vector>> = vec![Vec::new(); scene.frames.len()];
    let mut rounds = Vec::with_capacity(params.rounds);
    clock.restart();
    let (n, steps) = (offsets.len(), params.rounds * offsets.len());
    for round in 0..params.rounds {
        let mut found: Vec<(Vec<Vector>, Round)> = Vec::with_capacity(n);
        while found.len() < n {
            let off = found.iter().map(|(_, r)| r.silhouette_mm).sum::<Real>();
            let loss = (!found.is_empty()).then(|| off / found.len() as Real);
            if watch(&clock.at(Stage::Motion, round * n + found.len(), steps, loss)).is_break() {
                return Err(MotionError::Cancelled { rounds: round });
            }
            let group = found.len()..n.min(found.len() + together);
            let solved: Vec<_> = group.into_par_iter().map(|k| scene.solve(k, &offsets)).collect();
            for one in solved {
                let frame = scene.frames[found.len()].frame;
                found.push(one.ok_or(MotionError::Singular { frame, round })?);
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
    let _ = watch(&clock.at(
        Stage::Motion,
        steps,
        steps,
        rounds.last().map(|r: &MotionRound| r.silhouette_mm),
    ));

    let known: Vec<usize> = scene.frames.iter().map(|f| f.frame).collect();
    let offsets = in_all_frames(&known, offsets, capture.len());
    let solved: Vec<bool> = (0..capture.len()).map(|k| known.binary_search(&k).is_ok()).collect();
    let report = MotionReport::of(&offsets, &solved, rounds);
    Ok(Motion { offsets, report })
}

/// What all frames share.
struct Scene<'a> {
    capture: &'a Capture,
    surface: &'a Surface,
    edges: Edges,
    /// Those that bring something.
    frames: Vec<Observation>,
    params: &'a MotionParams,
}

impl Scene<'_> {
    /// d of frame `k` after another round; `None` where its equations have no finite solution.
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

    /// The frames that say something about frame `k`.
    fn window(&self, k: usize) -> std::ops::Range<usize> {
        let at = self.frames[k].frame;
        let near = |f: &Observation| f.frame.abs_diff(at) <= self.params.window;
        let first = self.frames[..k].iter().rposition(|f| !near(f)).map_or(0, |f| f + 1);
        let end =
            self.frames[k..].iter().position(|f| !near(f)).map_or(self.frames.len(), |f| k + f);
        first..end
    }
}

/// The motion of all `count` frames: of those that are not `known`, in proportion to time between
/// that of the known before and after; before the first and after the last that of the nearest;
/// without any, zero.
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
    fn frames_without_evidence_move_as_those_before_and_after() {
        let d = |x: Real| vec![Vector::new(x, 0.0, 0.0); 2];
        let all = in_all_frames(&[1, 4], vec![d(1.0), d(4.0)], 7);
        let x: Vec<Real> = all.iter().map(|d| d[1].x).collect();
        for (x, y) in x.iter().zip([1.0, 1.0, 2.0, 3.0, 4.0, 4.0, 4.0]) {
            approx::assert_relative_eq!(*x, y, epsilon = 1e-12);
        }
        assert_eq!(in_all_frames(&[], Vec::new(), 2), vec![Vec::<Vector>::new(); 2]);
    }
}
