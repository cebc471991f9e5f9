//! Fields that are not what they say: wrong slopes and bounds, noise, NaN, no gradient, inside out.

use crate::cases::Random;
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::shapes::{Cuboid, Plane, Sphere, Torus};

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    None,
    /// All values times a factor; the bound on the slope says so.
    Slope(Real),
    /// All values times a factor; the bound on the slope is still 1.
    SecretSlope(Real),
    /// Ripples of this height and a thousandth of the size; gradients do not see them.
    Noise(Real),
    /// NaN in one half-space.
    Nan,
    /// Infinite in one half-space.
    Infinite,
    /// No gradient anywhere.
    Flat,
    /// Gradients of 1e300.
    Steep,
    /// Inside out.
    InsideOut,
    /// A step instead of a slope: ± size.
    Step,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solid {
    Ball,
    Box,
    Ring,
    Ground,
}

/// A solid of about `size` metres round `center`, with a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hostile {
    pub solid: Solid,
    pub center: Point,
    pub size: Real,
    pub fault: Fault,
}

impl Hostile {
    /// Any solid with any fault, a fifth of them without.
    pub fn any(r: &mut Random, center: Point, size: Real) -> Self {
        let fault = match r.below(12) {
            0 => Fault::Slope(r.pick(&[0.1, 0.7, 1.3, 3.0])),
            1 => Fault::SecretSlope(r.pick(&[0.1, 0.7, 1.3, 3.0, 1e6])),
            2 => Fault::Noise(size * r.power(-4.0, -1.0)),
            3 => Fault::Nan,
            4 => Fault::Infinite,
            5 => Fault::Flat,
            6 => Fault::Steep,
            7 => Fault::InsideOut,
            8 => Fault::Step,
            _ => Fault::None,
        };
        let solid = r.pick(&[Solid::Ball, Solid::Box, Solid::Ring, Solid::Ground]);
        Self { solid, center, size, fault }
    }

    /// Whether the bound on the slope holds.
    pub fn is_honest(&self) -> bool {
        matches!(self.fault, Fault::None | Fault::Slope(_) | Fault::InsideOut)
    }

    fn exact(&self, p: &Point) -> FieldSample {
        let (center, size) = (self.center, self.size);
        match self.solid {
            Solid::Ball => Sphere { center, radius: 0.5 * size }.sample(p),
            Solid::Box => Cuboid { center, half: Vector::new(0.5, 0.3, 0.4) * size }.sample(p),
            Solid::Ring => Torus { center, major: 0.5 * size, minor: 0.2 * size }.sample(p),
            Solid::Ground => Plane { point: center, normal: Vector::z() }.sample(p),
        }
    }
}

impl SignedDistance for Hostile {
    fn distance(&self, p: &Point) -> Real {
        self.sample(p).distance
    }

    fn sample(&self, p: &Point) -> FieldSample {
        let FieldSample { distance, gradient } = self.exact(p);
        let beyond = p.x > self.center.x + 0.1 * self.size;
        match self.fault {
            Fault::None => FieldSample { distance, gradient },
            Fault::Slope(f) | Fault::SecretSlope(f) => {
                FieldSample { distance: distance * f, gradient: gradient * f }
            }
            Fault::Noise(height) => {
                let k = 6000.0 / self.size;
                let d = p - self.center;
                let ripple =
                    ((k * d.x).sin() + (1.3 * k * d.y).sin() + (1.7 * k * d.z).sin()) / 3.0;
                FieldSample { distance: distance + height * ripple, gradient }
            }
            Fault::Nan if beyond => {
                FieldSample { distance: Real::NAN, gradient: Vector::repeat(Real::NAN) }
            }
            Fault::Infinite if beyond => FieldSample { distance: Real::NEG_INFINITY, gradient },
            Fault::Nan | Fault::Infinite => FieldSample { distance, gradient },
            Fault::Flat => FieldSample { distance, gradient: Vector::zeros() },
            Fault::Steep => FieldSample { distance, gradient: gradient * 1e300 },
            Fault::InsideOut => FieldSample { distance: -distance, gradient: -gradient },
            Fault::Step => FieldSample { distance: self.size.copysign(distance), gradient },
        }
    }

    fn bounds(&self) -> Option<Aabb> {
        let whole = Aabb { min: self.center, max: self.center }.inflated(self.size);
        (self.solid != Solid::Ground && self.fault != Fault::InsideOut).then_some(whole)
    }

    fn lipschitz(&self) -> Real {
        if let Fault::Slope(f) = self.fault { f } else { 1.0 }
    }
}
