//! The skeleton, skinning weights and poses of the mannequin.

use crate::mannequin::figure::{ELBOW, LEG, SHOULDER, WRIST};
use crate::pose::Pose;
use crate::skeleton::{Joint, Skeleton};
use crate::skin_weights::SkinWeights;
use if_core::math::{Point, Real, Vector};
use nalgebra::UnitQuaternion;
use std::f64::consts::TAU;

/// Name, parent, head and tail of each bone.
fn bones() -> Vec<(&'static str, Option<usize>, Point, Point)> {
    let middle = |y: Real, z: Real| Point::new(0.0, y, z);
    let hand = WRIST + (WRIST - ELBOW) * 0.4;
    let toe = Point::new(0.136, 0.014, 0.136);
    vec![
        ("hips", None, middle(0.90, -0.010), middle(1.02, -0.004)),
        ("spine", Some(0), middle(1.02, -0.004), middle(1.40, -0.020)),
        ("head", Some(1), middle(1.44, -0.022), middle(1.66, 0.008)),
        ("left_arm", Some(1), SHOULDER, ELBOW),
        ("left_forearm", Some(3), ELBOW, hand),
        ("right_arm", Some(1), mirrored(SHOULDER), mirrored(ELBOW)),
        ("right_forearm", Some(5), mirrored(ELBOW), mirrored(hand)),
        ("left_thigh", Some(0), LEG[0], LEG[1]),
        ("left_shin", Some(7), LEG[1], LEG[2]),
        ("left_foot", Some(8), LEG[2], toe),
        ("right_thigh", Some(0), mirrored(LEG[0]), mirrored(LEG[1])),
        ("right_shin", Some(10), mirrored(LEG[1]), mirrored(LEG[2])),
        ("right_foot", Some(11), mirrored(LEG[2]), mirrored(toe)),
    ]
}

fn mirrored(p: Point) -> Point {
    Point::new(-p.x, p.y, p.z)
}

/// 13 joints: hips, spine, head, arms, forearms with the hands, thighs, shins and feet.
pub fn skeleton() -> Skeleton {
    let joint = |(name, parent, head, tail): (&str, Option<usize>, Point, Point)| Joint {
        name: name.into(),
        parent,
        head,
        tail,
    };
    Skeleton::new(bones().into_iter().map(joint).collect())
        .expect("parents come before children, and names are unique")
}

/// Exponent of the decay of weights with distance. With 4 the torso pulls the arms along, with 16
/// joints are sharp.
const POWER: i32 = 8;
/// Least distance to a bone, in metres: no distance is zero.
const THICKNESS: Real = 0.02;

/// Weights by the distance to the four nearest bones: equal for skin and cloth at one position, so
/// that layers move together.
pub fn skin_weights(rest: &[Point]) -> SkinWeights {
    let bones = bones();
    let (mut joints, mut weights) =
        (Vec::with_capacity(rest.len()), Vec::with_capacity(rest.len()));
    for p in rest {
        let mut near: Vec<(Real, u16)> = bones
            .iter()
            .zip(0..)
            .map(|((_, _, a, b), joint)| (to_segment(p, a, b).max(THICKNESS), joint))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let least = near[0].0;
        let share: Vec<Real> = near[..4].iter().map(|(d, _)| (least / d).powi(POWER)).collect();
        let sum: Real = share.iter().sum();
        joints.push([0, 1, 2, 3].map(|k| near[k].1));
        weights.push([0, 1, 2, 3].map(|k| (share[k] / sum) as f32));
    }
    SkinWeights::new(joints, weights, bones.len())
        .expect("every bone is a joint, and weights sum to one")
}

fn to_segment(p: &Point, a: &Point, b: &Point) -> Real {
    let along = b - a;
    let s = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (p - (a + along * s)).norm()
}

/// The pose in one of `frames` frames of a full turn about the y axis, with slightly swinging arms
/// and swaying body.
pub fn turning_pose(frame: usize, frames: usize) -> Pose {
    let phase = TAU * frame as Real / frames.max(1) as Real;
    let skeleton = skeleton();
    let mut pose = Pose::rest(skeleton.len());
    let mut turn = |name: &str, axis: Vector, angle: Real| {
        let joint = skeleton
            .names()
            .position(|n| n == name)
            .expect("joints that are turned are in the skeleton");
        pose.rotations[joint] *= UnitQuaternion::new(axis * angle);
    };
    turn("hips", Vector::y(), phase);
    turn("spine", Vector::z(), 0.03 * (2.0 * phase).sin());
    turn("spine", Vector::x(), 0.02 * (3.0 * phase + 1.0).sin());
    turn("head", Vector::y(), 0.10 * (phase + 0.5).sin());
    // Arms hang lower than in rest, by 9°, and swing.
    turn("left_arm", Vector::z(), -0.15 + 0.06 * (2.0 * phase).sin());
    turn("right_arm", Vector::z(), 0.15 + 0.06 * (2.0 * phase + 0.7).sin());
    turn("left_forearm", Vector::x(), -0.12 - 0.08 * phase.sin());
    turn("right_forearm", Vector::x(), -0.12 + 0.08 * phase.sin());
    turn("left_thigh", Vector::z(), 0.02 * (phase + 0.3).sin());
    turn("right_thigh", Vector::z(), 0.02 * (phase + 1.3).sin());
    pose
}

/// The pose in one of `frames` frames of two steps on the spot: legs and arms swing against each
/// other.
pub fn walking_pose(frame: usize, frames: usize) -> Pose {
    let phase = TAU * frame as Real / frames.max(1) as Real;
    let skeleton = skeleton();
    let mut pose = Pose::rest(skeleton.len());
    let mut turn = |name: &str, axis: Vector, angle: Real| {
        let joint = skeleton.names().position(|n| n == name).expect("a joint of the skeleton");
        pose.rotations[joint] *= UnitQuaternion::new(axis * angle);
    };
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let swing = sign * phase.sin();
        turn(&format!("{side}_thigh"), Vector::x(), -0.1 - 0.3 * swing);
        // The knee bends while the leg swings forwards.
        let lifted = (sign * phase.cos()).max(0.0);
        turn(&format!("{side}_shin"), Vector::x(), 0.15 + 0.5 * lifted);
        turn(&format!("{side}_arm"), Vector::z(), -0.2 * sign);
        turn(&format!("{side}_arm"), Vector::x(), 0.3 * swing);
        turn(&format!("{side}_forearm"), Vector::x(), -0.3 + 0.1 * swing);
    }
    turn("spine", Vector::y(), 0.06 * phase.sin());
    pose
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hand_follows_the_forearm_and_the_navel_no_limb() {
        let skeleton = skeleton();
        let skin =
            skin_weights(&[WRIST, Point::new(0.0, 1.10, 0.09), Point::new(-0.102, 0.47, 0.05)]);
        let weight = |v: usize, name: &str| {
            let joint = skeleton.names().position(|n| n == name).unwrap();
            (0..4)
                .filter(|k| usize::from(skin.joints()[v][*k]) == joint)
                .map(|k| skin.weights()[v][k])
                .sum::<f32>()
        };
        assert!(weight(0, "left_forearm") > 0.99);
        assert!(weight(1, "spine") + weight(1, "hips") > 0.98);
        assert!(
            (weight(2, "right_thigh") - weight(2, "right_shin")).abs() < 0.1,
            "the knee is both's"
        );
    }

    #[test]
    fn steps_alternate() {
        let skeleton = skeleton();
        let foot = |frame: usize, name: &str| {
            let joint = skeleton.names().position(|n| n == name).unwrap();
            skeleton.frames(&walking_pose(frame, 8)).unwrap()[joint].translation.vector
        };
        // One foot is in front, then the other; a foot that swings is lifted.
        let ahead = |frame| foot(frame, "left_foot").z - foot(frame, "right_foot").z;
        assert!(ahead(2) > 0.3 && ahead(6) < -0.3, "{} {}", ahead(2), ahead(6));
        assert!(foot(0, "left_foot").y > foot(0, "right_foot").y + 0.02);
        assert!((walking_pose(8, 8).largest_turn(&walking_pose(0, 8))) < 1e-9);
    }

    #[test]
    fn a_turn_ends_where_it_begins_and_the_feet_stay_on_the_floor() {
        let skeleton = skeleton();
        let (first, last) = (turning_pose(0, 12), turning_pose(12, 12));
        for (a, b) in first.rotations.iter().zip(&last.rotations) {
            assert!(a.angle_to(b) < 1e-6);
        }
        for frame in 0..12 {
            let foot = skeleton.transforms(&turning_pose(frame, 12)).unwrap()[9]
                * Point::new(0.13, 0.0, 0.05);
            assert!(foot.y.abs() < 0.01, "{foot}");
        }
    }
}
