//! An accuracy that is kept, or refused.

use super::Baked;
use super::params::{BakeError, BakeParams, MAX_LEVELS};
use if_core::field::SignedDistance;
use if_core::math::Real;

impl Baked {
    /// Bakes with cells as small as an accuracy needs, however small that is, or says that it
    /// cannot: the bound for points no farther than `reach` metres from the surface
    /// ([`Baked::error_bound_within`]) is at most `accuracy` metres.
    ///
    /// # Errors
    ///
    /// As [`Baked::new`]; and [`BakeError::Inaccurate`] where the accuracy is not reached with
    /// cells that were halved eight times, or with the memory that `params` allow.
    pub fn with_accuracy(
        source: &(impl SignedDistance + ?Sized),
        accuracy: Real,
        reach: Real,
        params: &BakeParams,
    ) -> Result<Self, BakeError> {
        let found =
            Self::new(source, &BakeParams { accuracy, reach, levels: MAX_LEVELS, ..*params })?;
        let bound = found.error_bound_within(reach);
        if bound <= accuracy {
            Ok(found)
        } else {
            Err(BakeError::Inaccurate { accuracy, bound, cell: found.smallest_cell() })
        }
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
            assert!(
                baked.error_bound_within(0.03) <= accuracy && baked.smallest_cell() <= last,
                "{accuracy}"
            );
            last = baked.smallest_cell();
            for k in 0..4000 {
                let (a, b, r) =
                    (k as Real * 0.7, k as Real * 1.9, 0.07 + 0.03 * (k as Real * 0.37).sin());
                let ring = 0.2 + r * b.cos();
                let p = Point::new(ring * a.cos(), 0.1 + r * b.sin(), ring * a.sin());
                let off = (baked.distance(&p) - RING.distance(&p)).abs();
                assert!(RING.distance(&p) > 0.03 || off <= accuracy, "{off} at {p}");
            }
        }
        assert!(last < 0.012);
    }

    #[test]
    fn what_cannot_be_reached_is_said() {
        let params =
            BakeParams { band: 0.02, depth: 0.02, memory: 30 << 20, ..BakeParams::default() };
        assert!(matches!(
            Baked::with_accuracy(&RING, 1e-12, 0.02, &params),
            Err(BakeError::Inaccurate { .. })
        ));
        for bad in [0.0, -1.0, Real::NAN] {
            assert!(matches!(
                Baked::with_accuracy(&RING, bad, 0.02, &params),
                Err(BakeError::Parameter { name: "accuracy", .. })
            ));
        }
    }
}
