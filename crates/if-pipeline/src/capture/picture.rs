//! The PNG files of a capture.

use png::{BitDepth, ColorType, Decoder, Encoder, Transformations};
use std::fs::File;
use std::io::{self, BufReader, Write};
use std::path::Path;

/// What a picture shows.
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

    /// The subfolder of noisy pictures.
    pub(super) fn noisy(self) -> &'static str {
        ["mask_noisy", "label_noisy", "normal_noisy"][self as usize]
    }

    fn expects(self) -> &'static str {
        match self {
            Self::Mask => "grey of 1 to 16 bits",
            Self::Label => "grey or palette of 8 bits, whose values are the labels",
            Self::Normal => "RGB of 8 or 16 bits",
        }
    }

    fn accepts(self, color: ColorType, depth: BitDepth) -> bool {
        match self {
            Self::Mask => color == ColorType::Grayscale,
            Self::Label => {
                matches!(color, ColorType::Grayscale | ColorType::Indexed)
                    && depth == BitDepth::Eight
            }
            Self::Normal => color == ColorType::Rgb,
        }
    }
}

/// Why a picture cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum PictureError {
    /// The system does not give or take the file.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It is no PNG file, or a damaged one.
    #[error("not a sound PNG file: {0}")]
    Decode(png::DecodingError),
    /// It cannot be written.
    #[error("cannot be written: {0}")]
    Encode(#[from] png::EncodingError),
    /// It has another size.
    #[error(
        "{width} × {height} pixels, but the camera in meta.json has {expected_width} × {expected_height}"
    )]
    Size { width: usize, height: usize, expected_width: usize, expected_height: usize },
    /// It has other channels or bits.
    #[error("the pixels are {color:?} of {bits} bits; it must be {expected}")]
    Format { color: ColorType, bits: u8, expected: &'static str },
}

impl From<png::DecodingError> for PictureError {
    fn from(error: png::DecodingError) -> Self {
        match error {
            png::DecodingError::IoError(e) => Self::Io(e),
            other => Self::Decode(other),
        }
    }
}

/// Looks at the head of the file: size and kind of pixels.
pub(super) fn check(path: &Path, kind: Kind, size: (usize, usize)) -> Result<(), PictureError> {
    let mut decoder = Decoder::new(BufReader::with_capacity(256, File::open(path)?));
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
        let bits = info.bit_depth as u8;
        return Err(PictureError::Format {
            color: info.color_type,
            bits,
            expected: kind.expects(),
        });
    }
    Ok(())
}

/// The samples of a picture of this size, in big-endian order where they have 16 bits, and whether
/// they have.
fn read(path: &Path, kind: Kind, size: (usize, usize)) -> Result<(Vec<u8>, bool), PictureError> {
    let mut decoder = Decoder::new(BufReader::new(File::open(path)?));
    check_info(decoder.read_header_info()?, kind, size)?;
    // Less than 8 bits become 8; a palette of labels stays one.
    decoder.set_transformations(if kind == Kind::Mask {
        Transformations::EXPAND
    } else {
        Transformations::IDENTITY
    });
    let mut reader = decoder.read_info()?;
    let bytes = reader.output_buffer_size().unwrap_or(usize::MAX);
    let wide = reader.output_color_type().1 == BitDepth::Sixteen;
    let mut samples = vec![0; bytes];
    reader.next_frame(&mut samples)?;
    Ok((samples, wide))
}

/// Whether each pixel is brighter than half of full white.
pub(super) fn mask(path: &Path, size: (usize, usize)) -> Result<Vec<bool>, PictureError> {
    let (samples, wide) = read(path, Kind::Mask, size)?;
    Ok(samples.iter().step_by(if wide { 2 } else { 1 }).map(|s| *s >= 128).collect())
}

/// The label of each pixel.
pub(super) fn labels(path: &Path, size: (usize, usize)) -> Result<Vec<u8>, PictureError> {
    Ok(read(path, Kind::Label, size)?.0)
}

/// Length below which a decoded normal is none. An estimator writes grey, zero in all three, where
/// it knows nothing; rounding to 8 bits leaves 0.007 there, and true normals have length 1 but for
/// 0.01.
const NO_NORMAL: f32 = 0.1;

/// The unit normal of each pixel, from (n · ½ + ½) in full range; zero where the pixel is black or
/// says nothing.
pub(super) fn normals(path: &Path, size: (usize, usize)) -> Result<Vec<[f32; 3]>, PictureError> {
    let (samples, wide) = read(path, Kind::Normal, size)?;
    let unit = |code: [f32; 3]| {
        let n = code.map(|c| 2.0 * c - 1.0);
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        if code == [0.0; 3] || length < NO_NORMAL { [0.0; 3] } else { n.map(|c| c / length) }
    };
    Ok(if wide {
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

/// Writes what [`mask`] reads.
pub(super) fn write_mask(
    out: impl Write,
    size: (usize, usize),
    mask: &[bool],
) -> Result<(), PictureError> {
    let samples: Vec<u8> = mask.iter().map(|m| if *m { 255 } else { 0 }).collect();
    encode(out, size, ColorType::Grayscale, BitDepth::Eight, &samples)
}

/// Writes what [`labels`] reads.
pub(super) fn write_labels(
    out: impl Write,
    size: (usize, usize),
    labels: &[u8],
) -> Result<(), PictureError> {
    encode(out, size, ColorType::Grayscale, BitDepth::Eight, labels)
}

/// Writes what [`normals`] reads, in 8 bits: within 0.4° of what was given.
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
