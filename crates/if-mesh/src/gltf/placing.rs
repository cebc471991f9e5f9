//! From the coordinates that a file stores to those of its scene, and back.

use if_core::math::{Point, Real, Vector};
use nalgebra::{Matrix3, Matrix4};

/// An affine map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Affine {
    pub(super) linear: Matrix3<Real>,
    pub(super) shift: Vector,
}

impl Affine {
    pub(super) const IDENTITY: Self = Self {
        linear: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        shift: Vector::new(0.0, 0.0, 0.0),
    };

    /// The upper three rows of a matrix, given column by column.
    pub(super) fn of_columns(columns: &[Real; 16]) -> Self {
        let m = Matrix4::from_column_slice(columns);
        let linear = m.fixed_view::<3, 3>(0, 0).into_owned();
        Self { linear, shift: m.fixed_view::<3, 1>(0, 3).into_owned() }
    }

    /// This after `first`.
    pub(super) fn after(&self, first: &Self) -> Self {
        Self { linear: self.linear * first.linear, shift: self.linear * first.shift + self.shift }
    }

    pub(super) fn is_invertible(&self) -> bool {
        let entries = self.linear.iter().chain(self.shift.iter());
        entries.copied().all(Real::is_finite) && self.inverse().is_some()
    }

    fn inverse(&self) -> Option<Matrix3<Real>> {
        self.linear.try_inverse().filter(|m| m.iter().all(|x| x.is_finite()))
    }
}

/// The map of one vertex, after an offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placing {
    /// The sum of the morph targets, in the coordinates of the file.
    pub(super) morph: Vector,
    pub(super) map: Affine,
}

impl Placing {
    /// Whether positions are those of the file.
    pub(super) fn is_identity(&self) -> bool {
        self.map == Affine::IDENTITY && self.morph == Vector::zeros()
    }

    /// Whether triangles turn over: the scene has their corners in the other order.
    pub(super) fn is_mirrored(&self) -> bool {
        self.map.linear.determinant() < 0.0
    }

    /// From the file to the scene.
    pub(super) fn forward(&self, stored: [f32; 3]) -> Point {
        let p = Vector::from(stored.map(Real::from)) + self.morph;
        if self.map == Affine::IDENTITY {
            p.into()
        } else {
            (self.map.linear * p + self.map.shift).into()
        }
    }

    /// From the scene to the nearest position that the file can store.
    pub(super) fn back(&self, p: &Point) -> [f32; 3] {
        let p = if self.map == Affine::IDENTITY {
            p.coords
        } else {
            self.inverse() * (p.coords - self.map.shift)
        };
        (p - self.morph).map(|x| x as f32).into()
    }

    /// A normal of the file, in the scene; not of length 1.
    pub(super) fn normal_forward(&self, n: &Vector) -> Vector {
        self.inverse().transpose() * n
    }

    /// A normal of the scene, in the file.
    pub(super) fn normal_back(&self, n: &Vector) -> Vector {
        self.map.linear.transpose() * n
    }

    /// A direction along the surface of the file, in the scene; not of length 1.
    pub(super) fn tangent_forward(&self, t: &Vector) -> Vector {
        self.map.linear * t
    }

    /// A direction along the surface of the scene, in the file.
    pub(super) fn tangent_back(&self, t: &Vector) -> Vector {
        self.inverse() * t
    }

    fn inverse(&self) -> Matrix3<Real> {
        self.map.inverse().expect("the reader refuses other maps")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_goes_forward_comes_back_and_normals_stay_normal() {
        let columns =
            [0.0, 0.0, -0.02, 0.0, 0.0, 0.01, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.5, -0.25, 2.0, 1.0];
        let map = Affine::of_columns(&columns);
        let placing = Placing { morph: Vector::new(1.0, 0.0, 0.0), map };
        let there = placing.forward([1.0, 2.0, 3.0]);
        assert!((there - Point::new(0.53, -0.23, 1.96)).norm() < 1e-15, "{there}");
        assert_eq!(placing.back(&there), [1.0, 2.0, 3.0]);
        let (u, n) = (Vector::new(1.0, 2.0, 0.0), Vector::new(2.0, -1.0, 0.0));
        let turned = placing.normal_forward(&n);
        assert!(turned.dot(&(map.linear * u)).abs() < 1e-12);
        assert!((placing.normal_back(&turned) - n).norm() < 1e-12);
        assert!(turned.dot(&placing.tangent_forward(&u)).abs() < 1e-12);
        assert!((placing.tangent_back(&placing.tangent_forward(&u)) - u).norm() < 1e-12);
        assert!(!Affine { linear: Matrix3::zeros(), ..map }.is_invertible());
    }
}
