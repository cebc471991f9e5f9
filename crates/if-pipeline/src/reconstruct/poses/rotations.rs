//! Derivatives of the logarithm of rotations.

use super::twists::cross;
use if_core::math::{Real, Vector};
use nalgebra::{Matrix3, UnitQuaternion};

/// The rotation vector of q: its axis times its angle, at most π.
pub(super) fn log(q: &UnitQuaternion<Real>) -> Vector {
    q.scaled_axis()
}

/// The derivative of log(q exp(δ)) at δ = 0, for φ = log(q): the inverse of the right Jacobian. That
/// of log(exp(δ) q) is its transpose.
///
/// ```text
/// J = I + ½ [φ] + (1/θ² − (1 + cos θ) / (2 θ sin θ)) [φ]²
/// ```
pub(super) fn log_slope(phi: &Vector) -> Matrix3<Real> {
    let theta = phi.norm();
    let k = cross(phi);
    // The factor tends to 1/12; below this angle it differs from that by less than rounding. At π it
    // is 1/π², where the cotangent below tends to 0.
    let factor = if theta < 1e-4 {
        1.0 / 12.0
    } else {
        let half = 0.5 * theta;
        (1.0 - half * half.cos() / half.sin().max(Real::MIN_POSITIVE)) / (theta * theta)
    };
    Matrix3::identity() + k * 0.5 + k * k * factor
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_of_the_logarithm_match_differences() {
        for phi in [
            Vector::zeros(),
            Vector::new(1e-6, 0.0, -2e-6),
            Vector::new(0.3, -0.2, 0.1),
            Vector::new(-1.5, 1.2, 1.0),
            Vector::new(0.0, 3.1, 0.0),
        ] {
            let q = UnitQuaternion::new(phi);
            let (right, h) = (log_slope(&phi), 1e-6);
            for axis in 0..3 {
                let mut d = Vector::zeros();
                d[axis] = h;
                let (up, down) = (UnitQuaternion::new(d), UnitQuaternion::new(-d));
                let after = (log(&(q * up)) - log(&(q * down))) / (2.0 * h);
                let before = (log(&(up * q)) - log(&(down * q))) / (2.0 * h);
                let (a, b) = (right.column(axis), right.transpose().column(axis).into_owned());
                // Differences of step 1e-6 round at 1e-10.
                assert!((after - a).norm() < 1e-7, "{phi:?} {axis}: {after} {a}");
                assert!((before - b).norm() < 1e-7, "{phi:?} {axis}");
            }
        }
    }
}
