//! Motions of one skeleton on another: bones point where those of the other point.

use super::bones::{Bones, bones};
use super::bvh::{Bvh, BvhError};
use super::lowest::Lowest;
use super::matching::{Matches, above, below, matches};
use super::standing::{Standing, stand};
use crate::pose::Pose;
use crate::skeleton::{Joint, Skeleton};
use if_core::math::{Real, Vector};
use nalgebra::UnitQuaternion;

type Turn = UnitQuaternion<Real>;

/// A motion for a skeleton.
pub(super) struct Retargeted {
    /// Translation of the root and rotations of all joints, for each frame.
    pub(super) poses: Vec<(Vector, Vec<Turn>)>,
    /// Joints of the skeleton that the motion does not have.
    pub(super) unmatched: Vec<String>,
    /// Joints of the file that no joint of the skeleton follows, the nearest to its hips first.
    pub(super) left_over: Vec<String>,
    /// Large bones of limbs that the file lacks while it has others of the limb, in words.
    pub(super) still: Vec<String>,
    /// From the origin to where the first frame has the hips on the floor of the file, at the size of the skeleton.
    pub(super) start: Vector,
    /// The frame that stands for the rest pose of the file.
    pub(super) rest_frame: Option<usize>,
}

/// The motion of a BVH file for a skeleton.
///
/// With B the rotation of a joint of the file in the world, the skeleton's joint has W = B A there,
/// where A turns its bone in the rest pose to that of the file: about y to the side that the person faces, then
/// the shortest way; of a hand as its arm, then the shortest way to its
/// fingers. Joints of the spine are matched by their share of its length, and so are those of neck and head that
/// no name matches, all others by name; those that the file lacks follow their parents. Translations are those of the [hips](hips), scaled by
/// their heights in the rest pose of the file; joints above them stay as they are. The first frame is above the origin; the floor of the file, y = 0, is that of the body where its
/// feet are near that, else its lowest joint or sole.
///
/// # Errors
///
/// The file has fewer than half of the joints, and lacks one of the large bones of the limbs; or its person
/// [stands](stand) along neither y nor z.
pub(super) fn retarget(mut bvh: Bvh, skeleton: &Skeleton) -> Result<Retargeted, BvhError> {
    let matches = matches(&bvh, skeleton)?;
    let Standing { height, facing, frame } = stand(&mut bvh, skeleton, &matches)?;
    let Matches { of, is_limb, is_end, hips: [hips, hips_of_file], .. } = &matches;
    let (hips, hips_of_file) = (*hips, *hips_of_file);
    let bvh = bvh;
    let rest = bvh.rest();
    let rest: Vec<Vector> = rest.iter().map(|p| p - rest[hips_of_file]).collect();
    let joints = skeleton.joints();
    let root = joints[hips].head;
    let is_below = below(|j| joints[j].parent, joints.len(), |j| j == hips);
    let own = joints.iter().zip(&is_below).filter_map(|(j, is_below)| is_below.then_some(j));

    let mut align: Vec<Turn> = Vec::with_capacity(joints.len());
    let of_limb = below(|j| joints[j].parent, joints.len(), |j| is_limb[j]);
    for (j, joint) in joints.iter().enumerate() {
        let inherited = joint.parent.map_or(facing, |p| align[p]);
        // A hand goes on as its arm; a head does not lean because the neck of the file does not.
        let going_on = if of_limb[j] { inherited } else { facing };
        align.push(match bones(&bvh, skeleton, &matches, &rest, j) {
            Bones::One(own, other) if is_end[j] && (going_on * own).angle(&other) > ASIDE => {
                going_on
            }
            // Opposite bones have no shortest way.
            Bones::One(own, other) => Turn::rotation_between(&(facing * own), &other)
                .map_or(inherited, |swing| swing * facing),
            Bones::Fan(own, other) => Turn::rotation_between(&(inherited * own), &other)
                .map_or(inherited, |swing| swing * inherited),
            Bones::Many => facing,
            Bones::None => going_on,
        });
    }
    let local = |turns: &[Turn]| {
        let mut world: Vec<Turn> = Vec::with_capacity(joints.len());
        let mut local = Vec::with_capacity(joints.len());
        for (j, joint) in joints.iter().enumerate() {
            let above = joint.parent.map_or(Turn::identity(), |p| world[p]);
            let turn = of[j].map_or(above, |k| turns[k] * align[j]);
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
    let both = Lowest::new(&bvh, skeleton, &matches, (&rest, height));
    let scale = both.height(skeleton, &as_file, hips) / both.height_in_file;
    let soles = (height - both.height_in_file) * scale;
    let floor = floor(own, root.y, soles);

    let first = bvh.frames(hips_of_file).next();
    let start = first.map_or(Vector::zeros(), |(p, _)| Vector::new(p.x, 0.0, p.z));
    let poses = bvh.frames(hips_of_file).map(|(position, turns)| {
        ((position - start) * scale - Vector::y() * (root.y - floor), local(&turns))
    });
    let above = above(|j| joints[j].parent, hips);
    let missing = (0..joints.len()).filter(|j| of[*j].is_none() && !above.contains(j));
    let unmatched = missing.map(|j| joints[j].name.clone()).collect();
    let poses = poses.collect();
    let left_over = left_over(&bvh, of, hips_of_file);
    let (start, still) = (start * scale, matches.still);
    Ok(Retargeted { poses, unmatched, left_over, still, start, rest_frame: frame })
}

/// Joints with channels below the hips of the file that no joint of the skeleton follows, the nearest to the hips
/// first: fingers come last.
fn left_over(bvh: &Bvh, of: &[Option<usize>], hips: usize) -> Vec<String> {
    let parent = |k: usize| bvh.joints[k].parent;
    let mut is_free = below(parent, bvh.joints.len(), |k| k == hips);
    of.iter().flatten().for_each(|k| is_free[*k] = false);
    let mut depth: Vec<usize> = Vec::with_capacity(bvh.joints.len());
    (0..bvh.joints.len()).for_each(|k| depth.push(parent(k).map_or(0, |p| depth[p] + 1)));
    let is_left = |k: &usize| is_free[*k] && bvh.joints[*k].has_channels();
    let mut free: Vec<usize> = (0..bvh.joints.len()).filter(is_left).collect();
    free.sort_by_key(|k| depth[*k]);
    free.into_iter().map(|k| bvh.joints[k].name.clone()).collect()
}

/// The height of the floor of these joints, whose hips are at `hips`. Without a bone below their lowest one, soles
/// are below it as far as in the file.
fn floor<'a>(joints: impl Iterator<Item = &'a Joint>, hips: Real, soles: Real) -> Real {
    let ends = |j: &Joint| [j.head, j.tail].map(|end| (end.y, j.head != j.tail));
    let lowest = joints.flat_map(ends).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let (lowest, has_bone) = lowest.unwrap_or((hips, true));
    let (most, soles) = if has_bone { (SOLE, 0.0) } else { (ANKLE, soles) };
    if lowest.abs() < most * (hips - lowest) { 0.0 } else { lowest - soles }
}

/// Height of the lowest end of a bone, as a share of that of the hips, up to which a body stands on y = 0: soles are
/// a little lower than joints.
const SOLE: Real = 0.1;
/// The same of a joint without a bone, such as an ankle of glTF files.
const ANKLE: Real = 0.2;
/// Angle between the last bones of a limb or the head, beyond which the file has something else there: a
/// foot whose bone leads down to the sole, a head whose bone leads to the face.
const ASIDE: Real = std::f64::consts::FRAC_PI_4;
