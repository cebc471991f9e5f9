//! The canonical signed distance field φ as a network with parameters.

use crate::error::NetworkError;
use crate::frozen::FrozenMlp;
use crate::init::geometric;
use crate::kernel::isa::Isa;
use crate::mlp::{Layout, SdfConfig};
use crate::step::{StepMemory, loss_gradient};
use crate::trainable::{PointLoss, Sample32, TrainableField};

/// φ(x; θ): the canonical SDF of Appendix E, with its parameters in f32.
///
/// θ is flat, in the order of [`SdfConfig::layout`].
#[derive(Clone, Debug)]
pub struct SdfNetwork {
    config: SdfConfig,
    layout: Layout,
    theta: Vec<f32>,
    frozen: FrozenMlp,
    memory: StepMemory,
}

impl SdfNetwork {
    /// A field close to the distance from a sphere of `config.radius`; the same for the same seed.
    ///
    /// # Errors
    ///
    /// [`NetworkError`], for a shape that cannot be built.
    pub fn new(config: &SdfConfig, seed: u64) -> Result<Self, NetworkError> {
        let theta = geometric(config, &config.layout()?, seed);
        SdfNetwork::from_parameters(config, theta)
    }

    /// The network of `config` with the parameters `theta`, in the order of [`SdfConfig::layout`].
    ///
    /// # Errors
    ///
    /// [`NetworkError`], for a shape that cannot be built, or a θ of another length or with a
    /// number that is not finite.
    pub fn from_parameters(config: &SdfConfig, theta: Vec<f32>) -> Result<Self, NetworkError> {
        SdfNetwork::with_isa(config, theta, Isa::best())
    }

    /// [`SdfNetwork::from_parameters`] on a given instruction set.
    ///
    /// # Errors
    ///
    /// As [`SdfNetwork::from_parameters`].
    pub(crate) fn with_isa(
        config: &SdfConfig,
        theta: Vec<f32>,
        isa: Isa,
    ) -> Result<Self, NetworkError> {
        let frozen = FrozenMlp::with_isa(config, &theta, isa)?;
        let layout = config.layout()?;
        let memory = StepMemory::default();
        Ok(SdfNetwork { config: config.clone(), layout, theta, frozen, memory })
    }

    /// The shape.
    pub fn config(&self) -> &SdfConfig {
        &self.config
    }

    /// Where θ keeps each layer.
    pub(crate) fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The kernels with the weights of the last [`TrainableField::refresh`].
    pub fn frozen(&self) -> &FrozenMlp {
        &self.frozen
    }
}

impl TrainableField for SdfNetwork {
    fn parameters(&self) -> &[f32] {
        &self.theta
    }

    fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.theta
    }

    fn refresh(&mut self) {
        self.frozen.refresh(&self.layout, &self.theta);
    }

    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        self.frozen.samples(points, out);
    }

    fn loss_gradient(
        &self,
        points: &[[f32; 3]],
        loss: &(dyn Fn(usize, Sample32) -> PointLoss + Sync),
        gradient: &mut [f32],
    ) -> f64 {
        assert_eq!(gradient.len(), self.theta.len(), "one derivative per parameter");
        let (mlp, memory) = (&self.frozen, &self.memory);
        loss_gradient(mlp, memory, &self.layout, &self.theta, points, loss, gradient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::init::Normal;
    use crate::reference::{PointLoss64, ReferenceSdf};

    fn points(count: usize, seed: u64) -> Vec<[f32; 3]> {
        let mut normal = Normal::seeded(seed);
        (0..count).map(|_| std::array::from_fn(|_| 0.5 * normal.next() as f32)).collect()
    }

    /// A network off its initial state, so that no column is zero.
    fn network(config: &SdfConfig, isa: Isa) -> SdfNetwork {
        let start = SdfNetwork::new(config, 3).expect("a valid shape");
        let mut normal = Normal::seeded(9);
        let noise = 0.3 / (config.width as f64).sqrt();
        let theta = start.parameters().iter().map(|v| v + (noise * normal.next()) as f32).collect();
        SdfNetwork::with_isa(config, theta, isa).expect("a valid shape")
    }

    fn twin(network: &SdfNetwork) -> ReferenceSdf {
        let theta = network.parameters().iter().map(|&v| f64::from(v)).collect();
        ReferenceSdf::new(network.config(), theta).expect("the same shape")
    }

    fn shapes() -> Vec<SdfConfig> {
        let small =
            SdfConfig { width: 72, layers: 3, skip: Some(2), features: 5, ..SdfConfig::fast() };
        vec![
            SdfConfig { weight_norm: false, skip: None, features: 0, ..small.clone() },
            SdfConfig { layers: 1, skip: None, bands: 0, width: 7, ..small.clone() },
            SdfConfig { beta: 7.0, width: 300, skip: Some(1), ..small.clone() },
            small,
        ]
    }

    #[test]
    fn value_and_gradient_are_those_of_f64_on_every_instruction_set() {
        for config in shapes() {
            for isa in Isa::all() {
                let network = network(&config, isa);
                let twin = twin(&network);
                for count in [1, 13, 200] {
                    let points = points(count, 5);
                    let mut samples = vec![Sample32::default(); count];
                    let mut values = vec![0.0; count];
                    network.samples32(&points, &mut samples);
                    network.frozen().values(&points, &mut values);
                    for (n, x) in points.iter().enumerate() {
                        let (value, gradient) = twin.sample(x.map(f64::from));
                        assert_eq!(values[n], samples[n].value);
                        assert!((f64::from(values[n]) - value).abs() < 1e-6, "{}", isa.name());
                        for axis in 0..3 {
                            let error = f64::from(samples[n].gradient[axis]) - gradient[axis];
                            assert!(error.abs() < 1e-5, "{}: {error}", isa.name());
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn machines_that_fuse_multiply_and_add_have_the_same_results_to_the_bit() {
        let points = points(40, 2);
        let samples = |isa: Isa| -> Vec<Sample32> {
            let mut samples = vec![Sample32::default(); 40];
            network(&shapes()[2], isa).samples32(&points, &mut samples);
            samples
        };
        let gradients = |isa: Isa| -> Vec<[f32; 3]> {
            samples(isa).iter().map(|sample| sample.gradient).collect()
        };
        let fused: Vec<_> = Isa::all().into_iter().filter(|isa| isa.name() != "portable").collect();
        for pair in fused.windows(2) {
            assert_eq!(samples(pair[0]), samples(pair[1]));
        }
        let fused: Vec<_> = fused.into_iter().map(gradients).collect();
        // One of them alone is at least that of the portable path, which rounds twice: each is
        // within 1e-5 of the twin in f64.
        for (a, b) in fused.iter().flatten().zip(gradients(Isa::portable()).iter().cycle()) {
            (0..3).for_each(|k| assert!((a[k] - b[k]).abs() < 2e-5, "{a:?} {b:?}"));
        }
    }

    #[test]
    fn a_point_that_is_no_number_gives_no_number_and_spoils_no_other() {
        for isa in Isa::all() {
            let network = network(&shapes()[3], isa);
            let mut points = points(30, 2);
            let mut good = vec![Sample32::default(); 30];
            network.samples32(&points, &mut good);
            points[4][1] = f32::NAN;
            points[20][2] = f32::INFINITY;
            let mut samples = good.clone();
            network.samples32(&points, &mut samples);
            for n in 0..30 {
                if n == 4 || n == 20 {
                    assert!(samples[n].value.is_nan(), "{}: {:?}", isa.name(), samples[n]);
                    assert!(samples[n].gradient.iter().any(|g| g.is_nan()));
                } else {
                    assert_eq!(samples[n], good[n]);
                }
            }
            let mut gradient = vec![0.0; network.parameters().len()];
            assert!(network.loss_gradient(&points, &loss, &mut gradient).is_nan());
            points[4][1] = 0.0;
            points[20][2] = 0.0;
            assert!(network.loss_gradient(&points, &loss, &mut gradient).is_finite());
            assert!(gradient.iter().all(|g| g.is_finite()), "scratch memory keeps a NaN");
        }
    }

    #[test]
    fn features_are_those_of_f64() {
        let network = network(&shapes()[3], Isa::best());
        let (points, twin) = (points(30, 1), twin(&network));
        let mut out = vec![0.0; 30 * network.frozen().outputs()];
        network.frozen().evaluate(&points, &mut out);
        for (x, out) in points.iter().zip(out.chunks_exact(6)) {
            for (a, b) in out.iter().zip(twin.outputs(x.map(f64::from))) {
                assert!((f64::from(*a) - b).abs() < 1e-6);
            }
        }
    }

    /// A loss with value, eikonal and normal terms.
    fn loss(index: usize, sample: Sample32) -> PointLoss {
        let g = sample.gradient.map(f64::from);
        let length = g.iter().map(|g| g * g).sum::<f64>().sqrt();
        let weight = 1.0 + (index % 3) as f64;
        let value = f64::from(sample.value);
        let mut at = PointLoss {
            loss: weight * value * value + (length - 1.0).powi(2),
            d_value: (2.0 * weight * value) as f32,
            d_gradient: g.map(|g| (2.0 * (length - 1.0) * g / length) as f32),
        };
        for axis in 0..3 {
            let off = g[axis] - [0.6, 0.0, -0.8][axis];
            at.loss += off * off;
            at.d_gradient[axis] += (2.0 * off) as f32;
        }
        at
    }

    #[test]
    fn the_gradient_by_the_parameters_is_that_of_f64_on_every_instruction_set() {
        for config in shapes() {
            for isa in Isa::all() {
                let network = network(&config, isa);
                let points = points(110, 8);
                let mut gradient = vec![f32::NAN; network.parameters().len()];
                let total = network.loss_gradient(&points, &loss, &mut gradient);
                let points: Vec<_> = points.iter().map(|x| x.map(f64::from)).collect();
                let (exact_total, exact) =
                    twin(&network).loss_gradient(&points, |i, value, gradient| {
                        let gradient = gradient.map(|g| g as f32);
                        let at = loss(i, Sample32 { value: value as f32, gradient });
                        PointLoss64 {
                            loss: at.loss,
                            d_value: f64::from(at.d_value),
                            d_gradient: at.d_gradient.map(f64::from),
                        }
                    });
                assert!((total - exact_total).abs() < 1e-5 * exact_total);
                let scale = exact.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
                for (k, (a, b)) in gradient.iter().zip(&exact).enumerate() {
                    let error = (f64::from(*a) - b).abs();
                    // Curvature β/4 times a rounding of 1e-7 of z, over the sum of 110 points.
                    assert!(error < 2e-5 * scale, "{} parameter {k}: {a} {b}", isa.name());
                }
            }
        }
    }

    #[test]
    fn the_same_bits_come_out_for_any_number_of_threads() {
        let network = network(&shapes()[3], Isa::best());
        let points = points(2000, 4);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("a pool").install(|| {
                let mut samples = vec![Sample32::default(); points.len()];
                network.samples32(&points, &mut samples);
                let mut gradient = vec![0.0; network.parameters().len()];
                let total = network.loss_gradient(&points, &loss, &mut gradient);
                (samples, gradient, total)
            })
        };
        let one = run(1);
        for threads in [2, 5] {
            assert!(run(threads) == one, "{threads} threads differ from one");
        }
    }

    #[test]
    fn a_call_without_points_has_no_loss_and_no_gradient() {
        let network = network(&shapes()[3], Isa::best());
        let mut gradient = vec![f32::NAN; network.parameters().len()];
        assert_eq!(network.loss_gradient(&[], &loss, &mut gradient), 0.0);
        assert!(gradient.iter().all(|g| *g == 0.0));
        network.samples32(&[], &mut []);
    }

    #[test]
    fn the_initial_field_is_near_a_sphere() {
        let config = SdfConfig::fast();
        for seed in 0..3 {
            let network = SdfNetwork::new(&config, seed).expect("a valid shape");
            let points = points(300, seed);
            let mut samples = vec![Sample32::default(); 301];
            network.samples32(&points, &mut samples[..300]);
            let mean = samples[..300]
                .iter()
                .map(|s| s.gradient.iter().map(|g| f64::from(g * g)).sum::<f64>().sqrt())
                .sum::<f64>()
                / 300.0;
            // Measured over four seeds: 0.85 to 1.16, φ(0) −0.24 to −0.33.
            assert!((0.75..1.25).contains(&mean), "mean of |∇φ| {mean}");
            network.samples32(&[[0.0; 3]], &mut samples[..1]);
            assert!((-0.4..-0.15).contains(&samples[0].value), "φ(0) {}", samples[0].value);
            let mut outside = [Sample32::default()];
            network.samples32(&[[1.5, 0.0, 0.0]], &mut outside);
            assert!(outside[0].value > 0.4, "outside {}", outside[0].value);
        }
    }

    #[test]
    fn spoilt_or_cut_parameters_are_refused() {
        let config = &shapes()[1];
        let mut theta = network(config, Isa::best()).parameters().to_vec();
        theta[4] = f32::NAN;
        let error = SdfNetwork::from_parameters(config, theta.clone()).expect_err("a NaN");
        assert!(error.to_string().contains("parameter 4"));
        theta.pop();
        assert!(matches!(
            SdfNetwork::from_parameters(config, theta),
            Err(NetworkError::Length { .. })
        ));
    }
}
