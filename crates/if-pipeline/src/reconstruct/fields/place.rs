//! A point of the trained surface in a frame: where it is seen, and how losses there depend on φ
//! and d.
//!
//! ```text
//! y(x) = Σ wⱼ(x) Tⱼ (x + d(x))      the posed point, LBS(x + d)
//! A    = Σ wⱼ Rⱼ                    ∂y/∂d
//! J    = A (1 + ∂d) + Σ Tⱼ(x + d) ∇wⱼᵀ        ∂y/∂x
//! g    = ∇φ,   m = J⁻ᵀ g            the normal of the posed surface, times |m|
//! ```

use super::skin::Skin;
use if_body::skinning::Affine;
use if_core::field::FieldSample;
use if_core::math::{Point, Real, Vector};
use nalgebra::Matrix3;

/// d and ∂d/∂x at a point, in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Offset {
    pub(super) offset: Vector,
    pub(super) jacobian: Matrix3<Real>,
}

/// A canonical point in a frame.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// φ and g.
    pub(super) field: FieldSample,
    /// y.
    pub(super) posed: Point,
    /// J.
    pub(super) jacobian: Matrix3<Real>,
    /// J⁻¹.
    pub(super) inverse: Matrix3<Real>,
    /// A.
    pub(super) linear: Matrix3<Real>,
    /// m.
    pub(super) normal: Vector,
}

/// Derivatives of a loss by what the networks return at a point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Adjoint {
    /// By φ.
    pub(super) value: Real,
    /// By ∇φ.
    pub(super) gradient: Vector,
    /// By d.
    pub(super) offset: Vector,
    /// By ∂d/∂x.
    pub(super) jacobian: Matrix3<Real>,
}

impl Place {
    /// The point `x` with what the networks return there, its weights and the joints' maps. `None`
    /// if J is singular, or φ has no gradient.
    pub(super) fn new(
        x: &Point,
        field: FieldSample,
        d: &Offset,
        skin: &Skin,
        joints: &[Affine],
    ) -> Option<Self> {
        let moved = x + d.offset;
        let (mut posed, mut linear) = (Vector::zeros(), Matrix3::zeros());
        let mut spread = Matrix3::zeros();
        for (j, w, slope) in skin.weights(x) {
            let at = joints[j].point(&moved).coords;
            posed += at * w;
            linear += joints[j].linear * w;
            spread += at * slope.transpose();
        }
        let jacobian = linear * (Matrix3::identity() + d.jacobian) + spread;
        let inverse = jacobian.try_inverse()?;
        let normal = inverse.transpose() * field.gradient;
        let length = normal.norm();
        (length > 0.0 && length.is_finite()).then_some(Self {
            field,
            posed: Point::from(posed),
            jacobian,
            inverse,
            linear,
            normal,
        })
    }

    /// The unit normal of the posed surface.
    pub(super) fn unit_normal(&self) -> Vector {
        self.normal / self.normal.norm()
    }

    /// Distance of y from the line through `from` along the unit vector `along`.
    pub(super) fn off_line(&self, from: &Point, along: &Vector) -> Real {
        across(&(self.posed - from), along).norm()
    }

    /// Newton's step of x towards φ(x) = 0 and y(x) on a line; infinite if the line is tangent to
    /// the surface.
    ///
    /// ```text
    /// J δx = v s − r,   g · δx = −φ          r = the part of y − o across v
    /// ```
    pub(super) fn step_to_line(&self, from: &Point, along: &Vector) -> Vector {
        let back = self.inverse * across(&(self.posed - from), along);
        let way = self.inverse * along;
        let g = self.field.gradient;
        way * ((g.dot(&back) - self.field.distance) / g.dot(&way)) - back
    }

    /// Newton's step of x towards φ(x) = 0, along ∇φ.
    pub(super) fn step_to_surface(&self) -> Vector {
        let g = self.field.gradient;
        g * (-self.field.distance / g.norm_squared())
    }

    /// The adjoint of a loss with the derivative `by_normal` by the unit normal of the posed
    /// surface, at a fixed point x.
    ///
    /// ```text
    /// ∂L/∂g = ḡ = J⁻¹ (1 − n nᵀ) n̄ / |m|,   ∂L/∂J = −m ḡᵀ
    /// ```
    pub(super) fn of_normal(
        &self,
        by_normal: &Vector,
        x: &Point,
        skin: &Skin,
        joints: &[Affine],
    ) -> Adjoint {
        let n = self.unit_normal();
        let gradient = self.inverse * (by_normal - n * n.dot(by_normal)) / self.normal.norm();
        // J depends on d through the positions Tⱼ(x + d) beside the slopes of the weights.
        let mut offset = Vector::zeros();
        for (j, _, slope) in skin.weights(x) {
            offset -= joints[j].linear.transpose() * self.normal * slope.dot(&gradient);
        }
        let jacobian = -(self.linear.transpose() * self.normal) * gradient.transpose();
        Adjoint { value: 0.0, gradient, offset, jacobian }
    }

    /// What `adjoint`, of the normal at x, contributes to the derivative by x: with the place
    /// `beside` at x + h ĝ, differences of g and J along ḡ.
    ///
    /// ```text
    /// x̄ = H ḡ − (∂J along ḡ)ᵀ m          H = ∇∇φ; both derivatives are symmetric
    /// ```
    pub(super) fn by_point(&self, adjoint: &Adjoint, beside: &Self, h: Real) -> Vector {
        let rate = adjoint.gradient.norm() / h;
        let by_field = beside.field.gradient - self.field.gradient;
        let by_pose = (beside.jacobian - self.jacobian).transpose() * self.normal;
        (by_field - by_pose) * rate
    }

    /// The adjoint of a loss with the derivative `by_point` by x, where x follows φ and d so that it
    /// stays on the surface and y(x) on a line along `along`. `None` if the line is tangent to the
    /// surface.
    ///
    /// ```text
    /// w = J⁻¹ v:   ∂L/∂φ = −(x̄ · w) / (g · w),   ∂L/∂d = −(J⁻¹ A)ᵀ (x̄ − g (x̄ · w) / (g · w))
    /// ```
    pub(super) fn of_point(&self, by_point: &Vector, along: &Vector) -> Option<Adjoint> {
        let (w, g) = (self.inverse * along, self.field.gradient);
        let share = by_point.dot(&w) / g.dot(&w);
        if !share.is_finite() {
            return None;
        }
        let offset = -(self.inverse * self.linear).transpose() * (by_point - g * share);
        Some(Adjoint { value: -share, offset, ..Adjoint::default() })
    }

    /// The adjoint of a loss with the derivative `by_way` by the displacement of the posed surface
    /// along its normal, as where a ray touches it: how x moves along the surface has no effect.
    ///
    /// ```text
    /// ∂L/∂φ = −L′ / |m|,   ∂L/∂d = L′ (J⁻¹ A)ᵀ g / |m|
    /// ```
    pub(super) fn of_way(&self, by_way: Real) -> Adjoint {
        let value = -by_way / self.normal.norm();
        let offset = (self.inverse * self.linear).transpose() * self.field.gradient * -value;
        Adjoint { value, offset, ..Adjoint::default() }
    }
}

impl std::ops::Add for Adjoint {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            gradient: self.gradient + other.gradient,
            offset: self.offset + other.offset,
            jacobian: self.jacobian + other.jacobian,
        }
    }
}

/// The part of `v` across the unit vector `along`.
fn across(v: &Vector, along: &Vector) -> Vector {
    v - along * v.dot(along)
}

#[cfg(test)]
mod tests;
