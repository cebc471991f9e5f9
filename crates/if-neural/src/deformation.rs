//! The non-rigid deformation d(x, hᵢ) as a network with parameters.

use crate::encoding::{annealing_alpha, band_weights};
use crate::init::deformation;
use crate::mlp::{ConfigError, DeformationConfig, Layout, check_parameters};
use crate::reference_deformation::{OffsetLoss64, ReferenceDeformation};

/// d and its Jacobian at one point of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OffsetSample {
    /// d, in the unit of the points.
    pub offset: [f32; 3],
    /// ∂dᵢ/∂xⱼ: row i for component i of d.
    pub jacobian: [[f32; 3]; 3],
}

/// The loss of one point and its derivatives by the offset and the Jacobian there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OffsetLoss {
    /// The point's share of the loss, already weighted.
    pub loss: f64,
    /// ∂L/∂d.
    pub d_offset: [f32; 3],
    /// ∂L/∂J, laid out as the Jacobian.
    pub d_jacobian: [[f32; 3]; 3],
}

/// d(x, hᵢ; θ): the offset of the material point x in frame i.
///
/// θ is flat: the layers as [`DeformationConfig::layout`] says, then one embedding hᵢ after the
/// other. ReLU has no second derivative, so a loss on the Jacobian differentiates as one on d.
///
/// # Source
///
/// Supplement, Appendix E and Figure 5 (b); numbers and initialisation from the lineage.
#[derive(Clone, Debug)]
pub struct DeformationNetwork {
    config: DeformationConfig,
    layout: Layout,
    theta: Vec<f32>,
    alpha: f32,
    reference: ReferenceDeformation,
}

impl DeformationNetwork {
    /// A deformation that moves points by next to nothing, all bands in; the same for the same seed.
    ///
    /// # Errors
    ///
    /// [`ConfigError`], for a shape that cannot be built.
    pub fn new(config: &DeformationConfig, seed: u64) -> Result<Self, ConfigError> {
        let theta = deformation(config, &config.layout()?, seed);
        DeformationNetwork::from_parameters(config, theta)
    }

    /// The network of `config` with the parameters `theta`, layers first, then embeddings.
    ///
    /// # Errors
    ///
    /// [`ConfigError`], for a shape that cannot be built, or a θ of another length or with a
    /// number that is not finite.
    pub fn from_parameters(config: &DeformationConfig, theta: Vec<f32>) -> Result<Self, ConfigError> {
        let layout = config.layout()?;
        check_parameters(&theta, layout.parameters + config.frames * config.embedding)?;
        let alpha = f32::INFINITY;
        let reference = reference(config, &theta, alpha);
        Ok(DeformationNetwork { config: config.clone(), layout, theta, alpha, reference })
    }

    /// The shape.
    pub fn config(&self) -> &DeformationConfig {
        &self.config
    }

    /// Where θ keeps each layer.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// θ: layers, then embeddings.
    pub fn parameters(&self) -> &[f32] {
        &self.theta
    }

    /// θ, to be stepped by an optimiser; call [`Self::refresh`] afterwards.
    pub fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.theta
    }

    /// hᵢ of `frame`.
    ///
    /// # Panics
    ///
    /// If there is no such frame.
    pub fn embedding(&self, frame: usize) -> &[f32] {
        assert!(frame < self.config.frames, "frame {frame} of {}", self.config.frames);
        let at = self.layout.parameters + frame * self.config.embedding;
        &self.theta[at..at + self.config.embedding]
    }

    /// Brings what is derived from θ up to date.
    pub fn refresh(&mut self) {
        self.reference = reference(&self.config, &self.theta, self.alpha);
    }

    /// Fades the bands in up to `alpha` ([`band_weights`]); infinity (the default) for all.
    pub fn set_alpha(&mut self, alpha: f32) {
        self.alpha = alpha;
        self.refresh();
    }

    /// Sets α by the lineage's schedule ([`annealing_alpha`]).
    pub fn anneal(&mut self, iteration: usize) {
        self.set_alpha(annealing_alpha(self.config.bands, iteration));
    }

    /// α as set.
    pub fn alpha(&self) -> f32 {
        self.alpha
    }

    /// d and ∂d/∂x at `points`, point k in frame `frames[k]`.
    ///
    /// # Panics
    ///
    /// If the slices differ in length or a frame is out of range.
    pub fn samples(&self, points: &[[f32; 3]], frames: &[u32], out: &mut [OffsetSample]) {
        assert_eq!(points.len(), out.len(), "one sample per point");
        self.check_frames(points, frames);
        for ((point, &frame), out) in points.iter().zip(frames).zip(out) {
            let (d, j) = self.reference.sample(point.map(f64::from), frame as usize);
            *out = OffsetSample { offset: d.map(|v| v as f32), jacobian: j.map(|row| row.map(|v| v as f32)) };
        }
    }

    /// The sum of `loss(i, sample at points[i])`; its derivative by θ, embeddings included,
    /// overwrites `gradient`. `loss` must depend on nothing but its arguments: it is called from
    /// many threads.
    ///
    /// # Panics
    ///
    /// If the slices differ in length, a frame is out of range, or `gradient` is not as long as θ.
    pub fn loss_gradient(
        &self,
        points: &[[f32; 3]],
        frames: &[u32],
        loss: &(dyn Fn(usize, OffsetSample) -> OffsetLoss + Sync),
        gradient: &mut [f32],
    ) -> f64 {
        assert_eq!(gradient.len(), self.theta.len(), "one derivative per parameter");
        self.check_frames(points, frames);
        let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
        let (total, by_theta) = self.reference.loss_gradient(&points, frames, |i, d, j| {
            let sample = OffsetSample { offset: d.map(|v| v as f32), jacobian: j.map(|row| row.map(|v| v as f32)) };
            let at = loss(i, sample);
            OffsetLoss64 {
                loss: at.loss,
                d_offset: at.d_offset.map(f64::from),
                d_jacobian: at.d_jacobian.map(|row| row.map(f64::from)),
            }
        });
        for (out, value) in gradient.iter_mut().zip(&by_theta) {
            *out = *value as f32;
        }
        total
    }

    fn check_frames(&self, points: &[[f32; 3]], frames: &[u32]) {
        assert_eq!(points.len(), frames.len(), "one frame per point");
        for (k, &frame) in frames.iter().enumerate() {
            assert!((frame as usize) < self.config.frames, "point {k} is in frame {frame} of {}", self.config.frames);
        }
    }
}

fn reference(config: &DeformationConfig, theta: &[f32], alpha: f32) -> ReferenceDeformation {
    let theta = theta.iter().map(|&v| f64::from(v)).collect();
    ReferenceDeformation::new(config, theta, band_weights(config.bands, alpha)).expect("config and length were checked")
}
