//! Displacements in the frames of the rest pose, in which those of different poses are comparable.

use super::outfit::SkinnedOutfit;
use if_body::Pose;
use if_body::skinning::{Affine, blends, pose_points};
use if_core::math::{Point, Vector, turned};
use if_core::nalgebra::Matrix3;

/// The maps of all vertices from the rest pose to another.
///
/// A displacement turns with the linear part A of its vertex, and keeps its length. The surface
/// itself gives no such frames: in folds its triangles turn over from one frame to the next, while
/// skinning is smooth in the pose.
#[derive(Debug)]
pub(super) struct PoseMaps(Vec<Affine>);

impl PoseMaps {
    /// One map for each vertex.
    pub(super) fn new(maps: Vec<Affine>) -> Self {
        Self(maps)
    }

    /// The maps of a pose that was checked against the skeleton.
    pub(super) fn of_pose(outfit: &SkinnedOutfit, pose: &Pose) -> Self {
        let transforms = outfit.skeleton.transforms(pose);
        Self(blends(outfit.skin(), &transforms.expect("poses were checked against the skeleton")))
    }

    /// `points` in the pose, one for each vertex of all layers.
    pub(super) fn posed(&self, points: &[Point]) -> Vec<Point> {
        pose_points(points, &self.0)
    }

    /// The displacements of `positions` from `target`, in the frames of the rest pose.
    pub(super) fn local(&self, target: &[Point], positions: &[Point]) -> Vec<Vector> {
        let one = |((map, t), p): ((&Affine, &Point), &Point)| {
            // A singular blend has no inverse, and such a vertex no frame.
            let back = map.linear.try_inverse().unwrap_or_else(Matrix3::identity);
            turned(&back, &(p - t))
        };
        self.0.iter().zip(target).zip(positions).map(one).collect()
    }

    /// `target` moved by displacements in the frames of the rest pose: the inverse of
    /// [`local`](Self::local).
    pub(super) fn displaced(&self, target: &[Point], displacements: &[Vector]) -> Vec<Point> {
        let one = |((map, t), u): ((&Affine, &Point), &Vector)| t + turned(&map.linear, u);
        self.0.iter().zip(target).zip(displacements).map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{motion, outfit};
    use super::*;

    #[test]
    fn displacements_turn_with_the_skeleton_and_back() {
        let outfit = outfit();
        let maps = PoseMaps::of_pose(&outfit, &motion(4).poses[3]);
        let rest = outfit.positions();
        let target = maps.posed(&rest);
        let shift = vec![Vector::new(1e-3, 2e-3, -1e-3); rest.len()];
        let moved = maps.displaced(&target, &shift);
        for (back, shift) in maps.local(&target, &moved).iter().zip(&shift) {
            assert!((back - shift).norm() < 1e-12, "{back}");
        }
        let turned = |v: &usize| ((moved[*v] - target[*v]) - shift[*v]).norm() > 1e-3;
        let count = (0..rest.len()).filter(turned).count();
        assert!(count > 50 && count < rest.len() / 2, "one leg turns, and nothing else: {count}");
    }
}
