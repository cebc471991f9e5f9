//! Exact signs of determinants: on which side of a plane or a line a point lies.
//!
//! Three stages, each entered only where the one before cannot decide: a floating-point filter
//! whose error bound holds with underflow and overflow; the adaptive predicates of the crate
//! `robust`, which are exact while no product of three coordinates leaves the range of `f64`; and
//! integers of any length ([`super::wide`]). Together they are exact for all finite input.

use super::wide;
use crate::math::{Point, Real, Vector};

/// Bound of the filter, relative to the sum of the products' magnitudes. Eight roundings lie
/// between the input and the result, 8 · 2⁻⁵³ = 8.9e-16; the rest covers the rounding of the bound
/// itself. Smaller would be wrong, ten times larger sends ten times as many calls to the slower
/// stages.
pub(super) const FILTER: Real = 1.2e-15;
/// Added to every magnitude: times [`FILTER`] it exceeds what underflow can take from a product.
pub(super) const UNDERFLOW: Real = 1e-300;
/// Coordinates between which `robust` is exact: its smallest number is a product of three last
/// digits, (2⁻³⁰⁰ · 2⁻⁵²)³ = 2⁻¹⁰⁵⁶, its largest below 2³³⁰ ^ 3 · 2⁵, both in the range of `f64`.
const EXACT_RANGE: [Real; 2] = [4.909093465297727e-91, 2.187250724783012e+99];

/// The plane through three points, ready to classify many others.
#[derive(Clone, Copy)]
pub(super) struct Plane<'a> {
    corners: [&'a Point; 3],
    /// `(b − a) × (c − a)`, rounded.
    pub(super) normal: Vector,
    magnitude: Vector,
}

impl<'a> Plane<'a> {
    #[inline]
    pub(super) fn new(corners: [&'a Point; 3]) -> Self {
        let [a, b, c] = corners;
        let (u, v) = (b - a, c - a);
        let (xy, yx) = (u.x * v.y, u.y * v.x);
        let (yz, zy) = (u.y * v.z, u.z * v.y);
        let (zx, xz) = (u.z * v.x, u.x * v.z);
        let normal = Vector::new(yz - zy, zx - xz, xy - yx);
        let magnitude = Vector::new(
            yz.abs() + zy.abs() + UNDERFLOW,
            zx.abs() + xz.abs() + UNDERFLOW,
            xy.abs() + yx.abs() + UNDERFLOW,
        );
        Self { corners, normal, magnitude }
    }

    /// +1 where `p` sees the corners counter-clockwise, −1 where clockwise, 0 in the plane,
    /// exactly.
    #[inline]
    pub(super) fn side(&self, p: &Point) -> i8 {
        let d = p - self.corners[0];
        let det = self.normal.x * d.x + self.normal.y * d.y + self.normal.z * d.z;
        let m = &self.magnitude;
        let bound = FILTER * (m.x * d.x.abs() + m.y * d.y.abs() + m.z * d.z.abs() + UNDERFLOW);
        // A NaN or an infinity from overflow fails both comparisons.
        if det > bound {
            1
        } else if det < -bound {
            -1
        } else {
            exact_side(self.corners, p)
        }
    }
}

/// Sign of `((b − a) × (c − a)) · (p − a)`, exactly, for all finite input: +1 where `p` sees `a`,
/// `b`, `c` counter-clockwise, −1 where clockwise, 0 where the four lie in one plane.
#[inline]
pub fn side_of_plane(a: &Point, b: &Point, c: &Point, p: &Point) -> i8 {
    Plane::new([a, b, c]).side(p)
}

#[cold]
#[inline(never)]
fn exact_side([a, b, c]: [&Point; 3], p: &Point) -> i8 {
    if p == a || p == b || p == c {
        return 0;
    }
    if [a, b, c, p].iter().all(|q| q.iter().all(|x| in_exact_range(*x))) {
        let to = |q: &Point| robust::Coord3D { x: q.x, y: q.y, z: q.z };
        -sign(robust::orient3d(to(a), to(b), to(c), to(p)))
    } else {
        wide::side_of_plane(a, b, c, p)
    }
}

/// A point of a coordinate plane.
pub(super) type Point2 = [Real; 2];

/// Sign of `(b − a) × (p − a)`, exactly, for all finite input: +1 where `p` lies to the left of the
/// line from `a` to `b`.
pub(super) fn side_of_line(a: Point2, b: Point2, p: Point2) -> i8 {
    if p == a || p == b || a == b {
        return 0;
    }
    if [a, b, p].iter().flatten().all(|x| in_exact_range(*x)) {
        let to = |q: Point2| robust::Coord { x: q[0], y: q[1] };
        sign(robust::orient2d(to(a), to(b), to(p)))
    } else {
        wide::side_of_line(a, b, p)
    }
}

#[inline]
fn in_exact_range(x: Real) -> bool {
    let m = x.abs();
    m == 0.0 || (EXACT_RANGE[0]..=EXACT_RANGE[1]).contains(&m)
}

#[inline]
fn sign(x: Real) -> i8 {
    i8::from(x > 0.0) - i8::from(x < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_is_what_its_comment_says() {
        assert_eq!(EXACT_RANGE, [2.0f64.powi(-300), 2.0f64.powi(330)]);
    }

    #[test]
    fn a_point_one_ulp_off_the_plane_is_seen_at_every_scale() {
        for exponent in [-1070, -700, -350, -300, -100, 0, 100, 320, 330, 340, 1000] {
            // 2^exponent itself may be denormal: all products below are exact multiples of it.
            let s = if exponent < -1000 {
                f64::MIN_POSITIVE * 2.0f64.powi(exponent + 1022)
            } else {
                2.0f64.powi(exponent)
            };
            let [a, b, c] =
                [Point::new(s, 0.0, 0.0), Point::new(0.0, s, 0.0), Point::new(0.0, 0.0, s)];
            let third = s * 0.25;
            let on = Point::new(s * 0.5, third, third);
            assert_eq!(side_of_plane(&a, &b, &c, &on), 0, "2^{exponent}");
            if exponent > -1000 {
                let up = Point::new(on.x, on.y, on.z.next_up());
                let down = Point::new(on.x, on.y, on.z.next_down());
                assert_eq!(side_of_plane(&a, &b, &c, &up), 1, "2^{exponent}");
                assert_eq!(side_of_plane(&a, &b, &c, &down), -1, "2^{exponent}");
                assert_eq!(
                    side_of_line([s, 0.0], [0.0, s], [s * 0.5, (s * 0.5).next_up()]),
                    -side_of_line([0.0, s], [s, 0.0], [s * 0.5, (s * 0.5).next_up()])
                );
                assert_eq!(side_of_line([0.0, s], [s, 0.0], [s * 0.5, (s * 0.5).next_up()]), 1);
            }
        }
    }

    #[test]
    fn scales_may_be_mixed() {
        let a = Point::new(1e-300, 0.0, 0.0);
        let b = Point::new(0.0, 1e300, 0.0);
        let c = Point::new(0.0, 0.0, 1.0);
        assert_eq!(side_of_plane(&a, &b, &c, &Point::origin()), -1);
        assert_eq!(side_of_plane(&a, &c, &b, &Point::origin()), 1);
        assert_eq!(side_of_plane(&a, &b, &c, &Point::new(5e-324, 0.0, 1.0)), 1);
        assert_eq!(side_of_plane(&a, &b, &c, &Point::new(-5e-324, 0.0, 1.0)), -1);
        let m = f64::MAX;
        assert_eq!(
            side_of_plane(
                &Point::new(m, m, -m),
                &Point::new(-m, m, -m),
                &Point::new(m, -m, -m),
                &Point::new(0.0, 0.0, m)
            ),
            1
        );
    }
}
