//! φ in burn: the plain graph and the fused kernels as an operation, held against each other.
//!
//! `cargo test -p if-neural --features burn --test burn`

use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};
use burn_autodiff::Autodiff;
use burn_ndarray::NdArray;
use burn_optim::{AdamConfig, GradientsParams, Optimizer};
use if_neural::NetworkError;
use if_neural::burn::{FusedSdf, SdfModule};
use if_neural::mlp::SdfConfig;
use if_neural::sdf::SdfNetwork;
use if_neural::trainable::{Sample32, TrainableField};
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
