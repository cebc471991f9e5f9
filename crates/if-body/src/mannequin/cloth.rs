//! The patterns of garments: the parts below them, their ease, and where they are cut open.
//!
//! Each garment covers the parts of those below it and some of its own, with a wider ease: without
//! dips, layers do not touch.

use crate::mannequin::Garment;
use crate::mannequin::figure::{ELBOW, SHOULDER, WRIST, arms, figure, shins, thighs, torso};
use crate::mannequin::shape::{Dips, Formula, Part, Ring, Shape, Solid, ramp};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};
use std::f64::consts::TAU;

/// The pattern of a garment.
pub(super) struct Pattern {
    /// Its surface, closed.
    pub(super) shape: Shape,
    /// Cell size of the lattice of the extraction, in metres.
    pub(super) cell: Real,
    /// Offset of that lattice, different for each garment.
    pub(super) phase: [Real; 3],
    /// Cuts: the surface is removed where a formula is positive.
    pub(super) cuts: Vec<Formula>,
}

/// The pattern of a garment whose dips have `overlap` of their full depth.
pub(super) fn pattern(kind: Garment, overlap: Real) -> Pattern {
    let (mut shape, cell, phase, cuts) = match kind {
        Garment::Trousers => (trousers(), 0.0145, [0.83, 0.21, 0.47], trousers_cuts()),
        Garment::Tshirt => (tshirt(), 0.0140, [0.37, 0.62, 0.18], tshirt_cuts()),
        Garment::Skirt => (skirt(), 0.0150, [0.11, 0.44, 0.71], skirt_cuts()),
        Garment::Jacket => (jacket(), 0.0155, [0.56, 0.09, 0.93], jacket_cuts()),
        Garment::Coat => (coat(), 0.0165, [0.28, 0.87, 0.33], coat_cuts()),
    };
    if overlap > 0.0 {
        // The layers it dips into, depth, wavelength, seed, and the wave height above which it dips.
        let (into, depth, length, seed, above) = match kind {
            Garment::Trousers => (vec![figure()], 0.005, 0.24, 1, -0.1),
            Garment::Tshirt => (vec![figure()], 0.008, 0.23, 4, -0.2),
            Garment::Skirt => (vec![tshirt()], 0.010, 0.28, 5, 0.0),
            Garment::Jacket => (vec![tshirt(), skirt()], 0.014, 0.30, 7, 0.0),
            Garment::Coat => (vec![jacket()], 0.020, 0.36, 9, 0.0),
        };
        shape.dips = Some(Dips {
            into,
            depth,
            weight: Box::new(move |p| overlap * ramp(waves(p, length, seed), above, above + 0.6)),
        });
    }
    Pattern { shape, cell, phase, cuts }
}

fn trousers() -> Shape {
    let mut parts = torso();
    parts.extend(thighs());
    parts.extend(shins());
    let (knee, hem) = (Point::new(0.104, 0.470, 0.006), Point::new(0.120, 0.040, -0.012));
    let leg =
        Part::new(Solid::Cone { from: knee, to: hem, from_radius: 0.058, to_radius: 0.062 }, 0.03);
    parts.extend([leg.mirrored(), leg]);
    shape(parts, [0.30, 0.06, 1.06], |p| {
        0.0065 + 0.010 * ramp(p.y, 0.80, 0.45) + 0.002 * waves(p, 0.11, 1)
    })
}

fn trousers_cuts() -> Vec<Formula> {
    vec![Box::new(|p| p.y - 1.015 - 0.1 * p.z), Box::new(|p| 0.095 - p.y)]
}

fn tshirt() -> Shape {
    shape(shirt_parts(), [0.36, 0.88, 1.50], |p| {
        0.0125 + 0.009 * ramp(p.x.abs(), 0.17, 0.28) + 0.0015 * waves(p, 0.10, 3)
    })
}

fn tshirt_cuts() -> Vec<Formula> {
    vec![
        Box::new(|p| neckline(p, 1.424, 0.31)),
        Box::new(|p| 0.93 - p.y + 0.004 * (3.0 * turn(p)).cos()),
        cuff(SHOULDER, ELBOW, 0.175),
    ]
}

fn skirt() -> Shape {
    let mut parts = shirt_parts();
    parts.push(bell());
    shape(parts, [0.32, 0.55, 1.07], |p| {
        0.0195 + 0.013 * ramp(p.y, 0.97, 0.62) * (11.0 * turn(p) + 0.7).cos()
    })
}

fn skirt_cuts() -> Vec<Formula> {
    vec![
        Box::new(|p| p.y - 1.035 - 0.06 * p.z),
        Box::new(|p| 0.60 - p.y + 0.005 * (11.0 * turn(p)).sin()),
    ]
}

fn jacket() -> Shape {
    let mut parts = shirt_parts();
    parts.push(bell());
    shape(parts, [0.60, 0.82, 1.52], |p| 0.0285 + 0.0025 * waves(p, 0.13, 6))
}

fn jacket_cuts() -> Vec<Formula> {
    vec![
        Box::new(|p| neckline(p, 1.445, 0.30)),
        Box::new(|p| 0.875 - p.y + 0.02 * p.z),
        cuff(ELBOW, WRIST, 0.238),
        front(|y| 0.036 + 0.030 * ramp(y, 1.08, 1.40) + 0.020 * ramp(y, 1.02, 0.87)),
    ]
}

fn coat() -> Shape {
    let mut parts = shirt_parts();
    parts.push(bell());
    shape(parts, [0.62, 0.45, 1.55], |p| {
        let low = ramp(p.y, 0.97, 0.60);
        0.040 + low * (0.022 + 0.008 * (7.0 * turn(p) + 0.4).cos()) + 0.002 * waves(p, 0.15, 8)
    })
}

fn coat_cuts() -> Vec<Formula> {
    vec![
        Box::new(|p| neckline(p, 1.470, 0.25)),
        Box::new(|p| 0.50 - p.y + 0.004 * (7.0 * turn(p)).cos()),
        cuff(ELBOW, WRIST, 0.215),
        front(|y| 0.098 + 0.006 * ramp(y, 1.20, 1.42) + 0.030 * ramp(y, 1.00, 0.50)),
    ]
}

/// The parts that a T-shirt, and everything over it, covers.
fn shirt_parts() -> Vec<Part> {
    let mut parts = torso();
    parts.extend(thighs());
    let ring = |y, half_width, half_depth, z| Ring { y, half_width, half_depth, z };
    let rings = vec![
        ring(0.860, 0.176, 0.116, -0.008),
        ring(0.960, 0.166, 0.114, -0.004),
        ring(1.070, 0.146, 0.108, 0.004),
        ring(1.180, 0.144, 0.110, 0.006),
        ring(1.300, 0.148, 0.098, -0.008),
    ];
    parts.push(Part::new(Solid::Loft { rings, round: 0.02 }, 0.05));
    parts.extend(arms().into_iter().map(|part| part.blended(0.06)));
    parts
}

/// The bell that a skirt, and everything over it, covers below the waist.
fn bell() -> Part {
    let ring = |y, half_width, half_depth, z| Ring { y, half_width, half_depth, z };
    let rings = vec![
        ring(0.380, 0.265, 0.215, 0.000),
        ring(0.500, 0.256, 0.208, 0.000),
        ring(0.620, 0.242, 0.194, 0.000),
        ring(0.760, 0.218, 0.170, -0.002),
        ring(0.900, 0.184, 0.134, -0.004),
        ring(1.000, 0.152, 0.108, 0.000),
    ];
    Part::new(Solid::Loft { rings, round: 0.01 }, 0.05)
}

/// A shape within `region`: half its width, its lowest and its highest y.
fn shape(
    parts: Vec<Part>,
    region: [Real; 3],
    ease: impl Fn(&Point) -> Real + Send + Sync + 'static,
) -> Shape {
    let [x, low, high] = region;
    Shape {
        parts,
        ease: Box::new(ease),
        dips: None,
        floor: Real::NEG_INFINITY,
        region: Aabb { min: Point::new(-x, low, -0.34), max: Point::new(x, high, 0.34) },
    }
}

/// Three crossing waves of about the given length in metres: between −1 and 1.
fn waves(p: &Point, length: Real, seed: u32) -> Real {
    let k = TAU / length;
    let s = Real::from(seed);
    let phase = |n: Real| (12.9898 * s + 78.233 * n).sin() * 43.0;
    let [a, b, c] = [
        Vector::new(0.78, 0.52, 0.35),
        Vector::new(-0.45, 0.61, 0.65),
        Vector::new(0.31, -0.74, 0.60),
    ];
    let wave = |d: Vector, n: Real| (k * d.dot(&p.coords) + phase(n)).sin();
    (wave(a, 1.0) + wave(b, 2.0) + wave(c, 3.0)) / 3.0
}

/// Angle about the y axis, 0 in front.
fn turn(p: &Point) -> Real {
    p.x.atan2(p.z)
}

/// Cuts both sleeves `at` metres behind `from` on the way to `to`.
fn cuff(from: Point, to: Point, at: Real) -> Formula {
    /// Largest half width of a sleeve, in metres: farther away the cut has no effect.
    const SLEEVE: Real = 0.14;
    let axis = (to - from).normalize();
    Box::new(move |p| {
        let d = Point::new(p.x.abs(), p.y, p.z) - from;
        let along = axis.dot(&d);
        (along - at).min(SLEEVE - (d - axis * along).norm())
    })
}

/// A neckline that passes x = 0, z = −0.01 at `height`, falls by `slope` towards the front, and
/// rises to the shoulders.
fn neckline(p: &Point, height: Real, slope: Real) -> Real {
    p.y - height + slope * (p.z + 0.01) - 7.0 * p.x * p.x
}

/// Opens the front by `half_gap(y)` to each side.
fn front(half_gap: impl Fn(Real) -> Real + Send + Sync + 'static) -> Formula {
    Box::new(move |p| (half_gap(p.y) - p.x.abs()).min(p.z))
}
