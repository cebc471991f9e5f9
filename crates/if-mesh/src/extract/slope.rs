//! The bound on a field's slope.

use crate::extract::budget::Budget;
use crate::extract::error::ExtractError;
use crate::extract::params::Slope;
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::random::SplitMix64;

/// What bounds a field between points where it was evaluated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bound {
    /// Upper bound on |∇φ|.
    pub(super) slope: Real,
    /// Maximum error of a value.
    pub(super) noise: Real,
}

/// The bound on |∇φ| of `field` in `region` that `slope` describes.
pub(super) fn slope_bound(
    slope: &Slope,
    field: &dyn SignedDistance,
    region: &Aabb,
    budget: &mut Budget,
) -> Result<Real, ExtractError> {
    let slope = match *slope {
        Slope::Field => field.lipschitz(),
        Slope::Given(slope) => slope,
        Slope::Sampled { points, factor, seed } => {
            // A position and a sample each.
            let bytes = points.saturating_mul(size_of::<Point>() + size_of::<FieldSample>());
            if bytes > budget.memory {
                return Err(ExtractError::TooManyPoints { points, bytes, limit: budget.memory });
            }
            let mut random = SplitMix64::new(seed);
            let size = region.size();
            let places: Vec<Point> = (0..points)
                .map(|_| {
                    region.min
                        + Vector::new(random.unit(), random.unit(), random.unit())
                            .component_mul(&size)
                })
                .collect();
            let mut samples =
                vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; points];
            field.samples(&places, &mut samples);
            budget.evaluated("slope", points)?;
            factor * samples.iter().map(|s| s.gradient.norm()).fold(0.0, Real::max)
        }
    };
    if slope.is_nan() || slope <= 0.0 { Err(ExtractError::Slope { slope }) } else { Ok(slope) }
}
