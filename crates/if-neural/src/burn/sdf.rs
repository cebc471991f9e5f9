//! φ as a burn module: plain tensor operations on any backend.

use super::encoding::encode;
use super::tensors::{floats, parameter};
use burn::module::{Ignored, Module, Param};
use burn::tensor::Tensor;
use burn::tensor::activation::sigmoid;
use burn::tensor::backend::Backend;

use crate::error::NetworkError;
use crate::mlp::{LayerLayout, SdfConfig};
use crate::sdf::SdfNetwork;
use crate::trainable::TrainableField;
use std::ops::Range;

/// The parameters of [`SdfNetwork`] as burn parameters.
///
/// Weights are rows × columns as in PyTorch; with weight norm they are v, and `gains` has the
/// gain of each row.
#[derive(Module, Debug)]
pub struct SdfModule<B: Backend> {
    /// W or v of each layer.
    pub weights: Vec<Param<Tensor<B, 2>>>,
    /// b of each layer.
    pub biases: Vec<Param<Tensor<B, 1>>>,
    /// Gains of each layer; none without weight norm.
    pub gains: Vec<Param<Tensor<B, 1>>>,
    config: Ignored<SdfConfig>,
}

impl<B: Backend> SdfModule<B> {
    /// A copy of `network` on `device`.
    pub fn from_network(network: &SdfNetwork, device: &B::Device) -> Self {
        let theta = network.parameters();
        let layers = &network.layout().layers;
        let weight =
            &|at: &LayerLayout| parameter(&theta[at.weight.clone()], [at.rows, at.columns], device);
        let vector = &|at: Range<usize>| {
            let len = at.len();
            parameter(&theta[at], [len], device)
        };
        SdfModule {
            weights: layers.iter().map(weight).collect(),
            biases: layers.iter().map(|at| vector(at.bias.clone())).collect(),
            gains: layers.iter().filter_map(|at| at.gain.clone()).map(vector).collect(),
            config: Ignored(network.config().clone()),
        }
    }

    /// The network with this module's parameters, rounded to f32.
    ///
    /// # Errors
    ///
    /// [`NetworkError::NotFinite`] if training has diverged.
    pub fn to_network(&self) -> Result<SdfNetwork, NetworkError> {
        SdfNetwork::from_parameters(&self.config.0, floats(self.theta()))
    }

    /// The shape.
    pub fn config(&self) -> &SdfConfig {
        &self.config.0
    }

    /// All parameters in one vector, in the order of [`SdfConfig::layout`]; differentiable.
    pub fn theta(&self) -> Tensor<B, 1> {
        let mut parts = Vec::new();
        for (l, weight) in self.weights.iter().enumerate() {
            parts.push(weight.val().flatten(0, 1));
            parts.push(self.biases[l].val());
            if let Some(gain) = self.gains.get(l) {
                parts.push(gain.val());
            }
        }
        Tensor::cat(parts, 0)
    }

    /// φ (n × 1) and ∇φ (n × 3) at `points` (n × 3), the gradient by the adjoint pass written in
    /// tensor operations: one reverse pass of an autodiff backend differentiates both by the
    /// parameters.
    ///
    /// # Panics
    ///
    /// If `points` has not three columns (burn's own message).
    pub fn samples(&self, points: Tensor<B, 2>) -> (Tensor<B, 2>, Tensor<B, 2>) {
        let config = &self.config.0;
        let (encoded, encoded_slopes) = encode(&vec![1.0; config.bands], points);
        let weights: Vec<_> = (0..self.weights.len()).map(|l| self.folded(l)).collect();
        let [n, width] = encoded.dims();
        // Forward: activations, and the slopes σ′ for the adjoint pass.
        let mut a = encoded.clone();
        let mut slopes = Vec::new();
        for l in 0..config.layers {
            if config.skip == Some(l) {
                a = Tensor::cat(vec![a, encoded.clone()], 1).div_scalar(std::f32::consts::SQRT_2);
            }
            let z =
                a.matmul(weights[l].clone().transpose()) + self.biases[l].val().unsqueeze_dim(0);
            let (value, slope) = softplus(z, config.beta);
            a = value;
            slopes.push(slope);
        }
        let last = weights[config.layers].clone().narrow(0, 0, 1);
        let bias = self.biases[config.layers].val().narrow(0, 0, 1).unsqueeze_dim(0);
        let value = a.matmul(last.clone().transpose()) + bias;
        // Adjoint: q is ∂φ/∂a of each layer, from the last to the first.
        let mut q = last.expand([n, config.width]);
        let mut by_encoding: Option<Tensor<B, 2>> = None;
        for l in (0..config.layers).rev() {
            q = (q * slopes[l].clone()).matmul(weights[l].clone());
            // The joined input: one part goes to the encoding, the other to the layer before.
            if config.skip == Some(l) {
                q = q.div_scalar(std::f32::consts::SQRT_2);
                by_encoding = Some(q.clone().narrow(1, config.width - width, width));
                q = q.narrow(1, 0, config.width - width);
            }
        }
        let by_encoding = by_encoding.map_or(q.clone(), |skipped| q + skipped) * encoded_slopes;
        let gradient: Tensor<B, 3> = by_encoding.reshape([n, width / 3, 3]);
        (value, gradient.sum_dim(1).squeeze_dim(1))
    }

    /// W of layer l: v, or gain · v/|v|.
    fn folded(&self, l: usize) -> Tensor<B, 2> {
        let v = self.weights[l].val();
        match self.gains.get(l) {
            None => v,
            Some(gain) => {
                // A row of zeros stays one, as in the kernels.
                let square = v.clone().powi_scalar(2).sum_dim(1);
                let zero = square.clone().equal_elem(0.0);
                let norm = square.mask_fill(zero, 1.0).sqrt();
                v * (gain.val().unsqueeze_dim(1) / norm)
            }
        }
    }
}

/// softplus(βz)/β, linear above βz = 20 as PyTorch's, and its slope.
fn softplus<B: Backend>(z: Tensor<B, 2>, beta: f32) -> (Tensor<B, 2>, Tensor<B, 2>) {
    let t = z.clone().mul_scalar(beta);
    let linear = t.clone().greater_elem(20.0);
    let value = t.clone().clamp_max(20.0).exp().log1p().div_scalar(beta);
    (value.mask_where(linear, z), sigmoid(t))
}
