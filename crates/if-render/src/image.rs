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
    fn a_picture_without_pixels_is_an_error_that_says_so() {
        let error = Image::new(0, 5).write_png(Vec::new()).unwrap_err();
        assert!(error.to_string().contains("0 × 5"), "{error}");
    }
}
