//! Boxes without zeros of a field: a node's value φ excludes zeros in the ball of radius |φ| / L
//! around it.

use if_core::math::Real;

/// Part of a radius that is subtracted, so that rounding (1e-16 of the coordinates) cannot drop a
/// box that a zero touches. A million times more would keep one box in a thousand more.
const SLACK: Real = 1e-9;

/// The balls without zeros around the corners of a box; lengths in cells.
pub(super) struct Balls {
    centres: [[Real; 3]; 8],
    /// Squared radii.
    radii: [Real; 8],
}

impl Balls {
    /// From the corners and the radii of their balls. Negative and NaN radii are empty balls.
    pub(super) fn new(centres: [[Real; 3]; 8], radii: [Real; 8]) -> Self {
        Self {
            centres,
            radii: radii.map(|r| if r > 0.0 { (r * (1.0 - SLACK)).powi(2) } else { 0.0 }),
        }
    }

    /// Whether the union of the balls certainly contains the box: the box, or each of its eight
    /// parts, and so on `depth` times, lies within one of the balls.
    pub(super) fn cover(&self, lo: [Real; 3], hi: [Real; 3], depth: u32) -> bool {
        // Loops, as `map` of arrays is inlined or not with whatever else the crate holds: it would
        // be 6 % of an extraction.
        let (mut middle, mut half) = ([0.0; 3], [0.0; 3]);
        for k in 0..3 {
            (middle[k], half[k]) = (0.5 * (lo[k] + hi[k]), 0.5 * (hi[k] - lo[k]));
        }
        let mut middle_is_covered = false;
        for (c, r2) in self.centres.iter().zip(&self.radii) {
            let (mut near, mut far) = (0.0, 0.0);
            for k in 0..3 {
                let d = (middle[k] - c[k]).abs();
                near += d * d;
                far += (d + half[k]) * (d + half[k]);
            }
            if far < *r2 {
                return true;
            }
            middle_is_covered |= near < *r2;
        }
        depth > 0
            && middle_is_covered
            && (0..8).all(|part| {
                let (mut low, mut high) = (lo, middle);
                for k in (0..3).filter(|k| part >> k & 1 == 1) {
                    (low[k], high[k]) = (middle[k], hi[k]);
                }
                self.cover(low, high, depth - 1)
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::random::SplitMix64;

    /// The unit cube's corners with these radii.
    fn unit(radii: [Real; 8]) -> Balls {
        Balls::new(
            [0, 1, 2, 3, 4, 5, 6, 7].map(|c| [0, 1, 2].map(|k| f64::from(c >> k & 1))),
            radii,
        )
    }

    #[test]
    fn one_ball_or_eight_cover_a_cube() {
        let whole = |radii, depth| unit(radii).cover([0.0; 3], [1.0; 3], depth);
        let one = |r| [r, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!(whole(one(1.7321), 0) && !whole(one(1.7320), 3));
        // Half a diagonal each.
        assert!(whole([0.867; 8], 1) && !whole([0.867; 8], 0) && !whole([0.866; 8], 4));
        for none in [0.0, -2.0, Real::NAN] {
            assert!(!whole([none; 8], 4));
        }
        assert!(whole(one(Real::INFINITY), 0));
    }

    #[test]
    fn what_is_covered_holds_no_point_out_of_all_balls() {
        let mut numbers = SplitMix64::new(7);
        let mut random = || numbers.unit();
        let mut covered = 0;
        for _ in 0..400 {
            let radii = [0; 8].map(|_| 1.4 * random());
            let balls = unit(radii);
            let lo = [0; 3].map(|_| 0.5 * random());
            let hi = lo.map(|x| x + 0.5 * random());
            let depths = [0, 1, 2, 3].map(|depth| balls.cover(lo, hi, depth));
            assert!(depths.is_sorted(), "deeper looks cover more");
            if depths[3] {
                covered += 1;
                for _ in 0..200 {
                    let p = [0, 1, 2].map(|k| lo[k] + (hi[k] - lo[k]) * random());
                    let distance =
                        |c: &[Real; 3]| (0..3).map(|k| (p[k] - c[k]).powi(2)).sum::<Real>().sqrt();
                    assert!(balls.centres.iter().zip(radii).any(|(c, r)| distance(c) <= r));
                }
            }
        }
        assert!(covered > 50, "{covered}");
    }
}
