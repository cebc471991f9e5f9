//! The bones that a joint has in a skeleton and in a BVH file.

use super::bvh::Bvh;
use super::matching::Matches;
use crate::skeleton::{SHORT, Skeleton};
use if_core::math::Vector;

/// The bones of a joint in both rest poses.
pub(super) enum Bones {
    /// Of no length, or missing.
    None,
    One(Vector, Vector),
    /// The sum of those of a joint of a limb that branches: a hand goes on from the arm to where the
    /// fingers point.
    Fan(Vector, Vector),
    /// Another joint branches.
    Many,
}

/// The bones of the joint `j` of a skeleton; `rest` has the positions of the file's joints at rest.
pub(super) fn bones(
    bvh: &Bvh,
    skeleton: &Skeleton,
    matches: &Matches,
    rest: &[Vector],
    j: usize,
) -> Bones {
    let of = &matches.of;
    let Some(k) = of[j] else { return Bones::None };
    let joints = skeleton.joints();
    // The nearest joints below that both have.
    let is_below = |mut c: usize| {
        while let Some(p) = joints[c].parent {
            if p == j {
                return true;
            }
            if of[p].is_some() {
                return false;
            }
            c = p;
        }
        false
    };
    let below =
        (j + 1..joints.len()).filter_map(|c| Some((c, of[c]?))).filter(|(c, _)| is_below(*c));
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
        2.. if !matches.is_limb[j] => Bones::Many,
        _ if !is_bone => Bones::None,
        2.. => Bones::Fan(own, other),
        _ => Bones::One(own, other),
    }
}
