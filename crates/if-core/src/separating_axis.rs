//! Axes along which two triangles lie apart.

use crate::math::{Point, Real, Vector, area_vector, unit_or_zero};

/// Gap, as a share of the triangles' size, up to which two triangles count as touching.
const ROUNDING: Real = 1e-12;

/// Unit normals of planes, one of which separates two disjoint triangles that do not lie in one plane:
/// their normals and the cross products of their edges, but for those that vanish.
///
/// # Source
///
/// Gottschalk, Lin and Manocha 1996, *OBBTree*.
pub fn axes<'a>(a: &'a [Point; 3], b: &'a [Point; 3]) -> impl Iterator<Item = Vector> + 'a {
    let normals = [a, b].map(|[p, q, r]| area_vector(p, q, r));
    let across = (0..9).map(move |k| edge(a, k / 3).cross(&edge(b, k % 3)));
    normals.into_iter().chain(across).map(|n| unit_or_zero(&n)).filter(|n| *n != Vector::zeros())
}

/// The axis among [`axes`] along which the gap between two triangles is widest: the unit vector from `a`
/// to `b`, and the gap in metres, which is negative where they overlap. For triangles that touch or lie
/// in one plane, and have no corner at one position, the normals of their edges within it count as well.
/// `None` if all axes vanish.
pub fn widest_gap(a: &[Point; 3], b: &[Point; 3]) -> Option<(Vector, Real)> {
    let gap = |n: &Vector| {
        let top = a.iter().map(|x| n.dot(&x.coords)).fold(Real::NEG_INFINITY, Real::max);
        b.iter().map(|x| n.dot(&x.coords)).fold(Real::INFINITY, Real::min) - top
    };
    let both = |n: Vector| [n, -n].map(|n| (n, gap(&n)));
    let wider =
        |best: (Vector, Real), next: (Vector, Real)| if next.1 > best.1 { next } else { best };
    let found = axes(a, b).flat_map(both).reduce(wider)?;
    let size = (b[0] - a[0]).norm().max((a[1] - a[0]).norm());
    if found.1 > ROUNDING * size || a.iter().any(|p| b.contains(p)) {
        return Some(found);
    }
    let within = [a, b].into_iter().flat_map(|t| {
        let normal = unit_or_zero(&area_vector(&t[0], &t[1], &t[2]));
        (0..3).map(move |k| unit_or_zero(&normal.cross(&edge(t, k))))
    });
    Some(within.filter(|n| *n != Vector::zeros()).flat_map(both).fold(found, wider))
}

/// The edge that begins at corner `k`.
fn edge(t: &[Point; 3], k: usize) -> Vector {
    t[(k + 1) % 3] - t[k]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intersect::{Contact, triangles};
    use crate::random::SplitMix64;

    #[test]
    fn the_widest_gap_separates_all_disjoint_triangles_and_no_others() {
        let mut random = SplitMix64::new(9);
        let mut next = || random.unit() - 0.5;
        for flat in [1.0, 0.0] {
            let mut apart = 0;
            for _ in 0..500 {
                let [a, b] =
                    [0; 2].map(|_| [0; 3].map(|_| Point::new(next(), next(), flat * next())));
                let (n, gap) = widest_gap(&a, &b).unwrap();
                let disjoint = triangles(a.each_ref(), b.each_ref()) == Contact::Disjoint;
                assert_eq!(gap > 0.0, disjoint, "{a:?} {b:?} {gap}");
                apart += usize::from(disjoint);
                let heights = |t: &[Point; 3]| t.map(|p| n.dot(&p.coords));
                let top = heights(&a).into_iter().fold(Real::NEG_INFINITY, Real::max);
                assert!(heights(&b).iter().all(|h| *h >= top + gap - 1e-12));
            }
            assert!((50..450).contains(&apart), "{apart}");
        }
    }
}
