//! Files whose rest pose is no upright person, or lies in other axes than the frames.

use super::*;
use std::f64::consts::FRAC_PI_2;

/// The skeleton and the poses with joints whose axes are turned by `turn` at rest.
fn turned(
    skeleton: &Skeleton,
    poses: &[Pose],
    turn: impl Fn(&Joint) -> UnitQuaternion<Real>,
) -> (Skeleton, Vec<Pose>) {
    let joints = skeleton.joints();
    let turns: Vec<UnitQuaternion<Real>> = joints.iter().map(turn).collect();
    let mut all: Vec<Joint> = Vec::new();
    for (j, joint) in joints.iter().enumerate() {
        let head = joint.parent.map_or(joint.head, |p| {
            all[p].head + turns[p].inverse() * (joint.head - joints[p].head)
        });
        let tail = head + turns[j].inverse() * (joint.tail - joint.head);
        all.push(Joint { head, tail, ..joint.clone() });
    }
    let poses = poses.iter().map(|pose| {
        let local = |(j, joint): (usize, &Joint)| {
            let above = joint.parent.map_or(UnitQuaternion::identity(), |p| turns[p].inverse());
            above * pose.rotations[j] * turns[j]
        };
        Pose { rotations: joints.iter().enumerate().map(local).collect(), ..pose.clone() }
    });
    (Skeleton::new(all).unwrap(), poses.collect())
}

fn assert_same(motion: &Motion, poses: &[Pose]) {
    for (a, b) in motion.poses.iter().zip(poses) {
        let moved = a.root_translation - b.root_translation;
        assert!(moved.norm() < 1e-9, "{moved}");
        assert!(a.largest_turn(b) < 1e-6, "{}", a.largest_turn(b));
    }
}

#[test]
fn a_frame_stands_for_a_rest_pose_that_is_no_person() {
    let skeleton = crate::mannequin::rig::skeleton();
    let mut poses = poses(&skeleton);
    // As when somebody stands still for a moment, turned a little to the side.
    let mut still = Pose::rest(skeleton.len());
    still.rotations[0] = UnitQuaternion::from_axis_angle(&Vector::y_axis(), 0.4);
    poses.push(still);
    poses.remove(0);
    let along = |j: &Joint| UnitQuaternion::rotation_between(&Vector::x(), &(j.tail - j.head));
    let (along_x, turned_poses) = turned(&skeleton, &poses, |j| along(j).unwrap());
    let text = written(&along_x, &turned_poses, 100.0);
    let motion = Motion::read(text.as_bytes(), &skeleton).unwrap();
    assert_eq!(motion.rest_frame, Some(poses.len() - 1));
    // The first frame is above the origin.
    let start = Vector::new(1.0, 0.0, 1.0).component_mul(&poses[0].root_translation);
    poses.iter_mut().for_each(|pose| pose.root_translation -= start);
    assert_same(&motion, &poses);
    assert_eq!(motion.every(2).rest_frame, motion.rest_frame);

    // Lying in all frames, and of no shape at rest.
    let down = UnitQuaternion::from_axis_angle(&Vector::z_axis(), FRAC_PI_2);
    let lying = turned_poses.iter().map(|pose| {
        let mut pose = pose.clone();
        pose.rotations[0] = down * pose.rotations[0];
        pose
    });
    let text = written(&along_x, &lying.collect::<Vec<_>>(), 100.0);
    let fault = Motion::read(text.as_bytes(), &skeleton).unwrap_err().to_string();
    assert!(fault.contains("y or z must be up"), "{fault}");
}

#[test]
fn frames_may_have_another_axis_up_than_the_rest_pose() {
    let skeleton = crate::mannequin::rig::skeleton();
    let (poses, root) = (poses(&skeleton), skeleton.joints()[0].head.coords);
    let up = UnitQuaternion::from_axis_angle(&Vector::x_axis(), FRAC_PI_2);
    // At rest y is up, and z in the frames.
    let lifted = |pose: &Pose| {
        let mut pose = pose.clone();
        pose.root_translation = up * (root + pose.root_translation) - root;
        pose.rotations[0] = up * pose.rotations[0];
        pose
    };
    let of = |poses: &[Pose]| written(&skeleton, poses, 3.0);
    let all: Vec<Pose> = poses.iter().map(lifted).collect();
    let motion = Motion::read(of(&all).as_bytes(), &skeleton).unwrap();
    assert_eq!(motion.rest_frame, None);
    assert_same(&motion, &poses);
    // The other way round: z at rest, and y in the frames.
    let (along_z, same) = turned(&skeleton, &poses, |_| up.inverse());
    let motion = Motion::read(written(&along_z, &same, 3.0).as_bytes(), &skeleton).unwrap();
    assert_same(&motion, &poses);

    // Who lies on the floor stays there: its hips are at no standing height along z,
    let lying = |pose: &Pose| {
        let mut pose = lifted(pose);
        pose.root_translation.z -= 0.7 * root.y;
        pose
    };
    let all: Vec<Pose> = poses.iter().map(lying).collect();
    let trunk = |motion: &Motion, k: usize| motion.poses[k].rotations[0] * Vector::y();
    let motion = Motion::read(of(&all).as_bytes(), &skeleton).unwrap();
    assert!((0..all.len()).all(|k| trunk(&motion, k).y < 0.7));
    // and so does who stands up at the end.
    let all: Vec<Pose> = poses[1..].iter().map(lifted).chain([poses[0].clone()]).collect();
    let motion = Motion::read(of(&all).as_bytes(), &skeleton).unwrap();
    assert!(trunk(&motion, 0).y < 0.7 && trunk(&motion, 3).y > 0.99);
}

/// The skeleton as it stands in a pose.
fn posed(skeleton: &Skeleton, pose: &Pose) -> Skeleton {
    let frames = skeleton.frames(pose).unwrap();
    let at = |(j, joint): (usize, &Joint)| Joint {
        head: frames[j].translation.vector.into(),
        tail: frames[j] * Point::from(joint.tail - joint.head),
        ..joint.clone()
    };
    Skeleton::new(skeleton.joints().iter().enumerate().map(at).collect()).unwrap()
}

#[test]
fn a_body_that_faces_anywhere_is_turned_as_a_whole() {
    let skeleton = crate::mannequin::rig::skeleton();
    let poses = poses(&skeleton);
    let text = written(&skeleton, &poses, 100.0);
    for degrees in [3.0, 10.0, 45.0, 90.0, 130.0, -20.0] {
        let turn = UnitQuaternion::from_axis_angle(&Vector::y_axis(), Real::to_radians(degrees));
        let mut faced = Pose::rest(skeleton.len());
        faced.rotations[0] = turn;
        let motion = Motion::read(text.as_bytes(), &posed(&skeleton, &faced)).unwrap();
        // In each frame the bones of the file are turned from the body's by the same turn.
        for (a, b) in motion.poses.iter().zip(&poses) {
            let mut above = a.clone();
            above.rotations.iter_mut().for_each(|r| *r = turn.inverse() * *r * turn);
            above.rotations[0] = turn * above.rotations[0];
            let off = above.largest_turn(b);
            assert!(off < 1e-6, "{degrees}: {off}");
        }
    }
}

#[test]
fn a_rest_pose_in_a_stride_faces_as_the_body() {
    let skeleton = crate::mannequin::rig::skeleton();
    let mut stride = Pose::rest(skeleton.len());
    let mut turn = |name: &str, axis, angle| {
        let j = skeleton.names().position(|n| n == name).unwrap();
        stride.rotations[j] = UnitQuaternion::from_axis_angle(&axis, angle);
    };
    // An arm is forward, a leg back, and the shoulders are turned from the hips.
    turn("left_arm", Vector::y_axis(), -1.2);
    turn("right_thigh", Vector::x_axis(), 0.4);
    turn("spine", Vector::y_axis(), 0.2);
    let file = posed(&skeleton, &stride);
    let text = written(&file, &[Pose::rest(skeleton.len())], 1.0);
    let motion = Motion::read(text.as_bytes(), &skeleton).unwrap();
    let turned = motion.poses[0].rotations[0].angle();
    assert!(turned < 1e-9, "{turned}");
}

#[test]
fn last_bones_that_lead_elsewhere_are_no_bones() {
    let skeleton = crate::mannequin::rig::skeleton();
    // To the face, and down to the sole.
    let aside = |j: &Joint| {
        let along = match j.name.as_str() {
            "head" => Vector::new(0.0, 0.02, 0.1),
            "left_foot" | "right_foot" => Vector::new(0.0, (j.tail - j.head).y, 0.0),
            _ => return j.clone(),
        };
        Joint { tail: j.head + along, ..j.clone() }
    };
    let file = Skeleton::new(skeleton.joints().iter().map(aside).collect()).unwrap();
    let poses = poses(&skeleton);
    let motion = Motion::read(written(&file, &poses, 1.0).as_bytes(), &skeleton).unwrap();
    assert_same(&motion, &poses);
}
