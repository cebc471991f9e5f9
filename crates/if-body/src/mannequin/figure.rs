//! The person: proportions of an average woman of 1.70 m.

use crate::mannequin::shape::{Part, Ring, Shape, Solid};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};

/// The left shoulder joint.
pub(super) const SHOULDER: Point = Point::new(0.160, 1.362, -0.020);
/// The left elbow.
pub(super) const ELBOW: Point = Point::new(0.346, 1.152, -0.028);
/// The left wrist.
pub(super) const WRIST: Point = Point::new(0.506, 0.964, 0.012);

/// A part, and its mirror image in x = 0.
fn both(solid: Solid, blend: Real) -> [Part; 2] {
    let left = Part::new(solid, blend);
    [left.clone(), left.mirrored()]
}

fn cone(from: Point, from_radius: Real, to: Point, to_radius: Real) -> Solid {
    Solid::Cone { from, to, from_radius, to_radius }
}

fn egg(center: [Real; 3], radii: [Real; 3]) -> Solid {
    Solid::Ellipsoid { center: center.into(), axes: [Vector::x(), Vector::y(), Vector::z()], radii }
}

/// Hips to neck.
pub(super) fn torso() -> Vec<Part> {
    let ring = |y, half_width, half_depth, z| Ring { y, half_width, half_depth, z };
    let rings = vec![
        ring(0.790, 0.120, 0.085, -0.010),
        ring(0.860, 0.166, 0.100, -0.012),
        ring(0.925, 0.172, 0.104, -0.012),
        ring(1.000, 0.148, 0.096, -0.004),
        ring(1.070, 0.122, 0.086, 0.002),
        ring(1.150, 0.128, 0.090, 0.002),
        ring(1.230, 0.142, 0.098, -0.002),
        ring(1.310, 0.150, 0.094, -0.012),
        ring(1.370, 0.142, 0.080, -0.020),
        ring(1.412, 0.100, 0.066, -0.024),
        ring(1.440, 0.066, 0.058, -0.022),
        ring(1.480, 0.053, 0.053, -0.012),
        ring(1.540, 0.050, 0.052, 0.000),
    ];
    let mut parts = vec![Part::new(Solid::Loft { rings, round: 0.02 }, 0.02)];
    parts.extend(both(
        cone(Point::new(0.030, 1.462, -0.030), 0.030, Point::new(0.132, 1.392, -0.026), 0.028),
        0.040,
    )); // shoulders
    parts.extend(both(egg([0.066, 1.240, 0.064], [0.056, 0.056, 0.044]), 0.050)); // breasts
    parts.extend(both(egg([0.078, 0.875, -0.055], [0.082, 0.095, 0.070]), 0.050)); // seat
    parts
}

/// The left hip, knee and ankle.
pub(super) const LEG: [Point; 3] = [
    Point::new(0.088, 0.880, -0.004),
    Point::new(0.102, 0.470, 0.012),
    Point::new(0.116, 0.080, -0.022),
];

/// Hips to knees.
pub(super) fn thighs() -> Vec<Part> {
    both(cone(LEG[0], 0.084, LEG[1], 0.047), 0.035).into()
}

/// Knees to ankles.
pub(super) fn shins() -> Vec<Part> {
    let mut parts = Vec::from(both(cone(LEG[1], 0.047, LEG[2], 0.031), 0.018));
    parts.extend(both(egg([0.109, 0.340, -0.022], [0.042, 0.125, 0.046]), 0.030)); // calf
    parts
}

/// Shoulders to wrists.
pub(super) fn arms() -> Vec<Part> {
    let mut parts = Vec::new();
    parts.extend(both(cone(SHOULDER, 0.048, ELBOW, 0.033), 0.045));
    parts.extend(both(cone(ELBOW, 0.034, WRIST, 0.023), 0.016));
    parts
}

/// Parts that clothes do not cover: head, hands and feet.
fn extremities() -> Vec<Part> {
    let mut parts = vec![
        Part::new(egg([0.0, 1.598, 0.008], [0.072, 0.096, 0.090]), 0.020), // skull
        Part::new(egg([0.0, 1.540, 0.036], [0.048, 0.056, 0.056]), 0.040), // jaw
        Part::new(egg([0.0, 1.570, 0.098], [0.012, 0.022, 0.018]), 0.014), // nose
        Part::new(egg([0.0, 1.640, -0.010], [0.088, 0.074, 0.104]), 0.003), // hair
        Part::new(egg([0.0, 1.580, -0.036], [0.080, 0.092, 0.066]), 0.020), // and its lower part
        Part::new(egg([0.0, 1.668, -0.108], [0.036, 0.036, 0.034]), 0.010), // and a bun
    ];
    // The hand hangs in line with the forearm, its palm towards the thigh.
    let along = (WRIST - ELBOW).normalize();
    let across = (Vector::z() - along * along.z).normalize();
    let through = along.cross(&across);
    let axes = [along, across, through];
    let mitt = |at: Real, aside: Real, radii| Solid::Ellipsoid {
        center: WRIST + along * at + across * aside,
        axes,
        radii,
    };
    parts.extend(both(mitt(0.058, 0.0, [0.060, 0.038, 0.019]), 0.025));
    parts.extend(both(mitt(0.112, -0.002, [0.066, 0.033, 0.016]), 0.025));
    let thumb = WRIST + along * 0.035 + across * 0.026;
    parts.extend(both(cone(thumb, 0.014, thumb + along * 0.058 + across * 0.026, 0.011), 0.014));
    let (ankle, heel, toe) = (
        Point::new(0.116, 0.085, -0.024),
        Point::new(0.117, 0.030, -0.042),
        Point::new(0.136, 0.014, 0.136),
    );
    parts.extend(both(cone(heel, 0.036, toe, 0.030), 0.030));
    parts.extend(both(cone(ankle, 0.036, Point::new(0.126, 0.038, 0.050), 0.034), 0.030));
    parts
}

/// The whole body.
pub(super) fn figure() -> Shape {
    let mut parts = torso();
    parts.extend(thighs());
    parts.extend(shins());
    parts.extend(arms());
    parts.extend(extremities());
    Shape {
        parts,
        ease: Box::new(|_| 0.0),
        dips: None,
        floor: 0.0,
        region: Aabb { min: Point::new(-0.70, -0.02, -0.20), max: Point::new(0.70, 1.76, 0.22) },
    }
}
