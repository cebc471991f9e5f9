//! Inverse skinning: from posed space to canonical space.

use super::WeightGrid;
use if_core::math::{Point, Real};
use nalgebra::Isometry3;

/// Parameters of [`unpose`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnposeParams {
    /// Largest residual of a root, in metres.
    pub tolerance: Real,
    /// Largest number of Newton steps from each start.
    pub steps: usize,
    /// Longest step, in metres: Newton's method on trilinear weights overshoots.
    pub longest: Real,
}

impl Default for UnposeParams {
    /// 1e-8 m in at most 20 steps of at most 10 cm.
    fn default() -> Self {
        Self { tolerance: 1e-8, steps: 20, longest: 0.1 }
    }
}

/// A canonical point that a pose maps to the given point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unposed {
    /// In canonical space.
    pub point: Point,
    /// Distance of its posed point from the given one, in metres.
    pub residual: Real,
    /// The joint whose rigid inverse was the start of the search.
    pub joint: usize,
}

/// All canonical points that a pose maps to `p`: none, one, or several where the body touches
/// itself.
///
/// Solves f(x) = p by Newton's method, from the start x₀ = Sⱼ⁻¹ p of each joint j whose start lies
/// in the grid's box. Roots within ten tolerances of each other count as one. The result is in the
/// order of the joints, not of their weights: the caller chooses the body part it needs.
///
/// # Source
///
/// Multiple starts as in SNARF [Chen et al. 2021], with the weights of [`WeightGrid`].
///
/// # Panics
///
/// If there is not one transform for each joint of the grid.
pub fn unpose(
    grid: &WeightGrid,
    transforms: &[Isometry3<Real>],
    p: &Point,
    params: &UnposeParams,
) -> Vec<Unposed> {
    let bounds = grid.bounds();
    let mut roots: Vec<Unposed> = Vec::new();
    for (joint, transform) in transforms.iter().enumerate() {
        let start = transform.inverse_transform_point(p);
        if !bounds.contains(&start) {
            continue;
        }
        let Some(root) = newton(grid, transforms, p, start, params) else { continue };
        let is_known = |known: &Unposed| (known.point - root.0).norm() <= 10.0 * params.tolerance;
        if !roots.iter().any(is_known) {
            roots.push(Unposed { point: root.0, residual: root.1, joint });
        }
    }
    roots
}

/// A root near the start `x`, and its residual; `None` if the iteration does not converge.
fn newton(
    grid: &WeightGrid,
    transforms: &[Isometry3<Real>],
    p: &Point,
    mut x: Point,
    params: &UnposeParams,
) -> Option<(Point, Real)> {
    let (mut place, mut jacobian) = grid.pose_with_jacobian(&x, transforms);
    let mut residual = (p - place).norm();
    for _ in 0..params.steps {
        if residual <= params.tolerance {
            return Some((x, residual));
        }
        let mut step = jacobian.lu().solve(&(p - place))?;
        let length = step.norm();
        if length > params.longest {
            step *= params.longest / length;
        }
        // The step is halved until the residual decreases: the Jacobian is discontinuous across the
        // planes of the lattice.
        let mut accepted = false;
        for _ in 0..6 {
            let next = grid.pose_with_jacobian(&(x + step), transforms);
            let remaining = (p - next.0).norm();
            if remaining < residual {
                (x, place, jacobian, residual) = (x + step, next.0, next.1, remaining);
                accepted = true;
                break;
            }
            step *= 0.5;
        }
        if !accepted {
            return None;
        }
    }
    (residual <= params.tolerance).then_some((x, residual))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skinning::WeightGridParams;
    use crate::skinning::elbow::{elbow, elbow_body};
    use if_core::math::Vector;

    #[test]
    fn posed_points_are_unposed_to_their_origin() {
        let (points, skin) = elbow_body();
        let grid = WeightGrid::new(
            &points,
            &skin,
            2,
            &WeightGridParams { cell: 0.04, ..Default::default() },
        )
        .unwrap();
        for angle in [0.0, 0.8, 1.5] {
            let transforms = elbow(angle);
            for (k, p) in points.iter().enumerate().step_by(7) {
                let q = p + Vector::new(0.001 * (k % 5) as Real, 0.01, -0.013);
                let posed = grid.blend(&q, &transforms).point(&q);
                let roots = unpose(&grid, &transforms, &posed, &UnposeParams::default());
                assert!(
                    roots.iter().any(|r| (r.point - q).norm() < 1e-6),
                    "angle {angle}, {q}: {roots:?}"
                );
                assert!(roots.iter().all(|r| r.residual <= 1e-8));
            }
        }
    }

    #[test]
    fn where_the_body_touches_itself_there_are_several_roots() {
        let (points, skin) = elbow_body();
        let grid = WeightGrid::new(
            &points,
            &skin,
            2,
            &WeightGridParams { cell: 0.04, ..Default::default() },
        )
        .unwrap();
        // Folded back: the lower half lies on the upper one.
        let transforms = elbow(std::f64::consts::PI * 0.97);
        let p = transforms[0] * Point::new(-0.25, -0.01, 0.0);
        let roots = unpose(&grid, &transforms, &p, &UnposeParams::default());
        assert!(roots.len() >= 2, "{roots:?}");
        assert!(
            roots.iter().any(|r| r.point.x < -0.2) && roots.iter().any(|r| r.point.x > 0.2),
            "{roots:?}"
        );
    }

    #[test]
    fn a_point_far_away_has_no_root() {
        let (points, skin) = elbow_body();
        let grid = WeightGrid::new(
            &points,
            &skin,
            2,
            &WeightGridParams { cell: 0.04, ..Default::default() },
        )
        .unwrap();
        assert_eq!(
            unpose(&grid, &elbow(0.5), &Point::new(5.0, 5.0, 5.0), &UnposeParams::default()),
            []
        );
    }
}
