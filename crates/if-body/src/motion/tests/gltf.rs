//! Skeletons as glTF files have them: without ends of bones, and with joints of faces, hair and cloth.

use super::*;
use if_mesh::gltf::SkinJoint;

/// The skeleton of a glTF file with the joints of another one, and more: (name, name of its parent, from that).
fn of_gltf(skeleton: &Skeleton, more: &[(&str, &str, [Real; 3])]) -> Skeleton {
    let joint = |joint: &Joint| SkinJoint {
        name: joint.name.clone(),
        parent: joint.parent,
        place: joint.head,
    };
    let mut joints: Vec<SkinJoint> = skeleton.joints().iter().map(joint).collect();
    for (name, above, offset) in more {
        let parent = joints.iter().position(|joint| joint.name == *above).unwrap();
        let place = joints[parent].place + Vector::from(*offset);
        joints.push(SkinJoint { name: (*name).into(), parent: Some(parent), place });
    }
    Skeleton::from_gltf(&joints).unwrap()
}

/// The poses of the first joints of a skeleton, and no turns of others.
fn assert_same(motion: &Motion, poses: &[Pose]) {
    for (a, b) in motion.poses.iter().zip(poses) {
        let moved = a.root_translation - b.root_translation;
        assert!(moved.norm() < 1e-9, "{moved}");
        for (j, turn) in a.rotations.iter().enumerate() {
            let expected = b.rotations.get(j).copied().unwrap_or_default();
            assert!(turn.angle_to(&expected) < 1e-6, "joint {j}: {}", turn.angle_to(&expected));
        }
    }
}

#[test]
fn a_head_does_not_point_to_its_eyes_jaw_or_hair() {
    let file = crate::mannequin::rig::skeleton();
    let poses = poses(&file);
    let text = written(&file, &poses, 100.0);
    let eyes = [("LeftEye", "head", [0.03, 0.08, 0.09]), ("RightEye", "head", [-0.03, 0.08, 0.09])];
    let jaw = [("jaw", "head", [0.0, 0.02, 0.02])];
    let hair = [("hair_01", "head", [0.0, 0.1, -0.06]), ("hair_02", "hair_01", [0.0, -0.1, 0.0])];
    let faces = [&eyes[..], &jaw, &hair, &[&eyes[..], &jaw, &hair].concat()];
    for face in faces {
        let body = of_gltf(&file, face);
        assert_same(&Motion::read(text.as_bytes(), &body).unwrap(), &poses);
        // So does that of a file with the same face, and one with another jaw.
        let other = face.iter().map(|(name, above, [x, y, z])| (*name, *above, [*x, *y, 2.0 * z]));
        let other = of_gltf(&file, &other.collect::<Vec<_>>());
        for person in [&body, &other] {
            let more = |pose: &Pose| {
                let mut pose = pose.clone();
                pose.rotations.resize(person.len(), UnitQuaternion::identity());
                pose
            };
            let poses: Vec<Pose> = poses.iter().map(more).collect();
            let motion = Motion::read(written(person, &poses, 1.0).as_bytes(), &body).unwrap();
            let head = body.names().position(|name| name == "head").unwrap();
            for (a, b) in motion.poses.iter().zip(&poses) {
                let apart = a.rotations[head].angle_to(&b.rotations[head]);
                assert!(apart < 1e-6, "{face:?}: {apart}");
            }
        }
        // A skeleton that is written and read again is the same.
        let mut bytes = Vec::new();
        body.write(&mut bytes).unwrap();
        let again = Skeleton::read(&bytes[..]).unwrap();
        assert_same(&Motion::read(text.as_bytes(), &again).unwrap(), &poses);
    }
}

#[test]
fn a_head_points_to_its_top() {
    let file = crate::mannequin::rig::skeleton();
    let text = written(&file, &[Pose::rest(file.len())], 100.0);
    let head = file.names().position(|name| name == "head").unwrap();
    let along = file.joints()[head].tail - file.joints()[head].head;
    let lean = UnitQuaternion::from_axis_angle(&Vector::x_axis(), 0.3);
    for top in ["HeadTop_End", "head_end", "Head_Nub", "head001_leaf", "End"] {
        let more = [(top, "head", (lean * along).into()), ("LeftEye", "head", [0.0, 0.1, 0.1])];
        let body = of_gltf(&file, &more);
        let motion = Motion::read(text.as_bytes(), &body).unwrap();
        let found = motion.poses[0].rotations[head];
        assert!(found.angle_to(&lean.inverse()) < 1e-6, "{top}: {}", found.angle());
    }
}

#[test]
fn toes_point_to_their_end() {
    let file = Skeleton::new(half(CMU)).unwrap();
    let text = written(&file, &[Pose::rest(file.len())], 1.0);
    let lean = UnitQuaternion::from_axis_angle(&Vector::y_axis(), 0.3);
    let along = (lean * Vector::new(0.1, 0.0, 0.0)).into();
    for (name, expected) in [("LeftToe_End", 0.3), ("LeftToeBase_end", 0.3), ("LeftLace", 0.0)] {
        let body = of_gltf(&file, &[(name, "LeftToeBase", along)]);
        let motion = Motion::read(text.as_bytes(), &body).unwrap();
        let found = motion.poses[0].rotations[4].angle();
        assert!((found - expected).abs() < 1e-6, "{name}: {found}");
    }
}

#[test]
fn hands_and_feet_do_not_point_to_what_they_hold() {
    let file = crate::mannequin::rig::skeleton();
    let poses = poses(&file);
    let text = written(&file, &poses, 1.0);
    let more = [
        ("weapon", "left_forearm", [0.02, 0.02, 0.02]),
        ("left_forearm_twist", "right_forearm", [-0.02, 0.01, 0.0]),
        ("spur", "left_foot", [0.0, 0.0, -0.05]),
        ("lace", "right_foot", [0.0, 0.05, 0.05]),
    ];
    assert_same(&Motion::read(text.as_bytes(), &of_gltf(&file, &more)).unwrap(), &poses);
}

#[test]
fn the_same_rig_without_ends_of_feet_has_the_same_size_and_floor() {
    let file = crate::mannequin::rig::skeleton();
    let poses = poses(&file);
    let no_ends = |skeleton: &Skeleton| {
        let joint = |joint: &Joint| Joint { tail: joint.head, ..joint.clone() };
        Skeleton::new(skeleton.joints().iter().map(joint).collect()).unwrap()
    };
    let lifted = |by: Real| {
        let up = Vector::new(0.0, by, 0.0);
        let joint =
            |joint: &Joint| Joint { head: joint.head + up, tail: joint.tail + up, ..joint.clone() };
        Skeleton::new(file.joints().iter().map(joint).collect()).unwrap()
    };
    let body = of_gltf(&file, &[]);
    for scale in [1.0, 39.37] {
        for text in [written(&file, &poses, scale), written(&no_ends(&file), &poses, scale)] {
            assert_same(&Motion::read(text.as_bytes(), &body).unwrap(), &poses);
        }
    }
    // A foot of another name: its shin is the last joint of both.
    let text = written(&file, &poses[..1], 1.0).replace("left_foot", "left_hoof");
    assert_same(&Motion::read(text.as_bytes(), &body).unwrap(), &poses[..1]);
    // With heels the ankles are higher.
    let heels = lifted(0.06);
    for file in [&heels, &no_ends(&heels)] {
        let text = written(file, &poses, 1.0);
        assert_same(&Motion::read(text.as_bytes(), &of_gltf(&heels, &[])).unwrap(), &poses);
    }
    // A body about the origin stays there: the file has soles.
    let low = of_gltf(&lifted(-0.9), &[]);
    let motion = Motion::read(written(&file, &poses, 1.0).as_bytes(), &low).unwrap();
    assert!(motion.poses[0].root_translation.y.abs() < 0.02);
    // A rig of twice the size moves twice as far.
    let twice = file.scaled(2.0).unwrap();
    for body in [twice.clone(), of_gltf(&twice, &[])] {
        let motion = Motion::read(written(&file, &poses, 1.0).as_bytes(), &body).unwrap();
        for (a, b) in motion.poses.iter().zip(&poses) {
            let moved = a.root_translation - 2.0 * b.root_translation;
            assert!(moved.norm() < 1e-9, "{moved}");
        }
    }
}

#[test]
fn a_prefix_that_joints_of_limbs_have_is_no_part_of_names_among_hair() {
    let file = crate::mannequin::rig::skeleton();
    let poses = poses(&file);
    let text = written(&file, &poses, 1.0);
    let capital = |word: &str| word[..1].to_uppercase() + &word[1..];
    let name = |prefix: &str, name: &str| match name.split_once('_') {
        Some((side, part)) => format!("{prefix}{}_{part}", capital(&side[..1])),
        None if prefix == "J_Bip_" => format!("{prefix}C_{}", capital(name)),
        None => format!("{prefix}{name}"),
    };
    for (prefix, hair) in [
        ("J_Bip_", "J_Sec_Hair"),
        ("Bip01 ", "Ponytail"),
        ("CC_Base_", "hair_"),
        ("DEF-", "hair."),
        ("ValveBiped.Bip01_", "hair_"),
        ("", "J_Sec_L_Skirt"),
    ] {
        let joint = |joint: &Joint| Joint { name: name(prefix, &joint.name), ..joint.clone() };
        let renamed = Skeleton::new(file.joints().iter().map(joint).collect()).unwrap();
        let head = name(prefix, "head");
        let hairs: Vec<String> = (0..40).map(|k| format!("{hair}{k:02}")).collect();
        let hairs: Vec<(&str, &str, [Real; 3])> =
            hairs.iter().map(|hair| (hair.as_str(), head.as_str(), [0.0, 0.1, -0.02])).collect();
        let body = of_gltf(&renamed, &hairs);
        let motion = Motion::read(text.as_bytes(), &body).unwrap();
        assert_eq!(motion.unmatched.len(), 40, "{prefix}: {:?}", motion.unmatched);
        assert_same(&motion, &poses);
    }
}

#[test]
fn words_for_the_middle_are_no_part_of_names() {
    let file = crate::mannequin::rig::skeleton();
    let poses = poses(&file);
    let text = written(&file, &poses, 1.0);
    for middle in ["C_{}", "{}_M", "{}.C", "center_{}"] {
        let name = |name: &str| match name.contains('_') {
            true => name.to_owned(),
            false => middle.replace("{}", name),
        };
        let joint = |joint: &Joint| Joint { name: name(&joint.name), ..joint.clone() };
        let body = Skeleton::new(file.joints().iter().map(joint).collect()).unwrap();
        let motion = Motion::read(text.as_bytes(), &body).unwrap();
        assert_eq!(motion.unmatched, [""; 0], "{middle}");
        assert_same(&motion, &poses);
    }
    // Where a joint has the name without it they are two.
    let mut joints = file.joints().to_vec();
    let head = joints.iter().position(|joint| joint.name == "head").unwrap();
    joints.push(Joint { name: "C_head".into(), parent: Some(head), ..joints[head].clone() });
    let body = Skeleton::new(joints).unwrap();
    let motion = Motion::read(text.as_bytes(), &body).unwrap();
    assert_eq!(motion.unmatched, ["C_head"]);
}
