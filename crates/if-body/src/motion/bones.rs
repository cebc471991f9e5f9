//! The bones that a joint has in a skeleton and in a BVH file.

use super::bvh::Bvh;
use super::matching::Matches;
use crate::skeleton::{SHORT, Skeleton};
use if_core::math::{Real, Vector};

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
    let mut below: Vec<(usize, usize)> = below.collect();
    // A jaw alone is not where a head points.
    if let [(c, _)] = below[..]
        && matches.head == Some(j)
        && !matches.goes_on[c]
    {
        below.clear();
    }
    let below = below.into_iter();
    let bones: Vec<(Vector, Vector)> =
        below.map(|(c, m)| (joints[c].head - joints[j].head, rest[m] - rest[k])).collect();
    let (own, other) = if bones.is_empty() {
        let is_next = |c: &usize| matches.is_limb[j] || matches.goes_on_in_file[*c];
        let children = (0..rest.len()).filter(|c| bvh.joints[*c].parent == Some(k));
        let children = children.filter(is_next).map(|c| rest[c] - rest[k]);
        (last_bone(skeleton, matches, j), bvh.end(k).into_iter().chain(children).sum())
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

/// The bone of a joint below which nothing is in the file: to its tail if that is [stated](states_tail), else amid
/// the joints to which it leads by their names, for eyes, a jaw or hair are not where a head points.
fn last_bone(skeleton: &Skeleton, matches: &Matches, j: usize) -> Vector {
    let joints = skeleton.joints();
    if states_tail(skeleton, j) {
        return joints[j].tail - joints[j].head;
    }
    let next = children(skeleton, j).filter(|c| matches.goes_on[*c]);
    next.map(|c| joints[c].head - joints[j].head).sum()
}

/// Whether the tail of a joint is its own. Skeletons of glTF files have none: there it is amid the joints below.
pub(super) fn states_tail(skeleton: &Skeleton, j: usize) -> bool {
    let joints = skeleton.joints();
    let count = children(skeleton, j).count();
    let sum: Vector = children(skeleton, j).map(|c| joints[c].head.coords).sum();
    count == 0 || (joints[j].tail.coords - sum / count as Real).norm() > SHORT
}

fn children(skeleton: &Skeleton, j: usize) -> impl Iterator<Item = usize> {
    let joints = skeleton.joints();
    (j + 1..joints.len()).filter(move |c| joints[*c].parent == Some(j))
}
