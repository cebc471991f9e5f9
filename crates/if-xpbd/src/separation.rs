//! Triangles of one garment that keep the side of each other on which they started.

use crate::constraint::{Constraint, Residual, Stage};
use if_core::math::{Point, Real, Vector};
use if_core::separating_axis::widest_gap;

/// Pairs of triangles held apart along the axis that separated them at rest.
///
/// The axis n is that of the [widest gap](widest_gap), kept as a vector of the world. For every corner a
/// of the lower and every corner b of the upper triangle
///
/// ```text
/// C = n·(x_b − x_a) − g ≥ 0        Δx_a = −w_a n max(0, −C) / (w_a + w_b),   Δx_b likewise, +
/// ```
///
/// with g nine tenths of the gap at rest, and at most the gap given. Shared corners are left out;
/// each other pair of corners then keeps half of its height at rest. Like [`crate::tie::Ties`],
/// it is meant for corrections without large rotations.
///
/// # Source
///
/// Ours.
#[derive(Clone, Debug, Default)]
pub struct Separations {
    below: Vec<u32>,
    above: Vec<u32>,
    normals: Vec<Vector>,
    gaps: Vec<Real>,
    /// The shares of both in the push of each pair in this substep; zero where there was none.
    pushed: Vec<[Real; 2]>,
}

impl Separations {
    /// No pairs.
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of vertex pairs held apart.
    pub fn len(&self) -> usize {
        self.gaps.len()
    }

    /// Whether no pair is held apart.
    pub fn is_empty(&self) -> bool {
        self.gaps.is_empty()
    }

    /// Holds triangles `s` and `t` apart as they are in `rest`, by up to `gap` metres. Returns
    /// `false` and adds nothing if no plane separates them there.
    pub fn push(&mut self, s: [u32; 3], t: [u32; 3], gap: Real, rest: &[Point]) -> bool {
        let (p, q) = (s.map(|v| rest[v as usize]), t.map(|v| rest[v as usize]));
        // Triangles with a common corner have a gap of zero, but for rounding.
        let shares = s.iter().any(|v| t.contains(v));
        let rounding = 1e-12 * (p[0] - q[0]).norm().max((p[1] - p[0]).norm());
        let least = if shares { -rounding } else { Real::MIN_POSITIVE };
        let Some((normal, room)) = widest_gap(&p, &q).filter(|(_, gap)| *gap >= least) else {
            return false;
        };
        for a in s {
            for b in t {
                if a != b {
                    self.below.push(a);
                    self.above.push(b);
                    self.normals.push(normal);
                    let height = normal.dot(&(rest[b as usize] - rest[a as usize]));
                    self.gaps.push(if shares {
                        gap.min(0.5 * height.max(0.0))
                    } else {
                        gap.min(0.9 * room)
                    });
                }
            }
        }
        true
    }

    /// Brings triangle `t` to the side of triangle `s` that the unit vector `normal` points to, `gap`
    /// metres apart: each pair of corners by at most `step` metres beyond its height in `now`. For
    /// triangles that intersect, where [`Separations::push`] has no side to keep. With a common
    /// corner the others are kept on their sides of it.
    pub fn push_along(
        &mut self,
        [s, t]: [[u32; 3]; 2],
        normal: Vector,
        gap: Real,
        step: Real,
        now: &[Point],
    ) {
        for a in s {
            for b in t {
                // The other corners of a fan may lie in one plane with the common one.
                let is_fan = s.contains(&b) || t.contains(&a);
                let height = normal.dot(&(now[b as usize] - now[a as usize]));
                if a != b {
                    self.below.push(a);
                    self.above.push(b);
                    self.normals.push(normal);
                    self.gaps.push((if is_fan { 0.0 } else { gap }).min(height + step));
                }
            }
        }
    }
}

impl Constraint for Separations {
    fn begin_substep(
        &mut self,
        _previous: &[Point],
        _positions: &[Point],
        _inverse_masses: &[Real],
        _h: Real,
    ) {
        self.pushed.clear();
        self.pushed.resize(self.gaps.len(), [0.0; 2]);
    }

    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], _h: Real) -> Residual {
        let mut residual = Residual { count: self.len(), ..Residual::default() };
        let records = self.pushed.len() == self.len();
        for k in 0..self.gaps.len() {
            let (a, b, n) = (self.below[k] as usize, self.above[k] as usize, self.normals[k]);
            let deficit = self.gaps[k] - n.dot(&(positions[b] - positions[a]));
            if deficit <= 0.0 {
                continue;
            }
            residual.active += 1;
            residual.max = residual.max.max(deficit);
            residual.sum_squares += deficit * deficit;
            let sum = inverse_masses[a] + inverse_masses[b];
            if sum <= 0.0 {
                continue;
            }
            let push = n * (deficit / sum);
            positions[a] -= push * inverse_masses[a];
            positions[b] += push * inverse_masses[b];
            if records {
                self.pushed[k] = [inverse_masses[a] / sum, inverse_masses[b] / sum];
            }
        }
        residual
    }

    fn stage(&self) -> Stage {
        Stage::Contact
    }

    /// Removes the speed at which the corners of each pushed pair separate. Momentum is kept.
    fn correct_velocities(&self, velocities: &mut [Vector]) {
        for (k, [below, above]) in self.pushed.iter().enumerate() {
            let (a, b, n) = (self.below[k] as usize, self.above[k] as usize, self.normals[k]);
            let separating = n.dot(&(velocities[b] - velocities[a]));
            if separating > 0.0 {
                velocities[a] += n * (separating * below);
                velocities[b] -= n * (separating * above);
            }
        }
    }

    fn reset(&mut self) {
        self.pushed.clear();
    }

    fn is_idle(&self) -> bool {
        self.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::intersect::{Contact, triangles_sharing};

    fn two(height: Real) -> Vec<Point> {
        let f =
            |z: Real| [Point::new(0.0, 0.0, z), Point::new(1.0, 0.0, z), Point::new(0.0, 1.0, z)];
        f(0.0).into_iter().chain(f(height)).collect()
    }

    #[test]
    fn triangles_pushed_through_one_another_return_to_their_sides() {
        let mut group = Separations::new();
        assert!(group.push([0, 1, 2], [3, 4, 5], 0.01, &two(0.1)));
        let mut x = two(-0.05);
        x[4].z = 0.2;
        for _ in 0..50 {
            group.project(&mut x, &[1.0; 6], 1.0);
        }
        let top = x[..3].iter().map(|p| p.z).fold(Real::NEG_INFINITY, Real::max);
        let bottom = x[3..].iter().map(|p| p.z).fold(Real::INFINITY, Real::min);
        assert!(bottom - top > 0.0099, "{}", bottom - top);
    }

    #[test]
    fn triangles_that_intersect_part_along_the_direction_given_step_by_step() {
        let mut x = two(-0.05);
        x[4].z = 0.2;
        let mut rounds = 0;
        while x[3..].iter().any(|p| p.z < x[0].z + 0.0099) {
            let mut group = Separations::new();
            group.push_along([[0, 1, 2], [3, 4, 5]], Vector::z(), 0.01, 0.02, &x);
            assert_eq!(group.len(), 9);
            for _ in 0..50 {
                group.project(&mut x, &[1.0; 6], 1.0);
            }
            rounds += 1;
            assert!(rounds < 9);
        }
        assert!(rounds >= 3, "{rounds}");
        // Of two neighbours the common corner keeps out of it.
        let mut fan = Separations::new();
        fan.push_along([[0, 1, 2], [0, 3, 4]], Vector::z(), 0.01, 1.0, &x);
        assert_eq!((fan.len(), fan.gaps.iter().filter(|gap| **gap == 0.0).count()), (8, 4));
    }

    #[test]
    fn a_push_leaves_no_separating_speed_and_keeps_momentum() {
        let mut group = Separations::new();
        assert!(group.push([0, 1, 2], [3, 4, 5], 0.01, &two(0.1)));
        let (before, w) = (two(-0.05), [1.0, 2.0, 0.5, 1.0, 1.0, 4.0]);
        let mut x = before.clone();
        group.begin_substep(&before, &before, &w, 0.01);
        group.project(&mut x, &w, 0.01);
        let mut v: Vec<Vector> = x
            .iter()
            .zip(&before)
            .map(|(p, q)| (p - q) / 0.01 + Vector::new(0.3, 0.2, 0.0))
            .collect();
        let momentum = |v: &[Vector]| v.iter().zip(&w).map(|(v, w)| v / *w).sum::<Vector>();
        let energy =
            |v: &[Vector]| v.iter().zip(&w).map(|(v, w)| 0.5 * v.z * v.z / w).sum::<Real>();
        let (first, given) = (momentum(&v), energy(&v));
        group.correct_velocities(&mut v);
        approx::assert_relative_eq!(momentum(&v), first, epsilon = 1e-12);
        // Nine pairs, taken one after another: each takes some away, and the later ones drag the
        // corners of the first.
        assert!(given > 10.0 && energy(&v) < 0.2 * given, "{given} {}", energy(&v));
        assert!(v.iter().all(|v| (v.x, v.y) == (0.3, 0.2)), "the slide stays");
    }

    #[test]
    fn neighbours_over_a_corner_unfold_again() {
        let rest = vec![
            Point::origin(),
            Point::new(1.0, 0.2, 0.0),
            Point::new(1.0, -0.2, 0.0),
            Point::new(-1.0, 0.2, 0.1),
            Point::new(-1.0, -0.2, -0.1),
        ];
        let mut group = Separations::new();
        assert!(group.push([0, 1, 2], [0, 3, 4], 0.01, &rest));
        let mut x = rest.clone();
        x[3] = Point::new(0.5, 0.0, 0.1);
        x[4] = Point::new(0.5, 0.0, -0.1);
        let (s, t) = ([&x[0], &x[1], &x[2]], [&x[0], &x[3], &x[4]]);
        assert!(triangles_sharing(s, [0, 1, 2], t, [0, 3, 4]).is_some());
        for _ in 0..50 {
            group.project(&mut x, &[1.0; 5], 1.0);
        }
        let (s, t) = ([&x[0], &x[1], &x[2]], [&x[0], &x[3], &x[4]]);
        assert_eq!(triangles_sharing(s, [0, 1, 2], t, [0, 3, 4]), Contact::Disjoint);
    }

    #[test]
    fn triangles_that_intersect_at_rest_are_not_added() {
        let mut rest = two(0.0);
        rest[5].z = 0.3;
        rest[4].z = -0.3;
        let mut group = Separations::new();
        assert!(!group.push([0, 1, 2], [3, 4, 5], 0.01, &rest) && group.is_empty());
    }

    #[test]
    fn triangles_of_a_flat_sheet_are_held_apart_within_it() {
        let mut rest = two(0.0);
        rest[3..].iter_mut().for_each(|p| p.x += 4.0);
        let mut group = Separations::new();
        assert!(group.push([0, 1, 2], [3, 4, 5], 0.01, &rest));
        assert!(
            group.normals.iter().all(|n| n.z == 0.0) && group.gaps.iter().all(|gap| *gap == 0.01)
        );
        // What is violated counts, also where nothing can move.
        let mut x = two(0.0);
        let stuck = group.project(&mut x, &[0.0; 6], 1.0);
        assert!(stuck.active > 0 && x == two(0.0));
    }
}
