//! Meshes with known answers. All wind counter-clockwise seen from outside.

use crate::math::{Point, Real, Vector};
use crate::mesh::TriMesh;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// A sphere about the origin: the icosahedron, its triangles split into four `subdivisions` times
/// and pushed onto the sphere. `20 · 4ⁿ` triangles, `10 · 4ⁿ + 2` vertices, all on the sphere.
///
/// # Panics
///
/// If there are more than 12 subdivisions, which 32-bit indices cannot name.
pub fn icosphere(radius: Real, subdivisions: u32) -> TriMesh {
    assert!(
        subdivisions <= 12,
        "an icosphere of {subdivisions} subdivisions has too many vertices"
    );
    let g = (1.0 + 5.0f64.sqrt()) / 2.0;
    let mut v: Vec<Vector> = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ]
    .iter()
    .map(|c| Vector::from(*c).normalize())
    .collect();
    #[rustfmt::skip]
    let mut t: Vec<[u32; 3]> = vec![
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
        [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ];
    for _ in 0..subdivisions {
        let mut middles = BTreeMap::new();
        let mut middle = |i: u32, j: u32| {
            *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                v.push((v[i as usize] + v[j as usize]).normalize());
                v.len() as u32 - 1
            })
        };
        t = t
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    checked(v.iter().map(|n| Point::from(n * radius)).collect(), t)
}

/// A tube about the y axis, from `y = 0` to `height`: `around` corners in each of `along + 1`
/// rings. Open at both ends, or `closed` by a fan each, when its volume is `height · radius² ·
/// around · sin(2π / around) / 2`.
///
/// # Panics
///
/// If `around` is below 3 or `along` is 0.
pub fn tube(radius: Real, height: Real, around: u32, along: u32, closed: bool) -> TriMesh {
    assert!(
        around >= 3 && along >= 1,
        "a tube needs 3 corners around and 1 step along, not {around} and {along}"
    );
    let ring = |y: u32| (radius, height * Real::from(y) / Real::from(along));
    let (mut v, mut t) = rings(&(0..=along).map(ring).collect::<Vec<_>>(), around);
    if closed {
        let (bottom, top) = (v.len() as u32, v.len() as u32 + 1);
        v.extend([Point::origin(), Point::new(0.0, height, 0.0)]);
        for k in 0..around {
            let next = (k + 1) % around;
            t.extend([[bottom, k, next], [top, along * around + next, along * around + k]]);
        }
    }
    checked(v, t)
}

/// A surface of revolution about the y axis, open at both ends: `around` corners in a ring for each
/// radius and height of the `profile`. Normals point outwards where the profile rises.
///
/// # Panics
///
/// If `around` is below 3, the profile has fewer than 2 rings, or a number of it is not finite.
pub fn revolved(profile: &[(Real, Real)], around: u32) -> TriMesh {
    assert!(
        around >= 3 && profile.len() >= 2,
        "a surface of revolution needs 3 corners around and 2 rings, not {around} and {}",
        profile.len()
    );
    let (v, t) = rings(profile, around);
    checked(v, t)
}

/// The vertices of [`revolved`], and the triangles between each ring and the next.
fn rings(profile: &[(Real, Real)], around: u32) -> (Vec<Point>, Vec<[u32; 3]>) {
    let mut v = Vec::new();
    for (radius, y) in profile {
        for k in 0..around {
            let (s, c) = (TAU * Real::from(k) / Real::from(around)).sin_cos();
            v.push(Point::new(radius * c, *y, radius * s));
        }
    }
    let mut t = Vec::new();
    for ring in 1..profile.len() as u32 {
        for k in 0..around {
            let (a, b) = ((ring - 1) * around + k, (ring - 1) * around + (k + 1) % around);
            t.extend([[a, b + around, b], [a, a + around, b + around]]);
        }
    }
    (v, t)
}

/// A ring about the y axis; all vertices lie on the torus. `2 · around · across` triangles.
///
/// # Panics
///
/// If `around` or `across` is below 3.
pub fn torus(major: Real, minor: Real, around: u32, across: u32) -> TriMesh {
    assert!(
        around >= 3 && across >= 3,
        "a ring needs 3 corners around and across, not {around} and {across}"
    );
    let mut v = Vec::new();
    let mut t = Vec::new();
    for i in 0..around {
        let (s, c) = (TAU * Real::from(i) / Real::from(around)).sin_cos();
        for j in 0..across {
            let (up, out) = (TAU * Real::from(j) / Real::from(across)).sin_cos();
            let r = major + minor * out;
            v.push(Point::new(r * c, minor * up, r * s));
            let at = |i: u32, j: u32| (i % around) * across + j % across;
            let (a, b, d, e) = (at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
            t.extend([[a, d, e], [a, e, b]]);
        }
    }
    checked(v, t)
}

/// A flat sheet in `z = 0` from the origin to `(width, height)`, facing +z: `nx · ny` squares, each
/// cut from its lower left to its upper right corner.
///
/// # Panics
///
/// If `nx` or `ny` is 0.
pub fn cloth(width: Real, height: Real, nx: u32, ny: u32) -> TriMesh {
    assert!(nx >= 1 && ny >= 1, "a cloth needs a square in each direction, not {nx} by {ny}");
    let mut v = Vec::new();
    for y in 0..=ny {
        for x in 0..=nx {
            v.push(Point::new(
                width * Real::from(x) / Real::from(nx),
                height * Real::from(y) / Real::from(ny),
                0.0,
            ));
        }
    }
    let mut t = Vec::new();
    for y in 0..ny {
        for x in 0..nx {
            let a = y * (nx + 1) + x;
            t.extend([[a, a + 1, a + nx + 2], [a, a + nx + 2, a + nx + 1]]);
        }
    }
    checked(v, t)
}

/// A closed box about the origin: 8 vertices, 12 triangles.
pub fn cuboid(half: Vector) -> TriMesh {
    let v = (0..8u8)
        .map(|k| {
            let s = |bit: u8| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
            Point::new(s(0) * half.x, s(1) * half.y, s(2) * half.z)
        })
        .collect();
    #[rustfmt::skip]
    let t = vec![
        [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
        [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5],
    ];
    checked(v, t)
}

fn checked(v: Vec<Point>, t: Vec<[u32; 3]>) -> TriMesh {
    TriMesh::new(v, t)
        .expect("the indices are made for the vertices, which are finite for finite sizes")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edges::Edges;
    use crate::field::SignedDistance;
    use crate::shapes::{Sphere, Torus};

    fn boundary_edges(mesh: &TriMesh) -> usize {
        Edges::new(mesh).valence.iter().filter(|v| **v == 1).count()
    }

    #[test]
    fn closed_meshes_are_closed_and_face_outwards() {
        let pi = std::f64::consts::PI;
        let sphere = icosphere(0.5, 4);
        assert_eq!((sphere.vertices().len(), sphere.triangles().len()), (2562, 5120));
        // 4^4 triangles for each side of the icosahedron: the chords lose about 0.3 %.
        approx::assert_relative_eq!(sphere.signed_volume(), pi / 6.0, max_relative = 5e-3);
        approx::assert_relative_eq!(sphere.area(), pi, max_relative = 5e-3);
        let ring = torus(1.0, 0.25, 96, 48);
        approx::assert_relative_eq!(
            ring.signed_volume(),
            2.0 * pi * pi / 16.0,
            max_relative = 5e-3
        );
        let tin = tube(0.5, 2.0, 7, 3, true);
        approx::assert_relative_eq!(
            tin.signed_volume(),
            2.0 * 0.25 * 7.0 * (TAU / 7.0).sin() / 2.0,
            max_relative = 1e-12
        );
        let brick = cuboid(Vector::new(0.5, 1.0, 1.5));
        approx::assert_relative_eq!(brick.signed_volume(), 6.0, max_relative = 1e-15);
        approx::assert_relative_eq!(brick.area(), 22.0, max_relative = 1e-15);
        for mesh in [&sphere, &ring, &tin, &brick] {
            assert_eq!(boundary_edges(mesh), 0);
            assert!(Edges::new(mesh).valence.iter().all(|v| *v == 2));
        }
    }

    #[test]
    fn open_meshes_have_the_openings_they_should_have() {
        assert_eq!(boundary_edges(&tube(0.5, 2.0, 7, 3, false)), 14);
        assert_eq!(boundary_edges(&cloth(1.0, 2.0, 3, 4)), 14);
        approx::assert_relative_eq!(cloth(1.0, 2.0, 3, 4).area(), 2.0, max_relative = 1e-14);
        assert!(cloth(1.0, 2.0, 3, 4).face_normals().iter().all(|n| n.z > 0.999));
        let wall = tube(0.5, 2.0, 64, 1, false);
        assert!(wall.face_normals().iter().enumerate().all(|(t, n)| {
            n.dot(&(wall.corners(t)[0] - Point::new(0.0, wall.corners(t)[0].y, 0.0))) > 0.0
        }));
    }

    #[test]
    fn vertices_lie_on_the_analytic_surface() {
        let ball = Sphere { center: Point::origin(), radius: 0.3 };
        assert!(icosphere(0.3, 3).vertices().iter().all(|p| ball.distance(p).abs() < 1e-15));
        let ring = Torus { center: Point::origin(), major: 0.4, minor: 0.1 };
        assert!(torus(0.4, 0.1, 9, 7).vertices().iter().all(|p| ring.distance(p).abs() < 1e-15));
    }
}
