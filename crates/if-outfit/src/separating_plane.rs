//! Planes that separate one triangle from another.

use if_core::math::{Point, Real, Vector};
use if_core::separating_axis::{self, axes};

/// Cosine between an axis and the wanted direction below which the axis is not considered: 72°.
const TOWARDS: Real = 0.3;

/// The plane that separates triangle `t` from triangle `o` with the least motion of `t` towards unit
/// vector `out`: its unit normal n, and the level that n·x must reach at all corners of `t`.
///
/// The candidates are the separating axes of the two that lie within 72° of `out`, and `out`
/// itself.
pub(crate) fn least_motion_plane(t: &[Point; 3], o: &[Point; 3], out: &Vector) -> (Vector, Real) {
    let level = |n: &Vector| o.iter().map(|p| n.dot(&p.coords)).fold(Real::NEG_INFINITY, Real::max);
    let depth =
        |n: &Vector| level(n) - t.iter().map(|p| n.dot(&p.coords)).fold(Real::INFINITY, Real::min);
    let mut best = (*out, depth(out));
    let mut consider = |mut n: Vector| {
        if n.dot(out) < 0.0 {
            n = -n;
        }
        if n.dot(out) >= TOWARDS && depth(&n) < best.1 {
            best = (n, depth(&n));
        }
    };
    axes(t, o).for_each(&mut consider);
    (best.0, level(&best.0))
}

/// The plane that separates triangle `t` from triangle `o` with the widest gap between them: its unit
/// normal n, towards `t`, the level that n·x does not exceed on `o`, and the gap. `None` if they
/// intersect.
pub(crate) fn widest_gap(t: &[Point; 3], o: &[Point; 3]) -> Option<(Vector, Real, Real)> {
    let (towards, gap) = separating_axis::widest_gap(t, o).filter(|(_, gap)| *gap > 0.0)?;
    let n = -towards;
    let level = o.iter().map(|p| n.dot(&p.coords)).fold(Real::NEG_INFINITY, Real::max);
    Some((n, level, gap))
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::intersect::{Contact, triangles};
    use if_core::random::SplitMix64;

    #[test]
    fn moved_up_to_the_plane_the_triangles_are_disjoint() {
        let o = [Point::new(0.0, 0.0, 0.0), Point::new(1.0, 0.0, 0.1), Point::new(0.0, 1.0, -0.1)];
        let mut random = SplitMix64::new(5);
        let mut next = || random.unit() - 0.5;
        let mut met = 0;
        for _ in 0..500 {
            let t = [0; 3].map(|_| Point::new(0.3 + next(), 0.3 + next(), 0.6 * next()));
            if triangles(t.each_ref(), o.each_ref()) == Contact::Disjoint {
                continue;
            }
            met += 1;
            let (n, level) = least_motion_plane(&t, &o, &Vector::z());
            assert!(n.z > 0.29);
            let low = t.iter().map(|p| n.dot(&p.coords)).fold(Real::INFINITY, Real::min);
            let moved = t.map(|p| p + n * (level - low + 1e-9));
            assert_eq!(triangles(moved.each_ref(), o.each_ref()), Contact::Disjoint);
            let up = t.iter().map(|p| p.z).fold(Real::INFINITY, Real::min);
            assert!(
                level - low
                    <= o.iter().map(|p| p.z).fold(Real::NEG_INFINITY, Real::max) - up + 1e-12
            );
        }
        assert!(met > 50);
    }
}
