//! Motions of one skeleton on another: bones point where those of the other point.

use super::bvh::{Bvh, BvhError};
use crate::pose::Pose;
use crate::skeleton::{SHORT, Skeleton};
use if_core::math::{Point, Real, Vector};
use nalgebra::UnitQuaternion;
use std::collections::{HashMap, HashSet};
use std::f64::consts::FRAC_PI_2;

type Turn = UnitQuaternion<Real>;

/// A motion for a skeleton.
pub(super) struct Retargeted {
    /// Translation of the root and rotations of all joints, for each frame.
    pub(super) poses: Vec<(Vector, Vec<Turn>)>,
    /// Joints of the skeleton that the motion does not have.
    pub(super) unmatched: Vec<String>,
}

/// The motion of a BVH file for a skeleton.
///
/// With B the rotation of a joint of the file in the world, the skeleton's joint has W = B A there,
/// where A turns its bone in the rest pose to that of the file: by quarter turns about y to the side
/// that the person faces, then the shortest way; of a hand as its arm, then the shortest way to its
/// fingers. Joints of the spine are matched by their share of its length, and so are those of neck and head that
/// no name matches, all others by name; those that the file lacks follow their parents. Translations are those of the [hips](hips), scaled by
/// their heights in the rest pose of the file; joints above them stay as they are. The first frame is above the origin; the floor of the file, y = 0, is that of the body where its
/// feet are near that, else its lowest joint.
///
/// # Errors
///
/// The file has fewer than half of the joints, and lacks one of the large bones of the limbs; or its rest
/// pose is upright neither along y nor along z.
pub(super) fn retarget(mut bvh: Bvh, skeleton: &Skeleton) -> Result<Retargeted, BvhError> {
    let Matches { of: matches, is_limb, hips: [hips, hips_of_file] } = matches(&bvh, skeleton)?;
    let [size, low] = extent(&bvh, hips_of_file);
    let rest = bvh.rest();
    // The span of stretched arms is a person's height; legs are nearly half of it.
    let stands_along =
        |axis: usize| -low[axis] > 0.25 * size.max() && is_up(axis, &rest, &matches, skeleton);
    let up = [1, 2].into_iter().find(|axis| stands_along(*axis)).ok_or(BvhError::NotUpright {
        height: size.y,
        width: size.x,
        depth: size.z,
    })?;
    let height = -low[up];
    if up == 2 {
        bvh.stand_along_z();
    }
    let bvh = bvh;
    let rest = bvh.rest();
    let rest: Vec<Vector> = rest.iter().map(|p| p - rest[hips_of_file]).collect();
    let joints = skeleton.joints();
    let root = joints[hips].head;
    let is_below = below(|j| joints[j].parent, joints.len(), |j| j == hips);
    let own = joints.iter().zip(&is_below).filter(|(_, is_below)| **is_below);
    let ends = own.flat_map(|(j, _)| [j.head.y, j.tail.y]);
    let lowest = ends.fold(root.y, Real::min);
    // Soles are a little lower than joints.
    let floor = if lowest.abs() < SOLE * (root.y - lowest) { 0.0 } else { lowest };

    let facing = facing(&root, skeleton, &matches, &rest);
    let mut align: Vec<Turn> = Vec::with_capacity(joints.len());
    let of_limb = below(|j| joints[j].parent, joints.len(), |j| is_limb[j]);
    for (j, joint) in joints.iter().enumerate() {
        let inherited = joint.parent.map_or(facing, |p| align[p]);
        align.push(match bones(&bvh, skeleton, (&matches, is_limb[j]), &rest, j) {
            // Opposite bones have no shortest way.
            Bones::One(own, other) => Turn::rotation_between(&(facing * own), &other)
                .map_or(inherited, |swing| swing * facing),
            Bones::Fan(own, other) => Turn::rotation_between(&(inherited * own), &other)
                .map_or(inherited, |swing| swing * inherited),
            Bones::Many => facing,
            // A hand goes on as its arm; a head does not lean because the neck of the file does not.
            Bones::None if of_limb[j] => inherited,
            Bones::None => facing,
        });
    }
    let local = |turns: &[Turn]| {
        let mut world: Vec<Turn> = Vec::with_capacity(joints.len());
        let mut local = Vec::with_capacity(joints.len());
        for (j, joint) in joints.iter().enumerate() {
            let above = joint.parent.map_or(Turn::identity(), |p| world[p]);
            let turn = matches[j].map_or(above, |k| turns[k] * align[j]);
            world.push(turn);
            local.push(above.inverse() * turn);
        }
        local
    };
    // In the skeleton's own rest pose legs may be spread or in a stride.
    let as_file = Pose {
        root_translation: Vector::zeros(),
        rotations: local(&vec![Turn::identity(); bvh.joints.len()]),
    };
    let scale = own_hip_height(skeleton, &as_file, &is_below, hips) / height;

    let first = bvh.frames(hips_of_file).next();
    let start = first.map_or(Vector::zeros(), |(p, _)| Vector::new(p.x, 0.0, p.z));
    let poses = bvh.frames(hips_of_file).map(|(position, turns)| {
        ((position - start) * scale - Vector::y() * (root.y - floor), local(&turns))
    });
    let above = above(|j| joints[j].parent, hips);
    let missing = (0..joints.len()).filter(|j| matches[*j].is_none() && !above.contains(j));
    let unmatched = missing.map(|j| joints[j].name.clone()).collect();
    Ok(Retargeted { poses: poses.collect(), unmatched })
}

/// Joints of a file that an error names.
const NAMED: usize = 4;

/// Which joints belong together.
struct Matches {
    /// The joint of the file for each joint of the skeleton.
    of: Vec<Option<usize>>,
    /// Whether a joint of the skeleton is of an arm or leg, by its name.
    is_limb: Vec<bool>,
    /// The hips of the skeleton and of the file.
    hips: [usize; 2],
}

/// Hips belong together, and other joints below them if their names are alike.
fn matches(bvh: &Bvh, skeleton: &Skeleton) -> Result<Matches, BvhError> {
    let (mut exact, mut usual) = (HashMap::new(), HashMap::new());
    let of_file = Name::all(bvh.joints.iter().map(|joint| joint.name.as_str()));
    for (k, name) in of_file.iter().enumerate() {
        exact.entry(&name.plain).or_insert(k);
        usual.entry(&name.usual).or_insert(k);
    }
    let names = Name::all(skeleton.names());
    // What is called a shoulder may be another joint of the arm in the file.
    let find = |name: &Name| match name.is_limb() && !name.is_part {
        true => usual.get(&name.usual).or_else(|| exact.get(&name.plain)),
        false => exact.get(&name.plain).or_else(|| usual.get(&name.usual)),
    };
    let mut taken = HashSet::new();
    let alike = names.iter().map(|name| find(name).copied().filter(|k| taken.insert(*k)));
    let alike: Vec<Option<usize>> = alike.collect();

    // Others with a side, such as handles of rigs (`ik_foot_l`), hang anywhere.
    let limbs = (0..names.len()).filter(|j| names[*j].is_limb());
    let limbs: Vec<[usize; 2]> = limbs.filter_map(|j| Some([j, alike[j]?])).collect();
    let is_leg = |[j, _]: &[usize; 2]| LEG.contains(&names[*j].usual.1.as_str());
    let hips = match limbs.iter().any(is_leg) {
        true => [
            hips(|j| skeleton.joints()[j].parent, limbs.iter().map(|limb| limb[0])),
            hips(|k| bvh.joints[k].parent, limbs.iter().map(|limb| limb[1])),
        ],
        false => [0, 0],
    };
    let above_skeleton = above(|j| skeleton.joints()[j].parent, hips[0]);
    let path_in_file = bvh.path(hips[1]);
    let arms: Vec<[usize; 2]> =
        limbs.iter().filter(|[j, _]| ARM.contains(&names[*j].usual.1.as_str())).copied().collect();
    let both = ['l', 'r'].map(|side| arms.iter().any(|[j, _]| names[*j].usual.0 == Some(side)));
    let chest = (both == [true; 2]).then(|| {
        [
            self::hips(|j| skeleton.joints()[j].parent, arms.iter().map(|arm| arm[0])),
            self::hips(|k| bvh.joints[k].parent, arms.iter().map(|arm| arm[1])),
        ]
    });
    let spine = chest.map_or_else(HashMap::new, |chest| between(bvh, skeleton, hips, chest));
    let neck = chest.and_then(|chest| {
        let own = head(&names, |j| skeleton.joints()[j].parent, chest[0])?;
        let other = head(&of_file, |k| bvh.joints[k].parent, chest[1])?;
        let mut neck = between(bvh, skeleton, chest, [own, other]);
        neck.retain(|j, k| *j == own || *k != Some(other));
        Some(neck)
    });
    let neck = neck.unwrap_or_default();
    let of = |j: usize| match j {
        j if spine.contains_key(&j) => spine[&j],
        j if j == hips[0] => Some(hips[1]),
        j if above_skeleton.contains(&j) => None,
        j => alike[j]
            .or_else(|| neck.get(&j).copied().flatten().filter(|k| !taken.contains(k)))
            .filter(|k| !path_in_file.contains(k)),
    };
    let of: Vec<Option<usize>> = (0..names.len()).map(of).collect();
    let found = of.iter().flatten().count();
    // A skeleton may have a hundred joints for a hand and a face.
    let limbs = ['l', 'r'].into_iter().flat_map(|side| LIMBS.map(|bone| (Some(side), bone)));
    let has_limb = |(side, bone): (Option<char>, &str)| {
        let mut of_limb = names.iter().zip(&of).filter(|(n, m)| m.is_some() && n.usual.0 == side);
        of_limb.any(|(name, _)| name.usual.1 == bone)
    };
    if 2 * found < skeleton.len() && !limbs.into_iter().all(has_limb) {
        // A limb tells more of how joints are named than a handle of a rig does.
        let missing = skeleton.names().zip(&of).zip(&names).filter(|((_, m), _)| m.is_none());
        let missing = missing.min_by_key(|(_, name)| !name.is_limb());
        let missing = missing.map_or("", |((name, _), _)| name).to_owned();
        let in_file = bvh.joints.iter().take(NAMED).map(|joint| joint.name.clone()).collect();
        return Err(BvhError::Joints { found, joints: skeleton.len(), missing, in_file });
    }
    Ok(Matches { of, is_limb: names.iter().map(Name::is_limb).collect(), hips })
}

/// The head: the joint of that name, or the last one on from the chest by the chest's name, such as Rigify's
/// `spine.006` on from `spine.003`.
fn head(names: &[Name], parent: impl Fn(usize) -> Option<usize>, chest: usize) -> Option<usize> {
    let called = |j: usize| without_number(&names[j].plain);
    let on_from =
        |last: usize, j: usize| match parent(j) == Some(last) && called(j) == called(chest) {
            true => j,
            false => last,
        };
    let last = || Some((chest + 1..names.len()).fold(chest, on_from)).filter(|j| *j != chest);
    names.iter().position(|name| name.plain == "head").or_else(last)
}

/// The joints of the spine, from above the hips to where both arms hang, or of the neck, from there to the
/// head, and those of the file at the nearest share of its length: every rig numbers and names them
/// otherwise (`Spine2`, `spine_03`, `Chest`). None where that is the first one.
fn between(
    bvh: &Bvh,
    skeleton: &Skeleton,
    first: [usize; 2],
    last: [usize; 2],
) -> HashMap<usize, Option<usize>> {
    let joints = skeleton.joints();
    let rest = bvh.rest();
    let own = shares(|j| joints[j].parent, |j| joints[j].head.coords, [first[0], last[0]]);
    let other = shares(|k| bvh.joints[k].parent, |k| rest[k], [first[1], last[1]]);
    let (Some(own), Some(other)) = (own, other) else { return HashMap::new() };
    let nearest = |share: Real| {
        let far = |(_, of): &(usize, Real)| (of - share).abs();
        // Of two as near the one that is farther from the first.
        let found = other.iter().rev().min_by(|a, b| far(a).total_cmp(&far(b)));
        found.map(|(k, _)| *k).filter(|k| *k != first[1])
    };
    own[1..].iter().map(|(j, share)| (*j, nearest(*share))).collect()
}

/// The joints from one to another below it, and the shares of the way there; none if it is not below.
fn shares(
    parent: impl Fn(usize) -> Option<usize>,
    at: impl Fn(usize) -> Vector,
    [first, last]: [usize; 2],
) -> Option<Vec<(usize, Real)>> {
    let mut path: Vec<usize> = std::iter::successors(Some(last), |j| parent(*j)).collect();
    path.truncate(path.iter().position(|j| *j == first)? + 1);
    path.reverse();
    let mut length = 0.0;
    let mut shares = vec![(first, 0.0)];
    for pair in path.windows(2) {
        length += (at(pair[1]) - at(pair[0])).norm();
        shares.push((pair[1], length));
    }
    (length > SHORT).then(|| shares.into_iter().map(|(j, s)| (j, s / length)).collect())
}

/// The height of the hips of a skeleton in a pose above the lowest joint below them.
fn own_hip_height(skeleton: &Skeleton, pose: &Pose, is_below: &[bool], hips: usize) -> Real {
    let frames = skeleton.frames(pose).expect("a turn for each joint");
    let own = skeleton.joints().iter().zip(&frames).zip(is_below).filter(|(_, below)| **below);
    let ends = own.flat_map(|((joint, frame), _)| {
        [frame.translation.y, (frame * Point::from(joint.tail - joint.head)).y]
    });
    frames[hips].translation.y - ends.fold(Real::INFINITY, Real::min)
}

/// The joint from which all limbs hang: the root, or one below it where the root lies on the floor, as in
/// many rigs of games.
fn hips(parent: impl Fn(usize) -> Option<usize>, limbs: impl Iterator<Item = usize>) -> usize {
    // Parents come before children: of two paths that have met no part is left to walk.
    let common = |mut a: usize, mut b: usize| {
        while a != b {
            let lower = if a > b { &mut a } else { &mut b };
            *lower = parent(*lower).unwrap_or(0);
        }
        a
    };
    limbs.reduce(common).unwrap_or(0)
}

/// Whether each of so many joints is one of the first ones or below one.
fn below(
    parent: impl Fn(usize) -> Option<usize>,
    count: usize,
    is_first: impl Fn(usize) -> bool,
) -> Vec<bool> {
    let mut is_below: Vec<bool> = Vec::with_capacity(count);
    for j in 0..count {
        is_below.push(is_first(j) || parent(j).is_some_and(|p| is_below[p]));
    }
    is_below
}

/// The joints above one.
fn above(parent: impl Fn(usize) -> Option<usize>, joint: usize) -> Vec<usize> {
    std::iter::successors(parent(joint), |j| parent(*j)).collect()
}

/// A joint's name in two forms that can be compared.
struct Name {
    /// Letters and digits in lower case, without a prefix as in `mixamorig:LeftArm`.
    plain: String,
    /// The side and the usual name: `LeftUpLeg`, `thigh.L` and `l_thigh` are all left, `thigh`, and so
    /// are the parts of a bone, `upperleg01.L` and `upperleg02.L`.
    usual: (Option<char>, String),
    /// Whether the usual name is without a number that the name has.
    is_part: bool,
}

/// Usual names of the joints of a leg.
const LEG: [&str; 3] = ["thigh", "shin", "foot"];
/// Usual names of the joints of an arm.
const ARM: [&str; 4] = ["shoulder", "arm", "forearm", "hand"];
/// Usual names of the bones that make a pose of limbs.
const LIMBS: [&str; 4] = ["thigh", "shin", "arm", "forearm"];
/// Names for the same joint of a limb, the usual one first.
const SYNONYMS: [&[&str]; 8] = [
    &["thigh", "upleg", "upperleg", "hip"],
    &["shin", "leg", "lowerleg", "calf", "knee"],
    &["foot", "ankle"],
    &["toe", "toebase", "toes", "ball"],
    &["shoulder", "clavicle", "collar"],
    &["arm", "upperarm"],
    &["forearm", "lowerarm", "elbow"],
    &["hand", "wrist"],
];

/// A part of the hand beyond the wrist, where that has a name of its own.
const PALM: &str = "palm";

impl Name {
    /// The names of a skeleton. Some mean another joint by what else its list has on that side: SMPL,
    /// Biovision and Kinect call the upper arm a shoulder, the toes a foot and the palm a hand.
    fn all<'a>(names: impl Iterator<Item = &'a str>) -> Vec<Self> {
        let mut names: Vec<(Self, String)> =
            without_prefix(names.collect()).into_iter().map(Self::new).collect();
        for side in ['l', 'r'] {
            let has = |any: &[&str]| {
                let own = names.iter().filter(|(name, _)| name.usual.0 == Some(side));
                own.map(|(_, word)| word.as_str()).any(|word| any.contains(&word))
            };
            let [.., toe, shoulder, arm, _, _] = SYNONYMS;
            let other = [
                ("shoulder", arm[0], !has(arm) && (has(&shoulder[1..]) || has(&["elbow"]))),
                ("foot", toe[0], has(&["ankle"]) && !has(toe)),
                ("hand", PALM, has(&["wrist"])),
            ];
            for (name, word) in names.iter_mut().filter(|(name, _)| name.usual.0 == Some(side)) {
                if let Some((_, usual, _)) = other.iter().find(|(w, _, is)| w == word && *is) {
                    name.usual.1 = (*usual).to_owned();
                }
            }
        }
        names.into_iter().map(|(name, _)| name).collect()
    }

    /// Whether it names a joint of an arm or leg.
    fn is_limb(&self) -> bool {
        let is_usual = |of: &&[&str]| of[0] == self.usual.1;
        self.usual.0.is_some() && SYNONYMS.iter().any(is_usual)
    }

    /// A name, and its words without the side.
    fn new(name: &str) -> (Self, String) {
        let name = name.rsplit(':').next().unwrap_or(name);
        let mut words: Vec<String> = Vec::new();
        let mut before = ' ';
        for c in name.chars() {
            let begins = !before.is_alphanumeric() || (c.is_uppercase() && before.is_lowercase());
            let after_side = words.len() == 1 && matches!(words[0].as_str(), "l" | "r");
            if c.is_alphanumeric() {
                if begins || (after_side && c.is_uppercase()) {
                    words.push(String::new());
                }
                if let Some(word) = words.last_mut() {
                    word.extend(c.to_lowercase());
                }
            }
            before = c;
        }
        let plain = words.concat();
        let at = words.iter().find_map(|w| side(w));
        let joined: String = words.iter().filter(|w| side(w).is_none()).cloned().collect();
        let bone = without_number(&joined);
        let synonyms = SYNONYMS.iter().find(|s| at.is_some() && s.contains(&bone));
        let Some(synonyms) = synonyms else {
            return (Self { plain, usual: (at, joined.clone()), is_part: false }, joined);
        };
        let usual = (at, synonyms[0].to_owned());
        (Self { plain, usual, is_part: bone != joined }, bone.to_owned())
    }
}

/// A name without the number at its end.
fn without_number(name: &str) -> &str {
    name.trim_end_matches(|c: char| c.is_ascii_digit())
}

/// The side that a word in lower case names.
fn side(word: &str) -> Option<char> {
    match word {
        "l" | "left" => Some('l'),
        "r" | "right" => Some('r'),
        _ => None,
    }
}

/// The names without the first parts, up to a separator, that most of them share: `mixamorig_`, `Bip01 `,
/// `DEF-`. A side is none, also where all have the same.
pub(super) fn without_prefix(mut names: Vec<&str>) -> Vec<&str> {
    let first_part = |name: &str| {
        let at = name.find(|c: char| !c.is_alphanumeric())?;
        let (separator, rest) = (name[at..].chars().next()?.len_utf8(), name.len());
        let is_prefix =
            at > 0 && at + separator < rest && side(&name[..at].to_lowercase()).is_none();
        is_prefix.then(|| at + separator)
    };
    loop {
        let mut counts: HashMap<&str, usize> = HashMap::new();
        for name in &names {
            if let Some(end) = first_part(name) {
                *counts.entry(&name[..end]).or_default() += 1;
            }
        }
        // No two are shared by more than half.
        let Some((prefix, _)) = counts.into_iter().find(|(_, count)| 4 * count >= 3 * names.len())
        else {
            return names;
        };
        for name in &mut names {
            *name = name.strip_prefix(prefix).unwrap_or(name);
        }
    }
}

/// The size of the hips and all below them in the rest pose, and its lowest corner from the hips.
fn extent(bvh: &Bvh, hips: usize) -> [Vector; 2] {
    let rest = bvh.rest();
    let is_below = below(|k| bvh.joints[k].parent, rest.len(), |k| k == hips);
    let (mut low, mut high) = (Vector::zeros(), Vector::zeros());
    for k in (0..rest.len()).filter(|k| is_below[*k]) {
        let at = rest[k] - rest[hips];
        for p in bvh.end(k).map(|end| at + end).into_iter().chain([at]) {
            (low, high) = (low.inf(&p), high.sup(&p));
        }
    }
    [high - low, low]
}

/// Least correlation of joints' heights in two rest poses that are the same way up. It is 1 for equal poses,
/// about 0 along another axis, where left and right are alike, and below 0 head down.
const SAME_WAY_UP: Real = 0.3;

/// Whether joints of the file lie the higher along an axis, the higher those of the skeleton do.
fn is_up(axis: usize, rest: &[Vector], matches: &[Option<usize>], skeleton: &Skeleton) -> bool {
    let joints = skeleton.joints().iter().zip(matches);
    let heights: Vec<[Real; 2]> =
        joints.filter_map(|(joint, k)| Some([joint.head.y, rest[(*k)?][axis]])).collect();
    let count = heights.len() as Real;
    let [own, other] = [0, 1].map(|k| heights.iter().map(|h| h[k]).sum::<Real>() / count);
    let (mut both, mut squares) = (0.0, [0.0; 2]);
    for h in &heights {
        let (a, b) = (h[0] - own, h[1] - other);
        both += a * b;
        squares = [squares[0] + a * a, squares[1] + b * b];
    }
    both > SAME_WAY_UP * (squares[0] * squares[1]).sqrt()
}

/// The quarter turns about y from the skeleton to the file.
fn facing(hips: &Point, skeleton: &Skeleton, matches: &[Option<usize>], rest: &[Vector]) -> Turn {
    let (mut along, mut across) = (0.0, 0.0);
    for (joint, k) in skeleton.joints().iter().zip(matches) {
        if let Some(k) = k {
            let (p, q) = (joint.head - hips, rest[*k]);
            along += p.x * q.x + p.z * q.z;
            across += p.z * q.x - p.x * q.z;
        }
    }
    let quarters = (across.atan2(along) / FRAC_PI_2).round();
    Turn::from_axis_angle(&Vector::y_axis(), quarters * FRAC_PI_2)
}

/// The bones of a joint in both rest poses.
enum Bones {
    /// Of no length, or missing.
    None,
    One(Vector, Vector),
    /// The sum of those of a joint of a limb that branches: a hand goes on from the arm to where the
    /// fingers point.
    Fan(Vector, Vector),
    /// Another joint branches.
    Many,
}

fn bones(
    bvh: &Bvh,
    skeleton: &Skeleton,
    (matches, is_limb): (&[Option<usize>], bool),
    rest: &[Vector],
    j: usize,
) -> Bones {
    let Some(k) = matches[j] else { return Bones::None };
    let joints = skeleton.joints();
    // The nearest joints below that both have.
    let is_below = |mut c: usize| {
        while let Some(p) = joints[c].parent {
            if p == j {
                return true;
            }
            if matches[p].is_some() {
                return false;
            }
            c = p;
        }
        false
    };
    let below =
        (j + 1..joints.len()).filter_map(|c| Some((c, matches[c]?))).filter(|(c, _)| is_below(*c));
    let bones: Vec<(Vector, Vector)> =
        below.map(|(c, m)| (joints[c].head - joints[j].head, rest[m] - rest[k])).collect();
    let (own, other) = if bones.is_empty() {
        let children = (0..rest.len()).filter(|c| bvh.joints[*c].parent == Some(k));
        let children = children.map(|c| rest[c] - rest[k]);
        (joints[j].tail - joints[j].head, bvh.end(k).into_iter().chain(children).sum())
    } else {
        bones.iter().fold(Default::default(), |(a, b): (Vector, Vector), (c, d)| (a + c, b + d))
    };
    let is_bone = own.norm() > SHORT && other.norm() > 0.0;
    match bones.len() {
        2.. if !is_limb => Bones::Many,
        _ if !is_bone => Bones::None,
        2.. => Bones::Fan(own, other),
        _ => Bones::One(own, other),
    }
}

/// Height of the lowest joint, as a share of that of the hips, up to which a body stands on y = 0.
const SOLE: Real = 0.1;
