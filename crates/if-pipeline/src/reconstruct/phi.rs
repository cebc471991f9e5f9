//! φ of the clothed person as a network.

use super::progress::{Clock, Progress, Stage};
use if_core::field::SignedDistance;
use if_core::math::Real;
use if_neural::field::NeuralField;
use if_neural::files::{WeightNorm, write_network};
use if_neural::fit::{Ended, Fit, FitError, FitParams};
use if_neural::frame::Frame;
use if_neural::network::{Network, NetworkConfig};
use if_neural::sampling::SamplingParams;
use if_neural::target::{BeginError, Target};
use serde::{Deserialize, Serialize};
use std::io;
use std::ops::ControlFlow;

/// How φ is fitted. By steps and not by the clock, so that the same capture gives the same bits.
#[derive(Clone, Debug, PartialEq)]
pub struct PhiParams {
    /// The network.
    pub network: NetworkConfig,
    /// Steps of the fit.
    pub steps: u64,
    /// Points it is fitted at.
    pub sampling: SamplingParams,
}

impl Default for PhiParams {
    /// The grid encoding and 150 steps: its first values are the field's own, and steps correct
    /// them (docs/reconstruction.md says by how much).
    fn default() -> Self {
        Self { network: NetworkConfig::grid(), steps: 150, sampling: SamplingParams::default() }
    }
}

impl PhiParams {
    /// Whether all parameters are in range; sizes of the network are looked at when it is made.
    ///
    /// # Errors
    ///
    /// The first that is not.
    pub fn validate(&self) -> Result<(), PhiError> {
        self.sampling.validate().map_err(BeginError::from)?;
        Ok(FitParams { steps: Some(self.steps), seconds: None, ..self.network.fit_params() }
            .validate()?)
    }
}

/// φ as a network, with what it is off.
#[derive(Clone, Debug)]
pub struct PhiNetwork {
    /// The network.
    pub network: Network,
    /// Metres to its cube and back.
    pub frame: Frame,
    /// Its errors.
    pub report: PhiReport,
}

/// Errors of φ's network at held-out points beside the surface it was fitted to.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PhiReport {
    /// Steps done.
    pub steps: u64,
    /// Mean error in millimetres.
    pub mean_mm: Real,
    /// 99th percentile of the error, in millimetres.
    pub p99_mm: Real,
    /// Mean of | |∇φ| − 1 |.
    pub eikonal: Real,
}

/// Why φ cannot be fitted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PhiError {
    /// No training points, or a network of sizes out of range.
    #[error(transparent)]
    Begin(#[from] BeginError),
    /// Parameters of the fit.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// `watch` asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// Fits a network to `field`, a signed distance in metres with bounds.
///
/// # Errors
///
/// [`PhiError`].
pub fn fit_phi(
    field: &dyn SignedDistance,
    params: &PhiParams,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<PhiNetwork, PhiError> {
    let mut clock = Clock::new();
    let steps = params.steps as usize;
    if watch(&clock.at(Stage::Field, 0, steps, None)).is_break() {
        return Err(PhiError::Cancelled);
    }
    let target = Target::Field(field);
    let (set, mut network) = target.begin(&params.network, &params.sampling)?;
    let fit = FitParams {
        steps: Some(params.steps),
        seconds: None,
        loss: target.loss(),
        ..params.network.fit_params()
    };
    let found = Fit::new(fit)?.run(&mut network, &set, &mut |p| {
        watch(&clock.at(Stage::Field, p.step as usize, steps, Some(1e3 * p.error.mean)))
    })?;
    if found.ended == Ended::Cancelled {
        return Err(PhiError::Cancelled);
    }
    let (e, frame) = (&found.error, set.frame);
    let report = PhiReport {
        steps: found.steps,
        mean_mm: 1e3 * e.mean,
        p99_mm: 1e3 * e.p99,
        eikonal: e.eikonal,
    };
    Ok(PhiNetwork { network, frame, report })
}

impl PhiNetwork {
    /// The bytes of its file, `phi.safetensors` of an asset; [`if_neural::files::read_network`]
    /// reads them.
    ///
    /// # Errors
    ///
    /// None while memory lasts.
    pub fn to_bytes(&self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        write_network(&mut bytes, &self.network, &self.frame, WeightNorm::Kept)?;
        Ok(bytes)
    }

    /// As a field in metres.
    ///
    /// # Errors
    ///
    /// A network that gives no numbers.
    pub fn field(&self) -> Result<NeuralField<Network>, if_neural::field::FieldError> {
        NeuralField::new(self.network.clone(), self.frame)
    }
}
