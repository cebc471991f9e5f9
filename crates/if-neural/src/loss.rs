//! The loss of a fit at one point.

use crate::trainable::{PointLoss, Sample32};
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// What is known at a training point, in network units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// φ wanted there.
    pub distance: f32,
    /// ∇φ wanted there, of unit length; anything where `normal` weighs nothing.
    pub gradient: [f32; 3],
    /// Weight of the distance, from 0 to 1.
    pub distance_trust: f32,
    /// Weight of the gradient, from 0 to 1.
    pub gradient_trust: f32,
}

/// Weights of the terms. With e = φ − d and ρ_s(x) = √(x² + s²) − s, quadratic below s and linear
/// above:
///
/// ```text
/// distance · ρ_distance_scale(e)  +  normal · ρ_normal_scale(|∇φ − n|)  +  eikonal · (|∇φ| − 1)² / 2
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LossParams {
    /// Weight of the distance.
    pub distance: f64,
    /// Errors of φ above this, in network units, count linearly: noise, folds that are not
    /// resolved.
    pub distance_scale: f64,
    /// Weight of the gradient's direction and length.
    pub normal: f64,
    /// Errors of ∇φ above this count linearly: creases, where a smooth field cannot follow.
    pub normal_scale: f64,
    /// Weight of |∇φ| = 1.
    pub eikonal: f64,
}

impl Default for LossParams {
    /// For targets without noise.
    fn default() -> Self {
        Self { distance: 1.0, distance_scale: 2e-3, normal: 0.01, normal_scale: 0.1, eikonal: 0.01 }
    }
}

/// ρ_s and its derivative divided by x.
fn robust(square: f64, s: f64) -> (f64, f64) {
    let root = (square + s * s).sqrt();
    // s is above zero: `LossParams::validate`.
    (root - s, 1.0 / root)
}

impl LossParams {
    /// The loss of `sample` against `known`, times `share`.
    #[inline]
    pub(crate) fn at(&self, known: &Known, sample: Sample32, share: f64) -> PointLoss {
        let g = sample.gradient.map(f64::from);
        let mut loss = 0.0;
        let mut d_value = 0.0;
        let mut d_gradient = [0.0; 3];
        if known.distance_trust > 0.0 {
            let e = f64::from(sample.value) - f64::from(known.distance);
            let w = self.distance * f64::from(known.distance_trust) * share;
            let (rho, slope) = robust(e * e, self.distance_scale);
            loss += w * rho;
            d_value = w * slope * e;
        }
        if known.gradient_trust > 0.0 {
            let r = [0, 1, 2].map(|k| g[k] - f64::from(known.gradient[k]));
            let w = self.normal * f64::from(known.gradient_trust) * share;
            let (rho, slope) = robust(r.iter().map(|x| x * x).sum(), self.normal_scale);
            loss += w * rho;
            (0..3).for_each(|k| d_gradient[k] += w * slope * r[k]);
        }
        if self.eikonal > 0.0 {
            let length = g.iter().map(|x| x * x).sum::<f64>().sqrt();
            let w = self.eikonal * share;
            loss += 0.5 * w * (length - 1.0).powi(2);
            // Where ∇φ vanishes the term has no gradient.
            if length > 0.0 {
                (0..3).for_each(|k| d_gradient[k] += w * (length - 1.0) * g[k] / length);
            }
        }
        PointLoss { loss, d_value: d_value as f32, d_gradient: d_gradient.map(|x| x as f32) }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for (name, value) in
            [("distance", self.distance), ("normal", self.normal), ("eikonal", self.eikonal)]
        {
            ParameterError::check_not_negative(name, value)?;
        }
        ParameterError::check_positive("distance_scale", self.distance_scale)?;
        ParameterError::check_positive("normal_scale", self.normal_scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_central_differences() {
        let params = LossParams {
            distance: 0.7,
            distance_scale: 0.2,
            normal: 0.4,
            normal_scale: 0.3,
            eikonal: 0.9,
        };
        let known = Known {
            distance: 0.1,
            gradient: [0.6, 0.0, 0.8],
            distance_trust: 0.5,
            gradient_trust: 0.25,
        };
        for (value, gradient) in
            [(0.4, [0.3, -0.2, 1.4]), (-3.0, [0.01, 0.0, 0.02]), (0.1, [0.6, 0.0, 0.8])]
        {
            let at = |dv: f32, dg: [f32; 3]| {
                params
                    .at(
                        &known,
                        Sample32 {
                            value: value + dv,
                            gradient: [0, 1, 2].map(|k| gradient[k] + dg[k]),
                        },
                        0.5,
                    )
                    .loss
            };
            let got = params.at(&known, Sample32 { value, gradient }, 0.5);
            let h = 1e-2f32;
            approx::assert_abs_diff_eq!(
                f64::from(got.d_value),
                (at(h, [0.0; 3]) - at(-h, [0.0; 3])) / 0.02,
                epsilon = 2e-3
            );
            for k in 0..3 {
                let mut d = [0.0; 3];
                d[k] = 1e-3;
                let slope = (at(0.0, d) - at(0.0, d.map(|x: f32| -x))) / 2e-3;
                approx::assert_abs_diff_eq!(f64::from(got.d_gradient[k]), slope, epsilon = 2e-3);
            }
        }
    }

    #[test]
    fn a_zero_gradient_without_trust_has_finite_loss_and_no_derivative() {
        let params = LossParams::default();
        let none = Known::default();
        let flat = params.at(&none, Sample32::default(), 1.0);
        assert_eq!((flat.d_value, flat.d_gradient), (0.0, [0.0; 3]));
        assert_eq!(flat.loss, 0.5 * params.eikonal);
    }

    #[test]
    fn weights_and_scales_out_of_range_are_rejected() {
        let good = LossParams::default();
        for (bad, name) in [
            (LossParams { distance: -1.0, ..good }, "distance"),
            (LossParams { normal: f64::INFINITY, ..good }, "normal"),
            (LossParams { eikonal: f64::NAN, ..good }, "eikonal"),
            (LossParams { distance_scale: 0.0, ..good }, "distance_scale"),
            (LossParams { normal_scale: f64::NAN, ..good }, "normal_scale"),
        ] {
            assert_eq!(bad.validate().map_err(|e| e.name), Err(name.into()));
        }
        assert_eq!(
            LossParams { distance: 0.0, normal: 0.0, eikonal: 0.0, ..good }.validate(),
            Ok(())
        );
    }
}
