//! The PNG images of a capture: data in the pixels, unlike the pictures of `if-render`.

use if_mesh::regular_file;
use png::{BitDepth, ColorType, Decoder, Encoder, Transformations};
use std::error::Error;
use std::io::{self, BufReader, Write};
use std::path::Path;

/// The content of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Mask = 0,
    Label = 1,
    Normal = 2,
}

impl Kind {
    pub(super) const ALL: [Self; 3] = [Self::Mask, Self::Label, Self::Normal];

    /// The subfolder, and the key under `channels`.
    pub(super) fn folder(self) -> &'static str {
        ["mask", "label", "normal"][self as usize]
    }

    /// The subfolder of noisy images.
    pub(super) fn noisy(self) -> &'static str {
        ["mask_noisy", "label_noisy", "normal_noisy"][self as usize]
    }

    fn expects(self) -> &'static str {
        match self {
            Self::Mask => "grey of 1 to 16 bits",
            Self::Label => "grey or palette of 1 to 8 bits, whose values are the labels",
            Self::Normal => "RGB of 8 or 16 bits",
        }
    }

    fn accepts(self, color: ColorType, depth: BitDepth) -> bool {
        match self {
            Self::Mask => color == ColorType::Grayscale,
            Self::Label => {
                matches!(color, ColorType::Grayscale | ColorType::Indexed)
                    && depth != BitDepth::Sixteen
            }
            Self::Normal => color == ColorType::Rgb,
        }
    }
}

/// An image cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum PictureError {
    /// The file cannot be read or written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The file is not a valid PNG file.
    #[error("not a valid PNG file: {0}")]
    Decode(Box<dyn Error + Send + Sync>),
    /// The image cannot be encoded.
    #[error("cannot be written: {0}")]
    Encode(Box<dyn Error + Send + Sync>),
    /// The size is not the camera's.
    #[error(
        "{width} × {height} pixels, but the camera in meta.json has {expected_width} × {expected_height}"
    )]
    Size { width: usize, height: usize, expected_width: usize, expected_height: usize },
    /// The channels or bits are wrong.
    #[error("the pixels are {found}; they must be {expected}")]
    Format { found: String, expected: &'static str },
}

impl From<png::DecodingError> for PictureError {
    fn from(error: png::DecodingError) -> Self {
        match error {
            png::DecodingError::IoError(e) => Self::Io(e),
            other => Self::Decode(other.into()),
        }
    }
}

impl From<png::EncodingError> for PictureError {
    fn from(error: png::EncodingError) -> Self {
        match error {
            png::EncodingError::IoError(e) => Self::Io(e),
            other => Self::Encode(other.into()),
        }
    }
}

/// Checks size and format by the header of the file.
pub(super) fn check(path: &Path, kind: Kind, size: (usize, usize)) -> Result<(), PictureError> {
    let mut decoder = Decoder::new(BufReader::with_capacity(256, regular_file::open(path)?));
    check_info(decoder.read_header_info()?, kind, size)
}

fn check_info(
    info: &png::Info,
    kind: Kind,
    (expected_width, expected_height): (usize, usize),
) -> Result<(), PictureError> {
    let (width, height) = (info.width as usize, info.height as usize);
    if (width, height) != (expected_width, expected_height) {
        return Err(PictureError::Size { width, height, expected_width, expected_height });
    }
    if !kind.accepts(info.color_type, info.bit_depth) {
        let found = format!("{:?} of {} bits", info.color_type, info.bit_depth as u8);
        return Err(PictureError::Format { found, expected: kind.expects() });
    }
    Ok(())
}

/// The samples of an image, their bits (of 16 in big-endian order), and the bytes of a pixel that has
/// some.
fn read(
    path: &Path,
    kind: Kind,
    size: (usize, usize),
) -> Result<(Vec<u8>, BitDepth, usize), PictureError> {
    let mut decoder = Decoder::new(BufReader::new(regular_file::open(path)?));
    check_info(decoder.read_header_info()?, kind, size)?;
    // Masks are expanded to at least 8 bits; palette indices of labels are kept.
    decoder.set_transformations(if kind == Kind::Mask {
        Transformations::EXPAND
    } else {
        Transformations::IDENTITY
    });
    let mut reader = decoder.read_info()?;
    let bytes = reader.output_buffer_size().unwrap_or(usize::MAX);
    let (color, depth) = reader.output_color_type();
    // A mask with a transparent grey (tRNS) has a second sample after it is expanded.
    let pixel = color.samples() * if depth == BitDepth::Sixteen { 2 } else { 1 };
    let mut samples = vec![0; bytes];
    reader.next_frame(&mut samples)?;
    Ok((samples, depth, pixel))
}

/// Whether each pixel is brighter than half of full white.
pub(super) fn mask(path: &Path, size: (usize, usize)) -> Result<Vec<bool>, PictureError> {
    let (samples, _, pixel) = read(path, Kind::Mask, size)?;
    Ok(samples.iter().step_by(pixel).map(|s| *s >= 128).collect())
}

/// The label of each pixel.
pub(super) fn labels(path: &Path, size: (usize, usize)) -> Result<Vec<u8>, PictureError> {
    let (samples, depth, _) = read(path, Kind::Label, size)?;
    let bits = depth as usize;
    if bits == 8 {
        return Ok(samples);
    }
    // Several pixels to a byte, the first in its high bits; each row begins a new one.
    let row = |bytes: &[u8]| -> Vec<u8> {
        let of = |x: usize| bytes[x * bits / 8] >> (8 - bits - x * bits % 8) & ((1 << bits) - 1);
        (0..size.0).map(of).collect()
    };
    Ok(samples.chunks_exact((size.0 * bits).div_ceil(8)).flat_map(row).collect())
}

/// Length below which a decoded normal counts as missing. Estimators write grey, a zero vector, where
/// they have no normal; rounding to 8 bits leaves 0.007, and valid normals have length 1 ± 0.01.
const NO_NORMAL: f32 = 0.1;

/// The unit normal of each pixel, encoded as (n · ½ + ½) in full range; zero where the pixel is black
/// or grey.
pub(super) fn normals(path: &Path, size: (usize, usize)) -> Result<Vec<[f32; 3]>, PictureError> {
    let (samples, depth, _) = read(path, Kind::Normal, size)?;
    let unit = |code: [f32; 3]| {
        let n = code.map(|c| 2.0 * c - 1.0);
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        if code == [0.0; 3] || length < NO_NORMAL { [0.0; 3] } else { n.map(|c| c / length) }
    };
    Ok(if depth == BitDepth::Sixteen {
        let code =
            |s: &[u8], k: usize| f32::from(u16::from_be_bytes([s[2 * k], s[2 * k + 1]])) / 65535.0;
        samples.chunks_exact(6).map(|s| unit([code(s, 0), code(s, 1), code(s, 2)])).collect()
    } else {
        samples
            .chunks_exact(3)
            .map(|s| unit([s[0], s[1], s[2]].map(|c| f32::from(c) / 255.0)))
            .collect()
    })
}

fn encode(
    out: impl Write,
    (width, height): (usize, usize),
    color: ColorType,
    depth: BitDepth,
    samples: &[u8],
) -> Result<(), PictureError> {
    let mut encoder = Encoder::new(out, width as u32, height as u32);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Balanced);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(samples)?;
    Ok(writer.finish()?)
}

/// Writes an image that [`mask`] reads.
pub(super) fn write_mask(
    out: impl Write,
    size: (usize, usize),
    mask: &[bool],
) -> Result<(), PictureError> {
    let samples: Vec<u8> = mask.iter().map(|m| if *m { 255 } else { 0 }).collect();
    encode(out, size, ColorType::Grayscale, BitDepth::Eight, &samples)
}

/// Writes an image that [`labels`] reads.
pub(super) fn write_labels(
    out: impl Write,
    size: (usize, usize),
    labels: &[u8],
) -> Result<(), PictureError> {
    encode(out, size, ColorType::Grayscale, BitDepth::Eight, labels)
}

/// Writes an image that [`normals`] reads, in 8 bits: exact to 0.4°.
pub(super) fn write_normals(
    out: impl Write,
    size: (usize, usize),
    normals: &[[f32; 3]],
) -> Result<(), PictureError> {
    let code = |n: &[f32; 3]| {
        if *n == [0.0; 3] { [0; 3] } else { n.map(|c| ((0.5 * c + 0.5) * 255.0).round() as u8) }
    };
    let samples: Vec<u8> = normals.iter().flat_map(code).collect();
    encode(out, size, ColorType::Rgb, BitDepth::Eight, &samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As Pillow writes images of few colours.
    #[test]
    fn labels_may_have_less_than_a_byte() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("label.png");
        let palette = [0; 12];
        for (depth, rows, expected) in [
            (
                BitDepth::Two,
                vec![0b0001_1011, 0b0100_0000, 0b1110_0100, 0b1000_0000],
                [0, 1, 2, 3, 1, 3, 2, 1, 0, 2],
            ),
            (BitDepth::One, vec![0b0110_1000, 0b1001_1000], [0, 1, 1, 0, 1, 1, 0, 0, 1, 1]),
        ] {
            let mut encoder = Encoder::new(std::fs::File::create(&path).unwrap(), 5, 2);
            encoder.set_color(ColorType::Indexed);
            encoder.set_depth(depth);
            encoder.set_palette(&palette[..]);
            encoder.write_header().unwrap().write_image_data(&rows).unwrap();
            check(&path, Kind::Label, (5, 2)).unwrap();
            assert_eq!(labels(&path, (5, 2)).unwrap(), expected);
        }
    }

    #[test]
    fn a_mask_with_a_transparent_grey_is_read_as_one_without() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.png");
        let expected: Vec<bool> = (0..12).map(|i| i % 5 == 0).collect();
        let samples: Vec<u8> = expected.iter().map(|m| if *m { 255 } else { 0 }).collect();
        for transparent in [None, Some(vec![0, 0])] {
            let mut encoder = Encoder::new(std::fs::File::create(&path).unwrap(), 4, 3);
            encoder.set_color(ColorType::Grayscale);
            encoder.set_depth(BitDepth::Eight);
            if let Some(grey) = transparent {
                encoder.set_trns(grey);
            }
            let mut writer = encoder.write_header().unwrap();
            writer.write_image_data(&samples).unwrap();
            writer.finish().unwrap();
            assert_eq!(mask(&path, (4, 3)).unwrap(), expected);
        }
    }
}
