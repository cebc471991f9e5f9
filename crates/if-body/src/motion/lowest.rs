//! What is lowest of a skeleton and of a BVH file, to compare the heights of their hips.

use super::bones::states_tail;
use super::bvh::Bvh;
use super::matching::{Matches, above, below};
use crate::pose::Pose;
use crate::skeleton::Skeleton;
use if_core::math::{Point, Real, Vector};

/// Joints and ends of bones that both have.
///
/// Skeletons of glTF files have no end below a foot that is their last joint, and files have an `End Site` there:
/// a height down to each one's own lowest point would make the same rig smaller than itself.
pub(super) struct Lowest {
    /// Joints of the skeleton.
    heads: Vec<usize>,
    /// Joints of the skeleton at the end of whose bones the file has an end, too.
    tails: Vec<usize>,
    /// The height of the file's hips above the lowest of the same in its rest pose.
    pub(super) height_in_file: Real,
}

/// Least share of the height of a file's hips that must be above a joint of both, down to the knees, about:
/// less does not tell the size of legs.
const LEGS: Real = 0.4;
/// Longest end of a bone that is there for the syntax alone, as a share of the height of the hips.
const STUB: Real = 0.01;

impl Lowest {
    /// `rest` has the positions of the file's joints from its hips in the rest pose, where these are at `height`
    /// above the lowest of all below them.
    pub(super) fn new(
        bvh: &Bvh,
        skeleton: &Skeleton,
        matches: &Matches,
        (rest, height): (&[Vector], Real),
    ) -> Self {
        let joints = skeleton.joints();
        let parent = |j: usize| joints[j].parent;
        let parent_in_file = |k: usize| bvh.joints[k].parent;
        let [hips, hips_of_file] = matches.hips;
        let is_below = below(parent, joints.len(), |j| j == hips);
        let is_below_in_file = below(parent_in_file, rest.len(), |k| k == hips_of_file);
        let own = joints.iter().zip(&is_below).filter(|(_, is_below)| **is_below);
        let own_height =
            joints[hips].head.y - own.map(|(j, _)| j.head.y).fold(Real::INFINITY, Real::min);
        let mut has_below = vec![false; joints.len()];
        for [j, _] in matches.pairs() {
            above(parent, j).into_iter().for_each(|a| has_below[a] = true);
        }
        let (mut heads, mut tails, mut low) = (Vec::new(), Vec::new(), 0.0);
        for [j, k] in matches.pairs().filter(|[j, k]| is_below[*j] && is_below_in_file[*k]) {
            heads.push(j);
            low = Real::min(low, rest[k].y);
            if has_below[j] {
                continue;
            }
            // What goes on from the last joint of both: other joints, and ends of bones that have none.
            let goes_on = |a: usize| parent(a).filter(|_| matches.goes_on[a]);
            let own = below(goes_on, joints.len(), |a| a == j);
            let own: Vec<usize> = (j..joints.len()).filter(|a| own[*a]).collect();
            let is_last = |a: &&usize| own.iter().all(|b| parent(*b) != Some(**a));
            let is_long = |a: &&usize| {
                let bone = joints[**a].tail - joints[**a].head;
                states_tail(skeleton, **a) && bone.norm() > STUB * own_height
            };
            let own_tails: Vec<usize> =
                own.iter().filter(is_last).filter(is_long).copied().collect();
            let other = below(parent_in_file, rest.len(), |a| a == k);
            let other: Vec<usize> = (k..rest.len()).filter(|a| other[*a]).collect();
            let end = |a: &usize| bvh.end(*a).filter(|end| end.norm() > STUB * height);
            let other_ends: Vec<Real> =
                other.iter().filter_map(|a| Some((rest[*a] + end(a)?).y)).collect();
            // Where one has no ends, joints are compared if there are some.
            let ends = !own_tails.is_empty() && !other_ends.is_empty();
            let has_own = own.len() > 1 || !own_tails.is_empty();
            let has_other = other.len() > 1 || !other_ends.is_empty();
            if !has_own || !has_other {
                continue;
            }
            if ends || own.len() > 1 {
                heads.extend(&own[1..]);
            }
            if ends || own.len() == 1 {
                tails.extend(own_tails);
            }
            if ends || other.len() > 1 {
                low = other.iter().map(|a| rest[*a].y).fold(low, Real::min);
            }
            if ends || other.len() == 1 {
                low = other_ends.into_iter().fold(low, Real::min);
            }
        }
        if -low > LEGS * height {
            return Self { heads, tails, height_in_file: -low };
        }
        let all: Vec<usize> = (0..joints.len()).filter(|j| is_below[*j]).collect();
        Self { heads: all.clone(), tails: all, height_in_file: height }
    }

    /// The height of the hips of the skeleton in a pose.
    pub(super) fn height(&self, skeleton: &Skeleton, pose: &Pose, hips: usize) -> Real {
        let joints = skeleton.joints();
        let frames = skeleton.frames(pose).expect("a turn for each joint");
        let heads = self.heads.iter().map(|j| frames[*j].translation.y);
        let tail = |j: &usize| (frames[*j] * Point::from(joints[*j].tail - joints[*j].head)).y;
        let lowest = heads.chain(self.tails.iter().map(tail)).fold(Real::INFINITY, Real::min);
        frames[hips].translation.y - lowest
    }
}
