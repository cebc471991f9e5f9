//! The non-rigid deformation d(x, hᵢ) as a network with parameters.

use rayon::prelude::*;

use crate::deformation_tile::{BLOCK, Net, Tile};
use crate::encoding::{annealing_alpha, band_weights};
use crate::frozen::tile_of;
use crate::init::deformation;
use crate::kernel::isa::Isa;
use crate::kernel::packed::PackedLayers;
use crate::kernel::pool::Pool;
use crate::kernel::sums::{Sums, add_up, group_of};
use crate::mlp::{ConfigError, DeformationConfig, Layout, check_parameters};

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
    /// A deformation that moves points by next to nothing, all bands in; the same for the same
    /// seed.
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
    pub fn from_parameters(
        config: &DeformationConfig,
        theta: Vec<f32>,
    ) -> Result<Self, ConfigError> {
        DeformationNetwork::with_isa(config, theta, Isa::best())
    }

    /// [`DeformationNetwork::from_parameters`] on a given instruction set.
    ///
    /// # Errors
    ///
    /// As [`DeformationNetwork::from_parameters`].
    pub fn with_isa(
        config: &DeformationConfig,
        theta: Vec<f32>,
        isa: Isa,
    ) -> Result<Self, ConfigError> {
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
        self.packed.refresh(&self.layout, &self.theta);
    }

    /// Fades the bands in up to `alpha` ([`band_weights`]); infinity (the default) for all.
    pub fn set_alpha(&mut self, alpha: f32) {
        self.alpha = alpha;
        self.band_weights = band_weights(self.config.bands, alpha);
    }

    /// Sets α by the lineage's schedule ([`annealing_alpha`]).
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
mod tests {
    use super::*;
    use crate::init::Normal;
    use crate::reference_deformation::{OffsetLoss64, ReferenceDeformation};

    fn config(frames: usize) -> DeformationConfig {
        DeformationConfig { width: 70, embedding: 9, layers: 3, ..DeformationConfig::fast(frames) }
    }

    fn network(config: &DeformationConfig, isa: Isa) -> DeformationNetwork {
        let start = DeformationNetwork::new(config, 3).expect("a valid shape");
        let mut normal = Normal::seeded(9);
        let theta = start.parameters().iter().map(|v| v + (0.05 * normal.next()) as f32).collect();
        let mut network = DeformationNetwork::with_isa(config, theta, isa).expect("as before");
        network.set_alpha(3.3);
        network
    }

    fn twin(network: &DeformationNetwork) -> ReferenceDeformation {
        let theta = network.parameters().iter().map(|&v| f64::from(v)).collect();
        let weights = band_weights(network.config.bands, network.alpha());
        ReferenceDeformation::new(&network.config, theta, weights).expect("the same shape")
    }

    fn inputs(count: usize, frames: usize) -> (Vec<[f32; 3]>, Vec<u32>) {
        let mut normal = Normal::seeded(7);
        let points =
            (0..count).map(|_| std::array::from_fn(|_| 0.5 * normal.next() as f32)).collect();
        (points, (0..count).map(|n| ((n * 7) % frames) as u32).collect())
    }

    fn loss(index: usize, sample: OffsetSample) -> OffsetLoss {
        let mut at = OffsetLoss::default();
        for i in 0..3 {
            let off = sample.offset[i] - 0.01 * (index % 7 + i) as f32;
            at.loss += f64::from(off * off);
            at.d_offset[i] = 2.0 * off;
            for j in 0..3 {
                at.loss += 0.5 * f64::from(sample.jacobian[i][j] * sample.jacobian[i][j]);
                at.d_jacobian[i][j] = sample.jacobian[i][j];
            }
        }
        at
    }

    #[test]
    fn offset_and_jacobian_are_those_of_f64_on_every_instruction_set() {
        for isa in Isa::all() {
            for config in [config(5), DeformationConfig { embedding: 0, layers: 1, ..config(5) }] {
                let network = network(&config, isa);
                let twin = twin(&network);
                for count in [1, 25, 130] {
                    let (points, frames) = inputs(count, 5);
                    let mut offsets = vec![[0.0; 3]; count];
                    let mut samples = vec![OffsetSample::default(); count];
                    network.offsets(&points, &frames, &mut offsets);
                    network.samples(&points, &frames, &mut samples);
                    for n in 0..count {
                        assert_eq!(offsets[n], samples[n].offset);
                        let x = points[n].map(f64::from);
                        let (d, j) = twin.sample(x, frames[n] as usize);
                        for i in 0..3 {
                            assert!((f64::from(offsets[n][i]) - d[i]).abs() < 2e-6);
                            for k in 0..3 {
                                let error = f64::from(samples[n].jacobian[i][k]) - j[i][k];
                                assert!(error.abs() < 2e-5, "{}: {error}", isa.name());
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn the_gradient_by_the_parameters_is_that_of_f64_on_every_instruction_set() {
        for isa in Isa::all() {
            for config in [config(5), DeformationConfig { embedding: 0, layers: 1, ..config(5) }] {
                let network = network(&config, isa);
                let (points, frames) = inputs(250, 5);
                let mut gradient = vec![f32::NAN; network.parameters().len()];
                let total = network.loss_gradient(&points, &frames, &loss, &mut gradient);
                let points: Vec<_> = points.iter().map(|x| x.map(f64::from)).collect();
                let (exact_total, exact) =
                    twin(&network).loss_gradient(&points, &frames, |i, d, j| {
                        let at = loss(
                            i,
                            OffsetSample {
                                offset: d.map(|v| v as f32),
                                jacobian: j.map(|row| row.map(|v| v as f32)),
                            },
                        );
                        OffsetLoss64 {
                            loss: at.loss,
                            d_offset: at.d_offset.map(f64::from),
                            d_jacobian: at.d_jacobian.map(|row| row.map(f64::from)),
                        }
                    });
                assert!((total - exact_total).abs() < 1e-5 * exact_total);
                let scale = exact.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
                for (k, (a, b)) in gradient.iter().zip(&exact).enumerate() {
                    let error = (f64::from(*a) - b).abs();
                    assert!(error < 1e-5 * scale, "{} parameter {k}: {a} {b}", isa.name());
                }
            }
        }
    }

    #[test]
    fn the_same_bits_come_out_for_any_number_of_threads() {
        let network = network(&config(5), Isa::best());
        let (points, frames) = inputs(1500, 5);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("a pool").install(|| {
                let mut gradient = vec![0.0; network.parameters().len()];
                let total = network.loss_gradient(&points, &frames, &loss, &mut gradient);
                (gradient, total)
            })
        };
        assert!(run(1) == run(3));
    }

    #[test]
    fn a_point_that_is_no_number_gives_no_number_and_spoils_no_other() {
        for isa in Isa::all() {
            let network = network(&config(5), isa);
            let (mut points, frames) = inputs(30, 5);
            let mut good = vec![OffsetSample::default(); 30];
            network.samples(&points, &frames, &mut good);
            let kept = std::mem::replace(&mut points[7], [f32::NAN, 0.0, 0.0]);
            let mut samples = good.clone();
            network.samples(&points, &frames, &mut samples);
            assert!(samples[7].offset.iter().all(|d| d.is_nan()), "{}", isa.name());
            for n in (0..30).filter(|n| *n != 7) {
                assert_eq!(samples[n], good[n]);
            }
            let mut gradient = vec![0.0; network.parameters().len()];
            assert!(network.loss_gradient(&points, &frames, &loss, &mut gradient).is_nan());
            points[7] = kept;
            network.loss_gradient(&points, &frames, &loss, &mut gradient);
            assert!(gradient.iter().all(|g| g.is_finite()), "scratch memory keeps a NaN");
        }
    }

    #[test]
    fn a_call_without_points_has_no_gradient() {
        let network = network(&config(5), Isa::best());
        let mut gradient = vec![f32::NAN; network.parameters().len()];
        assert_eq!(network.loss_gradient(&[], &[], &loss, &mut gradient), 0.0);
        assert!(gradient.iter().all(|g| *g == 0.0));
    }

    #[test]
    fn the_initial_deformation_moves_next_to_nothing() {
        let network = DeformationNetwork::new(&DeformationConfig::fast(30), 1).expect("a preset");
        let (points, frames) = inputs(100, 30);
        let mut offsets = vec![[0.0; 3]; 100];
        network.offsets(&points, &frames, &mut offsets);
        let largest = offsets.as_flattened().iter().fold(0.0_f32, |m, d| m.max(d.abs()));
        assert!(largest > 0.0 && largest < 0.01, "{largest}");
    }

    #[test]
    #[should_panic(expected = "frame 5 of 5")]
    fn a_frame_that_does_not_exist_panics_with_its_number() {
        let network = network(&config(5), Isa::best());
        network.offsets(&[[0.0; 3]], &[5], &mut [[0.0; 3]]);
    }
}
