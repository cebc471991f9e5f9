//! φ of the clothed person, as a network.

use super::error::ReconstructError;
use super::progress::{control, report};
use if_core::field::SignedDistance;
use if_core::math::Real;
use if_core::monitor::{Monitor, Progress};
use if_core::parameter::ParameterError;
use if_neural::Ended;
use if_neural::field::NeuralField;
use if_neural::files::{WeightNorm, write_network};
use if_neural::fit::{Fit, FitParams};
use if_neural::frame::Frame;
use if_neural::grid::GridConfig;
use if_neural::network::{Network, NetworkConfig};
use if_neural::sampling::SamplingParams;
use if_neural::target::Target;
use serde::{Deserialize, Serialize};
use std::io;

/// Parameters of [`fit_phi`]. The fit has a fixed number of steps, not of seconds, so that the same
/// capture gives the same bits.
#[derive(Clone, Debug, PartialEq)]
pub struct PhiParams {
    /// The network.
    pub network: NetworkConfig,
    /// Steps of the fit.
    pub steps: u64,
    /// Sampling of the training points.
    pub sampling: SamplingParams,
}

/// Entries of a level of the grids of clothed people: files of 3 MB instead of 9, off by a fifth
/// more (docs/evidence/reconstruction.md).
pub(super) const TABLE: u32 = 1 << 18;

impl Default for PhiParams {
    /// The grid encoding and 150 steps: it is initialised with the field's values, which the steps
    /// refine.
    fn default() -> Self {
        let grid = GridConfig { table: TABLE, ..GridConfig::default() };
        Self { network: NetworkConfig::Grid(grid), steps: 150, sampling: SamplingParams::default() }
    }
}

impl PhiParams {
    /// Checks the ranges; the sizes of the network are checked when it is created.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.sampling.validate().map_err(|e| e.within("sampling"))?;
        FitParams { steps: Some(self.steps), seconds: None, ..self.network.fit_params() }.validate()
    }
}

/// φ as a network, and its errors.
#[derive(Clone, Debug)]
pub struct PhiNetwork {
    /// The network.
    pub network: Network,
    /// The map from metres to the network's unit cube.
    pub frame: Frame,
    /// Its errors.
    pub report: PhiReport,
}

/// Errors of φ's network at held-out points near the surface.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PhiReport {
    /// Steps of the fit.
    pub steps: u64,
    /// Mean error in millimetres.
    pub mean_mm: Real,
    /// 99th percentile of the error, in millimetres.
    pub p99_mm: Real,
    /// Mean of | |∇φ| − 1 |.
    pub eikonal: Real,
}

/// Fits a network to `field`, a signed distance in metres with bounds.
///
/// # Errors
///
/// [`ReconstructError`], such as a network of invalid sizes.
pub fn fit_phi(
    field: &dyn SignedDistance,
    params: &PhiParams,
    monitor: &mut dyn Monitor,
) -> Result<PhiNetwork, ReconstructError> {
    let steps = params.steps as usize;
    report(monitor, "phi", (0, steps), None)?;
    let target = Target::Field(field);
    let (set, mut network) = target.begin(&params.network, &params.sampling)?;
    let fit = FitParams {
        steps: Some(params.steps),
        seconds: None,
        loss: target.loss(),
        ..params.network.fit_params()
    };
    let mut progress = |p: &Progress<'_>| {
        let mean = p.measure("error").map(|metres| ("mean_mm", 1e3 * metres));
        control(report(monitor, "phi", (p.done, steps), mean))
    };
    let found = Fit::new(fit)?.run(&mut network, &set, &mut progress)?;
    if found.ended == Ended::Diverged {
        return Err(ReconstructError::NetworkDiverged { steps: found.steps });
    }
    let (e, frame) = (&found.error, set.frame);
    let errors = PhiReport {
        steps: found.steps,
        mean_mm: 1e3 * e.mean,
        p99_mm: 1e3 * e.p99,
        eikonal: e.eikonal,
    };
    Ok(PhiNetwork { network, frame, report: errors })
}

impl PhiNetwork {
    /// The bytes of its file, `phi.safetensors` of an asset; [`if_neural::files::read_network`]
    /// reads them.
    ///
    /// # Errors
    ///
    /// None, unless memory is exhausted.
    pub fn to_bytes(&self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        write_network(&mut bytes, &self.network, &self.frame, WeightNorm::Kept)?;
        Ok(bytes)
    }

    /// The network as a field in metres.
    ///
    /// # Errors
    ///
    /// The network returns values that are not finite.
    pub fn field(&self) -> Result<NeuralField<Network>, if_neural::field::FieldError> {
        NeuralField::new(self.network.clone(), self.frame)
    }
}
