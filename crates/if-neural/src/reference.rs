//! φ and d in f64 and plain loops: the slow twins that the fused kernels are compared with.

mod deformation;

pub use crate::encoding::band_weights;
pub use deformation::{OffsetLoss64, ReferenceDeformation};

use crate::error::NetworkError;
use crate::mlp::{Layout, SdfConfig};

/// The loss of one point in f64: what [`crate::trainable::PointLoss`] is in f32.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointLoss64 {
    /// The point's share of the loss.
    pub loss: f64,
    /// ∂L/∂φ.
    pub d_value: f64,
    /// ∂L/∂(∇φ).
    pub d_gradient: [f64; 3],
}

/// φ in f64, point by point: some hundred times slower than the kernels.
#[derive(Clone, Debug)]
pub struct ReferenceSdf {
    config: SdfConfig,
    layout: Layout,
    theta: Vec<f64>,
    layers: Vec<Dense64>,
}

/// One folded linear layer.
#[derive(Clone, Debug)]
struct Dense64 {
    rows: usize,
    columns: usize,
    weight: Vec<f64>,
    bias: Vec<f64>,
}

impl Dense64 {
    /// W a.
    fn apply(&self, a: &[f64]) -> Vec<f64> {
        self.weight
            .chunks_exact(self.columns)
            .map(|row| row.iter().zip(a).map(|(w, a)| w * a).sum())
            .collect()
    }

    /// Wᵀ p.
    fn transposed(&self, p: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.columns];
        for (row, &p) in self.weight.chunks_exact(self.columns).zip(p) {
            for (out, w) in out.iter_mut().zip(row) {
                *out += w * p;
            }
        }
        out
    }

    /// W += p aᵀ.
    fn add_outer(&mut self, p: &[f64], a: &[f64]) {
        for (row, &p) in self.weight.chunks_exact_mut(self.columns).zip(p) {
            for (w, a) in row.iter_mut().zip(a) {
                *w += p * a;
            }
        }
    }
}

/// What the forward and the adjoint pass of one point leave behind.
struct Trace {
    slopes: Vec<f64>,
    inputs: Vec<Vec<f64>>,
    /// σ′ and σ″ of the hidden layers.
    first: Vec<Vec<f64>>,
    second: Vec<Vec<f64>>,
    outputs: Vec<f64>,
    /// ∂φ/∂z of each layer.
    p: Vec<Vec<f64>>,
    /// ∂φ/∂(output of hidden layer l).
    q: Vec<Vec<f64>>,
    gradient: [f64; 3],
}

impl ReferenceSdf {
    /// The network of `config` with the parameters `theta`.
    ///
    /// # Errors
    ///
    /// [`NetworkError`], for a shape that cannot be built or a θ of another length.
    pub fn new(config: &SdfConfig, theta: Vec<f64>) -> Result<Self, NetworkError> {
        let layout = config.layout()?;
        if theta.len() != layout.parameters {
            return Err(NetworkError::Length { expected: layout.parameters, got: theta.len() });
        }
        let layers = layout
            .layers
            .iter()
            .map(|at| {
                let mut weight = theta[at.weight.clone()].to_vec();
                if let Some(gain) = &at.gain {
                    for (row, g) in weight.chunks_exact_mut(at.columns).zip(&theta[gain.clone()]) {
                        let norm = row.iter().map(|v| v * v).sum::<f64>().sqrt();
                        let scale = if norm > 0.0 { g / norm } else { 0.0 };
                        row.iter_mut().for_each(|v| *v *= scale);
                    }
                }
                Dense64 {
                    rows: at.rows,
                    columns: at.columns,
                    weight,
                    bias: theta[at.bias.clone()].to_vec(),
                }
            })
            .collect();
        Ok(ReferenceSdf { config: config.clone(), layout, theta, layers })
    }

    /// φ and ∇φ at `x`.
    pub fn sample(&self, x: [f64; 3]) -> (f64, [f64; 3]) {
        let trace = self.trace(x);
        (trace.outputs[0], trace.gradient)
    }

    /// All outputs at `x`: φ and the features.
    pub fn outputs(&self, x: [f64; 3]) -> Vec<f64> {
        self.trace(x).outputs
    }

    fn trace(&self, x: [f64; 3]) -> Trace {
        let encoding = self.config.encoding();
        let mut features = vec![0.0; encoding.width()];
        let mut slopes = features.clone();
        encoding.encode64(x, &[], &mut features, &mut slopes);
        let hidden = self.config.layers;
        let (mut inputs, mut first, mut second) = (vec![features.clone()], vec![], vec![]);
        let mut outputs = Vec::new();
        for (l, layer) in self.layers.iter().enumerate() {
            let mut z = layer.apply(&inputs[l]);
            z.iter_mut().zip(&layer.bias).for_each(|(z, b)| *z += b);
            if l == hidden {
                outputs = z;
                break;
            }
            let beta = f64::from(self.config.beta);
            let (mut s, mut c) = (vec![0.0; layer.rows], vec![0.0; layer.rows]);
            for i in 0..layer.rows {
                let t = beta * z[i];
                // PyTorch's threshold: linear above 20.
                if t > 20.0 {
                    s[i] = 1.0;
                } else {
                    s[i] = 1.0 / (1.0 + (-t).exp());
                    c[i] = beta * s[i] * (1.0 - s[i]);
                    z[i] = t.exp().ln_1p() / beta;
                }
            }
            inputs.push(self.joined(l + 1, z, &features));
            first.push(s);
            second.push(c);
        }
        let mut p = vec![Vec::new(); hidden + 1];
        let mut q = vec![Vec::new(); hidden];
        let mut encoded = vec![0.0; features.len()];
        p[hidden] = vec![0.0; self.layers[hidden].rows];
        p[hidden][0] = 1.0;
        for l in (0..=hidden).rev() {
            let back = self.layers[l].transposed(&p[l]);
            if l == 0 {
                encoded.iter_mut().zip(&back).for_each(|(e, b)| *e += b);
                break;
            }
            q[l - 1] = self.split(l, back, &mut encoded);
            p[l - 1] = q[l - 1].iter().zip(&first[l - 1]).map(|(q, s)| q * s).collect();
        }
        let mut gradient = [0.0; 3];
        for (o, (e, slope)) in encoded.iter().zip(&slopes).enumerate() {
            gradient[o % 3] += e * slope;
        }
        Trace { slopes, inputs, first, second, outputs, p, q, gradient }
    }

    /// The input of layer `l` from the output of the one before.
    fn joined(&self, l: usize, h: Vec<f64>, features: &[f64]) -> Vec<f64> {
        if self.config.skip == Some(l) {
            h.iter().chain(features).map(|v| v * std::f64::consts::FRAC_1_SQRT_2).collect()
        } else {
            h
        }
    }

    /// The reverse of [`Self::joined`]: what goes to the layer before; the rest is added to
    /// `encoded`.
    fn split(&self, l: usize, back: Vec<f64>, encoded: &mut [f64]) -> Vec<f64> {
        if self.config.skip == Some(l) {
            let mut h: Vec<f64> =
                back.iter().map(|v| v * std::f64::consts::FRAC_1_SQRT_2).collect();
            let tail = h.split_off(h.len() - encoded.len());
            encoded.iter_mut().zip(&tail).for_each(|(e, t)| *e += t);
            h
        } else {
            back
        }
    }

    /// The sum of `loss(i, φ, ∇φ)` over the points and its derivative by θ, which is returned.
    ///
    /// Forward; adjoint for ∇φ; then the reverse of both: a tangent pass in the direction
    /// ∂L/∂∇φ, and a reverse pass that takes up what the tangent left at σ′.
    pub fn loss_gradient(
        &self,
        points: &[[f64; 3]],
        loss: impl Fn(usize, f64, [f64; 3]) -> PointLoss64,
    ) -> (f64, Vec<f64>) {
        let hidden = self.config.layers;
        let mut total = 0.0;
        let mut sums: Vec<Dense64> = self
            .layers
            .iter()
            .map(|layer| Dense64 {
                weight: vec![0.0; layer.weight.len()],
                bias: vec![0.0; layer.rows],
                ..*layer
            })
            .collect();
        for (index, &x) in points.iter().enumerate() {
            let trace = self.trace(x);
            let at = loss(index, trace.outputs[0], trace.gradient);
            total += at.loss;
            // Tangent pass.
            let encoded: Vec<f64> = (trace.slopes.iter().enumerate())
                .map(|(o, slope)| slope * at.d_gradient[o % 3])
                .collect();
            let mut tangent = encoded.clone();
            let mut from_slopes = Vec::new();
            for l in 0..=hidden {
                sums[l].add_outer(&trace.p[l], &tangent);
                if l == hidden {
                    break;
                }
                let moved = self.layers[l].apply(&tangent);
                from_slopes.push(
                    (0..moved.len())
                        .map(|i| moved[i] * trace.q[l][i] * trace.second[l][i])
                        .collect::<Vec<f64>>(),
                );
                let out = moved.iter().zip(&trace.first[l]).map(|(m, s)| m * s).collect();
                tangent = self.joined(l + 1, out, &encoded);
            }
            // Reverse pass.
            let mut delta = vec![0.0; self.layers[hidden].rows];
            delta[0] = at.d_value;
            let mut unused = vec![0.0; encoded.len()];
            for l in (0..=hidden).rev() {
                sums[l].add_outer(&delta, &trace.inputs[l]);
                sums[l].bias.iter_mut().zip(&delta).for_each(|(b, d)| *b += d);
                if l == 0 {
                    break;
                }
                let back = self.split(l, self.layers[l].transposed(&delta), &mut unused);
                delta = (0..back.len())
                    .map(|i| back[i] * trace.first[l - 1][i] + from_slopes[l - 1][i])
                    .collect();
            }
        }
        (total, self.unfolded(&sums))
    }

    /// From the derivatives by the folded W and b to those by θ.
    fn unfolded(&self, sums: &[Dense64]) -> Vec<f64> {
        let mut out = vec![0.0; self.theta.len()];
        for (at, sum) in self.layout.layers.iter().zip(sums) {
            out[at.bias.clone()].copy_from_slice(&sum.bias);
            let Some(gain) = &at.gain else {
                out[at.weight.clone()].copy_from_slice(&sum.weight);
                continue;
            };
            for row in 0..at.rows {
                let span = row * at.columns..(row + 1) * at.columns;
                let v = &self.theta[at.weight.clone()][span.clone()];
                let dw = &sum.weight[span.clone()];
                let norm = v.iter().map(|v| v * v).sum::<f64>().sqrt();
                if norm == 0.0 {
                    continue;
                }
                let along = v.iter().zip(dw).map(|(v, d)| v * d).sum::<f64>() / norm;
                let scale = self.theta[gain.start + row] / norm;
                out[gain.start + row] = along;
                for (k, (v, d)) in v.iter().zip(dw).enumerate() {
                    out[at.weight.start + span.start + k] = scale * (d - along * v / norm);
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::init::{Normal, geometric};

    fn small() -> SdfConfig {
        SdfConfig {
            bands: 2,
            width: 24,
            layers: 4,
            skip: Some(2),
            features: 3,
            // Small β: with 100 the third derivatives would drown the central differences.
            beta: 5.0,
            ..SdfConfig::fast()
        }
    }

    fn network(config: &SdfConfig) -> (Vec<f64>, Vec<[f64; 3]>) {
        let layout = config.layout().expect("a valid shape");
        let mut normal = Normal::seeded(5);
        let theta = geometric(config, &layout, 7)
            .iter()
            .map(|&v| f64::from(v) * 1.1 + 0.1 * normal.next())
            .collect();
        (theta, (0..4).map(|_| std::array::from_fn(|_| 0.6 * normal.next())).collect())
    }

    /// A loss with all the terms: value, eikonal, normal.
    fn loss(index: usize, value: f64, gradient: [f64; 3]) -> PointLoss64 {
        let weight = 1.0 + index as f64;
        let length = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        let normal = [0.6, 0.0, -0.8];
        let mut at = PointLoss64 {
            loss: weight * value * value + (length - 1.0).powi(2),
            d_value: 2.0 * weight * value,
            d_gradient: gradient.map(|g| 2.0 * (length - 1.0) * g / length),
        };
        for axis in 0..3 {
            at.loss += (gradient[axis] - normal[axis]).powi(2);
            at.d_gradient[axis] += 2.0 * (gradient[axis] - normal[axis]);
        }
        at
    }

    #[test]
    fn the_gradient_by_the_point_is_that_of_central_differences() {
        for config in [small(), SdfConfig { weight_norm: false, skip: None, ..small() }] {
            let (theta, points) = network(&config);
            let net = ReferenceSdf::new(&config, theta).expect("a valid network");
            for &x in &points {
                let (_, gradient) = net.sample(x);
                for axis in 0..3 {
                    let h = 1e-5;
                    let [a, b] = [-h, h].map(|step| {
                        let mut at = x;
                        at[axis] += step;
                        net.sample(at).0
                    });
                    assert!(((b - a) / (2.0 * h) - gradient[axis]).abs() < 1e-7);
                }
            }
        }
    }

    #[test]
    fn the_gradient_by_every_parameter_is_that_of_central_differences() {
        for config in [small(), SdfConfig { weight_norm: false, skip: None, ..small() }] {
            let (theta, points) = network(&config);
            let net = ReferenceSdf::new(&config, theta.clone()).expect("a valid network");
            let (_, gradient) = net.loss_gradient(&points, loss);
            let total = |theta: Vec<f64>| {
                let net = ReferenceSdf::new(&config, theta).expect("a valid network");
                (points.iter().enumerate())
                    .map(|(i, &x)| {
                        let (value, gradient) = net.sample(x);
                        loss(i, value, gradient).loss
                    })
                    .sum::<f64>()
            };
            let scale = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
            // Every 7th, so that each layer's weights, biases and gains are met.
            for k in (0..theta.len()).step_by(7) {
                let h = 1e-5;
                let [a, b] = [-h, h].map(|step| {
                    let mut moved = theta.clone();
                    moved[k] += step;
                    total(moved)
                });
                let error = (b - a) / (2.0 * h) - gradient[k];
                assert!(error.abs() < 1e-7 * scale.max(1.0), "parameter {k}: off by {error}");
            }
        }
    }
}
