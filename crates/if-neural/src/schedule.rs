//! The learning rate over a fit.

use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// A rise over the first steps, then half a cosine down to a small share:
///
/// ```text
/// rate · min(1, (step + 1) / warmup) · (last + (1 − last) (1 + cos π·progress) / 2)
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Schedule {
    /// The highest rate.
    pub rate: f64,
    /// Steps of the rise.
    pub warmup: u64,
    /// Share of the rate at the end, from 0 to 1.
    pub last: f64,
}

impl Default for Schedule {
    fn default() -> Self {
        Self { rate: 1e-3, warmup: 20, last: 0.01 }
    }
}

impl Schedule {
    /// The rate of step `step`, counted from 0, when `progress` of the fit, from 0 to 1, is done.
    pub fn rate(&self, step: u64, progress: f64) -> f64 {
        let rise = if step < self.warmup { (step + 1) as f64 / self.warmup as f64 } else { 1.0 };
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * progress.clamp(0.0, 1.0)).cos());
        self.rate * rise * (self.last + (1.0 - self.last) * cosine)
    }

    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        // The steps are taken in f32, where 1e300 is infinite.
        let rate = self.rate > 0.0 && (self.rate as f32).is_finite();
        let needs = "above zero, and finite in single precision";
        ParameterError::check("rate", self.rate, rate, needs)?;
        ParameterError::check_share("last", self.last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_rises_then_falls_to_the_last_share() {
        let s = Schedule { rate: 2.0, warmup: 4, last: 0.1 };
        assert_eq!([0, 1, 3].map(|k| s.rate(k, 0.0)), [0.5, 1.0, 2.0]);
        approx::assert_relative_eq!(s.rate(9, 0.5), 2.0 * 0.55, epsilon = 1e-12);
        approx::assert_relative_eq!(s.rate(9, 1.0), 0.2, epsilon = 1e-12);
        assert_eq!(s.rate(9, 7.0), s.rate(9, 1.0));
        assert_eq!(s.validate(), Ok(()));
        for rate in [0.0, -1.0, f64::NAN, 1e300] {
            assert_eq!(Schedule { rate, ..s }.validate().map_err(|e| e.name), Err("rate".into()));
        }
        assert_eq!(Schedule { last: 2.0, ..s }.validate().map_err(|e| e.name), Err("last".into()));
    }
}
