//! φ and ∇φ by the fused kernels, as one differentiable burn operation.

use std::sync::{Arc, Mutex, PoisonError};

use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData, TensorPrimitive};
use burn_autodiff::Autodiff;
use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::CheckpointStrategy;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};

use crate::burn::module::floats;
use crate::mlp::{ConfigError, SdfConfig, check_parameters};
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
    /// order of [`SdfConfig::layout`] (see [`super::module::SdfModule::theta`]).
    ///
    /// # Errors
    ///
    /// [`ConfigError`], for a shape that cannot be built, or a θ of another length or with a
    /// number that is not finite.
    pub fn samples<B: Backend, C: CheckpointStrategy>(
        &self,
        theta: Tensor<Autodiff<B, C>, 1>,
        points: &[[f32; 3]],
    ) -> Result<Tensor<Autodiff<B, C>, 2>, ConfigError> {
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

/// The operation as burn's tape knows it.
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
    Tensor::<B, D>::from_data(TensorData::new(values, shape), device).into_primitive().tensor()
}

#[cfg(test)]
mod tests {
    use burn_ndarray::NdArray;
    use burn_optim::{AdamConfig, GradientsParams, Optimizer};

    use super::*;
    use crate::burn::module::SdfModule;
    use crate::init::Normal;

    type Plain = Autodiff<NdArray>;

    fn configs() -> [SdfConfig; 2] {
        let base =
            SdfConfig { width: 64, layers: 4, skip: Some(2), features: 3, ..SdfConfig::fast() };
        [base.clone(), SdfConfig { weight_norm: false, skip: None, beta: 20.0, ..base }]
    }

    fn network(config: &SdfConfig) -> SdfNetwork {
        let mut network = SdfNetwork::new(config, 3).expect("a valid shape");
        let mut normal = Normal::seeded(1);
        network.parameters_mut().iter_mut().for_each(|v| *v += 0.03 * normal.next() as f32);
        network.refresh();
        network
    }

    fn points(count: usize) -> Vec<[f32; 3]> {
        let mut normal = Normal::seeded(2);
        (0..count).map(|_| std::array::from_fn(|_| 0.5 * normal.next() as f32)).collect()
    }

    fn tensor(points: &[[f32; 3]]) -> Tensor<Plain, 2> {
        let data = TensorData::new(points.as_flattened().to_vec(), [points.len(), 3]);
        Tensor::from_data(data, &Default::default())
    }

    /// Value and eikonal terms.
    fn loss(value: Tensor<Plain, 2>, gradient: Tensor<Plain, 2>) -> Tensor<Plain, 1> {
        let length = gradient.powi_scalar(2).sum_dim(1).sqrt();
        value.powi_scalar(2).sum() + length.sub_scalar(1.0).powi_scalar(2).sum()
    }

    fn fused_loss(
        fused: &FusedSdf,
        module: &SdfModule<Plain>,
        at: &[[f32; 3]],
    ) -> Tensor<Plain, 1> {
        let out = fused.samples(module.theta(), at).expect("finite parameters");
        loss(out.clone().narrow(1, 0, 1), out.narrow(1, 1, 3))
    }

    /// All derivatives in the order of θ.
    fn by_parameters(module: &SdfModule<Plain>, loss: Tensor<Plain, 1>) -> Vec<f32> {
        let gradients = loss.backward();
        let mut all = Vec::new();
        for l in 0..module.weights.len() {
            let weight = module.weights[l].val().grad(&gradients).expect("tracked");
            all.extend(floats(weight));
            all.extend(floats(module.biases[l].val().grad(&gradients).expect("tracked")));
            if let Some(gain) = module.gains.get(l) {
                all.extend(floats(gain.val().grad(&gradients).expect("tracked")));
            }
        }
        all
    }

    #[test]
    fn the_plain_graph_has_the_values_and_gradients_of_the_kernels() {
        for config in configs() {
            let network = network(&config);
            let module = SdfModule::<NdArray>::from_network(&network, &Default::default());
            let points = points(50);
            let data = TensorData::new(points.as_flattened().to_vec(), [50, 3]);
            let (value, gradient) = module.samples(Tensor::from_data(data, &Default::default()));
            let (value, gradient) = (floats(value), floats(gradient));
            let mut samples = vec![Sample32::default(); 50];
            network.samples32(&points, &mut samples);
            for (n, sample) in samples.iter().enumerate() {
                // Both are f32, and each is off from f64 by a few 1e-7 and 1e-6.
                assert!((sample.value - value[n]).abs() < 2e-6);
                for axis in 0..3 {
                    assert!((sample.gradient[axis] - gradient[3 * n + axis]).abs() < 2e-5);
                }
            }
        }
    }

    #[test]
    fn the_hand_written_backward_pass_has_the_gradients_of_the_plain_graph() {
        for config in configs() {
            let network = network(&config);
            let module = SdfModule::<Plain>::from_network(&network, &Default::default());
            let points = points(120);
            let (value, gradient) = module.samples(tensor(&points));
            let plain = by_parameters(&module, loss(value, gradient));
            let fused = FusedSdf::new(&config);
            let ours = by_parameters(&module, fused_loss(&fused, &module, &points));
            assert_eq!(plain.len(), network.parameters().len());
            let scale = plain.iter().fold(0.0_f32, |m, g| m.max(g.abs()));
            assert!(scale > 0.1, "the loss moves nothing");
            for (k, (a, b)) in ours.iter().zip(&plain).enumerate() {
                // Two f32 computations with β·1e-7 of rounding in each slope, over 120 points.
                assert!((a - b).abs() < 5e-5 * scale, "parameter {k}: {a} {b}");
            }
        }
    }

    #[test]
    fn conversion_there_and_back_keeps_every_bit() {
        let network = network(&configs()[0]);
        let module = SdfModule::<NdArray>::from_network(&network, &Default::default());
        let back = module.to_network().expect("finite parameters");
        assert_eq!(back.parameters(), network.parameters());
        assert_eq!(back.config(), network.config());
    }

    #[test]
    fn burns_adam_lowers_the_loss_through_the_fused_operation_as_through_the_graph() {
        let config = &configs()[0];
        let network = network(config);
        let points = points(60);
        let train = |fused: Option<FusedSdf>| -> Vec<f32> {
            let mut module = SdfModule::<Plain>::from_network(&network, &Default::default());
            let mut adam = AdamConfig::new().init();
            let mut losses = Vec::new();
            for _ in 0..6 {
                let loss = match &fused {
                    Some(fused) => fused_loss(fused, &module, &points),
                    None => {
                        let (value, gradient) = module.samples(tensor(&points));
                        loss(value, gradient)
                    }
                };
                losses.push(floats(loss.clone().inner())[0]);
                let gradients = GradientsParams::from_grads(loss.backward(), &module);
                module = adam.step(1e-3, module, gradients);
            }
            losses
        };
        let (ours, plain) = (train(Some(FusedSdf::new(config))), train(None));
        assert!(ours[5] < 0.9 * ours[0], "{ours:?}");
        for (a, b) in ours.iter().zip(&plain) {
            assert!((a - b).abs() < 1e-3 * b, "{ours:?} {plain:?}");
        }
    }

    #[test]
    fn parameters_that_are_no_numbers_are_refused() {
        let config = &configs()[1];
        let fused = FusedSdf::new(config);
        let count = config.layout().expect("a valid shape").parameters;
        let theta = |value: f32, count: usize| {
            Tensor::<Plain, 1>::from_data(
                TensorData::new(vec![value; count], [count]),
                &Default::default(),
            )
        };
        let error = fused.samples(theta(f32::NAN, count), &[[0.0; 3]]).expect_err("no number");
        assert!(matches!(error, ConfigError::NotFinite { index: 0, .. }));
        let error = fused.samples(theta(0.1, 7), &[[0.0; 3]]).expect_err("too short");
        assert!(matches!(error, ConfigError::Parameters { found: 7, .. }));
    }
}
