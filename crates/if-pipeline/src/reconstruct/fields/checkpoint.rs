//! Checkpoints of the training: its state between two rounds, in a file.

use super::nets::Nets;
use super::report::FieldsReport;
use super::state::State;
use crate::reconstruct::error::ReconstructError;
use crate::reconstruct::sealed::{self, Key, Magic};
use if_core::math::{Point, Real};
use if_neural::adam::{Adam, AdamParams};
use if_neural::deformation::DeformationNetwork;
use if_neural::frame::Frame;
use if_neural::mlp::DeformationConfig;
use if_neural::network::{Network, NetworkConfig};
use if_neural::trainable::TrainableField;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The first bytes of the file.
const MAGIC: &Magic = b"ifg fields v1\n\0\0";

/// What stands before the numbers.
#[derive(Serialize, Deserialize)]
struct Header {
    step: u64,
    frame: Frame,
    phi: NetworkConfig,
    deformation: DeformationConfig,
    vertices: usize,
    report: FieldsReport,
}

/// Writes the file atomically.
pub(super) fn write(state: &State, path: &Path, key: &Key) -> Result<(), ReconstructError> {
    let header = Header {
        step: state.step,
        frame: state.nets.frame,
        phi: state.nets.phi.config(),
        deformation: state.nets.deformation.config().clone(),
        vertices: state.vertices.len(),
        report: state.report.clone(),
    };
    let header = serde_json::to_vec(&header)
        .map_err(|e| ReconstructError::Checkpoint { path: path.into(), source: e.into() })?;
    let mut bytes = Vec::new();
    bytes.extend_from_slice(&(header.len() as u64).to_le_bytes());
    bytes.extend_from_slice(&header);
    let [phi_first, phi_second] = state.phi_adam.moments();
    let [d_first, d_second] = state.deformation_adam.moments();
    let (phi, deformation) = (state.nets.phi.parameters(), state.nets.deformation.parameters());
    for part in
        [phi, state.start.parameters(), phi_first, phi_second, deformation, d_first, d_second]
    {
        part.iter().for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
    }
    let coordinates = state.vertices.iter().flat_map(|p| p.iter());
    coordinates.for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
    sealed::write(path, (MAGIC, key), &bytes)
}

/// Reads the file; `None` if it is missing, of other input, or of more than `most` steps. The
/// optimisers have the given rates.
pub(super) fn read(
    path: &Path,
    key: &Key,
    most: u64,
    rates: [AdamParams; 2],
) -> Result<Option<State>, ReconstructError> {
    let state = sealed::read(path, (MAGIC, key), |body| parse(body, rates))?;
    Ok(state.filter(|state| state.step <= most))
}

fn parse(body: &[u8], rates: [AdamParams; 2]) -> Option<State> {
    let (length, rest) = body.split_at_checked(8)?;
    let length = usize::try_from(u64::from_le_bytes(length.try_into().ok()?)).ok()?;
    let (header, rest) = rest.split_at_checked(length)?;
    let header: Header = serde_json::from_slice(header).ok()?;
    header.frame.validate().ok()?;
    // The lengths of the networks' parameters follow from their sizes.
    let start = Network::new(&header.phi, 0).ok()?;
    let deformation = DeformationNetwork::new(&header.deformation, 0).ok()?;
    let (n, m) = (start.parameters().len(), deformation.parameters().len());
    let numbers = n.checked_mul(4)?.checked_add(m.checked_mul(3)?)?;
    let (floats, rest) = rest.split_at_checked(numbers.checked_mul(4)?)?;
    if rest.len() != header.vertices.checked_mul(24)? {
        return None;
    }
    let float = |c: &[u8]| f32::from_le_bytes(c.try_into().expect("four bytes"));
    let floats: Vec<f32> = floats.chunks_exact(4).map(float).collect();
    let mut at = 0;
    let mut part = |length: usize| {
        at += length;
        floats[at - length..at].to_vec()
    };
    let phi = Network::with_parameters(&header.phi, part(n)).ok()?;
    let start = Network::with_parameters(&header.phi, part(n)).ok()?;
    let phi_adam = Adam::resume(rates[0], header.step, [part(n), part(n)]).ok()?;
    let deformation = DeformationNetwork::from_parameters(&header.deformation, part(m)).ok()?;
    let deformation_adam = Adam::resume(rates[1], header.step, [part(m), part(m)]).ok()?;
    let real = |c: &[u8]| Real::from_le_bytes(c.try_into().expect("eight bytes"));
    let coordinates: Vec<Real> = rest.chunks_exact(8).map(real).collect();
    let vertices = coordinates.chunks_exact(3).map(|p| Point::new(p[0], p[1], p[2])).collect();
    let nets = Nets { phi, deformation, frame: header.frame };
    let (step, report) = (header.step, header.report);
    Some(State { step, nets, start, phi_adam, deformation_adam, vertices, report })
}
