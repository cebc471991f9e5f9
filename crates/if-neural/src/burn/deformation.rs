//! d as a burn module: plain tensor operations on any backend.

use super::encoding::encode;
use super::tensors::{floats, parameter, tensor};
use crate::deformation::DeformationNetwork;
use crate::encoding::band_weights;
use crate::error::NetworkError;
use crate::mlp::{DeformationConfig, LayerLayout};
use burn::module::{Ignored, Module, Param};
use burn::tensor::backend::Backend;
use burn::tensor::{Int, Tensor};

/// The parameters of [`DeformationNetwork`] as burn parameters.
///
/// Weights are rows × columns as in PyTorch.
#[derive(Module, Debug)]
pub struct DeformationModule<B: Backend> {
    /// W of each layer.
    pub weights: Vec<Param<Tensor<B, 2>>>,
    /// b of each layer.
    pub biases: Vec<Param<Tensor<B, 1>>>,
    /// hᵢ, frames × length; `None` if embeddings have the length 0.
    pub embeddings: Option<Param<Tensor<B, 2>>>,
    config: Ignored<DeformationConfig>,
    alpha: Ignored<f32>,
}

impl<B: Backend> DeformationModule<B> {
    /// A copy of `network`, with its α, on `device`.
    pub fn from_network(network: &DeformationNetwork, device: &B::Device) -> Self {
        let (theta, layout, config) = (network.parameters(), network.layout(), network.config());
        let (frames, length) = (config.frames, config.embedding);
        let weight =
            &|at: &LayerLayout| parameter(&theta[at.weight.clone()], [at.rows, at.columns], device);
        let embeddings = &theta[layout.parameters..];
        DeformationModule {
            weights: layout.layers.iter().map(weight).collect(),
            biases: layout
                .layers
                .iter()
                .map(|at| parameter(&theta[at.bias.clone()], [at.rows], device))
                .collect(),
            embeddings: (length > 0).then(|| parameter(embeddings, [frames, length], device)),
            config: Ignored(config.clone()),
            alpha: Ignored(network.alpha()),
        }
    }

    /// The network with this module's parameters, rounded to f32, and α.
    ///
    /// # Errors
    ///
    /// [`NetworkError::NotFinite`] if training has diverged.
    pub fn to_network(&self) -> Result<DeformationNetwork, NetworkError> {
        let mut network =
            DeformationNetwork::from_parameters(&self.config.0, floats(self.theta()))?;
        network.set_alpha(self.alpha.0);
        Ok(network)
    }

    /// The shape.
    pub fn config(&self) -> &DeformationConfig {
        &self.config.0
    }

    /// Fades the bands in up to `alpha`, as [`DeformationNetwork::set_alpha`].
    pub fn set_alpha(&mut self, alpha: f32) {
        self.alpha = Ignored(alpha);
    }

    /// All parameters in one vector, layers first, then embeddings; differentiable.
    pub fn theta(&self) -> Tensor<B, 1> {
        let mut parts = Vec::new();
        for (weight, bias) in self.weights.iter().zip(&self.biases) {
            parts.push(weight.val().flatten(0, 1));
            parts.push(bias.val());
        }
        parts.extend(self.embeddings.iter().map(|h| h.val().flatten(0, 1)));
        Tensor::cat(parts, 0)
    }

    /// d (n × 3) and J = ∂d/∂x (n × 3 × 3, row i for component i of d) at `points` (n × 3), point k
    /// in the frame `frames[k]`.
    ///
    /// The Jacobian is carried along as three tangents, written in tensor operations: one reverse
    /// pass of an autodiff backend differentiates both by the parameters.
    ///
    /// # Panics
    ///
    /// If `points` has not three columns, `frames` has another length, or a frame is out of range
    /// (burn's own messages).
    pub fn samples(
        &self,
        points: Tensor<B, 2>,
        frames: Tensor<B, 1, Int>,
    ) -> (Tensor<B, 2>, Tensor<B, 3>) {
        self.samples_at(points, frames, self.alpha.0)
    }

    /// [`Self::samples`] with the bands faded in up to `alpha`.
    pub(super) fn samples_at(
        &self,
        points: Tensor<B, 2>,
        frames: Tensor<B, 1, Int>,
        alpha: f32,
    ) -> (Tensor<B, 2>, Tensor<B, 3>) {
        let config = &self.config.0;
        let (encoded, slopes) = encode(&band_weights(config.bands, alpha), points);
        let [n, width] = encoded.dims();
        // The tangent of axis j begins with the slopes of the features that depend on it.
        let of_axis = |j: usize| (0..width).map(move |o| f32::from(u8::from(o % 3 == j)));
        let of_axes = (0..3).flat_map(of_axis).collect();
        let of_axes = tensor::<B, 3>(of_axes, [3, 1, width], &encoded.device());
        let mut tangents: Tensor<B, 2> =
            (slopes.unsqueeze_dim::<3>(0) * of_axes).reshape([3 * n, width]);
        let mut a = match &self.embeddings {
            Some(embeddings) => Tensor::cat(vec![encoded, embeddings.val().select(0, frames)], 1),
            None => encoded,
        };
        for l in 0..=config.layers {
            let weight = self.weights[l].val();
            let rows = weight.dims()[0];
            // Embeddings do not depend on the point.
            let moving = if l == 0 { weight.clone().narrow(1, 0, width) } else { weight.clone() };
            a = a.matmul(weight.transpose()) + self.biases[l].val().unsqueeze_dim(0);
            tangents = tangents.matmul(moving.transpose());
            if l < config.layers {
                let open = a.clone().greater_elem(0.0).float();
                a = a * open.clone();
                let moved: Tensor<B, 3> = tangents.reshape([3, n, rows]);
                tangents = (moved * open.unsqueeze_dim(0)).reshape([3 * n, rows]);
            }
        }
        let jacobian: Tensor<B, 3> = tangents.reshape([3, n, 3]);
        (a, jacobian.swap_dims(0, 1).swap_dims(1, 2))
    }
}
