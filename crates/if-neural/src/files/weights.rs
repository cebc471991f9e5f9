//! Weights with and without weight norm [Salimans and Kingma 2016], W = g v / |v|.

use super::ReadError;
use super::tensors::Tensors;
use crate::mlp::SdfConfig;
use crate::sdf::SdfNetwork;
use crate::trainable::TrainableField;

/// θ of the same network without weight norm.
pub(super) fn fold(sdf: &SdfNetwork) -> Vec<f32> {
    let theta = sdf.parameters();
    let mut out = Vec::new();
    for layer in &sdf.layout().layers {
        let rows = theta[layer.weight.clone()].chunks_exact(layer.columns);
        for (r, row) in rows.enumerate() {
            let scale =
                layer.gain.as_ref().map_or(1.0, |gain| gain_by_length(theta[gain.start + r], row));
            out.extend(row.iter().map(|v| (f64::from(*v) * scale) as f32));
        }
        out.extend_from_slice(&theta[layer.bias.clone()]);
    }
    out
}

/// g / |v|. A row of zeros has no direction: it stays zero, whatever its gain.
fn gain_by_length(gain: f32, row: &[f32]) -> f64 {
    let norm = norm(row);
    if norm > 0.0 { f64::from(gain) / norm } else { 0.0 }
}

fn norm(row: &[f32]) -> f64 {
    row.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt()
}

/// θ in the order of the layout: weight, bias and gain of each layer.
pub(super) fn sdf_theta(
    tensors: &Tensors,
    config: &SdfConfig,
    prefix: &str,
) -> Result<Vec<f32>, ReadError> {
    let layout = config.layout()?;
    let mut theta = Vec::new();
    for (l, layer) in layout.layers.iter().enumerate() {
        let name = |what: &str| format!("{prefix}lin{l}.{what}");
        let weight = [layer.rows, layer.columns];
        let pairs = [
            ["weight_v", "weight_g"],
            ["parametrizations.weight.original1", "parametrizations.weight.original0"],
        ];
        let normed = pairs.iter().map(|pair| pair.map(&name)).find(|pair| tensors.has(&pair[0]));
        let bias = |theta: &mut Vec<f32>| tensors.append(&name("bias"), &[layer.rows], theta);
        match (&layer.gain, normed) {
            (Some(_), Some([v, g])) => {
                tensors.append(&v, &weight, &mut theta)?;
                bias(&mut theta)?;
                tensors.append(&g, &[layer.rows, 1], &mut theta)?;
            }
            // A folded file for a network with weight norm: g = |v|.
            (Some(_), None) => {
                let first = theta.len();
                tensors.append(&name("weight"), &weight, &mut theta)?;
                let gains: Vec<f32> = theta[first..]
                    .chunks_exact(layer.columns)
                    .map(|row| norm(row) as f32)
                    .collect();
                bias(&mut theta)?;
                theta.extend(gains);
            }
            // A file with weight norm for a network without: W = g v / |v|.
            (None, Some([v, g])) => {
                let first = theta.len();
                tensors.append(&v, &weight, &mut theta)?;
                let mut gains = Vec::new();
                tensors.append(&g, &[layer.rows, 1], &mut gains)?;
                for (row, gain) in theta[first..].chunks_exact_mut(layer.columns).zip(gains) {
                    let scale = gain_by_length(gain, row);
                    row.iter_mut().for_each(|w| *w = (f64::from(*w) * scale) as f32);
                }
                bias(&mut theta)?;
            }
            (None, None) => {
                tensors.append(&name("weight"), &weight, &mut theta)?;
                bias(&mut theta)?;
            }
        }
    }
    Ok(theta)
}
