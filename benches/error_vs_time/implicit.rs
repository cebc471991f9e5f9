//! Implicit Euler for mass and springs, solved by Newton's method to the last digits: what methods are measured against.

use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};
use if_core::math::{Point, Real, Vector};
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::particles::Particles;
use nalgebra::Matrix3;

/// Springs, masses and gravity.
pub(crate) struct Springs<'a> {
    edges: Vec<([u32; 2], Real)>,
    beta: Real,
    particles: &'a Particles,
    gravity: Vector,
}

impl<'a> Springs<'a> {
    pub(crate) fn new(edges: &EdgeSet, beta: Real, particles: &'a Particles, gravity: Vector) -> Self {
        Self { edges: edges.visited().collect(), beta, particles, gravity }
    }

    fn mass(&self, v: usize) -> Option<Real> {
        let w = self.particles.inverse_masses[v];
        (w > 0.0).then(|| 1.0 / w)
    }

    /// Σ m |x − x̃|² / 2h² + Σ (|e| − ℓ)² / 2β − Σ m g·x.
    fn energy(&self, x: &[Point], aim: &[Point], h: Real) -> Real {
        let inertia: Real = (0..x.len())
            .filter_map(|v| {
                self.mass(v).map(|m| m * ((x[v] - aim[v]).norm_squared() / (2.0 * h * h) - self.gravity.dot(&x[v].coords)))
            })
            .sum();
        let stretch: Real =
            self.edges.iter().map(|([i, j], rest)| ((x[*i as usize] - x[*j as usize]).norm() - rest).powi(2)).sum();
        inertia + stretch / (2.0 * self.beta)
    }

    /// The minimum of the energy of a step of `h` that aims at `aim` (the inertial positions, without gravity), from `x`.
    /// A large `h` gives the equilibrium.
    pub(crate) fn minimize(&self, mut x: Vec<Point>, aim: &[Point], h: Real) -> Vec<Point> {
        let mut count = 0;
        let rows: Vec<Option<usize>> = (0..x.len())
            .map(|v| {
                self.mass(v).map(|_| {
                    count += 3;
                    count - 3
                })
            })
            .collect();
        for _ in 0..500 {
            let mut gradient = vec![Vector::zeros(); x.len()];
            for v in 0..x.len() {
                if let Some(m) = self.mass(v) {
                    gradient[v] = m * ((x[v] - aim[v]) / (h * h) - self.gravity);
                }
            }
            for ([i, j], rest) in &self.edges {
                let e = x[*i as usize] - x[*j as usize];
                let pull = e * ((1.0 - rest / e.norm()) / self.beta);
                gradient[*i as usize] += pull;
                gradient[*j as usize] -= pull;
            }
            let mut right = Mat::zeros(count, 1);
            for (row, g) in rows.iter().zip(&gradient) {
                if let Some(row) = row {
                    (0..3).for_each(|k| right[(row + k, 0)] = -g[k]);
                }
            }
            // The exact matrix where it is positive definite, else without what makes compressed springs buckle.
            let step =
                self.factor(&x, &rows, count, h, false).or_else(|| self.factor(&x, &rows, count, h, true)).unwrap().solve(&right);
            let step: Vec<Vector> =
                rows.iter().map(|r| r.map_or(Vector::zeros(), |r| Vector::from_fn(|k, _| step[(r + k, 0)]))).collect();
            let longest = step.iter().map(|s| s.norm()).fold(0.0, Real::max);
            let slope: Real = step.iter().zip(&gradient).map(|(s, g)| s.dot(g)).sum();
            let before = self.energy(&x, aim, h);
            let mut share = 1.0;
            let moved = loop {
                let trial: Vec<Point> = x.iter().zip(&step).map(|(p, s)| p + s * share).collect();
                if self.energy(&trial, aim, h) <= before + 1e-4 * share * slope || share < 1e-9 {
                    break trial;
                }
                share *= 0.5;
            };
            x = moved;
            if longest < 1e-11 || share < 1e-9 {
                break;
            }
        }
        x
    }

    fn factor(&self, x: &[Point], rows: &[Option<usize>], count: usize, h: Real, definite: bool) -> Option<Llt<usize, Real>> {
        let mut entries = Vec::new();
        let mut add = |i: Option<usize>, j: Option<usize>, block: &Matrix3<Real>| {
            if let (Some(i), Some(j)) = (i, j) {
                for (a, b) in (0..9).map(|k| (k / 3, k % 3)) {
                    if i + a >= j + b {
                        entries.push(Triplet::new(i + a, j + b, block[(a, b)]));
                    }
                }
            }
        };
        for (v, row) in rows.iter().enumerate() {
            if let Some(m) = self.mass(v) {
                add(*row, *row, &(Matrix3::identity() * (m / (h * h))));
            }
        }
        for ([i, j], rest) in &self.edges {
            let e = x[*i as usize] - x[*j as usize];
            let along = e.normalize();
            let across = 1.0 - rest / e.norm();
            let across = if definite { across.max(0.0) } else { across };
            let block = ((1.0 - across) * along * along.transpose() + Matrix3::identity() * across) / self.beta;
            let (i, j) = (rows[*i as usize], rows[*j as usize]);
            add(i, i, &block);
            add(j, j, &block);
            add(i, j, &-block);
            add(j, i, &-block);
        }
        let matrix = SparseColMat::try_new_from_triplets(count, count, &entries).ok()?;
        let symbolic = SymbolicLlt::try_new(matrix.symbolic(), Side::Lower).ok()?;
        Llt::try_new_with_symbolic(symbolic, matrix.as_ref(), Side::Lower).ok()
    }
}
