//! Adjoints against central differences, on a ball in a bent arm of two joints.

use super::*;
use crate::reconstruct::fields::skin::joint_maps;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

/// Parameters: radius and centre of a ball, d = p + Q x.
const COUNT: usize = 4 + 3 + 9;
type Theta = [Real; COUNT];

/// A ball of 15 cm in the elbow, and an offset of some millimetres that is not constant.
const THETA: Theta = [
    0.15, 0.02, -0.01, 0.03, // ball
    0.004, -0.003, 0.002, // p
    0.05, -0.08, 0.02, 0.06, -0.04, 0.03, -0.07, 0.01, 0.05, // Q
];

fn ball(theta: &Theta, x: &Point) -> FieldSample {
    let way = x - Point::new(theta[1], theta[2], theta[3]);
    // Not a distance: |∇φ| = 1 only on the surface, as in a network.
    let (r, length) = (theta[0], way.norm());
    FieldSample { distance: (length * length - r * r) / (2.0 * r), gradient: way / r }
}

fn offset(theta: &Theta, x: &Point) -> Offset {
    let jacobian = Matrix3::from_row_slice(&theta[7..16]);
    Offset { offset: Vector::new(theta[4], theta[5], theta[6]) + jacobian * x.coords, jacobian }
}

/// The weights of an elbow: the second joint's grows along x.
fn skin() -> Skin {
    let slope = Vector::new(2.0, 0.3, -0.2);
    Skin { at: Point::origin(), joints: vec![(0, 0.5, -slope), (1, 0.5, slope)] }
}

/// The lower arm turns by 40° about z.
fn joints() -> Vec<Affine> {
    let turn = UnitQuaternion::from_scaled_axis(Vector::new(0.1, 0.2, 0.7));
    let moved = Translation3::new(0.2, 0.1, -0.3);
    joint_maps(&[
        Isometry3::from_parts(moved, UnitQuaternion::identity()),
        Isometry3::from_parts(moved, turn),
    ])
}

fn place(theta: &Theta, x: &Point) -> Place {
    Place::new(x, ball(theta, x), &offset(theta, x), &skin(), &joints()).unwrap()
}

/// Rays from above that meet the ball at several angles.
fn rays() -> Vec<(Point, Vector)> {
    let from = Point::new(0.25, 1.5, -0.2);
    let target = |x: Real, z: Real| Point::new(0.22 + x, 0.1, -0.27 + z);
    [(0.0, 0.0), (0.08, 0.02), (-0.09, 0.03), (0.02, -0.1)]
        .map(|(x, z)| (from, (target(x, z) - from).normalize()))
        .to_vec()
}

/// Where a ray meets the posed ball, from the side of the camera.
fn hit(theta: &Theta, (from, along): &(Point, Vector)) -> Point {
    let mut x = Point::new(theta[1], theta[2] + theta[0], theta[3]);
    for _ in 0..50 {
        x += place(theta, &x).step_to_line(from, along);
    }
    let at = place(theta, &x);
    assert!(at.field.distance.abs() < 1e-12 && at.off_line(from, along) < 1e-12);
    assert!(at.normal.dot(along) < 0.0, "the near side");
    x
}

/// The derivative by the parameters of what the adjoint belongs to.
fn by_theta(adjoint: &Adjoint, theta: &Theta, x: &Point) -> Theta {
    let h = 1e-6;
    std::array::from_fn(|k| {
        let [a, b] = [-h, h].map(|h| {
            let mut theta = *theta;
            theta[k] += h;
            (ball(&theta, x), offset(&theta, x))
        });
        let change = adjoint.value * (b.0.distance - a.0.distance)
            + adjoint.gradient.dot(&(b.0.gradient - a.0.gradient))
            + adjoint.offset.dot(&(b.1.offset - a.1.offset))
            + adjoint.jacobian.dot(&(b.1.jacobian - a.1.jacobian));
        change / (2.0 * h)
    })
}

fn differences(loss: impl Fn(&Theta) -> Real) -> Theta {
    let h = 1e-6;
    std::array::from_fn(|k| {
        let [a, b] = [-h, h].map(|h| {
            let mut theta = THETA;
            theta[k] += h;
            loss(&theta)
        });
        (b - a) / (2.0 * h)
    })
}

fn assert_same(found: &Theta, expected: &Theta) {
    let largest = expected.iter().fold(0.0, |a: Real, b| a.max(b.abs()));
    for (k, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((a - b).abs() < 1e-5 * largest, "parameter {k}: {a}, by differences {b}");
    }
}

#[test]
fn the_jacobian_is_the_slope_of_the_posed_point() {
    let (x, h) = (Point::new(0.05, 0.1, -0.02), 1e-6);
    let at = place(&THETA, &x);
    for k in 0..3 {
        let step = Vector::ith(k, h);
        let slope =
            (place(&THETA, &(x + step)).posed - place(&THETA, &(x - step)).posed) / (2.0 * h);
        approx::assert_relative_eq!(slope, at.jacobian.column(k).into_owned(), epsilon = 1e-8);
    }
}

#[test]
fn the_adjoint_of_a_point_on_a_ray_is_its_central_difference() {
    let by_point = Vector::new(0.3, -0.7, 0.5);
    for ray in rays() {
        let x = hit(&THETA, &ray);
        let adjoint = place(&THETA, &x).of_point(&by_point, &ray.1).unwrap();
        let expected = differences(|theta| by_point.dot(&hit(theta, &ray).coords));
        assert_same(&by_theta(&adjoint, &THETA, &x), &expected);
    }
}

#[test]
fn the_adjoint_of_a_seen_normal_is_its_central_difference() {
    let seen = Vector::new(0.2, 0.9, -0.3).normalize();
    for ray in rays() {
        let x = hit(&THETA, &ray);
        let at = place(&THETA, &x);
        // L = 1 − n · N.
        let (skin, joints, h) = (skin(), joints(), 1e-6);
        let turned = at.of_normal(&-seen, &x, &skin, &joints);
        let beside = place(&THETA, &(x + turned.gradient.normalize() * h));
        let by_point = at.by_point(&turned, &beside, h);
        let adjoint = turned + at.of_point(&by_point, &ray.1).unwrap();
        let expected =
            differences(|theta| 1.0 - place(theta, &hit(theta, &ray)).unit_normal().dot(&seen));
        assert_same(&by_theta(&adjoint, &THETA, &x), &expected);
    }
}

#[test]
fn the_adjoint_of_a_silhouette_is_the_central_difference_of_its_distance() {
    // The farthest posed point of the ball along a direction u: the surface moves there along its
    // normal u, and where on the surface the farthest point is has no effect.
    let u = Vector::new(0.6, 0.0, 0.8);
    let farthest = |theta: &Theta| {
        let mut x = Point::new(theta[1], theta[2], theta[3]) + u * theta[0];
        // Fixed point: the canonical point whose posed normal is u.
        for _ in 0..200 {
            let at = place(theta, &x);
            let n = (at.jacobian.transpose() * u).normalize();
            x = Point::new(theta[1], theta[2], theta[3]) + n * theta[0];
        }
        x
    };
    let x = farthest(&THETA);
    let at = place(&THETA, &x);
    assert!((at.unit_normal() - u).norm() < 1e-9);
    let expected = differences(|theta| u.dot(&place(theta, &farthest(theta)).posed.coords));
    assert_same(&by_theta(&at.of_way(1.0), &THETA, &x), &expected);
}

#[test]
fn a_point_beside_the_surface_steps_onto_it() {
    let x = Point::new(0.2, 0.1, 0.05);
    let at = place(&THETA, &x);
    let on = x + at.step_to_surface();
    assert!(ball(&THETA, &on).distance.abs() < 0.3 * at.field.distance.abs());
    // A tangent line has no step and no adjoint.
    let tangent = at.jacobian * at.field.gradient.cross(&Vector::x());
    let along = tangent.normalize();
    let step = at.step_to_line(&Point::origin(), &along);
    assert!(!step.norm().is_finite() || step.norm() > 1e3);
    let flat = FieldSample { distance: 1.0, gradient: Vector::zeros() };
    assert!(Place::new(&x, flat, &offset(&THETA, &x), &skin(), &joints()).is_none());
}
