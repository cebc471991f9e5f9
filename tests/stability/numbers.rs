//! `if-core` with numbers from the ends of f64: denormals, 1e300, last digits, and all of them
//! mixed.

use crate::cases::{Random, Tally, cases, check, finite, share};
use crate::meshes;
use if_core::aabb::Aabb;
use if_core::closest::{closest_on_segment, closest_on_triangle};
use if_core::edges::{Edges, VertexTriangles};
use if_core::intersect::{is_degenerate, segment_triangle, triangles, triangles_sharing};
use if_core::math::{Point, Real, Vector, area_vector, barycentric_point, unit_or_zero};
use if_core::mesh::TriMesh;

/// A number from the ends of the range, or near one that was drawn before.
fn extreme(r: &mut Random) -> Real {
    const ENDS: [Real; 16] = [
        0.0,
        -0.0,
        5e-324,
        -5e-324,
        1e-310,
        Real::MIN_POSITIVE,
        1e-300,
        1e-160,
        1e-16,
        1.0,
        -1.0,
        1e16,
        1e154,
        1e160,
        1e300,
        Real::MAX,
    ];
    let x = r.pick(&ENDS);
    match r.below(5) {
        0 => -x,
        1 => x.next_up(),
        2 => x * r.unit(),
        3 => r.pick(&ENDS),
        _ => x,
    }
}

fn point(r: &mut Random) -> Point {
    let p = Point::new(extreme(r), extreme(r), extreme(r));
    if finite(&[p]) { p } else { Point::origin() }
}

/// Six points; half of the time some of them coincide, or share coordinates.
fn six(r: &mut Random) -> [Point; 6] {
    let mut p = [(); 6].map(|()| point(r));
    for _ in 0..r.below(6) {
        let (i, j, k) = (r.below(6), r.below(6), r.below(3));
        if r.chance(0.3) {
            p[i] = p[j];
        } else {
            p[i][k] = p[j][k];
        }
    }
    p
}

fn turned(t: [&Point; 3], turn: usize) -> [&Point; 3] {
    let t = [t[turn % 3], t[(turn + 1) % 3], t[(turn + 2) % 3]];
    if turn >= 3 { [t[1], t[0], t[2]] } else { t }
}

fn predicates(count: u32) -> Tally {
    cases("predicates at the ends", count, |r| {
        let p = six(r);
        let (a, b) = ([&p[0], &p[1], &p[2]], [&p[3], &p[4], &p[5]]);
        let contact = triangles(a, b);
        // Rational arithmetic is asked in if-core; here all orders of corners and triangles must
        // agree.
        for turn in 0..6 {
            check(
                triangles(turned(a, turn), b) == contact
                    && triangles(b, turned(a, turn)) == contact,
                || format!("{p:?}: corners turned by {turn} meet otherwise"),
            )?;
        }
        let apart = triangles_sharing(a, [0, 1, 2], b, [3, 4, 5]);
        check(apart == contact, || {
            format!("{p:?}: no common corner, yet {apart:?} for {contact:?}")
        })?;
        check(is_degenerate(a) == is_degenerate(turned(a, 4)), || {
            format!("{p:?}: degenerate by the order of corners")
        })?;
        if let Some(hit) = segment_triangle(&p[3], &p[4], a) {
            let good = (0.0..=1.0).contains(&hit.parameter)
                && hit.barycentric.iter().all(|b| (0.0..=1.0).contains(b));
            check(good && hit.direction.abs() == 1, || format!("{p:?}: {hit:?}"))?;
        }
        Ok(if contact.is_some() { "meet" } else { "apart" })
    })
}

#[test]
#[ignore = "stress"]
fn predicates_agree_with_themselves_at_the_ends_of_the_range() {
    let tally = predicates(10_000);
    assert!(share(&tally, "meet") > 0.05 && share(&tally, "apart") > 0.05, "{tally:?}");
}

#[test]
#[ignore = "stress"]
fn predicates_agree_with_themselves_in_three_million_questions() {
    // Each pair is asked about 14 times.
    predicates(220_000);
}

fn nearest(count: u32) -> Tally {
    cases("nearest points", count, |r| {
        // To the fourth power lengths must stay within the range.
        let scale = r.power(-70.0, 70.0);
        let flat = r.pick(&[1.0, 1e-3, 1e-8, 1e-16, 0.0]);
        let mut t = [(); 3].map(|()| {
            let v = r.vector(1.0);
            Point::new(v.x, v.y * flat, v.z) * scale
        });
        if r.chance(0.1) {
            t[0] = t[1];
        }
        if r.chance(0.1) {
            t[2] = t[0] + (t[1] - t[0]) * r.between(-1.0, 2.0);
        }
        let far = r.pick(&[1.5, 1.5, 1.5, 1e3]);
        let p = r.point(far * scale);
        let corners = [&t[0], &t[1], &t[2]];
        let (b, _) = closest_on_triangle(&p, corners[0], corners[1], corners[2]);
        let sum: Real = b.iter().sum();
        check(b.iter().all(|x| (0.0..=1.0).contains(x)) && (sum - 1.0).abs() < 1e-12, || {
            format!("{p:?} {t:?}: {b:?}")
        })?;
        let found = (barycentric_point(corners, b) - p).norm();
        // What a needle loses to rounding is a small part of its own size, seen from nearby.
        let size = Aabb::from_points(&t).diagonal();
        for _ in 0..20 {
            let (u, v) = (r.unit(), r.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let other = (barycentric_point(corners, [1.0 - u - v, u, v]) - p).norm();
            let slack = 1e-7 * size + 1e-12 * found;
            check(found <= other + slack, || {
                format!("{p:?} {t:?}: {found:e} found, {other:e} is nearer")
            })?;
        }
        let s = closest_on_segment(&p, &t[0], &t[1]);
        check((0.0..=1.0).contains(&s), || format!("{p:?} {t:?}: {s}"))?;
        Ok("ok")
    })
}

#[test]
fn nearest_points_are_nearest_at_every_size_and_on_needles() {
    nearest(5_000);
}

#[test]
#[ignore = "stress"]
fn nearest_points_are_nearest_a_hundred_thousand_times() {
    nearest(100_000);
}

#[test]
fn nothing_panics_at_the_ends_of_the_range_and_weights_stay_weights() {
    cases("all of if-core at the ends", 5_000, |r| {
        let p = six(r);
        let (b, _) = closest_on_triangle(&p[0], &p[1], &p[2], &p[3]);
        check(b.iter().all(|x| (0.0..=1.0).contains(x)), || format!("{p:?}: nearest at {b:?}"))?;
        let s = closest_on_segment(&p[0], &p[1], &p[2]);
        check((0.0..=1.0).contains(&s), || format!("{p:?}: nearest at {s}"))?;
        let u = unit_or_zero(&p[0].coords);
        check(u == Vector::zeros() || (u.norm() - 1.0).abs() < 1e-14, || {
            format!("{p:?}: a unit vector of {}", u.norm())
        })?;
        let mesh = TriMesh::new(p.to_vec(), vec![[0, 1, 2], [3, 4, 5], [2, 1, 3]])
            .map_err(|e| e.to_string())?;
        check(mesh.aabb().contains(&p[4]), || format!("{p:?}: not in its own box"))?;
        for n in mesh.face_normals().into_iter().chain(mesh.vertex_normals()) {
            check(n.norm() < 1.0 + 1e-12, || format!("{p:?}: a normal of {n:?}"))?;
        }
        let _ = (mesh.area(), mesh.signed_volume(), area_vector(&p[0], &p[1], &p[2]));
        Ok("ok")
    });
}

#[test]
fn tables_of_edges_are_whole_for_any_soup() {
    cases("edges of soups", 500, |r| {
        let (points, triangles) = (3 + r.below(20), 1 + r.below(60));
        let mesh = meshes::soup(r, points, triangles);
        let edges = Edges::new(&mesh);
        let sides: u32 = edges.valence.iter().sum();
        check(sides as usize == 3 * triangles, || {
            format!("{sides} sides of {triangles} triangles")
        })?;
        let round = VertexTriangles::new(&mesh);
        let all: usize = (0..points).map(|v| round.of(v).len()).sum();
        check(all == 3 * triangles, || format!("{all} corners of {triangles} triangles"))?;
        for walk in edges.boundary_loops(&mesh) {
            check(walk.iter().all(|v| (*v as usize) < points), || {
                format!("a loop through {walk:?}")
            })?;
        }
        Ok("ok")
    });
}
