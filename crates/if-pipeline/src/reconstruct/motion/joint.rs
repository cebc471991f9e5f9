//! The linear least-squares problem of all frames at once.
//!
//! ```text
//! E(s) = Σᵢ evidence of frame i (sᵢ)  +  Σₖ ( qₖ |ŝₖ|² + cₖ |B ŝₖ|² )
//! ŝ    = Uᵀ s in time: modes of the prior;  B s = s − mean of its neighbours' s
//! ```
//!
//! with sᵢ the step of each vertex along its direction in frame i. Mode 0 is constant in time: the
//! mean surface, whose bending is that of the fit of the surface. In the other modes, which are
//! motion, larger and faster motion costs more. Solved by conjugate gradients; the preconditioner
//! has the mean evidence of all frames in place of each frame's, so it separates into modes.

use crate::reconstruct::refine::{Observed, add_bending};
use if_core::edges::Edges;
use if_core::math::Real;
use if_core::monitor::Cancelled;
use if_core::rows::Rows;
use if_sparse::{Cholesky, Mat};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Residual at which the iteration ends, relative to the first: steps are then exact to a hundredth
/// of a millimetre where the first is a centimetre.
const ACCURATE: Real = 1e-3;
/// Largest number of iterations.
const ITERATIONS: usize = 60;
/// Modes whose stiffness differs by at most this factor share a factorisation.
const ALIKE: Real = 2.0;

/// The prior in time.
pub(super) struct Modes {
    /// Columns are modes; the first is constant.
    basis: DMatrix<Real>,
    /// q of each mode.
    stay: Vec<Real>,
    /// c of each mode.
    bending: Vec<Real>,
}

/// Weights of the prior.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior {
    /// q of the mean surface, in a round.
    pub(super) mean_stay: Real,
    /// c of the mean surface, in a round.
    pub(super) mean_bending: Real,
    /// Of the motion.
    pub(super) stay: Real,
    pub(super) bending: Real,
    /// Of changes of its changes from frame to frame.
    pub(super) acceleration: Real,
}

impl Modes {
    /// The modes of frames with these numbers in time, increasing.
    pub(super) fn new(numbers: &[u32], prior: &Prior) -> Self {
        let n = numbers.len();
        let paces = paces(numbers);
        let mut roughness = DMatrix::<Real>::zeros(n, n);
        for i in 2..n {
            let (before, after) = (paces[i - 2], paces[i - 1]);
            let row = [(i - 2, before), (i - 1, -before - after), (i, after)];
            for (a, x) in row {
                for (b, y) in row {
                    roughness[(a, b)] += prior.acceleration * x * y;
                }
            }
        }
        // The constant is an eigenvector of value 0; drawn out of the others, it is the first.
        let constant = 1.0 / n as Real;
        let lift = roughness.trace() + 1.0;
        let eigen = (roughness.add_scalar(-lift * constant)).symmetric_eigen();
        let mut order: Vec<usize> = (0..n).collect();
        order
            .sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]).then(a.cmp(b)));
        let basis = DMatrix::from_fn(n, n, |r, c| eigen.eigenvectors[(r, order[c])]);
        let mut stay: Vec<Real> =
            order.iter().map(|k| prior.stay + eigen.eigenvalues[*k].max(0.0)).collect();
        let mut bending = vec![prior.bending; n];
        if let (Some(q), Some(c)) = (stay.first_mut(), bending.first_mut()) {
            (*q, *c) = (prior.mean_stay, prior.mean_bending);
        }
        Self { basis, stay, bending }
    }

    /// From frames to modes.
    fn modes(&self, s: &[Vec<Real>]) -> Vec<Vec<Real>> {
        self.mixed(s, |k, i| self.basis[(i, k)])
    }

    /// From modes to frames.
    fn frames(&self, s: &[Vec<Real>]) -> Vec<Vec<Real>> {
        self.mixed(s, |i, k| self.basis[(i, k)])
    }

    fn mixed(
        &self,
        s: &[Vec<Real>],
        weight: impl Fn(usize, usize) -> Real + Sync,
    ) -> Vec<Vec<Real>> {
        let size = s.first().map_or(0, Vec::len);
        (0..s.len())
            .into_par_iter()
            .map(|a| {
                let mut sum = vec![0.0; size];
                for (b, s) in s.iter().enumerate() {
                    let w = weight(a, b);
                    sum.iter_mut().zip(s).for_each(|(sum, s)| *sum += w * s);
                }
                sum
            })
            .collect()
    }
}

/// Between frames and the next ones: the mean time between frames as a multiple of theirs.
fn paces(numbers: &[u32]) -> Vec<Real> {
    let apart = |w: &[u32]| Real::from(w[1] - w[0]);
    let sum: Real = numbers.windows(2).map(apart).sum();
    let mean = sum / numbers.len().saturating_sub(1).max(1) as Real;
    numbers.windows(2).map(|w| mean / apart(w)).collect()
}

/// The equations.
pub(super) struct Joint<'a> {
    pub(super) edges: &'a Edges,
    pub(super) neighbours: &'a Rows<u32>,
    pub(super) modes: &'a Modes,
    /// The evidence of each frame; `None` without images.
    pub(super) seen: Vec<Option<Observed>>,
    /// Steps of earlier rounds.
    pub(super) so_far: &'a [Vec<Real>],
}

impl Joint<'_> {
    /// The further step of each vertex in each frame; `None` if there is no finite one. `watch` is called
    /// in each iteration, and can end them.
    pub(super) fn solve(
        &self,
        watch: &mut dyn FnMut() -> Result<(), Cancelled>,
    ) -> Result<Option<Vec<Vec<Real>>>, Cancelled> {
        let size = self.neighbours.len();
        let Some(blocks) = self.preconditioner() else { return Ok(None) };
        // The gradient at no further step. The mean surface has no memory of earlier rounds.
        let mut before = self.modes.modes(self.so_far);
        if let Some(mean) = before.first_mut() {
            mean.fill(0.0);
        }
        let home = self.modes.frames(&self.prior(&before));
        let mut r: Vec<Vec<Real>> = self
            .seen
            .iter()
            .zip(&home)
            .map(|(seen, home)| match seen {
                Some(seen) => seen.right.iter().zip(home).map(|(b, h)| b - h).collect(),
                None => home.iter().map(|h| -h).collect(),
            })
            .collect();
        let mut x = vec![vec![0.0; size]; r.len()];
        let mut z = self.precondition(&blocks, &r);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        let enough = rz * ACCURATE * ACCURATE;
        let mut iterations = 0;
        while rz > enough && iterations < ITERATIONS {
            watch()?;
            let ap = self.apply(&p);
            let pap = dot(&p, &ap);
            if !(pap > 0.0 && pap.is_finite()) {
                return Ok(None);
            }
            let alpha = rz / pap;
            add(&mut x, alpha, &p);
            add(&mut r, -alpha, &ap);
            z = self.precondition(&blocks, &r);
            let next = dot(&r, &z);
            let beta = next / rz;
            p.par_iter_mut().zip(&z).for_each(|(p, z)| {
                p.iter_mut().zip(z).for_each(|(p, z)| *p = z + beta * *p);
            });
            rz = next;
            iterations += 1;
        }
        Ok(x.iter().flatten().all(|x| x.is_finite()).then_some(x))
    }

    /// The matrix times `s`.
    fn apply(&self, s: &[Vec<Real>]) -> Vec<Vec<Real>> {
        let mut out = self.modes.frames(&self.prior(&self.modes.modes(s)));
        out.par_iter_mut().zip(s).zip(&self.seen).for_each(|((out, s), seen)| {
            let Some(seen) = seen else { return };
            for (v, out) in out.iter_mut().enumerate() {
                *out += seen.diagonal[v] * s[v];
            }
            for ([a, b], w) in self.edges.vertices.iter().zip(&seen.across) {
                let (a, b) = (*a as usize, *b as usize);
                out[a] += w * s[b];
                out[b] += w * s[a];
            }
        });
        out
    }

    /// The prior's matrix times `s`, both in modes.
    fn prior(&self, s: &[Vec<Real>]) -> Vec<Vec<Real>> {
        s.par_iter()
            .enumerate()
            .map(|(k, s)| {
                let (q, c) = (self.modes.stay[k], self.modes.bending[k]);
                let mut out: Vec<Real> = s.iter().map(|s| q * s).collect();
                for v in 0..s.len() {
                    let near = self.neighbours.of(v);
                    if near.is_empty() {
                        continue;
                    }
                    let share = 1.0 / near.len() as Real;
                    let mean = near.iter().map(|u| s[*u as usize]).sum::<Real>() * share;
                    let bent = c * (s[v] - mean);
                    out[v] += bent;
                    near.iter().for_each(|u| out[*u as usize] -= bent * share);
                }
                out
            })
            .collect()
    }

    /// Factorisations, and the modes that each is for.
    fn preconditioner(&self) -> Option<Vec<(Cholesky, Vec<usize>)>> {
        let n = self.neighbours.len();
        let mut mean = Observed {
            diagonal: vec![0.0; n],
            across: vec![0.0; self.edges.vertices.len()],
            right: Vec::new(),
            round: Default::default(),
        };
        let share = 1.0 / self.seen.len().max(1) as Real;
        for seen in self.seen.iter().flatten() {
            mean.diagonal.iter_mut().zip(&seen.diagonal).for_each(|(m, s)| *m += share * s);
            mean.across.iter_mut().zip(&seen.across).for_each(|(m, s)| *m += share * s);
        }
        let modes = self.modes;
        let mut order: Vec<usize> = (0..modes.stay.len()).collect();
        order.sort_by(|a, b| modes.stay[*a].total_cmp(&modes.stay[*b]).then(a.cmp(b)));
        let mut groups: Vec<(Real, Real, Vec<usize>)> = Vec::new();
        for k in order {
            let (q, c) = (modes.stay[k], modes.bending[k]);
            match groups.last_mut() {
                Some((least, bending, group)) if q <= ALIKE * *least && c == *bending => {
                    group.push(k)
                }
                _ => groups.push((q, c, vec![k])),
            }
        }
        groups
            .into_par_iter()
            .map(|(q, c, group)| {
                let mut entries = mean.entries(self.edges, q);
                add_bending(&mut entries, self.neighbours, c);
                Some((Cholesky::new(n, &entries).ok()?, group))
            })
            .collect()
    }

    fn precondition(&self, blocks: &[(Cholesky, Vec<usize>)], r: &[Vec<Real>]) -> Vec<Vec<Real>> {
        let in_modes = self.modes.modes(r);
        let size = self.neighbours.len();
        let solved: Vec<(usize, Vec<Real>)> = blocks
            .par_iter()
            .flat_map_iter(|(factor, group)| {
                let mut right = Mat::from_fn(size, group.len(), |v, c| in_modes[group[c]][v]);
                factor.solve_in_place(&mut right);
                let column = move |c: usize| (0..size).map(|v| right[(v, c)]).collect();
                group.iter().enumerate().map(|(c, k)| (*k, column(c))).collect::<Vec<_>>()
            })
            .collect();
        let mut modes = vec![Vec::new(); r.len()];
        solved.into_iter().for_each(|(k, x)| modes[k] = x);
        self.modes.frames(&modes)
    }
}

/// The sum of products, in the order of frames: the same bits on any number of threads.
fn dot(a: &[Vec<Real>], b: &[Vec<Real>]) -> Real {
    let one =
        |(a, b): (&Vec<Real>, &Vec<Real>)| -> Real { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let parts: Vec<Real> = a.par_iter().zip(b).map(one).collect();
    parts.iter().sum()
}

/// a ← a + w b.
fn add(a: &mut [Vec<Real>], w: Real, b: &[Vec<Real>]) {
    a.par_iter_mut().zip(b).for_each(|(a, b)| a.iter_mut().zip(b).for_each(|(a, b)| *a += w * b));
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes;

    #[test]
    fn the_gradient_of_the_energy_vanishes_at_the_step() {
        let mesh = meshes::icosphere(0.2, 2);
        let (edges, n, count) = (Edges::new(&mesh), mesh.vertices().len(), 5);
        let neighbours = edges.neighbours(n);
        let prior = Prior {
            mean_stay: 1e-3,
            mean_bending: 0.7,
            stay: 0.02,
            bending: 3.0,
            acceleration: 0.1,
        };
        let numbers: Vec<u32> = (0..count as u32).map(|k| 3 * k).collect();
        let modes = Modes::new(&numbers, &prior);
        // Evidence that differs from frame to frame; the third has none.
        let frame = |i: usize| Observed {
            diagonal: (0..n).map(|v| 1.0 + 0.1 * ((v + i) % 7) as Real).collect(),
            across: (0..edges.vertices.len()).map(|e| -0.1 * ((e + i) % 3) as Real / 3.0).collect(),
            right: (0..n).map(|v| 0.01 * ((v * (i + 2)) % 11) as Real - 0.03).collect(),
            round: Default::default(),
        };
        let seen: Vec<_> = (0..count).map(|i| (i != 2).then(|| frame(i))).collect();
        let before: Vec<Vec<Real>> = (0..count)
            .map(|i| (0..n).map(|v| 1e-3 * ((v + 3 * i) % 5) as Real).collect())
            .collect();
        let joint =
            Joint { edges: &edges, neighbours: &neighbours, modes: &modes, seen, so_far: &before };
        let stopped = joint.solve(&mut || Err(Cancelled));
        assert_eq!(stopped, Err(Cancelled), "at its first iteration");
        let step = joint.solve(&mut || Ok(())).unwrap().unwrap();

        // The energy, written out term by term.
        let bent = |s: &[Real]| -> Real {
            let mean = |v: usize| {
                let near = neighbours.of(v);
                near.iter().map(|u| s[*u as usize]).sum::<Real>() / near.len() as Real
            };
            (0..n).map(|v| (s[v] - mean(v)).powi(2)).sum()
        };
        let square = |s: &[Real]| -> Real { s.iter().map(|s| s * s).sum() };
        let energy = |step: &[Vec<Real>]| {
            let mut sum = 0.0;
            for (s, seen) in step.iter().zip(&joint.seen) {
                let Some(seen) = seen else { continue };
                for v in 0..n {
                    sum += seen.diagonal[v] * s[v] * s[v] - 2.0 * seen.right[v] * s[v];
                }
                for ([a, b], w) in edges.vertices.iter().zip(&seen.across) {
                    sum += 2.0 * w * s[*a as usize] * s[*b as usize];
                }
            }
            let total: Vec<Vec<Real>> = step
                .iter()
                .zip(&before)
                .map(|(s, b)| s.iter().zip(b).map(|(s, b)| s + b).collect())
                .collect();
            let mean = |of: &[Vec<Real>]| -> Vec<Real> {
                (0..n).map(|v| of.iter().map(|s| s[v]).sum::<Real>() / count as Real).collect()
            };
            let (middle, stepped) = (mean(&total), mean(step));
            for s in &total {
                let d: Vec<Real> = s.iter().zip(&middle).map(|(s, m)| s - m).collect();
                sum += prior.stay * square(&d) + prior.bending * bent(&d);
            }
            for three in total.windows(3) {
                let change = |v: usize| three[0][v] - 2.0 * three[1][v] + three[2][v];
                sum += prior.acceleration * (0..n).map(|v| change(v).powi(2)).sum::<Real>();
            }
            let frames = count as Real;
            sum + frames
                * (prior.mean_stay * square(&stepped) + prior.mean_bending * bent(&stepped))
        };
        let slope = |at: &[Vec<Real>], i: usize, v: usize| {
            let h = 1e-4;
            let moved = |h: Real| {
                let mut s = at.to_vec();
                s[i][v] += h;
                energy(&s)
            };
            (moved(h) - moved(-h)) / (2.0 * h)
        };
        let still = vec![vec![0.0; n]; count];
        for i in 0..count {
            for v in (0..n).step_by(13) {
                // Against slopes of about 0.05 before the step; the iteration leaves a thousandth.
                let (now, first) = (slope(&step, i, v), slope(&still, i, v));
                assert!(now.abs() < 5e-4, "frame {i}, vertex {v}: {now}, {first} before");
            }
        }
    }

    #[test]
    fn what_all_frames_show_moves_the_mean_surface_alone() {
        let mesh = meshes::icosphere(0.2, 2);
        let (edges, n) = (Edges::new(&mesh), mesh.vertices().len());
        let neighbours = edges.neighbours(n);
        let prior = Prior {
            mean_stay: 1e-4,
            mean_bending: 5.0,
            stay: 0.01,
            bending: 15.0,
            acceleration: 0.1,
        };
        let modes = Modes::new(&[0, 1, 2, 3, 4, 5], &prior);
        let frame = || Observed {
            diagonal: vec![0.3; n],
            across: vec![0.0; edges.vertices.len()],
            right: vec![0.3 * 0.01; n],
            round: Default::default(),
        };
        let seen = (0..6).map(|_| Some(frame())).collect();
        let before = vec![vec![0.0; n]; 6];
        let joint =
            Joint { edges: &edges, neighbours: &neighbours, modes: &modes, seen, so_far: &before };
        for s in joint.solve(&mut || Ok(())).unwrap().unwrap().iter().flatten() {
            approx::assert_relative_eq!(*s, 0.01, epsilon = 1e-4);
        }
    }
}
