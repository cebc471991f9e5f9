//! The coarsest grid that is accurate enough.

use super::Baked;
use super::params::{BakeError, BakeParams};
use if_core::field::SignedDistance;
use if_core::math::Real;

/// The first grid has cells this many times those of the parameters.
const COARSE: Real = 2.0;
/// Grids tried at most: each has cells of at most 0.85 times those before, 0.85¹⁶ = 1/13.
const TRIES: usize = 16;
/// Bounds fall at least about as this power of the cell; at creases as the first, so that two tries are needed there.
const POWER: Real = 1.5;

impl Baked {
    /// Bakes with cells as large as an accuracy allows: twice those of `params` at first (or the band, where that is less), then smaller ones, until the
    /// bound for points no farther than `reach` metres from the surface ([`Baked::error_bound_within`]) is at most
    /// `accuracy` metres.
    ///
    /// # Errors
    ///
    /// As [`Baked::new`]; an accuracy that is not above zero; and [`BakeError::Inaccurate`] where no grid that was tried
    /// is accurate enough. Grids that would take more memory than `params` allow are [`BakeError::TooLarge`].
    pub fn with_accuracy(
        source: &(impl SignedDistance + ?Sized),
        accuracy: Real,
        reach: Real,
        params: &BakeParams,
    ) -> Result<Self, BakeError> {
        params.validate()?;
        for (name, value) in [("accuracy", accuracy), ("reach", reach)] {
            if value.is_nan() || value <= 0.0 {
                return Err(BakeError::Parameter { name, value, needs: "a length above zero, in metres" });
            }
        }
        let mut cell = (COARSE * params.cell).min(params.band);
        let mut found = Self::new(source, &BakeParams { cell, ..*params })?;
        for _ in 1..TRIES {
            let bound = found.error_bound_within(reach);
            if bound <= accuracy {
                return Ok(found);
            }
            // A little finer than the power says, so that it seldom takes one more.
            cell *= (0.9 * (accuracy / bound).powf(1.0 / POWER)).clamp(0.35, 0.85);
            found = Self::new(source, &BakeParams { cell, ..*params })?;
        }
        let bound = found.error_bound_within(reach);
        if bound <= accuracy { Ok(found) } else { Err(BakeError::Inaccurate { accuracy, bound, cell }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;
    use if_core::shapes::Torus;

    const RING: Torus = Torus { center: Point::new(0.0, 0.1, 0.0), major: 0.2, minor: 0.07 };

    #[test]
    fn finer_accuracies_get_smaller_cells_and_hold() {
        let params = BakeParams { band: 0.03, ..BakeParams::default() };
        let mut last = Real::INFINITY;
        for accuracy in [1e-3, 1e-4, 1e-5] {
            let baked = Baked::with_accuracy(&RING, accuracy, 0.03, &params).unwrap();
            assert!(baked.error_bound_within(0.03) <= accuracy && baked.cell() <= last, "{accuracy} {}", baked.cell());
            last = baked.cell();
            for k in 0..4000 {
                let (a, b, r) = (k as Real * 0.7, k as Real * 1.9, 0.07 + 0.03 * (k as Real * 0.37).sin());
                let ring = 0.2 + r * b.cos();
                let p = Point::new(ring * a.cos(), 0.1 + r * b.sin(), ring * a.sin());
                let off = (baked.distance(&p) - RING.distance(&p)).abs();
                assert!(RING.distance(&p) > 0.03 || off <= accuracy, "{off} at {p}");
            }
        }
        assert!(last < 0.015);
    }

    #[test]
    fn what_cannot_be_reached_is_said() {
        let params = BakeParams { band: 0.02, depth: 0.02, memory: 30 << 20, ..BakeParams::default() };
        assert!(matches!(Baked::with_accuracy(&RING, 1e-12, 0.02, &params), Err(BakeError::TooLarge { .. })));
        for bad in [0.0, -1.0, Real::NAN] {
            assert!(matches!(
                Baked::with_accuracy(&RING, bad, 0.02, &params),
                Err(BakeError::Parameter { name: "accuracy", .. })
            ));
        }
    }
}
