//! The shapes of the two networks: what is a parameter, the presets, and where θ keeps what.

use std::ops::{Range, RangeInclusive};

use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

use crate::encoding::PositionalEncoding;
use crate::error::NetworkError;

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
    /// Bands of the positional encoding, 0 to 16.
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
    pub(crate) const fn encoding(&self) -> PositionalEncoding {
        PositionalEncoding { bands: self.bands }
    }

    /// Where θ keeps each linear layer, hidden ones first.
    ///
    /// # Errors
    ///
    /// The first size out of range.
    #[doc(hidden)]
    pub fn layout(&self) -> Result<Layout, ParameterError> {
        let encoded = checked_width(self.bands, self.width, self.layers)?;
        if let Some(skip) = self.skip {
            let needs = "from 1 to `layers` − 1, or missing";
            ParameterError::check("skip", skip as f64, skip > 0 && skip < self.layers, needs)?;
            let needs =
                "larger than the count of features of the encoding, 3 + 6 `bands`, with `skip`";
            ParameterError::check("width", self.width as f64, self.width > encoded, needs)?;
        }
        bounded("features", self.features, 0..=MAX_WIDTH, "from 0 to 4096")?;
        ParameterError::check_positive("beta", self.beta.into())?;
        ParameterError::check_positive("radius", self.radius.into())?;
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
    /// Bands of the positional encoding, 0 to 16.
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
    pub(crate) const fn encoding(&self) -> PositionalEncoding {
        PositionalEncoding { bands: self.bands }
    }

    /// Where θ keeps each linear layer; the embeddings follow, frame by frame.
    ///
    /// # Errors
    ///
    /// The first size out of range.
    #[doc(hidden)]
    pub fn layout(&self) -> Result<Layout, ParameterError> {
        let encoded = checked_width(self.bands, self.width, self.layers)?;
        bounded("embedding", self.embedding, 0..=MAX_WIDTH, "from 0 to 4096")?;
        bounded("frames", self.frames, 1..=MAX_FRAMES, "from 1 to 2^20")?;
        let mut shapes = Vec::with_capacity(self.layers + 1);
        for layer in 0..=self.layers {
            let columns = if layer == 0 { encoded + self.embedding } else { self.width };
            shapes.push((if layer == self.layers { 3 } else { self.width }, columns));
        }
        Ok(Layout::new(&shapes, false))
    }
}

/// Most bands of an encoding. The highest has 2¹⁵ radians per unit: more is finer than f32 points hold.
const MAX_BANDS: usize = 16;
/// Widest layer: its matrix has 64 MiB.
const MAX_WIDTH: usize = 4096;
/// Most hidden layers.
const MAX_LAYERS: usize = 64;
/// Most frames of a deformation.
const MAX_FRAMES: usize = 1 << 20;

fn checked_width(bands: usize, width: usize, layers: usize) -> Result<usize, ParameterError> {
    bounded("bands", bands, 0..=MAX_BANDS, "from 0 to 16")?;
    bounded("width", width, 1..=MAX_WIDTH, "from 1 to 4096")?;
    bounded("layers", layers, 1..=MAX_LAYERS, "from 1 to 64")?;
    Ok(PositionalEncoding { bands }.width())
}

fn bounded(
    name: &'static str,
    value: usize,
    range: RangeInclusive<usize>,
    needs: &'static str,
) -> Result<(), ParameterError> {
    ParameterError::check(name, value as f64, range.contains(&value), needs)
}

/// Where θ keeps the linear layers of a network.
#[doc(hidden)]
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The layers in order.
    pub layers: Vec<LayerLayout>,
    /// Length of θ that the layers take.
    pub parameters: usize,
}

/// Where θ keeps one linear layer `z = W a + b`.
#[doc(hidden)]
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
    #[cfg(test)]
    pub(crate) fn gains(&self) -> usize {
        self.layers.iter().filter_map(|layer| layer.gain.as_ref()).map(Range::len).sum()
    }
}

/// Rejects a θ of another length, or with a number that is not finite.
pub(crate) fn check_parameters(theta: &[f32], expected: usize) -> Result<(), NetworkError> {
    if theta.len() != expected {
        return Err(NetworkError::Length { expected, got: theta.len() });
    }
    match theta.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(NetworkError::NotFinite { index, value: theta[index] }),
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
    fn shapes_out_of_range_are_rejected_with_field_and_number() {
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
            (SdfConfig { width: 39, ..base.clone() }, "width"),
        ];
        for (config, field) in table {
            let error = config.layout().expect_err("a shape out of range").to_string();
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
