//! Implicit Euler for mass and springs, solved by Newton's method to the last digits: what methods
//! are measured against.

use if_core::math::{Point, Real, Vector};
use if_sparse::{Cholesky, Entry, Mat};
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::particles::Particles;
use nalgebra::Matrix3;

/// Springs, masses and gravity; and a ball that nothing enters.
pub(crate) struct Springs<'a> {
    edges: Vec<([u32; 2], Real)>,
    beta: Real,
    particles: &'a Particles,
    gravity: Vector,
    ball: Option<Ball>,
}

/// A ball without friction, kept clear by an augmented Lagrangian: μ for each particle, and the
/// stiffness beside it.
struct Ball {
    center: Point,
    radius: Real,
    stiffness: Real,
    multipliers: Vec<Real>,
}

impl Ball {
    /// The force on particle `v` at `p`, and from where to where it points.
    fn push(&self, v: usize, p: &Point) -> Option<(Real, Vector, Real)> {
        let d = p - self.center;
        let force = self.multipliers[v] + self.stiffness * (self.radius - d.norm());
        (force > 0.0).then(|| (force, d / d.norm(), d.norm()))
    }
}

impl<'a> Springs<'a> {
    pub(crate) fn new(
        edges: &EdgeSet,
        beta: Real,
        particles: &'a Particles,
        gravity: Vector,
    ) -> Self {
        Self { edges: edges.visited().collect(), beta, particles, gravity, ball: None }
    }

    /// The minimum, as [`Self::minimize`], over all positions outside of a ball, each to 1e-11 m.
    pub(crate) fn minimize_outside(
        mut self,
        x: Vec<Point>,
        aim: &[Point],
        h: Real,
        center: Point,
        radius: Real,
    ) -> Vec<Point> {
        let stiffness = 100.0 / self.beta;
        self.ball = Some(Ball { center, radius, stiffness, multipliers: vec![0.0; x.len()] });
        let mut x = x;
        for _ in 0..60 {
            x = self.minimize(x, aim, h);
            let ball = self.ball.as_mut().expect("it was put there");
            let mut worst: Real = 0.0;
            for (v, p) in x.iter().enumerate() {
                let inside = radius - (p - center).norm();
                let after = (ball.multipliers[v] + stiffness * inside).max(0.0);
                worst = worst.max((after - ball.multipliers[v]).abs() / stiffness);
                ball.multipliers[v] = after;
            }
            if worst < 1e-11 {
                break;
            }
        }
        x
    }

    fn mass(&self, v: usize) -> Option<Real> {
        let w = self.particles.inverse_masses[v];
        (w > 0.0).then(|| 1.0 / w)
    }

    /// Σ m |x − x̃|² / 2h² + Σ (|e| − ℓ)² / 2β − Σ m g·x.
    fn energy(&self, x: &[Point], aim: &[Point], h: Real) -> Real {
        let inertia: Real = (0..x.len())
            .filter_map(|v| {
                self.mass(v).map(|m| {
                    m * ((x[v] - aim[v]).norm_squared() / (2.0 * h * h)
                        - self.gravity.dot(&x[v].coords))
                })
            })
            .sum();
        let stretch: Real = self
            .edges
            .iter()
            .map(|([i, j], rest)| ((x[*i as usize] - x[*j as usize]).norm() - rest).powi(2))
            .sum();
        let contact: Real = self.ball.as_ref().map_or(0.0, |ball| {
            let pushes = x.iter().enumerate().filter_map(|(v, p)| ball.push(v, p));
            pushes.map(|(force, ..)| force * force / (2.0 * ball.stiffness)).sum()
        });
        inertia + stretch / (2.0 * self.beta) + contact
    }

    /// The minimum of the energy of a step of `h` that aims at `aim` (the inertial positions,
    /// without gravity), from `x`. A large `h` gives the equilibrium.
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
            if let Some(ball) = &self.ball {
                for (v, p) in x.iter().enumerate() {
                    if let Some((force, out, _)) = ball.push(v, p) {
                        gradient[v] -= out * force;
                    }
                }
            }
            let mut right = Mat::zeros(count, 1);
            for (row, g) in rows.iter().zip(&gradient) {
                if let Some(row) = row {
                    (0..3).for_each(|k| right[(row + k, 0)] = -g[k]);
                }
            }
            // The exact matrix where it is positive definite, else without what makes compressed
            // springs buckle.
            let exact = self.factor(&x, &rows, count, h, false);
            exact
                .or_else(|| self.factor(&x, &rows, count, h, true))
                .unwrap()
                .solve_in_place(&mut right);
            let step: Vec<Vector> = rows
                .iter()
                .map(|r| r.map_or(Vector::zeros(), |r| Vector::from_fn(|k, _| right[(r + k, 0)])))
                .collect();
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

    fn factor(
        &self,
        x: &[Point],
        rows: &[Option<usize>],
        count: usize,
        h: Real,
        definite: bool,
    ) -> Option<Cholesky> {
        let mut entries = Vec::new();
        let mut add = |i: Option<usize>, j: Option<usize>, block: &Matrix3<Real>| {
            if let (Some(i), Some(j)) = (i, j) {
                for (a, b) in (0..9).map(|k| (k / 3, k % 3)) {
                    if i + a >= j + b {
                        entries.push(Entry::new(i + a, j + b, block[(a, b)]));
                    }
                }
            }
        };
        for (v, row) in rows.iter().enumerate() {
            if let Some(m) = self.mass(v) {
                add(*row, *row, &(Matrix3::identity() * (m / (h * h))));
            }
        }
        if let Some(ball) = &self.ball {
            for (v, p) in x.iter().enumerate() {
                if let Some((force, out, far)) = ball.push(v, p) {
                    let along = out * out.transpose();
                    let across = if definite { 0.0 } else { force / far };
                    add(
                        rows[v],
                        rows[v],
                        &(along * ball.stiffness - (Matrix3::identity() - along) * across),
                    );
                }
            }
        }
        for ([i, j], rest) in &self.edges {
            let e = x[*i as usize] - x[*j as usize];
            let along = e.normalize();
            let across = 1.0 - rest / e.norm();
            let across = if definite { across.max(0.0) } else { across };
            let block = ((1.0 - across) * along * along.transpose() + Matrix3::identity() * across)
                / self.beta;
            let (i, j) = (rows[*i as usize], rows[*j as usize]);
            add(i, i, &block);
            add(j, j, &block);
            add(i, j, &-block);
            add(j, i, &-block);
        }
        Cholesky::new(count, &entries).ok()
    }
}
