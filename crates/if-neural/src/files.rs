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
//! frame. Readers check the header first, and read no more than it announces and the file has.

mod checkpoint;
mod tensors;
mod weights;

#[cfg(feature = "train")]
pub use checkpoint::{read_checkpoint, write_checkpoint};

use crate::deformation::DeformationNetwork;
use crate::error::NetworkError;
use crate::frame::Frame;
use crate::grid::GridField;
use crate::mlp::{DeformationConfig, Layout, SdfConfig};
use crate::network::{Network, NetworkConfig};
use crate::sdf::SdfNetwork;
use crate::trainable::TrainableField;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};
use tensors::{Named, Tensors};
use weights::{fold, sdf_theta};

/// The version that is written. Readers reject later ones.
const VERSION: u32 = 1;

/// A file cannot be read as a network.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The system cannot read the file.
    #[error("cannot read the file: {0}")]
    Io(#[from] io::Error),
    /// The header announces more bytes than any network has.
    #[error("the header announces more than {limit} bytes; no network is that large")]
    TooLarge {
        /// The limit, in bytes.
        limit: u64,
    },
    /// Not safetensors, cut short, or a header that does not fit the data.
    #[error("not a whole safetensors file ({message}): it was cut short, or is of another format")]
    Header {
        /// Message of the parser.
        message: String,
    },
    /// The configuration is missing.
    #[error("the file has no metadata `if_neural`; give the configuration, with read_sdf_weights")]
    NoMetadata,
    /// The configuration is invalid.
    #[error("the metadata `if_neural` is invalid: {message}")]
    Metadata {
        /// Message of the parser.
        message: String,
    },
    /// Written by a later version.
    #[error(
        "the file is of version {found}, this program knows versions up to {VERSION}; update it"
    )]
    Version {
        /// Version of the file.
        found: u32,
    },
    /// The file is of another kind.
    #[error("the file holds a {found}, not a {wanted}")]
    Kind {
        /// Kind of the file.
        found: String,
        /// Kind expected.
        wanted: &'static str,
    },
    /// A tensor is missing.
    #[error("tensor `{name}` is missing")]
    Missing {
        /// Its name.
        name: String,
    },
    /// The shape of a tensor does not match the configuration.
    #[error("tensor `{name}` has the shape {found:?}; the configuration needs {expected:?}")]
    Shape {
        /// Its name.
        name: String,
        /// Version of the file.
        found: Vec<usize>,
        /// Shape of the configuration.
        expected: Vec<usize>,
    },
    /// A tensor is not in single precision.
    #[error("tensor `{name}` holds {found}; convert it to F32")]
    Type {
        /// Its name.
        name: String,
        /// Its type.
        found: String,
    },
    /// A size of the network or a number of the frame is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The parameters do not match the configuration, or are not finite.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The parts of a checkpoint do not match.
    #[error("the checkpoint is invalid: {what}")]
    Checkpoint {
        /// What does not match.
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

/// The metadata.
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
    /// α of the annealing; `None` is all bands.
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
/// Errors of the writer.
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
                Err(_) => Vec::new(), // unreachable: the network has these sizes
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
    frame.validate()?;
    let theta = match config {
        NetworkConfig::Grid(config) => {
            let mut theta = Vec::new();
            for (name, shape) in GridField::parts_of(config)? {
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
    Ok(SdfNetwork::from_parameters(config, theta)?)
}

/// Writes a deformation.
///
/// # Errors
///
/// Errors of the writer.
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
    frame.validate()?;
    let layout = config.layout()?;
    let mut theta = Vec::new();
    for (l, layer) in layout.layers.iter().enumerate() {
        tensors.append(&format!("lin{l}.weight"), &[layer.rows, layer.columns], &mut theta)?;
        tensors.append(&format!("lin{l}.bias"), &[layer.rows], &mut theta)?;
    }
    tensors.append("embeddings", &[config.frames, config.embedding], &mut theta)?;
    let mut network = DeformationNetwork::from_parameters(config, theta)?;
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

#[cfg(test)]
mod tests;
