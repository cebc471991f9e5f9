//! The observed normals of a frame, smoothed, with slopes.

use if_core::math::{Real, Vector};
use nalgebra::SMatrix;

/// Share of a smoothed pixel's weight that must come from pixels with a normal.
const KNOWN: f32 = 0.5;

/// Normals in world space, interpolated between pixel centres.
pub(super) struct NormalImage {
    width: usize,
    height: usize,
    /// Smoothed normals, shorter than 1 where they vary; zero where missing.
    values: Vec<[f32; 3]>,
}

impl NormalImage {
    /// Smooths `normals` (zero where missing) by a Gaussian of `blur` pixels over the pixels that
    /// have one.
    pub(super) fn new(normals: &[[f32; 3]], width: usize, height: usize, blur: Real) -> Self {
        debug_assert_eq!(normals.len(), width * height);
        let reach = (3.0 * blur).ceil() as usize;
        let kernel: Vec<f32> = (0..=2 * reach)
            .map(|k| match blur > 0.0 {
                true => (-0.5 * ((k as Real - reach as Real) / blur).powi(2)).exp() as f32,
                false => 1.0,
            })
            .collect();
        let sum: f32 = kernel.iter().sum();
        let known = |n: &[f32; 3]| if *n == [0.0; 3] { 0.0 } else { 1.0 };
        let mut values: Vec<[f32; 4]> =
            normals.iter().map(|n| [n[0], n[1], n[2], known(n)]).collect();
        for (step, count) in [(1, width), (width, height)] {
            let place = |i: usize| if step == 1 { i % width } else { i / width };
            values = (0..values.len())
                .map(|i| {
                    let at = place(i);
                    let mut total = [0.0; 4];
                    for (k, w) in kernel.iter().enumerate() {
                        // Beyond the image nothing is known.
                        let to = at + k;
                        if (reach..count + reach).contains(&to) {
                            let v = &values[i + k * step - reach * step];
                            (0..4).for_each(|c| total[c] += w * v[c]);
                        }
                    }
                    total.map(|t| t / sum)
                })
                .collect();
        }
        let of = |[x, y, z, known]: [f32; 4]| {
            if known < KNOWN { [0.0; 3] } else { [x / known, y / known, z / known] }
        };
        Self { width, height, values: values.into_iter().map(of).collect() }
    }

    /// The normal at a pixel position and its derivative by (u, v); `None` where one of the four
    /// nearest pixels has none.
    pub(super) fn at(&self, u: Real, v: Real) -> Option<(Vector, SMatrix<Real, 3, 2>)> {
        let (x, y) = (u - 0.5, v - 0.5);
        let inside = |c: Real, n: usize| c >= 0.0 && c < (n.saturating_sub(1)) as Real;
        if !inside(x, self.width) || !inside(y, self.height) {
            return None;
        }
        let (i, j) = (x as usize, y as usize);
        let (a, b) = (x - i as Real, y - j as Real);
        let value = |i: usize, j: usize| {
            let n = self.values[j * self.width + i];
            (n != [0.0; 3]).then(|| Vector::new(n[0].into(), n[1].into(), n[2].into()))
        };
        let (p, q, r, s) = (value(i, j)?, value(i + 1, j)?, value(i, j + 1)?, value(i + 1, j + 1)?);
        let (top, bottom) = (p + (q - p) * a, r + (s - r) * a);
        let along = (q - p) * (1.0 - b) + (s - r) * b;
        Some((top + (bottom - top) * b, SMatrix::from_columns(&[along, bottom - top])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothed_normals_have_the_slopes_of_their_interpolation_and_keep_to_known_pixels() {
        let (w, h) = (24, 18);
        let normals: Vec<[f32; 3]> = (0..w * h)
            .map(|i| {
                let (x, y) = ((i % w) as f32, (i / w) as f32);
                let n = [0.2 + 0.03 * x, 0.1 - 0.02 * y, -1.0];
                let length = n.iter().map(|c| c * c).sum::<f32>().sqrt();
                if x < 4.0 { [0.0; 3] } else { n.map(|c| c / length) }
            })
            .collect();
        for blur in [0.0, 1.5] {
            let image = NormalImage::new(&normals, w, h, blur);
            assert!(image.at(2.0, 9.0).is_none() && image.at(-1.0, 3.0).is_none());
            assert!(image.at(23.8, 3.0).is_none() && image.at(Real::NAN, 3.0).is_none());
            let (u, v, d) = (12.3, 9.7, 1e-3);
            let (n, slope) = image.at(u, v).unwrap();
            let du = (image.at(u + d, v).unwrap().0 - image.at(u - d, v).unwrap().0) / (2.0 * d);
            let dv = (image.at(u, v + d).unwrap().0 - image.at(u, v - d).unwrap().0) / (2.0 * d);
            // Values are in single precision, their interpolation is not.
            assert!((slope.column(0) - du).norm() < 1e-9 && (slope.column(1) - dv).norm() < 1e-9);
            assert!((n.norm() - 1.0).abs() < 0.02, "{blur}: {}", n.norm());
        }
    }
}
