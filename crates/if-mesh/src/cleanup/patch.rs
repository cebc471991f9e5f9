//! The inside of a filled hole: refined to the size of the triangles round it.

use super::lid::Chords;
use super::twins::{NONE, Twins, ends, next, previous};
use if_core::math::{Point, Real, Vector, area_vector};
use std::collections::HashSet;

/// A triangulated piece of surface whose first vertices are those of the loop it closes.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    /// Vertices of the loop.
    pub(super) rim: usize,
    /// The loop's vertices, then those inside.
    pub(super) points: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// A triangle is split if its centre is farther from each corner than the corner's edge length over
/// this.
const DENSITY: Real = std::f64::consts::SQRT_2;
/// Rounds of turning edges after each round of splitting, at most: they end by themselves on flat
/// patches.
const TURNS: usize = 20;
/// Rounds of splitting, at most; each divides lengths by 1.7.
const SPLITS: usize = 40;
/// Sum of the cotangents of two opposite angles below which an edge is turned. Zero would turn the
/// diagonals of squares for ever.
const NOT_DELAUNAY: Real = -1e-9;

/// Splits the triangles of `patch` until their edges are as long as `lengths` say at the loop's
/// vertices, in metres, and turns edges so that angles are large. Stops at `most` new vertices.
///
/// # Source
///
/// Liepa 2003, section 4.
pub(super) fn refine(patch: &mut Patch, lengths: &[Real], taken: &Chords, most: usize) {
    let mut net = Net::new(patch, lengths, taken);
    net.relax();
    for _ in 0..SPLITS {
        let mut split = false;
        for t in 0..net.triangles.len() as u32 {
            if net.points.len() - patch.rim >= most {
                break;
            }
            split |= net.split(t);
        }
        net.relax();
        if !split {
            break;
        }
    }
    (patch.points, patch.triangles) = (net.points, net.triangles);
}

struct Net<'a> {
    points: Vec<Point>,
    /// Wanted edge length at each vertex.
    lengths: Vec<Real>,
    triangles: Vec<[u32; 3]>,
    twins: Vec<u32>,
    edges: HashSet<(u32, u32)>,
    taken: &'a Chords,
}

fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

impl<'a> Net<'a> {
    fn new(patch: &Patch, lengths: &[Real], taken: &'a Chords) -> Self {
        let twins = Twins::new(patch.points.len(), &patch.triangles).of;
        let edges = patch
            .triangles
            .iter()
            .flat_map(|t| [key(t[0], t[1]), key(t[1], t[2]), key(t[2], t[0])])
            .collect();
        Self {
            points: patch.points.clone(),
            lengths: lengths.to_vec(),
            triangles: patch.triangles.clone(),
            twins,
            edges,
            taken,
        }
    }

    fn join(&mut self, g: u32, h: u32) {
        if g != NONE {
            self.twins[g as usize] = h;
        }
        if h != NONE {
            self.twins[h as usize] = g;
        }
    }

    /// Puts a vertex into the middle of a triangle that is too large.
    fn split(&mut self, t: u32) -> bool {
        let corners = self.triangles[t as usize];
        let center = Point::from(
            corners.iter().fold(Vector::zeros(), |s, v| s + self.points[*v as usize].coords) / 3.0,
        );
        let wanted = corners.iter().map(|v| self.lengths[*v as usize]).sum::<Real>() / 3.0;
        let is_far = |v: &u32| {
            let d = DENSITY * (self.points[*v as usize] - center).norm();
            d > wanted && d > self.lengths[*v as usize]
        };
        if !corners.iter().all(is_far) {
            return false;
        }
        let [a, b, c] = corners;
        let x = self.points.len() as u32;
        self.points.push(center);
        self.lengths.push(wanted);
        let outer = [0, 1, 2].map(|k| self.twins[(3 * t + k) as usize]);
        let (t1, t2) = (self.triangles.len() as u32, self.triangles.len() as u32 + 1);
        self.triangles[t as usize] = [a, b, x];
        self.triangles.extend([[b, c, x], [c, a, x]]);
        self.twins.resize(3 * self.triangles.len(), NONE);
        self.join(3 * t, outer[0]);
        self.join(3 * t1, outer[1]);
        self.join(3 * t2, outer[2]);
        self.join(3 * t + 1, 3 * t1 + 2);
        self.join(3 * t1 + 1, 3 * t2 + 2);
        self.join(3 * t2 + 1, 3 * t + 2);
        self.edges.extend([key(a, x), key(b, x), key(c, x)]);
        for h in [3 * t, 3 * t1, 3 * t2] {
            self.turn_if_better(h);
        }
        true
    }

    /// Turns edges until no turn helps.
    fn relax(&mut self) {
        for _ in 0..TURNS {
            let mut turned = false;
            for h in 0..self.twins.len() as u32 {
                turned |= self.turn_if_better(h);
            }
            if !turned {
                break;
            }
        }
    }

    /// Turns the edge of `h` if the angles opposite to it sum to more than 180°, and nothing is in
    /// the way.
    fn turn_if_better(&mut self, h: u32) -> bool {
        let g = self.twins[h as usize];
        if g == NONE {
            return false;
        }
        let [a, b] = ends(&self.triangles, h);
        let c = ends(&self.triangles, previous(h))[0];
        let d = ends(&self.triangles, previous(g))[0];
        if c == d || self.cotangent(c, a, b) + self.cotangent(d, b, a) >= NOT_DELAUNAY {
            return false;
        }
        if self.edges.contains(&key(c, d)) || self.taken.contains(&key(c, d)) {
            return false;
        }
        let normal = |i: u32, j: u32, k: u32| {
            area_vector(
                &self.points[i as usize],
                &self.points[j as usize],
                &self.points[k as usize],
            )
        };
        let both = normal(a, b, c) + normal(b, a, d);
        if normal(a, d, c).dot(&both) <= 0.0 || normal(b, c, d).dot(&both) <= 0.0 {
            return false;
        }
        let (ca, bc, ad, db) = (previous(h), next(h), next(g), previous(g));
        let [ca, bc, ad, db] = [ca, bc, ad, db].map(|h| self.twins[h as usize]);
        let (t, u) = (h / 3, g / 3);
        self.triangles[t as usize] = [a, d, c];
        self.triangles[u as usize] = [b, c, d];
        self.join(3 * t, ad);
        self.join(3 * t + 2, ca);
        self.join(3 * u, bc);
        self.join(3 * u + 2, db);
        self.join(3 * t + 1, 3 * u + 1);
        self.edges.remove(&key(a, b));
        self.edges.insert(key(c, d));
        true
    }

    /// Cotangent of the angle at `p` in the triangle (p, q, r); large and negative for a flat one.
    fn cotangent(&self, p: u32, q: u32, r: u32) -> Real {
        let [p, q, r] = [p, q, r].map(|v| self.points[v as usize]);
        let (u, v) = (q - p, r - p);
        let sine = u.cross(&v).norm();
        if sine > 0.0 {
            u.dot(&v) / sine
        } else if u.dot(&v) < 0.0 {
            Real::MIN / 4.0
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lid::Lid;
    use super::*;

    #[test]
    fn a_disc_is_filled_with_even_triangles() {
        let n = 48;
        let points: Vec<Point> = (0..n)
            .map(|k| {
                let a = k as Real / n as Real * std::f64::consts::TAU;
                Point::new(a.cos(), a.sin(), 0.0)
            })
            .collect();
        let (outside, taken) = (vec![Vector::z(); n], Chords::new());
        let triangles =
            Lid { points: &points, outside: &outside, taken: &taken }.triangulate(64).unwrap();
        let mut patch = Patch { rim: n, points, triangles };
        let edge = 2.0 * (std::f64::consts::PI / n as Real).sin();
        refine(&mut patch, &vec![edge; n], &taken, 10_000);
        let twins = Twins::new(patch.points.len(), &patch.triangles);
        assert!(twins.crowded.is_empty() && twins.against.is_empty());
        assert_eq!(twins.rim().count(), n);
        assert_eq!(patch.triangles.len(), 2 * (patch.points.len() - n) + n - 2);
        // Equilateral triangles of that edge would be 423; those that are left are up to 1.7 times
        // as long.
        assert!((150..900).contains(&patch.triangles.len()), "{}", patch.triangles.len());
        let areas: Vec<Real> = patch
            .triangles
            .iter()
            .map(|t| {
                area_vector(
                    &patch.points[t[0] as usize],
                    &patch.points[t[1] as usize],
                    &patch.points[t[2] as usize],
                )
                .z / 2.0
            })
            .collect();
        assert!(areas.iter().all(|a| *a > 0.0));
        approx::assert_relative_eq!(
            areas.iter().sum::<Real>(),
            24.0 * (std::f64::consts::TAU / 48.0).sin(),
            max_relative = 1e-12
        );
    }

    #[test]
    fn refining_ends_at_the_vertices_allowed() {
        let points = vec![Point::origin(), Point::new(1.0, 0.0, 0.0), Point::new(0.0, 1.0, 0.0)];
        let mut patch = Patch { rim: 3, points, triangles: vec![[0, 1, 2]] };
        refine(&mut patch, &[1e-9; 3], &Chords::new(), 500);
        assert_eq!(patch.points.len(), 503);
    }
}
