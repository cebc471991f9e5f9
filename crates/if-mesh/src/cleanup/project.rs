//! Projection onto the zero set of a field.

use super::edit_mesh::EditMesh;
use super::patch::Patch;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};

/// Rounds of evening out the vertices of a projected patch.
const RELAXATIONS: usize = 10;
/// Newton steps to the field's zero set in each round. A distance needs one; a network's field, two
/// or three.
const STEPS: usize = 3;

/// Moves the inner vertices of the patch to the zero set of the field, evenly spaced.
pub(super) fn project(patch: &mut Patch, field: &dyn SignedDistance) {
    let boundary = patch.boundary;
    let size = if_core::aabb::Aabb::from_points(&patch.points).diagonal();
    let mut samples = vec![
        FieldSample { distance: 0.0, gradient: Vector::zeros() };
        patch.points.len() - boundary
    ];
    let mut onto = |points: &mut [Point]| {
        for _ in 0..STEPS {
            field.samples(&points[boundary..], &mut samples);
            for (p, s) in points[boundary..].iter_mut().zip(&samples) {
                if let Some(step) = newton(s, 0.5 * size) {
                    *p += step;
                }
            }
        }
    };
    onto(&mut patch.points);
    for _ in 0..RELAXATIONS {
        let mut sums = vec![(Vector::zeros(), 0.0); patch.points.len()];
        for t in &patch.triangles {
            for k in 0..3 {
                for j in [1, 2] {
                    sums[t[k] as usize].0 += patch.points[t[(k + j) % 3] as usize].coords;
                    sums[t[k] as usize].1 += 1.0;
                }
            }
        }
        for v in boundary..patch.points.len() {
            if sums[v].1 > 0.0 {
                let mean = Point::from(sums[v].0 / sums[v].1);
                patch.points[v] = nalgebra::center(&patch.points[v], &mean);
            }
        }
        onto(&mut patch.points);
    }
}

/// The step to φ = 0 along the gradient, at most `longest`; `None` where the field has no gradient
/// or is not finite.
pub(super) fn newton(sample: &FieldSample, longest: Real) -> Option<Vector> {
    let squared = sample.gradient.norm_squared();
    if !(squared > 1e-12 && squared.is_finite() && sample.distance.is_finite()) {
        return None; // a signed distance has 1
    }
    let step = -sample.gradient * (sample.distance / squared);
    let length = step.norm();
    Some(if length > longest { step * (longest / length) } else { step })
}

/// Moves the targets of `moving` vertices back to φ = 0, by at most the length of their move.
pub(super) fn project_back(
    work: &EditMesh,
    field: &dyn SignedDistance,
    target: &mut [Point],
    moving: &[u32],
) {
    for &v in moving {
        let p = &mut target[v as usize];
        let move_length = (*p - work.points[v as usize]).norm();
        if move_length > 0.0
            && let Some(step) = newton(&field.sample(p), move_length)
        {
            *p += step;
        }
    }
}
