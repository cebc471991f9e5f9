//! How positions will be stored, and so to what they are rounded before they are verified.

use if_core::math::{Point, Real};
use if_mesh::file::MeshFile;
use if_mesh::ply::{CoordinateType, quantise};

/// How the positions of a layer will be stored.
///
/// They are rounded to that form before they are verified, so that the proof is about the positions
/// that a reader of the file gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Storage {
    /// Double precision: 8 bytes each, or decimal text that is read back as the same number, as
    /// [`if_mesh::obj::write`] writes it. Nothing is lost.
    #[default]
    F64,
    /// Single precision: 4 bytes each. 0.1 µm is lost at 1 m.
    F32,
    /// Decimal text with this many digits after the point, such as `{:.6}` gives.
    Text {
        /// Digits after the point.
        decimals: u8,
    },
}

impl Storage {
    /// How [`MeshFile::write`] stores the positions of this file.
    pub fn of(file: &MeshFile) -> Self {
        if file.is_single_precision() { Self::F32 } else { Self::F64 }
    }

    /// The positions as they will be read back.
    ///
    /// A coordinate beyond the range of `f32` stays as it is: only a vertex of no triangle can have
    /// one, because [`Outfit::new`](crate::outfit::Outfit::new) rejects a garment of that size.
    ///
    /// # Examples
    ///
    /// ```
    /// use if_core::math::Point;
    /// use if_outfit::storage::Storage;
    /// let p = Point::new(0.123456789, 1.0, -1e-9);
    /// assert_eq!(Storage::F64.round(&[p]), [p]);
    /// assert_eq!(Storage::F32.round(&[p])[0].x, f64::from(0.123456789_f32));
    /// assert_eq!(Storage::Text { decimals: 6 }.round(&[p]), [Point::new(0.123457, 1.0, 0.0)]);
    /// ```
    pub fn round(self, positions: &[Point]) -> Vec<Point> {
        match self {
            Self::F64 => positions.to_vec(),
            Self::F32 => {
                let mut single = quantise(positions, CoordinateType::Float);
                for (single, p) in single.iter_mut().zip(positions) {
                    if !single.iter().all(|x| x.is_finite()) {
                        *single = *p;
                    }
                }
                single
            }
            Self::Text { decimals } => {
                let digits = usize::from(decimals);
                let read_back = |x: Real| format!("{x:.digits$}").parse().unwrap_or(x);
                positions.iter().map(|p| p.map(read_back)).collect()
            }
        }
    }
}
