//! Nearest points on surfaces.

use crate::math::{Point, Real};
use crate::pointers::through_pointers;

/// The part of a triangle on which a nearest point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Inside the triangle.
    Face,
    /// On the edge from corner k to corner k + 1.
    Edge(u8),
    /// In corner k.
    Vertex(u8),
}

/// A nearest point on a triangle mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// The point itself.
    pub point: Point,
    /// Its distance from the query, not signed, in metres.
    pub distance: Real,
    /// The triangle it lies on: among equally near ones, any, but always the same.
    pub triangle: u32,
    /// Its barycentric coordinates there: three numbers ≥ 0 with sum 1.
    pub barycentric: [Real; 3],
    /// The part of the triangle it lies on.
    pub feature: Feature,
}

/// A surface that computes the nearest point to a query.
pub trait ClosestPoint: Sync {
    /// The nearest point at most `max_distance` (metres, may be infinite) from `p`; `None` if
    /// all points are farther, hence always if it is negative.
    fn closest(&self, p: &Point, max_distance: Real) -> Option<Closest>;
}

through_pointers!(ClosestPoint {
    fn closest(&self, p: &Point, max_distance: Real) -> Option<Closest>;
});

/// A triangle whose squared double area is below this part of its longest side to the fourth power
/// is a needle: there rounding (1e-16 of the latter) decides between regions, and the edges are
/// compared too. At 1e-12 nearest points on needles are off by a thousandth of their length; at
/// 1e-4 a tenth of all triangles of cloth pays for it.
const NEEDLE: Real = 1e-8;

/// The nearest point of the triangle `(a, b, c)` to `p`: barycentric coordinates and feature.
///
/// A degenerate triangle is treated as its longest edge or its single point.
///
/// # Source
///
/// Ericson 2005, *Real-Time Collision Detection*, 5.1.5 (Voronoi regions), with the division of
/// each region guarded.
///
/// # Accuracy
///
/// No point of the triangle is nearer by more than 1e-7 of its size, also on needles, for lengths
/// between 1e-70 and 1e70. Beyond them the coordinates are still three numbers ≥ 0 with sum 1.
#[inline]
pub fn closest_on_triangle(p: &Point, a: &Point, b: &Point, c: &Point) -> ([Real; 3], Feature) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return ([1.0, 0.0, 0.0], Feature::Vertex(0));
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return ([0.0, 1.0, 0.0], Feature::Vertex(1));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    // |ab|², |ac|² and ab·ac, from the products above.
    let (bb, cc, bc) = (d1 - d3, d2 - d6, d1 - d5);
    let longest = bb.max(cc);
    // Also false if a product overflows.
    let sound = bb * cc - bc * bc > NEEDLE * longest * longest;
    let found = region([d1, d2, d3, d4, d5, d6]);
    match found {
        Some(found) if sound => found,
        _ => on_needle(p, [a, b, c], found),
    }
}

/// The Voronoi region, once those of the corners a and b are excluded; `None` if rounding excludes
/// all of them.
#[inline]
fn region([d1, d2, d3, d4, d5, d6]: [Real; 6]) -> Option<([Real; 3], Feature)> {
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 - d3 > 0.0 {
        let v = d1 / (d1 - d3);
        return Some(([1.0 - v, v, 0.0], Feature::Edge(0)));
    }
    if d6 >= 0.0 && d5 <= d6 {
        return Some(([0.0, 0.0, 1.0], Feature::Vertex(2)));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 - d6 > 0.0 {
        let w = d2 / (d2 - d6);
        return Some(([1.0 - w, 0.0, w], Feature::Edge(2)));
    }
    let va = d3 * d6 - d5 * d4;
    let (e1, e2) = (d4 - d3, d5 - d6);
    if va <= 0.0 && e1 >= 0.0 && e2 >= 0.0 && e1 + e2 > 0.0 {
        let w = e1 / (e1 + e2);
        return Some(([0.0, 1.0 - w, w], Feature::Edge(1)));
    }
    let sum = va + vb + vc;
    if sum > 0.0 {
        let (v, w) = (vb / sum, vc / sum);
        return Some(([(1.0 - v - w).max(0.0), v, w], Feature::Face));
    }
    None
}

/// The nearer of what was found and of the three edges.
#[cold]
fn on_needle(
    p: &Point,
    t: [&Point; 3],
    found: Option<([Real; 3], Feature)>,
) -> ([Real; 3], Feature) {
    // Halved, so that no difference overflows, and of size one.
    let relative = t.map(|x| p.coords * 0.5 - x.coords * 0.5);
    let size = relative.iter().map(|x| x.amax()).fold(0.0, Real::max);
    let away = relative.map(|x| if size > 0.0 { x / size } else { x });
    let distance =
        |b: &[Real; 3]| (away[0] * b[0] + away[1] * b[1] + away[2] * b[2]).norm_squared();
    let mut best = ([1.0, 0.0, 0.0], Feature::Vertex(0), distance(&[1.0, 0.0, 0.0]));
    // Weights are finite where no product overflowed, and may miss 1 in sum on a needle.
    if let Some((b, feature)) = found
        && b.iter().all(|w| (0.0..=1.0).contains(w))
        && (b[0] + b[1] + b[2] - 1.0).abs() < 1e-15
    {
        best = (b, feature, distance(&b));
    }
    for k in 0..3 {
        let next = (k + 1) % 3;
        let s =
            closest_on_segment(&Point::origin(), &Point::from(away[k]), &Point::from(away[next]));
        let mut b = [0.0; 3];
        b[k] = 1.0 - s;
        b[next] = s;
        let d = distance(&b);
        if d < best.2 {
            let feature = match s {
                s if s <= 0.0 => Feature::Vertex(k as u8),
                s if s >= 1.0 => Feature::Vertex(next as u8),
                _ => Feature::Edge(k as u8),
            };
            best = (b, feature, d);
        }
    }
    (best.0, best.1)
}

/// Parameter in [0, 1] of the point of the segment `(a, b)` nearest to `p`; 0 where `a = b`.
#[inline]
pub fn closest_on_segment(p: &Point, a: &Point, b: &Point) -> Real {
    let ab = b - a;
    let length2 = ab.norm_squared();
    let s = (p - a).dot(&ab) / length2;
    if s.is_finite() && length2.is_finite() {
        s.clamp(0.0, 1.0)
    } else {
        on_extreme_segment(p, a, b)
    }
}

/// The same where the square of the length is zero or overflows.
#[cold]
fn on_extreme_segment(p: &Point, a: &Point, b: &Point) -> Real {
    let (ab, ap) = (b.coords * 0.5 - a.coords * 0.5, p.coords * 0.5 - a.coords * 0.5);
    let size = ab.amax();
    if size <= 0.0 {
        return 0.0;
    }
    // Both scaled to size one. The ratio of the sizes comes last: if it overflows, clamping still
    // gives the right end.
    let (along, far) = (ab / size, ap.amax());
    if far <= 0.0 {
        return 0.0;
    }
    let s = (ap / far).dot(&along) / along.norm_squared() * (far / size);
    if s.is_nan() { 0.0 } else { s.clamp(0.0, 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::barycentric_point;

    /// The slow twin: a fine scan of the triangle.
    fn scan(p: &Point, t: [&Point; 3]) -> Real {
        const N: usize = 400;
        let mut best = Real::INFINITY;
        for i in 0..=N {
            for j in 0..=N - i {
                let (u, v) = (i as Real / N as Real, j as Real / N as Real);
                best = best.min((barycentric_point(t, [1.0 - u - v, u, v]) - p).norm());
            }
        }
        best
    }

    #[test]
    fn every_region_agrees_with_a_scan() {
        let tri = [Point::new(0.0, 0.0, 0.0), Point::new(1.0, 0.1, 0.0), Point::new(0.2, 0.9, 0.3)];
        let t = [&tri[0], &tri[1], &tri[2]];
        for x in -2..=4 {
            for y in -2..=4 {
                for z in [-0.7, 0.0, 0.4] {
                    let p = Point::new(f64::from(x) * 0.4, f64::from(y) * 0.4, z);
                    let (b, _) = closest_on_triangle(&p, t[0], t[1], t[2]);
                    let d = (barycentric_point(t, b) - p).norm();
                    let reference = scan(&p, t);
                    assert!(
                        d <= reference + 1e-12 && d >= reference - 5e-3,
                        "{p}: {d} against {reference}"
                    );
                    assert!(
                        b.iter().all(|w| *w >= 0.0) && (b.iter().sum::<Real>() - 1.0).abs() < 1e-12
                    );
                }
            }
        }
    }

    #[test]
    fn degenerate_triangles_have_nearest_points_too() {
        let (a, b) = (Point::origin(), Point::new(1.0, 0.0, 0.0));
        let m = Point::new(0.5, 0.0, 0.0);
        for t in [[&a, &b, &m], [&a, &m, &b], [&a, &a, &b], [&b, &b, &b]] {
            let p = Point::new(0.7, 0.3, -0.4);
            let (w, _) = closest_on_triangle(&p, t[0], t[1], t[2]);
            let d = (barycentric_point(t, w) - p).norm();
            let expected = if t == [&b, &b, &b] { (p - b).norm() } else { 0.5 };
            approx::assert_relative_eq!(d, expected, epsilon = 1e-12);
        }
    }

    #[test]
    fn nearest_points_on_needles_are_nearest() {
        // A height of 1e-16 of the length: every product that separates the regions is rounding.
        // Found by tests/stability.
        let (a, b) =
            (Point::new(0.296_701, -0.0, 1.512_686), Point::new(-0.947_593, -0.0, -0.562_486));
        let c = Point::new(1.099_457, 0.0, 2.851_482);
        let p = Point::new(2.922_332, -0.319_107, -1.784_955);
        let (w, _) = closest_on_triangle(&p, &a, &b, &c);
        let found = (barycentric_point([&a, &b, &c], w) - p).norm();
        let segment =
            |q: &Point, r: &Point| (q + (r - q) * closest_on_segment(&p, q, r) - p).norm();
        let least = segment(&a, &b).min(segment(&b, &c)).min(segment(&c, &a));
        assert!(found <= least + 1e-12, "{found} found, {least} is there");
    }

    #[test]
    fn weights_are_weights_where_products_overflow_or_vanish() {
        for size in [5e-324, 1e-310, 1e-200, 1e-100, 1e100, 1e200, 1.7e308] {
            let at = |x: Real, y: Real, z: Real| Point::new(x * size, y * size, z * size);
            let (a, b, c) = (at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0));
            for p in [
                at(0.3, 0.3, 0.5),
                at(1.0, 1.0, 0.0),
                at(-1.0, 0.5, 1.0),
                at(0.5, -1.0, 0.0),
                at(1.0, -1.0, 1.0),
            ] {
                let (w, _) = closest_on_triangle(&p, &a, &b, &c);
                assert!(
                    w.iter().all(|w| (0.0..=1.0).contains(w))
                        && (w.iter().sum::<Real>() - 1.0).abs() < 1e-15,
                    "{w:?}"
                );
                assert!((0.0..=1.0).contains(&closest_on_segment(&p, &b, &c)));
            }
        }
        let (a, b) = (Point::new(-1.7e308, 0.0, 0.0), Point::new(1.7e308, 0.0, 0.0));
        assert_eq!(closest_on_segment(&Point::origin(), &a, &b), 0.5);
        let (a, b) = (Point::origin(), Point::new(1e-320, 0.0, 0.0));
        assert_eq!(closest_on_segment(&Point::new(1.0, 0.0, 0.0), &a, &b), 1.0);
    }
}
