//! The union of closed layers as a field.

use super::ClosedLayer;
use crate::baked::{BakeError, BakeParams, Baked};
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Monitor;

/// The union of closed layers, as one field: the clothed body that Appendix C corrects against.
///
/// The distance is exact outside; inside, it is the largest depth in any one layer, which is a
/// lower bound of the depth in the union. It jumps across the caps that close a garment's openings.
#[derive(Clone, Debug)]
pub struct ClothedField<'a> {
    layers: Vec<&'a ClosedLayer>,
}

impl<'a> ClothedField<'a> {
    /// The union of `layers`.
    pub fn new(layers: Vec<&'a ClosedLayer>) -> Self {
        Self { layers }
    }

    /// Bakes the part in `region` on cells of `cell` metres, for one who evaluates it in each
    /// substep. The field jumps at the caps of openings, where no cell is small enough: none is
    /// halved.
    ///
    /// # Errors
    ///
    /// As [`Baked::part`].
    pub fn baked(
        &self,
        region: &Aabb,
        cell: Real,
        monitor: &mut dyn Monitor,
    ) -> Result<Baked, BakeError> {
        let (band, accuracy) = (2.0 * cell, Real::INFINITY);
        let params = BakeParams { cell, band, reach: cell, accuracy, ..Default::default() };
        Baked::part(self, region, &params, monitor)
    }
}

impl SignedDistance for ClothedField<'_> {
    fn distance(&self, p: &Point) -> Real {
        self.sample(p).distance
    }

    fn sample(&self, p: &Point) -> FieldSample {
        let mut best = FieldSample { distance: Real::INFINITY, gradient: Vector::zeros() };
        for layer in &self.layers {
            let reach =
                if best.distance.is_finite() { best.distance.max(0.0) } else { Real::INFINITY };
            if let Some(s) = layer.sided(p, reach)
                && s.distance < best.distance
            {
                best = FieldSample { distance: s.distance, gradient: s.normal };
            }
        }
        best
    }

    fn bounds(&self) -> Option<Aabb> {
        Some(self.layers.iter().fold(Aabb::EMPTY, |b, l| b.merged(&l.bvh().aabb())))
    }

    /// 1 if all layers are closed bodies; infinite otherwise, as the field jumps across caps.
    fn lipschitz(&self) -> Real {
        if self.layers.iter().all(|l| l.is_closed_body()) { 1.0 } else { Real::INFINITY }
    }
}
