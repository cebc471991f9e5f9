//! Triangulation of a closed loop: minimum weight, or ear clipping for long loops.

use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashSet};

/// Pairs of places on a loop, the smaller first, that are joined by an edge.
pub(super) type Chords = HashSet<(u32, u32)>;

/// A loop to close, in the direction of the triangles that will close it.
#[derive(Clone, Debug)]
pub(super) struct LoopPolygon<'a> {
    /// Its vertices.
    pub(super) points: &'a [Point],
    /// The unit normal of the triangle beyond the edge from each vertex to the next; zero if there
    /// is no triangle.
    pub(super) outside: &'a [Vector],
    /// Chords that are edges of the mesh already, and must not be repeated.
    pub(super) forbidden: &'a Chords,
}

/// Weight of a triangulation: the sharpest fold, as 1 − cos, before the area.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
struct Weight {
    fold: Real,
    area: Real,
}

const IMPOSSIBLE: Weight = Weight { fold: Real::INFINITY, area: Real::INFINITY };
/// Fold of a triangle of zero area: more than that of any other (2), so that it is the last resort.
const NO_NORMAL: Real = 3.0;

impl LoopPolygon<'_> {
    /// Triangulates the loop: the smallest sharpest fold and, among equals, the smallest area; loops
    /// of more than `exact_up_to` edges by ear clipping. `None` if the forbidden chords admit no
    /// triangulation.
    ///
    /// # Source
    ///
    /// Liepa 2003, *Filling Holes in Meshes*, after Barequet and Sharir 1995.
    pub(super) fn triangulate(&self, exact_up_to: usize) -> Option<Vec<[u32; 3]>> {
        match self.points.len() {
            0..=2 => None,
            n if n <= exact_up_to => self.minimum_weight(),
            _ => self.clip_ears(),
        }
    }

    fn is_forbidden(&self, i: usize, j: usize) -> bool {
        self.forbidden.contains(&(i.min(j) as u32, i.max(j) as u32))
    }

    /// Dynamic programming over all triangulations, in O(n³).
    fn minimum_weight(&self) -> Option<Vec<[u32; 3]>> {
        let n = self.points.len();
        let at = |i: usize, k: usize| i * n + k;
        let mut weights = vec![IMPOSSIBLE; n * n];
        let mut normals = vec![Vector::zeros(); n * n]; // of the triangle chosen on the chord
        let mut middles = vec![0u32; n * n];
        for i in 0..n - 1 {
            weights[at(i, i + 1)] = Weight { fold: 0.0, area: 0.0 };
            normals[at(i, i + 1)] = self.outside[i];
        }
        // Best triangulation below each chord (i, k), shorter chords first.
        for span in 2..n {
            for i in 0..n - span {
                let k = i + span;
                let closing = span == n - 1;
                if !closing && self.is_forbidden(i, k) {
                    continue;
                }
                let mut best = IMPOSSIBLE;
                // Apex m of the triangle on the chord (i, k).
                for m in i + 1..k {
                    let (left, right) = (weights[at(i, m)], weights[at(m, k)]);
                    let below = left.fold.max(right.fold);
                    if below > best.fold || below == Real::INFINITY {
                        continue;
                    }
                    let twice = area_vector(&self.points[i], &self.points[m], &self.points[k]);
                    let area = left.area + right.area + 0.5 * twice.norm();
                    let normal = unit_or_zero(&twice);
                    let mut worst = below
                        .max(fold(&normal, &normals[at(i, m)]))
                        .max(fold(&normal, &normals[at(m, k)]));
                    if closing {
                        worst = worst.max(fold(&normal, &self.outside[n - 1]));
                    }
                    let weight = Weight { fold: worst, area };
                    if weight < best {
                        best = weight;
                        normals[at(i, k)] = normal;
                        middles[at(i, k)] = m as u32;
                    }
                }
                weights[at(i, k)] = best;
            }
        }
        if weights[at(0, n - 1)].fold == Real::INFINITY {
            return None;
        }
        let mut triangles = Vec::with_capacity(n - 2);
        // Collect the triangles from the apices.
        let mut open = vec![(0, n - 1)];
        while let Some((i, k)) = open.pop() {
            if k < i + 2 {
                continue;
            }
            let m = middles[at(i, k)] as usize;
            triangles.push([i as u32, m as u32, k as u32]);
            open.extend([(i, m), (m, k)]);
        }
        Some(triangles)
    }

    /// Clips the ear of least cost (a short new edge, a small fold) until the loop is closed.
    fn clip_ears(&self) -> Option<Vec<[u32; 3]>> {
        let n = self.points.len();
        let mut next: Vec<usize> = (0..n).map(|k| (k + 1) % n).collect();
        let mut previous: Vec<usize> = (0..n).map(|k| (k + n - 1) % n).collect();
        let mut beyond = self.outside.to_vec(); // normal beyond the edge from k to next[k]
        // Entries of the heap with an older stamp are out of date.
        let mut stamp = vec![0u32; n];
        let mut left = n;
        let mut triangles = Vec::with_capacity(n - 2);
        let mut heap: BinaryHeap<Ear> =
            (0..n).filter_map(|k| self.ear(k, [previous[k], next[k]], &beyond, 0, left)).collect();
        while let Some(ear) = heap.pop() {
            let (k, a, b) = (ear.tip, previous[ear.tip], next[ear.tip]);
            if stamp[k] != ear.stamp {
                continue;
            }
            triangles.push([a as u32, k as u32, b as u32]);
            left -= 1;
            if left == 2 {
                return Some(triangles);
            }
            stamp[k] = u32::MAX;
            beyond[a] =
                unit_or_zero(&area_vector(&self.points[a], &self.points[k], &self.points[b]));
            (next[a], previous[b]) = (b, a);
            for v in [a, b] {
                stamp[v] += 1;
                heap.extend(self.ear(v, [previous[v], next[v]], &beyond, stamp[v], left));
            }
        }
        None
    }

    fn ear(
        &self,
        tip: usize,
        [a, b]: [usize; 2],
        beyond: &[Vector],
        stamp: u32,
        left: usize,
    ) -> Option<Ear> {
        if left > 3 && self.is_forbidden(a, b) {
            return None;
        }
        let normal =
            unit_or_zero(&area_vector(&self.points[a], &self.points[tip], &self.points[b]));
        let worst = fold(&normal, &beyond[a]).max(fold(&normal, &beyond[tip]));
        // An ear that folds by less than 60° costs up to 1.5 times its chord; one that folds back,
        // up to 30 times.
        let cost = (self.points[b] - self.points[a]).norm()
            * (1.0 + worst + 8.0 * (worst - 0.5).max(0.0).powi(2));
        Some(Ear { cost, tip, stamp })
    }
}

/// 1 − cos of the angle between two normals.
fn fold(a: &Vector, b: &Vector) -> Real {
    if *a == Vector::zeros() {
        NO_NORMAL
    } else if *b == Vector::zeros() {
        0.0 // there is no triangle beyond that edge
    } else {
        1.0 - a.dot(b)
    }
}

struct Ear {
    cost: Real,
    tip: usize,
    stamp: u32,
}

impl Ord for Ear {
    /// The cheapest is the greatest; of equal ones the first. `BinaryHeap` pops the greatest.
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .cost
            .total_cmp(&self.cost)
            .then(other.tip.cmp(&self.tip))
            .then(other.stamp.cmp(&self.stamp))
    }
}
impl PartialOrd for Ear {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Ear {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Ear {}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(n: usize, height: impl Fn(usize) -> Real) -> Vec<Point> {
        (0..n)
            .map(|k| {
                let a = k as Real / n as Real * std::f64::consts::TAU;
                Point::new(a.cos(), a.sin(), height(k))
            })
            .collect()
    }

    fn area(points: &[Point], triangles: &[[u32; 3]]) -> Real {
        triangles
            .iter()
            .map(|t| {
                0.5 * area_vector(
                    &points[t[0] as usize],
                    &points[t[1] as usize],
                    &points[t[2] as usize],
                )
                .norm()
            })
            .sum()
    }

    /// The smallest (fold, area) of all triangulations, by trying them all.
    fn brute(lid: &LoopPolygon, i: usize, k: usize, above: &Vector) -> Option<(Real, Real)> {
        if k == i + 1 {
            return Some((fold(above, &lid.outside[i]), 0.0));
        }
        let mut best: Option<(Real, Real)> = None;
        for m in i + 1..k {
            let twice = area_vector(&lid.points[i], &lid.points[m], &lid.points[k]);
            let normal = unit_or_zero(&twice);
            let here = fold(&normal, above);
            if let (Some(l), Some(r)) = (brute(lid, i, m, &normal), brute(lid, m, k, &normal)) {
                let w = (here.max(l.0).max(r.0), l.1 + r.1 + 0.5 * twice.norm());
                if best.is_none_or(|b| w < b) {
                    best = Some(w);
                }
            }
        }
        best
    }

    #[test]
    fn both_methods_close_a_flat_loop_with_a_flat_lid() {
        let (points, forbidden) = (circle(40, |_| 0.0), Chords::new());
        let outside = vec![Vector::z(); 40];
        let lid = LoopPolygon { points: &points, outside: &outside, forbidden: &forbidden };
        for limit in [3, 64] {
            let triangles = lid.triangulate(limit).unwrap();
            assert_eq!(triangles.len(), 38);
            let polygon = 20.0 * (std::f64::consts::TAU / 40.0).sin();
            approx::assert_relative_eq!(area(&points, &triangles), polygon, max_relative = 1e-12);
        }
    }

    #[test]
    fn the_dynamic_programme_agrees_with_trying_all_triangulations() {
        let points = circle(8, |k| 0.4 * (2.3 * k as Real).sin());
        let outside: Vec<Vector> =
            (0..8).map(|k| unit_or_zero(&Vector::new(0.3 * k as Real, 0.2, 1.0))).collect();
        let forbidden = Chords::new();
        let lid = LoopPolygon { points: &points, outside: &outside, forbidden: &forbidden };
        let triangles = lid.triangulate(8).unwrap();
        let normal = |t: &[u32; 3]| {
            unit_or_zero(&area_vector(
                &points[t[0] as usize],
                &points[t[1] as usize],
                &points[t[2] as usize],
            ))
        };
        let mut sharpest: Real = 0.0;
        for t in &triangles {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let other =
                    triangles.iter().find(|u| (0..3).any(|j| (u[j], u[(j + 1) % 3]) == (b, a)));
                let beyond = other.map_or(outside[a as usize], &normal);
                sharpest = sharpest.max(fold(&normal(t), &beyond));
            }
        }
        let (best, _) = brute(&lid, 0, 7, &outside[7]).unwrap();
        approx::assert_relative_eq!(sharpest, best, max_relative = 1e-12);
    }

    #[test]
    fn forbidden_chords_are_not_repeated() {
        let (points, outside) = (circle(4, |_| 0.0), vec![Vector::z(); 4]);
        for limit in [3, 64] {
            let one = Chords::from([(0, 2)]);
            let lid = LoopPolygon { points: &points, outside: &outside, forbidden: &one };
            let triangles = lid.triangulate(limit).unwrap();
            assert!(triangles.iter().all(|t| t.contains(&1) && t.contains(&3)));
            let both = Chords::from([(0, 2), (1, 3)]);
            assert_eq!(LoopPolygon { forbidden: &both, ..lid }.triangulate(limit), None);
        }
    }
}
