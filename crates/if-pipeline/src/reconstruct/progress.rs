//! How far a reconstruction is.

use if_core::math::Real;
use std::time::Instant;

/// What is being done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// Pictures are read.
    Read,
    /// Loose clothes are looked for, and what the surface starts from is made.
    Start,
    /// The surface is fitted to masks and normals; the loss is the silhouettes' distance from the
    /// masks' borders, in millimetres.
    Surface,
    /// The canonical mesh is extracted.
    Extract,
    /// The motion of single frames is solved; the loss is the silhouettes' distance from the masks'
    /// borders before it, in millimetres, mean of the round's frames so far.
    Motion,
    /// The network of that motion is fitted.
    MotionNetwork,
    /// The field is fitted.
    Field,
    /// Labels are voted, and garments cut and cleaned.
    Garments,
}

/// How far the work is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// What is being done.
    pub stage: Stage,
    /// Steps of it that are done.
    pub step: usize,
    /// Steps of it in all.
    pub steps: usize,
    /// What it tries to make small, where it has that.
    pub loss: Option<Real>,
    /// Seconds until this stage ends, by the time its steps have taken.
    pub seconds_left: Option<Real>,
}

/// Measures a stage.
pub(super) struct Clock {
    start: Instant,
    first: Option<usize>,
}

impl Clock {
    pub(super) fn new() -> Self {
        Self { start: Instant::now(), first: None }
    }

    /// A new stage begins.
    pub(super) fn restart(&mut self) {
        *self = Self::new();
    }

    /// What to tell before step `step` of `steps`.
    pub(super) fn at(
        &mut self,
        stage: Stage,
        step: usize,
        steps: usize,
        loss: Option<Real>,
    ) -> Progress {
        let first = *self.first.get_or_insert(step);
        let done = step - first.min(step);
        let left = |n: usize| {
            self.start.elapsed().as_secs_f64() / n as Real * (steps - step.min(steps)) as Real
        };
        Progress { stage, step, steps, loss, seconds_left: (done > 0).then(|| left(done)) }
    }
}
