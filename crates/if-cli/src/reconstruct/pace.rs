//! How a run tells of its progress.

use if_core::monitor::Progress;
use std::time::{Duration, Instant};

/// Least time between two steps of a stage that are logged: the fastest stages have hundreds a second,
/// and rounds of the surface, which matter most, take longer on captures of a usual size.
const LOGGED_EACH: Duration = Duration::from_secs(1);

/// Estimates the remaining time of a stage by the time of its steps so far, and selects which are logged.
pub(super) struct Pace {
    stage: &'static str,
    first: usize,
    start: Instant,
    logged: Option<Instant>,
}

impl Pace {
    pub(super) fn new() -> Self {
        Self { stage: "", first: 0, start: Instant::now(), logged: None }
    }

    /// Seconds until the stage ends; `None` at its first step.
    pub(super) fn seconds_left(&mut self, progress: &Progress) -> Option<f64> {
        if progress.stage != self.stage {
            *self = Self { stage: progress.stage, first: progress.done, ..Self::new() };
        }
        let done = progress.done.saturating_sub(self.first);
        let left = progress.total?.saturating_sub(progress.done);
        (done > 0).then(|| self.start.elapsed().as_secs_f64() / done as f64 * left as f64)
    }

    /// Whether to log a step whose stage [`Pace::seconds_left`] has seen: the first of each stage, and
    /// of the others one from time to time.
    pub(super) fn is_due(&mut self) -> bool {
        let is_due = self.logged.is_none_or(|logged| logged.elapsed() >= LOGGED_EACH);
        if is_due {
            self.logged = Some(Instant::now());
        }
        is_due
    }
}

/// What a stage does, and how far it is.
pub(super) fn described(progress: &Progress, seconds_left: Option<f64>) -> String {
    let what = match progress.stage {
        "read" => "reading frames",
        "start" => "looking for loose clothes",
        "poses" => "refining poses",
        "surface" => "fitting the surface",
        "fields" => "training φ and d",
        "extract" => "extracting the canonical mesh",
        "motion" => "solving the motion of single frames",
        "motion_network" => "fitting the network of the motion",
        "phi" => "fitting the network of φ",
        "garments" => "finding garments",
        "smooth" => "smoothing labels",
        "holes" | "boundary" => "cleaning a garment",
        stage => stage,
    };
    let mut text = what.to_owned();
    if let Some(total) = progress.total {
        text += &format!(" {}/{total}", progress.done);
    }
    if let Some(mm) = progress.measure("silhouette_mm") {
        text += &format!(", silhouettes off by {mm:.1} mm");
    }
    if let Some(degrees) = progress.measure("normal_degrees") {
        text += &format!(", normals by {degrees:.1}°");
    }
    if let Some(mm) = progress.measure("mean_mm") {
        text += &format!(", φ off by {mm:.1} mm");
    }
    if let Some(left) = seconds_left {
        text += &format!(", {left:.0} s left");
    }
    text
}
