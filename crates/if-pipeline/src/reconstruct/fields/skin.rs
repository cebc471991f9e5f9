//! Skinning weights near a skinned surface, with their slopes.

use if_body::SkinWeights;
use if_body::skinning::Affine;
use if_core::closest::ClosestPoint;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use nalgebra::Isometry3;

/// The weights around a point: linear, as in the nearest triangle of a surface.
#[derive(Clone, Debug)]
pub(super) struct Skin {
    /// The point.
    pub(super) at: Point,
    /// Joints, their weights at the point, and the slopes of the weights in 1/m, which sum to 0.
    pub(super) joints: Vec<(u16, Real, Vector)>,
}

impl Skin {
    /// The weights at the point of a surface nearest to `at`, with its slopes along the surface;
    /// across the surface weights are constant.
    pub(super) fn near(tree: &Bvh, surface: &TriMesh, skin: &SkinWeights, at: &Point) -> Self {
        let near =
            tree.closest(at, Real::INFINITY).expect("a surface with triangles has a nearest point");
        let t = near.triangle as usize;
        let slopes = slopes(surface.corners(t));
        let mut joints: Vec<(u16, Real, Vector)> = Vec::with_capacity(6);
        for ((v, b), slope) in surface.triangles()[t].iter().zip(near.barycentric).zip(slopes) {
            let v = *v as usize;
            for (j, w) in skin.joints()[v].iter().zip(skin.weights()[v]) {
                let w = Real::from(w);
                match joints.iter_mut().find(|s| s.0 == *j) {
                    Some(sum) => (sum.1, sum.2) = (sum.1 + b * w, sum.2 + slope * w),
                    None if w != 0.0 => joints.push((*j, b * w, slope * w)),
                    None => {}
                }
            }
        }
        Self { at: *at, joints }
    }

    /// The weights continued to `x`.
    pub(super) fn weights(&self, x: &Point) -> impl Iterator<Item = (usize, Real, &Vector)> {
        let step = x - self.at;
        self.joints.iter().map(move |(j, w, slope)| (usize::from(*j), w + slope.dot(&step), slope))
    }
}

/// The gradients of the barycentric coordinates of a triangle in its plane; zero if it is
/// degenerate.
fn slopes([a, b, c]: [&Point; 3]) -> [Vector; 3] {
    let normal = (b - a).cross(&(c - a));
    let square = normal.norm_squared();
    if square == 0.0 {
        return [Vector::zeros(); 3];
    }
    [(b, c), (c, a), (a, b)].map(|(from, to)| normal.cross(&(to - from)) / square)
}

/// The maps of single joints.
pub(super) fn joint_maps(transforms: &[Isometry3<Real>]) -> Vec<Affine> {
    let rigid = |t: &Isometry3<Real>| Affine {
        linear: t.rotation.to_rotation_matrix().into_inner(),
        offset: t.translation.vector,
    };
    transforms.iter().map(rigid).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes;

    #[test]
    fn slopes_are_those_of_the_weights_along_the_surface() {
        let ball = meshes::icosphere(0.5, 2);
        let share = |p: &Point| (0.5 + 0.7 * p.y - 0.2 * p.x) as f32;
        let weights = ball.vertices().iter().map(|p| [share(p), 1.0 - share(p), 0.0, 0.0]);
        let n = ball.vertices().len();
        let skin = SkinWeights::new(vec![[0, 1, 0, 0]; n], weights.collect(), 2).unwrap();
        let tree = Bvh::new(&ball);
        let [a, b, c] = ball.corners(7);
        let at = Point::from((a.coords + b.coords + c.coords) / 3.0);
        let near = Skin::near(&tree, &ball, &skin, &at);
        for step in [b - a, c - a] {
            let x = at + step * 0.05;
            let again = Skin::near(&tree, &ball, &skin, &x);
            let of = |skin: &Skin| skin.weights(&x).find(|w| w.0 == 0).map(|w| w.1).unwrap();
            approx::assert_relative_eq!(of(&near), of(&again), epsilon = 1e-9);
            approx::assert_relative_eq!(of(&near), Real::from(share(&x)), epsilon = 1e-6);
        }
        let sum: Vector = near.joints.iter().map(|j| j.2).sum();
        assert!(sum.norm() < 1e-6 && near.joints[0].2.dot(&(b - a).cross(&(c - a))).abs() < 1e-9);
        let flat = Point::origin();
        assert_eq!(slopes([&flat; 3]), [Vector::zeros(); 3]);
    }
}
