//! What passes through what between two states, while all vertices move in straight lines.

use super::params::WalkParams;
use super::scene::Scene;
use super::walk::{WalkError, check_positions};
use crate::outfit::{Outfit, OutfitError};
use if_core::distance::way_between;
use if_core::intersect::triangles;
use if_core::math::{Point, Real, Vector, area_vector};
use if_core::monitor::Cancelled;
use if_mesh::index::{Bvh, MovingPair};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Times that an interval is halved before two triangles count as meeting in it: of two frames at 30
/// a second 2 ns are left, in which a hand moves by 10 nm.
const HALVINGS: u32 = 24;
/// Width of a slab between triangles, in metres, that counts as one: more than rounding of
/// coordinates of ten metres.
const WIDTH: Real = 1e-14;

/// Two triangles that meet between two states, and in neither of these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The share of the way at which they meet first; up to there they are apart.
    pub share: Real,
    /// For both the layer, 0 for the body, and the index there.
    pub triangles: [(usize, u32); 2],
}

impl Crossing {
    /// Whether they are of two layers.
    pub fn is_of_layers(&self) -> bool {
        self.triangles[0].0 != self.triangles[1].0
    }
}

/// Finds the [`Crossing`]s between states of one outfit.
#[derive(Clone, Debug)]
pub struct Crossings {
    scene: Scene,
    shape: Bvh,
}

impl Crossings {
    /// For the states of `outfit`.
    ///
    /// # Errors
    ///
    /// An invalid outfit.
    pub fn new(outfit: &Outfit) -> Result<Self, OutfitError> {
        outfit.check()?;
        let scene = Scene::new(outfit, &WalkParams::default());
        let shape = Bvh::new(&scene.mesh);
        Ok(Self { scene, shape })
    }

    /// The pairs of triangles that meet while every vertex goes from `from` to `to` in a straight line,
    /// all in the same time, sorted by triangles. Positions are those of all layers, the body first.
    ///
    /// Pairs that intersect in `from` or `to` are left out: they are those of these states. So are
    /// triangles with a common corner. No other pair is missed: a pair is left out only if planes
    /// that stay as they are for a part of the way each separate it all the way. A pair that is
    /// reported meets, or comes nearer than what a part in 2^24 of the way can tell.
    ///
    /// # Errors
    ///
    /// [`WalkError::Target`].
    pub fn between(&self, from: &[Point], to: &[Point]) -> Result<Vec<Crossing>, WalkError> {
        let found = self.between_at_most(from, to, usize::MAX, &|| false)?;
        Ok(found.expect("no more than can be counted"))
    }

    /// As [`between`](Self::between), or `None` if there are more than `most`: where a body turns round
    /// or jumps, all triangles may meet, and to find them takes minutes. `stops` is called often, and cancels
    /// the search.
    ///
    /// # Errors
    ///
    /// [`WalkError::Target`], and [`WalkError::Cancelled`] if `stops` returns true.
    pub fn between_at_most(
        &self,
        from: &[Point],
        to: &[Point],
        most: usize,
        stops: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<Vec<Crossing>>, WalkError> {
        let n = self.scene.mesh.vertices().len();
        check_positions(from, n)?;
        check_positions(to, n)?;
        let tree = |x: &[Point]| {
            let mut tree = self.shape.clone();
            tree.refit(x);
            tree
        };
        let (start, end) = rayon::join(|| tree(from), || tree(to));
        let count = AtomicUsize::new(0);
        let found = start.own_pairs_in_motion(&end, |pair| {
            let crossing = self.crossing(&pair);
            let is_one_more = crossing.is_some() && count.fetch_add(1, Ordering::Relaxed) >= most;
            if is_one_more || stops() {
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(crossing)
        });
        match found {
            // Whether there are more does not depend on which are found first.
            None if stops() => Err(Cancelled.into()),
            None => Ok(None),
            Some(mut found) => {
                found.sort_unstable_by_key(|c| c.triangles);
                Ok(Some(found))
            }
        }
    }

    fn crossing(&self, pair: &MovingPair<'_>) -> Option<Crossing> {
        let [i, j] = pair.triangles.map(|t| self.scene.mesh.triangles()[t as usize]);
        if i.iter().any(|v| j.contains(v)) {
            return None;
        }
        let share = first_meeting(pair, [0.0, 1.0], HALVINGS)?;
        let meets = |t: &[&[Point; 3]; 2]| triangles(t[0].each_ref(), t[1].each_ref()).is_some();
        if meets(&pair.start) || meets(&pair.end) {
            return None;
        }
        let mut triangles = pair.triangles.map(|t| self.scene.local_triangle(t));
        triangles.sort_unstable();
        Some(Crossing { share, triangles })
    }
}

/// The first time at which no plane is found between two triangles.
fn first_meeting(pair: &MovingPair<'_>, [from, to]: [Real; 2], halvings: u32) -> Option<Real> {
    if stay_apart(pair, [from, to]) {
        return None;
    }
    if halvings == 0 {
        return Some(from);
    }
    let middle = 0.5 * (from + to);
    first_meeting(pair, [from, middle], halvings - 1)
        .or_else(|| first_meeting(pair, [middle, to], halvings - 1))
}

/// Whether a plane of one direction separates the triangles from the first time to the second. The
/// distance of two corners along a direction is linear in time, so the ends of the time decide.
fn stay_apart(pair: &MovingPair<'_>, times: [Real; 2]) -> bool {
    let at = |time: Real| {
        [0, 1].map(|side: usize| {
            let (s, e) = (pair.start[side], pair.end[side]);
            [0, 1, 2].map(|k| s[k] + (e[k] - s[k]) * time)
        })
    };
    let ends = times.map(at);
    let separates = |direction: &Vector| {
        let length = direction.norm();
        let gap = |sign: Real| {
            ends.iter().all(|[a, b]| {
                let along = |p: &Point| sign * direction.dot(&(p - a[0]));
                let least = b.iter().map(along).fold(Real::INFINITY, Real::min);
                let largest = a.iter().map(along).fold(Real::NEG_INFINITY, Real::max);
                least - largest > WIDTH * length
            })
        };
        length > 0.0 && (gap(1.0) || gap(-1.0))
    };
    let [a, b] = at(0.5 * (times[0] + times[1]));
    let normal = |t: &[Point; 3]| area_vector(&t[0], &t[1], &t[2]);
    separates(&normal(&a))
        || separates(&normal(&b))
        || way_between(a.each_ref(), b.each_ref()).is_some_and(|way| separates(&way))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{arm, bent, outfit};
    use super::*;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::tube;

    /// A thin closed rod along y at `x`, and a sheet of cloth in the plane x = 0.
    fn rod_and_sheet(x: Real) -> (Outfit, Vec<Point>) {
        let rod = tube(0.004, 0.3, 8, 6, true);
        let place = |p: &Point| Point::new(p.x + x, p.y, p.z);
        let rod = rod.with_vertices(rod.vertices().iter().map(place).collect()).unwrap();
        let n = 12;
        let vertices = (0..n * n).map(|k| {
            let at = |i: u32| 0.2 * (f64::from(i) / f64::from(n - 1) - 0.5);
            Point::new(0.0, at(k % n), at(k / n))
        });
        let corners = (0..(n - 1) * (n - 1)).map(|k| k / (n - 1) * n + k % (n - 1));
        let cells = corners.flat_map(|a| [[a, a + 1, a + n], [a + 1, a + n + 1, a + n]]);
        let sheet = TriMesh::new(vertices.collect(), cells.collect()).unwrap();
        let outfit = outfit(rod, vec![sheet]);
        let x = outfit.layers().flat_map(|l| l.mesh.vertices()).copied().collect();
        (outfit, x)
    }

    #[test]
    fn a_rod_that_jumps_through_cloth_is_caught_and_one_that_goes_along_is_not() {
        let (outfit, from) = rod_and_sheet(-0.05);
        let (_, to) = rod_and_sheet(0.05);
        let crossings = Crossings::new(&outfit).unwrap();
        let found = crossings.between(&from, &to).unwrap();
        assert!(found.len() > 30 && found.iter().all(Crossing::is_of_layers), "{}", found.len());
        let first = found.iter().map(|c| c.share).fold(1.0, Real::min);
        // The rod of 4 mm touches after 46 of 100 mm.
        assert!((first - 0.46).abs() < 1e-6, "{first}");
        assert!(found.iter().all(|c| c.triangles[0].0 == 0 && c.triangles[1].0 == 1));
        // Cloth that gives way, near as it is.
        let n = outfit.body.mesh.vertices().len();
        let away = |x: &[Point], by: Real| -> Vec<Point> {
            let moved = x.iter().enumerate();
            moved.map(|(v, p)| if v < n { *p } else { p + Vector::x() * by }).collect()
        };
        let near = away(&from, -0.05 + 0.0041);
        let gone = away(&to, 0.05 + 0.0041);
        assert_eq!(crossings.between(&near, &gone).unwrap(), []);
        // A jump of the rod's end alone, and back.
        assert_eq!(crossings.between(&to, &from).unwrap().len(), found.len());
        let same = crossings.between(&to, &to).unwrap();
        assert!(same.is_empty(), "{same:?}");
        assert!(crossings.between(&from, &to[1..]).is_err());
        // More than are to be found, and a search that is cancelled.
        let at_most = |most| crossings.between_at_most(&from, &to, most, &|| false).unwrap();
        assert_eq!(at_most(found.len()), Some(found.clone()));
        assert_eq!(at_most(found.len() - 1), None);
        let stopped = crossings.between_at_most(&from, &to, usize::MAX, &|| true);
        assert!(matches!(stopped, Err(WalkError::Cancelled(_))), "{stopped:?}");
    }

    #[test]
    fn the_times_are_those_of_small_steps() {
        // An arm that bends through its sleeve, which stays.
        let outfit = arm();
        let from: Vec<Point> = outfit.layers().flat_map(|l| l.mesh.vertices()).copied().collect();
        let n = outfit.body.mesh.vertices().len();
        let mut to = bent(&from, 0.7);
        to[n..].copy_from_slice(&from[n..]);
        let crossings = Crossings::new(&outfit).unwrap();
        let found = crossings.between(&from, &to).unwrap();
        let at = |t: Real| -> Vec<Point> {
            from.iter().zip(&to).map(|(a, b)| a + (b - a) * t).collect()
        };
        // Those that meet at the end are the pairs of the end.
        let meet = |t: Real| {
            let x = at(t);
            let mesh = crossings.scene.mesh.with_vertices(x).unwrap();
            let pairs = crate::findings::own_of(&mesh, &Bvh::new(&mesh));
            let local = pairs.iter().map(|p| p.map(|t| crossings.scene.local_triangle(t)));
            local.collect::<Vec<_>>()
        };
        let last = meet(1.0);
        assert!(found.len() > 20 && last.len() > 20, "{} {}", found.len(), last.len());
        assert!(found.iter().all(|c| !last.contains(&c.triangles)));
        let mut seen = 0;
        for k in 1..64 {
            let t = Real::from(k) / 64.0;
            for pair in meet(t).into_iter().filter(|p| !last.contains(p)) {
                let of = |c: &&Crossing| c.triangles == pair;
                let crossing = found.iter().find(of);
                // Triangles with a common corner are left out.
                if let Some(crossing) = crossing {
                    assert!(crossing.share <= t, "{crossing:?} {t}");
                    seen += 1;
                } else {
                    assert_eq!(pair[0].0, pair[1].0, "{pair:?} {t}");
                }
            }
        }
        assert!(seen > 20, "{seen}");
        // On the way back the same pairs meet: those of the start, now, are left out as well.
        let pairs = |found: &[Crossing]| found.iter().map(|c| c.triangles).collect::<Vec<_>>();
        assert_eq!(pairs(&crossings.between(&to, &from).unwrap()), pairs(&found));
    }
}
