//! The two networks, in metres.

use super::place::Offset;
use crate::reconstruct::error::ReconstructError;
use if_core::field::FieldSample;
use if_core::math::{Point, Real, Vector};
use if_neural::deformation::{DeformationNetwork, OffsetSample};
use if_neural::frame::Frame;
use if_neural::network::Network;
use if_neural::trainable::{Sample32, TrainableField};
use nalgebra::Matrix3;

/// φ and d in one frame of network units.
#[derive(Clone, Debug)]
pub(super) struct Nets {
    pub(super) phi: Network,
    pub(super) deformation: DeformationNetwork,
    pub(super) frame: Frame,
}

impl Nets {
    /// Points in network units.
    pub(super) fn units(&self, points: &[Point]) -> Vec<[f32; 3]> {
        points.iter().map(|p| self.frame.to_unit(p)).collect()
    }

    /// φ and ∇φ.
    pub(super) fn field(&self, points: &[Point]) -> Vec<FieldSample> {
        field_of(&self.phi, &self.frame, points)
    }

    /// d and ∂d, point k in frame `frames[k]` of the capture.
    pub(super) fn offsets(&self, points: &[Point], frames: &[u32]) -> Vec<Offset> {
        let mut out = vec![OffsetSample::default(); points.len()];
        self.deformation.samples(&self.units(points), frames, &mut out);
        let offset = |s: &OffsetSample| Offset {
            offset: Vector::from(s.offset.map(Real::from)) / self.frame.scale,
            jacobian: Matrix3::from_fn(|r, c| Real::from(s.jacobian[r][c])),
        };
        out.iter().map(offset).collect()
    }

    /// d alone, of one frame of the capture.
    pub(super) fn moved(&self, points: &[Point], frame: usize) -> Vec<Vector> {
        let mut out = vec![[0.0; 3]; points.len()];
        let frames = vec![frame as u32; points.len()];
        self.deformation.offsets(&self.units(points), &frames, &mut out);
        out.iter().map(|d| Vector::from(d.map(Real::from)) / self.frame.scale).collect()
    }

    /// Checks that all parameters are finite.
    pub(super) fn check(&self, steps: u64) -> Result<(), ReconstructError> {
        let finite = |theta: &[f32]| theta.iter().all(|p| p.is_finite());
        if finite(self.phi.parameters()) && finite(self.deformation.parameters()) {
            Ok(())
        } else {
            Err(ReconstructError::FieldsDiverged { steps })
        }
    }
}

/// φ and ∇φ of a network at points in metres.
pub(super) fn field_of(phi: &Network, frame: &Frame, points: &[Point]) -> Vec<FieldSample> {
    let units: Vec<[f32; 3]> = points.iter().map(|p| frame.to_unit(p)).collect();
    let mut out = vec![Sample32::default(); points.len()];
    phi.samples32(&units, &mut out);
    let sample = |s: &Sample32| FieldSample {
        distance: Real::from(s.value) / frame.scale,
        gradient: Vector::from(s.gradient.map(Real::from)),
    };
    out.iter().map(sample).collect()
}
