//! Scalars, points and vectors, and the few formulas on triangles that every crate needs.

use nalgebra::Matrix3;

/// The scalar of geometry and solver.
pub type Real = f64;
/// A position, in metres.
pub type Point = nalgebra::Point3<Real>;
/// A direction or displacement, in metres.
pub type Vector = nalgebra::Vector3<Real>;

/// The smaller of two numbers, and `b` if one of them is NaN: one instruction, where [`Real::min`]
/// takes four.
#[inline(always)]
pub fn smaller(a: Real, b: Real) -> Real {
    if a < b { a } else { b }
}

/// The larger of two numbers, and `b` if one of them is NaN: one instruction, where [`Real::max`]
/// takes four.
#[inline(always)]
pub fn larger(a: Real, b: Real) -> Real {
    if a > b { a } else { b }
}

/// Twice the area of the triangle `(a, b, c)` times its unit normal: zero for a degenerate one.
#[inline]
pub fn area_vector(a: &Point, b: &Point, c: &Point) -> Vector {
    (b - a).cross(&(c - a))
}

/// `v / |v|`, or the zero vector where `|v|` is zero or no finite number.
///
/// Scales by the largest component first, so that neither `1e-300` nor `1e300` is lost.
#[inline]
pub fn unit_or_zero(v: &Vector) -> Vector {
    let scale = v.amax();
    let w = v / scale;
    let length = w.norm();
    // The largest of some numbers may pass a NaN over; the length does not.
    if scale > 0.0 && scale.is_finite() && length.is_finite() {
        w / length
    } else {
        Vector::zeros()
    }
}

/// The point `Σ bₖ pₖ` of a triangle for barycentric coordinates `b`.
#[inline]
pub fn barycentric_point(corners: [&Point; 3], b: [Real; 3]) -> Point {
    Point::from(corners[0].coords * b[0] + corners[1].coords * b[1] + corners[2].coords * b[2])
}

/// Two directions in the plane of a triangle and its normal, as columns; `None` if it has no area.
pub fn triangle_frame([a, b, c]: [&Point; 3]) -> Option<Matrix3<Real>> {
    let first = (b - a).try_normalize(0.0)?;
    let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
    Some(Matrix3::from_columns(&[first, normal.cross(&first), normal]))
}

/// `v` turned by a matrix, with its length.
pub fn turned(turn: &Matrix3<Real>, v: &Vector) -> Vector {
    let to = turn * v;
    let (old, new) = (v.norm(), to.norm());
    if new > 0.0 { to * (old / new) } else { *v }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_vector_survives_extreme_lengths() {
        for s in [1e-300, 1e-9, 1.0, 1e9, 1e300] {
            let u = unit_or_zero(&Vector::new(3.0 * s, 0.0, 4.0 * s));
            approx::assert_relative_eq!(u, Vector::new(0.6, 0.0, 0.8), max_relative = 1e-15);
        }
        assert_eq!(unit_or_zero(&Vector::zeros()), Vector::zeros());
        assert_eq!(unit_or_zero(&Vector::new(Real::INFINITY, 0.0, 0.0)), Vector::zeros());
        for k in 0..3 {
            let mut v = Vector::new(1.0, -2.0, 3.0);
            v[k] = Real::NAN;
            assert_eq!(unit_or_zero(&v), Vector::zeros());
        }
    }
}
