//! All stretch constraints solved at once: "manifold projection" as Algorithm 1's text calls it.

use if_core::math::{Point, Real, Vector};
use if_core::parameter::ParameterError;
use if_core::rows::Rows;
use if_sparse::{Cholesky, Mat, Pattern, Place};
use if_xpbd::constraint::{Constraint, Counters, Residual, check_compliance};
use if_xpbd::edge_set::EdgeSet;

/// Least addition to the diagonal, relative to each entry (so heavy edges among light ones converge
/// as they do alone), so that rigid constraints of which some follow from others (every flat cloth
/// has them) can be factored. At ten times less rounding makes such matrices indefinite; ten times
/// more costs a rigid cloth a Newton step or two. A step that does not help, or a matrix that
/// cannot be factored, is tried with a hundred times more (Levenberg and Marquardt), up to one.
const RIDGE: Real = 1e-9;
/// How many times the rounding of an edge's ends and of `β̃ λ` its residual may be and count as
/// none. At ten times less steps are made after noise, which the ridge of a rigid cloth turns into
/// motion; ten times more is seen at 1 km in 1e-11 m.
const NOISE: Real = 4.0;
/// Shortest Newton step tried, as a power of ½.
const HALVINGS: u32 = 12;

/// Edge-length constraints solved together by Newton's method with a line search.
///
/// With J the constraints' gradients, one row for each edge, `W = M⁻¹` and `β̃ = β / h²`:
///
/// ```text
/// (J W Jᵀ + β̃) Δλ = −(C + β̃ λ)         lines 17 and 18
/// λ += α Δλ,   p += α W Jᵀ Δλ          lines 19 to 21
/// ```
///
/// α is the first of 1, ½, ¼, … that makes |C + β̃ λ| smaller: without it a cloth stretched by 5 %
/// diverges. The pattern is analysed once; a step costs one sparse Cholesky factorisation. One
/// visit makes up to [`iterations`](DirectStretch::iterations) steps.
///
/// The matrix has one entry for each pair of edges that share a vertex. Time and memory are
/// therefore quadratic in the valence: a vertex of 10,000 edges brings 50 million entries.
///
/// As printed, and as in XPBD, the change of J within a substep is not fed back into the inertia.
///
/// # Source
///
/// Supplement, Algorithm 1, lines 16 to 22; [Goldenthal et al. 2007] for the name.
pub struct DirectStretch {
    ends: Vec<[u32; 2]>,
    rests: Vec<Real>,
    lambda: Vec<Real>,
    /// For each entry of the matrix: two edges and the vertex they share.
    entries: Vec<[u32; 3]>,
    pattern: Option<Pattern>,
    failures: u64,
    compliance: Real,
    /// Most Newton steps in a visit.
    pub iterations: u32,
    /// A visit ends once `max |C + β̃ λ|` is below this, in metres, or below what the rounding of
    /// positions leaves.
    pub tolerance: Real,
}

/// A sum that remembers what its additions round away: multipliers of edges that follow from others
/// are up to 1/[`RIDGE`] times larger than what is left of them at a vertex, where they cancel, and
/// so would their rounding be.
#[derive(Clone, Copy)]
struct Sum {
    total: Vector,
    lost: Vector,
}

impl Default for Sum {
    fn default() -> Self {
        Self { total: Vector::zeros(), lost: Vector::zeros() }
    }
}

impl Sum {
    /// Knuth's sum of two, which finds exactly what the rounded one lacks.
    fn add(&mut self, x: Vector) {
        let total = self.total + x;
        let taken = total - self.total;
        self.lost += (self.total - (total - taken)) + (x - taken);
        self.total = total;
    }

    fn total(&self) -> Vector {
        self.total + self.lost
    }
}

impl std::fmt::Debug for DirectStretch {
    /// Numbers only: a factor is megabytes.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DirectStretch")
            .field("edges", &self.ends.len())
            .field("compliance", &self.compliance)
            .field("iterations", &self.iterations)
            .field("tolerance", &self.tolerance)
            .finish_non_exhaustive()
    }
}

impl DirectStretch {
    /// Constraints on `edges` with `compliance` β in m/N (0 is rigid, infinity makes the group
    /// idle): 20 steps at most, to 1e-12 m.
    ///
    /// # Errors
    ///
    /// If the compliance is negative or NaN.
    pub fn new(edges: &EdgeSet, compliance: Real) -> Result<Self, ParameterError> {
        check_compliance(compliance)?;
        let n = edges.len();
        let (ends, rests): (Vec<[u32; 2]>, Vec<Real>) = edges.visited().unzip();
        let of_vertex = ends.iter().zip(0..).flat_map(|(&[a, b], k)| [(a, k), (b, k)]);
        let around = Rows::new(edges.vertex_count(), of_vertex);
        let mut entries = Vec::new();
        for v in 0..around.len() {
            let list = around.of(v);
            for (i, &k) in list.iter().enumerate() {
                entries.extend(list[..=i].iter().map(|&l| [k, l, v as u32]));
            }
        }
        let places: Vec<_> = entries
            .iter()
            .map(|e| Place::new(e[0].max(e[1]) as usize, e[0].min(e[1]) as usize))
            .collect();
        let pattern = Pattern::new(n, &places).ok();
        Ok(Self {
            ends,
            rests,
            lambda: vec![0.0; n],
            entries,
            pattern,
            failures: 0,
            compliance,
            iterations: 20,
            tolerance: 1e-12,
        })
    }

    /// Unit gradients (zero where the ends coincide) and `C + β̃ λ`; and what of its size is
    /// rounding.
    fn evaluate(
        &self,
        positions: &[Point],
        softness: Real,
        gradients: &mut Vec<Vector>,
        values: &mut Vec<Real>,
    ) -> (Residual, Real) {
        gradients.clear();
        values.clear();
        let mut residual = Residual::default();
        let mut largest: Real = 0.0;
        for k in 0..self.ends.len() {
            let d = positions[self.ends[k][0] as usize] - positions[self.ends[k][1] as usize];
            let length = d.norm();
            let stress = softness * self.lambda[k];
            let c = length - self.rests[k] + stress;
            largest = largest
                .max(positions[self.ends[k][0] as usize].coords.amax() + length + stress.abs());
            gradients.push(if length > 0.0 { d / length } else { Vector::zeros() });
            values.push(c);
            residual.add(c);
        }
        (residual, NOISE * Real::EPSILON * largest)
    }

    /// Of both ends together.
    fn inverse_mass(&self, k: u32, inverse_masses: &[Real]) -> Real {
        inverse_masses[self.ends[k as usize][0] as usize]
            + inverse_masses[self.ends[k as usize][1] as usize]
    }

    fn factor(
        &self,
        gradients: &[Vector],
        inverse_masses: &[Real],
        softness: Real,
        ridge: Real,
    ) -> Option<Cholesky> {
        let pattern = self.pattern.as_ref()?;
        let sign = |k: u32, v: u32| if self.ends[k as usize][0] == v { 1.0 } else { -1.0 };
        let mut values: Vec<Real> = Vec::with_capacity(self.entries.len());
        for &[k, l, v] in &self.entries {
            let w = inverse_masses[v as usize] * sign(k, v) * sign(l, v);
            let mut value = w * gradients[k as usize].dot(&gradients[l as usize]);
            if k == l {
                let own = self.inverse_mass(k, inverse_masses) + softness;
                // An edge meets itself at both of its ends: half of its share at each. Pinned ones
                // have any multiplier.
                value += 0.5 * (softness + ridge * if own > 0.0 { own } else { 1.0 });
            }
            values.push(value);
        }
        pattern.factor(&values).ok()
    }
}

impl Constraint for DirectStretch {
    fn begin_substep(
        &mut self,
        _previous: &[Point],
        _positions: &[Point],
        _inverse_masses: &[Real],
        _h: Real,
    ) {
        self.lambda.fill(0.0);
    }

    /// The residual is that before the last Newton step, or after it where that met the tolerance.
    /// A matrix that cannot be factored leaves everything as it is, and is counted as degenerate.
    ///
    /// # Panics
    ///
    /// If the slices are shorter than the edges' vertex count.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], h: Real) -> Residual {
        let softness = self.compliance / (h * h);
        if self.is_idle() || !softness.is_finite() {
            return Residual::default();
        }
        let (mut gradients, mut values) = (Vec::new(), Vec::new());
        let (mut residual, mut noise) =
            self.evaluate(positions, softness, &mut gradients, &mut values);
        let mut ridge = RIDGE;
        for _ in 0..self.iterations {
            if residual.max <= self.tolerance.max(noise) {
                break;
            }
            let Some(cholesky) = self.factor(&gradients, inverse_masses, softness, ridge) else {
                if ridge < 1.0 {
                    ridge *= 100.0;
                    continue;
                }
                self.failures += 1;
                break;
            };
            let mut delta = Mat::from_fn(values.len(), 1, |k, _| -values[k]);
            cholesky.solve_in_place(&mut delta);
            let mut impulses = vec![Sum::default(); positions.len()];
            for k in 0..self.ends.len() {
                let impulse = gradients[k] * delta[(k, 0)];
                impulses[self.ends[k][0] as usize].add(impulse);
                impulses[self.ends[k][1] as usize].add(-impulse);
            }
            let push: Vec<Vector> =
                impulses.iter().zip(inverse_masses).map(|(s, w)| s.total() * *w).collect();
            let (start, start_lambda) = (positions.to_vec(), self.lambda.clone());
            let mut alpha = 1.0;
            let mut better = false;
            for _ in 0..HALVINGS {
                for v in 0..positions.len() {
                    positions[v] = start[v] + push[v] * alpha;
                }
                for k in 0..self.lambda.len() {
                    self.lambda[k] = start_lambda[k] + alpha * delta[(k, 0)];
                }
                let (tried, rounding) =
                    self.evaluate(positions, softness, &mut gradients, &mut values);
                if tried.sum_squares < residual.sum_squares {
                    (residual, noise) = (tried, rounding);
                    better = true;
                    break;
                }
                alpha *= 0.5;
            }
            if !better {
                positions.copy_from_slice(&start);
                self.lambda = start_lambda;
                if ridge >= 1.0 {
                    break;
                }
                (residual, noise) = self.evaluate(positions, softness, &mut gradients, &mut values);
                ridge *= 100.0;
            } else {
                ridge = (ridge * 0.1).max(RIDGE);
            }
        }
        residual
    }

    fn is_idle(&self) -> bool {
        self.ends.is_empty() || self.compliance == Real::INFINITY
    }

    fn counters(&self) -> Counters {
        Counters { degenerate: self.failures, ..Counters::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes::cloth;
    use if_xpbd::params::{Motion, SolverParams};
    use if_xpbd::particles::Particles;
    use if_xpbd::solver::Solver;
    use if_xpbd::stretch::Stretch;

    /// 5 % stretched, each vertex up to 1 mm off.
    fn stretched(n: u32) -> (EdgeSet, Vec<Point>) {
        let mesh = cloth(0.01 * f64::from(n), 0.01 * f64::from(n), n, n);
        let noise = |k: usize, s: Real| 1e-3 * (k as Real * s).sin();
        let p = mesh.vertices().iter().enumerate();
        let p = p.map(|(k, x)| {
            Point::from(x.coords * 1.05)
                + Vector::new(noise(k, 12.9), noise(k, 78.2), noise(k, 37.7))
        });
        (EdgeSet::of_mesh(&mesh), p.collect())
    }

    #[test]
    fn a_stretched_noisy_cloth_converges_for_soft_and_for_hard_springs() {
        for (compliance, h, enough) in
            [(1e-5, 1e-3, 1e-12), (1e-5, 1e-1, 1e-12), (1e-9, 1e-2, 1e-12), (0.0, 1e-3, 1e-6)]
        {
            let (edges, mut p) = stretched(12);
            let w = vec![1.0; p.len()];
            let mut group = DirectStretch::new(&edges, compliance).unwrap();
            group.iterations = 60;
            group.begin_substep(&[], &[], &w, h);
            let r = group.project(&mut p, &w, h);
            assert!(r.max <= enough, "β = {compliance}, h = {h}: {} m are left", r.max);
        }
    }

    #[test]
    fn sweeps_and_the_direct_solve_meet() {
        let (edges, start) = stretched(8);
        let w: Vec<Real> = (0..start.len())
            .map(|k| if k == 0 { 0.0 } else { 1.0 + 0.5 * (k as Real).sin() })
            .collect();
        let h = 1e-3;
        let mut direct = DirectStretch::new(&edges, 1e-5).unwrap();
        let mut p = start.clone();
        direct.begin_substep(&[], &[], &w, h);
        direct.project(&mut p, &w, h);
        let mut sweeps = Stretch::new(edges, 1e-5).unwrap();
        let mut q = start.clone();
        sweeps.begin_substep(&[], &[], &w, h);
        for _ in 0..60 {
            sweeps.project(&mut q, &w, h);
        }
        assert!(sweeps.residual(&q, h).max < 1e-13);
        let moved = p.iter().zip(&start).map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        let apart = p.iter().zip(&q).map(|(a, b)| (a - b).norm()).fold(0.0, Real::max);
        // Both end at C + β̃ λ = 0, along gradients that turn a little on the way.
        assert!(apart < 0.02 * moved, "{apart} m apart after {moved} m");
    }

    #[test]
    fn degenerate_input_moves_nothing_that_it_should_not() {
        let edges = EdgeSet::new(&[[0, 1], [1, 2]], &[1.0, 1.0], 3).unwrap();
        for w in [[0.0; 3], [1.0; 3], [1e-6, 1e6, 0.0]] {
            for compliance in [0.0, 1e-12, 1e3, Real::INFINITY] {
                let mut p = vec![Point::origin(), Point::origin(), Point::new(0.0, 3.0, 0.0)];
                let mut group = DirectStretch::new(&edges, compliance).unwrap();
                group.begin_substep(&[], &[], &w, 1e-3);
                group.project(&mut p, &w, 1e-3);
                assert!(p.iter().all(|x| x.iter().all(|c| c.is_finite())));
                assert!(w[0] != 0.0 || p[0] == Point::origin());
            }
        }
        DirectStretch::new(&EdgeSet::default(), 0.0).unwrap().project(&mut [], &[], 1.0);
    }

    #[test]
    fn problem_3_each_link_of_a_compliant_chain_carries_what_hangs_below() {
        const G: Real = 9.81;
        let beta = 1e-5;
        for n in [11, 31, 101] {
            let link = 1.0 / (n - 1) as Real;
            let p = (0..n).map(|k| Point::new(0.0, -link * k as Real, 0.0)).collect();
            let ends: Vec<[u32; 2]> = (1..n as u32).map(|k| [k - 1, k]).collect();
            let edges = EdgeSet::new(&ends, &vec![link; n - 1], n).unwrap();
            let mut group = DirectStretch::new(&edges, beta).unwrap();
            let mut particles = Particles::uniform(p, 1.0).unwrap().pinned([0]);
            let mut solver = Solver::new(SolverParams {
                time_step: 1.0,
                substeps: 1,
                motion: Motion::Dynamic { damping: 0.0 },
                gravity: [0.0, -G, 0.0],
                energy_jump: Real::INFINITY,
                ..SolverParams::default()
            })
            .unwrap();
            for _ in 0..60 {
                solver.step(&mut particles, &mut [&mut group]).unwrap();
            }
            for (k, w) in particles.positions.windows(2).enumerate() {
                let (longer, exact) = ((w[0] - w[1]).norm() - link, G * beta * (n - 1 - k) as Real);
                assert!((longer - exact).abs() < 1e-10, "n {n}, link {k}: {longer} for {exact}");
            }
        }
    }
}
