mod gltf;
mod standing;

use super::*;
use crate::skeleton::Joint;
use if_core::math::Point;

fn skeleton() -> Skeleton {
    let joint = |name: &str, parent| Joint {
        name: name.into(),
        parent,
        head: Point::origin(),
        tail: Point::new(0.0, 1.0, 0.0),
    };
    Skeleton::new(vec![joint("hips", None), joint("knee", Some(0))]).unwrap()
}

fn read(joints: &str, frames: &str) -> Result<Motion, MotionError> {
    let text = format!(r#"{{"fps": 24, "joints": {joints}, "frames": {frames}}}"#);
    Motion::read(text.as_bytes(), &skeleton())
}

const JOINTS: &str = r#"["hips", "knee"]"#;
const FRAME: &str = r#"{"root_t": [0, 1, 2], "rot": [[1, 0, 0, 0], [0, 1, 0, 0]]}"#;

#[test]
fn a_motion_has_a_pose_for_each_frame() {
    let motion = read(JOINTS, &format!("[{FRAME}, {FRAME}, {FRAME}]")).unwrap();
    assert_eq!((motion.frames_per_second, motion.poses.len()), (24.0, 3));
    assert_eq!(motion.poses[1].root_translation, Vector::new(0.0, 1.0, 2.0));
    assert_eq!(motion.poses[1].quaternions()[1], [0.0, 1.0, 0.0, 0.0]);
    let half = motion.every(2);
    assert_eq!((half.frames_per_second, half.poses.len()), (12.0, 2));
}

#[test]
fn a_motion_lists_its_joints_in_any_order() {
    let turned = r#"[{"root_t": [0, 1, 2], "rot": [[0, 1, 0, 0], [1, 0, 0, 0]]}]"#;
    let expected = read(JOINTS, &format!("[{FRAME}]")).unwrap();
    assert_eq!(read(r#"["knee", "hips"]"#, turned).unwrap(), expected);
}

#[test]
fn what_cannot_be_read_is_not_made_or_written() {
    assert!(matches!(Motion::new(24.0, vec![]), Err(MotionError::Empty)));
    for rate in [-5.0, 0.0, Real::NAN, Real::INFINITY] {
        assert!(matches!(Motion::new(rate, vec![Pose::rest(2)]), Err(MotionError::Rate(_))));
    }
    let fine = Motion::new(24.0, vec![Pose::rest(2); 2]).unwrap();
    let mut text = Vec::new();
    fine.write(&mut text, &skeleton()).unwrap();
    assert_eq!(Motion::read(text.as_slice(), &skeleton()).unwrap(), fine);
    let refused = |spoil: fn(&mut Motion), expected: &str| {
        let (mut motion, mut out) = (fine.clone(), Vec::new());
        spoil(&mut motion);
        let error = motion.write(&mut out, &skeleton()).unwrap_err();
        assert!(error.to_string().contains(expected) && out.is_empty(), "{error}");
    };
    refused(|m| m.poses[1].root_translation.x = Real::NAN, "frame 1 of the motion");
    refused(|m| m.poses[1] = Pose::rest(3), "3 rotations for 2 joints");
    refused(|m| m.frames_per_second = Real::NAN, "NaN frames per second");
    refused(|m| m.poses.clear(), "no frames");
}

#[test]
fn invalid_motions_are_errors_that_name_the_place() {
    let error = |joints: &str, frames: &str| read(joints, frames).unwrap_err().to_string();
    let frames = format!("[{FRAME}]");
    let table = [
        (
            r#"["hips", "elbow"]"#,
            frames.as_str(),
            "lacks the joint `knee`; a motion in JSON has each joint of the skeleton once, by its name and in any order: hips, knee",
        ),
        (r#"["hips"]"#, &frames, "the motion lacks the joint `knee`"),
        (r#"["hips", "knee", "toe"]"#, &frames, "the skeleton lacks the joint `toe`"),
        (r#"["hips", "knee", "hips"]"#, &frames, "the motion lists twice the joint `hips`"),
        (JOINTS, "[]", "no frames"),
        (JOINTS, r#"[{"root_t": [0, 0, 0], "rot": [[1, 0, 0, 0]]}]"#, "frame 0"),
        (JOINTS, r#"[{"root_t": [0, 0, 0], "rot": [[1, 0, 0, 0], [2, 0, 0, 0]]}]"#, "rotation 1"),
        (JOINTS, r#"[{"root_t": [0, 0, 1e300], "rot": [[1, 0, 0, 0], [1, 0, 0, 0]]}]"#, "frame 0"),
        (JOINTS, r#"[{"root_t": [NaN, 0, 0], "rot": []}]"#, "docs/animate.md"),
    ];
    for (joints, frames, expected) in table {
        let found = error(joints, frames);
        assert!(found.contains(expected), "{found}");
    }
    let text = format!(r#"{{"fps": 0, "joints": {JOINTS}, "frames": {frames}}}"#);
    assert!(matches!(
        Motion::read(text.as_bytes(), &skeleton()),
        Err(MotionError::Rate(rate)) if rate == 0.0
    ));
}

/// A BVH file of the skeleton in some poses, with all offsets multiplied by `scale`.
fn written(skeleton: &Skeleton, poses: &[Pose], scale: Real) -> String {
    fn write_joint(skeleton: &Skeleton, j: usize, scale: Real, text: &mut String) {
        let joints = skeleton.joints();
        let parent = joints[j].parent;
        let offset = parent.map_or(Vector::zeros(), |p| joints[j].head - joints[p].head) * scale;
        let kind = if parent.is_some() { "JOINT" } else { "ROOT" };
        let channels = match parent {
            None => "6 Xposition Yposition Zposition Zrotation Yrotation Xrotation",
            Some(_) => "3 Zrotation Yrotation Xrotation",
        };
        let [x, y, z]: [Real; 3] = offset.into();
        let name = &joints[j].name;
        *text += &format!("{kind} {name}\n{{\nOFFSET {x} {y} {z}\nCHANNELS {channels}\n");
        let mut children = (0..joints.len()).filter(|c| joints[*c].parent == Some(j)).peekable();
        if children.peek().is_none() {
            let end = (joints[j].tail - joints[j].head) * scale;
            *text += &format!("End Site\n{{\nOFFSET {} {} {}\n}}\n", end.x, end.y, end.z);
        }
        children.for_each(|c| write_joint(skeleton, c, scale, text));
        *text += "}\n";
    }
    /// The order of the hierarchy: each joint is followed by all that is below it.
    fn order(skeleton: &Skeleton, j: usize, list: &mut Vec<usize>) {
        list.push(j);
        let joints = skeleton.joints();
        (0..joints.len())
            .filter(|c| joints[*c].parent == Some(j))
            .for_each(|c| order(skeleton, c, list));
    }
    let mut text = String::from("HIERARCHY\n");
    write_joint(skeleton, 0, scale, &mut text);
    text += &format!("MOTION\nFrames: {}\nFrame Time: 0.04\n", poses.len());
    let mut list = Vec::new();
    order(skeleton, 0, &mut list);
    for pose in poses {
        let p = (pose.root_translation + skeleton.joints()[0].head.coords) * scale;
        text += &format!("{} {} {}", p.x, p.y, p.z);
        for j in &list {
            let (x, y, z) = pose.rotations[*j].euler_angles();
            text += &format!(" {} {} {}", z.to_degrees(), y.to_degrees(), x.to_degrees());
        }
        text += "\n";
    }
    text
}

/// Where all joints are in a frame.
fn heads(skeleton: &Skeleton, pose: &Pose) -> Vec<Point> {
    skeleton.frames(pose).unwrap().iter().map(|g| g.translation.vector.into()).collect()
}

/// Poses of the mannequin: still, and with all joints turned.
fn poses(skeleton: &Skeleton) -> Vec<Pose> {
    let turned = |k: usize| {
        let angle = |j: usize, axis: usize| 0.3 * ((1 + k + 3 * j + 5 * axis) as Real).sin();
        let turn = |j| UnitQuaternion::from_euler_angles(angle(j, 0), angle(j, 1), angle(j, 2));
        let root_translation = Vector::new(0.1, 0.02, -0.3) * k as Real;
        Pose { root_translation, rotations: (0..skeleton.len()).map(turn).collect() }
    };
    std::iter::once(Pose::rest(skeleton.len())).chain((1..4).map(turned)).collect()
}

#[test]
fn a_motion_of_the_same_skeleton_in_other_units_comes_back_from_bvh() {
    let skeleton = crate::mannequin::rig::skeleton();
    let poses = poses(&skeleton);
    for scale in [1.0, 39.37] {
        let text = written(&skeleton, &poses, scale);
        let motion = Motion::read(text.as_bytes(), &skeleton).unwrap();
        assert_eq!((motion.frames_per_second, motion.unmatched.len()), (25.0, 0));
        for (a, b) in motion.poses.iter().zip(&poses) {
            let moved = a.root_translation - b.root_translation;
            assert!(moved.norm() < 1e-9, "{moved}");
            assert!(a.largest_turn(b) < 1e-7, "{}", a.largest_turn(b));
        }
    }
    // A body about the origin stays where it is: what is lowest is its floor.
    let lowered = |j: &Joint| {
        let down = Vector::new(0.0, -0.8, 0.0);
        Joint { head: j.head + down, tail: j.tail + down, ..j.clone() }
    };
    let low = Skeleton::new(skeleton.joints().iter().map(lowered).collect()).unwrap();
    let motion = Motion::read(written(&skeleton, &poses, 1.0).as_bytes(), &low).unwrap();
    assert!(motion.poses[0].root_translation.y.abs() < 0.02);
}

#[test]
fn files_with_z_up_stand() {
    let skeleton = crate::mannequin::rig::skeleton();
    let poses = poses(&skeleton);
    // Blender's axes: z is up, and y points backwards.
    let swap = |line: &str| match line.split(' ').collect::<Vec<_>>()[..] {
        ["OFFSET", x, y, z] => format!("OFFSET {x} {} {y}", -z.parse::<Real>().unwrap()),
        ["CHANNELS", "6", ..] => {
            "CHANNELS 6 Xposition Yposition Zposition Yrotation Zrotation Xrotation".into()
        }
        ["CHANNELS", "3", ..] => "CHANNELS 3 Yrotation Zrotation Xrotation".into(),
        _ => line.to_owned(),
    };
    // What turns about z by an angle turns about -y by it.
    let swapped = |row: &str| {
        let v: Vec<Real> = row.split(' ').map(|v| v.parse().unwrap()).collect();
        let turns = v[3..].chunks(3).flat_map(|t| [-t[0], t[1], t[2]]);
        let all: Vec<String> =
            [v[0], -v[2], v[1]].into_iter().chain(turns).map(|v| v.to_string()).collect();
        all.join(" ")
    };
    let text = written(&skeleton, &poses, 10.0);
    let (hierarchy, rows) = text.split_once("Frame Time: 0.04\n").unwrap();
    let hierarchy: Vec<String> = hierarchy.lines().map(swap).collect();
    let rows: Vec<String> = rows.lines().map(swapped).collect();
    let text = format!("{}\nFrame Time: 0.04\n{}\n", hierarchy.join("\n"), rows.join("\n"));
    let motion = Motion::read(text.as_bytes(), &skeleton).unwrap();
    for (a, b) in motion.poses.iter().zip(&poses) {
        let moved = a.root_translation - b.root_translation;
        assert!(moved.norm() < 1e-9, "{moved}");
        assert!(a.largest_turn(b) < 1e-7, "{}", a.largest_turn(b));
    }
    // Head down, it stands along no axis.
    let down = |line: &str| match line.split(' ').collect::<Vec<_>>()[..] {
        ["OFFSET", x, y, z] => format!("OFFSET {x} {y} {}", -z.parse::<Real>().unwrap()),
        _ => line.to_owned(),
    };
    let text: Vec<String> = text.lines().map(down).collect();
    let fault = Motion::read(text.join("\n").as_bytes(), &skeleton).unwrap_err().to_string();
    assert!(fault.contains("y or z must be up"), "{fault}");
}

#[test]
fn joints_above_the_hips_are_no_hips() {
    let skeleton = crate::mannequin::rig::skeleton();
    let poses = poses(&skeleton);
    // As in many rigs of games: a root on the floor.
    let root = Joint {
        name: "root".into(),
        parent: None,
        head: Point::origin(),
        tail: Point::new(0.0, 0.1, 0.0),
    };
    let below = |j: &Joint| Joint { parent: Some(j.parent.map_or(0, |p| p + 1)), ..j.clone() };
    let all = std::iter::once(root).chain(skeleton.joints().iter().map(below));
    let rooted = Skeleton::new(all.collect()).unwrap();
    let with_root = |pose: &Pose| Pose {
        root_translation: pose.root_translation,
        rotations: [&[UnitQuaternion::identity()], &pose.rotations[..]].concat(),
    };
    let rooted_poses: Vec<Pose> = poses.iter().map(with_root).collect();
    let (plain, with_root) =
        (written(&skeleton, &poses, 2.0), written(&rooted, &rooted_poses, 2.0));
    // The hips have the channels of positions, and the root none; no row changes.
    let moved = plain.replacen("ROOT", "ROOT reference\n{\nOFFSET 0 0 0\nCHANNELS 0\nJOINT", 1);
    let moved = moved.replacen("MOTION", "}\nMOTION", 1);
    for text in [&plain, &with_root, &moved] {
        for (skeleton, poses) in [(&skeleton, &poses), (&rooted, &rooted_poses)] {
            let motion = Motion::read(text.as_bytes(), skeleton).unwrap();
            assert_eq!(motion.unmatched, [""; 0]);
            for (a, b) in motion.poses.iter().zip(poses) {
                let moved = a.root_translation - b.root_translation;
                assert!(moved.norm() < 1e-9, "{moved}");
                assert!(a.largest_turn(b) < 1e-7, "{}", a.largest_turn(b));
            }
        }
    }
    // Channels after a child, and twice.
    let (before, after) = plain.split_once("CHANNELS 6").unwrap();
    let (list, rest) = after.split_once('\n').unwrap();
    let (joints, frames) = rest.split_once("}\nMOTION").unwrap();
    let late = format!("{before}{joints}CHANNELS 6{list}\n}}\nMOTION{frames}");
    let rows = late.split("0.04\n").last().unwrap().lines();
    let turned = rows.map(|row| {
        let values: Vec<&str> = row.split(' ').collect();
        [&values[6..], &values[..6]].concat().join(" ")
    });
    let rows: Vec<String> = turned.collect();
    let late = format!("{}0.04\n{}\n", late.split("0.04\n").next().unwrap(), rows.join("\n"));
    let motion = Motion::read(late.as_bytes(), &skeleton).unwrap();
    assert!((motion.poses[3].root_translation - poses[3].root_translation).norm() < 1e-9);
    let twice = plain.replacen("JOINT", "CHANNELS 0\nJOINT", 1);
    let fault = Motion::read(twice.as_bytes(), &skeleton).unwrap_err().to_string();
    assert!(fault.contains("found `CHANNELS`"), "{fault}");
}

#[test]
fn bones_point_where_those_of_a_skeleton_with_another_rest_pose_point() {
    let skeleton = crate::mannequin::rig::skeleton();
    // The same person in another rest pose: arms and legs spread, faced to its left, other names.
    let mut spread = Pose::rest(skeleton.len());
    let quarter = UnitQuaternion::from_euler_angles(0.0, std::f64::consts::FRAC_PI_2, 0.0);
    spread.rotations[0] = quarter;
    for (name, angle) in [("left_arm", 0.8), ("right_arm", -0.8), ("left_thigh", 0.2)] {
        let j = skeleton.names().position(|n| n == name).unwrap();
        spread.rotations[j] = UnitQuaternion::from_euler_angles(0.1, 0.2, angle);
    }
    let frames = skeleton.frames(&spread).unwrap();
    let renamed = |name: &str| match name.split_once('_') {
        Some((side, "thigh")) => format!("rig:{}UpLeg", capital(side)),
        Some((side, "shin")) => format!("rig:{}Leg", capital(side)),
        Some((side, part)) => format!("{part}.{}", &side[..1]),
        None => name.to_uppercase(),
    };
    fn capital(side: &str) -> String {
        side[..1].to_uppercase() + &side[1..]
    }
    let at = |(j, joint): (usize, &Joint)| {
        let head = frames[j].translation.vector.into();
        let tail = frames[j] * Point::from(joint.tail - joint.head);
        Joint { name: renamed(&joint.name), parent: joint.parent, head, tail }
    };
    let other = Skeleton::new(skeleton.joints().iter().enumerate().map(at).collect()).unwrap();
    let poses = poses(&skeleton);
    let text = written(&other, &poses, 100.0);
    let motion = Motion::read(text.as_bytes(), &skeleton).unwrap();
    assert_eq!(motion.unmatched, [""; 0]);
    for (a, b) in motion.poses.iter().zip(&poses) {
        let (ours, theirs) = (heads(&skeleton, a), heads(&other, b));
        for (j, joint) in skeleton.joints().iter().enumerate() {
            let children = skeleton.joints().iter().filter(|c| c.parent == Some(j)).count();
            let Some(p) = joint.parent else { continue };
            // Where bones branch the rest poses are alike, but for the quarter turn.
            let siblings = skeleton.joints().iter().filter(|c| c.parent == Some(p)).count();
            if siblings == 1 {
                let [d, e] = [&ours, &theirs].map(|x| (x[j] - x[p]).normalize());
                assert!((d - e).norm() < 1e-9, "{} {children}: {d} {e}", joint.name);
            }
        }
    }
    // The pelvis is turned as that of the file, from where that faces.
    let moved = &motion.poses[0].rotations[0];
    assert!(moved.angle_to(&quarter) < 1e-9, "{moved}");
}

/// A leg and an arm: names, parents, and where joints are.
fn half(names: [&str; 10]) -> Vec<Joint> {
    let places = [
        [0.0, 1.0, 0.0],
        [0.1, 0.95, 0.0],
        [0.1, 0.5, 0.0],
        [0.1, 0.08, 0.0],
        [0.1, 0.02, 0.12],
        [0.0, 1.2, 0.0],
        [0.03, 1.4, 0.0],
        [0.2, 1.42, 0.0],
        [0.45, 1.42, 0.0],
        [0.7, 1.42, 0.0],
    ];
    let joint = |(k, name): (usize, &str)| Joint {
        name: name.into(),
        parent: if k == 5 { Some(0) } else { k.checked_sub(1) },
        head: places[k].into(),
        tail: Point::from(places[k]) + Vector::new(0.1, 0.0, 0.0),
    };
    names.into_iter().enumerate().map(joint).collect()
}

const CMU: [&str; 10] = [
    "Hips",
    "LeftUpLeg",
    "LeftLeg",
    "LeftFoot",
    "LeftToeBase",
    "Spine",
    "LeftShoulder",
    "LeftArm",
    "LeftForeArm",
    "LeftHand",
];
const SMPL: [&str; 10] = [
    "pelvis",
    "left_hip",
    "left_knee",
    "left_ankle",
    "left_foot",
    "spine",
    "left_collar",
    "left_shoulder",
    "left_elbow",
    "left_wrist",
];

#[test]
fn joints_are_named_by_several_conventions() {
    let mut smpl = half(SMPL);
    let palm = Joint { name: "left_hand".into(), parent: Some(9), ..smpl[9].clone() };
    smpl.push(Joint { head: palm.head + Vector::new(0.08, 0.0, 0.0), ..palm });
    let (cmu, smpl) = (Skeleton::new(half(CMU)).unwrap(), Skeleton::new(smpl).unwrap());
    for (file, skeleton, missing) in [(&cmu, &smpl, vec!["left_hand"]), (&smpl, &cmu, vec![])] {
        let mut raised = Pose::rest(file.len());
        raised.rotations[7] = UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0);
        let motion = Motion::read(written(file, &[raised], 1.0).as_bytes(), skeleton).unwrap();
        assert_eq!(motion.unmatched, missing);
        for (turn, name) in motion.poses[0].rotations.iter().zip(skeleton.names()) {
            let expected = if ["left_shoulder", "LeftArm"].contains(&name) { 1.0 } else { 0.0 };
            assert!((turn.angle() - expected).abs() < 1e-6, "{name}: {}", turn.angle());
        }
    }
}

const POSER: [&str; 10] = [
    "hip", "lThigh", "lShin", "lFoot", "lToe", "abdomen", "lCollar", "lShldr", "lForeArm", "lHand",
];

/// Poser's joints, as Daz Studio calls them: a bone is two joints, one that bends and one below it that twists.
fn daz() -> Vec<Joint> {
    let mut joints = half(POSER);
    for (bone, bend, twist) in [
        (8, "lForearmBend", "lForearmTwist"),
        (7, "lShldrBend", "lShldrTwist"),
        (1, "lThighBend", "lThighTwist"),
    ] {
        let head = nalgebra::center(&joints[bone].head, &joints[bone + 1].head);
        let below = Joint { name: twist.into(), parent: Some(bone), head, ..joints[bone].clone() };
        joints[bone].name = bend.into();
        joints.insert(bone + 1, below);
        for joint in &mut joints[bone + 2..] {
            joint.parent = joint.parent.map(|p| if p < bone { p } else { p + 1 });
        }
    }
    joints
}

#[test]
fn limbs_of_poser_and_daz_studio_are_known_by_their_names() {
    for skeleton in [half(CMU), half(SMPL)] {
        let skeleton = Skeleton::new(skeleton).unwrap();
        let spine = skeleton.joints()[5].name.clone();
        for file in [half(POSER), daz()] {
            let file = Skeleton::new(file).unwrap();
            let mut raised = Pose::rest(file.len());
            let arm = file.names().position(|name| name.starts_with("lShldr")).unwrap();
            let leg = file.names().position(|name| name.starts_with("lThigh")).unwrap();
            raised.rotations[arm] = UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0);
            raised.rotations[leg] = UnitQuaternion::from_euler_angles(-0.5, 0.0, 0.0);
            let motion = Motion::read(written(&file, &[raised], 1.0).as_bytes(), &skeleton);
            let motion = motion.unwrap();
            assert_eq!(motion.unmatched, [spine.as_str()]);
            assert_eq!(motion.still, [""; 0]);
            assert_eq!(motion.left_over[0], "abdomen");
            for (j, turn) in motion.poses[0].rotations.iter().enumerate() {
                let expected = [0.0, 0.5, 1.0][usize::from(j == 1) + 2 * usize::from(j == 7)];
                assert!((turn.angle() - expected).abs() < 1e-6, "{j}: {}", turn.angle());
            }
        }
    }
}

#[test]
fn bones_of_limbs_that_do_not_move_are_named_with_what_the_file_has_instead() {
    let skeleton = Skeleton::new(half(CMU)).unwrap();
    let of = |renamed: &[(usize, &str)]| {
        let mut joints = half(POSER);
        renamed.iter().for_each(|(j, name)| joints[*j].name = (*name).into());
        let file = Skeleton::new(joints).unwrap();
        Motion::read(written(&file, &[Pose::rest(10)], 1.0).as_bytes(), &skeleton).unwrap()
    };
    let motion = of(&[(7, "lOber"), (1, "lOben")]);
    assert_eq!(motion.still, ["left thigh", "left upper arm"]);
    assert_eq!(motion.left_over, ["lOben", "abdomen", "lOber"]);
    assert_eq!(motion.every(1), motion);
    // Where the file has nothing of a limb, it has no other names for it.
    let skeleton = crate::mannequin::rig::skeleton();
    let is_arm = |name: &str| ["arm", "hand", "shoulder"].iter().any(|bone| name.ends_with(bone));
    let lacking = |(k, joint): (usize, &Joint)| match joint.name.starts_with("left_") {
        true if is_arm(&joint.name) => Joint { name: format!("x{k}"), ..joint.clone() },
        _ => joint.clone(),
    };
    let file = skeleton.joints().iter().enumerate().map(lacking).collect();
    let text = written(&Skeleton::new(file).unwrap(), &[Pose::rest(skeleton.len())], 1.0);
    let motion = Motion::read(text.as_bytes(), &skeleton).unwrap();
    assert!(motion.unmatched.len() > 1 && motion.still.is_empty(), "{:?}", motion.still);
}

#[test]
fn where_a_file_begins_is_known_at_the_size_of_the_skeleton() {
    let skeleton = crate::mannequin::rig::skeleton();
    let mut pose = Pose::rest(skeleton.len());
    pose.root_translation = Vector::new(2.0, 0.0, -1.0);
    let text = written(&skeleton, &[pose.clone()], 100.0);
    let motion = Motion::read(text.as_bytes(), &skeleton).unwrap();
    let [x, z] = motion.moved_to_origin.unwrap();
    let hips = skeleton.joints()[0].head;
    assert!((x - 2.0 - hips.x).abs() < 1e-6 && (z + 1.0 - hips.z).abs() < 1e-6, "{x} {z}");
    assert!(motion.poses[0].root_translation.norm() < 1e-6 + hips.x.hypot(hips.z));
    assert_eq!(motion.every(1).moved_to_origin, Some([x, z]));
    assert_eq!(Motion::new(24.0, vec![pose]).unwrap().moved_to_origin, None);
}

#[test]
fn a_prefix_that_most_names_have_is_no_part_of_them() {
    let skeleton = Skeleton::new(half(SMPL)).unwrap();
    for prefix in ["mixamorig_", "Bip01 ", "DEF-", "J_Bip_", "rig1:"] {
        // The root has its own name in many rigs.
        let renamed = |(j, joint): (usize, Joint)| {
            let name = if j == 0 { "Bip01".into() } else { format!("{prefix}{}", joint.name) };
            Joint { name, ..joint }
        };
        let file = half(CMU).into_iter().enumerate().map(renamed).collect();
        let file = Skeleton::new(file).unwrap();
        let mut raised = Pose::rest(file.len());
        raised.rotations[7] = UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0);
        let text = written(&file, &[raised], 1.0);
        let motion = Motion::read(text.as_bytes(), &skeleton).unwrap();
        assert_eq!(motion.unmatched, [""; 0], "{prefix}");
        let arm = &motion.poses[0].rotations[7];
        assert!((arm.angle() - 1.0).abs() < 1e-6, "{prefix}: {}", arm.angle());
    }
    let names = vec!["L_arm", "L_leg", "R_arm", "R_leg", "spine_01", "spine_02"];
    assert_eq!(super::matching::without_prefix(names.clone()), names, "sides are no prefix");
}

#[test]
fn a_hand_with_fingers_goes_on_as_the_arm() {
    let with_fingers = |names| {
        let mut joints = half(names);
        for (name, z) in [("LeftFingerBase", 0.0), ("LThumb", 0.03)] {
            let head = joints[9].head + Vector::new(0.06, 0.0, z);
            joints.push(Joint { name: name.into(), parent: Some(9), head, ..joints[9].clone() });
        }
        Skeleton::new(joints).unwrap()
    };
    let file = with_fingers(CMU);
    // The same person with its arm down.
    let mut down = Pose::rest(file.len());
    down.rotations[7] = UnitQuaternion::from_euler_angles(0.0, 0.0, -0.8);
    let frames = file.frames(&down).unwrap();
    let lowered = |(j, joint): (usize, &Joint)| Joint {
        head: frames[j].translation.vector.into(),
        tail: frames[j] * Point::from(joint.tail - joint.head),
        ..joint.clone()
    };
    let skeleton = Skeleton::new(file.joints().iter().enumerate().map(lowered).collect()).unwrap();
    let text = written(&file, &[Pose::rest(file.len())], 1.0);
    // Names may stand right before their braces.
    let text = text.replace("LeftHand\n{", "LeftHand{").replace("End Site", "End site");
    let motion = Motion::read(text.as_bytes(), &skeleton).unwrap();
    let turns = &motion.poses[0].rotations;
    assert!((turns[7].angle() - 0.8).abs() < 1e-6, "the arm is raised");
    for j in [8, 9] {
        assert!(turns[j].angle() < 1e-6, "joint {j} turns by {}", turns[j].angle());
    }
}

#[test]
fn handles_of_rigs_are_no_limbs() {
    let skeleton = crate::mannequin::rig::skeleton();
    let root = Joint { name: "root".into(), parent: None, ..skeleton.joints()[0].clone() };
    let mut joints = vec![Joint { head: Point::origin(), tail: Point::new(0.0, 0.1, 0.0), ..root }];
    let below = |j: &Joint| Joint { parent: Some(j.parent.map_or(0, |p| p + 1)), ..j.clone() };
    joints.extend(skeleton.joints().iter().map(below));
    let foot = joints.iter().position(|j| j.name == "left_foot").unwrap();
    let head = Point::new(joints[foot].head.x, 0.0, joints[foot].head.z);
    joints.push(Joint { name: "ik_foot_l".into(), parent: Some(0), head, ..joints[foot].clone() });
    let rig = Skeleton::new(joints).unwrap();
    let text = written(&rig, &[Pose::rest(rig.len())], 100.0);
    let motion = Motion::read(text.as_bytes(), &rig).unwrap();
    assert!(motion.poses[0].root_translation.norm() < 1e-9);
    assert!(motion.poses[0].rotations.iter().all(|turn| turn.angle() < 1e-6));
}

#[test]
fn invalid_bvh_files_are_errors_that_name_the_place() {
    let skeleton = crate::mannequin::rig::skeleton();
    let good = written(&skeleton, &poses(&skeleton), 1.0);
    let error = |text: &str| Motion::read(text.as_bytes(), &skeleton).unwrap_err().to_string();
    let lying = |text: &str| {
        // Offsets with x and y exchanged: x is up.
        let swap = |line: &str| match line.split(' ').collect::<Vec<_>>()[..] {
            ["OFFSET", x, y, z] => format!("OFFSET {y} {x} {z}"),
            _ => line.to_owned(),
        };
        text.lines().map(swap).collect::<Vec<_>>().join("\n")
    };
    let table = [
        (good.replace("ROOT", "JOINT"), "line 2: expected ROOT, found `JOINT`"),
        (good.replacen("OFFSET 0", "OFFSET x", 1), "line 4: `x` is not a finite number"),
        (good.replacen("OFFSET 0", "OFFSET NaN", 1), "line 4: `NaN` is not"),
        (good.replacen("6 Xposition", "7 Xposition", 1), "number of channels, from 0 to 6"),
        (good.replacen("Xposition", "Wposition", 1), "found `Wposition`"),
        (good.replacen("JOINT", "BONE", 1), "found `BONE`"),
        (good.replace("Frames: 4", "Frames: 5"), "5 frames of 42 channels have 210"),
        (good.replace("Frames: 4", "Frames: 99999999999999999"), "frames of 42 channels"),
        (good.replace("Frames: 4", "Frames: -4"), "expected the number of frames, found `-4`"),
        (good.replace("0.04", "0"), "inf frames per second"),
        (good.replace("JOINT spine", "JOINT hips"), "two joints are called `hips`"),
        (good.split("MOTION").next().unwrap().to_owned(), "the file ends where MOTION"),
        (good.split("Time:").next().unwrap().to_owned(), "the file ends where Time:"),
        (
            good.replace("left", "west").replace("right", "east"),
            "3 of the skeleton's 13 joints are in the file, among the others not `left_",
        ),
        (good.replace("left", "west").replace("right", "east"), "the file has `hips`, `"),
        (lying(&good), "y or z must be up"),
        ("HIERARCHY\nROOT hips".to_owned(), "the name of a joint and {"),
    ];
    for (text, expected) in table {
        let found = error(&text);
        assert!(found.contains(expected), "{found}");
    }
    let text = [good.split("Frames").next().unwrap(), "Frames: 0\nFrame Time: 1\n"].concat();
    assert!(matches!(Motion::read(text.as_bytes(), &skeleton), Err(MotionError::Empty)));
    // A file that is named so is BVH, even if it is empty.
    for (text, expected) in
        [("", "HIERARCHY"), ("Hierarchy\nROOT hips", "the name of a joint and {")]
    {
        let found = Motion::read_as(text.as_bytes(), &skeleton, true).unwrap_err().to_string();
        assert!(found.contains(expected), "{found}");
    }
    // A deep file does not exhaust the stack.
    let deep: String = (0..100_000).map(|k| format!("JOINT j{k} {{ OFFSET 0 0 0\n")).collect();
    let text = format!("HIERARCHY ROOT a {{ OFFSET 0 0 0\n{deep}");
    assert!(error(&text).contains("the file ends where a joint"));
    assert!(matches!(Motion::read(&[0xff, 0xfe][..], &skeleton), Err(MotionError::Text)));
}

#[test]
fn bvh_files_as_programs_write_them_are_read() {
    let skeleton = crate::mannequin::rig::skeleton();
    let poses = poses(&skeleton);
    let good = written(&skeleton, &poses, 1.0);
    let read = |bytes: &[u8]| Motion::read(bytes, &skeleton);
    let expected = read(good.as_bytes()).unwrap();
    let table = [
        good.replace("Frames: 4", "Frames:4").replace("Time: 0.04", "Time:0.04"),
        good.replace("Frames: 4", "Frames : 4").replace("Time: 0.04", "Time :0.04"),
        good.replace("Frames: 4", "FRAMES:4"),
        good.replace("End Site", "End Site headEnd"),
        good.replace("End Site\n{", "End SiteHead{"),
    ];
    for text in table {
        assert_eq!(read(text.as_bytes()).unwrap(), expected, "{text}");
    }
    // A joint that the skeleton lacks, called `Hüfte` in Latin-1.
    let text = good.replacen("End Site", "JOINT H?fte {OFFSET 0 0 0}\nEnd Site", 1);
    let latin: Vec<u8> = text.bytes().map(|byte| if byte == b'?' { 0xfc } else { byte }).collect();
    assert_eq!(read(&latin).unwrap(), expected);

    let second = good.replace("MOTION", "ROOT other {OFFSET 0 0 0}\nMOTION");
    let table = [
        (second, "expected MOTION (one person a file), found `ROOT`"),
        (good.replacen("End Site\n{", "End Site\n}", 1), "expected {, found `}`"),
        (good.replace("Frames:", "Frames"), "expected Frames:, found `Frames`"),
        (good.replace("right", "east").replace("left", "west"), "joints of the BVH file"),
        ("glTF\x02\0\0\0".into(), "animations are not read"),
    ];
    for (text, expected) in table {
        let found = read(text.as_bytes()).unwrap_err().to_string();
        assert!(found.contains(expected), "{found}");
    }
    for bytes in [&b"\xff\xfeH\0I\0"[..], b"\xfcHIERARCHY"] {
        assert!(matches!(read(bytes), Err(MotionError::Text)));
    }
}

/// Limbs as CMU names them, about a spine of these joints of the same shape.
fn person(spine: &[(&str, Real)]) -> Skeleton {
    let mut joints: Vec<Joint> = Vec::new();
    let mut add = |name: String, parent: Option<usize>, at: [Real; 3]| {
        let head = Point::from(at);
        joints.push(Joint { name, parent, head, tail: head + Vector::new(0.0, 0.05, 0.0) });
        joints.len() - 1
    };
    let hips = add("Hips".into(), None, [0.0, 1.0, 0.0]);
    for (side, x) in [("Left", 1.0), ("Right", -1.0)] {
        let mut last = hips;
        for (name, y) in [("UpLeg", 0.95), ("Leg", 0.5), ("Foot", 0.05)] {
            last = add(format!("{side}{name}"), Some(last), [0.1 * x, y, 0.0]);
        }
    }
    let mut chest = hips;
    for (name, share) in spine {
        chest = add((*name).into(), Some(chest), [0.0, 1.0 + 0.4 * share, 0.0]);
    }
    for (side, x) in [("Left", 1.0), ("Right", -1.0)] {
        let mut last = chest;
        for (name, far) in [("Arm", 0.2), ("ForeArm", 0.45), ("Hand", 0.7)] {
            last = add(format!("{side}{name}"), Some(last), [far * x, 1.42, 0.0]);
        }
    }
    Skeleton::new(joints).unwrap()
}

/// Rigs number and name the joints of the spine each in its own way.
#[test]
fn a_chest_bends_as_that_of_the_file() {
    let cmu = [("LowerBack", 0.2), ("Spine", 0.6), ("Spine1", 1.0)];
    let skeleton = person(&cmu);
    let others: [&[(&str, Real)]; 5] = [
        &cmu,
        &[("Spine", 0.3), ("Spine1", 0.6), ("Spine2", 1.0)],
        &[("spine_01", 0.2), ("spine_02", 0.4), ("spine_03", 0.7), ("spine_04", 1.0)],
        &[("Chest", 0.5), ("Chest2", 1.0)],
        &[("torso", 1.0)],
    ];
    for spine in others {
        let file = person(spine);
        let mut bent = Pose::rest(file.len());
        let first = file.names().position(|name| name == spine[0].0).unwrap();
        for (k, turn) in bent.rotations[first..][..spine.len()].iter_mut().enumerate() {
            *turn = UnitQuaternion::from_euler_angles(0.3 + 0.1 * k as Real, 0.0, 0.0);
        }
        let motion =
            Motion::read(written(&file, &[bent.clone()], 1.0).as_bytes(), &skeleton).unwrap();
        let chest = |skeleton: &Skeleton, pose: &Pose, name: &str| {
            let j = skeleton.names().position(|n| n == name).unwrap();
            skeleton.frames(pose).unwrap()[j].rotation
        };
        let expected = chest(&file, &bent, spine[spine.len() - 1].0);
        let found = chest(&skeleton, &motion.poses[0], "Spine1");
        assert!(found.angle_to(&expected) < 1e-6, "{spine:?}: {}", found.angle_to(&expected));
        // What is nearer to the hips follows them.
        let missing = if spine[0].1 >= 0.4 { &["LowerBack", "Spine"][..] } else { &[] };
        assert!(motion.unmatched.iter().all(|name| missing.contains(&name.as_str())), "{spine:?}");
    }
}

#[test]
fn feet_of_a_body_with_spread_legs_stay_on_the_floor() {
    let file = person(&[("Spine", 1.0)]);
    let mut spread = Pose::rest(file.len());
    for (name, angle) in [("LeftUpLeg", 0.5), ("RightUpLeg", -0.5)] {
        let j = file.names().position(|n| n == name).unwrap();
        spread.rotations[j] = UnitQuaternion::from_euler_angles(0.0, 0.0, angle);
    }
    let frames = file.frames(&spread).unwrap();
    let moved = |(frame, joint): (&nalgebra::Isometry3<Real>, &Joint)| Joint {
        head: frame.translation.vector.into(),
        tail: frame * Point::from(joint.tail - joint.head),
        ..joint.clone()
    };
    let body = Skeleton::new(frames.iter().zip(file.joints()).map(moved).collect()).unwrap();
    let lowest = |frames: &[nalgebra::Isometry3<Real>]| {
        frames.iter().map(|f| f.translation.y).fold(Real::INFINITY, Real::min)
    };
    let standing = written(&file, &[Pose::rest(file.len())], 1.0);
    let motion = Motion::read(standing.as_bytes(), &body).unwrap();
    let [own, now] =
        [&Pose::rest(body.len()), &motion.poses[0]].map(|p| lowest(&body.frames(p).unwrap()));
    assert!(now > own - 1e-9, "{now} below the floor, {own}");
}

#[test]
fn a_head_without_an_end_does_not_lean_as_the_neck() {
    let with_neck = |lean: Real| {
        let mut joints = person(&[("Spine", 1.0)]).joints().to_vec();
        let chest = joints.iter().position(|j| j.name == "Spine").unwrap();
        let neck = Point::new(0.0, 1.45, 0.0);
        let head = neck + Vector::new(0.0, 0.1, lean);
        let up = Vector::new(0.0, 0.2, 0.0);
        joints.push(Joint { name: "Neck".into(), parent: Some(chest), head: neck, tail: head });
        let parent = Some(joints.len() - 1);
        joints.push(Joint { name: "Head".into(), parent, head, tail: head + up });
        Skeleton::new(joints).unwrap()
    };
    let (file, body) = (with_neck(0.0), with_neck(0.05));
    let text = written(&file, &[Pose::rest(file.len())], 1.0);
    let (before, after) = text.split_once("JOINT Head").unwrap();
    let (joint, end) = after.split_once("End Site").unwrap();
    let (_, rest) = end.split_once("}\n").unwrap();
    let text = format!("{before}JOINT Head{joint}{rest}");
    let motion = Motion::read(text.as_bytes(), &body).unwrap();
    let frames = body.frames(&motion.poses[0]).unwrap();
    let [neck, head] = [2, 1].map(|k| frames[body.len() - k].rotation.angle());
    assert!(neck > 0.4 && head < 1e-6, "{neck} {head}");
}

/// The skeleton with joints renamed and others put on top of theirs: (its name, names of the parts).
fn renamed(skeleton: &Skeleton, names: &[(&str, &[&str])]) -> Skeleton {
    let mut joints: Vec<Joint> = Vec::new();
    let mut last = Vec::new();
    for joint in skeleton.joints() {
        let own = [joint.name.as_str()];
        let parts = names.iter().find(|(name, _)| *name == joint.name).map_or(&own[..], |n| n.1);
        let mut parent = joint.parent.map(|p| last[p]);
        for (k, part) in parts.iter().enumerate() {
            let along = (joint.tail - joint.head) * (k as Real / parts.len() as Real);
            let joint =
                Joint { name: (*part).into(), parent, head: joint.head + along, ..joint.clone() };
            joints.push(joint);
            parent = Some(joints.len() - 1);
        }
        last.push(joints.len() - 1);
    }
    Skeleton::new(joints).unwrap()
}

#[test]
fn bones_of_several_parts_neck_and_head_follow_those_of_the_file() {
    let mut joints = person(&[("Spine", 0.5), ("Spine1", 1.0)]).joints().to_vec();
    let chest = joints.iter().position(|j| j.name == "Spine1").unwrap();
    for (name, parent, y) in [("Neck", chest, 1.45), ("Head", joints.len(), 1.55)] {
        let (head, tail) = (Point::new(0.0, y, 0.0), Point::new(0.0, y + 0.1, 0.0));
        joints.push(Joint { name: name.into(), parent: Some(parent), head, tail });
    }
    let cmu = Skeleton::new(joints).unwrap();
    let rigify = renamed(
        &cmu,
        &[
            ("Spine", &["spine.001"]),
            ("Spine1", &["spine.003"]),
            ("Neck", &["spine.004", "spine.005"]),
            ("Head", &["spine.006"]),
            ("LeftUpLeg", &["thigh.L", "thigh.L.001"]),
        ],
    );
    let unreal = renamed(&cmu, &[("Neck", &["neck_01", "neck_02"]), ("Head", &["head"])]);
    let makehuman = renamed(
        &cmu,
        &[
            ("Spine", &["spine04"]),
            ("Spine1", &["spine02", "spine01"]),
            ("Neck", &["neck01", "neck02"]),
            ("Head", &["head"]),
            ("LeftUpLeg", &["upperleg01.L", "upperleg02.L"]),
            ("LeftLeg", &["lowerleg01.L", "lowerleg02.L"]),
            ("LeftFoot", &["foot.L"]),
            ("LeftArm", &["upperarm01.L", "upperarm02.L"]),
            ("LeftForeArm", &["lowerarm01.L", "lowerarm02.L"]),
            ("LeftHand", &["wrist.L"]),
        ],
    );
    let of =
        |skeleton: &Skeleton, pose: &Pose, j: usize| skeleton.frames(pose).unwrap()[j].rotation;
    for rig in [&rigify, &unreal, &makehuman] {
        for (file, body) in [(rig, &cmu), (&cmu, rig), (rig, rig)] {
            let mut pose = Pose::rest(file.len());
            for (j, turn) in pose.rotations.iter_mut().enumerate() {
                *turn = UnitQuaternion::from_euler_angles(0.02 * j as Real, 0.01, -0.03);
            }
            let text = written(file, &[pose.clone()], 1.0);
            let motion = Motion::read(text.as_bytes(), body).unwrap();
            let (head_of_file, head) = (file.len() - 1, body.len() - 1);
            let [expected, found] =
                [of(file, &pose, head_of_file), of(body, &motion.poses[0], head)];
            assert!(found.angle_to(&expected) < 1e-6, "head: {:?}", motion.unmatched);
            if std::ptr::eq(file, body) {
                assert_eq!(motion.unmatched, [""; 0]);
                assert!(motion.poses[0].largest_turn(&pose) < 1e-6);
            }
            // No joint of the body is missing that is no further part of a bone.
            let is_part = |name: &String| name.contains("02.L") || name.ends_with(".L.001");
            let left: Vec<_> = motion.unmatched.iter().filter(|name| !is_part(name)).collect();
            assert!(left.is_empty(), "{left:?}");
        }
    }
}

#[test]
fn a_skeleton_with_many_joints_of_a_face_is_posed_by_a_file_without() {
    let file = person(&[("Spine", 1.0)]);
    let mut joints = file.joints().to_vec();
    let chest = joints.iter().position(|j| j.name == "Spine").unwrap();
    for k in 0..40 {
        joints.push(Joint {
            name: format!("face{k}"),
            parent: Some(chest),
            ..joints[chest].clone()
        });
    }
    let body = Skeleton::new(joints).unwrap();
    let text = written(&file, &[Pose::rest(file.len())], 1.0);
    let motion = Motion::read(text.as_bytes(), &body).unwrap();
    assert_eq!(motion.unmatched.len(), 40);
    // With a limb less there is too little.
    let text = text.replace("LeftForeArm", "tail");
    let fault = Motion::read(text.as_bytes(), &body).unwrap_err().to_string();
    assert!(fault.contains("among the others not `LeftForeArm`"), "{fault}");
}
