//! d of all frames as one network with an embedding for each frame.

use super::Motion;
use crate::reconstruct::progress::{Clock, Progress, Stage};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_neural::deform::{DeformError, DeformParams, fit_deformation};
use if_neural::deformation::DeformationNetwork;
use if_neural::files::write_deformation;
use if_neural::frame::{Frame, FrameError};
use if_neural::mlp::{ConfigError, DeformationConfig};
use serde::{Deserialize, Serialize};
use std::io;
use std::ops::ControlFlow;

/// Room about the surface in the network's cube, in metres.
const MARGIN: Real = 0.05;

/// How d becomes a network. By steps and not by the clock, so that the same capture gives the same
/// bits.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionNetworkParams {
    /// The network; its number of frames is that of the capture.
    pub network: DeformationConfig,
    /// Seed of its first values.
    pub seed: u64,
    /// The fit.
    pub fit: DeformParams,
}

impl Default for MotionNetworkParams {
    fn default() -> Self {
        Self { network: DeformationConfig::fast(1), seed: 1, fit: DeformParams::default() }
    }
}

/// d(x, hᵢ): a network that was fitted to a [`Motion`].
#[derive(Clone, Debug)]
pub struct MotionNetwork {
    /// The network.
    pub network: DeformationNetwork,
    /// Metres to its cube and back.
    pub frame: Frame,
    /// What it is off.
    pub report: MotionNetworkReport,
}

/// Errors of d's network at vertices that it was not fitted to, every tenth, in all frames.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MotionNetworkReport {
    /// Steps done.
    pub steps: u64,
    /// Mean distance from the solved d, in millimetres.
    pub mean_mm: Real,
    /// The largest, in millimetres.
    pub max_mm: Real,
    /// The mean for d = 0: mean |d|, in millimetres.
    pub still_mm: Real,
}

/// Why there is no network of d.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MotionNetworkError {
    /// A surface without extent.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A network of sizes out of range.
    #[error(transparent)]
    Network(#[from] ConfigError),
    /// Parameters of the fit, or a motion with numbers that are not finite.
    #[error(transparent)]
    Fit(#[from] DeformError),
    /// The fit's loss was no number any more.
    #[error("the network of d diverged after {steps} steps; lower `fit.schedule.rate`")]
    Diverged {
        /// Steps that were done.
        steps: u64,
    },
    /// `watch` asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// Fits a network, with an embedding for each frame, to the `motion` of a `surface`.
///
/// # Errors
///
/// [`MotionNetworkError`].
///
/// # Panics
///
/// If the motion is of another surface.
pub fn distil_motion(
    motion: &Motion,
    surface: &TriMesh,
    params: &MotionNetworkParams,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<MotionNetwork, MotionNetworkError> {
    let rest = surface.vertices();
    let moved = |d: &Vec<_>| -> Vec<Point> {
        assert!(d.is_empty() || d.len() == rest.len(), "one offset for each vertex of the surface");
        if d.is_empty() { rest.to_vec() } else { rest.iter().zip(d).map(|(p, d)| p + d).collect() }
    };
    let frames: Vec<Vec<Point>> = motion.offsets.iter().map(moved).collect();
    let at = Frame::around(&surface.aabb(), MARGIN)?;
    let config = DeformationConfig { frames: frames.len(), ..params.network.clone() };
    let mut network = DeformationNetwork::new(&config, params.seed)?;
    let (mut clock, steps) = (Clock::new(), params.fit.steps as usize);
    if watch(&clock.at(Stage::MotionNetwork, 0, steps, None)).is_break() {
        return Err(MotionNetworkError::Cancelled);
    }
    let found = fit_deformation(&mut network, &at, rest, &frames, &params.fit, &mut |step, _| {
        watch(&clock.at(Stage::MotionNetwork, step as usize, steps, None))
    })?;
    if found.cancelled {
        return Err(MotionNetworkError::Cancelled);
    }
    if found.diverged {
        return Err(MotionNetworkError::Diverged { steps: found.steps });
    }
    let e = &found.error;
    let report = MotionNetworkReport {
        steps: found.steps,
        mean_mm: 1e3 * e.mean,
        max_mm: 1e3 * e.max,
        still_mm: 1e3 * e.still,
    };
    Ok(MotionNetwork { network, frame: at, report })
}

impl MotionNetwork {
    /// The bytes of its file, `deformation.safetensors`; [`if_neural::files::read_deformation`]
    /// reads them.
    ///
    /// # Errors
    ///
    /// None while memory lasts.
    pub fn to_bytes(&self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        write_deformation(&mut bytes, &self.network, &self.frame)?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::MotionReport;
    use if_core::math::Vector;
    use if_core::shapes::meshes;
    use if_neural::files::read_deformation;
    use if_neural::schedule::Schedule;

    #[test]
    fn a_motion_is_learned_and_its_file_gives_it_again() {
        let ball = meshes::icosphere(0.5, 3);
        let wave = |frame: usize| {
            let d = |p: &Point| Vector::y() * (0.02 * (4.0 * p.x + frame as Real).sin());
            ball.vertices().iter().map(d).collect::<Vec<_>>()
        };
        // The last frame does not move.
        let offsets = vec![wave(0), wave(1), wave(2), Vec::new()];
        let motion = Motion { offsets, report: MotionReport::default() };
        let fit = DeformParams {
            steps: 300,
            batch: 128,
            anneal: 40,
            schedule: Schedule { rate: 5e-3, ..DeformParams::default().schedule },
            ..DeformParams::default()
        };
        let network = DeformationConfig { bands: 3, embedding: 8, frames: 1, width: 32, layers: 2 };
        let params = MotionNetworkParams { network, fit, ..Default::default() };
        let found =
            distil_motion(&motion, &ball, &params, &mut |_| ControlFlow::Continue(())).unwrap();
        let r = found.report;
        assert!(r.mean_mm < 0.3 * r.still_mm && r.still_mm > 5.0 && r.steps == 300, "{r:?}");
        let (network, frame) = read_deformation(&found.to_bytes().unwrap()[..]).unwrap();
        let p = Point::new(0.1, 0.2, -0.3);
        let mut d = [[0.0; 3]; 2];
        network.offsets(&[frame.to_unit(&p); 2], &[0, 3], &mut d);
        let metres = |d: [f32; 3]| Real::from(d[1]) / frame.scale;
        assert!((metres(d[0]) - 0.02 * (0.4 as Real).sin()).abs() < 0.006, "{d:?}");
        assert!(metres(d[1]).abs() < 0.006, "{d:?}");
        let stopped = distil_motion(&motion, &ball, &params, &mut |p| {
            if p.step == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert!(matches!(stopped, Err(MotionNetworkError::Cancelled)));
    }
}
