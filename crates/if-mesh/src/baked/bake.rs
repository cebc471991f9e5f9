//! Baking: bricks in the band, samples at their nodes, and smaller cells where these are needed.

use super::accuracy::steepest;
use super::bricks::Bricks;
use super::error::BakeError;
use super::field::Baked;
use super::params::{BakeParams, MAX_LEVELS, Redistance};
use super::samples::{self, Samples};
use super::zero_set::ZeroSet;
use super::{band, blend, refine};
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real};
use if_core::monitor::Monitor;
use if_core::shapes::{Cuboid, Intersection};

/// Maximum | |∇φ| − 1 | of a distance: a source counts as one while at most one node in a hundred
/// exceeds it.
const UNIT: Real = 0.02;

/// A box that holds all points.
const EVERYWHERE: Aabb = Aabb {
    min: Point::new(Real::NEG_INFINITY, Real::NEG_INFINITY, Real::NEG_INFINITY),
    max: Point::new(Real::INFINITY, Real::INFINITY, Real::INFINITY),
};

impl Baked {
    /// Bakes `source`: evaluates it at nodes of the largest cells and of those that were halved, in
    /// the middle of each cell near the surface, and at some two hundred thousand random points to
    /// measure the error.
    ///
    /// [`Baked::error_bound_within`] returns the accuracy that was reached;
    /// [`Baked::with_accuracy`] fails if it is not the one requested. `monitor` receives the stages
    /// `band`, `sample` and `measure`, with the number of points, and those of
    /// [`crate::extract::extract`] if distances are measured anew.
    ///
    /// # Errors
    ///
    /// [`BakeError`]: parameters out of range, more memory than allowed, a source without bounds if
    /// no region is given, one that is not finite in the band, one whose inside leaves the region,
    /// or cancelled.
    pub fn new(
        source: &(impl SignedDistance + ?Sized),
        params: &BakeParams,
        monitor: &mut dyn Monitor,
    ) -> Result<Self, BakeError> {
        Self::bake(&source, &EVERYWHERE, params, monitor)
    }

    /// Bakes with cells as small as an accuracy requires: the bound for points within `reach`
    /// metres of the surface ([`Baked::error_bound_within`]) is at most `accuracy` metres.
    ///
    /// # Errors
    ///
    /// As [`Baked::new`]; and [`BakeError::Inaccurate`] if the accuracy is not reached with cells
    /// that were halved eight times, or with the memory that `params` allow.
    pub fn with_accuracy(
        source: &(impl SignedDistance + ?Sized),
        accuracy: Real,
        reach: Real,
        params: &BakeParams,
        monitor: &mut dyn Monitor,
    ) -> Result<Self, BakeError> {
        let params = BakeParams { accuracy, reach, levels: MAX_LEVELS, ..*params };
        let found = Self::new(source, &params, monitor)?;
        let bound = found.error_bound_within(reach);
        if bound <= accuracy {
            Ok(found)
        } else {
            Err(BakeError::Inaccurate { accuracy, bound, cell: found.smallest_cell() })
        }
    }

    /// Bakes the part of `source` in the box `core` and a margin round it. Where the border of that
    /// cuts through the inside it becomes a surface; in `core` values are those of `source`, to the
    /// accuracy that `params` have. `params.region` and `params.redistance` are not used.
    ///
    /// # Errors
    ///
    /// As [`Baked::new`].
    pub fn part(
        source: &(impl SignedDistance + ?Sized),
        core: &Aabb,
        params: &BakeParams,
        monitor: &mut dyn Monitor,
    ) -> Result<Self, BakeError> {
        // In cells of `core` that are near enough to the surface to be halved, the border is further
        // away than the surface.
        let region = core.inflated(params.band.max(params.reach + 3.0 * params.cell));
        let cuboid = Cuboid { center: region.center(), half: region.size() / 2.0 };
        let redistance = Redistance::Never;
        let params = BakeParams { region: Some(region), redistance, ..*params };
        Self::bake(&Intersection(source, cuboid), core, &params, monitor)
    }

    /// Errors count in `core`. Not generic: compiled once, and not for each type of field.
    fn bake(
        source: &dyn SignedDistance,
        core: &Aabb,
        params: &BakeParams,
        monitor: &mut dyn Monitor,
    ) -> Result<Self, BakeError> {
        params.validate()?;
        // Bricks of the largest cells in the band, and the source at their nodes.
        let region = band::region(source, params)?;
        let mut bricks = band::band_bricks(source, &region, params, monitor)?;
        let all: Vec<u32> = (0..bricks.places.len() as u32).collect();
        let raw = Samples::of_all(source, &bricks, monitor)?;
        samples::fill(&mut bricks, &all, &raw);
        band::check_border(&bricks)?;
        let redistanced = match params.redistance {
            Redistance::Always => true,
            Redistance::Never => false,
            Redistance::WhenNeeded => !is_distance(&raw.samples, params),
        };
        // Smaller cells where the error is too large, of the source or of the distance to its zero
        // set.
        let (errors, cut) = if redistanced {
            // Beyond the band by more than a brick, so that bricks no surface reaches are dropped.
            let far = 2.0 * blend::SIDE as Real * bricks.cell;
            let zero_set = ZeroSet::new(source, &region, params, &raw.samples, far, monitor)?;
            let raw = Samples::of_all(&zero_set, &bricks, monitor)?;
            samples::fill(&mut bricks, &all, &raw);
            (
                refine::refine(&mut bricks, &zero_set, (params, core), raw, monitor)?,
                zero_set.unseen(),
            )
        } else {
            (refine::refine(&mut bricks, source, (params, core), raw, monitor)?, 0.0)
        };
        let (bytes, limit, cell, lipschitz) =
            (bricks.bytes(), params.memory, params.cell, source.lipschitz());
        let bricks: Bricks = bricks
            .compacted(params.band, params.depth)
            .ok_or(BakeError::TooLarge { bytes, limit, cell, lipschitz })?;
        // Values are stored in single precision.
        let unseen = cut
            + Real::from(bricks.nodes.iter().fold(0.0f32, |m, n| m.max(n[0].abs())) * f32::EPSILON);
        let surface = bricks.surface_box();
        let lipschitz = steepest(&bricks).max(1.0);
        Ok(Self {
            bricks,
            band: params.band,
            depth: params.depth,
            surface,
            errors,
            unseen,
            lipschitz,
            redistanced,
        })
    }
}

/// Whether nearly all gradients in the band are of unit length.
fn is_distance(samples: &[FieldSample], params: &BakeParams) -> bool {
    let (mut all, mut off) = (0usize, 0usize);
    for s in samples {
        if (-params.depth..=params.band).contains(&s.distance) {
            all += 1;
            off += usize::from((s.gradient.norm() - 1.0).abs() > UNIT);
        }
    }
    off * 100 <= all
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::monitor::Silent;
    use if_core::shapes::Torus;

    const RING: Torus = Torus { center: Point::new(0.0, 0.1, 0.0), major: 0.2, minor: 0.07 };

    #[test]
    fn finer_accuracies_get_smaller_cells_and_hold() {
        let params = BakeParams { band: 0.03, ..BakeParams::default() };
        let mut last = Real::INFINITY;
        for accuracy in [1e-3, 1e-4, 1e-5] {
            let baked = Baked::with_accuracy(&RING, accuracy, 0.03, &params, &mut Silent).unwrap();
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
    fn an_unreachable_accuracy_is_an_error() {
        let params =
            BakeParams { band: 0.02, depth: 0.02, memory: 30 << 20, ..BakeParams::default() };
        assert!(matches!(
            Baked::with_accuracy(&RING, 1e-12, 0.02, &params, &mut Silent),
            Err(BakeError::Inaccurate { .. })
        ));
        for bad in [0.0, -1.0, Real::NAN] {
            assert!(matches!(
                Baked::with_accuracy(&RING, bad, 0.02, &params, &mut Silent),
                Err(BakeError::Parameter(e)) if e.name == "accuracy"
            ));
        }
    }
}
