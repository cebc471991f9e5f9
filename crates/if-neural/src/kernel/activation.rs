//! Softplus, its slope and its curvature, vector by vector.

use pulp::{Simd, WithSimd};

use super::isa::fma;

/// (eʳ − 1 − r)/r² on [−ln 2/2, ln 2/2]: Chebyshev fit, error 7e-8 of a term below 0.12.
const EXP: [f32; 5] = [0.5, 0.166_665_76, 0.041_666_552, 0.008_363_346, 0.001_392_639_2];

/// ln(1 + e)/e on [0, 1]: Chebyshev fit, error 4e-8.
const LOG: [f32; 9] = [
    0.999_999_94,
    -0.499_994_46,
    0.333_181_2,
    -0.248_353_99,
    0.190_768_81,
    -0.136_022_48,
    0.077_516_09,
    -0.029_074_065,
    0.005_126_102,
];

/// 1.5·2²³: added to a number below 2²², it leaves the nearest integer in the low bits.
const ROUND: f32 = 12_582_912.0;

/// −βz from which an activation is shut.
const SHUT: f32 = 40.0;

/// ln 2 in two parts, the first of 9 bits so that its multiples are exact.
const LN2_HIGH: f32 = 0.693_359_4;
const LN2_LOW: f32 = -0.000_212_194_44;

/// softplus(βz)/β and its derivative.
///
/// With e = exp(−|βz|): `max(z, 0) + ln(1 + e)/β`, which needs no threshold and cannot overflow;
/// the slope is `1/(1 + e)`, times e where z < 0.
///
/// # Accuracy
///
/// The value to 1.2e-7/β + half a unit in the last place, the slope to (3 + |βz|)·1e-7 relative
/// where |βz| < 40 (the rounding of βz); the slope stays at e⁻⁴⁰ = 4e-18 beyond, and the value at
/// 4e-18/β, far below the rounding of any sum that they enter: what is smaller leaves the normal
/// numbers within a layer or two, and Intel's processors take 100 cycles for such a product. NaN
/// gives NaN.
#[inline(always)]
fn softplus<S: Simd>(simd: S, z: S::f32s, beta: S::f32s, inverse: S::f32s) -> (S::f32s, S::f32s) {
    let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
    let t = simd.mul_f32s(z, beta);
    // −|t|, and no lower than where e has long vanished beside 1.
    let n = simd.min_f32s(t, simd.sub_f32s(zero, t));
    let n = simd.max_f32s(n, simd.splat_f32s(-SHUT));
    let y = fma(simd, n, simd.splat_f32s(std::f32::consts::LOG2_E), simd.splat_f32s(ROUND));
    let m = simd.sub_f32s(y, simd.splat_f32s(ROUND));
    let r = fma(simd, m, simd.splat_f32s(-LN2_HIGH), n);
    let r = fma(simd, m, simd.splat_f32s(-LN2_LOW), r);
    let mut q = simd.splat_f32s(EXP[4]);
    for k in (0..4).rev() {
        q = fma(simd, q, r, simd.splat_f32s(EXP[k]));
    }
    let q = fma(simd, simd.mul_f32s(r, r), q, r);
    let q = simd.add_f32s(q, one);
    // Times 2ᵐ, in the exponent's bits.
    let m = simd.wrapping_dyn_shl_u32s(simd.transmute_u32s_f32s(y), simd.splat_u32s(23));
    let e = simd.transmute_f32s_u32s(simd.add_u32s(simd.transmute_u32s_f32s(q), m));
    let reciprocal = simd.div_f32s(one, simd.add_f32s(one, e));
    let mut l = simd.splat_f32s(LOG[8]);
    for k in (0..8).rev() {
        l = fma(simd, l, e, simd.splat_f32s(LOG[k]));
    }
    let l = simd.mul_f32s(l, e);
    // By comparisons rather than `max`, which may return a number for a NaN z.
    let shut = simd.less_than_or_equal_f32s(t, zero);
    let value = fma(simd, l, inverse, simd.select_f32s(shut, zero, z));
    let slope = simd.select_f32s(shut, simd.mul_f32s(e, reciprocal), reciprocal);
    (value, slope)
}

/// z → softplus in place, its slopes to `slopes` (unchanged if it is empty). The first `features`
/// of each of the `points` rows, rounded up to vectors.
pub(crate) struct Softplus<'a> {
    pub(crate) z: &'a mut [f32],
    pub(crate) slopes: &'a mut [f32],
    pub(crate) stride: usize,
    pub(crate) features: usize,
    pub(crate) points: usize,
    pub(crate) beta: f32,
}

impl WithSimd for Softplus<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Softplus { z, slopes, stride, features, points, beta } = self;
        let features = features.next_multiple_of(S::F32_LANES);
        let (b, inverse) = (simd.splat_f32s(beta), simd.splat_f32s(1.0 / beta));
        for n in 0..points {
            let at = n * stride..n * stride + features;
            let (z, _) = S::as_mut_simd_f32s(&mut z[at.clone()]);
            if slopes.is_empty() {
                for z in z {
                    *z = softplus(simd, *z, b, inverse).0;
                }
            } else {
                let (slopes, _) = S::as_mut_simd_f32s(&mut slopes[at]);
                for (z, slope) in z.iter_mut().zip(slopes) {
                    (*z, *slope) = softplus(simd, *z, b, inverse);
                }
            }
        }
    }
}

/// `out[n][k] = a[n][k]·b[n][k]`, over whole arrays of one length (a multiple of 16).
pub(crate) struct Multiply<'a> {
    pub(crate) a: &'a [f32],
    pub(crate) b: &'a [f32],
    pub(crate) out: &'a mut [f32],
}

impl WithSimd for Multiply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (a, _) = S::as_simd_f32s(self.a);
        let (b, _) = S::as_simd_f32s(self.b);
        let (out, _) = S::as_mut_simd_f32s(self.out);
        for ((out, &a), &b) in out.iter_mut().zip(a).zip(b) {
            *out = simd.mul_f32s(a, b);
        }
    }
}

/// `row[n][k] *= b[n][k]` in place.
pub(crate) struct Scale<'a> {
    pub(crate) a: &'a mut [f32],
    pub(crate) b: &'a [f32],
}

impl WithSimd for Scale<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (a, _) = S::as_mut_simd_f32s(self.a);
        let (b, _) = S::as_simd_f32s(self.b);
        for (a, &b) in a.iter_mut().zip(b) {
            *a = simd.mul_f32s(*a, b);
        }
    }
}

/// The middle of the reverse of the adjoint: with m the product of W and the tangent, in place
/// `moved ← m·s` (the next tangent) and `q ← m·q·β·s·(1 − s)` (what σ″ takes up).
pub(crate) struct Curve<'a> {
    pub(crate) moved: &'a mut [f32],
    pub(crate) q: &'a mut [f32],
    pub(crate) s: &'a [f32],
    pub(crate) beta: f32,
}

impl WithSimd for Curve<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (beta, one) = (simd.splat_f32s(self.beta), simd.splat_f32s(1.0));
        let (moved, _) = S::as_mut_simd_f32s(self.moved);
        let (q, _) = S::as_mut_simd_f32s(self.q);
        let (s, _) = S::as_simd_f32s(self.s);
        for ((m, q), &s) in moved.iter_mut().zip(q).zip(s) {
            let next = simd.mul_f32s(*m, s);
            let rest = simd.mul_f32s(beta, simd.sub_f32s(one, s));
            *q = simd.mul_f32s(simd.mul_f32s(next, rest), *q);
            *m = next;
        }
    }
}

/// `a ← a·s + c` in place.
pub(crate) struct ScaleAdd<'a> {
    pub(crate) a: &'a mut [f32],
    pub(crate) s: &'a [f32],
    pub(crate) c: &'a [f32],
}

impl WithSimd for ScaleAdd<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (a, _) = S::as_mut_simd_f32s(self.a);
        let (s, _) = S::as_simd_f32s(self.s);
        let (c, _) = S::as_simd_f32s(self.c);
        for ((a, &s), &c) in a.iter_mut().zip(s).zip(c) {
            *a = fma(simd, *a, s, c);
        }
    }
}

/// Closes rows where a ReLU is shut: `rows[b][n][k] ← 0` where `z[n][k] ≤ 0`, for the blocks b of
/// `block` rows each, the first `points` rows of each. An empty `z` means the first block.
pub(crate) struct Relu<'a> {
    pub(crate) z: &'a [f32],
    pub(crate) rows: &'a mut [f32],
    pub(crate) stride: usize,
    pub(crate) block: usize,
    pub(crate) points: usize,
}

impl WithSimd for Relu<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let zero = simd.splat_f32s(0.0);
        let (z, _) = S::as_simd_f32s(self.z);
        let (rows, _) = S::as_mut_simd_f32s(self.rows);
        let (stride, step) = (self.stride / S::F32_LANES, self.block * self.stride / S::F32_LANES);
        for at in 0..self.points * stride {
            let z = if z.is_empty() { rows[at] } else { z[at] };
            // Not "where it is above 0": NaN must not become 0.
            let shut = simd.less_than_or_equal_f32s(z, zero);
            let mut at = at;
            while at < rows.len() {
                rows[at] = simd.select_f32s(shut, zero, rows[at]);
                at += step;
            }
        }
    }
}

/// `start + Σ_k a[k]·b[k]`, over the shorter of the two: the products exact and their sum in f64,
/// in eight parts whatever the instruction set. The one sum of a point that nothing follows.
pub(crate) struct Dot<'a> {
    pub(crate) a: &'a [f32],
    pub(crate) b: &'a [f32],
    pub(crate) start: f32,
}

impl WithSimd for Dot<'_> {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> f32 {
        let len = self.a.len().min(self.b.len());
        let (a, a_rest) = self.a[..len].as_chunks::<8>();
        let (b, b_rest) = self.b[..len].as_chunks::<8>();
        let mut sums = [0.0_f64; 8];
        for (a, b) in a.iter().zip(b) {
            for k in 0..8 {
                sums[k] += f64::from(a[k]) * f64::from(b[k]);
            }
        }
        let rest: f64 = a_rest.iter().zip(b_rest).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
        (sums.iter().sum::<f64>() + rest + f64::from(self.start)) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::isa::Isa;

    #[test]
    fn softplus_and_its_slope_are_those_of_f64_on_every_instruction_set() {
        for isa in Isa::all() {
            for beta in [1.0_f32, 10.0, 100.0] {
                let zs: Vec<f32> = (-6400..=6400)
                    .map(|k| k as f32 / 64.0)
                    .chain([0.0, -0.0, 1e-30, -1e-30, 1e30, -1e30, 0.2, -0.2])
                    .map(|t| t / beta)
                    .collect();
                let mut z = zs.clone();
                z.resize(zs.len().next_multiple_of(16), 0.0);
                let (features, mut slopes) = (z.len(), vec![0.0; z.len()]);
                let stride = features;
                let slopes_of = &mut slopes;
                isa.run(Softplus {
                    z: &mut z,
                    slopes: slopes_of,
                    stride,
                    features,
                    points: 1,
                    beta,
                });
                for (k, &at) in zs.iter().enumerate() {
                    let t = f64::from(beta) * f64::from(at);
                    let value = (t.max(0.0) + (-t.abs()).exp().ln_1p()) / f64::from(beta);
                    let slope = 1.0 / (1.0 + (-t).exp());
                    let error = (f64::from(z[k]) - value).abs();
                    assert!(
                        error <= 1.2e-7 / f64::from(beta) + 6.1e-8 * value,
                        "{} β {beta}: softplus({at}) is off by {error}",
                        isa.name()
                    );
                    let error = (f64::from(slopes[k]) - slope).abs();
                    let bound = (3.0 + t.abs()) * 1e-7 * slope;
                    let shut = if t < f64::from(-SHUT) { 4.3e-18 } else { 0.0 };
                    assert!(error <= bound + shut, "{}: slope at {at}", isa.name());
                    // Below the normal numbers some processors are a hundred times slower.
                    for number in [z[k], slopes[k]] {
                        assert!(
                            number.is_normal() && number * 1e-16 >= f32::MIN_POSITIVE,
                            "{}: {number} at {at}",
                            isa.name()
                        );
                    }
                }
            }
        }
    }
}
