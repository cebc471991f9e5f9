//! φ and ∇φ by the fused kernels, as one differentiable burn operation.

use std::sync::{Arc, Mutex, PoisonError};

use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorPrimitive};
use burn_autodiff::Autodiff;
use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::CheckpointStrategy;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};

use crate::burn::tensors::{floats, tensor};
use crate::error::NetworkError;
use crate::mlp::{SdfConfig, check_parameters};
use crate::sdf::SdfNetwork;
use crate::trainable::{PointLoss, Sample32, TrainableField};

/// The fused kernels as an operation on θ.
///
/// Forward: φ and ∇φ. Backward: the training step of [`SdfNetwork`], which runs the forward pass
/// again; that costs 8 products a layer and step where the fit beside burn needs 6. The points are
/// constants: no derivative by them is formed. The arithmetic is f32 on the CPU whatever the
/// backend; numbers travel through the host.
#[derive(Clone, Debug)]
pub struct FusedSdf {
    config: SdfConfig,
    spare: Spare,
}

/// Networks whose memory is free.
type Spare = Arc<Mutex<Vec<SdfNetwork>>>;

/// What the backward pass needs: the network at the θ of the forward pass.
#[derive(Debug)]
struct Saved {
    network: Option<SdfNetwork>,
    points: Vec<[f32; 3]>,
    spare: Spare,
}

impl Drop for Saved {
    fn drop(&mut self) {
        let mut spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner);
        spare.extend(self.network.take());
    }
}

impl FusedSdf {
    /// The operation for networks of one shape.
    pub fn new(config: &SdfConfig) -> Self {
        FusedSdf { config: config.clone(), spare: Spare::default() }
    }

    /// φ and ∇φ at `points` as rows `[φ, ∂φ/∂x, ∂φ/∂y, ∂φ/∂z]`, for the parameters `theta` in the
    /// order of [`SdfConfig::layout`] (see [`SdfModule::theta`](super::SdfModule::theta)).
    ///
    /// # Errors
    ///
    /// [`NetworkError`], for a shape that cannot be built, or a θ of another length or with a
    /// number that is not finite.
    pub fn samples<B: Backend, C: CheckpointStrategy>(
        &self,
        theta: Tensor<Autodiff<B, C>, 1>,
        points: &[[f32; 3]],
    ) -> Result<Tensor<Autodiff<B, C>, 2>, NetworkError> {
        let device = theta.device();
        let values = floats(theta.clone().inner());
        let spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let network = match spare {
            Some(mut network) => {
                check_parameters(&values, network.parameters().len())?;
                network.parameters_mut().copy_from_slice(&values);
                network.refresh();
                network
            }
            None => SdfNetwork::from_parameters(&self.config, values)?,
        };
        let mut samples = vec![Sample32::default(); points.len()];
        network.samples32(points, &mut samples);
        let rows = samples
            .iter()
            .flat_map(|s| [s.value, s.gradient[0], s.gradient[1], s.gradient[2]])
            .collect();
        let saved = Saved {
            network: Some(network),
            points: points.to_vec(),
            spare: Arc::clone(&self.spare),
        };
        let output = primitive::<B, 2>(rows, [points.len(), 4], &device);
        let theta = theta.into_primitive().tensor();
        let operation = Samples.prepare::<C>([theta.node.clone()]).compute_bound().stateful();
        let output = match operation {
            OpsKind::Tracked(operation) => operation.finish(Arc::new(saved), output),
            OpsKind::UnTracked(operation) => operation.finish(output),
        };
        Ok(Tensor::from_primitive(TensorPrimitive::Float(output)))
    }
}

/// The operation on burn's tape.
#[derive(Debug)]
struct Samples;

impl<B: Backend> Backward<B, 1> for Samples {
    type State = Arc<Saved>;

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let by_output = gradients.consume::<B>(&ops.node);
        let [Some(parent)] = &ops.parents else { return };
        let by_output = Tensor::<B, 2>::from_primitive(TensorPrimitive::Float(by_output));
        let device = by_output.device();
        let rows = floats(by_output);
        let Saved { network: Some(network), points, .. } = ops.state.as_ref() else { return };
        let mut by_theta = vec![0.0; network.parameters().len()];
        let loss = |n: usize, _: Sample32| {
            let row = &rows[4 * n..4 * n + 4];
            PointLoss { loss: 0.0, d_value: row[0], d_gradient: [row[1], row[2], row[3]] }
        };
        network.loss_gradient(points, &loss, &mut by_theta);
        let len = by_theta.len();
        gradients.register::<B>(parent.id, primitive::<B, 1>(by_theta, [len], &device));
    }
}

fn primitive<B: Backend, const D: usize>(
    values: Vec<f32>,
    shape: [usize; D],
    device: &B::Device,
) -> B::FloatTensorPrimitive {
    tensor::<B, D>(values, shape, device).into_primitive().tensor()
}
