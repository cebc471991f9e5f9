//! Point caches: positions of one mesh in many frames, as animation tools read them (PC2).
//!
//! ```text
//! "POINTCACHE2\0"   i32 version 1   i32 points   f32 first frame   f32 frames a sample   i32 samples
//! samples × points × (f32 x, f32 y, f32 z), little-endian
//! ```

use if_core::math::Point;
use std::io::{self, Write};

/// A point cache cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum PointCacheError {
    /// More points or frames than the format can count.
    #[error("a point cache holds at most {} points and frames; there are {count}", i32::MAX)]
    TooMany { count: usize },
    /// A frame has another number of points.
    #[error("frame {frame} has {found} points, and the cache {expected}; the mesh must not change")]
    Points { frame: usize, found: usize, expected: usize },
    /// There are more or fewer frames than were announced.
    #[error("{found} frames were written of {expected}; announce their number at the start")]
    Frames { found: usize, expected: usize },
    /// A coordinate is not finite in single precision.
    #[error(
        "point {point} of frame {frame} is {at:?}; coordinates must be finite in single precision"
    )]
    NonFinite { frame: usize, point: usize, at: Point },
    /// The writer fails.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Writes the positions of one mesh frame by frame, in the order of its vertices.
///
/// # Examples
///
/// ```
/// use if_core::math::Point;
/// use if_mesh::point_cache::PointCacheWriter;
/// let mut bytes = Vec::new();
/// let mut cache = PointCacheWriter::new(&mut bytes, 1, 2)?;
/// cache.frame(&[Point::origin()])?;
/// cache.frame(&[Point::new(1.0, 0.0, 0.0)])?;
/// cache.finish()?;
/// assert_eq!(bytes.len(), 32 + 2 * 12);
/// # Ok::<(), if_mesh::point_cache::PointCacheError>(())
/// ```
#[derive(Debug)]
pub struct PointCacheWriter<W> {
    writer: W,
    points: usize,
    frames: usize,
    written: usize,
}

impl<W: Write> PointCacheWriter<W> {
    /// Writes the header of a cache of `frames` frames with `points` points each, numbered from 0.
    ///
    /// # Errors
    ///
    /// More than the format can count, or a writer that fails.
    pub fn new(writer: W, points: usize, frames: usize) -> Result<Self, PointCacheError> {
        Self::numbered(writer, points, frames, [0, 1])
    }

    /// As [`new`](Self::new), with the number of the first frame, and by how much each next one is higher.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn numbered(
        mut writer: W,
        points: usize,
        frames: usize,
        [first, step]: [usize; 2],
    ) -> Result<Self, PointCacheError> {
        let counted =
            |count: usize| i32::try_from(count).map_err(|_| PointCacheError::TooMany { count });
        writer.write_all(b"POINTCACHE2\0")?;
        writer.write_all(&1i32.to_le_bytes())?;
        writer.write_all(&counted(points)?.to_le_bytes())?;
        writer.write_all(&(first as f32).to_le_bytes())?;
        writer.write_all(&(step as f32).to_le_bytes())?;
        writer.write_all(&counted(frames)?.to_le_bytes())?;
        Ok(Self { writer, points, frames, written: 0 })
    }

    /// Writes the next frame.
    ///
    /// # Errors
    ///
    /// Another number of points, a coordinate that single precision cannot hold, or a writer that
    /// fails.
    pub fn frame(&mut self, points: &[Point]) -> Result<(), PointCacheError> {
        let frame = self.written;
        if points.len() != self.points {
            let (found, expected) = (points.len(), self.points);
            return Err(PointCacheError::Points { frame, found, expected });
        }
        let mut bytes = Vec::with_capacity(12 * points.len());
        for (point, at) in points.iter().enumerate() {
            for x in at.iter().map(|x| *x as f32) {
                if !x.is_finite() {
                    return Err(PointCacheError::NonFinite { frame, point, at: *at });
                }
                bytes.extend(x.to_le_bytes());
            }
        }
        self.writer.write_all(&bytes)?;
        self.written += 1;
        Ok(())
    }

    /// Ends the cache.
    ///
    /// # Errors
    ///
    /// Not as many frames as announced, or a writer that fails.
    pub fn finish(mut self) -> Result<(), PointCacheError> {
        if self.written != self.frames {
            let (found, expected) = (self.written, self.frames);
            return Err(PointCacheError::Frames { found, expected });
        }
        Ok(self.writer.flush()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cache_has_the_header_and_the_numbers_of_the_format() {
        let mut bytes = Vec::new();
        let mut cache = PointCacheWriter::new(&mut bytes, 2, 2).unwrap();
        cache.frame(&[Point::new(1.0, 2.0, 3.0), Point::origin()]).unwrap();
        cache.frame(&[Point::origin(); 2]).unwrap();
        cache.finish().unwrap();
        assert_eq!(&bytes[..12], b"POINTCACHE2\0");
        let int = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let float = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!((int(12), int(16), float(20), float(24), int(28)), (1, 2, 0.0, 1.0, 2));
        assert_eq!([32, 36, 40, 44].map(float), [1.0, 2.0, 3.0, 0.0]);
        assert_eq!(bytes.len(), 32 + 2 * 2 * 12);
        let mut every_second = Vec::new();
        let cache = PointCacheWriter::numbered(&mut every_second, 2, 2, [5, 2]).unwrap();
        assert!(cache.finish().is_err());
        assert_eq!(every_second[..20], bytes[..20]);
        let float = |at: usize| f32::from_le_bytes(every_second[at..at + 4].try_into().unwrap());
        assert_eq!((float(20), float(24), every_second.len()), (5.0, 2.0, 32));
    }

    #[test]
    fn frames_that_do_not_fit_are_errors() {
        let mut cache = PointCacheWriter::new(Vec::new(), 2, 3).unwrap();
        cache.frame(&[Point::origin(); 2]).unwrap();
        let error = cache.frame(&[Point::origin()]).unwrap_err();
        assert!(error.to_string().contains("frame 1 has 1 points"), "{error}");
        let error = cache.frame(&[Point::origin(), Point::new(0.0, 1e300, 0.0)]).unwrap_err();
        assert!(matches!(error, PointCacheError::NonFinite { frame: 1, point: 1, .. }));
        let error = cache.finish().unwrap_err();
        assert!(matches!(error, PointCacheError::Frames { found: 1, expected: 3 }));
    }
}
