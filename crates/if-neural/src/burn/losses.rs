//! The losses of the fits in tensor operations: the twins of [`crate::loss`] and of the loss in
//! [`crate::deform`].

use super::tensors::tensor;
use crate::deform::DeformParams;
use crate::loss::{Known, LossParams};
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;

/// ρ_s of a square: √(x² + s²) − s, without the cancellation of the difference.
fn robust<B: Backend>(square: Tensor<B, 2>, s: f64) -> Tensor<B, 2> {
    let root = square.clone().add_scalar(s * s).sqrt();
    square / root.add_scalar(s)
}

/// Geman and McClure's s / (s + c²) of a square s.
fn bounded<B: Backend>(square: Tensor<B, 2>, c: f64) -> Tensor<B, 2> {
    square.clone() / square.add_scalar(c * c)
}

/// The sum of the squares in each row.
fn squares<B: Backend>(rows: Tensor<B, 2>) -> Tensor<B, 2> {
    rows.powi_scalar(2).sum_dim(1)
}

/// Mean loss of the samples φ (n × 1) and ∇φ (n × 3) against what is known there.
pub(super) fn field_loss<B: Backend>(
    params: &LossParams,
    known: &[Known],
    value: Tensor<B, 2>,
    gradient: Tensor<B, 2>,
) -> Tensor<B, 1> {
    let (n, device) = (known.len(), value.device());
    let column = |of: &dyn Fn(&Known) -> f32| -> Tensor<B, 2> {
        tensor(known.iter().map(of).collect(), [n, 1], &device)
    };
    let wanted = tensor(known.iter().flat_map(|k| k.gradient).collect(), [n, 3], &device);
    let off = (value - column(&|k| k.distance)).powi_scalar(2);
    let distance = robust(off, params.distance_scale) * column(&|k| k.distance_trust);
    let turned = squares(gradient.clone() - wanted);
    let normal = robust(turned, params.normal_scale) * column(&|k| k.gradient_trust);
    // A root has no derivative at 0: where ∇φ vanishes the term is constant.
    let square = squares(gradient);
    let flat = square.clone().equal_elem(0.0);
    let length = square.mask_fill(flat.clone(), 1.0).sqrt().mask_fill(flat, 0.0);
    let eikonal = length.sub_scalar(1.0).powi_scalar(2);
    let sum = distance.mul_scalar(params.distance)
        + normal.mul_scalar(params.normal)
        + eikonal.mul_scalar(0.5 * params.eikonal);
    sum.sum().div_scalar(n as f64)
}

/// Mean loss of the samples d (n × 3) and ∂d/∂x (n × 3 × 3), where `wanted` has the offsets that are
/// known.
pub(super) fn offset_loss<B: Backend>(
    params: &DeformParams,
    wanted: &[Option<[f32; 3]>],
    offset: Tensor<B, 2>,
    jacobian: Tensor<B, 3>,
) -> Tensor<B, 1> {
    let (n, device) = (wanted.len(), offset.device());
    let known = wanted.iter().map(|w| f32::from(u8::from(w.is_some()))).collect();
    let known: Tensor<B, 2> = tensor(known, [n, 1], &device);
    let wanted = wanted.iter().flat_map(|w| w.unwrap_or_default()).collect();
    let off = squares(offset.clone() - tensor(wanted, [n, 3], &device));
    let data = robust(off, params.data_scale) * known;
    let small = bounded(squares(offset), params.small_scale);
    // With F = 1 + J: (FᵀF − 1) / 2 = (J + Jᵀ + JᵀJ) / 2.
    let transposed = jacobian.clone().swap_dims(1, 2);
    let strain = (jacobian.clone() + transposed.clone() + transposed.matmul(jacobian)) * 0.5;
    let rigidity = bounded(squares(strain.reshape([n, 9])), params.rigidity_scale);
    let sum = data.mul_scalar(params.data)
        + small.mul_scalar(params.small)
        + rigidity.mul_scalar(params.rigidity);
    sum.sum().div_scalar(n as f64)
}
