//! The canonical signed distance field φ as a network with parameters.

use crate::init::geometric;
use crate::mlp::{ConfigError, Layout, SdfConfig, check_parameters};
use crate::reference::{PointLoss64, ReferenceSdf};
use crate::trainable::{PointLoss, Sample32, TrainableField};

/// φ(x; θ): the canonical SDF of Appendix E, with its parameters in f32.
///
/// θ is flat, in the order of [`SdfConfig::layout`].
#[derive(Clone, Debug)]
pub struct SdfNetwork {
    config: SdfConfig,
    layout: Layout,
    theta: Vec<f32>,
    reference: ReferenceSdf,
}

impl SdfNetwork {
    /// A field close to the distance from a sphere of `config.radius`; the same for the same seed.
    ///
    /// # Errors
    ///
    /// [`ConfigError`], for a shape that cannot be built.
    pub fn new(config: &SdfConfig, seed: u64) -> Result<Self, ConfigError> {
        let theta = geometric(config, &config.layout()?, seed);
        SdfNetwork::from_parameters(config, theta)
    }

    /// The network of `config` with the parameters `theta`, laid out as [`SdfConfig::layout`] says.
    ///
    /// # Errors
    ///
    /// [`ConfigError`], for a shape that cannot be built, or a θ of another length or with a
    /// number that is not finite.
    pub fn from_parameters(config: &SdfConfig, theta: Vec<f32>) -> Result<Self, ConfigError> {
        let layout = config.layout()?;
        check_parameters(&theta, layout.parameters)?;
        let reference = reference(config, &theta);
        Ok(SdfNetwork { config: config.clone(), layout, theta, reference })
    }

    /// The shape.
    pub fn config(&self) -> &SdfConfig {
        &self.config
    }

    /// Where θ keeps each layer.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }
}

fn reference(config: &SdfConfig, theta: &[f32]) -> ReferenceSdf {
    ReferenceSdf::new(config, theta.iter().map(|&v| f64::from(v)).collect()).expect("config and length were checked")
}

impl TrainableField for SdfNetwork {
    fn parameters(&self) -> &[f32] {
        &self.theta
    }

    fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.theta
    }

    fn refresh(&mut self) {
        self.reference = reference(&self.config, &self.theta);
    }

    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        assert_eq!(points.len(), out.len(), "one sample per point");
        for (point, out) in points.iter().zip(out) {
            let (value, gradient) = self.reference.sample(point.map(f64::from));
            *out = Sample32 { value: value as f32, gradient: gradient.map(|g| g as f32) };
        }
    }

    fn loss_gradient(
        &self,
        points: &[[f32; 3]],
        loss: &(dyn Fn(usize, Sample32) -> PointLoss + Sync),
        gradient: &mut [f32],
    ) -> f64 {
        assert_eq!(gradient.len(), self.theta.len(), "one derivative per parameter");
        let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
        let (total, by_theta) = self.reference.loss_gradient(&points, |i, value, gradient| {
            let sample = Sample32 { value: value as f32, gradient: gradient.map(|g| g as f32) };
            let at = loss(i, sample);
            PointLoss64 { loss: at.loss, d_value: f64::from(at.d_value), d_gradient: at.d_gradient.map(f64::from) }
        });
        for (out, value) in gradient.iter_mut().zip(&by_theta) {
            *out = *value as f32;
        }
        total
    }
}
