//! The loss of a deformation at one point: data, rigidity and smallness.

use super::DeformParams;
use crate::deformation::{OffsetLoss, OffsetSample};
use if_core::nalgebra::Matrix3;

/// F = 1 + ∂d/∂x.
fn gradient_of(s: &OffsetSample) -> Matrix3<f64> {
    Matrix3::from_fn(|r, c| f64::from(s.jacobian[r][c]) + f64::from(u8::from(r == c)))
}

/// (FᵀF − 1) / 2.
pub(super) fn strain(s: &OffsetSample) -> Matrix3<f64> {
    let f = gradient_of(s);
    (f.transpose() * f - Matrix3::identity()) * 0.5
}

impl DeformParams {
    /// The loss at a point where `wanted` is the offset, if it is known.
    pub(super) fn loss(
        &self,
        wanted: Option<&[f32; 3]>,
        s: &OffsetSample,
        share: f64,
    ) -> OffsetLoss {
        let d = s.offset.map(f64::from);
        let (mut loss, mut d_offset) = (0.0, [0.0; 3]);
        if let Some(wanted) = wanted {
            let e = [0, 1, 2].map(|k| d[k] - f64::from(wanted[k]));
            let root =
                (e.iter().map(|x| x * x).sum::<f64>() + self.data_scale * self.data_scale).sqrt();
            loss += self.data * share * (root - self.data_scale);
            (0..3).for_each(|k| d_offset[k] += self.data * share * e[k] / root);
        }
        // Geman and McClure 1985: s / (s + c²).
        let bounded = |square: f64, c: f64| {
            let below = square + c * c;
            (square / below, c * c / (below * below))
        };
        let (small, slope) = bounded(d.iter().map(|x| x * x).sum(), self.small_scale);
        loss += self.small * share * small;
        (0..3).for_each(|k| d_offset[k] += self.small * share * slope * 2.0 * d[k]);
        let (f, e) = (gradient_of(s), strain(s));
        let (stretched, slope) = bounded(e.norm_squared(), self.rigidity_scale);
        loss += self.rigidity * share * stretched;
        let by_f = f * e * (2.0 * self.rigidity * share * slope);
        let d_jacobian = [0, 1, 2].map(|r| [0, 1, 2].map(|c| by_f[(r, c)] as f32));
        OffsetLoss { loss, d_offset: d_offset.map(|x| x as f32), d_jacobian }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_of_the_loss_are_central_differences() {
        let params = DeformParams {
            rigidity: 0.7,
            small: 0.4,
            data: 0.9,
            data_scale: 0.1,
            small_scale: 0.5,
            ..Default::default()
        };
        let sample = OffsetSample {
            offset: [0.1, -0.2, 0.05],
            jacobian: [[0.1, 0.3, -0.2], [0.0, -0.1, 0.4], [0.2, 0.1, 0.3]],
        };
        let at = |s: &OffsetSample| params.loss(Some(&[0.3, 0.1, 0.0]), s, 0.5);
        let got = at(&sample);
        let h = 1e-3f32;
        for k in 0..3 {
            let moved = |d: f32| {
                let mut s = sample;
                s.offset[k] += d;
                at(&s).loss
            };
            approx::assert_abs_diff_eq!(
                f64::from(got.d_offset[k]),
                (moved(h) - moved(-h)) / 2e-3,
                epsilon = 1e-4
            );
            for c in 0..3 {
                let moved = |d: f32| {
                    let mut s = sample;
                    s.jacobian[k][c] += d;
                    at(&s).loss
                };
                approx::assert_abs_diff_eq!(
                    f64::from(got.d_jacobian[k][c]),
                    (moved(h) - moved(-h)) / 2e-3,
                    epsilon = 1e-4
                );
            }
        }
        let turned = OffsetSample {
            offset: [0.0; 3],
            jacobian: [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0; 3]],
        };
        assert!(strain(&turned).norm() < 1e-12, "a turn by 90° is rigid");
    }
}
