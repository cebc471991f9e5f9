//! The Newton step to the surface of a field.

use if_core::field::FieldSample;
use if_core::math::{Real, Vector};

/// The step φ ∇φ / |∇φ|² to the surface, at most `limit` long. Zero where the gradient is too small
/// for a direction.
pub(crate) fn newton_step(s: &FieldSample, limit: Real) -> Vector {
    /// A distance has a gradient of length 1; below a tenth the linear model of the field means
    /// nothing.
    const FLAT: Real = 0.1;
    let g2 = s.gradient.norm_squared();
    if !(s.distance.is_finite() && g2 >= FLAT * FLAT && g2.is_finite()) {
        return Vector::zeros();
    }
    let step = s.gradient * (s.distance / g2);
    let length = step.norm();
    if length > limit { step * (limit / length) } else { step }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_newton_step_is_bounded_and_needs_a_slope() {
        let step = |distance, slope| {
            newton_step(&FieldSample { distance, gradient: Vector::new(0.0, slope, 0.0) }, 0.5)
        };
        assert_eq!(step(0.25, 2.0).y, 0.125);
        assert_eq!(step(-9.0, 1.0).y, -0.5);
        for (distance, slope) in
            [(1.0, 0.01), (Real::INFINITY, 1.0), (1.0, Real::NAN), (Real::NAN, 1.0)]
        {
            assert_eq!(step(distance, slope), Vector::zeros());
        }
    }
}
