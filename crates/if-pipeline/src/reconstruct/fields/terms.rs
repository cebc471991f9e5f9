//! Derivatives of a step's loss at its points, and their way into the parameters.

use super::nets::Nets;
use super::place::Adjoint;
use if_core::math::{Point, Real, Vector};
use if_neural::deformation::{OffsetLoss, OffsetSample};
use if_neural::trainable::{PointLoss, Sample32, TrainableField};
use nalgebra::Matrix3;

/// Points of a step, with the derivatives of the loss by φ, ∇φ, d and ∂d there, in metres.
#[derive(Debug, Default)]
pub(super) struct Terms {
    phi_points: Vec<Point>,
    phi: Vec<(Real, Vector)>,
    d_points: Vec<Point>,
    d_frames: Vec<u32>,
    d: Vec<(Vector, Matrix3<Real>)>,
}

impl Terms {
    /// Adds the derivatives at a point in a frame of the capture.
    pub(super) fn add(&mut self, at: &Point, frame: u32, adjoint: &Adjoint) {
        self.add_field(at, adjoint.value, adjoint.gradient);
        self.add_offset(at, frame, adjoint.offset, adjoint.jacobian);
    }

    /// Adds derivatives by φ and ∇φ.
    pub(super) fn add_field(&mut self, at: &Point, by_value: Real, by_gradient: Vector) {
        self.phi_points.push(*at);
        self.phi.push((by_value, by_gradient));
    }

    /// Adds derivatives by d and ∂d.
    pub(super) fn add_offset(
        &mut self,
        at: &Point,
        frame: u32,
        by_offset: Vector,
        by_jacobian: Matrix3<Real>,
    ) {
        self.d_points.push(*at);
        self.d_frames.push(frame);
        self.d.push((by_offset, by_jacobian));
    }

    /// The derivatives by the parameters of φ and of d, which overwrite `phi` and `deformation`.
    pub(super) fn gradients(&self, nets: &Nets, phi: &mut [f32], deformation: &mut [f32]) {
        let scale = nets.frame.scale;
        // φ and d of the networks are `scale` times those in metres; ∇φ and ∂d are the same.
        let by_field = |k: usize, _: Sample32| {
            let (value, gradient) = &self.phi[k];
            PointLoss {
                loss: 0.0,
                d_value: (value / scale) as f32,
                d_gradient: [0, 1, 2].map(|c| gradient[c] as f32),
            }
        };
        nets.phi.loss_gradient(&nets.units(&self.phi_points), &by_field, phi);
        let by_offset = |k: usize, _: OffsetSample| {
            let (offset, jacobian) = &self.d[k];
            OffsetLoss {
                loss: 0.0,
                d_offset: [0, 1, 2].map(|c| (offset[c] / scale) as f32),
                d_jacobian: [0, 1, 2].map(|r| [0, 1, 2].map(|c| jacobian[(r, c)] as f32)),
            }
        };
        let points = nets.units(&self.d_points);
        nets.deformation.loss_gradient(&points, &self.d_frames, &by_offset, deformation);
    }
}
