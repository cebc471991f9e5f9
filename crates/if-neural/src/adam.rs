//! Adam, as a state that can be stored.

use if_core::parameter::ParameterError;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Parameters of one task.
const BLOCK: usize = 1 << 14;

/// Rates of the optimiser Adam.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AdamParams {
    /// β₁: memory of the mean derivative.
    pub beta1: f32,
    /// β₂: memory of the mean square.
    pub beta2: f32,
    /// ε, in the unit of the derivatives.
    pub epsilon: f32,
    /// Skips parameters, and their moments, whose derivative is exactly zero: nodes of a grid that
    /// no point of the batch is near.
    pub sparse: bool,
}

impl Default for AdamParams {
    fn default() -> Self {
        Self { beta1: 0.9, beta2: 0.99, epsilon: 1e-12, sparse: true }
    }
}

impl AdamParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for (name, beta) in [("beta1", self.beta1), ("beta2", self.beta2)] {
            let ok = (0.0..1.0).contains(&beta);
            ParameterError::check(name, beta.into(), ok, "from 0 to below 1")?;
        }
        ParameterError::check_positive("epsilon", self.epsilon.into())
    }
}

/// Moments of the derivatives.
///
/// # Source
///
/// Kingma and Ba 2015, Algorithm 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Its rates.
    pub(crate) params: AdamParams,
    /// Steps done.
    pub(crate) steps: u64,
    /// Mean derivative of each parameter.
    pub(crate) first: Vec<f32>,
    /// Mean square of each derivative.
    pub(crate) second: Vec<f32>,
}

impl Adam {
    /// The state before the first step, for `len` parameters.
    ///
    /// # Errors
    ///
    /// See [`AdamParams::validate`].
    pub fn new(params: AdamParams, len: usize) -> Result<Self, ParameterError> {
        params.validate()?;
        Ok(Self { params, steps: 0, first: vec![0.0; len], second: vec![0.0; len] })
    }

    /// The state after `steps` steps, to resume from: the parts that [`Adam::moments`] returned.
    ///
    /// # Errors
    ///
    /// See [`AdamParams::validate`].
    ///
    /// # Panics
    ///
    /// If the moments differ in length.
    pub fn resume(
        params: AdamParams,
        steps: u64,
        [first, second]: [Vec<f32>; 2],
    ) -> Result<Self, ParameterError> {
        params.validate()?;
        assert_eq!(first.len(), second.len(), "two moments for each parameter");
        Ok(Self { params, steps, first, second })
    }

    /// Mean and mean square of each derivative.
    pub fn moments(&self) -> [&[f32]; 2] {
        [&self.first, &self.second]
    }

    /// One step of learning rate `rate` down `gradient`.
    ///
    /// # Panics
    ///
    /// If `theta` or `gradient` is not as long as the moments.
    pub fn step(&mut self, theta: &mut [f32], gradient: &[f32], rate: f32) {
        assert!(
            theta.len() == self.first.len() && gradient.len() == theta.len(),
            "one derivative for each parameter"
        );
        self.steps += 1;
        let AdamParams { beta1, beta2, epsilon, sparse } = self.params;
        let t = self.steps.min(i32::MAX as u64) as i32;
        // In f64: 1 − β₂ᵗ has few digits at first.
        let unbias1 = (1.0 / (1.0 - f64::from(beta1).powi(t))) as f32;
        let unbias2 = (1.0 / (1.0 - f64::from(beta2).powi(t))) as f32;
        theta
            .par_chunks_mut(BLOCK)
            .zip(gradient.par_chunks(BLOCK))
            .zip(self.first.par_chunks_mut(BLOCK).zip(self.second.par_chunks_mut(BLOCK)))
            .for_each(|((theta, gradient), (first, second))| {
                for k in 0..theta.len() {
                    let g = gradient[k];
                    if sparse && g == 0.0 {
                        continue;
                    }
                    first[k] = beta1 * first[k] + (1.0 - beta1) * g;
                    second[k] = beta2 * second[k] + (1.0 - beta2) * g * g;
                    theta[k] -=
                        rate * (first[k] * unbias1) / ((second[k] * unbias2).sqrt() + epsilon);
                }
            });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_those_of_the_paper() {
        let params = AdamParams { beta1: 0.9, beta2: 0.999, epsilon: 1e-8, sparse: false };
        let mut adam = Adam::new(params, 2).unwrap();
        let mut theta = [1.0f32, -2.0];
        let (mut m, mut v, mut slow) = ([0.0f64; 2], [0.0f64; 2], [1.0f64, -2.0]);
        for t in 1..=50 {
            let gradient = [2.0 * theta[0], (t as f32).sin()];
            adam.step(&mut theta, &gradient, 0.01);
            for k in 0..2 {
                let g = if k == 0 { 2.0 * slow[0] } else { f64::from((t as f32).sin()) };
                m[k] = 0.9 * m[k] + 0.1 * g;
                v[k] = 0.999 * v[k] + 0.001 * g * g;
                slow[k] -= 0.01 * (m[k] / (1.0 - 0.9f64.powi(t)))
                    / ((v[k] / (1.0 - 0.999f64.powi(t))).sqrt() + 1e-8);
            }
        }
        for k in 0..2 {
            approx::assert_abs_diff_eq!(f64::from(theta[k]), slow[k], epsilon = 1e-4);
        }
    }

    #[test]
    fn parameters_without_a_derivative_stay_unchanged() {
        let mut adam = Adam::new(AdamParams::default(), 3).unwrap();
        let mut theta = [1.0f32; 3];
        adam.step(&mut theta, &[1.0, 1.0, 0.0], 0.1);
        adam.step(&mut theta, &[0.0, 1.0, 0.0], 0.1);
        assert_eq!((theta[2], adam.first[2]), (1.0, 0.0));
        approx::assert_relative_eq!(theta[0], 0.9, epsilon = 1e-6);
        assert!(theta[1] < 0.85);
    }

    #[test]
    fn rates_that_divide_by_zero_are_rejected() {
        let good = AdamParams::default();
        for (bad, name) in [
            (AdamParams { beta1: 1.0, ..good }, "beta1"),
            (AdamParams { beta1: f32::NAN, ..good }, "beta1"),
            (AdamParams { beta2: 1.0, ..good }, "beta2"),
            (AdamParams { beta2: -0.1, ..good }, "beta2"),
            (AdamParams { epsilon: 0.0, ..good }, "epsilon"),
            (AdamParams { epsilon: f32::INFINITY, ..good }, "epsilon"),
        ] {
            assert_eq!(Adam::new(bad, 1).map_err(|e| e.name), Err(name.into()));
        }
        assert_eq!(AdamParams { beta1: 0.0, beta2: 0.0, ..good }.validate(), Ok(()));
    }

    #[test]
    fn a_parabola_is_descended_on_any_number_of_threads() {
        let run = |threads| {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
                let mut theta: Vec<f32> = (0..40_000).map(|k| (k % 7) as f32 - 3.0).collect();
                let mut adam = Adam::new(AdamParams::default(), theta.len()).unwrap();
                for _ in 0..60 {
                    let gradient: Vec<f32> = theta.iter().map(|x| 2.0 * (x - 0.5)).collect();
                    adam.step(&mut theta, &gradient, 0.1);
                }
                theta
            })
        };
        let one = run(1);
        assert!(one == run(3));
        assert!(one.iter().all(|x| (x - 0.5).abs() < 0.6));
    }
}
