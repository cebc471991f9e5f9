//! The shapes of the two networks: what is a parameter, the presets, and where θ keeps what.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::encoding::PositionalEncoding;

/// Shape of the canonical field φ: encoding → `layers` × `width`, softplus → distance and features.
///
/// At layer `skip` the input is `concat(h, encoding)/√2`, and the layer before it has so many
/// outputs less.
///
/// # Source
///
/// Supplement, Appendix E and Figure 5, which gives no numbers: the presets are the lineage's
/// (SelfRecon, IDR, IGR).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SdfConfig {
    /// Bands of the positional encoding, 0 to [`MAX_BANDS`].
    pub bands: usize,
    /// Outputs of a hidden layer.
    pub width: usize,
    /// Count of hidden layers.
    pub layers: usize,
    /// The layer whose input is joined with the encoding: from 1 to `layers − 1`.
    pub skip: Option<usize>,
    /// β of the activation `softplus(βz)/β`: the larger, the closer to a ReLU.
    pub beta: f32,
    /// Outputs beside the distance, for a colour network.
    pub features: usize,
    /// Whether each row of each weight matrix is `gain · v/|v|`.
    pub weight_norm: bool,
    /// Radius of the sphere that the initial field is close to, in the unit of the points.
    pub radius: f32,
}

impl SdfConfig {
    /// The paper's: 8 × 512, skip at 4, β = 100, 256 features; 1,970,906 weights and biases and
    /// 4,314 gains.
    pub const fn paper() -> Self {
        SdfConfig {
            bands: 6,
            width: 512,
            layers: 8,
            skip: Some(4),
            beta: 100.0,
            features: 256,
            weight_norm: true,
            radius: 0.6,
        }
    }

    /// The same 256 wide: 526,810 weights and biases, a quarter of the time.
    pub const fn fast() -> Self {
        SdfConfig { width: 256, ..SdfConfig::paper() }
    }

    /// The encoding of the input.
    pub const fn encoding(&self) -> PositionalEncoding {
        PositionalEncoding { bands: self.bands }
    }

    /// Where θ keeps each linear layer, hidden ones first.
    ///
    /// # Errors
    ///
    /// [`ConfigError`], for a shape that cannot be built.
    pub fn layout(&self) -> Result<Layout, ConfigError> {
        let encoded = checked_width(self.bands, self.width, self.layers)?;
        if let Some(skip) = self.skip {
            if skip == 0 || skip >= self.layers {
                return Err(ConfigError::Skip { skip, layers: self.layers });
            }
            if self.width <= encoded {
                return Err(ConfigError::SkipWidth { width: self.width, encoded });
            }
        }
        bounded("features", self.features, 0, MAX_WIDTH)?;
        positive("beta", self.beta)?;
        positive("radius", self.radius)?;
        let mut shapes = Vec::with_capacity(self.layers + 1);
        for layer in 0..=self.layers {
            let columns = if layer == 0 { encoded } else { self.width };
            let rows = if layer == self.layers {
                1 + self.features
            } else if self.skip == Some(layer + 1) {
                self.width - encoded
            } else {
                self.width
            };
            shapes.push((rows, columns));
        }
        Ok(Layout::new(&shapes, self.weight_norm))
    }
}

/// Shape of the deformation d: concat(encoding, embedding) → `layers` × `width`, ReLU → an offset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeformationConfig {
    /// Bands of the positional encoding, 0 to [`MAX_BANDS`].
    pub bands: usize,
    /// Length of a frame's embedding.
    pub embedding: usize,
    /// Count of frames.
    pub frames: usize,
    /// Outputs of a hidden layer.
    pub width: usize,
    /// Count of hidden layers.
    pub layers: usize,
}

impl DeformationConfig {
    /// The paper's: 4 × 512 with embeddings of 128; 875,523 parameters beside the embeddings.
    pub const fn paper(frames: usize) -> Self {
        DeformationConfig { bands: 6, embedding: 128, frames, width: 512, layers: 4 }
    }

    /// The same 128 wide with embeddings of 32, for CPU fits.
    pub const fn fast(frames: usize) -> Self {
        DeformationConfig { width: 128, embedding: 32, ..DeformationConfig::paper(frames) }
    }

    /// The encoding of the point.
    pub const fn encoding(&self) -> PositionalEncoding {
        PositionalEncoding { bands: self.bands }
    }

    /// Where θ keeps each linear layer; the embeddings stand behind them, frame by frame.
    ///
    /// # Errors
    ///
    /// [`ConfigError`], for a shape that cannot be built.
    pub fn layout(&self) -> Result<Layout, ConfigError> {
        let encoded = checked_width(self.bands, self.width, self.layers)?;
        bounded("embedding", self.embedding, 0, MAX_WIDTH)?;
        bounded("frames", self.frames, 1, MAX_FRAMES)?;
        let mut shapes = Vec::with_capacity(self.layers + 1);
        for layer in 0..=self.layers {
            let columns = if layer == 0 { encoded + self.embedding } else { self.width };
            shapes.push((if layer == self.layers { 3 } else { self.width }, columns));
        }
        Ok(Layout::new(&shapes, false))
    }
}

/// Most bands of an encoding: 2¹⁶ turns per metre resolve 15 µm, below what f32 points hold.
pub const MAX_BANDS: usize = 16;
/// Widest layer: its matrix has 64 MiB.
pub const MAX_WIDTH: usize = 4096;
/// Most hidden layers.
pub const MAX_LAYERS: usize = 64;
/// Most frames of a deformation.
pub const MAX_FRAMES: usize = 1 << 20;

fn checked_width(bands: usize, width: usize, layers: usize) -> Result<usize, ConfigError> {
    bounded("bands", bands, 0, MAX_BANDS)?;
    bounded("width", width, 1, MAX_WIDTH)?;
    bounded("layers", layers, 1, MAX_LAYERS)?;
    Ok(PositionalEncoding { bands }.width())
}

fn bounded(name: &'static str, value: usize, least: usize, most: usize) -> Result<(), ConfigError> {
    if (least..=most).contains(&value) {
        Ok(())
    } else {
        Err(ConfigError::Size { name, value, least, most })
    }
}

fn positive(name: &'static str, value: f32) -> Result<(), ConfigError> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(ConfigError::Number { name, value }) }
}

/// Why a network cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// A count is out of its range.
    #[error("{name} = {value}: choose {least} to {most}")]
    Size {
        /// The field of the config.
        name: &'static str,
        /// What it holds.
        value: usize,
        /// Least value.
        least: usize,
        /// Greatest value.
        most: usize,
    },
    /// A number is not finite and positive.
    #[error("{name} = {value}: it must be finite and above zero")]
    Number {
        /// The field of the config.
        name: &'static str,
        /// What it holds.
        value: f32,
    },
    /// The skip joins no layer.
    #[error("skip = {skip} with {layers} hidden layers: choose 1 to layers − 1, or none")]
    Skip {
        /// The layer named.
        skip: usize,
        /// Count of hidden layers.
        layers: usize,
    },
    /// The joined layer has no room for the encoding.
    #[error("a skip needs width > {encoded}, the encoding's features; it is {width}")]
    SkipWidth {
        /// Outputs of a hidden layer.
        width: usize,
        /// Features of the encoding.
        encoded: usize,
    },
    /// θ has another length than the shape asks for.
    #[error("{found} parameters where the shape asks for {expected}")]
    Parameters {
        /// Length that the shape asks for.
        expected: usize,
        /// Length given.
        found: usize,
    },
    /// θ holds a number that is not finite.
    #[error("parameter {index} is {value}: the weights are spoilt")]
    NotFinite {
        /// Its index in θ.
        index: usize,
        /// What stands there.
        value: f32,
    },
}

/// Where θ keeps the linear layers of a network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The layers in order.
    pub layers: Vec<LayerLayout>,
    /// Length of θ that the layers take.
    pub parameters: usize,
}

/// Where θ keeps one linear layer `z = W a + b`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LayerLayout {
    /// Outputs.
    pub rows: usize,
    /// Inputs.
    pub columns: usize,
    /// W (with weight norm: v), row by row, as PyTorch's `weight` (`weight_v`).
    pub weight: Range<usize>,
    /// b.
    pub bias: Range<usize>,
    /// With weight norm the gain of each row, PyTorch's `weight_g`: W = gain · v/|v|.
    pub gain: Option<Range<usize>>,
}

impl Layout {
    fn new(shapes: &[(usize, usize)], weight_norm: bool) -> Self {
        let mut end = 0;
        let mut take = |count: usize| {
            end += count;
            end - count..end
        };
        let layers = shapes
            .iter()
            .map(|&(rows, columns)| LayerLayout {
                rows,
                columns,
                weight: take(rows * columns),
                bias: take(rows),
                gain: weight_norm.then(|| take(rows)),
            })
            .collect();
        Layout { layers, parameters: end }
    }

    /// Count of gains.
    pub fn gains(&self) -> usize {
        self.layers.iter().filter_map(|layer| layer.gain.as_ref()).map(Range::len).sum()
    }
}

/// Refuses a θ of another length, or with a number that is not finite.
pub(crate) fn check_parameters(theta: &[f32], expected: usize) -> Result<(), ConfigError> {
    if theta.len() != expected {
        return Err(ConfigError::Parameters { expected, found: theta.len() });
    }
    match theta.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(ConfigError::NotFinite { index, value: theta[index] }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_presets_have_the_counts_of_the_lineage() {
        let layout = SdfConfig::paper().layout().expect("the preset");
        assert_eq!(layout.gains(), 4_314);
        assert_eq!(layout.parameters - layout.gains(), 1_970_906);
        assert_eq!((layout.layers[3].rows, layout.layers[4].columns), (473, 512));
        let fast = SdfConfig::fast().layout().expect("the preset");
        assert_eq!(fast.parameters - fast.gains(), 526_810);
        let slim = SdfConfig { features: 0, ..SdfConfig::fast() }.layout().expect("a valid shape");
        assert_eq!(slim.parameters - slim.gains(), 461_018);
        let d = DeformationConfig::paper(90).layout().expect("the preset");
        assert_eq!(d.parameters, 875_523);
    }

    #[test]
    fn absurd_shapes_are_refused_with_the_field_and_the_number() {
        let base = SdfConfig::fast();
        let table = [
            (SdfConfig { width: usize::MAX, ..base.clone() }, "width"),
            (SdfConfig { width: 0, ..base.clone() }, "width"),
            (SdfConfig { layers: 0, ..base.clone() }, "layers"),
            (SdfConfig { layers: 1 << 40, ..base.clone() }, "layers"),
            (SdfConfig { bands: 17, ..base.clone() }, "bands"),
            (SdfConfig { features: 1 << 50, ..base.clone() }, "features"),
            (SdfConfig { beta: f32::NAN, ..base.clone() }, "beta"),
            (SdfConfig { radius: 0.0, ..base.clone() }, "radius"),
            (SdfConfig { skip: Some(0), ..base.clone() }, "skip"),
            (SdfConfig { skip: Some(8), ..base.clone() }, "skip"),
            (SdfConfig { width: 39, ..base.clone() }, "skip"),
        ];
        for (config, field) in table {
            let error = config.layout().expect_err("an absurd shape").to_string();
            assert!(error.contains(field), "{error} does not name {field}");
        }
        assert!(DeformationConfig::paper(0).layout().is_err());
        assert!(
            DeformationConfig { embedding: 1 << 40, ..DeformationConfig::paper(3) }
                .layout()
                .is_err()
        );
    }
}
