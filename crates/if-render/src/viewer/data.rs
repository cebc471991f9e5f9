//! Numbers of a page, small: points on a grid, as differences, as planes of bytes, compressed.
//!
//! A difference d is stored as 2 d, or −2 d − 1 if it is negative, so that small ones have small
//! bytes; the lowest bytes of all numbers of a list come first, then the next ones. `viewer.js` reads
//! them back.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
use std::io::Write;

/// Steps of the grid along the longest side of the box. A person of 1.8 m has steps of 0.1 µm, and
/// f32 no finer ones.
const STEPS: Real = 16_777_216.0;

pub(super) struct Writer {
    low: Point,
    step: Real,
    encoder: ZlibEncoder<Vec<u8>>,
}

impl Writer {
    /// A grid round `points`.
    pub(super) fn new<'a>(points: impl IntoIterator<Item = &'a Point>) -> Self {
        let region = Aabb::from_points(points);
        let low = if region.is_empty() { Point::origin() } else { region.min };
        let size = Some(region.size().max()).filter(|size| *size > 0.0).unwrap_or(1.0);
        Self {
            low,
            step: size / STEPS,
            encoder: ZlibEncoder::new(Vec::new(), Compression::default()),
        }
    }

    /// The place of the grid's point 0 0 0.
    pub(super) fn low(&self) -> [Real; 3] {
        self.low.coords.into()
    }

    pub(super) fn step(&self) -> Real {
        self.step
    }

    /// The nearest points of the grid.
    pub(super) fn grid(&self, points: &[Point]) -> Vec<[i32; 3]> {
        let on_grid = |p: &Point| ((p - self.low) / self.step).map(|x| x.round() as i32).into();
        points.iter().map(on_grid).collect()
    }

    /// Each number as the difference to the one in its row before.
    pub(super) fn chain<const N: usize>(&mut self, rows: impl Iterator<Item = [i32; N]>) {
        let mut before = [0; N];
        let mut out = Vec::new();
        for row in rows {
            out.extend((0..N).map(|k| row[k].wrapping_sub(before[k])));
            before = row;
        }
        self.differences(out.into_iter());
    }

    pub(super) fn differences(&mut self, differences: impl Iterator<Item = i32>) {
        let codes: Vec<u32> = differences.map(|d| ((d << 1) ^ (d >> 31)) as u32).collect();
        for plane in 0..4 {
            let bytes: Vec<u8> = codes.iter().map(|code| code.to_le_bytes()[plane]).collect();
            self.encoder.write_all(&bytes).expect("memory takes all");
        }
    }

    /// All numbers, as text.
    pub(super) fn finish(self) -> String {
        BASE64_STANDARD.encode(self.encoder.finish().expect("memory takes all"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::read::ZlibDecoder;
    use std::io::Read;

    /// What `viewer.js` does, in Rust.
    fn chain(bytes: &[u8], step: usize) -> Vec<i32> {
        let count = bytes.len() / 4;
        let mut out = vec![0i32; count];
        for k in 0..count {
            let code =
                (0..4).map(|plane| u32::from(bytes[plane * count + k]) << (8 * plane)).sum::<u32>();
            out[k] = (code >> 1) as i32 ^ -((code & 1) as i32);
            if k >= step {
                out[k] = out[k].wrapping_add(out[k - step]);
            }
        }
        out
    }

    #[test]
    fn points_come_back_within_half_a_step() {
        let point = |k: usize| {
            let a = 0.37 * k as f64;
            Point::new(0.5 * a.sin() - 1.0, 1.7 * (0.61 * a).cos(), 0.2 * (1.3 * a).sin())
        };
        let points: Vec<Point> = (0..500).map(point).collect();
        let mut writer = Writer::new(&points);
        let grid = writer.grid(&points);
        assert!(grid.iter().flatten().all(|x| (0..=STEPS as i32).contains(x)));
        writer.chain(grid.iter().copied());
        let (low, step) = (writer.low(), writer.step());
        let mut bytes = Vec::new();
        let text = writer.encoder.finish().unwrap();
        ZlibDecoder::new(text.as_slice()).read_to_end(&mut bytes).unwrap();
        let read = chain(&bytes, 3);
        assert_eq!(read.len(), 1500);
        for (k, x) in read.iter().enumerate() {
            let place = low[k % 3] + step * f64::from(*x);
            assert!((place - points[k / 3][k % 3]).abs() < 0.51 * step, "{k}: {place}");
        }
    }

    #[test]
    fn a_single_point_has_a_grid() {
        let only = Point::new(3.0, 4.0, 5.0);
        let writer = Writer::new(&[only]);
        assert_eq!(writer.grid(&[only]), [[0, 0, 0]]);
        assert!(writer.step() > 0.0);
    }
}
