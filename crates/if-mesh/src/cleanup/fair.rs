//! Fairing: a patch continues the slope of the surface around it.

use super::patch::Patch;
use if_core::math::{Point, Real, Vector};
use if_core::rows::Rows;
use if_sparse::{Cholesky, Entry, Mat};

/// Rounds, each with weights from the last shape. The first finds the shape, the second makes the
/// spacing even.
const ROUNDS: usize = 2;
/// Shorter edges than this share of the mean count as this long, so that weights differ by at most
/// a factor of 100.
const SHORTEST: Real = 0.01;

/// Moves the vertices inside `patch` to the minimum of the squared Laplacian
///
/// ```text
/// Σᵢ |L xᵢ|²,   L xᵢ = Σⱼ wᵢⱼ (xⱼ − xᵢ) / Σⱼ wᵢⱼ,   wᵢⱼ = 1 / |xⱼ − xᵢ|
/// ```
///
/// over the vertices of patch and loop; `around` holds for each vertex of the loop its neighbours
/// outside, so that position and slope are continuous across the loop: the discrete biharmonic
/// surface. Solved for displacements, by sparse Cholesky. Returns `false`, with nothing moved, if
/// the system cannot be factorised.
///
/// # Source
///
/// Liepa 2003, section 5, with the scale-dependent umbrella of Desbrun et al. 1999.
pub(super) fn fair(patch: &mut Patch, around: &[Vec<Point>]) -> bool {
    let before = patch.points.clone();
    for _ in 0..ROUNDS {
        if round(patch, around).is_none()
            || patch.points.iter().any(|p| !p.iter().all(|x| x.is_finite()))
        {
            patch.points = before;
            return false;
        }
    }
    true
}

fn round(patch: &mut Patch, around: &[Vec<Point>]) -> Option<()> {
    let (n, boundary) = (patch.points.len(), patch.boundary);
    let unknowns = n - boundary;
    if unknowns == 0 {
        return Some(());
    }
    let mut pairs: Vec<(u32, u32)> = patch
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)])
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    let neighbours = Rows::new(n, pairs.into_iter());
    let (sum, count) =
        (0..n).map(|v| (v, neighbours.of(v))).fold((0.0, 0usize), |(s, c), (v, list)| {
            (
                s + list
                    .iter()
                    .map(|u| (patch.points[*u as usize] - patch.points[v]).norm())
                    .sum::<Real>(),
                c + list.len(),
            )
        });
    let shortest = (SHORTEST * sum / count.max(1) as Real).max(Real::MIN_POSITIVE);
    let mut entries = Vec::new();
    let mut right = Mat::zeros(unknowns, 3);
    for v in 0..n {
        let here = patch.points[v];
        let weight = |p: &Point| 1.0 / (p - here).norm().max(shortest);
        let mut row: Vec<(usize, Real)> = neighbours
            .of(v)
            .iter()
            .map(|u| (*u as usize, weight(&patch.points[*u as usize])))
            .collect();
        let outside = around.get(v).map_or(&[][..], |a| &a[..]);
        let total =
            row.iter().map(|r| r.1).sum::<Real>() + outside.iter().map(weight).sum::<Real>();
        // L of the present shape, which the displacements must cancel.
        let mut laplacian = Vector::zeros();
        for (u, w) in &mut row {
            *w /= total;
            laplacian += (patch.points[*u] - here) * *w;
        }
        for p in outside {
            laplacian += (p - here) * (weight(p) / total);
        }
        row.push((v, -1.0));
        let inner: Vec<(usize, Real)> =
            row.iter().filter(|r| r.0 >= boundary).map(|r| (r.0 - boundary, r.1)).collect();
        for &(i, a) in &inner {
            (0..3).for_each(|k| right[(i, k)] -= a * laplacian[k]);
            entries.extend(
                inner.iter().filter(|(j, _)| *j <= i).map(|&(j, b)| Entry::new(i, j, a * b)),
            );
        }
    }
    Cholesky::new(unknowns, &entries).ok()?.solve_in_place(&mut right);
    for i in 0..unknowns {
        patch.points[boundary + i] += Vector::new(right[(i, 0)], right[(i, 1)], right[(i, 2)]);
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::super::loop_triangulation::{Chords, LoopPolygon};
    use super::super::patch::refine;
    use super::*;
    use if_core::math::unit_or_zero;

    /// The lid of a polar cap of the unit sphere, whose surroundings are the sphere.
    fn cap(n: usize, opening: Real) -> (Patch, Vec<Vec<Point>>) {
        let on = |polar: Real, k: Real| {
            let a = k / n as Real * std::f64::consts::TAU;
            Point::new(polar.sin() * a.cos(), polar.sin() * a.sin(), polar.cos())
        };
        let points: Vec<Point> = (0..n).map(|k| on(opening, k as Real)).collect();
        let edge = (points[1] - points[0]).norm();
        let ring = opening + edge;
        let around = (0..n).map(|k| vec![on(ring, k as Real), on(ring, k as Real + 1.0)]).collect();
        let outside: Vec<Vector> = points.iter().map(|p| unit_or_zero(&p.coords)).collect();
        let forbidden = Chords::new();
        let triangles = LoopPolygon { points: &points, outside: &outside, forbidden: &forbidden }
            .triangulate(64)
            .unwrap();
        let mut patch = Patch { boundary: n, points, triangles };
        refine(&mut patch, &vec![edge; n], &forbidden, 10_000);
        (patch, around)
    }

    #[test]
    fn a_patch_in_a_sphere_bulges_like_the_sphere() {
        let (mut patch, around) = cap(40, 0.5);
        let error =
            |p: &Patch| p.points.iter().map(|q| (q.coords.norm() - 1.0).abs()).fold(0.0, Real::max);
        let flat = error(&patch);
        assert!(fair(&mut patch, &around));
        // A plane cap is 0.122 too low in its middle; the biharmonic one has about the right slope.
        assert!(flat > 0.1 && error(&patch) < 0.03, "{flat} {}", error(&patch));
    }

    #[test]
    fn the_gradient_of_the_energy_vanishes_at_the_result() {
        let (mut patch, around) = cap(16, 0.4);
        let weights = patch.clone();
        assert!(round(&mut patch, &around).is_some());
        let energy = |patch: &Patch| -> Real {
            (0..patch.points.len())
                .map(|v| {
                    let mut list: Vec<u32> = patch
                        .triangles
                        .iter()
                        .filter(|t| t.contains(&(v as u32)))
                        .flatten()
                        .copied()
                        .collect();
                    list.sort_unstable();
                    list.dedup();
                    list.retain(|u| *u != v as u32);
                    let w = |p: &Point| 1.0 / (p - weights.points[v]).norm();
                    let outside = around.get(v).map_or(&[][..], |a| &a[..]);
                    let total: Real =
                        list.iter().map(|u| w(&weights.points[*u as usize])).sum::<Real>()
                            + outside.iter().map(w).sum::<Real>();
                    let mut l = Vector::zeros();
                    for u in list {
                        l += (patch.points[u as usize] - patch.points[v])
                            * w(&weights.points[u as usize])
                            / total;
                    }
                    for p in outside {
                        l += (p - patch.points[v]) * w(p) / total;
                    }
                    l.norm_squared()
                })
                .sum()
        };
        // Central differences of a quadratic function are exact but for rounding, 1e-16 of an
        // energy of 1e-2 over the step.
        for v in [patch.boundary, patch.boundary + 5, patch.points.len() - 1] {
            for axis in 0..3 {
                let moved = |by: Real| {
                    let mut p = patch.clone();
                    p.points[v][axis] += by;
                    energy(&p)
                };
                let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                assert!(slope.abs() < 1e-10, "{v} {axis} {slope}");
            }
        }
    }
}
