//! Positional encoding: the sines and cosines that let a small network see fine detail.

/// `[x, sin x, cos x, sin 2x, cos 2x, …, sin 2ᵏx, cos 2ᵏx]`, each entry for the three axes, without
/// the factor π, the input included: 3 + 6·bands features.
///
/// Feature `o` depends on the coordinate `o % 3` alone, which is what its derivative rests on. The
/// order is that of the embedders of NeRF and IDR, so that weights carry over.
///
/// # Source
///
/// Supplement, Appendix E and Figure 5, which cites NeRF [Mildenhall et al. 2021]. The count of
/// bands (6) and the missing π are those of the lineage (IDR, SelfRecon).
///
/// # Accuracy
///
/// Angles are doubled in f64 and rounded to f32 once: the features are those of the f64 twin to
/// half a unit in the last place, for any count of bands that a config accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PositionalEncoding {
    /// Count of bands; band k has the frequency 2ᵏ.
    pub(crate) bands: usize,
}

impl PositionalEncoding {
    /// Count of features: 3 + 6·bands.
    pub(crate) const fn width(self) -> usize {
        3 + 6 * self.bands
    }

    /// The features of `x` and, entry by entry, their derivatives by the coordinate `o % 3`.
    /// `weights` has one factor per band (see [`band_weights`]), or is empty for all ones.
    ///
    /// # Panics
    ///
    /// If `features` or `slopes` is shorter than [`Self::width`].
    pub(crate) fn encode(
        self,
        x: [f32; 3],
        weights: &[f32],
        features: &mut [f32],
        slopes: &mut [f32],
    ) {
        let width = self.width();
        let (features, slopes) = (&mut features[..width], &mut slopes[..width]);
        self.visit(x.map(f64::from), weights, |o, value, slope| {
            features[o] = value as f32;
            slopes[o] = slope as f32;
        });
    }

    /// [`Self::encode`] in f64, for the reference networks.
    ///
    /// # Panics
    ///
    /// If `features` or `slopes` is shorter than [`Self::width`].
    pub(crate) fn encode64(
        self,
        x: [f64; 3],
        weights: &[f32],
        features: &mut [f64],
        slopes: &mut [f64],
    ) {
        let width = self.width();
        let (features, slopes) = (&mut features[..width], &mut slopes[..width]);
        self.visit(x, weights, |o, value, slope| {
            features[o] = value;
            slopes[o] = slope;
        });
    }

    #[inline]
    fn visit(self, x: [f64; 3], weights: &[f32], mut put: impl FnMut(usize, f64, f64)) {
        for axis in 0..3 {
            put(axis, x[axis], 1.0);
            let (mut sin, mut cos) = x[axis].sin_cos();
            let mut frequency = 1.0;
            for band in 0..self.bands {
                let w = weights.get(band).map_or(1.0, |&w| f64::from(w));
                let at = 3 + 6 * band + axis;
                put(at, w * sin, w * frequency * cos);
                put(at + 3, w * cos, -w * frequency * sin);
                (sin, cos) = (2.0 * sin * cos, (cos - sin) * (cos + sin));
                frequency *= 2.0;
            }
        }
    }
}

/// The weights of the bands while they fade in: `(1 − cos(π·clamp(α − k, 0, 1)))/2` for band k.
///
/// # Source
///
/// The coarse-to-fine annealing of Nerfies [Park et al. 2021], as the lineage uses it for `d`.
pub fn band_weights(bands: usize, alpha: f32) -> Vec<f32> {
    (0..bands)
        .map(|k| {
            let t = (f64::from(alpha) - k as f64).clamp(0.0, 1.0);
            ((1.0 - (std::f64::consts::PI * t).cos()) / 2.0) as f32
        })
        .collect()
}

/// α of the lineage's schedule: `bands·(iteration/2500 + 0.5)`. All bands are in from iteration
/// 1,250 on.
pub(crate) fn annealing_alpha(bands: usize, iteration: usize) -> f32 {
    (bands as f64 * (iteration as f64 / 2500.0 + 0.5)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENCODING: PositionalEncoding = PositionalEncoding { bands: 6 };

    #[test]
    fn six_bands_give_39_features_in_the_order_of_the_lineage() {
        assert_eq!(ENCODING.width(), 39);
        let x = [0.3_f32, -0.7, 1.1];
        let (mut f, mut s) = ([0.0; 39], [0.0; 39]);
        ENCODING.encode(x, &[], &mut f, &mut s);
        assert_eq!(&f[..3], &x);
        for band in 0..6 {
            let frequency = f64::from(1_u32 << band);
            for axis in 0..3 {
                let angle = frequency * f64::from(x[axis]);
                assert_eq!(f[3 + 6 * band + axis], angle.sin() as f32);
                assert_eq!(f[6 + 6 * band + axis], angle.cos() as f32);
            }
        }
    }

    #[test]
    fn the_slopes_are_the_derivatives_by_central_differences() {
        let weights = band_weights(6, 3.4);
        let x = [0.3, -0.7, 1.1];
        let (mut f, mut s) = ([0.0; 39], [0.0; 39]);
        ENCODING.encode64(x, &weights, &mut f, &mut s);
        let h = 1e-6;
        for axis in 0..3 {
            let ends: Vec<[f64; 39]> = [-h, h]
                .iter()
                .map(|step| {
                    let mut at = x;
                    at[axis] += step;
                    let (mut f, mut s) = ([0.0; 39], [0.0; 39]);
                    ENCODING.encode64(at, &weights, &mut f, &mut s);
                    f
                })
                .collect();
            for o in 0..39 {
                let difference = (ends[1][o] - ends[0][o]) / (2.0 * h);
                let expected = if o % 3 == axis { s[o] } else { 0.0 };
                // Third derivative 32³ · h²/6 is 5e-9, rounding 1e-16/h is 1e-10.
                assert!((difference - expected).abs() < 2e-8, "feature {o}, axis {axis}");
            }
        }
    }

    #[test]
    fn bands_fade_in_one_after_the_other() {
        assert_eq!(band_weights(6, f32::INFINITY), vec![1.0; 6]);
        assert_eq!(band_weights(3, 0.0), vec![0.0; 3]);
        let half = band_weights(3, 1.5);
        assert_eq!((half[0], half[2]), (1.0, 0.0));
        assert!((half[1] - 0.5).abs() < 1e-7);
        assert_eq!(annealing_alpha(6, 0), 3.0);
        assert_eq!(annealing_alpha(6, 1250), 6.0);
    }
}
