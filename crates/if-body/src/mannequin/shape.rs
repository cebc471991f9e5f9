//! Implicit shapes: smoothly blended parts, and an ease that offsets the surface outwards.

use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};

/// A function of position, such as a length in metres.
pub(super) type Formula = Box<dyn Fn(&Point) -> Real + Send + Sync>;

/// A solid part of a body or garment.
#[derive(Clone, Debug)]
pub(super) enum Solid {
    /// The convex hull of two balls.
    Cone { from: Point, to: Point, from_radius: Real, to_radius: Real },
    /// An ellipsoid; `axes` are orthonormal.
    Ellipsoid { center: Point, axes: [Vector; 3], radii: [Real; 3] },
    /// Horizontal ellipses about x = 0, smoothly joined, lowest first; its ends are rounded by
    /// `round` metres.
    Loft { rings: Vec<Ring>, round: Real },
}

/// One ellipse of a loft, in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ring {
    pub(super) y: Real,
    pub(super) half_width: Real,
    pub(super) half_depth: Real,
    pub(super) z: Real,
}

/// A solid, and its blend with the parts before it in the list.
#[derive(Clone, Debug)]
pub(super) struct Part {
    solid: Solid,
    /// Width of the blend with the parts before it, in metres.
    blend: Real,
    /// Its bounding ball.
    center: Point,
    radius: Real,
}

impl Part {
    pub(super) fn new(solid: Solid, blend: Real) -> Self {
        let aabb = match &solid {
            Solid::Cone { from, to, from_radius, to_radius } => Aabb { min: *from, max: *from }
                .inflated(*from_radius)
                .merged(&Aabb { min: *to, max: *to }.inflated(*to_radius)),
            Solid::Ellipsoid { center, axes, radii } => {
                let extent =
                    |k: usize| (0..3).map(|i| (axes[i][k] * radii[i]).powi(2)).sum::<Real>().sqrt();
                let half = Vector::new(extent(0), extent(1), extent(2));
                Aabb { min: center - half, max: center + half }
            }
            Solid::Loft { rings, .. } => rings.iter().fold(Aabb::EMPTY, |b, r| {
                // Between two rings the width may slightly exceed both.
                let (w, d) = (1.03 * r.half_width, 1.03 * r.half_depth);
                b.grown_to(&Point::new(-w, r.y, r.z - d)).grown_to(&Point::new(w, r.y, r.z + d))
            }),
        };
        Self { solid, blend, center: aabb.center(), radius: 0.5 * aabb.diagonal() }
    }

    /// The mirror image in x = 0.
    pub(super) fn mirrored(&self) -> Self {
        let point = |p: &Point| Point::new(-p.x, p.y, p.z);
        let solid = match &self.solid {
            Solid::Cone { from, to, from_radius, to_radius } => Solid::Cone {
                from: point(from),
                to: point(to),
                from_radius: *from_radius,
                to_radius: *to_radius,
            },
            Solid::Ellipsoid { center, axes, radii } => Solid::Ellipsoid {
                center: point(center),
                axes: axes.map(|a| Vector::new(-a.x, a.y, a.z)),
                radii: *radii,
            },
            loft @ Solid::Loft { .. } => loft.clone(),
        };
        Self::new(solid, self.blend)
    }

    /// The part with another blend.
    pub(super) fn blended(self, blend: Real) -> Self {
        Self { blend, ..self }
    }
}

impl Solid {
    /// Signed distance: exact for cones, of first order near the surface for the others.
    fn distance(&self, p: &Point) -> Real {
        match self {
            Solid::Cone { from, to, from_radius, to_radius } => {
                cone(p, from, to, *from_radius, *to_radius)
            }
            Solid::Ellipsoid { center, axes, radii } => {
                let d = p - center;
                let q = Vector::new(axes[0].dot(&d), axes[1].dot(&d), axes[2].dot(&d));
                let r = Vector::from(*radii);
                let scaled = q.component_div(&r);
                let slope = scaled.component_div(&r).norm();
                let k = scaled.norm();
                if slope > 0.0 { k * (k - 1.0) / slope } else { -r.min() }
            }
            Solid::Loft { rings, round } => loft(p, rings, *round),
        }
    }
}

/// # Source
///
/// Quílez, *Distance functions*: the round cone, by the plane through its axis and the point.
fn cone(p: &Point, from: &Point, to: &Point, r0: Real, r1: Real) -> Real {
    let (axis, d) = (to - from, p - from);
    let length2 = axis.norm_squared();
    let rr = r0 - r1;
    let a2 = length2 - rr * rr;
    if a2 <= 0.0 {
        // One ball contains the other.
        return d.norm().min(Real::INFINITY) - r0.max(r1);
    }
    let y = d.dot(&axis);
    let z = y - length2;
    let x2 = (d * length2 - axis * y).norm_squared();
    let (y2, z2) = (y * y * length2, z * z * length2);
    let k = rr.signum() * rr * rr * x2;
    if z.signum() * a2 * z2 > k {
        (x2 + z2).sqrt() / length2 - r1
    } else if y.signum() * a2 * y2 < k {
        (x2 + y2).sqrt() / length2 - r0
    } else {
        ((x2 * a2 / length2).sqrt() + y * rr) / length2 - r0
    }
}

/// With u = x / a(y), w = (z − c(y)) / b(y) and r = √(u² + w²) the side is (r − 1) / |∇r|, the
/// gradient taken where the ray from the axis leaves the ellipse; the ends are planes.
fn loft(p: &Point, rings: &[Ring], round: Real) -> Real {
    let (low, high) = (rings[0].y, rings[rings.len() - 1].y);
    let ([a, b, c], [da, db, dc]) = between(rings, p.y.clamp(low, high));
    let (u, w) = (p.x / a, (p.z - c) / b);
    let r = u.hypot(w);
    let (u, w) = if r > 1e-9 { (u / r, w / r) } else { (0.0, 1.0) };
    let gradient = Vector::new(u / a, u * u * da / a + w * (w * db + dc) / b, w / b);
    let side = (r - 1.0) / gradient.norm() + round;
    let end = (p.y - high).max(low - p.y) + round;
    side.max(0.0).hypot(end.max(0.0)) + side.max(end).min(0.0) - round
}

/// Half width, half depth and z at height `y`, and their slopes: cubic, through all rings.
fn between(rings: &[Ring], y: Real) -> ([Real; 3], [Real; 3]) {
    let k = rings.partition_point(|r| r.y <= y).clamp(1, rings.len() - 1) - 1;
    let values = |r: &Ring| Vector::new(r.half_width, r.half_depth, r.z);
    let chord =
        |i: usize| (values(&rings[i + 1]) - values(&rings[i])) / (rings[i + 1].y - rings[i].y);
    let tangent = |i: usize| match i {
        0 => chord(0),
        i if i + 1 == rings.len() => chord(i - 1),
        i => {
            let (before, after) = (rings[i].y - rings[i - 1].y, rings[i + 1].y - rings[i].y);
            (chord(i - 1) * after + chord(i) * before) / (before + after)
        }
    };
    let h = rings[k + 1].y - rings[k].y;
    let t = (y - rings[k].y) / h;
    let (p, q, m, n) =
        (values(&rings[k]), values(&rings[k + 1]), tangent(k) * h, tangent(k + 1) * h);
    let c2 = (q - p) * 3.0 - m * 2.0 - n;
    let c3 = (p - q) * 2.0 + m + n;
    let value = p + (m + (c2 + c3 * t) * t) * t;
    let slope = (m + (c2 * 2.0 + c3 * (3.0 * t)) * t) / h;
    (value.into(), slope.into())
}

/// Smooth minimum with blend width `k`.
pub(super) fn smooth_min(a: Real, b: Real, k: Real) -> Real {
    let h = (k - (a - b).abs()).max(0.0);
    if h > 0.0 { a.min(b) - h * h / (4.0 * k) } else { a.min(b) }
}

/// 0 up to `from`, 1 from `to` on, smooth between.
pub(super) fn ramp(x: Real, from: Real, to: Real) -> Real {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Blended parts, offset outwards by an ease, with dips.
pub(super) struct Shape {
    /// Each is blended with those before it.
    pub(super) parts: Vec<Part>,
    /// Offset of the surface from the parts, in metres.
    pub(super) ease: Formula,
    /// Regions in which the surface bends inwards.
    pub(super) dips: Option<Dips>,
    /// Height of the plane below which the shape is cut off; −∞ for none.
    pub(super) floor: Real,
    /// The box to extract. The surface may extend beyond it.
    pub(super) region: Aabb,
}

/// Regions in which a surface dips into shapes below.
pub(super) struct Dips {
    /// The shapes below.
    pub(super) into: Vec<Shape>,
    /// Depth below their surface, in metres.
    pub(super) depth: Real,
    /// 0 outside the regions, 1 at full depth.
    pub(super) weight: Formula,
}

/// Bound on the slope: blends and eases are steeper than distances. Samples of the shapes here have
/// slopes below 2.
const LIPSCHITZ: Real = 2.5;
/// Step of the differences that give the gradient, in metres: 1e-4 smaller than any detail here.
const STEP: Real = 1e-6;
/// Width of the rounded edge between the floor and the shape, in metres.
const SOLE: Real = 0.012;

impl SignedDistance for Shape {
    fn distance(&self, p: &Point) -> Real {
        let mut d = Real::INFINITY;
        for part in &self.parts {
            // Parts whose bounding ball is too far away have no effect here.
            let least = (p - part.center).norm() - part.radius;
            if least < d + part.blend {
                d = smooth_min(d, part.solid.distance(p), part.blend);
            }
        }
        d -= (self.ease)(p);
        if let Some(dips) = &self.dips {
            let weight = (dips.weight)(p);
            if weight > 0.0 {
                let below =
                    dips.into.iter().map(|shape| shape.distance(p)).fold(Real::INFINITY, Real::min);
                d += weight * (below + dips.depth - d);
            }
        }
        -smooth_min(-d, p.y - self.floor, SOLE)
    }

    /// Gradient by differences along four directions; second-order accurate for smooth shapes.
    fn sample(&self, p: &Point) -> FieldSample {
        const CORNERS: [[Real; 3]; 4] =
            [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        let (mut distance, mut gradient) = (0.0, Vector::zeros());
        for corner in CORNERS.map(Vector::from) {
            let d = self.distance(&(p + corner * STEP));
            distance += 0.25 * d;
            gradient += corner * (d / (4.0 * STEP));
        }
        FieldSample { distance, gradient }
    }

    fn bounds(&self) -> Option<Aabb> {
        Some(self.region)
    }

    fn lipschitz(&self) -> Real {
        LIPSCHITZ
    }
}
