//! Stretch by a prefactored constant matrix: projective dynamics.

use if_core::edges::parts_by_edges;
use if_core::math::{Point, Real, Vector};
use if_core::parameter::ParameterError;
use if_sparse::{Cholesky, Entry, Mat};
use if_xpbd::constraint::{Constraint, Counters, Residual};
use if_xpbd::edge_set::EdgeSet;

/// Edge springs solved by local–global iterations on a constant matrix, factored once for each h.
///
/// With stiffness k = 1/β, S an edge's difference `pᵢ − pⱼ`, and p̃ the positions at the visit:
///
/// ```text
/// local:   d = ℓ S p / |S p|
/// global:  (M/h² + k Σ SᵀS) p = M/h² p̃ + k Σ Sᵀ d
/// ```
///
/// The global step is solved for the correction of p, and the correction of each part that hangs on
/// no pinned particle is then moved as a whole to where its centre of mass has to be: springs pull
/// at both of their ends alike. Far stiffer springs than masses over h² hold the centre a million
/// times less than the edges, and would otherwise cost a free cloth digits of its momentum. The
/// fixed point is that of implicit Euler, as of XPBD's sweeps. A visit starts from p̃ and does
/// everything: give the solver one sweep. Pinned particles go to the right-hand side.
///
/// # Source
///
/// [Bouaziz et al. 2014]; [Liu et al. 2013] for mass and springs.
pub struct GlobalStretch {
    edges: EdgeSet,
    compliance: Real,
    factor: Option<Factor>,
    failures: u64,
    /// Most local–global iterations in a visit.
    pub iterations: u32,
    /// A visit ends once no vertex moves farther than this in an iteration, in metres.
    pub tolerance: Real,
}

struct Factor {
    h: Real,
    inverse_masses: Vec<Real>,
    /// Row of each particle; `None` where pinned.
    rows: Vec<Option<usize>>,
    /// The particles of each part that hangs on no pinned one.
    free: Vec<Vec<u32>>,
    cholesky: Cholesky,
}

impl std::fmt::Debug for GlobalStretch {
    /// Numbers only: a factor is megabytes.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GlobalStretch")
            .field("edges", &self.edges.len())
            .field("compliance", &self.compliance)
            .field("iterations", &self.iterations)
            .field("tolerance", &self.tolerance)
            .finish_non_exhaustive()
    }
}

impl GlobalStretch {
    /// Springs on `edges` with `compliance` β in m/N: 200 iterations at most, to 1e-9 m.
    ///
    /// # Errors
    ///
    /// A compliance that is not positive. Infinity is allowed, and makes the group idle.
    pub fn new(edges: EdgeSet, compliance: Real) -> Result<Self, ParameterError> {
        let ok = compliance > 0.0 && (1.0 / compliance).is_finite();
        let range = "positive (m/N; for rigid edges use DirectStretch)";
        ParameterError::check("compliance", compliance, ok, range)?;
        Ok(Self { edges, compliance, factor: None, failures: 0, iterations: 200, tolerance: 1e-9 })
    }

    fn make_factor(&self, inverse_masses: &[Real], h: Real) -> Option<Factor> {
        let mut count = 0;
        let rows: Vec<Option<usize>> = inverse_masses
            .iter()
            .map(|w| {
                (*w > 0.0).then(|| {
                    count += 1;
                    count - 1
                })
            })
            .collect();
        let mut entries = Vec::new();
        for (v, w) in inverse_masses.iter().enumerate() {
            if let Some(row) = rows[v] {
                entries.push(Entry::new(row, row, 1.0 / (w * h * h)));
            }
        }
        let k = 1.0 / self.compliance;
        for ([a, b], _) in self.edges.visited() {
            let (i, j) = (rows[a as usize], rows[b as usize]);
            for row in [i, j].into_iter().flatten() {
                entries.push(Entry::new(row, row, k));
            }
            if let (Some(i), Some(j)) = (i, j) {
                entries.push(Entry::new(i.max(j), i.min(j), -k));
            }
        }
        let cholesky = Cholesky::new(count, &entries).ok()?;
        let free = free_parts(&self.edges, inverse_masses);
        Some(Factor { h, inverse_masses: inverse_masses.to_vec(), rows, free, cholesky })
    }
}

/// The particles of each part of two or more, joined by edges, of which none is pinned; in
/// ascending order.
fn free_parts(edges: &EdgeSet, inverse_masses: &[Real]) -> Vec<Vec<u32>> {
    let part_of = parts_by_edges(edges.visited().map(|(ends, _)| ends), inverse_masses.len());
    let mut parts = vec![Vec::new(); inverse_masses.len()];
    let mut held = vec![false; inverse_masses.len()];
    for (v, (w, part)) in inverse_masses.iter().zip(part_of).enumerate() {
        parts[part as usize].push(v as u32);
        held[part as usize] |= *w <= 0.0;
    }
    parts
        .into_iter()
        .zip(held)
        .filter(|(part, held)| part.len() > 1 && !held)
        .map(|(part, _)| part)
        .collect()
}

impl Constraint for GlobalStretch {
    fn begin_substep(
        &mut self,
        _previous: &[Point],
        _positions: &[Point],
        inverse_masses: &[Real],
        h: Real,
    ) {
        if self.is_idle() {
            return;
        }
        if self.factor.as_ref().is_none_or(|f| f.h != h || f.inverse_masses != inverse_masses) {
            self.factor = self.make_factor(inverse_masses, h);
            self.failures += u64::from(self.factor.is_none());
        }
    }

    /// The residual is the elongation `| |S p| − ℓ |` at the start. Where the matrix cannot be
    /// factored, or [`Constraint::begin_substep`] was not called, everything stays.
    ///
    /// # Panics
    ///
    /// If the slices are shorter than the edges' vertex count.
    fn project(&mut self, positions: &mut [Point], _inverse_masses: &[Real], h: Real) -> Residual {
        let mut residual = Residual::default();
        if self.is_idle() {
            return residual;
        }
        for ([a, b], rest) in self.edges.visited() {
            residual.add((positions[a as usize] - positions[b as usize]).norm() - rest);
        }
        let Some(Factor { inverse_masses, rows, free, cholesky, .. }) = &self.factor else {
            return residual;
        };
        let start = positions.to_vec();
        let mut right = Mat::zeros(rows.iter().flatten().count(), 3);
        let mut pushes = vec![Vector::zeros(); start.len()];
        let k = 1.0 / self.compliance;
        for _ in 0..self.iterations {
            // What is missing at p, so that rounding goes with the size of the correction and not
            // with that of p.
            for (v, row) in rows.iter().enumerate() {
                if let Some(row) = *row {
                    let missing = (start[v] - positions[v]) / (inverse_masses[v] * h * h);
                    (0..3).for_each(|axis| right[(row, axis)] = missing[axis]);
                }
            }
            for ([a, b], rest) in self.edges.visited() {
                let d = positions[a as usize] - positions[b as usize];
                let length = d.norm();
                let target = if length > 0.0 { d * (rest / length) } else { Vector::zeros() };
                let pull = (target - d) * k;
                for (own, sign) in [(a, 1.0), (b, -1.0)] {
                    if let Some(row) = rows[own as usize] {
                        (0..3).for_each(|axis| right[(row, axis)] += sign * pull[axis]);
                    }
                }
            }
            cholesky.solve_in_place(&mut right);
            for (push, row) in pushes.iter_mut().zip(rows) {
                if let Some(row) = *row {
                    *push = Vector::new(right[(row, 0)], right[(row, 1)], right[(row, 2)]);
                }
            }
            for part in free {
                // The sum of a free part's rows: Σ m (p + push) = Σ m p̃.
                let (mut lacks, mut mass) = (Vector::zeros(), 0.0);
                for v in part.iter().map(|v| *v as usize) {
                    lacks += (start[v] - positions[v] - pushes[v]) / inverse_masses[v];
                    mass += 1.0 / inverse_masses[v];
                }
                let shift = lacks / mass;
                part.iter().for_each(|v| pushes[*v as usize] += shift);
            }
            let mut farthest: Real = 0.0;
            for (p, push) in positions.iter_mut().zip(&pushes) {
                farthest = farthest.max(push.norm_squared());
                *p += push;
            }
            if farthest <= self.tolerance * self.tolerance {
                break;
            }
        }
        residual
    }

    fn reset(&mut self) {
        self.factor = None;
    }

    fn is_idle(&self) -> bool {
        self.edges.is_empty() || self.compliance == Real::INFINITY
    }

    fn counters(&self) -> Counters {
        Counters { degenerate: self.failures, ..Counters::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes::cloth;
    use if_xpbd::stretch::Stretch;

    #[test]
    fn a_stretched_noisy_cloth_reaches_the_state_of_the_sweeps() {
        let mesh = cloth(0.08, 0.08, 8, 8);
        let noise = |k: usize, s: Real| 2e-4 * (k as Real * s).sin();
        let start: Vec<Point> = mesh
            .vertices()
            .iter()
            .enumerate()
            .map(|(k, x)| {
                Point::from(x.coords * 1.05)
                    + Vector::new(noise(k, 12.9), noise(k, 78.2), noise(k, 37.7))
            })
            .collect();
        let w: Vec<Real> = (0..start.len()).map(|k| if k == 0 { 0.0 } else { 1.0 }).collect();
        let (h, compliance) = (2e-3, 1e-5);
        let mut global = GlobalStretch::new(EdgeSet::of_mesh(&mesh), compliance).unwrap();
        global.iterations = 2000;
        global.tolerance = 1e-13;
        let mut p = start.clone();
        global.begin_substep(&[], &[], &w, h);
        global.project(&mut p, &w, h);
        assert_eq!(p[0], start[0]);
        // Implicit Euler: M/h² (p − p̃) + k Σ ∇C C = 0 at every free vertex.
        let mut force = vec![Vector::zeros(); p.len()];
        for ([a, b], rest) in global.edges.visited() {
            let d = p[a as usize] - p[b as usize];
            let f = d * ((d.norm() - rest) / (d.norm() * compliance));
            force[a as usize] -= f;
            force[b as usize] += f;
        }
        for v in 1..p.len() {
            let wrong = (p[v] - start[v]) / (h * h) - force[v];
            assert!(wrong.norm() < 1e-6 * force[v].norm().max(1.0), "vertex {v}: {wrong}");
        }
        let mut sweeps = Stretch::new(EdgeSet::of_mesh(&mesh), compliance).unwrap();
        let mut q = start.clone();
        sweeps.begin_substep(&[], &[], &w, h);
        for _ in 0..200 {
            sweeps.project(&mut q, &w, h);
        }
        let moved = p.iter().zip(&start).map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        let apart = p.iter().zip(&q).map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        assert!(apart < 0.02 * moved, "{apart} m apart after {moved} m");
    }

    #[test]
    fn a_free_cloth_of_the_stiffest_springs_keeps_its_momentum() {
        // Springs 1e6 times stiffer than masses over h²: solved for positions, a thousand substeps
        // lose 1e-5 of it, and without the shift 1e-10.
        let mesh = cloth(1.0, 1.0, 4, 4);
        let mut group = GlobalStretch::new(EdgeSet::of_mesh(&mesh), 1e-12).unwrap();
        group.iterations = 20;
        let (h, n) = (1e-3, mesh.vertices().len());
        let mut p = mesh.vertices().to_vec();
        let mut v: Vec<Vector> =
            (0..n).map(|k| Vector::new(1.0, (k as Real).sin(), (2.0 * k as Real).cos())).collect();
        let before: Vector = v.iter().sum();
        for _ in 0..1000 {
            let previous = p.clone();
            p.iter_mut().zip(&v).for_each(|(p, v)| *p += v * h);
            group.begin_substep(&[], &[], &vec![1.0; n], h);
            group.project(&mut p, &vec![1.0; n], h);
            v = p.iter().zip(&previous).map(|(p, q)| (p - q) / h).collect();
        }
        let after: Vector = v.iter().sum();
        assert!((after - before).norm() < 1e-11 * before.norm(), "{}", after - before);
    }

    #[test]
    fn a_compliance_without_a_finite_stiffness_is_refused() {
        for bad in [0.0, -1.0, Real::NAN, 1e-320] {
            assert!(GlobalStretch::new(EdgeSet::default(), bad).is_err());
        }
        assert!(GlobalStretch::new(EdgeSet::default(), Real::INFINITY).unwrap().is_idle());
    }
}
