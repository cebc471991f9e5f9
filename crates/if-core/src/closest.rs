//! Nearest points on surfaces.

use crate::math::{Point, Real};

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

/// Surfaces that can tell their nearest point.
pub trait ClosestPoint: Sync {
    /// The nearest point at most `max_distance` (metres, may be infinite) from `p`; `None` where
    /// there is none.
    fn closest(&self, p: &Point, max_distance: Real) -> Option<Closest>;
}

/// The nearest point of the triangle `(a, b, c)` to `p`: barycentric coordinates and feature.
///
/// A degenerate triangle is treated as its longest edge or its single point.
///
/// # Source
///
/// Ericson 2005, *Real-Time Collision Detection*, 5.1.5 (regions of Voronoi), with the division of
/// each region guarded.
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
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 - d3 > 0.0 {
        let v = d1 / (d1 - d3);
        return ([1.0 - v, v, 0.0], Feature::Edge(0));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return ([0.0, 0.0, 1.0], Feature::Vertex(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 - d6 > 0.0 {
        let w = d2 / (d2 - d6);
        return ([1.0 - w, 0.0, w], Feature::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    let (e1, e2) = (d4 - d3, d5 - d6);
    if va <= 0.0 && e1 >= 0.0 && e2 >= 0.0 && e1 + e2 > 0.0 {
        let w = e1 / (e1 + e2);
        return ([0.0, 1.0 - w, w], Feature::Edge(1));
    }
    let sum = va + vb + vc;
    if sum > 0.0 {
        let (v, w) = (vb / sum, vc / sum);
        return ([(1.0 - v - w).max(0.0), v, w], Feature::Face);
    }
    // Rounding left no region: a degenerate triangle. Its three edges are all there is of it.
    let mut best = ([1.0, 0.0, 0.0], Feature::Vertex(0), ap.norm_squared());
    let corners = [a, b, c];
    for k in 0..3 {
        let (from, to) = (corners[k], corners[(k + 1) % 3]);
        let t = closest_on_segment(p, from, to);
        let d = (p - (from + (to - from) * t)).norm_squared();
        if d < best.2 {
            let mut bary = [0.0; 3];
            bary[k] = 1.0 - t;
            bary[(k + 1) % 3] = t;
            let feature = match t {
                t if t <= 0.0 => Feature::Vertex(k as u8),
                t if t >= 1.0 => Feature::Vertex(((k + 1) % 3) as u8),
                _ => Feature::Edge(k as u8),
            };
            best = (bary, feature, d);
        }
    }
    (best.0, best.1)
}

/// Parameter in [0, 1] of the point of the segment `(a, b)` nearest to `p`; 0 where `a = b`.
#[inline]
pub fn closest_on_segment(p: &Point, a: &Point, b: &Point) -> Real {
    let ab = b - a;
    let length2 = ab.norm_squared();
    if length2 > 0.0 { ((p - a).dot(&ab) / length2).clamp(0.0, 1.0) } else { 0.0 }
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
                    assert!(d <= reference + 1e-12 && d >= reference - 5e-3, "{p}: {d} against {reference}");
                    assert!(b.iter().all(|w| *w >= 0.0) && (b.iter().sum::<Real>() - 1.0).abs() < 1e-12);
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
}
