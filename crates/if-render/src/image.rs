//! Pictures, and PNG files of them.

use std::io::Write;

/// A picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Red, green and blue of each pixel in sRGB, rows from the top.
    pub rgb: Vec<u8>,
}

/// A picture could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write the picture of {width} × {height} pixels: {source}")]
pub struct PngError {
    width: u32,
    height: u32,
    source: png::EncodingError,
}

impl Image {
    /// A black picture.
    pub(crate) fn new(width: u32, height: u32) -> Self {
        Self { width, height, rgb: vec![0; 3 * width as usize * height as usize] }
    }

    /// Writes the picture as a PNG file.
    ///
    /// # Errors
    ///
    /// A picture without pixels, or a writer that fails.
    pub fn write_png(&self, writer: impl Write) -> Result<(), PngError> {
        let wrap = |source| PngError { width: self.width, height: self.height, source };
        let mut encoder = png::Encoder::new(writer, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header().map_err(wrap)?;
        writer.write_image_data(&self.rgb).map_err(wrap)?;
        writer.finish().map_err(wrap)
    }
}

/// Writes an animated PNG file of `frames`, each shown for `1 / frames_per_second` s, for ever.
/// Viewers that know no animation show the first.
///
/// # Errors
///
/// No frames, frames without pixels or of different sizes, or a writer that fails.
pub fn write_animation(
    frames: &[Image],
    frames_per_second: f64,
    writer: impl Write,
) -> Result<(), PngError> {
    let (width, height) = frames.first().map_or((0, 0), |f| (f.width, f.height));
    let wrap = |source| PngError { width, height, source };
    let mut encoder = png::Encoder::new(writer, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_animated(frames.len() as u32, 0).map_err(wrap)?;
    // In milliseconds, as far as 16 bits hold.
    let delay = (1000.0 / frames_per_second).round().clamp(1.0, f64::from(u16::MAX));
    encoder.set_frame_delay(delay as u16, 1000).map_err(wrap)?;
    let mut writer = encoder.write_header().map_err(wrap)?;
    for frame in frames {
        writer.write_image_data(&frame.rgb).map_err(wrap)?;
    }
    writer.finish().map_err(wrap)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_picture_is_read_again() {
        let mut image = Image::new(3, 2);
        image.rgb.iter_mut().enumerate().for_each(|(k, v)| *v = 10 * k as u8);
        let mut bytes = Vec::new();
        image.write_png(&mut bytes).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut rgb = vec![0; image.rgb.len()];
        reader.next_frame(&mut rgb).unwrap();
        assert_eq!((reader.info().size(), rgb), ((3, 2), image.rgb));
    }

    #[test]
    fn an_animation_holds_all_frames() {
        let frames: Vec<Image> = (0..3u8)
            .map(|k| Image { width: 2, height: 1, rgb: vec![k, 2 * k, 3 * k, 40, 50, 60] })
            .collect();
        let mut bytes = Vec::new();
        write_animation(&frames, 25.0, &mut bytes).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 3);
        for frame in &frames {
            let mut rgb = vec![0; 6];
            reader.next_frame(&mut rgb).unwrap();
            assert_eq!(rgb, frame.rgb);
            assert_eq!(reader.info().frame_control().unwrap().delay_num, 40);
        }
        assert!(write_animation(&[], 25.0, Vec::new()).is_err());
    }

    #[test]
    fn a_picture_without_pixels_is_an_error_that_says_so() {
        let error = Image::new(0, 5).write_png(Vec::new()).unwrap_err();
        assert!(error.to_string().contains("0 × 5"), "{error}");
    }
}
