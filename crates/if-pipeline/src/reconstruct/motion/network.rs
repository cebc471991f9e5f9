//! The motion of all frames as one network, with an embedding for each frame.

use super::report::Motion;
use crate::reconstruct::error::ReconstructError;
use crate::reconstruct::progress::{control, report};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::{Monitor, Progress};
use if_core::parameter::ParameterError;
use if_neural::Ended;
use if_neural::deform::{DeformParams, DeformReport, fit_deformation};
use if_neural::deformation::DeformationNetwork;
use if_neural::files::write_deformation;
use if_neural::frame::Frame;
use if_neural::mlp::DeformationConfig;
use serde::{Deserialize, Serialize};
use std::io;

/// Margin around the surface in the network's unit cube, in metres.
const MARGIN: Real = 0.05;

/// Parameters of [`distil_motion`]. The fit has a fixed number of steps, not of seconds, so that the
/// same capture gives the same bits.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionNetworkParams {
    /// The network; its number of frames is replaced by that of the capture.
    pub network: DeformationConfig,
    /// Seed of its initial values.
    pub seed: u64,
    /// Parameters of the fit.
    pub fit: DeformParams,
}

impl Default for MotionNetworkParams {
    fn default() -> Self {
        Self { network: DeformationConfig::fast(1), seed: 1, fit: DeformParams::default() }
    }
}

impl MotionNetworkParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        DeformationConfig { frames: 1, ..self.network.clone() }.layout()?;
        self.fit.validate()
    }
}

/// d(x, hᵢ): a network that was fitted to a [`Motion`].
#[derive(Clone, Debug)]
pub struct MotionNetwork {
    /// The network.
    pub network: DeformationNetwork,
    /// The map from metres to the network's unit cube.
    pub frame: Frame,
    /// Its errors.
    pub report: MotionNetworkReport,
}

/// Errors of the motion's network at held-out vertices, every tenth, in all frames.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MotionNetworkReport {
    /// Steps of the fit.
    pub steps: u64,
    /// Mean error, in millimetres.
    pub mean_mm: Real,
    /// Largest error, in millimetres.
    pub max_mm: Real,
    /// Mean |d| for comparison, in millimetres: the error of d = 0.
    pub still_mm: Real,
}

/// Fits a network, with an embedding for each frame, to the `motion` of a `surface`.
///
/// # Errors
///
/// [`ReconstructError`].
///
/// # Panics
///
/// If the motion is of another surface.
pub fn distil_motion(
    motion: &Motion,
    surface: &TriMesh,
    params: &MotionNetworkParams,
    monitor: &mut dyn Monitor,
) -> Result<MotionNetwork, ReconstructError> {
    let at = Frame::around(&surface.aabb(), MARGIN)?;
    let config = DeformationConfig { frames: motion.offsets.len(), ..params.network.clone() };
    let mut network = DeformationNetwork::new(&config, params.seed)?;
    let found = distil_into(&mut network, &at, (motion, surface), &params.fit, monitor)?;
    let e = &found.error;
    let errors = MotionNetworkReport {
        steps: found.steps,
        mean_mm: 1e3 * e.mean,
        max_mm: 1e3 * e.max,
        still_mm: 1e3 * e.still,
    };
    Ok(MotionNetwork { network, frame: at, report: errors })
}

/// Fits d to the motion of the vertices of a surface.
///
/// # Panics
///
/// If the motion is of another surface.
pub(in crate::reconstruct) fn distil_into(
    network: &mut DeformationNetwork,
    at: &Frame,
    (motion, surface): (&Motion, &TriMesh),
    params: &DeformParams,
    monitor: &mut dyn Monitor,
) -> Result<DeformReport, ReconstructError> {
    let rest = surface.vertices();
    let moved = |d: &Vec<_>| -> Vec<Point> {
        assert!(d.is_empty() || d.len() == rest.len(), "one offset for each vertex of the surface");
        if d.is_empty() { rest.to_vec() } else { rest.iter().zip(d).map(|(p, d)| p + d).collect() }
    };
    let frames: Vec<Vec<Point>> = motion.offsets.iter().map(moved).collect();
    let steps = params.steps as usize;
    report(monitor, "motion_network", (0, steps), None)?;
    let mut progress =
        |p: &Progress<'_>| control(report(monitor, "motion_network", (p.done, steps), None));
    let found = fit_deformation(network, at, rest, &frames, params, &mut progress)?;
    if found.ended == Ended::Diverged {
        return Err(ReconstructError::NetworkDiverged { steps: found.steps });
    }
    Ok(found)
}

impl MotionNetwork {
    /// The bytes of its file, `deformation.safetensors`; [`if_neural::files::read_deformation`]
    /// reads them.
    ///
    /// # Errors
    ///
    /// None, unless memory is exhausted.
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
    use if_core::monitor::{Progress, Silent};
    use if_core::shapes::meshes;
    use if_neural::files::read_deformation;
    use if_neural::schedule::Schedule;
    use std::ops::ControlFlow;

    #[test]
    fn a_motion_is_fitted_and_its_file_is_read_again() {
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
        let found = distil_motion(&motion, &ball, &params, &mut Silent).unwrap();
        let r = found.report;
        assert!(r.mean_mm < 0.3 * r.still_mm && r.still_mm > 5.0 && r.steps == 300, "{r:?}");
        let (network, frame) = read_deformation(&found.to_bytes().unwrap()[..]).unwrap();
        let p = Point::new(0.1, 0.2, -0.3);
        let mut d = [[0.0; 3]; 2];
        network.offsets(&[frame.to_unit(&p); 2], &[0, 3], &mut d);
        let metres = |d: [f32; 3]| Real::from(d[1]) / frame.scale;
        assert!((metres(d[0]) - 0.02 * (0.4 as Real).sin()).abs() < 0.006, "{d:?}");
        assert!(metres(d[1]).abs() < 0.006, "{d:?}");
        let stopped = distil_motion(&motion, &ball, &params, &mut |p: &Progress| {
            if p.done == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert!(matches!(stopped, Err(ReconstructError::Cancelled(_))));
    }
}
