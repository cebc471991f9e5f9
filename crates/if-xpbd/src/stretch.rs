//! Edge-length constraints with compliance: lines 4, 5 and 16 to 22 of Algorithm 1.

use crate::constraint::{Constraint, Counters, Residual};
use crate::edge_set::EdgeSet;
use crate::params::LambdaForm;
use if_core::math::{Point, Real};

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
    /// 1 / (wᵢ + wⱼ + β̃), or 0 where nothing can move.
    inverse_a: Vec<Real>,
    /// The h and the inverse masses that `inverse_a` was made for.
    prepared: (Real, Vec<Real>),
    /// β that `inverse_a` was made for.
    prepared_compliance: Real,
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
            inverse_a: vec![0.0; n],
            prepared: (Real::NAN, Vec::new()),
            prepared_compliance: Real::NAN,
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

    fn prepare(&mut self, inverse_masses: &[Real], h: Real) {
        let softness = self.compliance / (h * h);
        for k in 0..self.edges.len() {
            let w = inverse_masses[self.edges.a[k] as usize] + inverse_masses[self.edges.b[k] as usize];
            let a = w + softness;
            self.inverse_a[k] = if w > 0.0 && a.is_finite() { 1.0 / a } else { 0.0 };
        }
        self.prepared.0 = h;
        self.prepared.1.clear();
        self.prepared.1.extend_from_slice(inverse_masses);
        self.prepared_compliance = self.compliance;
    }
}

/// Edges `at .. at + N` of a colour: gathers, computes in lanes, scatters.
#[inline(always)]
fn visit<const N: usize>(
    edges: (&[u32], &[u32], &[Real], &[Real]),
    lambda: &mut [Real],
    positions: &mut [Point],
    inverse_masses: &[Real],
    scale: Real,
    fresh: bool,
    worst: &mut [Real; N],
    squares: &mut [Real; N],
) -> u32 {
    let (a, b, rest, inverse_a) = edges;
    let (mut dx, mut dy, mut dz) = ([0.0; N], [0.0; N], [0.0; N]);
    for l in 0..N {
        let (p, q) = (&positions[a[l] as usize], &positions[b[l] as usize]);
        (dx[l], dy[l], dz[l]) = (p.x - q.x, p.y - q.y, p.z - q.z);
    }
    let mut factor = [0.0; N];
    let mut flat = 0;
    for l in 0..N {
        let length = (dx[l] * dx[l] + dy[l] * dy[l] + dz[l] * dz[l]).sqrt();
        let before = if fresh { 0.0 } else { lambda[l] };
        let violation = length - rest[l] + scale * before;
        let delta = if length > 0.0 { -violation * inverse_a[l] } else { 0.0 };
        lambda[l] = before + delta;
        factor[l] = if length > 0.0 { delta / length } else { 0.0 };
        flat += u32::from(length <= 0.0);
        let size = violation.abs();
        worst[l] = if size > worst[l] { size } else { worst[l] };
        squares[l] += violation * violation;
    }
    for l in 0..N {
        let (i, j) = (a[l] as usize, b[l] as usize);
        let (fi, fj) = (factor[l] * inverse_masses[i], factor[l] * inverse_masses[j]);
        let p = &mut positions[i];
        (p.x, p.y, p.z) = (p.x + fi * dx[l], p.y + fi * dy[l], p.z + fi * dz[l]);
        let q = &mut positions[j];
        (q.x, q.y, q.z) = (q.x - fj * dx[l], q.y - fj * dy[l], q.z - fj * dz[l]);
    }
    flat
}

impl Constraint for Stretch {
    fn begin_substep(&mut self, _previous: &[Point], _positions: &[Point], inverse_masses: &[Real], h: Real) {
        self.fresh = true;
        if self.prepared.0 != h || self.prepared_compliance != self.compliance || self.prepared.1 != inverse_masses {
            self.prepare(inverse_masses, h);
        }
    }

    /// # Panics
    ///
    /// If the slices are shorter than the edges' vertex count.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], h: Real) -> Residual {
        if self.is_idle() {
            return Residual::default();
        }
        if self.prepared.0 != h || self.prepared_compliance != self.compliance {
            self.prepare(inverse_masses, h);
        }
        let (scale, fresh) = (self.lambda_scale(h), self.fresh);
        let mut worst = [0.0; LANES];
        let mut squares = [0.0; LANES];
        let (mut worst_left, mut squares_left) = ([0.0; 1], [0.0; 1]);
        let mut flat = 0;
        let e = &self.edges;
        for range in &e.colors {
            let mut at = range.start;
            while at + LANES <= range.end {
                let r = at..at + LANES;
                let lanes = (&e.a[r.clone()], &e.b[r.clone()], &e.rest[r.clone()], &self.inverse_a[r.clone()]);
                let lambda = &mut self.lambda[r];
                flat += visit(lanes, lambda, positions, inverse_masses, scale, fresh, &mut worst, &mut squares);
                at += LANES;
            }
            while at < range.end {
                let r = at..at + 1;
                let lane = (&e.a[r.clone()], &e.b[r.clone()], &e.rest[r.clone()], &self.inverse_a[r.clone()]);
                let lambda = &mut self.lambda[r];
                flat += visit(lane, lambda, positions, inverse_masses, scale, fresh, &mut worst_left, &mut squares_left);
                at += 1;
            }
        }
        self.fresh = false;
        self.degenerate += u64::from(flat);
        Residual {
            max: worst.into_iter().fold(worst_left[0], |m, x| if x > m { x } else { m }),
            sum_squares: squares.into_iter().sum::<Real>() + squares_left[0],
            count: e.len(),
            active: e.len() - flat as usize,
        }
    }

    fn is_idle(&self) -> bool {
        self.edges.is_empty() || self.compliance == Real::INFINITY
    }

    fn counters(&self) -> Counters {
        Counters { degenerate: self.degenerate, ..Counters::default() }
    }
}
