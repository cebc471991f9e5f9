//! Linear blend skinning for bodies, clothes and the space around them.
//!
//! ```text
//! f(x) = Σ wⱼ(x) Sⱼ x = A x + b,     A = Σ wⱼ rotation(Sⱼ),  b = Σ wⱼ translation(Sⱼ)
//! ```
//!
//! The weights w belong to vertices ([`SkinWeights`]), where f is one [`Affine`] map, or to all of
//! canonical space ([`WeightGrid`]).

#[cfg(test)]
mod elbow;
mod grid;
mod transfer;

pub use grid::{WeightGrid, WeightGridParams};
pub use transfer::{Binding, transferred_weights};

use crate::skin_weights::SkinWeights;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use nalgebra::{Isometry3, Matrix3};
use rayon::prelude::*;

/// The map x ↦ A x + b of a point with fixed weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// A: a rotation if one joint has all the weight, else a blend of rotations, which shrinks.
    pub linear: Matrix3<Real>,
    /// b, in metres.
    pub offset: Vector,
}

impl Affine {
    const ZERO: Self = Self {
        linear: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        offset: Vector::new(0.0, 0.0, 0.0),
    };

    /// The map of a point that follows one joint.
    fn rigid(transform: &Isometry3<Real>) -> Self {
        let mut one = Self::ZERO;
        one.add(1.0, transform);
        one
    }

    /// The map with this linear part that takes `from` to `to`.
    pub(crate) fn through(linear: Matrix3<Real>, from: &Point, to: &Point) -> Self {
        Self { linear, offset: to.coords - linear * from.coords }
    }

    fn add(&mut self, weight: Real, transform: &Isometry3<Real>) {
        self.linear += transform.rotation.to_rotation_matrix().into_inner() * weight;
        self.offset += transform.translation.vector * weight;
    }

    /// The posed point of `p`.
    #[inline]
    pub fn point(&self, p: &Point) -> Point {
        Point::from(self.linear * p.coords + self.offset)
    }

    /// The unit normal of the posed surface, from that of the canonical one: A⁻ᵀ n. Zero if the
    /// blend is singular.
    pub fn normal(&self, n: &Vector) -> Vector {
        self.linear
            .try_inverse()
            .map_or(Vector::zeros(), |inverse| unit_or_zero(&(inverse.transpose() * n)))
    }
}

/// The map of each vertex: the joints' `transforms` ([`crate::Skeleton::transforms`]), blended by
/// its weights.
///
/// # Panics
///
/// If a joint of the weights has no transform.
pub fn blends(skin: &SkinWeights, transforms: &[Isometry3<Real>]) -> Vec<Affine> {
    let joints: Vec<Affine> = transforms.iter().map(Affine::rigid).collect();
    (0..skin.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|v| {
            let mut sum = Affine::ZERO;
            for (j, w) in skin.joints()[v].iter().zip(&skin.weights()[v]) {
                let w = Real::from(*w);
                if w != 0.0 {
                    let joint = &joints[usize::from(*j)];
                    sum.linear += joint.linear * w;
                    sum.offset += joint.offset * w;
                }
            }
            sum
        })
        .collect()
}

/// The posed points of vertices.
///
/// # Panics
///
/// If there is not one map for each vertex.
pub fn pose_points(points: &[Point], maps: &[Affine]) -> Vec<Point> {
    assert_eq!(points.len(), maps.len(), "one map for each point");
    points.iter().zip(maps).map(|(p, map)| map.point(p)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Pose;
    use crate::skeleton::{Joint, Skeleton};

    /// Three joints in two poses, with numbers from `skin_mats` and `lbs` of the project's
    /// `render_sequence.py`: heads (0, 1, 0), (0.1, 1.5, 0), (0.4, 1.4, 0.1); parents −1, 0, 1.
    fn posed() -> (Skeleton, Pose) {
        let joint = |name: &str, parent, head: [Real; 3]| Joint {
            name: name.into(),
            parent,
            head: head.into(),
            tail: head.into(),
        };
        let joints = vec![
            joint("a", None, [0.0, 1.0, 0.0]),
            joint("b", Some(0), [0.1, 1.5, 0.0]),
            joint("c", Some(1), [0.4, 1.4, 0.1]),
        ];
        let quaternions = [[0.8, 0.0, 0.6, 0.0], [0.5, 0.5, 0.5, -0.5], [0.6, 0.48, 0.0, 0.64]];
        let pose = Pose::from_quaternions(Vector::new(0.05, -0.1, 0.2), &quaternions).unwrap();
        (Skeleton::new(joints).unwrap(), pose)
    }

    #[test]
    fn poses_match_the_renderer() {
        let (skeleton, pose) = posed();
        let transforms = skeleton.transforms(&pose).unwrap();
        let skin = SkinWeights::new(
            vec![[0, 1, 2, 0], [2, 1, 0, 0]],
            vec![[0.25, 0.5, 0.25, 0.0], [1.0, 0.0, 0.0, 0.0]],
            3,
        )
        .unwrap();
        let points = [Point::new(0.3, 1.45, 0.05), Point::new(0.6, 1.2, 0.3)];
        let out = pose_points(&points, &blends(&skin, &transforms));
        let expected = EXPECTED.map(Point::from);
        for (a, b) in out.iter().zip(&expected) {
            approx::assert_relative_eq!(a, b, epsilon = 1e-9);
        }
    }

    const EXPECTED: [[Real; 3]; 2] =
        [[-0.061412, 1.3524, 0.079484], [-0.5117024, 1.18448, -0.0621632]];

    #[test]
    fn normals_stay_at_right_angles_to_what_is_posed_as_a_direction() {
        let (skeleton, pose) = posed();
        let maps = blends(
            &SkinWeights::new(
                vec![[0, 1, 2, 0]; 2],
                vec![[0.7, 0.2, 0.1, 0.0], [0.1, 0.0, 0.9, 0.0]],
                3,
            )
            .unwrap(),
            &skeleton.transforms(&pose).unwrap(),
        );
        let n = Vector::new(0.0, 0.6, 0.8);
        let tangent = Vector::new(0.3, 0.8, -0.6);
        for map in &maps {
            assert!(map.normal(&n).dot(&(map.linear * tangent)).abs() < 1e-12);
        }
        let flat = Affine { linear: Matrix3::zeros(), offset: Vector::zeros() };
        assert_eq!(flat.normal(&n), Vector::zeros());
    }
}
