//! A patch that fills a hole, refined to the size of the triangles around it.

use super::half_edges::{HalfEdges, NONE, ends, next, previous};
use super::loop_triangulation::Chords;
use if_core::math::{Point, Real, Vector, area_vector};
use std::collections::HashSet;

/// A triangulated piece of surface; its first vertices are those of the loop it closes.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    /// Number of vertices on the loop.
    pub(super) boundary: usize,
    /// The loop's vertices, then those inside.
    pub(super) points: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// A triangle is split if its centre is farther from each corner than the corner's wanted edge length
/// over this.
const DENSITY: Real = std::f64::consts::SQRT_2;
/// Maximum number of rounds of edge flips after each round of splits: on flat patches they end by
/// themselves.
const FLIP_ROUNDS: usize = 20;
/// Maximum number of rounds of splits; each divides lengths by 1.7.
const SPLIT_ROUNDS: usize = 40;
/// Sum of the cotangents of two opposite angles below which an edge is flipped. Zero would flip the
/// diagonals of squares for ever.
const NOT_DELAUNAY: Real = -1e-9;

/// Splits the triangles of `patch` until their edges are as long as `lengths` at the loop's vertices,
/// in metres, and flips edges towards a Delaunay triangulation. Stops at `most` new vertices.
///
/// # Source
///
/// Liepa 2003, section 4.
pub(super) fn refine(patch: &mut Patch, lengths: &[Real], forbidden: &Chords, most: usize) {
    let mut net = Net::new(patch, lengths, forbidden);
    net.relax();
    for _ in 0..SPLIT_ROUNDS {
        let mut split = false;
        for t in 0..net.triangles.len() as u32 {
            if net.points.len() - patch.boundary >= most {
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

/// A patch with the twins of its half-edges.
struct Net<'a> {
    points: Vec<Point>,
    /// Wanted edge length at each vertex.
    lengths: Vec<Real>,
    triangles: Vec<[u32; 3]>,
    twins: Vec<u32>,
    edges: HashSet<(u32, u32)>,
    forbidden: &'a Chords,
}

fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

impl<'a> Net<'a> {
    fn new(patch: &Patch, lengths: &[Real], forbidden: &'a Chords) -> Self {
        let twins = HalfEdges::new(patch.points.len(), &patch.triangles).twin;
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
            forbidden,
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

    /// Splits a triangle at its centre if it is too large.
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
            self.flip_if_better(h);
        }
        true
    }

    /// Flips edges until no flip helps.
    fn relax(&mut self) {
        for _ in 0..FLIP_ROUNDS {
            let mut flipped = false;
            for h in 0..self.twins.len() as u32 {
                flipped |= self.flip_if_better(h);
            }
            if !flipped {
                break;
            }
        }
    }

    /// Flips the edge of `h` if the angles opposite to it sum to more than 180°, the new edge does
    /// not exist yet, and no triangle turns over.
    fn flip_if_better(&mut self, h: u32) -> bool {
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
        if self.edges.contains(&key(c, d)) || self.forbidden.contains(&key(c, d)) {
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

    /// Cotangent of the angle at `p` in the triangle (p, q, r); large and negative for an angle of 180°.
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
    use super::super::loop_triangulation::LoopPolygon;
    use super::*;

    #[test]
    fn a_disc_is_filled_with_triangles_of_even_size() {
        let n = 48;
        let points: Vec<Point> = (0..n)
            .map(|k| {
                let a = k as Real / n as Real * std::f64::consts::TAU;
                Point::new(a.cos(), a.sin(), 0.0)
            })
            .collect();
        let (outside, forbidden) = (vec![Vector::z(); n], Chords::new());
        let triangles = LoopPolygon { points: &points, outside: &outside, forbidden: &forbidden }
            .triangulate(64)
            .unwrap();
        let mut patch = Patch { boundary: n, points, triangles };
        let edge = 2.0 * (std::f64::consts::PI / n as Real).sin();
        refine(&mut patch, &vec![edge; n], &forbidden, 10_000);
        let half_edges = HalfEdges::new(patch.points.len(), &patch.triangles);
        assert!(half_edges.non_manifold.is_empty() && half_edges.inconsistent.is_empty());
        assert_eq!(half_edges.boundary().count(), n);
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
    fn refinement_stops_at_the_maximum_number_of_vertices() {
        let points = vec![Point::origin(), Point::new(1.0, 0.0, 0.0), Point::new(0.0, 1.0, 0.0)];
        let mut patch = Patch { boundary: 3, points, triangles: vec![[0, 1, 2]] };
        refine(&mut patch, &[1e-9; 3], &Chords::new(), 500);
        assert_eq!(patch.points.len(), 503);
    }
}
