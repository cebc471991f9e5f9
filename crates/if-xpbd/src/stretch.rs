//! Edge-length constraints with compliance: lines 4, 5 and 16 to 22 of Algorithm 1.

use crate::constraint::{Constraint, Counters, Residual};
use crate::edge_set::EdgeSet;
use crate::params::LambdaForm;
use if_core::math::{Point, Real};
use std::ops::Range;

/// Edges handled together, so that square roots and divisions run in SIMD registers. Safe because
/// edges of one colour share no vertex. Two lanes cost 10 % more, eight gain nothing.
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
/// An edge whose ends coincide has no gradient, and is left for a later sweep. An infinite
/// compliance makes the whole group idle.
///
/// Inside a garment a sweep runs on one thread: at 10⁴ vertices it takes about 0.2 ms, less than
/// forking and joining once for each of a dozen colours would save. Garments are what to
/// parallelise over.
///
/// # Source
///
/// Supplement, Algorithm 1, lines 4, 5 and 16 to 22. Line 18 prints `β λ` where XPBD
/// [Macklin et al. 2016] has `β̃ λ`; we follow XPBD, unless [`LambdaForm::Printed`] is asked for.
/// The two agree on the first sweep, where λ = 0.
#[derive(Clone, Debug)]
pub struct Stretch {
    edges: EdgeSet,
    lambda: Vec<Real>,
    /// Whether λ stands for zero, whatever the array holds: saves filling it.
    fresh: bool,
    degenerate: u64,
    /// β in m/N (s²/kg): the inverse of a spring's stiffness. 0 is rigid, infinity is absent.
    pub compliance: Real,
    /// What line 18 adds to C.
    pub form: LambdaForm,
}

impl Stretch {
    /// Constraints on `edges` with `compliance` β in m/N.
    pub fn new(edges: EdgeSet, compliance: Real) -> Self {
        let n = edges.len();
        Self {
            edges,
            lambda: vec![0.0; n],
            fresh: true,
            degenerate: 0,
            compliance,
            form: LambdaForm::Xpbd,
        }
    }

    /// The edges, in the order of visiting.
    pub fn edges(&self) -> &EdgeSet {
        &self.edges
    }

    /// The multipliers λ in the order of visiting, in kg·m. `−λ/h²` is the tension in newtons.
    pub fn multipliers(&self) -> impl Iterator<Item = Real> + '_ {
        self.lambda.iter().map(|l| if self.fresh { 0.0 } else { *l })
    }

    /// `max |C + β̃ λ|` at `positions`, in metres, without moving anything.
    ///
    /// # Panics
    ///
    /// If there are fewer positions than the edges' vertex count.
    pub fn residual(&self, positions: &[Point], h: Real) -> Residual {
        let scale = self.lambda_scale(h);
        let mut r = Residual::default();
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

/// Visits edges of one colour, N at a time: gathers, computes in lanes, scatters. Returns how many it visited.
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
        let length: [Real; N] = std::array::from_fn(|l| (dx[l] * dx[l] + dy[l] * dy[l] + dz[l] * dz[l]).sqrt());
        let violation: [Real; N] = std::array::from_fn(|l| length[l] - rest[l] + scale * lambda[l]);
        // One division: Δλ / length, which is 0 where nothing has a gradient or can move.
        let divisor: [Real; N] = std::array::from_fn(|l| length[l] * (wi[l] + wj[l] + softness));
        let factor: [Real; N] = std::array::from_fn(|l| if divisor[l] > 0.0 { -violation[l] / divisor[l] } else { 0.0 });
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
    fn begin_substep(&mut self, _previous: &[Point], _positions: &[Point], _inverse_masses: &[Real], _h: Real) {
        self.fresh = true;
    }

    /// # Panics
    ///
    /// If the slices are shorter than the edges' vertex count.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], h: Real) -> Residual {
        if self.is_idle() {
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
