//! Fitting a deformation to sequences of corresponding points: where each material point of the
//! canonical body is in each frame.

mod correspondences;
mod loss;

use crate::adam::AdamParams;
use crate::deformation::{DeformationNetwork, OffsetSample};
use crate::error::FitError;
use crate::frame::Frame;
use crate::schedule::Schedule;
use crate::training::{Ended, Plan, Problem, Training};
use correspondences::{Checked, Correspondences};
use if_core::math::{Point, Real};
use if_core::monitor::Monitor;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// Steps from one check on held-out points to the next. At ten times more a good state between two
/// checks is lost; at ten times less the checks take as long as the steps.
const CHECK_EVERY: u64 = 50;

/// How to fit a deformation. Lengths are in network units unless they are given in metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DeformParams {
    /// Points of a step, each of a random frame.
    pub batch: usize,
    /// Steps.
    pub steps: u64,
    /// Time at most, in seconds.
    pub seconds: Option<Real>,
    /// Weight of the distance between where a point is and where it should be.
    pub data: f64,
    /// Errors above this count linearly.
    pub data_scale: f64,
    /// Weight of rigidity: ‖FᵀF − 1‖² / 4 with F = 1 + ∂d/∂x, bounded beyond `rigidity_scale` as
    /// by Geman and McClure.
    pub rigidity: f64,
    /// c of the loss of Geman and McClure.
    pub rigidity_scale: f64,
    /// Weight of |d|², bounded beyond `small_scale`.
    pub small: f64,
    /// c of the loss of Geman and McClure.
    pub small_scale: f64,
    /// Share of the points of a step that lie between the given ones instead of on them: rigidity
    /// and smallness alone hold there. They are given points moved by N(0, `spread`).
    pub between: Real,
    /// Standard deviation of that motion.
    pub spread: Real,
    /// Iterations of the annealing of the encoding to one step; 0 has all bands from the start.
    pub anneal: usize,
    /// The learning rate.
    pub schedule: Schedule,
    /// The optimiser.
    pub adam: AdamParams,
    /// Seed of the batches.
    pub seed: u64,
}

impl Default for DeformParams {
    fn default() -> Self {
        Self {
            batch: 2048,
            steps: 2000,
            seconds: None,
            data: 1.0,
            data_scale: 5e-3,
            rigidity: 2e-4,
            rigidity_scale: 0.5,
            small: 1e-5,
            small_scale: 0.05,
            between: 0.25,
            spread: 0.02,
            anneal: 4,
            schedule: Schedule { rate: 1e-3, warmup: 20, last: 0.02 },
            adam: AdamParams {
                beta2: 0.999,
                epsilon: 1e-8,
                sparse: false,
                ..AdamParams::default()
            },
            seed: 1,
        }
    }
}

impl DeformParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let batch = (1..=1 << 24).contains(&self.batch);
        ParameterError::check("batch", self.batch as Real, batch, "from 1 to 2^24 points")?;
        ParameterError::check_share("between", self.between)?;
        for (name, value) in [
            ("data", self.data),
            ("rigidity", self.rigidity),
            ("small", self.small),
            ("spread", self.spread),
        ] {
            ParameterError::check_not_negative(name, value)?;
        }
        let scales = [
            ("data_scale", self.data_scale),
            ("rigidity_scale", self.rigidity_scale),
            ("small_scale", self.small_scale),
        ];
        for (name, value) in scales.into_iter().chain(self.seconds.map(|s| ("seconds", s))) {
            ParameterError::check_positive(name, value)?;
        }
        self.schedule.validate().map_err(|e| e.within("schedule"))?;
        self.adam.validate().map_err(|e| e.within("adam"))
    }
}

/// How a fit of a deformation ended, and how accurate the network is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct DeformReport {
    /// Why it ended.
    pub ended: Ended,
    /// Steps done.
    pub steps: u64,
    /// Step of the state that was kept: that with the least error at a check; 0 for the one it
    /// began with.
    pub kept: u64,
    /// Seconds of the steps.
    pub seconds: Real,
    /// Errors at the held-out points: every tenth, in all frames.
    pub error: OffsetAccuracy,
}

/// Errors of a deformation, in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct OffsetAccuracy {
    /// Mean distance between the moved points and their positions.
    pub mean: Real,
    /// The largest distance.
    pub max: Real,
    /// The mean distance without a deformation: how far points move.
    pub still: Real,
    /// Mean of ‖FᵀF − 1‖ / 2, the strain: zero where the motion is rigid.
    pub strain: Real,
}

/// Fits `network`, embeddings included, to `frames[i][k]`: the position of canonical point `k` in
/// frame `i`, in metres.
///
/// Progress is reported after each step, with the measures of [`Fit::run`](crate::fit::Fit::run);
/// `error` is in network units.
///
/// Afterwards the network has the parameters, and the α, of the check with the least error, also
/// after an error. The first check is before the first step, so that a fit never leaves more error
/// at the checked points than before.
///
/// # Errors
///
/// [`FitError`]: a parameter out of range, positions that are missing or not finite, a network that
/// is not finite at the start, or [`FitError::Cancelled`].
pub fn fit_deformation(
    network: &mut DeformationNetwork,
    at: &Frame,
    canonical: &[Point],
    frames: &[Vec<Point>],
    params: &DeformParams,
    monitor: &mut dyn Monitor,
) -> Result<DeformReport, FitError> {
    deform_with(network, at, (canonical, frames), params, |problem, training, plan| match training
        .run(problem, plan, monitor)
    {
        Ok(Ended::Diverged) => {
            training.restore_best(problem);
            Ok(Ended::Diverged)
        }
        result => {
            let fine = training.finish(problem);
            let ended = result?;
            Ok(if fine { ended } else { Ended::Diverged })
        }
    })
}

/// [`fit_deformation`] by `run`, which trains and leaves the network with the best state.
pub(crate) fn deform_with(
    network: &mut DeformationNetwork,
    at: &Frame,
    (canonical, frames): (&[Point], &[Vec<Point>]),
    params: &DeformParams,
    run: impl FnOnce(&mut DeformProblem<'_>, &mut Training, &Plan) -> Result<Ended, FitError>,
) -> Result<DeformReport, FitError> {
    params.validate()?;
    let data = Correspondences::new(network, at, canonical, frames)?;
    let &DeformParams { steps, seconds, schedule, adam, .. } = params;
    let plan = Plan {
        stage: "deform",
        steps: Some(steps),
        seconds,
        check_every: CHECK_EVERY,
        schedule,
        adam,
    };
    let (alpha, checked) = (network.alpha(), data.checked(params.seed));
    let mut problem = DeformProblem { network, data: &data, checked, params, alpha };
    let mut training = Training::default();
    let ended = run(&mut problem, &mut training, &plan)?;
    Ok(DeformReport {
        ended,
        steps: training.step,
        kept: training.best_step(),
        seconds: training.seconds,
        error: data.accuracy(problem.network, at),
    })
}

/// A network and the positions it is fitted to, as the loop sees them.
pub(crate) struct DeformProblem<'a> {
    pub(crate) network: &'a mut DeformationNetwork,
    pub(crate) data: &'a Correspondences,
    checked: Checked,
    pub(crate) params: &'a DeformParams,
    /// α before the first step.
    alpha: f32,
}

impl DeformProblem<'_> {
    /// Fades in the bands of `step`, counted from 0.
    pub(crate) fn anneal(&mut self, step: u64) {
        if self.params.anneal > 0 {
            self.network.anneal((step as usize).saturating_mul(self.params.anneal));
        }
    }
}

impl Problem for DeformProblem<'_> {
    fn parameters(&self) -> &[f32] {
        self.network.parameters()
    }

    fn parameters_mut(&mut self) -> &mut [f32] {
        self.network.parameters_mut()
    }

    fn refresh(&mut self) {
        self.network.refresh();
    }

    fn loss_gradient(&mut self, step: u64, gradient: &mut [f32]) -> f64 {
        self.anneal(step);
        let params = self.params;
        let (points, wanted) = self.data.batch(params, step);
        let frames: Vec<u32> = wanted.iter().map(|w| w.0).collect();
        let share = 1.0 / params.batch as f64;
        let loss = |i: usize, s: OffsetSample| params.loss(wanted[i].1.as_ref(), &s, share);
        self.network.loss_gradient(&points, &frames, &loss, gradient)
    }

    fn error(&self) -> Real {
        if self.network.parameters().iter().all(|p| p.is_finite()) {
            self.checked.mean(self.network)
        } else {
            Real::NAN
        }
    }

    fn noise(&self) -> Real {
        self.params.data_scale
    }

    fn restore(&mut self, step: u64, theta: &[f32]) {
        // Bands that the annealing did not reach were never trained: α belongs to the state.
        match step.checked_sub(1) {
            Some(last) => self.anneal(last),
            None => self.network.set_alpha(self.alpha),
        }
        self.network.parameters_mut().copy_from_slice(theta);
        self.network.refresh();
    }
}

#[cfg(test)]
mod tests;
