//! Which joints of a BVH file are those of a skeleton.

use super::bvh::{Bvh, BvhError};
use crate::skeleton::{SHORT, Skeleton};
use if_core::math::{Real, Vector};
use std::collections::{HashMap, HashSet};

/// Joints of a file that an error names.
const NAMED: usize = 4;

/// Which joints belong together.
pub(super) struct Matches {
    /// The joint of the file for each joint of the skeleton.
    pub(super) of: Vec<Option<usize>>,
    /// Whether a joint of the skeleton is of an arm or leg, by its name.
    pub(super) is_limb: Vec<bool>,
    /// The hips of the skeleton and of the file.
    pub(super) hips: [usize; 2],
    /// The joints from which both arms hang.
    pub(super) chest: Option<[usize; 2]>,
    /// Whether a joint of the skeleton is a hand or foot, or nothing below it is in the file.
    pub(super) is_end: Vec<bool>,
    /// The joints of the thighs.
    pub(super) thighs: Vec<[usize; 2]>,
    /// The left and the right hip joint.
    pub(super) hip_line: Option<[[usize; 2]; 2]>,
    /// The left and the right shoulder joint.
    pub(super) shoulder_line: Option<[[usize; 2]; 2]>,
    /// The head of the skeleton.
    pub(super) head: Option<usize>,
    /// Whether the bone of the parent leads to a joint of the skeleton, by its name: not to eyes, fingers or hair.
    pub(super) goes_on: Vec<bool>,
    /// The same of the joints of the file.
    pub(super) goes_on_in_file: Vec<bool>,
    /// Large bones of limbs that the file lacks while it has others of the limb, in words.
    pub(super) still: Vec<String>,
}

impl Matches {
    /// The joints that both have.
    pub(super) fn pairs(&self) -> impl Iterator<Item = [usize; 2]> {
        self.of.iter().enumerate().filter_map(|(j, k)| Some([j, (*k)?]))
    }
}

/// Hips belong together, and other joints below them if their names are alike.
pub(super) fn matches(bvh: &Bvh, skeleton: &Skeleton) -> Result<Matches, BvhError> {
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
    let head_of_skeleton = head(&names, |j| skeleton.joints()[j].parent, chest.map(|c| c[0]));
    let neck = chest.and_then(|chest| {
        let own = head_of_skeleton?;
        let other = head(&of_file, |k| bvh.joints[k].parent, Some(chest[1]))?;
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
    let large = || ['l', 'r'].into_iter().flat_map(|side| LIMBS.map(|bone| (Some(side), bone)));
    let has_limb = |(side, bone): (Option<char>, &str)| {
        let mut of_limb = names.iter().zip(&of).filter(|(n, m)| m.is_some() && n.usual.0 == side);
        of_limb.any(|(name, _)| name.usual.1 == bone)
    };
    if 2 * found < skeleton.len() && !large().all(has_limb) {
        // A limb tells more of how joints are named than a handle of a rig does.
        let missing = skeleton.names().zip(&of).zip(&names).filter(|((_, m), _)| m.is_none());
        let missing = missing.min_by_key(|(_, name)| !name.is_limb());
        let missing = missing.map_or("", |((name, _), _)| name).to_owned();
        let in_file = bvh.joints.iter().take(NAMED).map(|joint| joint.name.clone()).collect();
        return Err(BvhError::Joints { found, joints: skeleton.len(), missing, in_file });
    }
    let is_still = |(side, bone): &(Option<char>, &str)| {
        let is_own = |name: &Name| name.usual.0 == *side && name.usual.1 == *bone;
        let limb: &[&str] = if LEG.contains(bone) { &LEG } else { &ARM };
        names.iter().any(is_own)
            && !has_limb((*side, bone))
            && limb.iter().any(|bone| has_limb((*side, bone)))
    };
    let in_words = |(side, bone): (Option<char>, &str)| {
        let side = if side == Some('l') { "left" } else { "right" };
        format!("{side} {}", if bone == ARM[1] { "upper arm" } else { bone })
    };
    let still = large().filter(is_still).map(in_words).collect();
    let is_limb = names.iter().map(Name::is_limb).collect();
    let is_thigh = |[j, _]: &[usize; 2]| names[*j].usual.1 == LEG[0];
    let is_last = |name: &Name| ENDS.contains(&name.usual.1.as_str()) && name.is_limb();
    let mut has_below = vec![false; names.len()];
    for j in (0..names.len()).filter(|j| of[*j].is_some()) {
        above(|j| skeleton.joints()[j].parent, j).into_iter().for_each(|a| has_below[a] = true);
    }
    let is_end = |(name, has_below): (&Name, bool)| !has_below || is_last(name);
    let is_end = names.iter().zip(has_below).map(is_end).collect();
    let line = |bone: &str| {
        let of = |side| {
            let is_side =
                |[j, _]: &[usize; 2]| names[*j].usual.0 == Some(side) && names[*j].usual.1 == bone;
            limbs.iter().copied().find(is_side)
        };
        Some([of('l')?, of('r')?])
    };
    let (hip_line, shoulder_line) = (line(LEG[0]), line(ARM[1]));
    let thighs = limbs.iter().copied().filter(is_thigh).collect();
    let goes_on_in_file = goes_on(&of_file, |k| bvh.joints[k].parent);
    let goes_on = goes_on(&names, |j| skeleton.joints()[j].parent);
    let head = head_of_skeleton;
    Ok(Matches {
        of,
        is_limb,
        hips,
        chest,
        is_end,
        thighs,
        hip_line,
        shoulder_line,
        head,
        goes_on,
        goes_on_in_file,
        still,
    })
}

/// The head: the joint of that name, or the last one on from the chest by the chest's name, such as Rigify's
/// `spine.006` on from `spine.003`.
fn head(
    names: &[Name],
    parent: impl Fn(usize) -> Option<usize>,
    chest: Option<usize>,
) -> Option<usize> {
    let called = |j: usize| without_number(&names[j].plain);
    let last = || {
        let chest = chest?;
        let goes_on = |last, j| parent(j) == Some(last) && called(j) == called(chest);
        let on_from = |last: usize, j: usize| if goes_on(last, j) { j } else { last };
        Some((chest + 1..names.len()).fold(chest, on_from)).filter(|j| *j != chest)
    };
    names.iter().position(|name| name.plain == "head").or_else(last)
}

/// Whether each joint is the end of its parent's bone, by its name: the next one of the limb or trunk, or a joint
/// that is there for the end alone, as `HeadTop_End` or `Head_Nub`.
fn goes_on(names: &[Name], parent: impl Fn(usize) -> Option<usize>) -> Vec<bool> {
    let goes_on = |(j, name): (usize, &Name)| {
        let above = parent(j).map(|p| &names[p]);
        above.is_some_and(|above| name.ends(above) || name.is_next_of_limb(above))
    };
    names.iter().enumerate().map(goes_on).collect()
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
pub(super) fn below(
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
pub(super) fn above(parent: impl Fn(usize) -> Option<usize>, joint: usize) -> Vec<usize> {
    std::iter::successors(parent(joint), |j| parent(*j)).collect()
}

/// A joint's name in two forms that can be compared.
struct Name {
    /// Letters and digits in lower case, without a prefix as in `mixamorig:LeftArm`.
    plain: String,
    /// The side and the usual name: `LeftUpLeg`, `thigh.L` and `l_thigh` are all left, `thigh`, and so
    /// are the parts of a bone, `upperleg01.L` and `upperleg02.L`, and `lThighBend`.
    usual: (Option<char>, String),
    /// Whether the usual name is without a number that the name has.
    is_part: bool,
    /// The plain name without a word for the middle, if it has one.
    middle: Option<String>,
}

/// Usual names of the joints of a leg.
const LEG: [&str; 3] = ["thigh", "shin", "foot"];
/// Usual names of the joints of an arm.
const ARM: [&str; 4] = ["shoulder", "arm", "forearm", "hand"];
/// Usual names of the last large joints of limbs.
const ENDS: [&str; 2] = ["foot", "hand"];
/// Usual names of the bones that make a pose of limbs.
const LIMBS: [&str; 4] = ["thigh", "shin", "arm", "forearm"];
/// Names for the same joint of a limb, the usual one first.
const SYNONYMS: [&[&str]; 8] = [
    &["thigh", "upleg", "upperleg", "hip"],
    &["shin", "leg", "lowerleg", "lowleg", "calf", "knee"],
    &["foot", "ankle"],
    &["toe", "toebase", "toes", "ball", "forefoot"],
    &["shoulder", "clavicle", "collar"],
    &["arm", "upperarm", "uparm", "shldr"],
    &["forearm", "lowerarm", "lowarm", "elbow"],
    &["hand", "wrist"],
];

/// Last word of a bone that has a joint of its own for twists, `lThighBend` beside `lThighTwist`, as Daz Studio
/// names them.
const BEND: &str = "bend";
/// A part of the hand beyond the wrist, where that has a name of its own.
const PALM: &str = "palm";
/// Ends of the names of joints that are there for the end of a bone alone.
const TIPS: [&str; 6] = ["end", "site", "top", "tip", "nub", "leaf"];
/// Names of joints of the trunk to which the bone of another one leads.
const TRUNK: [&str; 5] = ["spine", "chest", "upperchest", "neck", "head"];
/// Words for the middle, of joints that have no side: `J_Bip_C_Head`, `Head_M`.
const MIDDLE: [&str; 4] = ["c", "m", "center", "centre"];

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
        let mut plain: HashSet<String> = names.iter().map(|(name, _)| name.plain.clone()).collect();
        for (name, _) in names.iter_mut().filter(|(name, _)| name.usual.0.is_none()) {
            // `C_Head` is the head, if nothing else is.
            if let Some(own) = name.middle.take().filter(|own| plain.insert(own.clone())) {
                (name.plain, name.usual.1) = (own.clone(), own);
            }
        }
        names.into_iter().map(|(name, _)| name).collect()
    }

    /// Whether it names the next joint of the trunk, or the end of the bone of the joint `above`.
    fn ends(&self, above: &Self) -> bool {
        let mut bone = without_number(&self.plain);
        let mut is_tip = false;
        while let Some(shorter) = TIPS.iter().find_map(|tip| bone.strip_suffix(tip)) {
            (bone, is_tip) = (without_number(shorter), true);
        }
        // `LeftToe_End` is that of `LeftToeBase`.
        let is_of_bone = is_tip && above.plain.starts_with(bone);
        is_of_bone || bone == without_number(&above.plain) || TRUNK.contains(&bone)
    }

    /// Whether it names a joint of the same limb as `above`.
    fn is_next_of_limb(&self, above: &Self) -> bool {
        let is_own = self.is_limb() || self.usual.1 == PALM;
        above.is_limb() && is_own && self.usual.0 == above.usual.0
    }

    /// Whether it names a joint of an arm or leg.
    fn is_limb(&self) -> bool {
        let is_usual = |of: &&[&str]| of[0] == self.usual.1;
        self.usual.0.is_some() && SYNONYMS.iter().any(is_usual)
    }

    /// A name, and its words without the side.
    fn new(name: &str) -> (Self, String) {
        let words = words(name.rsplit(':').next().unwrap_or(name));
        let plain = words.concat();
        let is_middle = |word: &&String| MIDDLE.contains(&word.as_str());
        let without: String = words.iter().filter(|word| !is_middle(word)).cloned().collect();
        let middle = Some(without).filter(|own| !own.is_empty() && *own != plain);
        let at = words.iter().find_map(|w| side(w));
        let joined: String = words.iter().filter(|w| side(w).is_none()).cloned().collect();
        let numbered = without_number(&joined);
        let bone = numbered.strip_suffix(BEND).unwrap_or(numbered);
        let synonyms = SYNONYMS.iter().find(|s| at.is_some() && s.contains(&bone));
        let Some(synonyms) = synonyms else {
            return (Self { plain, usual: (at, joined.clone()), is_part: false, middle }, joined);
        };
        let usual = (at, synonyms[0].to_owned());
        (Self { plain, usual, is_part: numbered != joined, middle }, bone.to_owned())
    }
}

/// The words of a name, in lower case.
fn words(name: &str) -> Vec<String> {
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
    words
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
/// `DEF-`. A side is none, also where all have the same. Joints of hair and cloth may be called otherwise, so
/// that what most joints of limbs share is a prefix, too.
pub(super) fn without_prefix(mut names: Vec<&str>) -> Vec<&str> {
    let first_part = |name: &str| {
        let end = starts(name).nth(1)?;
        let part = name[..end].trim_end_matches(|c: char| !c.is_alphanumeric());
        (!part.is_empty() && side(&part.to_lowercase()).is_none()).then_some(end)
    };
    loop {
        let parts = names.iter().filter_map(|name| Some(&name[..first_part(name)?]));
        let Some(prefix) = shared(parts, names.len()) else { break };
        names.iter_mut().for_each(|name| *name = name.strip_prefix(prefix).unwrap_or(name));
    }
    // Of each limb's joint the shortest first parts that are not of its name, which may be empty.
    let before_limb = |name: &&str| {
        let is_limb = |start: &usize| Name::new(&name[*start..]).0.is_limb();
        starts(name).find(is_limb)
    };
    let parts: Vec<&str> =
        names.iter().filter_map(|name| Some(&name[..before_limb(name)?])).collect();
    if let Some(prefix) = shared(parts.iter().copied(), parts.len()) {
        names.iter_mut().for_each(|name| *name = name.strip_prefix(prefix).unwrap_or(name));
    }
    names
}

/// The starts of what remains of a name without some of its first parts, which end with a separator.
fn starts(name: &str) -> impl Iterator<Item = usize> {
    let separators = name.char_indices().filter(|(_, c)| !c.is_alphanumeric());
    let ends = separators.map(|(at, c)| at + c.len_utf8());
    std::iter::once(0).chain(ends.filter(|end| *end < name.len()))
}

/// What at least three in four of `count` names begin with.
fn shared<'a>(parts: impl Iterator<Item = &'a str>, count: usize) -> Option<&'a str> {
    let mut counts: HashMap<&str, usize> = HashMap::new();
    parts.for_each(|part| *counts.entry(part).or_default() += 1);
    // No two are shared by more than half.
    counts.into_iter().find(|(_, shared)| 4 * shared >= 3 * count).map(|(part, _)| part)
}
