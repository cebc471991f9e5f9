//! Clips triangles to pieces that fixed point can represent.

use super::{GUARD, fixed_point};
use crate::camera::Camera;
use if_core::math::{Point, Real};

/// Clips a triangle with `corners` in the camera's frame at the near plane and far outside the
/// picture, and calls `take` with the remaining pieces.
///
/// The cut point of an edge does not depend on its triangle, as its ends are in ascending order of
/// `vertices`: neighbours leave no gap.
pub(super) fn pieces(
    vertices: [u32; 3],
    corners: &[Point; 3],
    camera: &Camera,
    near: Real,
    mut take: impl FnMut([[i32; 2]; 3]),
) {
    // From the smallest vertex on, and with edges cut from the smaller end: the same points for each
    // neighbour.
    let mut polygon: Vec<(u64, Point)> =
        (0..3).map(|k| (u64::from(vertices[k]), corners[k])).collect();
    let k = camera.intrinsics();
    let u = |p: &Point| k[(0, 0)] * p.x + k[(0, 1)] * p.y + k[(0, 2)] * p.z;
    let v = |p: &Point| k[(1, 1)] * p.y + k[(1, 2)] * p.z;
    // A little within the guard band, so that rounding leaves no cut point beyond it.
    let guard = 0.999 * GUARD;
    let planes: [&dyn Fn(&Point) -> Real; 5] = [
        &|p| p.z - near,
        &|p| u(p) + guard * p.z,
        &|p| guard * p.z - u(p),
        &|p| v(p) + guard * p.z,
        &|p| guard * p.z - v(p),
    ];
    for plane in planes {
        polygon = cut(&polygon, plane);
        if polygon.len() < 3 {
            return;
        }
    }
    let fixed: Vec<[i32; 2]> =
        polygon.iter().map(|(_, p)| fixed_point(&camera.to_pixel(p))).collect();
    for k in 1..fixed.len() - 1 {
        take([fixed[0], fixed[k], fixed[k + 1]]);
    }
}

/// The part of a polygon where `side` is not negative. A cut point gets an index made of those of
/// its edge's ends.
fn cut(polygon: &[(u64, Point)], side: &dyn Fn(&Point) -> Real) -> Vec<(u64, Point)> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (k, a) in polygon.iter().enumerate() {
        let b = &polygon[(k + 1) % polygon.len()];
        let (sa, sb) = (side(&a.1), side(&b.1));
        if sa >= 0.0 {
            out.push(*a);
        }
        if (sa >= 0.0) != (sb >= 0.0) {
            let ((p, sp), (q, sq)) =
                if a.0 < b.0 { ((a, sa), (b, sb)) } else { ((b, sb), (a, sa)) };
            let s = sp / (sp - sq);
            let at = p.1 + (q.1 - p.1) * s;
            out.push((
                (p.0 ^ q.0.rotate_left(21)).wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1 << 63,
                at,
            ));
        }
    }
    out
}
