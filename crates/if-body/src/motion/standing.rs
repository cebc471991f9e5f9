//! The pose of a BVH file that counts as rest: a person who stands along y.
//!
//! ```text
//! the rest pose of the file, with y up, or z
//! else the frame whose limbs point the most as those of the skeleton at rest
//! frames have the other axis up, if the person stands along that in them
//! ```
//!
//! Programs that lay the x axis of each joint along its bone write a rest pose that is no person.

use super::bones::{Bones, bones};
use super::bvh::{Bvh, BvhError};
use super::matching::{Matches, below};
use crate::skeleton::Skeleton;
use if_core::math::{Real, Vector};
use nalgebra::UnitQuaternion;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

type Turn = UnitQuaternion<Real>;

/// How the person of a file stands in the pose that counts as rest.
pub(super) struct Standing {
    /// Of the hips, above the lowest joint below them.
    pub(super) height: Real,
    /// The turn about y from the skeleton to the file.
    pub(super) facing: Turn,
    /// The frame that stands for the rest pose of the file.
    pub(super) frame: Option<usize>,
}

/// Lets a file stand along y.
///
/// # Errors
///
/// The person is upright along neither y nor z, at rest and in the frames.
pub(super) fn stand(
    bvh: &mut Bvh,
    skeleton: &Skeleton,
    matches: &Matches,
) -> Result<Standing, BvhError> {
    let at_rest = [1, 2].into_iter().find_map(|up| {
        bvh.stand_along(up);
        Some((height(bvh, skeleton, matches)?, None, up))
    });
    let in_frame = |bvh: &mut Bvh, up| {
        bvh.stand_along(up);
        let (height, frame) = likest_frame(bvh, skeleton, matches)?;
        Some((height, Some(frame), up))
    };
    let (height, frame, up) = match at_rest {
        Some(found) => found,
        None => [1, 2].into_iter().find_map(|up| in_frame(bvh, up)).ok_or_else(|| {
            bvh.stand_along(1);
            let [size, _] = extent(bvh, matches.hips[1]);
            BvhError::NotUpright { height: size.y, width: size.x, depth: size.z }
        })?,
    };
    let facing = match frame {
        None => heading_at_rest(bvh, skeleton, matches),
        Some(_) => heading(bvh, skeleton, matches, matches.thighs.iter().copied()),
    };
    // In the axes with y up.
    let other = if up == 1 { Vector::z() } else { -Vector::z() };
    if stands_in_frames(bvh, matches, height, other) {
        bvh.turn_frames(Turn::from_axis_angle(&Vector::x_axis(), -FRAC_PI_2 * other.z));
    }
    let facing = Turn::from_axis_angle(&Vector::y_axis(), facing);
    Ok(Standing { height, facing, frame })
}

/// The height of the hips of a person who stands along y.
fn height(bvh: &Bvh, skeleton: &Skeleton, matches: &Matches) -> Option<Real> {
    let [size, low] = extent(bvh, matches.hips[1]);
    // The span of stretched arms is a person's height; legs are nearly half of it.
    let stands = -low.y > 0.25 * size.max() && is_up(bvh, skeleton, matches);
    stands.then_some(-low.y)
}

/// Frames that are compared, at most about.
const MOST_FRAMES: usize = 1000;
/// Least mean cosine between the bones of limbs, of a person with hanging arms and one with stretched ones,
/// say.
const LIKE: Real = 0.5;

/// Takes the upright frame whose limbs point the most as those of the skeleton at rest as the rest pose;
/// returns the height of the hips there, and the frame.
fn likest_frame(bvh: &mut Bvh, skeleton: &Skeleton, matches: &Matches) -> Option<(Real, usize)> {
    let mut best: Option<(Real, Real, usize)> = None;
    for frame in (0..bvh.len()).step_by(1 + bvh.len() / MOST_FRAMES) {
        bvh.rest_as_in(frame);
        if let Some(height) = height(bvh, skeleton, matches) {
            let likeness = likeness(bvh, skeleton, matches);
            if likeness > best.map_or(LIKE, |(most, ..)| most) {
                best = Some((likeness, height, frame));
            }
        }
    }
    let (_, height, frame) = best?;
    bvh.rest_as_in(frame);
    Some((height, frame))
}

/// The mean cosine between the bones of the limbs.
fn likeness(bvh: &Bvh, skeleton: &Skeleton, matches: &Matches) -> Real {
    let angle = heading(bvh, skeleton, matches, matches.thighs.iter().copied());
    let facing = Turn::from_axis_angle(&Vector::y_axis(), angle);
    let rest = bvh.rest();
    let cosine = |j| match bones(bvh, skeleton, matches, &rest, j) {
        Bones::One(own, other) | Bones::Fan(own, other) => {
            Some((facing * own).dot(&other) / (own.norm() * other.norm()))
        }
        Bones::None | Bones::Many => None,
    };
    let limbs = (0..skeleton.len()).filter(|j| matches.is_limb[*j]);
    let cosines: Vec<Real> = limbs.filter_map(cosine).collect();
    cosines.iter().sum::<Real>() / cosines.len().max(1) as Real
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

/// Whether joints of the file lie the higher, the higher those of the skeleton do.
fn is_up(bvh: &Bvh, skeleton: &Skeleton, matches: &Matches) -> bool {
    let (joints, rest) = (skeleton.joints(), bvh.rest());
    let heights: Vec<[Real; 2]> =
        matches.pairs().map(|[j, k]| [joints[j].head.y, rest[k].y]).collect();
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

/// The angle about y from the skeleton to the file, by these joints of both.
fn heading(
    bvh: &Bvh,
    skeleton: &Skeleton,
    matches: &Matches,
    pairs: impl Iterator<Item = [usize; 2]>,
) -> Real {
    let (joints, rest) = (skeleton.joints(), bvh.rest());
    let [hips, hips_of_file] = matches.hips;
    let (mut along, mut across) = (0.0, 0.0);
    for [j, k] in pairs {
        let (p, q) = (joints[j].head - joints[hips].head, rest[k] - rest[hips_of_file]);
        along += p.x * q.x + p.z * q.z;
        across += p.z * q.x - p.x * q.z;
    }
    across.atan2(along)
}

/// Least angle from the nearest quarter turn at which a rest pose is turned, in radians: 1°, at which hands are
/// 12 mm aside. At ten times more a rig that is turned by 5° is twisted between pelvis and limbs; at ten times
/// less the rounding of a file's offsets decides.
const TURNED: Real = PI / 180.0;

/// The angle about y from the skeleton to the rest pose of the file: that of the lines through hips and
/// shoulders if these lie aside by more than they differ, else the nearest quarter turn.
///
/// All joints together tell only the quarter: a raised arm, a stride or a missing forearm turns them by 10°.
fn heading_at_rest(bvh: &Bvh, skeleton: &Skeleton, matches: &Matches) -> Real {
    let nearest_quarter = |angle: Real| (angle / FRAC_PI_2).round() * FRAC_PI_2;
    let lines = matches.hip_line.zip(matches.shoulder_line);
    let of_lines = lines.and_then(|(hips, shoulders)| {
        let of_hips = line_heading(bvh, skeleton, hips)?;
        // Between -π and π, so that their mean lies between them.
        let twist = line_heading(bvh, skeleton, shoulders)? - of_hips;
        let twist = twist - (twist / TAU).round() * TAU;
        let angle = of_hips + 0.5 * twist;
        let aside = (angle - nearest_quarter(angle)).abs();
        (aside > twist.abs().max(TURNED)).then_some(angle)
    });
    let of_all = || nearest_quarter(heading(bvh, skeleton, matches, matches.pairs()));
    of_lines.unwrap_or_else(of_all)
}

/// The angle about y from the line through two joints of the skeleton to that of the file; `None` if one of them
/// is upright.
fn line_heading(bvh: &Bvh, skeleton: &Skeleton, line: [[usize; 2]; 2]) -> Option<Real> {
    let (joints, rest) = (skeleton.joints(), bvh.rest());
    let [[a, k], [b, m]] = line;
    let (p, q) = (joints[b].head - joints[a].head, rest[m] - rest[k]);
    let [own, other] = [p, q].map(|along| (along.x != 0.0 || along.z != 0.0).then_some(along));
    let (p, q) = (own?, other?);
    Some((p.z * q.x - p.x * q.z).atan2(p.x * q.x + p.z * q.z))
}

/// Least cosine between trunk and axis of a person who stands.
const STANDS: Real = 0.5;
/// Share of the frames in which a person stands along an axis that is up.
const MOST: Real = 0.9;
/// Heights of hips over those in the rest pose, the median of the frames, of a person on a floor.
const ON_FLOOR: std::ops::RangeInclusive<Real> = 0.75..=1.25;

/// Whether the person stands along another axis than y in the frames, on a floor at zero, and never along
/// y, as of programs that write their own axes for the frames and others for the rest pose.
fn stands_in_frames(bvh: &Bvh, matches: &Matches, height: Real, axis: Vector) -> bool {
    let [_, hips] = matches.hips;
    let rest = bvh.rest();
    let trunk = matches.chest.and_then(|[_, chest]| (rest[chest] - rest[hips]).try_normalize(0.0));
    let Some(trunk) = trunk else { return false };
    let (mut count, mut heights) = (0, Vec::new());
    for (position, turns) in bvh.frames(hips) {
        let trunk = turns[hips] * trunk;
        if trunk.y > STANDS {
            return false;
        }
        count += usize::from(trunk.dot(&axis) > STANDS);
        heights.push(position.dot(&axis) / height);
    }
    heights.sort_by(Real::total_cmp);
    let median = heights.get(heights.len() / 2);
    count as Real >= MOST * heights.len() as Real && median.is_some_and(|h| ON_FLOOR.contains(h))
}
