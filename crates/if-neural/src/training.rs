//! The training loop of all fits: steps of Adam at a scheduled rate, checks on held-out points, and
//! the best state.
//!
//! ```text
//! until the steps or the time are over:
//!     if the error of the last check is small enough, and the problem confirms it: stop
//!     θ ← Adam(θ, ∂L/∂θ of a random batch, rate)
//!     every `check_every` steps: e ← error at the held-out points
//!         stop if e is not finite or far above the least error; keep θ if e is the least
//!     report to the monitor, which may cancel
//! ```

use crate::adam::{Adam, AdamParams};
use crate::error::FitError;
use crate::schedule::Schedule;
use if_core::math::Real;
use if_core::monitor::{Monitor, Progress};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// A check that finds an error this many times the least one stops the fit as diverged.
const DIVERGED: Real = 50.0;

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
    /// The monitor cancelled it.
    Cancelled,
    /// The loss or the network was not finite, or the error rose far above the least.
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

/// What is trained.
pub(crate) trait Problem {
    /// θ.
    fn parameters(&self) -> &[f32];

    /// θ, for the optimiser.
    fn parameters_mut(&mut self) -> &mut [f32];

    /// Updates what is derived from θ.
    fn refresh(&mut self);

    /// Mean loss of the batch of `step`, counted from 0; its derivatives overwrite `gradient`.
    fn loss_gradient(&mut self, step: u64, gradient: &mut [f32]) -> f64;

    /// Mean error at the held-out points of a check. NaN if anything, θ included, is not finite:
    /// inactive ReLUs map NaN to 0, so the mean alone cannot reveal it.
    fn error(&self) -> Real;

    /// An error that counts as small: only errors above 50 times this one can be a divergence.
    fn noise(&self) -> Real;

    /// Whether the fit is accurate enough to stop, where the last check found `error`.
    fn is_reached(&mut self, _step: u64, _error: Real) -> bool {
        false
    }

    /// Restores the state after `step` steps, whose parameters are `theta`.
    fn restore(&mut self, _step: u64, theta: &[f32]) {
        self.parameters_mut().copy_from_slice(theta);
        self.refresh();
    }
}

/// How to train.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plan {
    /// Name of the stage in progress reports.
    pub(crate) stage: &'static str,
    pub(crate) steps: Option<u64>,
    pub(crate) seconds: Option<Real>,
    pub(crate) check_every: u64,
    pub(crate) schedule: Schedule,
    pub(crate) adam: AdamParams,
}

impl Plan {
    /// Share that is done, of the steps or of the time, whichever is larger.
    pub(crate) fn share(&self, step: u64, seconds: Real) -> Real {
        let steps = self.steps.map_or(0.0, |s| if s == 0 { 1.0 } else { step as Real / s as Real });
        steps.max(self.seconds.map_or(0.0, |s| seconds / s))
    }
}

/// The state with the least error at a check so far.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Best {
    pub(crate) step: u64,
    pub(crate) mean: Real,
    pub(crate) theta: Vec<f32>,
}

/// The state of a fit beside θ. It can be stored: with a limit of steps instead of time, a fit that
/// goes on from here has the same bits as one without a stop.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Training {
    /// Steps done.
    pub(crate) step: u64,
    /// Seconds of the steps and checks.
    pub(crate) seconds: Real,
    /// `None` before the first run.
    pub(crate) adam: Option<Adam>,
    /// `None` before the first run.
    pub(crate) best: Option<Best>,
}

impl Training {
    /// Steps until a limit is met or the training diverges. The problem is left with the state of
    /// the last step; [`Training::finish`] and [`Training::restore_best`] install the best.
    ///
    /// # Errors
    ///
    /// The monitor cancels; or the problem is not finite at the start, or has another number of
    /// parameters than before.
    pub(crate) fn run(
        &mut self,
        problem: &mut impl Problem,
        plan: &Plan,
        monitor: &mut dyn Monitor,
    ) -> Result<Ended, FitError> {
        let (before, start) = (self.seconds, Instant::now());
        let seconds = || before + start.elapsed().as_secs_f64();
        let len = problem.parameters().len();
        if let Some(expected) = self.adam.as_ref().map(|a| a.first.len()).filter(|n| *n != len) {
            return Err(FitError::Length { expected, got: len });
        }
        let mut error = problem.error();
        if self.best.is_none() {
            if !error.is_finite() {
                return Err(FitError::NotANumber);
            }
            self.keep(problem.parameters(), error);
        }
        let mut adam = match self.adam.take() {
            Some(adam) => adam,
            None => Adam::new(plan.adam, len)?,
        };
        let mut gradient = vec![0.0; len];
        let ended = loop {
            let share = plan.share(self.step, self.seconds);
            if share >= 1.0 {
                let all = plan.steps.is_some_and(|s| self.step >= s);
                break Ok(if all { Ended::Steps } else { Ended::Time });
            }
            if problem.is_reached(self.step, error) {
                // Another state may have less error at the points of a check, but only this one is
                // confirmed at all held-out points.
                self.keep(problem.parameters(), error);
                break Ok(Ended::Accuracy);
            }
            let loss = problem.loss_gradient(self.step, &mut gradient);
            if !loss.is_finite() || !gradient.iter().all(|g| g.is_finite()) {
                break Ok(Ended::Diverged);
            }
            let rate = plan.schedule.rate(self.step, share) as f32;
            adam.step(problem.parameters_mut(), &gradient, rate);
            problem.refresh();
            self.step += 1;
            self.seconds = seconds();
            if self.step.is_multiple_of(plan.check_every) {
                error = problem.error();
                self.seconds = seconds();
                if !self.judge(problem.parameters(), error, problem.noise()) {
                    break Ok(Ended::Diverged);
                }
            }
            let share = plan.share(self.step, self.seconds).min(1.0);
            let progress = Progress {
                done: self.step as usize,
                total: plan.steps.map(|s| s as usize),
                measures: &[
                    ("loss", loss),
                    ("error", error),
                    ("seconds", self.seconds),
                    ("share", share),
                ],
                ..Progress::stage(plan.stage)
            };
            if let Err(cancelled) = monitor.report(&progress) {
                break Err(cancelled.into());
            }
        };
        self.adam = Some(adam);
        self.seconds = seconds();
        ended
    }

    /// Judges the last state as at a check, then restores the best one. `false` if the last state
    /// is not finite, or far worse than the best.
    pub(crate) fn finish(&mut self, problem: &mut impl Problem) -> bool {
        let fine = self.judge(problem.parameters(), problem.error(), problem.noise());
        self.restore_best(problem);
        fine
    }

    /// Restores the best state so far.
    pub(crate) fn restore_best(&self, problem: &mut impl Problem) {
        if let Some(best) = &self.best {
            problem.restore(best.step, &best.theta);
        }
    }

    /// Step of the best state.
    pub(crate) fn best_step(&self) -> u64 {
        self.best.as_ref().map_or(self.step, |best| best.step)
    }

    /// Keeps θ as the best state.
    pub(crate) fn keep(&mut self, theta: &[f32], mean: Real) {
        self.best = Some(Best { step: self.step, mean, theta: theta.to_vec() });
    }

    /// Keeps θ if its error is the least; `false` if it is not finite or far above the least.
    pub(crate) fn judge(&mut self, theta: &[f32], error: Real, noise: Real) -> bool {
        let Some(best) = &mut self.best else { return error.is_finite() };
        if !error.is_finite() || error > DIVERGED * best.mean.max(noise) {
            return false;
        }
        if error < best.mean {
            (best.step, best.mean) = (self.step, error);
            best.theta.copy_from_slice(theta);
        }
        true
    }
}

/// Random numbers of `step`. A stream for each step: nothing about batches has to be stored.
pub(crate) fn random_of_step(seed: u64, step: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed ^ (step + 1).wrapping_mul(0xd134_2543_de82_ef95))
}
