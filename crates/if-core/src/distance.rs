//! The distance of two triangles, between two bounds.

use crate::closest::{closest_on_segment, closest_on_triangle};
use crate::intersect;
use crate::math::{Point, Real, Vector, barycentric_point, unit_or_zero};

/// Rounding of a few products and sums of coordinates, relative to the size of both triangles. The
/// bounds are taken apart by it; a tenth of it is less than what `f64` loses.
const ROUNDING: Real = 16.0 * Real::EPSILON;
/// Width of the bounds, relative to the size, above which the nearest points are refined. Nearly all
/// pairs are below it; the rest are needles and edges that are nearly parallel.
const TIGHT: Real = 1e-12;
/// Maximum number of refinements.
const REFINEMENTS: usize = 8;

/// Bounds of a distance, in metres: it is at least `lower` and at most `upper`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceBounds {
    /// At least 0.
    pub lower: Real,
    /// At least `lower`.
    pub upper: Real,
}

impl DistanceBounds {
    const ZERO: Self = Self { lower: 0.0, upper: 0.0 };

    fn width(&self) -> Real {
        self.upper - self.lower
    }
}

/// The distance of the triangles `a` and `b`, as closed sets of points.
///
/// It is that of the nearest of 6 pairs of a corner and a triangle and 9 pairs of edges, and exactly
/// 0 if the triangles have a point in common ([`intersect::triangles`]). The points `p` of `a` and
/// `q` of `b` that were found give both bounds:
///
/// ```text
/// upper = |q − p|        lower = min over corners of b, n·x − max over corners of a, n·x,   n = (q − p) / |q − p|
/// ```
///
/// The lower bound is the width of a slab between the triangles, and both are equal at the nearest
/// points, as triangles are convex.
///
/// # Accuracy
///
/// The bounds hold with all rounding, for lengths between 1e-70 and 1e70. They differ by less than
/// 1e-12 of the size of the two triangles together; by up to 1e-9 of it if one is a needle.
///
/// # Examples
///
/// ```
/// use if_core::{distance::triangle_distance, math::Point};
/// let at = |z| [Point::new(0.0, 0.0, z), Point::new(1.0, 0.0, z), Point::new(0.0, 1.0, z)];
/// let found = triangle_distance(at(0.0).each_ref(), at(0.25).each_ref());
/// assert!((found.lower..=found.upper).contains(&0.25) && found.upper - found.lower < 1e-12);
/// ```
pub fn triangle_distance(a: [&Point; 3], b: [&Point; 3]) -> DistanceBounds {
    // No slab is between triangles that have a point in common.
    let (best, _) = nearest(a, b);
    if best.lower <= 0.0 && intersect::triangles(a, b).is_some() {
        return DistanceBounds::ZERO;
    }
    best
}

/// The unit vector from the nearest point of `a` to that of `b`: the normal of the widest slab between
/// the triangles. `None` if no slab is found between them, which is not to say that they have a point
/// in common.
pub fn way_between(a: [&Point; 3], b: [&Point; 3]) -> Option<Vector> {
    let (best, way) = nearest(a, b);
    if best.lower > 0.0 { way.try_normalize(0.0) } else { None }
}

/// Bounds of the distance, and the way between the points that gave the larger lower one.
fn nearest(a: [&Point; 3], b: [&Point; 3]) -> (DistanceBounds, Vector) {
    // Differences of coordinates are nearly exact, and small.
    let origin = *a[0];
    let [a_local, b_local] = [a, b].map(|t| t.map(|p| Point::from(p - origin)));
    let (la, lb) = (a_local.each_ref(), b_local.each_ref());
    let size = la.into_iter().chain(lb).map(|p| p.coords.amax()).fold(0.0, Real::max);
    let [mut p, mut q] = nearest_points(la, lb);
    let (mut best, mut way) = (bounds(la, lb, [&p, &q], size), q - p);
    for _ in 0..REFINEMENTS {
        if best.width() <= TIGHT * size || best.lower <= 0.0 {
            break;
        }
        p = on_triangle(&q, la);
        q = on_triangle(&p, lb);
        let next = bounds(la, lb, [&p, &q], size);
        if next.lower > best.lower {
            way = q - p;
        }
        best =
            DistanceBounds { lower: best.lower.max(next.lower), upper: best.upper.min(next.upper) };
    }
    (best, way)
}

/// Whether the triangles are farther apart than `limit`, a length, according to the planes of the
/// faces and those through the edges at right angles to them. `false` does not say that they are
/// nearer.
///
/// Much faster than [`triangle_distance`], and decides most pairs of a search.
pub fn are_apart(a: [&Point; 3], b: [&Point; 3], limit: Real) -> bool {
    is_beyond(a, b, limit) || is_beyond(b, a, limit)
}

/// Whether a face or edge plane of `a` separates the triangles by more than `limit`.
#[inline]
fn is_beyond(a: [&Point; 3], b: [&Point; 3], limit: Real) -> bool {
    let edges = [a[1] - a[0], a[2] - a[1], a[0] - a[2]];
    let normal = edges[0].cross(&edges[1]);
    let to = b.map(|p| p - a[0]);
    // Rounding of the products, with a wide margin.
    let limit = limit * (1.0 + 1e-9);
    let size = to.iter().chain(&edges).map(|v| v.amax()).fold(0.0, Real::max);
    let needed = |direction: &Vector| {
        let length = direction.norm();
        limit * length + 1e-12 * size * length
    };
    // The computed normal of a needle is mostly rounding, and not at right angles to it: what `a` itself
    // reaches along a direction counts.
    let (least, largest) = ends(to.map(|v| normal.dot(&v)));
    let own = ends(a.map(|p| normal.dot(&(p - a[0]))));
    if (least - own.1).max(own.0 - largest) > needed(&normal) {
        return true;
    }
    (0..3).any(|k| {
        let outward = edges[k].cross(&normal);
        let (least, _) = ends(b.map(|p| outward.dot(&(p - a[k]))));
        let (_, own) = ends(a.map(|p| outward.dot(&(p - a[k]))));
        least - own > needed(&outward)
    })
}

#[inline]
fn ends([x, y, z]: [Real; 3]) -> (Real, Real) {
    (x.min(y).min(z), x.max(y).max(z))
}

/// The nearest two points, of `a` and of `b`, if the triangles have none in common.
fn nearest_points(a: [&Point; 3], b: [&Point; 3]) -> [Point; 2] {
    let mut best = ([*a[0], *b[0]], Real::INFINITY);
    let mut offer = |p: Point, q: Point| {
        let d = (q - p).norm_squared();
        if d < best.1 {
            best = ([p, q], d);
        }
    };
    for corner in b {
        offer(on_triangle(corner, a), *corner);
    }
    for corner in a {
        offer(*corner, on_triangle(corner, b));
    }
    for i in 0..3 {
        for j in 0..3 {
            let [p, q] = between_segments([a[i], a[(i + 1) % 3]], [b[j], b[(j + 1) % 3]]);
            offer(p, q);
        }
    }
    best.0
}

fn on_triangle(p: &Point, [a, b, c]: [&Point; 3]) -> Point {
    barycentric_point([a, b, c], closest_on_triangle(p, a, b, c).0)
}

/// The nearest points of two segments. If they are nearly parallel, the nearest to the middle of
/// one: their ends decide elsewhere.
fn between_segments([a, b]: [&Point; 2], [c, d]: [&Point; 2]) -> [Point; 2] {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv) = (u.norm_squared(), u.dot(&v), v.norm_squared());
    let determinant = uu * vv - uv * uv;
    let s = (uv * v.dot(&w) - vv * u.dot(&w)) / determinant;
    let s = if s.is_finite() { s.clamp(0.0, 1.0) } else { 0.5 };
    // The nearest point of the other segment, and back, which is the pair if the first was clamped.
    let q = on_segment(&(a + u * s), c, d);
    let p = on_segment(&q, a, b);
    [p, on_segment(&p, c, d)]
}

fn on_segment(p: &Point, a: &Point, b: &Point) -> Point {
    a + (b - a) * closest_on_segment(p, a, b)
}

/// What the points `p` of `a` and `q` of `b` prove.
fn bounds(a: [&Point; 3], b: [&Point; 3], [p, q]: [&Point; 2], size: Real) -> DistanceBounds {
    let slack = ROUNDING * size;
    let way = q - p;
    let normal = unit_or_zero(&way);
    let (least, _) = ends(b.map(|x| normal.dot(&(x - p))));
    let (_, largest) = ends(a.map(|x| normal.dot(&(x - p))));
    DistanceBounds { lower: (least - largest - slack).max(0.0), upper: way.norm() + slack }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reproducible numbers in [-1, 1).
    struct Numbers(u64);

    impl Numbers {
        fn next(&mut self) -> Real {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (self.0 >> 11) as Real / (1u64 << 52) as Real - 1.0
        }

        fn point(&mut self) -> Point {
            Point::new(self.next(), self.next(), self.next())
        }

        fn triangle(&mut self) -> [Point; 3] {
            [self.point(), self.point(), self.point()]
        }
    }

    /// The slow twin: a convex quadratic program, by alternating projections from several starts.
    fn slow(a: &[Point; 3], b: &[Point; 3]) -> Real {
        let mut least = Real::INFINITY;
        for start in b {
            let mut q = *start;
            for _ in 0..20_000 {
                let p = on_triangle(&q, a.each_ref());
                let next = on_triangle(&p, b.each_ref());
                least = least.min((next - p).norm());
                if (next - q).norm() < 1e-15 {
                    break;
                }
                q = next;
            }
        }
        least
    }

    #[test]
    fn needles_are_no_farther_apart_than_they_are() {
        let mut numbers = Numbers(7);
        let mut near = 0;
        for _ in 0..4000 {
            let (p, along) = (numbers.point(), numbers.point().coords);
            // In a line, but for rounding.
            let needle = [p, p + along, p + along * (0.5 + 0.4 * numbers.next())];
            let middle = p + along * 0.6 + numbers.point().coords * 1e-3;
            let other = [0, 1, 2].map(|_| middle + numbers.point().coords * 1e-3);
            let (a, b) = (needle.each_ref(), other.each_ref());
            let upper = triangle_distance(a, b).upper;
            for limit in [1e-4, 1e-3, 2e-3] {
                assert!(
                    !are_apart(a, b, limit) || upper > limit,
                    "{upper} {limit}: {needle:?} {other:?}"
                );
                near += usize::from(upper < limit);
            }
        }
        assert!(near > 1000, "{near}");
    }

    #[test]
    fn the_bounds_hold_the_distance_and_are_tight() {
        let mut numbers = Numbers(7);
        let mut apart = 0;
        for k in 0..400 {
            let a = numbers.triangle();
            let shift = Vector::new(1.5 * numbers.next(), 0.0, 0.3);
            let b = numbers.triangle().map(|p| Point::from(0.5 * p.coords) + shift);
            let found = triangle_distance(a.each_ref(), b.each_ref());
            let reference = slow(&a, &b);
            assert!(found.lower <= reference + 1e-14, "{k}: {found:?} {reference}");
            assert!(found.upper - found.lower <= 1e-12, "{k}: {found:?}");
            if found.lower > 0.0 {
                apart += 1;
                assert!((reference - found.upper).abs() < 1e-6, "{k}: {found:?} {reference}");
            } else {
                assert!(intersect::triangles(a.each_ref(), b.each_ref()).is_some());
            }
        }
        assert!(apart > 100 && apart < 395, "{apart}");
    }

    #[test]
    fn the_order_and_the_winding_do_not_matter() {
        let mut numbers = Numbers(3);
        for _ in 0..300 {
            let (a, b) = (numbers.triangle(), numbers.triangle().map(|p| p + Vector::z() * 1.3));
            let found = triangle_distance(a.each_ref(), b.each_ref());
            let other = triangle_distance([&b[2], &b[1], &b[0]], [&a[1], &a[2], &a[0]]);
            assert!(found.lower <= other.upper && other.lower <= found.upper);
        }
    }

    #[test]
    fn known_distances_come_out() {
        let p = |x: Real, y: Real, z: Real| Point::new(x, y, z);
        let floor = [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.0, 1.0, 0.0)];
        let table = [
            // A corner over the face, edges that cross in the view from above, edges side by side.
            ([p(0.2, 0.2, 0.3), p(0.2, 0.2, 1.0), p(0.3, 0.2, 1.0)], 0.3),
            ([p(0.5, -1.0, 0.1), p(0.5, 1.0, 0.1), p(0.5, 0.0, 2.0)], 0.1),
            ([p(0.0, -0.2, 0.0), p(1.0, -0.2, 0.0), p(0.5, -1.0, 0.0)], 0.2),
            ([p(0.2, -1e-12, 0.0), p(0.8, -1e-12, 0.0), p(0.5, -1.0, 0.0)], 1e-12),
            // Through the face, an edge in common, a corner on an edge, on top of each other.
            ([p(0.2, 0.2, -1.0), p(0.2, 0.2, 1.0), p(2.0, 2.0, 0.0)], 0.0),
            ([p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.5, -1.0, 1.0)], 0.0),
            ([p(0.5, 0.0, 0.0), p(0.0, -1.0, 0.0), p(1.0, -1.0, 0.0)], 0.0),
            (floor, 0.0),
            // Far away.
            ([p(3.0, 4.0, 1e6), p(3.0, 5.0, 1e6), p(4.0, 4.0, 1e6)], (18.0 + 1e12f64).sqrt()),
        ];
        for (k, (other, distance)) in table.into_iter().enumerate() {
            let DistanceBounds { lower, upper } =
                triangle_distance(floor.each_ref(), other.each_ref());
            assert!((lower..=upper).contains(&distance), "{k}: {lower} {upper}");
            assert!(
                upper - lower <= 1e-12 * distance.max(1.0) && (upper == 0.0) == (distance == 0.0),
                "{k}"
            );
        }
    }

    #[test]
    fn needles_and_points_have_distances() {
        let mut numbers = Numbers(11);
        let mut widest: Real = 0.0;
        for k in 0..2000 {
            let [mut a, mut b] = [numbers.triangle(), numbers.triangle()];
            let height = [0.0, 1e-16, 1e-12, 1e-8, 1e-4][k % 5];
            a[2] = a[0] + (a[1] - a[0]) * numbers.next().abs() + numbers.point().coords * height;
            if k % 3 == 0 {
                b = [b[0]; 3];
            } else if k % 3 == 1 {
                // Nearly parallel to an edge of the other.
                b[1] = b[0] + (a[1] - a[0]) + numbers.point().coords * height;
            }
            let DistanceBounds { lower, upper } = triangle_distance(a.each_ref(), b.each_ref());
            assert!(lower >= 0.0 && lower <= upper && slow(&a, &b) >= lower - 1e-14, "{k}");
            widest = widest.max(upper - lower);
        }
        assert!(widest < 1e-9, "{widest}");
    }

    #[test]
    fn triangles_that_are_said_to_be_apart_are() {
        let mut numbers = Numbers(5);
        let mut decided = 0;
        for _ in 0..3000 {
            let (a, b) = (numbers.triangle(), numbers.triangle());
            let found = triangle_distance(a.each_ref(), b.each_ref());
            for limit in [0.0, 0.5 * found.lower, found.upper, 2.0 * found.upper] {
                let are_apart = are_apart(a.each_ref(), b.each_ref(), limit);
                decided += usize::from(are_apart && limit > 0.0);
                assert!(!are_apart || found.upper > limit, "{found:?} {limit}");
            }
        }
        assert!(decided > 300, "{decided}");
    }
}
