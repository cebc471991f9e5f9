//! How far a field is from its target, at held-out points.

use crate::frame::Frame;
use crate::trainable::Sample32;
use if_core::field::FieldSample;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use serde::{Deserialize, Serialize};

/// Held-out points beside and on the surface, with the target's values there, in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOut {
    beside: Vec<Point>,
    distances: Vec<Real>,
    on: Vec<Point>,
    normals: Vec<Vector>,
}

/// Errors against the target, in metres and degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FieldAccuracy {
    /// Mean of |φ − d| near the surface, in metres.
    pub mean: Real,
    /// 99 % of these errors are at most this, in metres.
    pub p99: Real,
    /// The largest, in metres.
    pub max: Real,
    /// Mean of |φ| on the surface, in metres.
    pub surface: Real,
    /// Mean of ||∇φ| − 1| near the surface.
    pub eikonal: Real,
    /// Mean angle of ∇φ against the target's normals on the surface, in degrees.
    pub normal_degrees: Real,
    /// Points near the surface.
    pub points: usize,
}

impl HeldOut {
    /// Points beside the surface, and on it, with the target's samples there.
    ///
    /// # Panics
    ///
    /// If the numbers of points and samples differ.
    pub fn new(beside: &[Point], at: &[FieldSample], on: &[Point], there: &[FieldSample]) -> Self {
        assert!(beside.len() == at.len() && on.len() == there.len(), "one sample for each point");
        Self {
            beside: beside.to_vec(),
            distances: at.iter().map(|s| s.distance).collect(),
            on: on.to_vec(),
            normals: there.iter().map(|s| unit_or_zero(&s.gradient)).collect(),
        }
    }

    /// Points beside the surface.
    pub fn len(&self) -> usize {
        self.beside.len()
    }

    /// Points beside the surface, in metres, and the target's distances there.
    pub fn beside(&self) -> (&[Point], &[Real]) {
        (&self.beside, &self.distances)
    }

    /// Whether there are no points beside the surface.
    pub fn is_empty(&self) -> bool {
        self.beside.is_empty()
    }

    /// Means of the coordinates and distances beside the surface and of the coordinates on it, in
    /// metres: a fingerprint of the target.
    pub(crate) fn means(&self) -> [Real; 7] {
        let mean = |points: &[Point]| {
            points.iter().fold(Vector::zeros(), |sum, p| sum + p.coords)
                / points.len().max(1) as Real
        };
        let (beside, on) = (mean(&self.beside), mean(&self.on));
        let distance = self.distances.iter().sum::<Real>() / self.distances.len().max(1) as Real;
        [beside.x, beside.y, beside.z, distance, on.x, on.y, on.z]
    }

    /// About `n` of the points, spread evenly over the list.
    pub(crate) fn thinned(&self, n: usize) -> Self {
        let stride = self.beside.len().div_ceil(n.max(1)).max(1);
        let on = self.on.len().div_ceil(n.max(1)).max(1);
        Self {
            beside: self.beside.iter().step_by(stride).copied().collect(),
            distances: self.distances.iter().step_by(stride).copied().collect(),
            on: self.on.iter().step_by(on).copied().collect(),
            normals: self.normals.iter().step_by(on).copied().collect(),
        }
    }

    /// The errors of a field, given by its values in network units. Not finite where the field is
    /// not.
    pub fn accuracy(
        &self,
        frame: &Frame,
        field: impl Fn(&[[f32; 3]], &mut [Sample32]),
    ) -> FieldAccuracy {
        let evaluate = |points: &[Point]| {
            let units: Vec<[f32; 3]> = points.iter().map(|p| frame.to_unit(p)).collect();
            let mut out = vec![Sample32::default(); units.len()];
            field(&units, &mut out);
            out
        };
        let length =
            |s: &Sample32| s.gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
        let beside = evaluate(&self.beside);
        let mut errors: Vec<Real> = beside
            .iter()
            .zip(&self.distances)
            .map(|(s, d)| (f64::from(s.value) / frame.scale - d).abs())
            .collect();
        let eikonal = mean(beside.iter().map(|s| (length(s) - 1.0).abs()));
        let on = evaluate(&self.on);
        let surface = mean(on.iter().map(|s| (f64::from(s.value) / frame.scale).abs()));
        let angles = on
            .iter()
            .zip(&self.normals)
            .filter(|(s, n)| length(s) > 0.0 && n.norm_squared() > 0.0)
            .map(|(s, n)| {
                let cosine =
                    (0..3).map(|k| f64::from(s.gradient[k]) * n[k]).sum::<f64>() / length(s);
                cosine.clamp(-1.0, 1.0).acos().to_degrees()
            });
        let normal_degrees = mean(angles);
        errors.sort_unstable_by(Real::total_cmp);
        let n = errors.len();
        let rank = |share: Real| {
            errors
                .get(((n as Real * share).ceil() as usize).saturating_sub(1))
                .copied()
                .unwrap_or(0.0)
        };
        FieldAccuracy {
            mean: mean(errors.iter().copied()),
            p99: rank(0.99),
            max: rank(1.0),
            surface,
            eikonal,
            normal_degrees,
            points: n,
        }
    }
}

impl FieldAccuracy {
    /// Whether all is finite.
    pub fn is_finite(&self) -> bool {
        [self.mean, self.p99, self.max, self.surface, self.eikonal, self.normal_degrees]
            .iter()
            .all(|x| x.is_finite())
    }
}

/// The mean; 0 of an empty list.
fn mean(values: impl Iterator<Item = Real>) -> Real {
    let (sum, n) = values.fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
    if n == 0 { 0.0 } else { sum / n as Real }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;

    #[test]
    fn errors_are_those_put_in() {
        let frame = Frame { center: Point::new(0.0, 1.0, 0.0), scale: 0.5 };
        let points: Vec<Point> = (0..100).map(|k| Point::new(0.01 * k as Real, 1.0, 0.2)).collect();
        let sample = |d| FieldSample { distance: d, gradient: Vector::x() };
        let beside: Vec<FieldSample> = points.iter().map(|p| sample(p.x)).collect();
        let held = HeldOut::new(&points, &beside, &points[..1], &[sample(0.0)]);
        // 1 mm off at one point of a hundred, 0.1 mm elsewhere; 10 % too steep; turned by 90°.
        let error = held.accuracy(&frame, |units, out| {
            for (u, o) in units.iter().zip(out) {
                let off = if u[0] > 0.49 { 5e-4 } else { 5e-5 };
                *o = Sample32 { value: u[0] + off, gradient: [0.0, 1.1, 0.0] };
            }
        });
        approx::assert_relative_eq!(error.max, 1e-3, epsilon = 1e-6);
        approx::assert_relative_eq!(error.p99, 1e-4, epsilon = 1e-6);
        approx::assert_relative_eq!(error.mean, 1.09e-4, epsilon = 1e-6);
        approx::assert_relative_eq!(error.eikonal, 0.1, epsilon = 1e-6);
        approx::assert_relative_eq!(error.normal_degrees, 90.0, epsilon = 1e-6);
        assert_eq!(held.thinned(10).len(), 10);
        assert!(error.is_finite());
    }

    #[test]
    fn a_field_that_is_nan_has_no_finite_error() {
        let p = [Point::origin()];
        let s = [FieldSample { distance: 0.0, gradient: Vector::x() }];
        let held = HeldOut::new(&p, &s, &p, &s);
        assert!(!held.accuracy(&Frame::UNIT, |_, out| out[0].value = f32::NAN).is_finite());
    }
}
