//! The fits of φ and d by burn: the batches, losses, optimiser, schedule and checks of the fits on the
//! kernels, differentiated by an autodiff backend.

use super::losses::{field_loss, offset_loss};
use super::tensors::{floats, tensor};
use super::{DeformationModule, SdfModule};
use crate::adam::AdamParams;
use crate::deform::{DeformParams, DeformProblem, DeformReport, deform_with};
use crate::error::{FitError, NetworkError};
use crate::fit::{Ended, FieldProblem, Fit, FitParams, FitReport};
use crate::frame::Frame;
use crate::sampling::TrainingSet;
use crate::sdf::SdfNetwork;
use crate::training::{Plan, Problem, Training};
use burn::module::AutodiffModule;
use burn::tensor::backend::AutodiffBackend;
use burn::tensor::{Int, Tensor, TensorData};
use burn_optim::{AdamConfig, GradientsParams, Optimizer};
use if_core::math::Point;
use if_core::monitor::{Monitor, Progress};
use if_core::parameter::ParameterError;
use std::time::Instant;

/// A network, and what it is trained for, whose steps burn can do.
trait Twin<B: AutodiffBackend>: Problem {
    /// The network as a burn module.
    type Module: AutodiffModule<B>;

    /// All parameters of a module.
    fn theta(module: &Self::Module) -> Tensor<B, 1>;

    /// Mean loss of the batch of `step`, counted from 0.
    fn graph_loss(&mut self, module: &Self::Module, step: u64) -> Tensor<B, 1>;
}

impl<B: AutodiffBackend> Twin<B> for FieldProblem<'_, SdfNetwork> {
    type Module = SdfModule<B>;

    fn theta(module: &SdfModule<B>) -> Tensor<B, 1> {
        module.theta()
    }

    fn graph_loss(&mut self, module: &SdfModule<B>, step: u64) -> Tensor<B, 1> {
        let params = self.params.loss;
        let batch = self.draw(step);
        let (n, device) = (batch.points.len(), module.weights[0].device());
        let points = tensor(batch.points.as_flattened().to_vec(), [n, 3], &device);
        let (value, gradient) = module.samples(points);
        field_loss(&params, &batch.known, value, gradient)
    }
}

impl<B: AutodiffBackend> Twin<B> for DeformProblem<'_> {
    type Module = DeformationModule<B>;

    fn theta(module: &DeformationModule<B>) -> Tensor<B, 1> {
        module.theta()
    }

    fn graph_loss(&mut self, module: &DeformationModule<B>, step: u64) -> Tensor<B, 1> {
        self.anneal(step);
        let (points, wanted) = self.data.batch(self.params, step);
        let (n, device) = (points.len(), module.weights[0].device());
        let points = tensor(points.as_flattened().to_vec(), [n, 3], &device);
        let (frames, wanted): (Vec<i64>, Vec<_>) =
            wanted.into_iter().map(|(frame, offset)| (i64::from(frame), offset)).unzip();
        let frames = Tensor::<B, 1, Int>::from_data(TensorData::new(frames, [n]), &device);
        let (offset, jacobian) = module.samples_at(points, frames, self.network.alpha());
        offset_loss(self.params, &wanted, offset, jacobian)
    }
}

/// Trains `module` on the points of `set` by burn, on the module's device: [`Fit::run`] with the
/// steps on an autodiff backend.
///
/// Progress, limits and checks are those of [`Fit::run`]; held-out points are evaluated by the
/// kernels. The result has the parameters of the check with the least error, or those that reached the
/// accuracy. A fit that the monitor cancels ends with [`Ended::Cancelled`] and cannot be resumed.
///
/// # Accuracy
///
/// Both compute in f32, with sums in another order. On burn's ndarray backend the loss of each of
/// the first 20 steps is that of the kernels to 2e-4 of its value (`tests/burn.rs`).
///
/// # Errors
///
/// A parameter is out of range, [`AdamParams::sparse`] is set, or the module is not finite at the
/// start.
pub fn fit<B: AutodiffBackend>(
    module: SdfModule<B>,
    set: &TrainingSet,
    params: &FitParams,
    monitor: &mut dyn Monitor,
) -> Result<(SdfModule<B>, FitReport), FitError> {
    let mut fit = Fit::new(*params)?;
    dense(&params.adam)?;
    let device = module.weights[0].device();
    let mut network = module.to_network().map_err(at_start)?;
    let mut training = Training::default();
    let mut problem = FieldProblem::new(&mut network, set, params, &mut fit.missed);
    let ended = descend::<B, _>(module, &mut problem, &mut training, &params.plan(), monitor)?;
    fit.training = training;
    let report = fit.report(ended, &network, set);
    Ok((SdfModule::from_network(&network, &device), report))
}

/// Trains `module`, embeddings included, to follow points over time by burn, on the module's device:
/// [`crate::fit_deformation`] with the steps on an autodiff backend.
///
/// Progress, checks and what comes out are those of [`crate::fit_deformation`], with α. A fit that the
/// monitor cancels ends with [`Ended::Cancelled`].
///
/// # Accuracy
///
/// As [`fit()`].
///
/// # Errors
///
/// As [`crate::fit_deformation`], or [`AdamParams::sparse`] is set.
pub fn fit_deformation<B: AutodiffBackend>(
    module: DeformationModule<B>,
    at: &Frame,
    canonical: &[Point],
    frames: &[Vec<Point>],
    params: &DeformParams,
    monitor: &mut dyn Monitor,
) -> Result<(DeformationModule<B>, DeformReport), FitError> {
    dense(&params.adam)?;
    let device = module.weights[0].device();
    let mut network = module.to_network().map_err(at_start)?;
    let report =
        deform_with(&mut network, at, (canonical, frames), params, |problem, training, plan| {
            descend::<B, _>(module, problem, training, plan, monitor)
        })?;
    Ok((DeformationModule::from_network(&network, &device), report))
}

/// Rejects what burn's Adam does not have.
fn dense(adam: &AdamParams) -> Result<(), ParameterError> {
    let needs = "off (0): the Adam of burn steps all parameters";
    ParameterError::check("adam.sparse", 1.0, !adam.sparse, needs)
}

/// The error of a module that has no network.
fn at_start(error: NetworkError) -> FitError {
    match error {
        NetworkError::Length { expected, got } => FitError::Length { expected, got },
        _ => FitError::NotANumber,
    }
}

/// [`Training::run`] with the steps of burn on `module`; `problem` has its θ at the checks, and
/// the best one in the end.
fn descend<B: AutodiffBackend, P: Twin<B>>(
    mut module: P::Module,
    problem: &mut P,
    training: &mut Training,
    plan: &Plan,
    monitor: &mut dyn Monitor,
) -> Result<Ended, FitError> {
    let start = Instant::now();
    let config = AdamConfig::new()
        .with_beta_1(plan.adam.beta1)
        .with_beta_2(plan.adam.beta2)
        .with_epsilon(plan.adam.epsilon);
    let mut adam = config.init::<B, P::Module>();
    let mut error = problem.error();
    if !error.is_finite() {
        return Err(FitError::NotANumber);
    }
    training.keep(problem.parameters(), error);
    let ended = loop {
        let share = plan.share(training.step, training.seconds);
        if share >= 1.0 {
            let all = plan.steps.is_some_and(|s| training.step >= s);
            break if all { Ended::Steps } else { Ended::Time };
        }
        // Only a check can confirm an accuracy, and then θ of the problem is that of the module.
        if training.step.is_multiple_of(plan.check_every)
            && problem.is_reached(training.step, error)
        {
            training.keep(problem.parameters(), error);
            break Ended::Accuracy;
        }
        let loss = problem.graph_loss(&module, training.step);
        let value = f64::from(floats(loss.clone().inner())[0]);
        if !value.is_finite() {
            break Ended::Diverged;
        }
        let gradients = GradientsParams::from_grads(loss.backward(), &module);
        module = adam.step(plan.schedule.rate(training.step, share), module, gradients);
        training.step += 1;
        training.seconds = start.elapsed().as_secs_f64();
        if training.step.is_multiple_of(plan.check_every) {
            install::<B, P>(&module, problem);
            error = problem.error();
            training.seconds = start.elapsed().as_secs_f64();
            if !training.judge(problem.parameters(), error, problem.noise()) {
                break Ended::Diverged;
            }
        }
        let share = plan.share(training.step, training.seconds).min(1.0);
        let progress = Progress {
            done: training.step as usize,
            total: plan.steps.map(|s| s as usize),
            measures: &[
                ("loss", value),
                ("error", error),
                ("seconds", training.seconds),
                ("share", share),
            ],
            ..Progress::stage(plan.stage)
        };
        if monitor.report(&progress).is_err() {
            break Ended::Cancelled;
        }
    };
    let mut ended = ended;
    if matches!(ended, Ended::Diverged | Ended::Accuracy) {
        // The last state is not finite, far off, or already kept.
        training.restore_best(problem);
    } else {
        install::<B, P>(&module, problem);
        if !training.finish(problem) {
            ended = Ended::Diverged;
        }
    }
    training.seconds = start.elapsed().as_secs_f64();
    Ok(ended)
}

/// Copies θ of the module into the problem.
fn install<B: AutodiffBackend, P: Twin<B>>(module: &P::Module, problem: &mut P) {
    problem.parameters_mut().copy_from_slice(&floats(P::theta(module)));
    problem.refresh();
}
