//! Fitting a field with parameters to a training set: steps, stops, and what is kept.

use crate::accuracy::{FieldError, HeldOut};
use crate::adam::{Adam, AdamParams};
use crate::loss::LossParams;
use crate::parameter_error::ParameterError;
use crate::sampling::{Samples, TrainingSet};
use crate::schedule::Schedule;
use crate::trainable::TrainableField;
use if_core::math::Real;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::time::Instant;

/// Held-out points of a check; the report has all of them.
const CHECKED: usize = 2048;
/// Checks from one look at all held-out points to the next, where the checks are below the accuracy
/// that is asked for and all are not. All are ten times as many by default: at ten times less
/// looking takes longer than checking, at ten times more a fit goes on for 2,000 steps too many.
const LOOK_EVERY: u64 = 4;
/// A check that finds the error this many times the best one's stops the fit as diverged.
const DIVERGED: Real = 50.0;
/// But errors below so many network units count as this much: the first values of a grid on a
/// smooth surface are a thousand times better than the steps' own noise, which is no divergence.
const NOISE: Real = 1e-4;
/// Means of held-out points of one target differ by less than this, in network units, wherever they
/// were drawn; those of another by some thousand times more.
const SAME_TARGET: Real = 1e-6;

/// How to fit.
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
    /// clothed bodies of which no table was kept; what they reach is in `docs/fitting.md`, and the
    /// example `fit_table` tries others (`--set`).
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

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Neither steps nor seconds are limited.
    #[error("the fit would never end: give `steps` or `seconds` (an accuracy need not be reached)")]
    Endless,
    /// The field is not a number at the very start.
    #[error(
        "a parameter of the field, or the field at the held-out points, is not a number before the first step; make it anew"
    )]
    NotANumber,
    /// A state of another field.
    #[error("the state is of a field with {expected} parameters, this one has {got}")]
    Parameters {
        /// Of the state.
        expected: usize,
        /// Of the field.
        got: usize,
    },
    /// The fit was begun with other points.
    #[error(
        "the fit was begun with another target: give the training set that it began with, or begin a new fit"
    )]
    Target,
}

impl FitParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter out of range, or no limit at all.
    pub fn validate(&self) -> Result<(), FitError> {
        let fault = |name, value, needs| Err(ParameterError { name, value, needs }.into());
        if !(1..=1 << 24).contains(&self.batch) {
            return fault("batch", self.batch as f64, "from 1 to 2^24 points");
        }
        if !(0.0..=1.0).contains(&self.far) {
            return fault("far", self.far, "from 0 to 1");
        }
        if self.check_every == 0 {
            return fault("check_every", 0.0, "at least 1 step");
        }
        for (name, value) in [("seconds", self.seconds), ("accuracy", self.accuracy)] {
            value.map_or(Ok(()), |v| ParameterError::unless_above_zero(name, v))?;
        }
        self.adam.validate()?;
        self.schedule.validate()?;
        self.loss.validate()?;
        if self.steps.is_none() && self.seconds.is_none() {
            return Err(FitError::Endless);
        }
        Ok(())
    }
}

/// Why a fit ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Ended {
    /// All steps were done.
    Steps,
    /// The time was over.
    Time,
    /// The accuracy was reached, at all held-out points.
    Accuracy,
    /// The caller asked to stop.
    Cancelled,
    /// The loss or the field was no number any more, or the error rose far above the best.
    Diverged,
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Steps => "all done",
            Self::Time => "the time was over",
            Self::Accuracy => "accuracy reached",
            Self::Cancelled => "cancelled",
            Self::Diverged => "it diverged, the last good state was kept",
        })
    }
}

/// What a caller hears after each step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitProgress {
    /// Steps done.
    pub step: u64,
    /// Share of the steps or of the time that is done, whichever is more.
    pub done: Real,
    /// Seconds of all steps so far.
    pub seconds: Real,
    /// Mean loss of the batch.
    pub loss: Real,
    /// Errors at the last check.
    pub error: FieldError,
}

/// How a fit went.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitReport {
    /// Why it ended.
    pub ended: Ended,
    /// Steps done.
    pub steps: u64,
    /// Step of the parameters that were kept: those that reached the accuracy, or those with the
    /// least error at a check. Where the caller broke, the last.
    pub kept: u64,
    /// Points seen.
    pub samples: u64,
    /// Seconds of the steps and checks.
    pub seconds: Real,
    /// Errors at all held-out points.
    pub error: FieldError,
}

/// The best parameters so far.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Best {
    pub(crate) step: u64,
    pub(crate) mean: Real,
    pub(crate) theta: Vec<f32>,
}

/// A fit that can stop, be stored and go on: with a number of steps instead of a time, the same
/// bits come out as without a stop.
///
/// # Examples
///
/// ```
/// use if_core::{math::Point, shapes::Sphere};
/// use if_neural::{fit::{Fit, FitParams}, grid::{GridConfig, GridField}, sampling::{SamplingParams, TrainingSet}};
/// use std::ops::ControlFlow;
/// let ball = Sphere { center: Point::new(0.0, 1.0, 0.0), radius: 0.3 };
/// let set = TrainingSet::of_field(&ball, &SamplingParams { near: 5000, far: 500, held_out: 500, ..Default::default() })?;
/// let mut field = GridField::new(GridConfig { finest: 32, levels: 2, ..Default::default() })?;
/// let mut fit = Fit::new(FitParams { steps: Some(300), seconds: None, batch: 1024, ..Default::default() })?;
/// let report = fit.run(&mut field, &set, &mut |_| ControlFlow::Continue(()))?;
/// assert!(report.error.mean < 1e-3, "{report:?}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    pub(crate) params: FitParams,
    pub(crate) step: u64,
    pub(crate) seconds: Real,
    /// None before the first run.
    pub(crate) adam: Option<Adam>,
    pub(crate) best: Option<Best>,
    /// Step of the last look at all held-out points that found less accuracy than the check.
    pub(crate) missed: Option<u64>,
    /// Of the held-out points: none before the first run.
    pub(crate) means: Option<[Real; 7]>,
}

impl Fit {
    /// A fit that has not begun.
    ///
    /// # Errors
    ///
    /// Parameters out of range.
    pub fn new(params: FitParams) -> Result<Self, FitError> {
        params.validate()?;
        Ok(Self {
            params,
            step: 0,
            seconds: 0.0,
            adam: None,
            best: None,
            missed: None,
            means: None,
        })
    }

    /// How it fits.
    pub fn params(&self) -> &FitParams {
        &self.params
    }

    /// Steps done.
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// Whether it can go on with `set`: it has not begun, or it began with points of this target.
    pub fn is_of(&self, set: &TrainingSet) -> bool {
        let most = SAME_TARGET / set.frame.scale;
        self.means.is_none_or(|means| {
            means.iter().zip(set.held_out.means()).all(|(a, b)| (a - b).abs() <= most)
        })
    }

    /// Steps until one of the limits is met, the caller breaks, or it diverges. `progress` is
    /// called after each.
    ///
    /// Then the field has the parameters that reached the accuracy, or those of the check with the
    /// least error; only if the caller broke it has those of the last step, so that [`Fit::run`]
    /// can go on, and [`Fit::finish`] installs the best.
    ///
    /// # Errors
    ///
    /// A field that is no number at the start, or not the one that the fit began with; or another
    /// target.
    pub fn run(
        &mut self,
        field: &mut (impl TrainableField + ?Sized),
        set: &TrainingSet,
        progress: &mut dyn FnMut(&FitProgress) -> ControlFlow<()>,
    ) -> Result<FitReport, FitError> {
        if !self.is_of(set) {
            return Err(FitError::Target);
        }
        let len = field.parameters().len();
        let mut adam = match self.adam.take() {
            Some(adam) => adam,
            None => Adam::new(self.params.adam, len)?,
        };
        if adam.first.len() != len {
            let expected = adam.first.len();
            self.adam = Some(adam);
            return Err(FitError::Parameters { expected, got: len });
        }
        self.means = Some(set.held_out.means());
        let held_out = set.held_out.thinned(CHECKED);
        let (before, start) = (self.seconds, Instant::now());
        let mut error = check(field, set, &held_out);
        if self.best.is_none() {
            if !is_finite(&error, field) {
                return Err(FitError::NotANumber);
            }
            self.best = Some(Best {
                step: self.step,
                mean: error.mean,
                theta: field.parameters().to_vec(),
            });
        }
        let mut gradient = vec![0.0; len];
        let mut batch = Samples::default();
        let ended = loop {
            let done = self.done();
            if done >= 1.0 {
                break if self.params.steps.is_some_and(|s| self.step >= s) {
                    Ended::Steps
                } else {
                    Ended::Time
                };
            }
            if self.is_due(&error) {
                let whole = check(field, set, &set.held_out);
                self.seconds = before + start.elapsed().as_secs_f64();
                if self.params.accuracy.is_some_and(|a| whole.mean <= a) {
                    break Ended::Accuracy;
                }
                self.missed = Some(self.step);
            }
            let rate = self.params.schedule.rate(self.step, done);
            let Some(loss) =
                self.one(field, set, &mut adam, &mut gradient, &mut batch, rate as f32)
            else {
                break Ended::Diverged;
            };
            self.seconds = before + start.elapsed().as_secs_f64();
            if self.step.is_multiple_of(self.params.check_every) {
                error = check(field, set, &held_out);
                self.seconds = before + start.elapsed().as_secs_f64();
                if !self.judge(&error, field, set) {
                    break Ended::Diverged;
                }
            }
            let heard = FitProgress {
                step: self.step,
                done: self.done().min(1.0),
                seconds: self.seconds,
                loss,
                error,
            };
            if progress(&heard).is_break() {
                break Ended::Cancelled;
            }
        };
        self.adam = Some(adam);
        match ended {
            Ended::Cancelled => {}
            // Another state may be better at the points of a check, but was not found to be at all.
            Ended::Accuracy => {
                self.best = Some(Best {
                    step: self.step,
                    mean: error.mean,
                    theta: field.parameters().to_vec(),
                })
            }
            Ended::Diverged => self.keep_best(field),
            Ended::Steps | Ended::Time => {
                let error = check(field, set, &held_out);
                self.judge(&error, field, set);
                self.keep_best(field);
            }
        }
        let kept = if ended == Ended::Cancelled {
            self.step
        } else {
            self.best.as_ref().map_or(0, |b| b.step)
        };
        Ok(self.report(ended, kept, field, set))
    }

    /// Ends a fit that the caller broke: its last state is judged as at a check, and the field gets
    /// the best one, of which the report speaks.
    ///
    /// An unbroken fit may not have checked there: what is to go on with the same bits is stored
    /// before.
    ///
    /// # Panics
    ///
    /// If it is another field.
    pub fn finish(
        mut self,
        field: &mut (impl TrainableField + ?Sized),
        set: &TrainingSet,
    ) -> FitReport {
        let error = check(field, set, &set.held_out.thinned(CHECKED));
        self.judge(&error, field, set);
        self.keep_best(field);
        self.report(Ended::Cancelled, self.best.as_ref().map_or(self.step, |b| b.step), field, set)
    }

    fn report(
        &self,
        ended: Ended,
        kept: u64,
        field: &(impl TrainableField + ?Sized),
        set: &TrainingSet,
    ) -> FitReport {
        FitReport {
            ended,
            steps: self.step,
            kept,
            samples: self.step * self.params.batch as u64,
            seconds: self.seconds,
            error: check(field, set, &set.held_out),
        }
    }

    /// Gives the field the best parameters so far.
    ///
    /// # Panics
    ///
    /// If it is another field.
    pub fn keep_best(&self, field: &mut (impl TrainableField + ?Sized)) {
        if let Some(best) = &self.best {
            field.parameters_mut().copy_from_slice(&best.theta);
            field.refresh();
        }
    }

    /// Share of the fit that is done.
    fn done(&self) -> Real {
        let steps = self
            .params
            .steps
            .map_or(0.0, |s| if s == 0 { 1.0 } else { self.step as Real / s as Real });
        steps.max(self.params.seconds.map_or(0.0, |s| self.seconds / s))
    }

    /// One step; the mean loss, or none where it is no number: then nothing was changed.
    fn one(
        &mut self,
        field: &mut (impl TrainableField + ?Sized),
        set: &TrainingSet,
        adam: &mut Adam,
        gradient: &mut [f32],
        batch: &mut Samples,
        rate: f32,
    ) -> Option<Real> {
        // A stream for each step: nothing about the batches has to be stored.
        let mut random = Pcg64Mcg::seed_from_u64(
            self.params.seed ^ (self.step + 1).wrapping_mul(0xd134_2543_de82_ef95),
        );
        batch.points.clear();
        batch.known.clear();
        let far = (self.params.batch as Real * self.params.far).round() as usize;
        set.near.draw(self.params.batch - far, &mut random, batch);
        set.far.draw(far, &mut random, batch);
        let share = 1.0 / self.params.batch as f64;
        let (loss, known) = (self.params.loss, &batch.known);
        let total =
            field.loss_gradient(&batch.points, &|i, s| loss.at(&known[i], s, share), gradient);
        if !total.is_finite() || !gradient.iter().all(|g| g.is_finite()) {
            return None;
        }
        adam.step(field.parameters_mut(), gradient, rate);
        field.refresh();
        self.step += 1;
        Some(total)
    }

    /// Whether to look at all held-out points: right after a check that found the accuracy that is
    /// asked for, but not so soon after one that was not borne out.
    fn is_due(&self, error: &FieldError) -> bool {
        let FitParams { accuracy, check_every, .. } = self.params;
        accuracy.is_some_and(|a| error.mean <= a)
            && self.step.is_multiple_of(check_every)
            && self.missed.is_none_or(|m| self.step - m >= check_every.saturating_mul(LOOK_EVERY))
    }

    /// Keeps the parameters if they are the best; false where they are hopeless.
    fn judge(
        &mut self,
        error: &FieldError,
        field: &(impl TrainableField + ?Sized),
        set: &TrainingSet,
    ) -> bool {
        let Some(best) = &mut self.best else { return error.is_finite() };
        if !is_finite(error, field)
            || error.mean > DIVERGED * best.mean.max(NOISE / set.frame.scale)
        {
            return false;
        }
        if error.mean < best.mean {
            best.step = self.step;
            best.mean = error.mean;
            best.theta.copy_from_slice(field.parameters());
        }
        true
    }
}

/// Whether errors and parameters are: nodes of a grid that no held-out point is near do not show in
/// the error.
fn is_finite(error: &FieldError, field: &(impl TrainableField + ?Sized)) -> bool {
    error.is_finite() && field.parameters().iter().all(|p| p.is_finite())
}

fn check(
    field: &(impl TrainableField + ?Sized),
    set: &TrainingSet,
    held_out: &HeldOut,
) -> FieldError {
    held_out.error(&set.frame, |points, out| field.samples32(points, out))
}

#[cfg(test)]
mod tests;
