//! Fitting a network for φ to a training set.

use crate::accuracy::{FieldAccuracy, HeldOut};
use crate::adam::AdamParams;
use crate::error::FitError;
use crate::loss::LossParams;
use crate::network::NetworkConfig;
use crate::sampling::{Samples, TrainingSet};
use crate::schedule::Schedule;
use crate::trainable::TrainableField;
use crate::training::{Plan, Problem, Training, random_of_step};
use if_core::math::Real;
use if_core::monitor::Monitor;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

pub use crate::training::Ended;

/// Held-out points of a check; the report has all of them.
const CHECKED: usize = 2048;
/// Checks from one evaluation of all held-out points to the next, while the checks are below the
/// accuracy and all points are not. All are ten times as many by default: with ten times less they
/// take longer than the checks, with ten times more a fit goes on for 2,000 steps too many.
const CONFIRM_EVERY: u64 = 4;
/// Errors below so many network units are no divergence: the first values of a grid on a smooth
/// surface are a thousand times better than the noise of the steps.
const NOISE: Real = 1e-4;
/// Means of held-out points of one target, drawn with the same seed and counts, differ by less than this, in
/// network units; those of another target by some thousand times more.
const SAME_TARGET: Real = 1e-6;

/// How to fit a field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FitParams {
    /// Points of a step.
    pub batch: usize,
    /// Share of them that lies anywhere in the cube instead of near the surface, from 0 to 1.
    pub far: Real,
    /// Steps at most.
    pub steps: Option<u64>,
    /// Time at most, in seconds. With it the learning rate follows the clock, and two runs differ
    /// in their bits; without it they do not.
    pub seconds: Option<Real>,
    /// Stop when the mean error near the surface, at all held-out points, is at most this, in
    /// metres.
    pub accuracy: Option<Real>,
    /// Steps from one check on held-out points to the next.
    pub check_every: u64,
    /// The learning rate.
    pub schedule: Schedule,
    /// The terms of the loss.
    pub loss: LossParams,
    /// The optimiser.
    pub adam: AdamParams,
    /// Seed of the batches.
    pub seed: u64,
}

impl Default for FitParams {
    /// One minute. Batch, rates and weights were chosen by trials of [`crate::grid::GridField`] on
    /// clothed bodies of which no table was kept; what they reach is in `docs/evidence/neural.md`,
    /// and the program `fit_table` tries others (`--set`).
    fn default() -> Self {
        Self {
            batch: 1 << 14,
            far: 0.1,
            steps: None,
            seconds: Some(60.0),
            accuracy: None,
            check_every: 50,
            schedule: Schedule::default(),
            loss: LossParams::default(),
            adam: AdamParams::default(),
            seed: 1,
        }
    }
}

impl FitParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter out of range, or neither steps nor seconds are limited.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let batch = (1..=1 << 24).contains(&self.batch);
        ParameterError::check("batch", self.batch as Real, batch, "from 1 to 2^24 points")?;
        ParameterError::check_share("far", self.far)?;
        let check_every = self.check_every;
        ParameterError::check("check_every", 0.0, check_every > 0, "at least 1 step")?;
        for (name, value) in [("seconds", self.seconds), ("accuracy", self.accuracy)] {
            value.map_or(Ok(()), |v| ParameterError::check_positive(name, v))?;
        }
        self.adam.validate().map_err(|e| e.within("adam"))?;
        self.schedule.validate().map_err(|e| e.within("schedule"))?;
        self.loss.validate().map_err(|e| e.within("loss"))?;
        let limited = self.steps.is_some() || self.seconds.is_some();
        let needs = "limited, or `seconds` must be: an accuracy may never be reached";
        ParameterError::check("steps", Real::INFINITY, limited, needs)
    }
}

impl FitParams {
    /// How to train.
    pub(crate) fn plan(&self) -> Plan {
        let Self { steps, seconds, check_every, schedule, adam, .. } = *self;
        Plan { stage: "fit", steps, seconds, check_every, schedule, adam }
    }
}

impl NetworkConfig {
    /// How to fit it: batches and rates that suit the kind of network. What they reach on clothed
    /// bodies is in `docs/evidence/neural.md`; others were tried, but not tabled.
    pub fn fit_params(&self) -> FitParams {
        match self {
            Self::Grid(_) => FitParams::default(),
            Self::Sdf(_) => FitParams {
                batch: 2048,
                check_every: 25,
                schedule: Schedule { rate: 1e-3, warmup: 50, last: 0.02 },
                adam: AdamParams {
                    beta2: 0.999,
                    epsilon: 1e-8,
                    sparse: false,
                    ..Default::default()
                },
                ..FitParams::default()
            },
        }
    }
}

/// How a fit ended, and how accurate the field is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FitReport {
    /// Why it ended.
    pub ended: Ended,
    /// Steps done.
    pub steps: u64,
    /// Step of the parameters that were kept: those that reached the accuracy, or those with the
    /// least error at a check.
    pub kept: u64,
    /// Training points of all steps.
    pub samples: u64,
    /// Seconds of the steps and checks.
    pub seconds: Real,
    /// Errors at all held-out points.
    pub error: FieldAccuracy,
}

/// A fit that can be cancelled, stored and resumed: with a limit of steps instead of time, the same
/// bits come out as without a stop.
///
/// # Examples
///
/// ```
/// use if_core::{Point, Silent, shapes::Sphere};
/// use if_neural::{Fit, FitParams, GridConfig, SamplingParams, TrainingSet, grid::GridField};
///
/// let ball = Sphere { center: Point::new(0.0, 1.0, 0.0), radius: 0.3 };
/// let sampling = SamplingParams { near: 5000, far: 500, held_out: 500, ..Default::default() };
/// let set = TrainingSet::of_field(&ball, &sampling)?;
/// let mut field = GridField::new(GridConfig { finest: 32, levels: 2, ..Default::default() })?;
/// let params = FitParams { steps: Some(300), seconds: None, batch: 1024, ..Default::default() };
/// let report = Fit::new(params)?.run(&mut field, &set, &mut Silent)?;
/// assert!(report.error.mean < 1e-3, "{report:?}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    pub(crate) params: FitParams,
    pub(crate) training: Training,
    /// Step of the last evaluation of all held-out points that found less accuracy than the check.
    pub(crate) missed: Option<u64>,
    /// Means of the held-out points ([`HeldOut::means`]); `None` before the first run.
    pub(crate) means: Option<[Real; 7]>,
}

impl Fit {
    /// A fit that has not begun.
    ///
    /// # Errors
    ///
    /// A parameter is out of range.
    pub fn new(params: FitParams) -> Result<Self, ParameterError> {
        params.validate()?;
        Ok(Self { params, training: Training::default(), missed: None, means: None })
    }

    /// The parameters.
    pub fn params(&self) -> &FitParams {
        &self.params
    }

    /// Steps done.
    pub fn steps(&self) -> u64 {
        self.training.step
    }

    /// Whether the fit can go on with `set`: it has not begun, or it began with points of this target, drawn
    /// with the same seed and counts.
    pub fn matches(&self, set: &TrainingSet) -> bool {
        let most = SAME_TARGET / set.frame.scale;
        self.means.is_none_or(|means| {
            means.iter().zip(set.held_out.means()).all(|(a, b)| (a - b).abs() <= most)
        })
    }

    /// Steps until a limit is met, the monitor cancels, or the fit diverges.
    ///
    /// Progress is reported after each step, with the measures `loss` (mean of the batch), `error`
    /// (mean near the surface at the last check, in metres), `seconds` (of all steps so far) and
    /// `share` (of the steps or of the time, whichever is larger, from 0 to 1).
    ///
    /// Afterwards the field has the parameters that reached the accuracy, or those of the check with
    /// the least error. If the monitor cancels it has those of the last step, so that [`Fit::run`]
    /// can resume; [`Fit::finish`] installs the best.
    ///
    /// # Errors
    ///
    /// [`FitError::Cancelled`]; a field that is not finite at the start, or of another size than the
    /// fit began with; another target.
    pub fn run(
        &mut self,
        field: &mut (impl TrainableField + ?Sized),
        set: &TrainingSet,
        monitor: &mut dyn Monitor,
    ) -> Result<FitReport, FitError> {
        if !self.matches(set) {
            return Err(FitError::Target);
        }
        self.means = Some(set.held_out.means());
        let plan = self.params.plan();
        let mut problem = FieldProblem::new(field, set, &self.params, &mut self.missed);
        let ended = self.training.run(&mut problem, &plan, monitor)?;
        match ended {
            // The last state is not finite, far off, or already kept.
            Ended::Diverged | Ended::Accuracy => self.training.restore_best(&mut problem),
            _ => {
                self.training.finish(&mut problem);
            }
        }
        Ok(self.report(ended, field, set))
    }

    /// Ends a cancelled fit: its last state is judged as at a check, and the field gets the best
    /// one, which the report describes.
    ///
    /// A fit without a stop may not check at this step: store a fit that is to go on with the same
    /// bits before.
    ///
    /// # Panics
    ///
    /// If the field has another number of parameters.
    pub fn finish(
        mut self,
        field: &mut (impl TrainableField + ?Sized),
        set: &TrainingSet,
    ) -> FitReport {
        let mut problem = FieldProblem::new(field, set, &self.params, &mut self.missed);
        self.training.finish(&mut problem);
        self.report(Ended::Cancelled, field, set)
    }

    /// The report of a fit that ended with `field`.
    pub(crate) fn report(
        &self,
        ended: Ended,
        field: &(impl TrainableField + ?Sized),
        set: &TrainingSet,
    ) -> FitReport {
        FitReport {
            ended,
            steps: self.training.step,
            kept: self.training.best_step(),
            samples: self.training.step * self.params.batch as u64,
            seconds: self.training.seconds,
            error: evaluate(field, set, &set.held_out),
        }
    }
}

/// A field and its training set, as the loop sees them.
pub(crate) struct FieldProblem<'a, F: ?Sized> {
    field: &'a mut F,
    set: &'a TrainingSet,
    pub(crate) params: &'a FitParams,
    missed: &'a mut Option<u64>,
    /// The held-out points of a check.
    checked: HeldOut,
    batch: Samples,
}

impl<'a, F: TrainableField + ?Sized> FieldProblem<'a, F> {
    pub(crate) fn new(
        field: &'a mut F,
        set: &'a TrainingSet,
        params: &'a FitParams,
        missed: &'a mut Option<u64>,
    ) -> Self {
        let checked = set.held_out.thinned(CHECKED);
        Self { field, set, params, missed, checked, batch: Samples::default() }
    }

    /// The batch of `step`, counted from 0.
    pub(crate) fn draw(&mut self, step: u64) -> &Samples {
        let FitParams { batch: size, far, seed, .. } = *self.params;
        let batch = &mut self.batch;
        let mut random = random_of_step(seed, step);
        batch.points.clear();
        batch.known.clear();
        let far = (size as Real * far).round() as usize;
        self.set.near.draw(size - far, &mut random, batch);
        self.set.far.draw(far, &mut random, batch);
        batch
    }
}

impl<F: TrainableField + ?Sized> Problem for FieldProblem<'_, F> {
    fn parameters(&self) -> &[f32] {
        self.field.parameters()
    }

    fn parameters_mut(&mut self) -> &mut [f32] {
        self.field.parameters_mut()
    }

    fn refresh(&mut self) {
        self.field.refresh();
    }

    fn loss_gradient(&mut self, step: u64, gradient: &mut [f32]) -> f64 {
        let FitParams { batch: size, loss, .. } = *self.params;
        self.draw(step);
        let batch = &self.batch;
        let share = 1.0 / size as f64;
        let known = &batch.known;
        self.field.loss_gradient(&batch.points, &|i, s| loss.at(&known[i], s, share), gradient)
    }

    fn error(&self) -> Real {
        let found = evaluate(self.field, self.set, &self.checked);
        // Nodes of a grid that no held-out point is near do not show in the error.
        let finite = found.is_finite() && self.field.parameters().iter().all(|p| p.is_finite());
        if finite { found.mean } else { Real::NAN }
    }

    fn noise(&self) -> Real {
        NOISE / self.set.frame.scale
    }

    /// Evaluates all held-out points right after a check that found the accuracy, but not too soon
    /// after an evaluation that did not confirm it.
    fn is_reached(&mut self, step: u64, error: Real) -> bool {
        let FitParams { accuracy, check_every, .. } = *self.params;
        let Some(accuracy) = accuracy.filter(|a| error <= *a) else { return false };
        let is_due = step.is_multiple_of(check_every)
            && self.missed.is_none_or(|m| step - m >= check_every.saturating_mul(CONFIRM_EVERY));
        if !is_due {
            return false;
        }
        if evaluate(self.field, self.set, &self.set.held_out).mean <= accuracy {
            return true;
        }
        *self.missed = Some(step);
        false
    }
}

fn evaluate(
    field: &(impl TrainableField + ?Sized),
    set: &TrainingSet,
    held_out: &HeldOut,
) -> FieldAccuracy {
    held_out.accuracy(&set.frame, |points, out| field.samples32(points, out))
}

#[cfg(test)]
mod tests;
