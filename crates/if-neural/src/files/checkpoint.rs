//! A cancelled fit in a file.

#![cfg(feature = "train")]

use super::tensors::{self, Named, Tensors};
use super::{Header, ReadError, grid_parts, layer_parts, network_of};
use crate::adam::Adam;
use crate::fit::{Fit, FitParams};
use crate::frame::Frame;
use crate::network::Network;
use crate::trainable::TrainableField;
use crate::training::Best;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};

/// Largest valid number of steps: months of them, and times the largest batch still a number of
/// points.
const MOST_STEPS: u64 = 1 << 39;

#[derive(Serialize, Deserialize)]
struct State {
    params: FitParams,
    step: u64,
    seconds: f64,
    adam_steps: Option<u64>,
    best_step: Option<u64>,
    best_mean: Option<f64>,
    missed: Option<u64>,
    /// Missing in files of earlier versions: their fits go on with any target.
    means: Option<[f64; 7]>,
}

/// Writes a fit and its network, as [`Fit::run`] leaves them when the monitor cancels.
///
/// # Errors
///
/// Errors of the writer.
pub fn write_checkpoint(
    writer: &mut impl Write,
    fit: &Fit,
    network: &Network,
    frame: &Frame,
) -> io::Result<()> {
    let mut header = Header::new("checkpoint");
    header.network = Some(network.config());
    header.frame = Some(*frame);
    let state = State {
        params: fit.params,
        step: fit.training.step,
        seconds: fit.training.seconds,
        adam_steps: fit.training.adam.as_ref().map(|a| a.steps),
        best_step: fit.training.best.as_ref().map(|b| b.step),
        best_mean: fit.training.best.as_ref().map(|b| b.mean),
        missed: fit.missed,
        means: fit.means,
    };
    header.state = Some(serde_json::to_value(state)?);
    let mut parts = match network {
        Network::Grid(grid) => grid_parts(grid),
        Network::Sdf(sdf) => layer_parts(sdf.layout(), sdf.parameters()),
    };
    let mut add = |name: &str, data| {
        parts.push(Named { name: name.to_owned(), shape: vec![network.parameters().len()], data })
    };
    if let Some(adam) = &fit.training.adam {
        add("adam.first", adam.first.as_slice());
        add("adam.second", adam.second.as_slice());
    }
    if let Some(best) = &fit.training.best {
        add("best", best.theta.as_slice());
    }
    tensors::write(writer, &header, &parts)
}

/// Reads what [`write_checkpoint`] wrote. The training set is made anew, from the same target and
/// parameters.
///
/// # Errors
///
/// See [`ReadError`].
pub fn read_checkpoint(reader: impl Read) -> Result<(Fit, Network, Frame), ReadError> {
    let tensors = Tensors::read(reader)?;
    let header = tensors.header("checkpoint")?;
    let (network, frame) = network_of(&tensors, &header)?;
    let fault = |what: String| ReadError::Checkpoint { what };
    let state: State =
        serde_json::from_value(header.state.ok_or_else(|| fault("the state is missing".into()))?)
            .map_err(|e| fault(format!("the state is invalid: {e}")))?;
    let mut fit = Fit::new(state.params).map_err(|e| fault(e.to_string()))?;
    if !(state.seconds >= 0.0 && state.seconds.is_finite()) {
        return Err(fault(format!("it took {} seconds", state.seconds)));
    }
    if state.step > MOST_STEPS {
        return Err(fault(format!(
            "it has done {} steps; none does more than {MOST_STEPS}",
            state.step
        )));
    }
    let steps = [
        ("evaluated all held-out points at", state.missed),
        ("was best at", state.best_step),
        ("moved its parameters up to", state.adam_steps),
    ];
    if let Some((what, Some(step))) =
        steps.into_iter().find(|(_, step)| step.is_some_and(|s| s > state.step))
    {
        return Err(fault(format!("it {what} step {step} and has done {}", state.step)));
    }
    if let Some(mean) = state.best_mean.filter(|m| !(*m >= 0.0 && m.is_finite())) {
        return Err(fault(format!("its least error is {mean} m")));
    }
    if let Some(mean) = state.means.into_iter().flatten().find(|m| !m.is_finite()) {
        return Err(fault(format!("a mean of its held-out points is {mean}")));
    }
    (fit.training.step, fit.training.seconds, fit.missed, fit.means) =
        (state.step, state.seconds, state.missed, state.means);
    let len = network.parameters().len();
    let array = |name: &str| -> Result<Vec<f32>, ReadError> {
        let mut data = Vec::new();
        tensors.append(name, &[len], &mut data)?;
        match data.iter().position(|v| !v.is_finite()) {
            Some(k) => Err(fault(format!("`{name}` is {} at {k}", data[k]))),
            None => Ok(data),
        }
    };
    if let Some(steps) = state.adam_steps {
        let (first, second) = (array("adam.first")?, array("adam.second")?);
        if let Some(k) = second.iter().position(|v| *v < 0.0) {
            return Err(fault(format!(
                "`adam.second` is {} at {k}, and a mean of squares",
                second[k]
            )));
        }
        fit.training.adam = Some(Adam { params: state.params.adam, steps, first, second });
    }
    fit.training.best = match (state.best_step, state.best_mean) {
        (Some(step), Some(mean)) => Some(Best { step, mean, theta: array("best")? }),
        (None, None) => None,
        (step, mean) => {
            return Err(fault(format!(
                "its best step is {step:?}, the error there {mean:?}: both, or none"
            )));
        }
    };
    Ok((fit, network, frame))
}
