//! Edge-length constraints with compliance: lines 4, 5 and 16 to 22 of Algorithm 1.

use crate::constraint::{Constraint, Counters, Residual, check_compliance};
use crate::edge_set::EdgeSet;
use crate::params::LambdaForm;
use if_core::math::{Point, Real};
use if_core::parameter::ParameterError;
use std::ops::Range;

/// Edges handled together, so that square roots and divisions run in SIMD registers: what AVX2
/// holds. Possible because edges of one colour share no vertex. Eight cost the same.
const LANES: usize = 4;

/// Edge-length constraints with compliance: the stretch group of the solver.
///
/// For an edge (i, j) of rest length ℓ, in metres, `C(p) = |pᵢ − pⱼ| − ℓ`. A sweep visits the edges
/// colour by colour and, with `β̃ = β / h²` in 1/kg and inverse masses `w`, applies
///
/// ```text
/// Δλ  = −(C + β̃ λ) / (wᵢ + wⱼ + β̃)        λ += Δλ
/// Δpᵢ = wᵢ ∇ᵢC Δλ,   ∇ᵢC = (pᵢ − pⱼ) / |pᵢ − pⱼ|
/// ```
///
/// An edge whose ends coincide has no gradient and is skipped until a later sweep. An infinite
/// compliance makes the whole group idle.
///
/// Inside a garment a sweep runs on one thread: at 10⁴ vertices it takes about 0.1 ms, less than
/// forking and joining once for each of a dozen colours would save. Garments are what to
/// parallelise over.
///
/// # Source
///
/// Supplement, Algorithm 1, lines 4, 5 and 16 to 22. Line 18 prints `β λ` where XPBD
/// [Macklin et al. 2016] has `β̃ λ`; we follow XPBD unless
/// [`form`](Stretch::form) is another. All agree on the first sweep, where λ = 0.
#[derive(Clone, Debug)]
pub struct Stretch {
    edges: EdgeSet,
    lambda: Vec<Real>,
    /// Whether all λ are zero, whatever the array holds: saves filling it.
    fresh: bool,
    degenerate: u64,
    compliance: Real,
    /// What line 18 adds to C.
    pub form: LambdaForm,
}

impl Stretch {
    /// Constraints on `edges` with `compliance` β in m/N (s²/kg), the inverse of a spring's
    /// stiffness: 0 is rigid, and infinity makes the group idle.
    ///
    /// # Errors
    ///
    /// If the compliance is negative or NaN.
    pub fn new(edges: EdgeSet, compliance: Real) -> Result<Self, ParameterError> {
        check_compliance(compliance)?;
        Ok(Self::with_form(edges, compliance, LambdaForm::Xpbd))
    }

    fn with_form(edges: EdgeSet, compliance: Real, form: LambdaForm) -> Self {
        let n = edges.len();
        Self { edges, lambda: vec![0.0; n], fresh: true, degenerate: 0, compliance, form }
    }

    /// The same constraints on the edges with an end that can move ([`EdgeSet::movable`]), with
    /// multipliers of zero.
    ///
    /// # Panics
    ///
    /// If there are fewer inverse masses than particles named.
    pub fn movable(&self, inverse_masses: &[Real]) -> Self {
        Self::with_form(self.edges.movable(inverse_masses), self.compliance, self.form)
    }

    /// β in m/N.
    pub fn compliance(&self) -> Real {
        self.compliance
    }

    /// The edges, in the order of visiting.
    pub fn edges(&self) -> &EdgeSet {
        &self.edges
    }

    /// `max |C + β̃ λ|` at `positions`, in metres, without moving anything.
    ///
    /// # Panics
    ///
    /// If there are fewer positions than the edges' vertex count.
    pub fn residual(&self, positions: &[Point], h: Real) -> Residual {
        let scale = self.lambda_scale(h);
        let mut r = Residual::default();
        if !(self.compliance / (h * h)).is_finite() {
            return r; // absent
        }
        for (k, ([a, b], rest)) in self.edges.visited().enumerate() {
            let lambda = if self.fresh { 0.0 } else { self.lambda[k] };
            r.add((positions[a as usize] - positions[b as usize]).norm() - rest + scale * lambda);
        }
        r
    }

    fn lambda_scale(&self, h: Real) -> Real {
        match self.form {
            LambdaForm::Xpbd => self.compliance / (h * h),
            LambdaForm::Printed => self.compliance,
            LambdaForm::Pbd => 0.0,
        }
    }
}

/// The same number of edges' data, in the order of visiting.
struct Lanes<'a> {
    a: &'a [u32],
    b: &'a [u32],
    rest: &'a [Real],
    lambda: &'a mut [Real],
}

#[inline(always)]
fn lanes<'a>(e: &'a EdgeSet, lambda: &'a mut [Real], r: Range<usize>) -> Lanes<'a> {
    Lanes {
        a: &e.a[r.clone()],
        b: &e.b[r.clone()],
        rest: &e.rest[r.clone()],
        lambda: &mut lambda[r],
    }
}

/// What a sweep found: largest violations, sums of squares, edges without length.
struct Found<const N: usize> {
    worst: [Real; N],
    squares: [Real; N],
    flat: u32,
}

/// Visits edges of one colour, N at a time: gathers, computes in lanes, scatters. Returns how many
/// it visited.
#[inline(always)]
fn visit<const N: usize>(
    lanes: Lanes<'_>,
    positions: &mut [Point],
    inverse_masses: &[Real],
    softness: Real,
    scale: Real,
    fresh: bool,
    found: &mut Found<N>,
) -> usize {
    let (a, b) = (lanes.a.as_chunks::<N>().0, lanes.b.as_chunks::<N>().0);
    let (rest, lambda) = (lanes.rest.as_chunks::<N>().0, lanes.lambda.as_chunks_mut::<N>().0);
    for (((a, b), rest), lambda) in a.iter().zip(b).zip(rest).zip(lambda) {
        let (mut dx, mut dy, mut dz) = ([0.0; N], [0.0; N], [0.0; N]);
        let (mut wi, mut wj) = ([0.0; N], [0.0; N]);
        for l in 0..N {
            let (i, j) = (a[l] as usize, b[l] as usize);
            let (p, q) = (&positions[i], &positions[j]);
            (dx[l], dy[l], dz[l]) = (p.x - q.x, p.y - q.y, p.z - q.z);
            (wi[l], wj[l]) = (inverse_masses[i], inverse_masses[j]);
        }
        if fresh {
            *lambda = [0.0; N];
        }
        // From here on lane by lane, each step by itself: this is what becomes SIMD.
        let length: [Real; N] =
            std::array::from_fn(|l| (dx[l] * dx[l] + dy[l] * dy[l] + dz[l] * dz[l]).sqrt());
        let violation: [Real; N] = std::array::from_fn(|l| length[l] - rest[l] + scale * lambda[l]);
        // One division: Δλ / length, which is 0 where nothing has a gradient or can move.
        let divisor: [Real; N] = std::array::from_fn(|l| length[l] * (wi[l] + wj[l] + softness));
        let factor: [Real; N] =
            std::array::from_fn(
                |l| if divisor[l] > 0.0 { -violation[l] / divisor[l] } else { 0.0 },
            );
        for l in 0..N {
            lambda[l] += factor[l] * length[l];
            let size = violation[l].abs();
            found.worst[l] = if size > found.worst[l] { size } else { found.worst[l] };
            found.squares[l] += violation[l] * violation[l];
        }
        if length.iter().any(|x| *x <= 0.0) {
            found.flat += length.iter().filter(|x| **x <= 0.0).count() as u32;
        }
        for l in 0..N {
            (wi[l], wj[l]) = (wi[l] * factor[l], wj[l] * factor[l]);
        }
        for l in 0..N {
            let p = &mut positions[a[l] as usize];
            (p.x, p.y, p.z) = (p.x + wi[l] * dx[l], p.y + wi[l] * dy[l], p.z + wi[l] * dz[l]);
            let q = &mut positions[b[l] as usize];
            (q.x, q.y, q.z) = (q.x - wj[l] * dx[l], q.y - wj[l] * dy[l], q.z - wj[l] * dz[l]);
        }
    }
    a.len() * N
}

/// One sweep over all colours. A struct rather than a closure, since this is what `pulp` compiles
/// once for each instruction set and picks at run time. No fused multiplications are formed, so the
/// bits do not depend on the machine.
struct Sweep<'a> {
    edges: &'a EdgeSet,
    lambda: &'a mut [Real],
    positions: &'a mut [Point],
    inverse_masses: &'a [Real],
    softness: Real,
    scale: Real,
    fresh: bool,
}

impl pulp::WithSimd for Sweep<'_> {
    type Output = Residual;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> Residual {
        let Self { edges: e, lambda, positions, inverse_masses, softness, scale, fresh } = self;
        let mut found = Found::<LANES> { worst: [0.0; LANES], squares: [0.0; LANES], flat: 0 };
        let mut left = Found::<1> { worst: [0.0], squares: [0.0], flat: 0 };
        for range in &e.colors {
            let all = lanes(e, lambda, range.clone());
            let done = visit(all, positions, inverse_masses, softness, scale, fresh, &mut found);
            let tail = lanes(e, lambda, range.start + done..range.end);
            visit(tail, positions, inverse_masses, softness, scale, fresh, &mut left);
        }
        Residual {
            max: found.worst.into_iter().fold(left.worst[0], |m, x| if x > m { x } else { m }),
            sum_squares: found.squares.into_iter().sum::<Real>() + left.squares[0],
            count: e.len(),
            active: e.len() - (found.flat + left.flat) as usize,
        }
    }
}

impl Constraint for Stretch {
    fn begin_substep(
        &mut self,
        _previous: &[Point],
        _positions: &[Point],
        _inverse_masses: &[Real],
        _h: Real,
    ) {
        self.fresh = true;
    }

    /// # Panics
    ///
    /// If the slices are shorter than the edges' vertex count.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], h: Real) -> Residual {
        if self.is_idle() || !(self.compliance / (h * h)).is_finite() {
            return Residual::default();
        }
        let (scale, fresh) = (self.lambda_scale(h), self.fresh);
        let residual = pulp::Arch::new().dispatch(Sweep {
            edges: &self.edges,
            lambda: &mut self.lambda,
            positions,
            inverse_masses,
            softness: self.compliance / (h * h),
            scale,
            fresh,
        });
        self.fresh = false;
        self.degenerate += (residual.count - residual.active) as u64;
        residual
    }

    fn is_idle(&self) -> bool {
        self.edges.is_empty() || self.compliance == Real::INFINITY
    }

    fn counters(&self) -> Counters {
        Counters { degenerate: self.degenerate, ..Counters::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::shapes::meshes::cloth;

    const H: Real = 1e-3;

    fn pair(rest: Real, compliance: Real) -> Stretch {
        Stretch::new(EdgeSet::new(&[[0, 1]], &[rest], 2).unwrap(), compliance).unwrap()
    }

    /// What is left of a spring that starts 0.01 m too long, after n sweeps of one substep.
    fn left(form: LambdaForm, sweeps: u32) -> Real {
        let mut p = vec![Point::origin(), Point::new(1.01, 0.0, 0.0)];
        let mut group = pair(1.0, 1e-5);
        group.form = form;
        group.begin_substep(&[], &[], &[1.0; 2], H);
        for _ in 0..sweeps {
            group.project(&mut p, &[1.0; 2], H);
        }
        (p[1] - p[0]).norm() - 1.0
    }

    #[test]
    fn more_sweeps_harden_the_printed_spring_and_not_the_xpbd_one() {
        for sweeps in [1_u32, 2, 5, 10] {
            // As printed λ, times β instead of β̃, is next to nothing: each sweep takes the same
            // share of what is left.
            let printed = 0.01 * (10.0_f64 / 12.0).powi(sweeps as i32);
            assert!((left(LambdaForm::Printed, sweeps) - printed).abs() < 5e-6);
            assert!((left(LambdaForm::Pbd, sweeps) - printed).abs() < 1e-15);
            // β̃ = 10, two unit masses: 0.01 · 10/12.
            assert!((left(LambdaForm::Xpbd, sweeps) - 0.01 / 1.2).abs() < 1e-15);
        }
    }

    #[test]
    fn momentum_stays_and_the_residual_falls() {
        let mesh = cloth(0.3, 0.2, 6, 4);
        let w: Vec<Real> = (0..35).map(|k| 0.5 + f64::from(k % 5)).collect();
        let noise = |k: usize, s: Real| 0.005 * (k as Real * s).sin();
        let start: Vec<Point> = mesh
            .vertices()
            .iter()
            .enumerate()
            .map(|(k, p)| p + Vector::new(noise(k, 1.3), noise(k, 7.7), noise(k, 3.1)))
            .collect();
        let mut p = start.clone();
        let mut group = Stretch::new(EdgeSet::of_mesh(&mesh), 1e-7).unwrap();
        group.begin_substep(&[], &[], &w, H);
        let mut last = Real::INFINITY;
        for _ in 0..100 {
            let r = group.project(&mut p, &w, H);
            assert!(r.rms() < last);
            last = r.rms();
            let linear: Vector = (0..p.len()).map(|k| (p[k] - start[k]) / w[k]).sum();
            // Some thousand pushes, each rounded in the 17th decimal.
            assert!(linear.norm() < 1e-14, "{linear}");
        }
        assert!(group.residual(&p, H).max < 1e-5);
        assert!(group.lambda.iter().any(|l| *l != 0.0));
    }

    #[test]
    fn an_infinite_compliance_has_no_residual() {
        let x = [Point::origin(), Point::new(3.0, 0.0, 0.0)];
        assert_eq!(pair(1.0, Real::INFINITY).residual(&x, H), Residual::default());
        assert_eq!(pair(1.0, 1e-5).residual(&x, H).max, 2.0);
    }

    #[test]
    fn one_visit_turns_nothing() {
        let before = [Point::new(0.1, 0.2, 0.3), Point::new(1.4, -0.3, 0.9)];
        let (mut p, w) = (before.to_vec(), [2.0, 0.3]);
        let mut group = pair(1.0, 1e-6);
        group.begin_substep(&[], &[], &w, H);
        group.project(&mut p, &w, H);
        let turn: Vector =
            (0..2).map(|k| before[k].coords.cross(&((p[k] - before[k]) / w[k]))).sum();
        assert!(p[0] != before[0] && turn.norm() < 1e-15);
    }

    #[test]
    fn a_moved_and_turned_cloth_moves_and_turns_along() {
        let mesh = cloth(0.3, 0.2, 6, 4);
        let turn = nalgebra::Rotation3::from_euler_angles(0.4, 1.0, -2.0);
        let away = Vector::new(1e3, -1e3, 1e3);
        let start: Vec<Point> = mesh
            .vertices()
            .iter()
            .map(|p: &Point| Point::new(1.1 * p.x, 0.9 * p.y, 0.02 * (40.0 * p.x).sin()))
            .collect();
        let run = |mut p: Vec<Point>| {
            let mut group = Stretch::new(EdgeSet::of_mesh(&mesh), 1e-6).unwrap();
            group.begin_substep(&[], &[], &[1.0; 35], H);
            for _ in 0..10 {
                group.project(&mut p, &[1.0; 35], H);
            }
            p
        };
        let here = run(start.clone());
        let there = run(start.iter().map(|p| turn * p + away).collect());
        for (p, q) in here.iter().zip(&there) {
            // Coordinates of 1e3 carry 1e-13, a few of which add up.
            assert!((turn * p + away - q).norm() < 1e-11);
        }
    }

    #[test]
    fn lanes_and_single_edges_give_the_same() {
        // A row of disjoint edges: one colour, all in lanes but the last three.
        let n = 4 * LANES as u32 + 3;
        let edges: Vec<[u32; 2]> = (0..n).map(|k| [2 * k, 2 * k + 1]).collect();
        let start: Vec<Point> = (0..2 * n)
            .map(|k| Point::new(f64::from(k), f64::from(k * k % 7), 0.1 * f64::from(k % 3)))
            .collect();
        let mut group =
            Stretch::new(EdgeSet::new(&edges, &vec![1.0; n as usize], start.len()).unwrap(), 1e-6)
                .unwrap();
        let w: Vec<Real> = (0..2 * n).map(|k| f64::from(k % 4)).collect();
        let mut p = start.clone();
        for _ in 0..3 {
            group.project(&mut p, &w, H);
        }
        for k in 0..n as usize {
            let mut q = start[2 * k..2 * k + 2].to_vec();
            let mut single = pair(1.0, 1e-6);
            for _ in 0..3 {
                single.project(&mut q, &w[2 * k..2 * k + 2], H);
            }
            assert_eq!(q, p[2 * k..2 * k + 2]);
        }
    }

    #[test]
    fn degenerate_edges_are_left_alone_and_counted() {
        for compliance in [0.0, 1e-12, 1e3, Real::MAX, Real::INFINITY] {
            for (w, moves) in [([0.0, 0.0], false), ([0.0, 1.0], true), ([1e-6, 1e6], true)] {
                let mut p = vec![Point::new(1.0, 1.0, 1.0); 2];
                let mut group = pair(0.5, compliance);
                group.begin_substep(&p.clone(), &p.clone(), &w, H);
                group.project(&mut p, &w, H);
                assert_eq!(p, vec![Point::new(1.0, 1.0, 1.0); 2]);
                assert_eq!(
                    group.counters().degenerate,
                    u64::from(!group.is_idle() && compliance < Real::MAX)
                );
                let mut q = vec![Point::origin(), Point::new(2.0, 0.0, 0.0)];
                group.project(&mut q, &w, H);
                assert!(q.iter().all(|x| x.iter().all(|c| c.is_finite())));
                assert!(moves || q == vec![Point::origin(), Point::new(2.0, 0.0, 0.0)]);
                assert!(w[0] > 0.0 || q[0] == Point::origin());
            }
        }
    }
}
