//! From a clean state towards another one, as near as contacts permit.

use super::walk::{WalkError, Walked, Walker};
use if_core::math::{Point, Real};
use if_core::monitor::Monitor;
use if_mesh::point_tree::PointTree;
use rayon::prelude::*;

/// Displacement of the body far from its own overlaps that [`Walker::approach`] takes over, in metres:
/// less than counts as yielding, 1 mm, with 0.1 mm of layers that were moved apart at rest.
const FAR: Real = 0.8e-3;
/// Displacement, in metres, that [`Walker::approach`] leaves out: a hundredth of the jitter that can be
/// seen.
const STILL: Real = 1e-5;
/// Most steps of one way: 2.5 m by default.
const MOST_STEPS: Real = 1e3;
/// Most ways that are tried, each with what the ones before found held back.
const MOST_WAYS: usize = 3;
/// Distance from what is held back, in metres, up to which all stays where it is, and twice which
/// nothing is held back any more: displacements of garments fade over 20 mm.
const HELD: Real = 0.025;

impl Walker {
    /// From the clean state `from` towards `to`, as near as contacts permit, in steps of at most half
    /// the distance at which primitives are watched, and at most 1,000. Contacts keep less apart than
    /// those of a walk, so that `to` may be a mean of states of walks. Vertices of the body that are
    /// farther than [`WalkParams::body_reach`](super::WalkParams::body_reach) from its overlaps at
    /// `reference` go to `to` exactly, and at most 0.8 mm from `reference`.
    ///
    /// What is in the way of a step that cannot be made clean stays with what lies within 25 mm, while
    /// the rest goes on; and so do vertices of garments that would end farther from `to` than any was
    /// at first, as beyond a fold that is entered on another side. If that does not help, the state is
    /// that of the last clean step, or `from` if vertices end farther off.
    ///
    /// The walker's state ends free of intersections if `from` is so, at whatever share of the way:
    /// only what moves is verified, unless `from` has to be rounded first.
    ///
    /// # Errors
    ///
    /// An invalid state, or the monitor cancelled.
    pub fn approach(
        &mut self,
        from: &[Point],
        to: &[Point],
        reference: &[Point],
        monitor: &mut dyn Monitor,
    ) -> Result<Walked, WalkError> {
        self.check(from)?;
        self.check(to)?;
        self.check(reference)?;
        let garments = self.scene.starts[1];
        let squared = |v: usize, x: &[Point]| (to[v] - x[v]).norm_squared();
        let farthest = (garments..to.len()).map(|v| squared(v, from)).fold(0.0, Real::max);
        let mut stuck = Vec::new();
        let mut ways = 0;
        loop {
            let walked = self.go(from, held_back(from, to, &stuck), reference, monitor)?;
            let astray = (garments..to.len()).filter(|v| squared(*v, &self.clean.x) > farthest);
            let astray: Vec<usize> = astray.collect();
            if walked.unresolved.is_empty() && astray.is_empty() {
                return Ok(walked);
            }
            ways += 1;
            if ways == MOST_WAYS {
                if astray.is_empty() {
                    return Ok(walked);
                }
                self.restart(from.to_vec())?;
                return Ok(Walked { reached: 0.0, ..walked });
            }
            let triangles = walked.unresolved.iter().flatten();
            let corners = triangles.flat_map(|(layer, t)| self.scene.corners_of(*layer, *t));
            stuck.extend(corners);
            stuck.extend(astray);
        }
    }

    /// One way of [`approach`](Self::approach).
    fn go(
        &mut self,
        from: &[Point],
        mut to: Vec<Point>,
        reference: &[Point],
        monitor: &mut dyn Monitor,
    ) -> Result<Walked, WalkError> {
        self.restart(from.to_vec())?;
        self.clean.is_verified = self.clean.x == from;
        let yielding = self.yielding(reference);
        for v in (0..self.scene.starts[1]).filter(|v| yielding.inverse_mass[*v] == 0.0) {
            to[v] = reference[v] + (to[v] - reference[v]).cap_magnitude(FAR);
        }
        // What need not move stays to the bit, so that steps skip it.
        for (to, from) in to.iter_mut().zip(from) {
            if (*to - from).norm_squared() < STILL * STILL {
                *to = *from;
            }
        }
        let params = self.params;
        let watched = params.watched();
        self.params = params.approaching();
        // Primitives that are not watched cannot pass each other within a step.
        let moves = from.iter().zip(&to).map(|(a, b)| (b - a).norm_squared());
        let largest = moves.fold(0.0, Real::max).sqrt();
        let steps = (2.0 * largest / watched).ceil().min(MOST_STEPS) as usize;
        // All go equally far in a step, and later steps concern only those that have far to go.
        let path = |t: Real| {
            from.iter().zip(&to).map(|(a, b)| a + (b - a).cap_magnitude(t * largest)).collect()
        };
        let walked = self.follow(steps, &path, Some(yielding), monitor);
        self.params = params;
        walked
    }
}

/// `to`, but `from` at the vertices `stuck` and near them.
fn held_back(from: &[Point], to: &[Point], stuck: &[usize]) -> Vec<Point> {
    if stuck.is_empty() {
        return to.to_vec();
    }
    let places: Vec<Point> = stuck.iter().map(|v| from[*v]).collect();
    let tree = PointTree::new(&places);
    let eased = |(from, to): (&Point, &Point)| {
        let mut nearest = Vec::new();
        tree.nearest(from, 1, &mut nearest);
        let distance = nearest.first().map_or(Real::INFINITY, |n| n.0.sqrt());
        from + (to - from) * (distance / HELD - 1.0).clamp(0.0, 1.0)
    };
    from.par_iter().zip(to).with_min_len(256).map(eased).collect()
}

#[cfg(test)]
mod tests {
    use super::super::WalkParams;
    use super::super::tests::outfit;
    use super::*;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::tube;

    /// A pipe with a sleeve 0.6 mm over it: half-way up the skin rises by 0.8 mm, and the end of the sleeve
    /// is to go out by 0.05 mm.
    #[test]
    fn what_goes_astray_holds_back_its_surroundings_alone() {
        let scene = outfit(tube(0.05, 0.6, 32, 48, true), vec![tube(0.051, 0.6, 32, 48, false)]);
        let mut walker = Walker::new(&scene, WalkParams::default()).unwrap();
        let garments = walker.scene.starts[1];
        // The ends of the pipe have a vertex on its axis.
        let out =
            |p: &Point| Point::new(p.x, 0.0, p.z).coords.try_normalize(1e-9).unwrap_or_default();
        let mut from = walker.rest().to_vec();
        from[garments..].iter_mut().for_each(|p| *p -= out(p) * 0.4e-3);
        let mut to = from.clone();
        for (v, p) in to.iter_mut().enumerate() {
            let by = match v < garments {
                true if (p.y - 0.3).abs() < 0.05 => 0.8e-3,
                false if p.y < 0.1 => 0.05e-3,
                _ => 0.0,
            };
            *p += out(p) * by;
        }
        let far =
            |x: &[Point]| (garments..x.len()).map(|v| (x[v] - to[v]).norm()).fold(0.0, Real::max);
        walker.go(&from, to.clone(), &from, &mut Silent).unwrap();
        assert!(far(walker.positions()) > 0.08e-3, "the skin pushes: {}", far(walker.positions()));
        walker.approach(&from, &to, &from, &mut Silent).unwrap();
        let now = walker.positions();
        assert!(far(now) <= far(&from), "{}", far(now));
        assert!(walker.intersections(now).unwrap().is_empty());
        for v in (garments..from.len()).filter(|v| from[*v].y < 0.1) {
            assert!((now[v] - to[v]).norm() < 2e-6, "{} {}", from[v], (now[v] - to[v]).norm());
        }
    }

    #[test]
    fn what_is_held_back_fades() {
        let line =
            |y: Real| (0..100).map(|k| Point::new(k as Real * 1e-3, y, 0.0)).collect::<Vec<_>>();
        let (from, to) = (line(0.0), line(1.0));
        assert_eq!(held_back(&from, &to, &[]), to);
        let held = held_back(&from, &to, &[0, 10]);
        // 25 mm from the last, and then in proportion up to 50 mm.
        for (k, p) in held.iter().enumerate() {
            let share = ((k as Real - 10.0) / 25.0 - 1.0).clamp(0.0, 1.0);
            assert!((p - Point::new(k as Real * 1e-3, share, 0.0)).norm() < 1e-12, "{k} {p}");
        }
    }
}
