//! The non-rigid deformation d(x, hᵢ) as a network with parameters.

mod tile;

use rayon::prelude::*;

use crate::encoding::{annealing_alpha, band_weights};
use crate::error::NetworkError;
use crate::frozen::tile_of;
use crate::init::deformation;
use crate::kernel::isa::Isa;
use crate::kernel::packed::PackedLayers;
use crate::kernel::pool::Pool;
use crate::kernel::sums::{Sums, add_up, group_of};
use crate::mlp::{DeformationConfig, Layout, check_parameters};
use tile::{BLOCK, Net, Tile};

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
/// θ is flat: the layers in the order of [`DeformationConfig::layout`], then one embedding hᵢ after the
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
    band_weights: Vec<f32>,
    packed: PackedLayers,
    tiles: Pool<Tile>,
    memory: Pool<StepMemory>,
}

/// Memory of a training step: the groups' sums, and each point's derivative by its embedding.
#[derive(Debug, Default)]
struct StepMemory {
    sums: Vec<Sums>,
    embeddings: Vec<f32>,
}

impl DeformationNetwork {
    /// A deformation that hardly moves points, with all bands; the same for the same seed.
    ///
    /// # Errors
    ///
    /// [`NetworkError`], for a shape that cannot be built.
    pub fn new(config: &DeformationConfig, seed: u64) -> Result<Self, NetworkError> {
        let theta = deformation(config, &config.layout()?, seed);
        DeformationNetwork::from_parameters(config, theta)
    }

    /// The network of `config` with the parameters `theta`, layers first, then embeddings.
    ///
    /// # Errors
    ///
    /// [`NetworkError`], for a shape that cannot be built, or a θ of another length or with a
    /// number that is not finite.
    pub fn from_parameters(
        config: &DeformationConfig,
        theta: Vec<f32>,
    ) -> Result<Self, NetworkError> {
        DeformationNetwork::with_isa(config, theta, Isa::best())
    }

    /// [`DeformationNetwork::from_parameters`] on a given instruction set.
    ///
    /// # Errors
    ///
    /// As [`DeformationNetwork::from_parameters`].
    pub(crate) fn with_isa(
        config: &DeformationConfig,
        theta: Vec<f32>,
        isa: Isa,
    ) -> Result<Self, NetworkError> {
        let layout = config.layout()?;
        check_parameters(&theta, layout.parameters + config.frames * config.embedding)?;
        let mut network = DeformationNetwork {
            config: config.clone(),
            alpha: f32::INFINITY,
            band_weights: band_weights(config.bands, f32::INFINITY),
            packed: PackedLayers::new(isa, &layout, None),
            tiles: Pool::default(),
            memory: Pool::default(),
            layout,
            theta,
        };
        network.refresh();
        Ok(network)
    }

    /// The shape.
    pub fn config(&self) -> &DeformationConfig {
        &self.config
    }

    /// Where θ keeps each layer.
    pub(crate) fn layout(&self) -> &Layout {
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

    /// Brings what is derived from θ up to date.
    pub fn refresh(&mut self) {
        self.packed.refresh(&self.layout, &self.theta);
    }

    /// Fades the bands in up to `alpha`: band k has the weight `(1 − cos(π·clamp(α − k, 0, 1)))/2`.
    /// Infinity (the default) is all bands.
    pub fn set_alpha(&mut self, alpha: f32) {
        self.alpha = alpha;
        self.band_weights = band_weights(self.config.bands, alpha);
    }

    /// Sets α by the lineage's schedule, `bands·(iteration/2500 + 0.5)`.
    pub fn anneal(&mut self, iteration: usize) {
        self.set_alpha(annealing_alpha(self.config.bands, iteration));
    }

    /// α as set.
    pub fn alpha(&self) -> f32 {
        self.alpha
    }

    /// d at `points`, point k in frame `frames[k]`.
    ///
    /// # Panics
    ///
    /// If the slices differ in length or a frame is out of range.
    pub fn offsets(&self, points: &[[f32; 3]], frames: &[u32], out: &mut [[f32; 3]]) {
        assert_eq!(points.len(), out.len(), "one offset per point");
        self.check_frames(points, frames);
        let (net, tile) = (self.net(), tile_of(points.len()));
        let inputs = points.par_chunks(tile).zip(frames.par_chunks(tile));
        inputs.zip(out.par_chunks_mut(tile)).for_each(|((points, frames), out)| {
            self.with_tile(|tile| tile.offsets(&net, points, frames, out));
        });
    }

    /// d and ∂d/∂x at `points`, point k in frame `frames[k]`.
    ///
    /// # Panics
    ///
    /// If the slices differ in length or a frame is out of range.
    pub fn samples(&self, points: &[[f32; 3]], frames: &[u32], out: &mut [OffsetSample]) {
        assert_eq!(points.len(), out.len(), "one sample per point");
        self.check_frames(points, frames);
        let net = self.net();
        let inputs = points.par_chunks(BLOCK).zip(frames.par_chunks(BLOCK));
        inputs.zip(out.par_chunks_mut(BLOCK)).for_each(|((points, frames), out)| {
            self.with_tile(|tile| tile.samples(&net, points, frames, out));
        });
    }

    /// The sum of `loss(i, sample at points[i])`; its derivative by θ, embeddings included,
    /// overwrites `gradient`. `loss` must depend on nothing but its arguments: it is called from
    /// many threads. The same bits come out for any number of threads.
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
        let (net, width) = (self.net(), self.config.embedding);
        let group = group_of(points.len(), BLOCK);
        let count = points.len().div_ceil(group).max(1);
        self.memory.with(StepMemory::default, |memory| {
            let StepMemory { sums, embeddings } = memory;
            sums.resize_with(count.max(sums.len()), || Sums::new(&self.packed, 3));
            let sums = &mut sums[..count];
            // One float at least, so that every group has its rows even without embeddings.
            let chunk = (group * width).max(1);
            embeddings.resize(count * chunk, 0.0);
            let rows = embeddings.par_chunks_mut(chunk);
            sums.par_iter_mut().for_each(Sums::clear);
            sums.par_iter_mut().zip(rows).enumerate().for_each(|(g, (sums, rows))| {
                let first = g * group;
                let last = (first + group).min(points.len());
                self.with_tile(|tile| {
                    for start in (first..last).step_by(BLOCK) {
                        let range = start..(start + BLOCK).min(last);
                        let rows = &mut rows[(start - first) * width..(range.end - first) * width];
                        let at = |n, sample| loss(start + n, sample);
                        tile.add(&net, &points[range.clone()], &frames[range], at, sums, rows);
                    }
                });
            });
            add_up(sums);
            let (layers, by_embeddings) = gradient.split_at_mut(self.layout.parameters);
            by_embeddings.fill(0.0);
            if width > 0 {
                for (row, &frame) in embeddings.chunks_exact(width).zip(frames) {
                    let out = &mut by_embeddings[frame as usize * width..][..width];
                    out.iter_mut().zip(row).for_each(|(sum, d)| *sum += d);
                }
            }
            sums[0].unfold(&self.packed, &self.layout, &self.theta, layers)
        })
    }

    fn net(&self) -> Net<'_> {
        Net {
            packed: &self.packed,
            encoding: self.config.encoding(),
            band_weights: &self.band_weights,
            embeddings: &self.theta[self.layout.parameters..],
            embedding: self.config.embedding,
        }
    }

    fn with_tile(&self, work: impl FnOnce(&mut Tile)) {
        self.tiles.with(|| Tile::new(&self.layout, self.config.encoding()), work);
    }

    fn check_frames(&self, points: &[[f32; 3]], frames: &[u32]) {
        assert_eq!(points.len(), frames.len(), "one frame per point");
        for (k, &frame) in frames.iter().enumerate() {
            assert!(
                (frame as usize) < self.config.frames,
                "point {k} is in frame {frame} of {}",
                self.config.frames
            );
        }
    }
}

#[cfg(test)]
mod tests;
