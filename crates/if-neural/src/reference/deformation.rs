//! d in f64 and plain loops: the slow twin of the deformation's kernels.

use crate::error::NetworkError;
use crate::mlp::{DeformationConfig, Layout};

/// The loss of one point in f64: what [`crate::deformation::OffsetLoss`] is in f32.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OffsetLoss64 {
    /// The point's share of the loss.
    pub loss: f64,
    /// ∂L/∂d.
    pub d_offset: [f64; 3],
    /// ∂L/∂J, row i for component i of d.
    pub d_jacobian: [[f64; 3]; 3],
}

/// d(x, h) in f64, point by point.
#[derive(Clone, Debug)]
pub struct ReferenceDeformation {
    config: DeformationConfig,
    layout: Layout,
    theta: Vec<f64>,
    band_weights: Vec<f32>,
}

/// The inputs of each layer: the value and its derivatives by x, y and z.
type Rows = Vec<[Vec<f64>; 4]>;

impl ReferenceDeformation {
    /// The network of `config` with θ (layers, then embeddings) and the weights of the bands.
    ///
    /// # Errors
    ///
    /// [`NetworkError`], for a shape that cannot be built or a θ of another length.
    pub fn new(
        config: &DeformationConfig,
        theta: Vec<f64>,
        band_weights: Vec<f32>,
    ) -> Result<Self, NetworkError> {
        let layout = config.layout()?;
        let expected = layout.parameters + config.frames * config.embedding;
        if theta.len() != expected {
            return Err(NetworkError::Length { expected, got: theta.len() });
        }
        Ok(ReferenceDeformation { config: config.clone(), layout, theta, band_weights })
    }

    /// d and its Jacobian ∂dᵢ/∂xⱼ (row i) at `x` in `frame`.
    pub fn sample(&self, x: [f64; 3], frame: usize) -> ([f64; 3], [[f64; 3]; 3]) {
        let (_, out) = self.trace(x, frame);
        let offset = std::array::from_fn(|i| out[0][i]);
        (offset, std::array::from_fn(|i| std::array::from_fn(|j| out[1 + j][i])))
    }

    fn trace(&self, x: [f64; 3], frame: usize) -> (Rows, [Vec<f64>; 4]) {
        let encoding = self.config.encoding();
        let width = encoding.width();
        let mut value = vec![0.0; width];
        let mut slopes = value.clone();
        encoding.encode64(x, &self.band_weights, &mut value, &mut slopes);
        let at = self.layout.parameters + frame * self.config.embedding;
        value.extend_from_slice(&self.theta[at..at + self.config.embedding]);
        let mut input: [Vec<f64>; 4] = std::array::from_fn(|_| vec![0.0; value.len()]);
        for o in 0..width {
            input[1 + o % 3][o] = slopes[o];
        }
        input[0] = value;
        let mut rows = Vec::new();
        for (l, at) in self.layout.layers.iter().enumerate() {
            let weight = &self.theta[at.weight.clone()];
            let mut out: [Vec<f64>; 4] = std::array::from_fn(|r| {
                weight
                    .chunks_exact(at.columns)
                    .map(|row| row.iter().zip(&input[r]).map(|(w, a)| w * a).sum())
                    .collect()
            });
            out[0].iter_mut().zip(&self.theta[at.bias.clone()]).for_each(|(z, b)| *z += b);
            if l < self.config.layers {
                for i in 0..at.rows {
                    if out[0][i] <= 0.0 {
                        out.iter_mut().for_each(|row| row[i] = 0.0);
                    }
                }
            }
            rows.push(std::mem::replace(&mut input, out));
        }
        (rows, input)
    }

    /// The sum of `loss(i, d, J)` and its derivative by θ, embeddings included.
    pub fn loss_gradient(
        &self,
        points: &[[f64; 3]],
        frames: &[u32],
        loss: impl Fn(usize, [f64; 3], [[f64; 3]; 3]) -> OffsetLoss64,
    ) -> (f64, Vec<f64>) {
        let mut total = 0.0;
        let mut gradient = vec![0.0; self.theta.len()];
        let width = self.config.encoding().width();
        for (index, (&x, &frame)) in points.iter().zip(frames).enumerate() {
            let (rows, out) = self.trace(x, frame as usize);
            let offset = std::array::from_fn(|i| out[0][i]);
            let jacobian = std::array::from_fn(|i| std::array::from_fn(|j| out[1 + j][i]));
            let at_point = loss(index, offset, jacobian);
            total += at_point.loss;
            let mut delta: [Vec<f64>; 4] = std::array::from_fn(|r| match r {
                0 => at_point.d_offset.to_vec(),
                j => (0..3).map(|i| at_point.d_jacobian[i][j - 1]).collect(),
            });
            for (l, at) in self.layout.layers.iter().enumerate().rev() {
                let mut back: [Vec<f64>; 4] = std::array::from_fn(|_| vec![0.0; at.columns]);
                for r in 0..4 {
                    for i in 0..at.rows {
                        let d = delta[r][i];
                        let span = at.weight.start + i * at.columns;
                        for k in 0..at.columns {
                            gradient[span + k] += d * rows[l][r][k];
                            back[r][k] += d * self.theta[span + k];
                        }
                    }
                }
                for i in 0..at.rows {
                    gradient[at.bias.start + i] += delta[0][i];
                }
                if l > 0 {
                    // A hidden output is 0 exactly where its ReLU is closed.
                    for k in 0..at.columns {
                        if rows[l][0][k] <= 0.0 {
                            back.iter_mut().for_each(|row| row[k] = 0.0);
                        }
                    }
                } else {
                    let start = self.layout.parameters + frame as usize * self.config.embedding;
                    for (k, d) in back[0][width..].iter().enumerate() {
                        gradient[start + k] += d;
                    }
                }
                delta = back;
            }
        }
        (total, gradient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoding::band_weights;
    use crate::init::{Normal, deformation};

    fn small() -> (DeformationConfig, Vec<f64>) {
        let config = DeformationConfig { bands: 2, embedding: 4, frames: 5, width: 20, layers: 2 };
        let layout = config.layout().expect("a valid shape");
        let mut normal = Normal::seeded(2);
        let theta = deformation(&config, &layout, 4)
            .iter()
            .map(|&v| f64::from(v) + 0.1 * normal.next())
            .collect();
        (config, theta)
    }

    const POINTS: [[f64; 3]; 3] = [[0.1, 0.2, -0.3], [0.5, -0.6, 0.2], [-0.4, 0.3, 0.9]];
    const FRAMES: [u32; 3] = [0, 4, 4];

    fn loss(index: usize, d: [f64; 3], j: [[f64; 3]; 3]) -> OffsetLoss64 {
        let mut at = OffsetLoss64::default();
        for i in 0..3 {
            let target = 0.1 * (index + i) as f64;
            at.loss += (d[i] - target).powi(2);
            at.d_offset[i] = 2.0 * (d[i] - target);
            for k in 0..3 {
                at.loss += 0.5 * j[i][k].powi(2);
                at.d_jacobian[i][k] = j[i][k];
            }
        }
        at
    }

    #[test]
    fn the_jacobian_is_that_of_central_differences() {
        let (config, theta) = small();
        let net = ReferenceDeformation::new(&config, theta, band_weights(2, 1.3))
            .expect("a valid network");
        for (x, frame) in POINTS.iter().zip(FRAMES) {
            let (_, jacobian) = net.sample(*x, frame as usize);
            for j in 0..3 {
                let h = 1e-6;
                let [a, b] = [-h, h].map(|step| {
                    let mut at = *x;
                    at[j] += step;
                    net.sample(at, frame as usize).0
                });
                for i in 0..3 {
                    assert!(((b[i] - a[i]) / (2.0 * h) - jacobian[i][j]).abs() < 1e-8);
                }
            }
        }
    }

    #[test]
    fn the_gradient_by_every_parameter_is_that_of_central_differences() {
        let (config, theta) = small();
        let total = |theta: Vec<f64>| {
            let net = ReferenceDeformation::new(&config, theta, band_weights(2, 1.3))
                .expect("a valid network");
            net.loss_gradient(&POINTS, &FRAMES, loss)
        };
        let (_, gradient) = total(theta.clone());
        assert!(gradient[theta.len() - 8..].iter().any(|g| *g != 0.0), "frame 4 is met");
        for k in 0..theta.len() {
            let h = 1e-6;
            let [a, b] = [-h, h].map(|step| {
                let mut moved = theta.clone();
                moved[k] += step;
                total(moved).0
            });
            assert!(((b - a) / (2.0 * h) - gradient[k]).abs() < 1e-7, "parameter {k}");
        }
    }
}
