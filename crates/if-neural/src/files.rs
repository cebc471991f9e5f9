//! Networks and checkpoints as safetensors files, in PyTorch's names and layout.
//!
//! | network | tensors |
//! | --- | --- |
//! | Appendix E, with weight norm | `lin0.weight_v` (rows × columns), `lin0.weight_g` (rows × 1), `lin0.bias`, `lin1.…` |
//! | Appendix E, folded | `lin0.weight`, `lin0.bias`, `lin1.…` |
//! | grid | `grid.0` (entries × features), …, `hidden.weight`, `hidden.bias`, `out.weight`, `out.bias` |
//! | deformation | `lin0.weight`, `lin0.bias`, …, `embeddings` (frames × length) |
//!
//! The header's metadata hold one entry, `if_neural`: JSON with version, kind, configuration and
//! frame. Readers judge the header first, and then take no more into memory than it says and the
//! file has.

mod checkpoint;
mod tensors;

#[cfg(feature = "train")]
pub use checkpoint::{read_checkpoint, write_checkpoint};

use crate::deformation::DeformationNetwork;
use crate::frame::Frame;
use crate::grid::GridField;
use crate::mlp::{DeformationConfig, Layout, SdfConfig};
use crate::network::{Network, NetworkConfig, NetworkError};
use crate::sdf::SdfNetwork;
use crate::trainable::TrainableField;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};
use tensors::{Named, Tensors};

/// The version that is written. Readers refuse later ones.
pub const VERSION: u32 = 1;

/// Why a file gives no network.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The system does not give the file.
    #[error("cannot read the file: {0}")]
    Io(#[from] io::Error),
    /// The header speaks of more than any network has.
    #[error("the header speaks of a file of more than {limit} bytes; no network is that large")]
    TooLarge {
        /// What is allowed.
        limit: u64,
    },
    /// Not safetensors, cut short, or a header that does not fit the data.
    #[error("not a whole safetensors file ({message}): it was cut short, or is of another format")]
    Header {
        /// What the parser says.
        message: String,
    },
    /// No configuration inside.
    #[error("the file has no metadata `if_neural`; give the configuration, with read_sdf_weights")]
    NoMetadata,
    /// A configuration that cannot be understood.
    #[error("the metadata `if_neural` cannot be understood: {message}")]
    Metadata {
        /// What the parser says.
        message: String,
    },
    /// Written by a later version.
    #[error(
        "the file is of version {found}, this program knows versions up to {VERSION}; update it"
    )]
    Version {
        /// Of the file.
        found: u32,
    },
    /// Of another kind.
    #[error("the file holds a {found}, not a {wanted}")]
    Kind {
        /// What it holds.
        found: String,
        /// What was asked for.
        wanted: &'static str,
    },
    /// A tensor is not there.
    #[error("tensor `{name}` is missing")]
    Missing {
        /// Its name.
        name: String,
    },
    /// A tensor has another shape than the configuration says.
    #[error("tensor `{name}` has the shape {found:?}, the configuration says {expected:?}")]
    Shape {
        /// Its name.
        name: String,
        /// Of the file.
        found: Vec<usize>,
        /// By the configuration.
        expected: Vec<usize>,
    },
    /// A tensor is not of single precision.
    #[error("tensor `{name}` holds {found}; convert it to F32")]
    Type {
        /// Its name.
        name: String,
        /// Its type.
        found: String,
    },
    /// Sizes out of range, or parameters that are no numbers.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// A frame that is none.
    #[error("the frame has the scale {} and the middle {}; both must be finite, the scale above zero", frame.scale, frame.center)]
    Frame {
        /// The frame.
        frame: Frame,
    },
    /// A checkpoint whose parts do not fit together.
    #[error("the checkpoint is at fault: {what}")]
    Checkpoint {
        /// What does not fit.
        what: String,
    },
}

/// How the weights of a network with weight norm are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum WeightNorm {
    /// As it is: gains and directions.
    #[default]
    Kept,
    /// As plain weights, `W = g v / |v|`.
    Folded,
}

/// What the metadata say.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Header {
    version: u32,
    kind: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    network: Option<NetworkConfig>,
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<Frame>,
    #[serde(skip_serializing_if = "Option::is_none")]
    deformation: Option<DeformationConfig>,
    /// α of the annealing; none is all bands.
    #[serde(skip_serializing_if = "Option::is_none")]
    alpha: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    state: Option<serde_json::Value>,
}

impl Header {
    fn new(kind: &str) -> Self {
        let kind = kind.to_owned();
        Self {
            version: VERSION,
            kind,
            network: None,
            frame: None,
            deformation: None,
            alpha: None,
            state: None,
        }
    }
}

/// Writes a network and its frame.
///
/// # Errors
///
/// What the writer says.
pub fn write_network(
    writer: &mut impl Write,
    network: &Network,
    frame: &Frame,
    norm: WeightNorm,
) -> io::Result<()> {
    let mut header = Header::new("network");
    header.frame = Some(*frame);
    header.network = Some(network.config());
    let folded;
    let parts = match network {
        Network::Grid(grid) => grid_parts(grid),
        Network::Sdf(sdf) if norm == WeightNorm::Folded && sdf.config().weight_norm => {
            let config = SdfConfig { weight_norm: false, ..sdf.config().clone() };
            folded = fold(sdf);
            let parts = match config.layout() {
                Ok(layout) => layer_parts(&layout, &folded),
                Err(_) => Vec::new(), // It was a network with these sizes.
            };
            header.network = Some(NetworkConfig::Sdf(config));
            parts
        }
        Network::Sdf(sdf) => layer_parts(sdf.layout(), sdf.parameters()),
    };
    tensors::write(writer, &header, &parts)
}

/// Reads what [`write_network`] wrote.
///
/// # Errors
///
/// See [`ReadError`].
pub fn read_network(reader: impl Read) -> Result<(Network, Frame), ReadError> {
    let tensors = Tensors::read(reader)?;
    let header = tensors.header("network")?;
    network_of(&tensors, &header)
}

fn network_of(tensors: &Tensors, header: &Header) -> Result<(Network, Frame), ReadError> {
    let fault = |what: &str| ReadError::Metadata { message: format!("{what} is missing") };
    let config = header.network.as_ref().ok_or_else(|| fault("`network`"))?;
    let frame = header.frame.ok_or_else(|| fault("`frame`"))?;
    if !frame.is_sound() {
        return Err(ReadError::Frame { frame });
    }
    let theta = match config {
        NetworkConfig::Grid(config) => {
            let mut theta = Vec::new();
            for (name, shape) in GridField::parts_of(config).map_err(NetworkError::from)? {
                tensors.append(&name, &shape, &mut theta)?;
            }
            theta
        }
        NetworkConfig::Sdf(config) => sdf_theta(tensors, config, "")?,
    };
    Ok((Network::with_parameters(config, theta)?, frame))
}

/// Reads the weights of a network of the lineage (SelfRecon, IDR, IGR) from a file without our
/// metadata: `{prefix}lin0.weight_v`, `.weight_g` and `.bias`, PyTorch's newer names
/// `lin0.parametrizations.weight.original1` and `.original0`, or folded `lin0.weight`. Other
/// tensors are passed over.
///
/// # Errors
///
/// See [`ReadError`].
pub fn read_sdf_weights(
    reader: impl Read,
    config: &SdfConfig,
    prefix: &str,
) -> Result<SdfNetwork, ReadError> {
    let tensors = Tensors::read(reader)?;
    let theta = sdf_theta(&tensors, config, prefix)?;
    Ok(SdfNetwork::from_parameters(config, theta).map_err(NetworkError::from)?)
}

/// Writes a deformation.
///
/// # Errors
///
/// What the writer says.
pub fn write_deformation(
    writer: &mut impl Write,
    network: &DeformationNetwork,
    frame: &Frame,
) -> io::Result<()> {
    let mut header = Header::new("deformation");
    header.deformation = Some(network.config().clone());
    header.frame = Some(*frame);
    header.alpha = network.alpha().is_finite().then(|| network.alpha());
    let mut parts = layer_parts(network.layout(), network.parameters());
    let (frames, length) = (network.config().frames, network.config().embedding);
    let data = &network.parameters()[network.layout().parameters..];
    parts.push(Named { name: "embeddings".into(), shape: vec![frames, length], data });
    tensors::write(writer, &header, &parts)
}

/// Reads what [`write_deformation`] wrote.
///
/// # Errors
///
/// See [`ReadError`].
pub fn read_deformation(reader: impl Read) -> Result<(DeformationNetwork, Frame), ReadError> {
    let tensors = Tensors::read(reader)?;
    let header = tensors.header("deformation")?;
    let fault = |what: &str| ReadError::Metadata { message: format!("{what} is missing") };
    let config = header.deformation.as_ref().ok_or_else(|| fault("`deformation`"))?;
    let frame = header.frame.ok_or_else(|| fault("`frame`"))?;
    if !frame.is_sound() {
        return Err(ReadError::Frame { frame });
    }
    let layout = config.layout().map_err(NetworkError::from)?;
    let mut theta = Vec::new();
    for (l, layer) in layout.layers.iter().enumerate() {
        tensors.append(&format!("lin{l}.weight"), &[layer.rows, layer.columns], &mut theta)?;
        tensors.append(&format!("lin{l}.bias"), &[layer.rows], &mut theta)?;
    }
    tensors.append("embeddings", &[config.frames, config.embedding], &mut theta)?;
    let mut network =
        DeformationNetwork::from_parameters(config, theta).map_err(NetworkError::from)?;
    if let Some(alpha) = header.alpha {
        network.set_alpha(alpha);
    }
    Ok((network, frame))
}

fn grid_parts(grid: &GridField) -> Vec<Named<'_>> {
    let mut rest = grid.parameters();
    let named = |(name, shape): (String, Vec<usize>)| {
        let (data, after) = rest.split_at(shape.iter().product());
        rest = after;
        Named { name, shape, data }
    };
    grid.parts().into_iter().map(named).collect()
}

fn layer_parts<'a>(layout: &Layout, theta: &'a [f32]) -> Vec<Named<'a>> {
    let mut parts = Vec::new();
    for (l, layer) in layout.layers.iter().enumerate() {
        let mut add = |what: &str, shape: Vec<usize>, range: std::ops::Range<usize>| {
            parts.push(Named { name: format!("lin{l}.{what}"), shape, data: &theta[range] });
        };
        add(
            if layer.gain.is_some() { "weight_v" } else { "weight" },
            vec![layer.rows, layer.columns],
            layer.weight.clone(),
        );
        add("bias", vec![layer.rows], layer.bias.clone());
        if let Some(gain) = &layer.gain {
            add("weight_g", vec![layer.rows, 1], gain.clone());
        }
    }
    parts
}

/// θ of the same network without weight norm.
fn fold(sdf: &SdfNetwork) -> Vec<f32> {
    let theta = sdf.parameters();
    let mut out = Vec::new();
    for layer in &sdf.layout().layers {
        let rows = theta[layer.weight.clone()].chunks_exact(layer.columns);
        for (r, row) in rows.enumerate() {
            let scale =
                layer.gain.as_ref().map_or(1.0, |gain| gain_by_length(theta[gain.start + r], row));
            out.extend(row.iter().map(|v| (f64::from(*v) * scale) as f32));
        }
        out.extend_from_slice(&theta[layer.bias.clone()]);
    }
    out
}

/// g / |v|. A row of zeros has no direction: it stays zero, whatever its gain.
fn gain_by_length(gain: f32, row: &[f32]) -> f64 {
    let norm = norm(row);
    if norm > 0.0 { f64::from(gain) / norm } else { 0.0 }
}

fn norm(row: &[f32]) -> f64 {
    row.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt()
}

/// θ in the order of the layout: weight, bias and gain of each layer.
fn sdf_theta(tensors: &Tensors, config: &SdfConfig, prefix: &str) -> Result<Vec<f32>, ReadError> {
    let layout = config.layout().map_err(NetworkError::from)?;
    let mut theta = Vec::new();
    for (l, layer) in layout.layers.iter().enumerate() {
        let name = |what: &str| format!("{prefix}lin{l}.{what}");
        let weight = [layer.rows, layer.columns];
        let pairs = [
            ["weight_v", "weight_g"],
            ["parametrizations.weight.original1", "parametrizations.weight.original0"],
        ];
        let normed = pairs.iter().map(|pair| pair.map(&name)).find(|pair| tensors.has(&pair[0]));
        let bias = |theta: &mut Vec<f32>| tensors.append(&name("bias"), &[layer.rows], theta);
        match (&layer.gain, normed) {
            (Some(_), Some([v, g])) => {
                tensors.append(&v, &weight, &mut theta)?;
                bias(&mut theta)?;
                tensors.append(&g, &[layer.rows, 1], &mut theta)?;
            }
            // A folded file for a network with weight norm: g = |v|.
            (Some(_), None) => {
                let first = theta.len();
                tensors.append(&name("weight"), &weight, &mut theta)?;
                let gains: Vec<f32> = theta[first..]
                    .chunks_exact(layer.columns)
                    .map(|row| norm(row) as f32)
                    .collect();
                bias(&mut theta)?;
                theta.extend(gains);
            }
            // And the other way round.
            (None, Some([v, g])) => {
                let first = theta.len();
                tensors.append(&v, &weight, &mut theta)?;
                let mut gains = Vec::new();
                tensors.append(&g, &[layer.rows, 1], &mut gains)?;
                for (row, gain) in theta[first..].chunks_exact_mut(layer.columns).zip(gains) {
                    let scale = gain_by_length(gain, row);
                    row.iter_mut().for_each(|w| *w = (f64::from(*w) * scale) as f32);
                }
                bias(&mut theta)?;
            }
            (None, None) => {
                tensors.append(&name("weight"), &weight, &mut theta)?;
                bias(&mut theta)?;
            }
        }
    }
    Ok(theta)
}

#[cfg(test)]
mod tests;
