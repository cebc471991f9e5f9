//! How positions will be stored, and so to what they are rounded before they are verified.

use if_core::math::{Point, Real};
use if_mesh::file::MeshFile;
use if_mesh::ply::{CoordinateType, quantise};

/// Steps of a coordinate that single precision holds one by one, but for one that two roundings need.
const STEPS: Real = ((1u32 << 24) - 1) as Real;

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
    /// Single precision, in multiples of 2^-`bits` m as far as it holds them one by one: 2^24 of them
    /// on both sides of 0. Differences of two positions are then single precision, too, and added to
    /// the first give the second, as animations of differences from a first frame need.
    Fixed {
        /// Binary digits after the point.
        bits: i8,
    },
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

    /// [`Storage::Fixed`] with the most digits at which all positions between `low` and `high`, and
    /// all differences of two of them, are exact; [`Storage::F32`] without finite bounds.
    ///
    /// # Examples
    ///
    /// ```
    /// use if_core::math::Point;
    /// use if_outfit::storage::Storage;
    /// let (low, high) = (Point::new(-0.8, 0.0, -0.3), Point::new(0.8, 1.8, 0.4));
    /// let storage = Storage::with_exact_differences(&low, &high);
    /// assert_eq!(storage, Storage::Fixed { bits: 23 }); // 0.12 µm: 0.06 µm are lost
    /// let [a, b] = [0.123456789, 1.7].map(|x| storage.round(&[Point::new(x, 0.0, 0.0)])[0].x);
    /// assert_eq!((b - a) as f32 + a as f32, b as f32);
    /// ```
    pub fn with_exact_differences(low: &Point, high: &Point) -> Self {
        if !low.iter().chain(high.iter()).all(|x| x.is_finite()) {
            return Self::F32;
        }
        let largest = low.coords.abs().max().max(high.coords.abs().max()).max((high - low).max());
        let bits = (i8::MIN..=i8::MAX).rev().find(|bits| largest <= STEPS * step(*bits));
        bits.map_or(Self::F32, |bits| Self::Fixed { bits })
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
            Self::Fixed { bits } => {
                let step = step(bits);
                let fixed: Vec<Point> =
                    positions.iter().map(|p| p.map(|x| (x / step).round() * step)).collect();
                Self::F32.round(&fixed)
            }
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

fn step(bits: i8) -> Real {
    2.0_f64.powi(-i32::from(bits))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_that_are_not_finite_fix_no_digits() {
        for bad in [Real::NAN, Real::INFINITY, Real::NEG_INFINITY] {
            let [fine, bad] = [0.5, bad].map(|x| Point::new(0.0, x, 1.0));
            for (low, high) in [(fine, bad), (bad, fine), (bad, bad)] {
                assert_eq!(Storage::with_exact_differences(&low, &high), Storage::F32);
            }
        }
    }

    #[test]
    fn differences_in_bounds_are_exact_in_single_precision_and_half_a_step_is_lost() {
        let mut random = 0.5;
        for size in [1e-3, 0.9, 1.0, 2.0, 2.1, 37.0, 5e4] {
            // Differences along x are larger than all coordinates.
            let [low, high] = [Point::new(-0.8, 0.0, 0.1) * size, Point::new(0.7, 1.0, 0.2) * size];
            let largest = 1.5 * size;
            let storage = Storage::with_exact_differences(&low, &high);
            let Storage::Fixed { bits } = storage else { panic!("{storage:?}") };
            let held = STEPS * step(bits);
            assert!(
                (largest..2.1 * largest).contains(&held),
                "{size}: no more is lost than must be"
            );
            let mut at = || {
                let p = Point::from([0, 1, 2].map(|k| {
                    random = (random + 0.618_033_988_749_894_9_f64).fract();
                    low[k] + random * (high[k] - low[k])
                }));
                let stored = storage.round(&[p])[0];
                assert!((stored - p).amax() <= 0.5 * step(bits));
                stored.map(|x| x as f32)
            };
            for _ in 0..1000 {
                let (a, b) = (at(), at());
                assert_eq!(a + (b - a), b);
                // The difference itself, which a viewer may scale, is exact as well.
                let exact = b.map(Real::from) - a.map(Real::from);
                assert_eq!((b - a).map(Real::from), exact);
            }
        }
    }
}
