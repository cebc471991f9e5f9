//! From posed space back to canonical space.

use super::WeightGrid;
use if_core::math::{Point, Real};
use nalgebra::Isometry3;

/// How [`unpose`] searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnposeParams {
    /// A root is good when it poses this near to the point, in metres.
    pub tolerance: Real,
    /// Newton steps from each start.
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

/// A canonical point, and how well it poses to the point it was sought for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unposed {
    /// In canonical space.
    pub point: Point,
    /// Distance of its posed place from the point that was asked for, in metres.
    pub residual: Real,
    /// The start it was found from: the joint whose rigid inverse it is.
    pub joint: usize,
}

/// All canonical points that a pose takes to `p`: none, one, or several where the body touches
/// itself.
///
/// Newton's method on f(x) = p from one start for each joint, x₀ = Sⱼ⁻¹ p, that lies in the grid's
/// box. Roots that lie within ten tolerances of one another are one. They come in the order of the
/// joints that they were found from, those with more weight in them not before the others: the
/// caller knows which part of the body it asks for.
///
/// # Source
///
/// The multiple starts are those of SNARF [Chen et al. 2021]; the map is that of [`WeightGrid`]'s
/// weights.
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
        let near = |known: &Unposed| (known.point - root.0).norm() <= 10.0 * params.tolerance;
        if !roots.iter().any(near) {
            roots.push(Unposed { point: root.0, residual: root.1, joint });
        }
    }
    roots
}

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
        // Halved until it brings us nearer: across planes of the lattice the Jacobian jumps.
        let mut accepted = false;
        for _ in 0..6 {
            let next = grid.pose_with_jacobian(&(x + step), transforms);
            let left = (p - next.0).norm();
            if left < residual {
                (x, place, jacobian, residual) = (x + step, next.0, next.1, left);
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
pub(super) mod tests {
    use super::*;
    use crate::skin_weights::SkinWeights;
    use crate::skinning::WeightGridParams;
    use if_core::math::Vector;
    use nalgebra::{Translation3, UnitQuaternion};

    /// A tube along x with a joint in the origin that bends about z.
    pub(in crate::skinning) fn elbow_body() -> (Vec<Point>, SkinWeights) {
        let mut points = Vec::new();
        let mut weights = Vec::new();
        for i in -20..=20 {
            for k in 0..12 {
                let (s, c) = (Real::from(k) * std::f64::consts::TAU / 12.0).sin_cos();
                points.push(Point::new(0.02 * Real::from(i), 0.05 * c, 0.05 * s));
                let lower = (0.5 + 0.1 * i as f32).clamp(0.0, 1.0);
                weights.push([1.0 - lower, lower, 0.0, 0.0]);
            }
        }
        (points.clone(), SkinWeights::new(vec![[0, 1, 0, 0]; points.len()], weights, 2).unwrap())
    }

    /// Its two transforms at an angle.
    pub(in crate::skinning) fn elbow(angle: Real) -> Vec<Isometry3<Real>> {
        let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), angle);
        let moved = Translation3::new(0.2, 0.1, -0.3);
        vec![
            Isometry3::from_parts(moved, UnitQuaternion::identity()),
            Isometry3::from_parts(moved, turn),
        ]
    }

    #[test]
    fn posed_points_come_back() {
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
