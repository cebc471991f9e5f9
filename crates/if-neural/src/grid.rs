//! A second encoding: features on grids of several resolutions, with a small network on top.

mod config;
mod head;
mod level;
mod passes;
mod seed;

pub use config::GridConfig;

use crate::error::NetworkError;
use crate::trainable::{PointLoss, Sample32, TrainableField};
use head::Head;
use if_core::parameter::ParameterError;
use level::Level;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// φ over the cube [−1, 1]³ from features on nested grids.
///
/// ```text
/// f_l(x) = Σ B²(x / h_l − n) c_l,n         over the 27 nodes n around x of each level l
/// φ = Σ_l h_l f_l,0  +  v · σ(W f + b) + c,   σ(z) = (z + √(z² + s)) / 2
/// ```
///
/// B² is the uniform quadratic B-spline, so that φ has a continuous gradient: with trilinear
/// features ∇φ jumps at every face of a cell, and the eikonal and normal terms of a fit, which are
/// losses on ∇φ, could not be met. (Smoothed trilinear weights are continuous too, but make ∇φ
/// vanish at the nodes.) σ is a softplus without transcendental functions, so that the same bits
/// come out wherever products are fused.
///
/// Parameters: the tables level by level, entry by entry, feature by feature; then W, b, v and c.
///
/// # Source
///
/// Müller et al. 2022, *Instant neural graphics primitives*: grids of several resolutions with
/// hashing. Splines, hashing of rows instead of nodes (three nodes of a row are neighbours in
/// memory), and the linear path are ours.
#[derive(Clone, Debug)]
pub struct GridField {
    config: GridConfig,
    levels: Vec<Level>,
    head: Head,
    params: Vec<f32>,
}

impl GridField {
    /// A grid that holds the sphere of radius 0.5.
    ///
    /// # Errors
    ///
    /// A size is out of range.
    pub fn new(config: GridConfig) -> Result<Self, NetworkError> {
        config.validate()?;
        let (levels, head) = config.layout();
        let tables = levels.last().map_or(0, |l| l.offset + l.entries * config.features as usize);
        let mut params = vec![0.0; tables + head.len()];
        let mut random = Pcg64Mcg::seed_from_u64(config.seed);
        let features = config.features as usize;
        // The first feature is the field itself; the others only have to differ.
        for (k, c) in params[..tables].iter_mut().enumerate() {
            if k % features > 0 {
                *c = random.random_range(-0.01..0.01);
            }
        }
        let inputs = head.linear.len();
        let reach = (1.0 / inputs as f32).sqrt();
        let (weights, rest) = params[tables..].split_at_mut(head.hidden * inputs);
        weights.iter_mut().for_each(|w| *w = random.random_range(-reach..reach));
        // v stays 0: the network begins as the linear path.
        rest[..head.hidden].iter_mut().for_each(|b| *b = random.random_range(-0.5..0.5));
        let mut grid = Self { config, levels, head, params };
        grid.seed(1, |points, out| {
            for (p, o) in points.iter().zip(out) {
                *o = p.iter().map(|x| x * x).sum::<f32>().sqrt() - 0.5;
            }
        });
        Ok(grid)
    }

    /// A grid of given parameters, as [`TrainableField::parameters`] has them.
    ///
    /// # Errors
    ///
    /// A configuration out of range, or another number of parameters.
    pub fn with_parameters(config: GridConfig, params: Vec<f32>) -> Result<Self, NetworkError> {
        config.validate()?;
        let (levels, head) = config.layout();
        let expected = levels.last().map_or(0, |l| l.offset + l.entries * config.features as usize)
            + head.len();
        if params.len() != expected {
            return Err(NetworkError::Length { got: params.len(), expected });
        }
        if let Some(index) = params.iter().position(|p| !p.is_finite()) {
            return Err(NetworkError::NotFinite { index, value: params[index] });
        }
        Ok(Self { config, levels, head, params })
    }

    /// The sizes.
    pub fn config(&self) -> &GridConfig {
        &self.config
    }

    /// Names and shapes of the parts of the parameters, in their order.
    pub(crate) fn parts(&self) -> Vec<(String, Vec<usize>)> {
        parts(&self.config, &self.levels, &self.head)
    }

    /// The same for the grid of a configuration.
    ///
    /// # Errors
    ///
    /// A size is out of range.
    pub(crate) fn parts_of(
        config: &GridConfig,
    ) -> Result<Vec<(String, Vec<usize>)>, ParameterError> {
        config.validate()?;
        let (levels, head) = config.layout();
        Ok(parts(config, &levels, &head))
    }

    fn tables(&self) -> usize {
        self.params.len() - self.head.len()
    }
}

fn parts(config: &GridConfig, levels: &[Level], head: &Head) -> Vec<(String, Vec<usize>)> {
    let (f, d, h) = (config.features as usize, head.linear.len(), head.hidden);
    let tables =
        levels.iter().enumerate().map(|(l, level)| (format!("grid.{l}"), vec![level.entries, f]));
    let head = [
        ("hidden.weight", vec![h, d]),
        ("hidden.bias", vec![h]),
        ("out.weight", vec![1, h]),
        ("out.bias", vec![1]),
    ];
    tables.chain(head.map(|(name, shape)| (name.to_owned(), shape))).collect()
}

impl TrainableField for GridField {
    fn parameters(&self) -> &[f32] {
        &self.params
    }

    fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.params
    }

    fn refresh(&mut self) {}

    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        match self.config.features {
            1 => self.samples_of::<1>(points, out),
            2 => self.samples_of::<2>(points, out),
            _ => self.samples_of::<4>(points, out),
        }
    }

    fn loss_gradient(
        &self,
        points: &[[f32; 3]],
        loss: &(dyn Fn(usize, Sample32) -> PointLoss + Sync),
        gradient: &mut [f32],
    ) -> f64 {
        assert_eq!(gradient.len(), self.params.len(), "one derivative for each parameter");
        match self.config.features {
            1 => self.loss_gradient_of::<1>(points, loss, gradient),
            2 => self.loss_gradient_of::<2>(points, loss, gradient),
            _ => self.loss_gradient_of::<4>(points, loss, gradient),
        }
    }
}

#[cfg(test)]
mod tests;
