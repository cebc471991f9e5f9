//! The positional encoding in tensor operations.

use burn::tensor::Tensor;
use burn::tensor::backend::Backend;

/// The features of the points (n × 3) and their derivatives by the coordinate `o % 3`, both n × width,
/// in the order of [`PositionalEncoding`](crate::encoding::PositionalEncoding). `weights` has one
/// factor per band.
pub(super) fn encode<B: Backend>(
    weights: &[f32],
    points: Tensor<B, 2>,
) -> (Tensor<B, 2>, Tensor<B, 2>) {
    let mut features = vec![points.clone()];
    let mut slopes = vec![points.ones_like()];
    for (band, &weight) in weights.iter().enumerate() {
        let frequency = (1_u32 << band) as f32;
        let angle = points.clone().mul_scalar(frequency);
        let sin = angle.clone().sin().mul_scalar(weight);
        let cos = angle.cos().mul_scalar(weight);
        features.extend([sin.clone(), cos.clone()]);
        slopes.extend([cos.mul_scalar(frequency), sin.mul_scalar(-frequency)]);
    }
    (Tensor::cat(features, 1), Tensor::cat(slopes, 1))
}
