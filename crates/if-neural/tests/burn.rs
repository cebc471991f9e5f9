//! φ and d in burn: modules, fits and the fused kernels as an operation, compared with the kernels.
//!
//! `cargo test -p if-neural --features burn --test burn`

#[path = "../examples/train_with_burn.rs"]
#[allow(dead_code)] // its `main`
mod train_with_burn;

use burn::tensor::backend::Backend;
use burn::tensor::{Int, Tensor, TensorData};
use burn_autodiff::Autodiff;
use burn_ndarray::NdArray;
use burn_optim::{AdamConfig, GradientsParams, Optimizer};
use if_core::shapes::Sphere;
use if_core::{Cancelled, Monitor, Point, Progress, Silent, Vector};
use if_neural::burn::{self as twin, DeformationModule, FusedSdf, SdfModule};
use if_neural::deformation::{OffsetLoss, OffsetSample};
use if_neural::mlp::{DeformationConfig, SdfConfig};
use if_neural::sdf::SdfNetwork;
use if_neural::trainable::{Sample32, TrainableField};
use if_neural::{
    DeformParams, DeformationNetwork, Ended, Fit, FitError, FitParams, Frame, NetworkConfig,
    NetworkError, SamplingParams, TrainingSet, fit_deformation,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Random numbers of mean 0 and deviation 1.
fn random(seed: u64) -> impl FnMut() -> f32 {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    move || random.random_range(-1.0..1.0_f32) * 3.0_f32.sqrt()
}

/// The numbers of a tensor, as f32.
fn floats<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f32> {
    tensor.into_data().convert::<f32>().into_vec().expect("just converted to f32")
}

type Plain = Autodiff<NdArray>;

fn configs() -> [SdfConfig; 2] {
    let base = SdfConfig { width: 64, layers: 4, skip: Some(2), features: 3, ..SdfConfig::fast() };
    [base.clone(), SdfConfig { weight_norm: false, skip: None, beta: 20.0, ..base }]
}

fn network(config: &SdfConfig) -> SdfNetwork {
    let mut network = SdfNetwork::new(config, 3).expect("a valid shape");
    let mut next = random(1);
    network.parameters_mut().iter_mut().for_each(|v| *v += 0.03 * next());
    network.refresh();
    network
}

fn points(count: usize) -> Vec<[f32; 3]> {
    let mut next = random(2);
    (0..count).map(|_| std::array::from_fn(|_| 0.5 * next())).collect()
}

fn tensor(points: &[[f32; 3]]) -> Tensor<Plain, 2> {
    let data = TensorData::new(points.as_flattened().to_vec(), [points.len(), 3]);
    Tensor::from_data(data, &Default::default())
}

/// Value and eikonal terms.
fn loss(value: Tensor<Plain, 2>, gradient: Tensor<Plain, 2>) -> Tensor<Plain, 1> {
    let length = gradient.powi_scalar(2).sum_dim(1).sqrt();
    value.powi_scalar(2).sum() + length.sub_scalar(1.0).powi_scalar(2).sum()
}

fn fused_loss(fused: &FusedSdf, module: &SdfModule<Plain>, at: &[[f32; 3]]) -> Tensor<Plain, 1> {
    let out = fused.samples(module.theta(), at).expect("finite parameters");
    loss(out.clone().narrow(1, 0, 1), out.narrow(1, 1, 3))
}

/// All derivatives in the order of θ.
fn by_parameters(module: &SdfModule<Plain>, loss: Tensor<Plain, 1>) -> Vec<f32> {
    let gradients = loss.backward();
    let mut all = Vec::new();
    for l in 0..module.weights.len() {
        let weight = module.weights[l].val().grad(&gradients).expect("tracked");
        all.extend(floats(weight));
        all.extend(floats(module.biases[l].val().grad(&gradients).expect("tracked")));
        if let Some(gain) = module.gains.get(l) {
            all.extend(floats(gain.val().grad(&gradients).expect("tracked")));
        }
    }
    all
}

#[test]
fn the_plain_graph_has_the_values_and_gradients_of_the_kernels() {
    for config in configs() {
        let network = network(&config);
        let module = SdfModule::<NdArray>::from_network(&network, &Default::default());
        let points = points(50);
        let data = TensorData::new(points.as_flattened().to_vec(), [50, 3]);
        let (value, gradient) = module.samples(Tensor::from_data(data, &Default::default()));
        let (value, gradient) = (floats(value), floats(gradient));
        let mut samples = vec![Sample32::default(); 50];
        network.samples32(&points, &mut samples);
        for (n, sample) in samples.iter().enumerate() {
            // Both are f32, and each is off from f64 by a few 1e-7 and 1e-6.
            assert!((sample.value - value[n]).abs() < 2e-6);
            for axis in 0..3 {
                assert!((sample.gradient[axis] - gradient[3 * n + axis]).abs() < 2e-5);
            }
        }
    }
}

#[test]
fn the_hand_written_backward_pass_has_the_gradients_of_the_plain_graph() {
    for config in configs() {
        let network = network(&config);
        let module = SdfModule::<Plain>::from_network(&network, &Default::default());
        let points = points(120);
        let (value, gradient) = module.samples(tensor(&points));
        let plain = by_parameters(&module, loss(value, gradient));
        let fused = FusedSdf::new(&config);
        let ours = by_parameters(&module, fused_loss(&fused, &module, &points));
        assert_eq!(plain.len(), network.parameters().len());
        let scale = plain.iter().fold(0.0_f32, |m, g| m.max(g.abs()));
        assert!(scale > 0.1, "the loss moves nothing");
        for (k, (a, b)) in ours.iter().zip(&plain).enumerate() {
            // Two f32 computations with β·1e-7 of rounding in each slope, over 120 points.
            assert!((a - b).abs() < 5e-5 * scale, "parameter {k}: {a} {b}");
        }
    }
}

#[test]
fn conversion_there_and_back_keeps_every_bit() {
    let network = network(&configs()[0]);
    let module = SdfModule::<NdArray>::from_network(&network, &Default::default());
    let back = module.to_network().expect("finite parameters");
    assert_eq!(back.parameters(), network.parameters());
    assert_eq!(back.config(), network.config());
}

#[test]
fn burns_adam_lowers_the_loss_through_the_fused_operation_as_through_the_graph() {
    let config = &configs()[0];
    let network = network(config);
    let points = points(60);
    let train = |fused: Option<FusedSdf>| -> Vec<f32> {
        let mut module = SdfModule::<Plain>::from_network(&network, &Default::default());
        let mut adam = AdamConfig::new().init();
        let mut losses = Vec::new();
        for _ in 0..6 {
            let loss = match &fused {
                Some(fused) => fused_loss(fused, &module, &points),
                None => {
                    let (value, gradient) = module.samples(tensor(&points));
                    loss(value, gradient)
                }
            };
            losses.push(floats(loss.clone().inner())[0]);
            let gradients = GradientsParams::from_grads(loss.backward(), &module);
            module = adam.step(1e-3, module, gradients);
        }
        losses
    };
    let (ours, plain) = (train(Some(FusedSdf::new(config))), train(None));
    assert!(ours[5] < 0.9 * ours[0], "{ours:?}");
    for (a, b) in ours.iter().zip(&plain) {
        assert!((a - b).abs() < 1e-3 * b, "{ours:?} {plain:?}");
    }
}

#[test]
fn parameters_that_are_not_finite_are_rejected() {
    let config = &configs()[1];
    let fused = FusedSdf::new(config);
    let count = config.layout().expect("a valid shape").parameters;
    let theta = |value: f32, count: usize| {
        Tensor::<Plain, 1>::from_data(
            TensorData::new(vec![value; count], [count]),
            &Default::default(),
        )
    };
    let error = fused.samples(theta(f32::NAN, count), &[[0.0; 3]]).expect_err("no number");
    assert!(matches!(error, NetworkError::NotFinite { index: 0, .. }));
    let error = fused.samples(theta(0.1, 7), &[[0.0; 3]]).expect_err("too short");
    assert!(matches!(error, NetworkError::Length { got: 7, .. }));
}

fn deformation(frames: usize, embedding: usize) -> DeformationNetwork {
    let config =
        DeformationConfig { width: 40, embedding, layers: 3, ..DeformationConfig::fast(frames) };
    let mut network = DeformationNetwork::new(&config, 3).expect("a valid shape");
    let mut next = random(4);
    network.parameters_mut().iter_mut().for_each(|v| *v += 0.03 * next());
    network.refresh();
    network.set_alpha(3.3);
    network
}

/// A frame for each point, in no order.
fn frames_of(count: usize, frames: usize) -> Vec<u32> {
    (0..count).map(|n| ((n * 7) % frames) as u32).collect()
}

fn indices<B: Backend>(frames: &[u32]) -> Tensor<B, 1, Int> {
    let frames: Vec<i64> = frames.iter().map(|&f| i64::from(f)).collect();
    let len = frames.len();
    Tensor::from_data(TensorData::new(frames, [len]), &Default::default())
}

#[test]
fn the_deformation_module_has_the_offsets_and_jacobians_of_the_kernels() {
    for embedding in [9, 0] {
        let network = deformation(5, embedding);
        let module = DeformationModule::<Plain>::from_network(&network, &Default::default());
        let (points, frames) = (points(50), frames_of(50, 5));
        let (offset, jacobian) = module.samples(tensor(&points), indices(&frames));
        let (offset, jacobian) = (floats(offset), floats(jacobian));
        let mut samples = vec![OffsetSample::default(); 50];
        network.samples(&points, &frames, &mut samples);
        for (n, sample) in samples.iter().enumerate() {
            // Both are f32, and each is off from f64 by a few 1e-7 and 1e-6.
            for i in 0..3 {
                assert!((sample.offset[i] - offset[3 * n + i]).abs() < 2e-6);
                for j in 0..3 {
                    assert!((sample.jacobian[i][j] - jacobian[9 * n + 3 * i + j]).abs() < 2e-5);
                }
            }
        }
    }
}

#[test]
fn derivatives_by_all_parameters_of_d_are_those_of_the_kernels() {
    let network = deformation(5, 9);
    let module = DeformationModule::<Plain>::from_network(&network, &Default::default());
    let (points, frames) = (points(120), frames_of(120, 4));
    // |d − 0.1|² + |J|² / 2
    let (offset, jacobian) = module.samples(tensor(&points), indices(&frames));
    let loss =
        offset.sub_scalar(0.1).powi_scalar(2).sum() + jacobian.powi_scalar(2).sum().mul_scalar(0.5);
    let gradients = loss.backward();
    let mut plain = Vec::new();
    for (weight, bias) in module.weights.iter().zip(&module.biases) {
        plain.extend(floats(weight.val().grad(&gradients).expect("tracked")));
        plain.extend(floats(bias.val().grad(&gradients).expect("tracked")));
    }
    let embeddings = module.embeddings.as_ref().expect("of length 9");
    plain.extend(floats(embeddings.val().grad(&gradients).expect("tracked")));
    let mut ours = vec![0.0; network.parameters().len()];
    let at_point = |_: usize, s: OffsetSample| OffsetLoss {
        loss: 0.0,
        d_offset: s.offset.map(|d| 2.0 * (d - 0.1)),
        d_jacobian: s.jacobian,
    };
    network.loss_gradient(&points, &frames, &at_point, &mut ours);
    assert_eq!(plain.len(), ours.len());
    let scale = plain.iter().fold(0.0_f32, |m, g| m.max(g.abs()));
    assert!(scale > 0.1, "the loss moves nothing");
    assert!(ours[ours.len() - 9..].iter().all(|g| *g == 0.0), "no point is in the last frame");
    for (k, (a, b)) in ours.iter().zip(&plain).enumerate() {
        assert!((a - b).abs() < 5e-5 * scale, "parameter {k}: {a} {b}");
    }
}

#[test]
fn conversion_of_d_there_and_back_keeps_every_bit() {
    for embedding in [9, 0] {
        let network = deformation(5, embedding);
        let module = DeformationModule::<NdArray>::from_network(&network, &Default::default());
        let back = module.to_network().expect("finite parameters");
        assert_eq!(back.parameters(), network.parameters());
        assert_eq!((back.config(), back.alpha()), (network.config(), network.alpha()));
    }
}

/// The losses of the steps of a fit, which is cancelled after `last` steps.
struct Losses {
    of_steps: Vec<f64>,
    last: usize,
}

impl Losses {
    fn until(last: usize) -> Self {
        Self { of_steps: Vec::new(), last }
    }
}

impl Monitor for Losses {
    fn report(&mut self, progress: &Progress<'_>) -> Result<(), Cancelled> {
        let loss = progress.measures.iter().find(|m| m.0 == "loss").expect("each step has one");
        self.of_steps.push(loss.1);
        if progress.done < self.last { Ok(()) } else { Err(Cancelled) }
    }
}

/// The largest relative difference between the losses of two fits.
fn largest_difference(a: &Losses, b: &Losses) -> f64 {
    assert_eq!(a.of_steps.len(), b.of_steps.len());
    a.of_steps.iter().zip(&b.of_steps).fold(0.0, |m, (a, b)| m.max((a - b).abs() / b))
}

/// Steps that are compared, five of them of the warm-up.
const STEPS: usize = 20;
/// Largest relative difference of the losses of these steps.
const BOUND: f64 = 2e-4;

fn ball() -> TrainingSet {
    let ball = Sphere { center: Point::new(0.0, 1.0, 0.0), radius: 0.3 };
    let sampling = SamplingParams { near: 5000, far: 500, held_out: 500, ..Default::default() };
    TrainingSet::of_field(&ball, &sampling).expect("a ball")
}

/// The recipe of φ, in small.
fn field_params(config: &SdfConfig, seed: u64) -> FitParams {
    let recipe = NetworkConfig::Sdf(config.clone()).fit_params();
    let schedule = if_neural::schedule::Schedule { warmup: 5, ..recipe.schedule };
    let (steps, seconds) = (Some(100), None);
    FitParams { batch: 256, steps, seconds, check_every: 10, schedule, seed, ..recipe }
}

#[test]
fn burn_has_the_losses_of_the_fused_fit_of_phi_step_by_step() {
    let (set, config) = (ball(), &configs()[0]);
    let start = SdfNetwork::new(config, 3).expect("a valid shape");
    let run = |seed: u64| {
        let mut losses = Losses::until(STEPS);
        let module = SdfModule::<Plain>::from_network(&start, &Default::default());
        let params = field_params(config, seed);
        let (_, report) = twin::fit(module, &set, &params, &mut losses).expect("a valid fit");
        assert_eq!((report.ended, report.steps), (Ended::Cancelled, STEPS as u64));
        losses
    };
    let mut fused = Losses::until(STEPS);
    let (mut network, params) = (start.clone(), field_params(config, 1));
    let cancelled =
        Fit::new(params).expect("valid").run(&mut network, &set, &mut fused).unwrap_err();
    assert_eq!(cancelled, FitError::Cancelled(Cancelled));
    let off = largest_difference(&run(1), &fused);
    println!("φ: losses differ by {off:.1e} of their values");
    assert!(off < BOUND, "{off}");
    assert!(fused.of_steps[STEPS - 1] < 0.9 * fused.of_steps[0], "{:?}", fused.of_steps);
    assert!(largest_difference(&run(2), &fused) > 5.0 * BOUND, "other batches pass, too");
}

/// Points on a bar, and frames in which its upper half bends.
fn bar() -> (Vec<Point>, Vec<Vec<Point>>) {
    let mut next = random(6);
    let mut point = || Point::new(0.1 * next() as f64, 0.5 * next() as f64, 0.1 * next() as f64);
    let canonical: Vec<Point> = (0..400).map(|_| point()).collect();
    let bent =
        |b: f64| canonical.iter().map(|p| p + Vector::x() * (b * p.y.max(0.0).powi(2))).collect();
    let frames = [-0.3, -0.1, 0.0, 0.1, 0.3].map(bent).into();
    (canonical, frames)
}

#[test]
fn burn_has_the_losses_of_the_fused_fit_of_d_step_by_step() {
    let (canonical, frames) = bar();
    let config = DeformationConfig { bands: 4, embedding: 8, frames: 5, width: 32, layers: 2 };
    // Far from the truth, so that the first steps show in the loss.
    let mut start = DeformationNetwork::new(&config, 1).expect("a valid shape");
    let mut next = random(7);
    start.parameters_mut().iter_mut().for_each(|v| *v += 0.1 * next());
    start.refresh();
    let recipe = DeformParams::default();
    // Annealed over the steps compared, and rates that show in the loss.
    let schedule = if_neural::schedule::Schedule { rate: 1e-2, warmup: 5, ..recipe.schedule };
    let params = DeformParams { batch: 256, steps: 100, anneal: 80, schedule, ..recipe };
    let run = |seed: u64| {
        let mut losses = Losses::until(STEPS);
        let module = DeformationModule::<Plain>::from_network(&start, &Default::default());
        let params = DeformParams { seed, ..params };
        let at = &Frame::UNIT;
        let fitted = twin::fit_deformation(module, at, &canonical, &frames, &params, &mut losses);
        assert_eq!(fitted.expect("a valid fit").1.ended, Ended::Cancelled);
        losses
    };
    let mut fused = Losses::until(STEPS);
    let mut network = start.clone();
    let at = &Frame::UNIT;
    let cancelled =
        fit_deformation(&mut network, at, &canonical, &frames, &params, &mut fused).unwrap_err();
    assert_eq!(cancelled, FitError::Cancelled(Cancelled));
    let off = largest_difference(&run(1), &fused);
    println!("d: losses differ by {off:.1e} of their values");
    assert!(off < BOUND, "{off}");
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    let (first, last) = (mean(&fused.of_steps[..5]), mean(&fused.of_steps[STEPS - 5..]));
    assert!(last < 0.8 * first, "{:?}", fused.of_steps);
    assert!(largest_difference(&run(2), &fused) > 5.0 * BOUND, "other batches pass, too");
}

#[test]
fn the_example_trains_both_networks() {
    let [field, motion] = train_with_burn::train::<Plain>(&Default::default()).expect("it trains");
    // The first networks are 20 mm and 30 mm off.
    assert!(field < 8e-3 && motion < 8e-3, "{field} {motion}");
}

#[test]
fn what_burn_cannot_fit_is_named() {
    let (set, config) = (ball(), &configs()[0]);
    let start = SdfNetwork::new(config, 3).expect("a valid shape");
    let mut module = SdfModule::<Plain>::from_network(&start, &Default::default());
    let mut sparse = field_params(config, 1);
    sparse.adam.sparse = true;
    let error = twin::fit(module.clone(), &set, &sparse, &mut Silent).unwrap_err();
    assert!(matches!(&error, FitError::Parameter(e) if e.name == "adam.sparse"), "{error}");
    module.biases[0] = module.biases[0].clone().map(|b| b.mul_scalar(f32::NAN));
    let params = field_params(config, 1);
    assert_eq!(twin::fit(module, &set, &params, &mut Silent).unwrap_err(), FitError::NotANumber);
}
