//! Similarities between bodies, and the bone-wise start of a registration.

use super::{AlignError, BodyShape, heading};
use crate::skeleton::{Joint, SHORT};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use nalgebra::{Matrix3, Rotation3};

/// A similarity: y = s R (x − a) + b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Similarity {
    rotation: Rotation3<Real>,
    scale: Real,
    from: Point,
    to: Point,
}

/// Least number of common joints to estimate a rotation.
const LEAST_JOINTS: usize = 3;

impl Similarity {
    /// The least-squares similarity between the joints that have the same names on both bodies;
    /// without enough of them, the one without rotation that matches height, ground and centre.
    ///
    /// # Source
    ///
    /// Umeyama, *Least-squares estimation of transformation parameters between two point patterns*,
    /// 1991.
    ///
    /// # Errors
    ///
    /// A body has no height.
    pub(super) fn between(from: &BodyShape, to: &BodyShape) -> Result<Self, AlignError> {
        let (a, b) = (from.mesh.aabb(), to.mesh.aabb());
        let height = |aabb: &Aabb, which| {
            let height = if aabb.is_empty() { 0.0 } else { aabb.size().y };
            if height > 0.0 { Ok(height) } else { Err(AlignError::NoHeight { which, height }) }
        };
        let scale = height(&b, "target")? / height(&a, "source")?;
        let pairs = same_joints(from, to);
        if let Some(fit) = umeyama(&pairs) {
            return Ok(fit);
        }
        Ok(Self::standing(from.mesh, to.mesh, Rotation3::identity(), scale))
    }

    /// Where joints tell no rotation, that with the heading of the [surfaces](heading::of_surfaces).
    pub(super) fn faced(self, from: &BodyShape, to: &BodyShape) -> Self {
        if umeyama(&same_joints(from, to)).is_some() {
            return self;
        }
        let heading = heading::of_surfaces(from.mesh, to.mesh, self.scale);
        Self::standing(from.mesh, to.mesh, heading, self.scale)
    }

    /// The similarity of this rotation about the vertical and scale that matches ground and centre.
    pub(super) fn standing(
        from: &TriMesh,
        to: &TriMesh,
        rotation: Rotation3<Real>,
        scale: Real,
    ) -> Self {
        let foot = |aabb: &Aabb| Point::new(aabb.center().x, aabb.min.y, aabb.center().z);
        let turned: Vec<Point> = from.vertices().iter().map(|p| rotation * p).collect();
        let foot_of_turned = foot(&Aabb::from_points(&turned));
        Self { rotation, scale, from: rotation.inverse() * foot_of_turned, to: foot(&to.aabb()) }
    }

    /// The image of a point.
    #[inline]
    pub(super) fn point(&self, p: &Point) -> Point {
        self.to + self.rotation * (p - self.from) * self.scale
    }
}

/// Positions of the joints that have the same names on both bodies.
fn same_joints(from: &BodyShape, to: &BodyShape) -> Vec<(Point, Point)> {
    let (Some(a), Some(b)) = (from.skeleton, to.skeleton) else { return Vec::new() };
    let twin = |name: &str| b.joints().iter().find(|j| j.name == name);
    a.joints().iter().filter_map(|j| Some((j.head, twin(&j.name)?.head))).collect()
}

/// Length of a bone, as a share of the height of its body, from which on it says how a body stands: fingers and
/// toes do not.
const LONG: Real = 0.1;

/// The bone of `from` that points the farthest from where that of the same name on `to` does, and the angle in
/// radians, once both bodies face the same way; `None` without common long bones.
pub(super) fn most_turned(
    from: &BodyShape,
    to: &BodyShape,
    similarity: &Similarity,
) -> Option<(String, Real)> {
    let (a, b) = (from.skeleton?, to.skeleton?);
    let least = LONG * from.mesh.aabb().size().y;
    let turned = |joint: &Joint| {
        let twin = b.joints().iter().find(|t| t.name == joint.name)?;
        let (u, v) = (joint.tail - joint.head, twin.tail - twin.head);
        let is_long = u.norm() >= least && v.norm() >= SHORT;
        is_long.then(|| (joint.name.clone(), (similarity.rotation * u).angle(&v)))
    };
    a.joints().iter().filter_map(turned).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// The least-squares similarity of pairs of points.
fn umeyama(pairs: &[(Point, Point)]) -> Option<Similarity> {
    if pairs.len() < LEAST_JOINTS {
        return None;
    }
    let n = pairs.len() as Real;
    let from = Point::from(pairs.iter().map(|p| p.0.coords).sum::<Vector>() / n);
    let to = Point::from(pairs.iter().map(|p| p.1.coords).sum::<Vector>() / n);
    let spread = pairs.iter().map(|p| (p.0 - from).norm_squared()).sum::<Real>() / n;
    let product = |p: &(Point, Point)| (p.1 - to) * (p.0 - from).transpose();
    let covariance: Matrix3<Real> = pairs.iter().map(product).sum::<Matrix3<Real>>() / n;
    let svd = covariance.svd(true, true);
    let (u, v) = (svd.u?, svd.v_t?);
    // Collinear joints do not determine the rotation about their line.
    if spread <= 0.0 || svd.singular_values[1] <= 1e-9 * svd.singular_values[0] {
        return None;
    }
    let sign = if (u * v).determinant() < 0.0 { -1.0 } else { 1.0 };
    let flip = Vector::new(1.0, 1.0, sign);
    let rotation = Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&flip) * v);
    let scale = svd.singular_values.component_mul(&flip).sum() / spread;
    (scale > 0.0).then_some(Similarity { rotation, scale, from, to })
}

/// The start of a registration: vertices moved with the bones, if both bodies have bones of the same
/// names and the source has weights; else by the similarity.
pub(super) fn start(from: &BodyShape, to: &BodyShape, similarity: &Similarity) -> Vec<Point> {
    let all = || from.mesh.vertices().iter().map(|p| similarity.point(p)).collect();
    let (Some(a), Some(b), Some(skin)) = (from.skeleton, to.skeleton, from.skin) else {
        return all();
    };
    let facing = heading::of_trunk(&same_joints(from, to), to.mesh, similarity.scale);
    let bone = |k: usize| {
        let j = &a.joints()[k];
        let twin = b.joints().iter().find(|t| t.name == j.name)?;
        let (u, v) = (facing * (j.tail - j.head), twin.tail - twin.head);
        // Rigs without tails have bones of no length, which show neither direction nor scale.
        if u.norm().min(v.norm()) < SHORT {
            return None;
        }
        let rotation = Rotation3::rotation_between(&u, &v)? * facing;
        // The geometric mean: bones differ more in length than limbs do in girth.
        Some(Similarity {
            rotation,
            scale: (v.norm() / u.norm() * similarity.scale).sqrt(),
            from: j.head,
            to: twin.head,
        })
    };
    let bones: Vec<Similarity> = (0..a.len()).map(|k| bone(k).unwrap_or(*similarity)).collect();
    let blend = |(v, p): (usize, &Point)| {
        let record = skin.joints()[v].iter().zip(&skin.weights()[v]);
        let moved: Vector = record
            .map(|(j, w)| {
                bones.get(usize::from(*j)).unwrap_or(similarity).point(p).coords * Real::from(*w)
            })
            .sum();
        let total: Real = skin.weights()[v].iter().map(|w| Real::from(*w)).sum();
        if total > 0.5 { Point::from(moved / total) } else { similarity.point(p) }
    };
    from.mesh.vertices().iter().enumerate().map(blend).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exact_similarity_is_recovered() {
        let truth = Similarity {
            rotation: Rotation3::from_euler_angles(0.3, -0.7, 1.1),
            scale: 1.3,
            from: Point::new(0.1, 0.2, 0.3),
            to: Point::new(-1.0, 0.5, 2.0),
        };
        let points =
            [[0.0, 0.0, 0.0], [1.0, 0.2, 0.0], [0.3, 1.0, -0.4], [0.2, -0.5, 0.9], [0.7, 0.7, 0.1]];
        let pairs = points.map(Point::from).map(|p| (p, truth.point(&p)));
        for n in [3, 5] {
            let fit = umeyama(&pairs[..n]).unwrap();
            approx::assert_relative_eq!(fit.scale, 1.3, max_relative = 1e-12);
            for (p, q) in &pairs {
                approx::assert_relative_eq!(fit.point(p), *q, epsilon = 1e-12);
            }
        }
        // Joints in one plane, as those of a person nearly are: a turn, and no reflection in it.
        for k in 0..50 {
            let turn = Rotation3::from_euler_angles(Real::from(k), 0.7 * Real::from(k), 0.3);
            let flat = points.map(|[x, y, _]| Point::new(x, y, 0.0));
            let pairs: Vec<_> = flat.iter().map(|p| (*p, turn * p)).collect();
            let fit = umeyama(&pairs).unwrap();
            let above = Point::new(0.2, 0.3, 1.0);
            approx::assert_relative_eq!(fit.point(&above), turn * above, epsilon = 1e-9);
        }
        assert!(umeyama(&pairs[..2]).is_none());
        let line: Vec<(Point, Point)> =
            (0..5).map(|k| Point::new(0.0, Real::from(k), 0.0)).map(|p| (p, p)).collect();
        assert!(umeyama(&line).is_none());
        assert!(umeyama(&[(Point::origin(), Point::origin()); 5]).is_none());
    }
}
