//! From a clean state towards another one, as near as contacts permit.

use super::locality::Yielding;
use super::walk::{WalkError, Walked, Walker};
use if_core::math::{Point, Real};
use if_core::monitor::Monitor;
use if_mesh::point_tree::PointTree;
use rayon::prelude::*;
use std::ops::Range;

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
    /// at first, as beyond a fold that is entered on another side, and vertices of the body that would end
    /// farther off than any vertex was, as where a contact has hardly a hold on them. If that does not help,
    /// the state is that of the last clean step, or `from` if vertices end farther off.
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
        let yielding = self.yielding(reference);
        let mut aim = to.to_vec();
        hold(&mut aim[..garments], reference, &yielding);
        let squared = |v: usize, x: &[Point]| (aim[v] - x[v]).norm_squared();
        let farthest = |of: Range<usize>| of.map(|v| squared(v, from)).fold(0.0, Real::max);
        let of_garments = farthest(garments..to.len());
        let of_all = of_garments.max(farthest(0..garments));
        let mut stuck = Vec::new();
        let mut ways = 0;
        loop {
            let held = held_back(from, to, &stuck);
            let walked = self.go(from, held, (reference, &yielding), monitor)?;
            let most = |v: usize| if v < garments { of_all } else { of_garments };
            let is_astray = |v: &usize| squared(*v, &self.clean.x) > most(*v);
            let astray: Vec<usize> = (0..to.len()).filter(is_astray).collect();
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
        (reference, yielding): (&[Point], &Yielding),
        monitor: &mut dyn Monitor,
    ) -> Result<Walked, WalkError> {
        self.restart(from.to_vec())?;
        self.clean.is_verified = self.clean.x == from;
        hold(&mut to[..self.scene.starts[1]], reference, yielding);
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
        let walked = self.follow(steps, &path, Some(yielding.clone()), monitor);
        self.params = params;
        walked
    }
}

/// Takes vertices of the body that do not yield to 0.8 mm from `reference` at most.
fn hold(body: &mut [Point], reference: &[Point], yielding: &Yielding) {
    for ((to, reference), w) in body.iter_mut().zip(reference).zip(&yielding.inverse_mass) {
        if *w == 0.0 {
            *to = reference + (*to - reference).cap_magnitude(FAR);
        }
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
    use if_core::math::Vector;
    use if_core::mesh::TriMesh;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::{icosphere, tube};

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
        let yielding = walker.yielding(&from);
        walker.go(&from, to.clone(), (&from, &yielding), &mut Silent).unwrap();
        assert!(far(walker.positions()) > 0.08e-3, "the skin pushes: {}", far(walker.positions()));
        walker.approach(&from, &to, &from, &mut Silent).unwrap();
        let now = walker.positions();
        assert!(far(now) <= far(&from), "{}", far(now));
        assert!(walker.intersections(now).unwrap().is_empty());
        for v in (garments..from.len()).filter(|v| from[*v].y < 0.1) {
            assert!((now[v] - to[v]).norm() < 2e-6, "{} {}", from[v], (now[v] - to[v]).norm());
        }
    }

    /// A large triangle of the body yields at one corner alone, and a ball comes down beside the opposite edge: the
    /// corner has fifty times as far to go.
    #[test]
    fn a_corner_of_the_body_that_is_thrown_out_goes_nowhere() {
        let corner = Point::new(0.0, 0.0, 0.173);
        let edge = [Point::new(-0.1, 0.0, 0.0), Point::new(0.1, 0.0, 0.0)];
        let mut vertices = vec![corner, edge[0], edge[1], Point::new(0.0, -0.16, 0.06)];
        let mut triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        // The body meets itself beside the corner, and yields there.
        let balls = [
            (Point::new(0.0, 5.6e-3, 3.5e-3), 5e-3),
            (corner + Vector::z() * 3.2e-3, 2e-3),
            (corner + Vector::z() * 4.2e-3, 2e-3),
        ];
        for (middle, radius) in balls {
            let (first, ball) = (vertices.len() as u32, icosphere(radius, 3));
            vertices.extend(ball.vertices().iter().map(|p| middle + p.coords));
            triangles.extend(ball.triangles().iter().map(|t| t.map(|v| v + first)));
        }
        let body = TriMesh::new(vertices, triangles).unwrap();
        let scene = outfit(body, vec![tube(0.5, 0.2, 16, 4, false)]);
        let params = WalkParams { body_reach: 5e-3, ..WalkParams::default() };
        let mut walker = Walker::new(&scene, params).unwrap();
        let from = walker.rest().to_vec();
        let mut to = from.clone();
        to[4..4 + icosphere(5e-3, 3).vertices().len()].iter_mut().for_each(|p| p.y -= FAR);
        let yielding = walker.yielding(&from);
        assert!(
            yielding.inverse_mass[..5]
                .iter()
                .map(|w| *w > 0.0)
                .eq([true, false, false, false, false])
        );
        walker.go(&from, to.clone(), (&from, &yielding), &mut Silent).unwrap();
        let thrown = (walker.positions()[0] - from[0]).norm();
        assert!(
            thrown > 5e-3 && walker.intersections(walker.positions()).unwrap().is_empty(),
            "{thrown}"
        );
        walker.approach(&from, &to, &from, &mut Silent).unwrap();
        let now = walker.positions();
        let body = now[..walker.scene.starts[1]].iter().zip(&from);
        let farthest = body.map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        assert!(farthest <= FAR + 1e-6, "{farthest}");
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
