//! Which way a body faces beside another one.

use super::similarity::Similarity;
use if_core::closest::ClosestPoint;
use if_core::math::{Point, Real, Vector, area_vector};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use nalgebra::Rotation3;
use rayon::prelude::*;

/// Distance, as a share of the height of a body, at which two places count as half as far apart as can be.
const APART: Real = 0.03;
/// Headings are tried in steps of so many degrees, then around the best in steps of one.
const WIDE: i32 = 10;
/// How many joints have to come near by a heading: limbs in another pose, and joints on one vertical, tell none.
const GAIN: Real = 0.5;
/// How much of the distance of surfaces a heading leaves at most. Where people stand alike, the right one leaves
/// less; of one who stands and one who strides or sits the best is no heading, and leaves more.
const LEFT: Real = 0.6;
/// Rounds of weights for the translation at a heading.
const ROUNDS: usize = 20;
/// Triangles that are compared, at most.
const TRIANGLES: usize = 1500;

/// The turn about the vertical, in whole degrees, after which the trunk of a body faces as that of another one: of
/// all headings the one at which the most joints come to lie near their twins on `to`, once scaled.
///
/// The least-squares similarity is turned by limbs in another pose, too.
pub(super) fn of_trunk(pairs: &[(Point, Point)], to: &TriMesh, scale: Real) -> Rotation3<Real> {
    let near = APART * to.aabb().size().y;
    let apart = |turn: &Rotation3<Real>| {
        let ways = pairs.iter().map(|(p, q)| q.coords - turn * p.coords * scale);
        sum_apart(&ways.collect::<Vec<_>>(), near)
    };
    let (turn, least) = nearest(&apart);
    if apart(&Rotation3::identity()) - least >= GAIN { turn } else { Rotation3::identity() }
}

/// The turn about the vertical, in whole degrees, after which the surface `from`, once scaled, lies nearest to `to`;
/// none unless it lies far nearer then.
pub(super) fn of_surfaces(from: &TriMesh, to: &TriMesh, scale: Real) -> Rotation3<Real> {
    let near = APART * to.aabb().size().y;
    let tree = Bvh::new(to);
    let every = from.triangles().len().div_ceil(TRIANGLES).max(1);
    let places = from.triangles().iter().step_by(every).map(|t| {
        let [a, b, c] = t.map(|v| from.vertices()[v as usize]);
        (Point::from((a.coords + b.coords + c.coords) / 3.0), area_vector(&a, &b, &c).norm())
    });
    let places: Vec<(Point, Real)> = places.collect();
    let apart = |turn: &Rotation3<Real>| -> Real {
        let similarity = Similarity::standing(from, to, *turn, scale);
        let distance = |(p, area): &(Point, Real)| {
            let near_to = tree.closest(&similarity.point(p), Real::INFINITY);
            area * near_to.map_or(0.0, |found| share_apart(found.distance, near))
        };
        places.par_iter().map(distance).collect::<Vec<_>>().iter().sum()
    };
    let (turn, least) = nearest(&apart);
    if least < LEFT * apart(&Rotation3::identity()) { turn } else { Rotation3::identity() }
}

/// Of all headings in whole degrees one at which `apart` is least, and its value there.
fn nearest(apart: &dyn Fn(&Rotation3<Real>) -> Real) -> (Rotation3<Real>, Real) {
    let about = |degrees: i32| {
        Rotation3::from_axis_angle(&Vector::y_axis(), Real::from(degrees).to_radians())
    };
    let least = |headings: &mut dyn Iterator<Item = i32>| {
        let tried = headings.map(|degrees| (apart(&about(degrees)), degrees));
        tried.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
    };
    let (_, start) = least(&mut (0..360).step_by(WIDE as usize));
    let (value, heading) = least(&mut (start - WIDE..=start + WIDE));
    (about(heading), value)
}

/// How far apart two places count at a distance: 1 for all that is much farther than `near` [Geman and McClure
/// 1985].
fn share_apart(distance: Real, near: Real) -> Real {
    let square = (distance / near).powi(2);
    square / (1.0 + square)
}

/// The least that these ways can all be [apart](share_apart) from one and the same.
fn sum_apart(ways: &[Vector], near: Real) -> Real {
    let count = ways.len().max(1) as Real;
    let mut mean = ways.iter().sum::<Vector>() / count;
    let share = |way: &Vector, mean: &Vector| share_apart((way - mean).norm(), near);
    for _ in 0..ROUNDS {
        let weight = |way| (1.0 - share(way, &mean)).powi(2);
        let weights: Vec<Real> = ways.iter().map(weight).collect();
        let sum: Vector = weights.iter().zip(ways).map(|(weight, way)| *weight * way).sum();
        mean = sum / weights.iter().sum::<Real>();
    }
    ways.iter().map(|way| share(way, &mean)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mannequin::{MannequinParams, body, rig};

    #[test]
    fn neither_limbs_nor_joints_on_one_vertical_turn_a_trunk() {
        let (body, skeleton) = (body(&MannequinParams::default()), rig::skeleton());
        let heading = |moved: fn(&str, Point) -> Point| {
            let joints = skeleton.joints().iter();
            let pairs: Vec<_> =
                joints.map(|j| (j.head, moved(&j.name, j.head) + Vector::x())).collect();
            of_trunk(&pairs, &body, 1.0)
        };
        let strides = heading(|name, p| {
            let forward = if name.starts_with("left") { 0.4 } else { -0.4 };
            let is_below = name.ends_with("shin") || name.ends_with("foot");
            if is_below { p + Vector::z() * forward } else { p }
        });
        let has_no_sides = heading(|_, p| Point::new(0.0, p.y, 0.0));
        assert_eq!([strides, has_no_sides], [Rotation3::identity(); 2]);
        let faces_sideways = heading(|_, p| Point::new(p.z, p.y, -p.x));
        let expected = Rotation3::from_axis_angle(&Vector::y_axis(), std::f64::consts::FRAC_PI_2);
        assert!(faces_sideways.angle_to(&expected) < 1e-9);
    }
}
