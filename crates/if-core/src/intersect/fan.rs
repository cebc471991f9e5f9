//! Whether the triangles around a vertex lie flat: then no two of them meet beyond what they share.

use super::predicates::{FILTER, UNDERFLOW};
use crate::math::{Point, Vector};

/// How the triangles around a vertex, each between two of its neighbours in turn, follow one another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fan {
    /// Each triangle ends where exactly one other begins.
    Closed,
    /// One triangle ends where no other begins, and one begins where no other ends.
    Open,
}

/// Whether the triangles (`centre`, p, q) for all [p, q] of `fan` certainly have no point in common
/// beyond common corners and edges: after one coordinate is left out, all turn the same way around
/// the centre, by less than one whole turn if the fan is open, and by exactly one if it is closed.
///
/// Each neighbour may begin at most one triangle, and end at most one; otherwise the answer means
/// nothing. False where rounding leaves a doubt, for triangles without an area, and for fans that
/// are folded, or bent so far that none of the three directions shows all of one side.
pub fn is_flat_fan<'a>(
    kind: Fan,
    centre: &Point,
    fan: impl Iterator<Item = [&'a Point; 2]> + Clone,
) -> bool {
    let normals = fan.clone().map(|[p, q]| (p - centre).cross(&(q - centre)));
    let sum: Vector = normals.sum();
    let out = sum.iamax();
    let (i, j, sign) = ((out + 1) % 3, (out + 2) % 3, sum[out].signum());
    // Each turn goes up through one half of the line along coordinate i, and down through the other.
    let (mut up, mut down) = (0, 0);
    for [p, q] in fan {
        let (u, v) = (p - centre, q - centre);
        let (left, right) = (u[i] * v[j], u[j] * v[i]);
        // A NaN from overflow fails the comparison.
        let is_certain = (left - right) * sign > FILTER * (left.abs() + right.abs() + UNDERFLOW);
        if !is_certain {
            return false;
        }
        match [p, q].map(|p| p[j] < centre[j]) {
            [true, false] => up += 1,
            [false, true] => down += 1,
            _ => {}
        }
    }
    match kind {
        Fan::Closed => up == 1,
        Fan::Open => up == 0 || down == 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intersect::triangles_sharing;
    use crate::random::SplitMix64;

    /// Neighbours at `angles` around the origin, in a plane that is turned, at random heights.
    fn neighbours(angles: &[f64], rough: f64, random: &mut SplitMix64) -> Vec<Point> {
        let mut between = |low: f64, high: f64| low + (high - low) * random.unit();
        let [x, y, z] = [between(-3.0, 3.0), between(-1.5, 1.5), between(-3.0, 3.0)];
        let turn = nalgebra::Rotation3::from_euler_angles(x, y, z);
        let place = |a: &f64| {
            let r = between(0.5, 1.5);
            turn * Point::new(r * a.cos(), r * a.sin(), rough * between(-1.0, 1.0))
        };
        angles.iter().map(place).collect()
    }

    /// Whether some two triangles of a fan meet beyond what they share.
    fn meets(ring: &[Point], wedges: &[[usize; 2]]) -> bool {
        let centre = Point::origin();
        let corners = |w: [usize; 2]| [&centre, &ring[w[0]], &ring[w[1]]];
        let names = |w: [usize; 2]| [u32::MAX, w[0] as u32, w[1] as u32];
        (0..wedges.len()).any(|a| {
            let meets = |b: usize| {
                let [a, b] = [wedges[a], wedges[b]];
                triangles_sharing(corners(a), names(a), corners(b), names(b)).is_some()
            };
            (0..a).any(meets)
        })
    }

    #[test]
    fn what_is_flat_meets_nowhere_and_smooth_fans_are_flat() {
        let mut random = SplitMix64::new(3);
        let (mut flat, mut folded, mut all) = (0, 0, 0);
        for case in 0..4000 {
            let n = 3 + case % 6;
            let kind = if case % 2 == 0 { Fan::Closed } else { Fan::Open };
            // Once round, at times nearly twice.
            let whole = std::f64::consts::TAU * if case % 5 == 0 { 1.7 } else { 1.0 };
            let closed = kind == Fan::Closed;
            let whole = if closed { whole } else { whole * (0.3 + 0.7 * random.unit()) };
            let mut angles: Vec<f64> =
                (0..n).map(|k| whole * (k as f64 + 0.4 * random.unit()) / n as f64).collect();
            if case % 7 == 0 {
                angles.swap(0, 2);
            }
            let rough = [0.0, 0.1, 0.5, 2.0][case % 4];
            let ring = neighbours(&angles, rough, &mut random);
            let count = if closed { n } else { n - 1 };
            let wedges: Vec<[usize; 2]> = (0..count).map(|k| [k, (k + 1) % n]).collect();
            let fan = wedges.iter().map(|w| w.map(|k| &ring[k]));
            let meets = meets(&ring, &wedges);
            let is_flat = is_flat_fan(kind, &Point::origin(), fan);
            assert!(!(is_flat && meets), "case {case}");
            let is_smooth = rough < 0.2 && case % 5 != 0 && case % 7 != 0 && n > 4;
            let is_smooth = is_smooth && (closed || whole < std::f64::consts::PI);
            all += usize::from(is_smooth);
            flat += usize::from(is_smooth && is_flat);
            folded += usize::from(meets);
        }
        assert!(flat * 20 > all * 19 && all > 400 && folded > 300, "{flat} of {all}, {folded}");
    }

    #[test]
    fn two_turns_and_a_fan_that_comes_back_to_its_beginning_are_not_flat() {
        let at = |a: f64| Point::new(a.cos(), a.sin(), 0.0);
        let ring = |n: usize, turns: f64| -> Vec<Point> {
            (0..n).map(|k| at(std::f64::consts::TAU * turns * k as f64 / n as f64)).collect()
        };
        let flat = |kind, ring: &[Point], count: usize| {
            let n = ring.len();
            is_flat_fan(kind, &Point::origin(), (0..count).map(|k| [&ring[k], &ring[(k + 1) % n]]))
        };
        assert!(flat(Fan::Closed, &ring(7, 1.0), 7));
        assert!(!flat(Fan::Closed, &ring(7, 2.0), 7));
        assert!(flat(Fan::Open, &ring(7, 1.0), 5));
        // A slit: the last neighbour lies where the first does.
        let slit: Vec<Point> = ring(4, 1.0).into_iter().chain([at(0.0)]).collect();
        assert!(!flat(Fan::Open, &slit, 4));
        // A triangle without an area.
        let [a, b] = [at(0.3), at(0.3)];
        assert!(!is_flat_fan(Fan::Open, &Point::origin(), [[&a, &b]].into_iter()));
    }
}
