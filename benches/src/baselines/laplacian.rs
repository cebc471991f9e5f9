//! A Laplacian solve: differential coordinates are kept, and vertices go to pushed targets, as well
//! as both can be.

use crate::baselines::push::pushed;
use if_core::edges::Edges;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_sparse::{Cholesky, Entry, Mat};

/// Clearance and weights of [`deform`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaplacianParams {
    /// δ: targets lie this far outside the field, in metres.
    pub clearance: Real,
    /// Weight of the targets of vertices with φ < δ.
    pub weight_pushed: Real,
    /// Weight of the other vertices, whose target is where they are. Above 0, or the system is
    /// singular.
    pub weight_kept: Real,
}

impl Default for LaplacianParams {
    fn default() -> Self {
        Self { clearance: 1e-3, weight_pushed: 2.0, weight_kept: 1.0 }
    }
}

/// Weights that leave the system without a solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the Laplacian system with the weights {pushed} and {kept} cannot be factored; give weights above 0"
)]
pub struct LaplacianError {
    pushed: Real,
    kept: Real,
}

/// Moves the vertices x to the least squares of
///
/// ```text
/// Σ |(L x′)ᵢ − (L x)ᵢ|² + Σ wᵢ² |x′ᵢ − tᵢ|²,     (L x)ᵢ = xᵢ − mean of its neighbours
/// ```
///
/// with t the vertices pushed once to φ ≥ δ, by one sparse Cholesky factorisation.
///
/// # Source
///
/// [Sorkine et al. 2004], with uniform weights.
///
/// # Errors
///
/// Weights that are not above 0.
pub fn deform(
    garment: &TriMesh,
    field: &impl SignedDistance,
    params: &LaplacianParams,
) -> Result<Vec<Point>, LaplacianError> {
    let error = LaplacianError { pushed: params.weight_pushed, kept: params.weight_kept };
    if !(params.weight_pushed > 0.0 && params.weight_kept > 0.0) {
        return Err(error);
    }
    let x = garment.vertices();
    let n = x.len();
    let targets = pushed(x, field, |_| params.clearance);
    let mut neighbours: Vec<Vec<usize>> = vec![Vec::new(); n];
    for [a, b] in &Edges::new(garment).vertices {
        neighbours[*a as usize].push(*b as usize);
        neighbours[*b as usize].push(*a as usize);
    }
    // Unknown are the displacements u: (LᵀL + W²) u = W² (t − x). The lower triangle is enough.
    let mut entries = Vec::new();
    let mut right = Mat::zeros(n, 3);
    for v in 0..n {
        let target = targets[v] - x[v];
        let weight =
            if target == Vector::zeros() { params.weight_kept } else { params.weight_pushed };
        let squared = weight * weight;
        entries.push(Entry::new(v, v, squared));
        (0..3).for_each(|k| right[(v, k)] = squared * target[k]);
        if neighbours[v].is_empty() {
            continue;
        }
        let share = -1.0 / neighbours[v].len() as Real;
        let row: Vec<(usize, Real)> =
            std::iter::once((v, 1.0)).chain(neighbours[v].iter().map(|u| (*u, share))).collect();
        for &(i, a) in &row {
            entries
                .extend(row.iter().filter(|(j, _)| *j <= i).map(|&(j, b)| Entry::new(i, j, a * b)));
        }
    }
    Cholesky::new(n, &entries).map_err(|_| error)?.solve_in_place(&mut right);
    Ok((0..n).map(|v| x[v] + Vector::new(right[(v, 0)], right[(v, 1)], right[(v, 2)])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::scene::{RADIUS, belt};
    use approx::assert_relative_eq;
    use if_core::shapes::Sphere;

    const BALL: Sphere = Sphere { center: Point::new(0.0, 0.0, 0.0), radius: RADIUS };

    #[test]
    fn heavy_targets_are_reached_and_light_ones_move_the_cloth_smoothly() {
        let belt = belt();
        let heavy = LaplacianParams { weight_pushed: 1e4, ..Default::default() };
        let after = deform(&belt, &BALL, &heavy).unwrap();
        for (p, q) in after.iter().zip(belt.vertices()) {
            if BALL.distance(q) < 1e-3 {
                // The targets give way by the forces of the cloth over the squared weight.
                assert_relative_eq!(BALL.distance(p), 1e-3, epsilon = 1e-8);
            }
        }
        let after = deform(&belt, &BALL, &LaplacianParams::default()).unwrap();
        let inside = |x: &[Point]| x.iter().filter(|p| BALL.distance(p) < 0.0).count();
        assert!(inside(&after) < inside(belt.vertices()));
    }

    #[test]
    fn the_gradient_of_the_energy_vanishes_at_the_result() {
        let belt = belt();
        let params = LaplacianParams::default();
        let after = deform(&belt, &BALL, &params).unwrap();
        let targets = pushed(belt.vertices(), &BALL, |_| params.clearance);
        let edges = Edges::new(&belt);
        let energy = |x: &[Point]| {
            let n = x.len();
            let mut sums = vec![(Vector::zeros(), 0.0); n];
            for [a, b] in &edges.vertices {
                for (i, j) in [(*a as usize, *b as usize), (*b as usize, *a as usize)] {
                    sums[i].0 += (x[j] - belt.vertices()[j]) - (x[i] - belt.vertices()[i]);
                    sums[i].1 += 1.0;
                }
            }
            let smooth: Real = sums.iter().map(|(s, d)| (s / *d).norm_squared()).sum();
            let fit: Real = (0..n)
                .map(|v| {
                    let w = if targets[v] == belt.vertices()[v] { 1.0 } else { 2.0 };
                    w * w * (x[v] - targets[v]).norm_squared()
                })
                .sum();
            smooth + fit
        };
        let h = 1e-6;
        for v in (0..after.len()).step_by(37) {
            for k in 0..3 {
                let at = |step: Real| {
                    let mut x = after.clone();
                    x[v][k] += step;
                    energy(&x)
                };
                // The energy is of order 0.01: its differences are exact to about 1e-18 / h.
                assert!(((at(h) - at(-h)) / (2.0 * h)).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn a_garment_that_is_clear_stays_and_weights_of_nothing_are_refused() {
        let belt = belt();
        let small = Sphere { center: Point::origin(), radius: 0.1 };
        assert_eq!(deform(&belt, &small, &LaplacianParams::default()).unwrap(), belt.vertices());
        let none = LaplacianParams { weight_kept: 0.0, ..Default::default() };
        assert!(deform(&belt, &small, &none).unwrap_err().to_string().contains("above 0"));
    }
}
