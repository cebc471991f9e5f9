//! The baked field and its queries.

use super::accuracy::{Errors, SAFETY};
use super::bricks::{Bricks, Reading, Spot};
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use rayon::prelude::*;

/// Points of one task of a batched call.
const CHUNK: usize = 256;
/// Points whose cells are located before the first is read: their waits for memory overlap.
const AHEAD: usize = 16;

/// A baked field.
///
/// In the band, between `−depth` and `band` metres from the surface, it differs from the distance
/// by at most [`Baked::error_bound`]; within the requested reach, by about the requested accuracy.
/// Outside the band the value is `band`, or the distance to the box of the surface if that is
/// larger: positive, and never above the distance by more than the error. Deeper than `depth` it is
/// `−depth`. The field is continuous, and its gradient, zero where the value is constant, is its
/// own, also across cells of different size, except for rounding to single precision.
///
/// # Examples
///
/// ```
/// use if_core::{field::SignedDistance, math::Point, monitor::Silent, shapes::Sphere};
/// use if_mesh::baked::{BakeParams, Baked};
/// let ball = Sphere { center: Point::origin(), radius: 0.2 };
/// let params = BakeParams { cell: 0.02, ..BakeParams::default() };
/// let baked = Baked::new(&ball, &params, &mut Silent)?;
/// let p = Point::new(0.1, 0.2, 0.05);
/// assert!((baked.distance(&p) - ball.distance(&p)).abs() <= baked.error_bound());
/// # Ok::<(), if_mesh::baked::BakeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Baked {
    pub(super) bricks: Bricks,
    pub(super) band: Real,
    pub(super) depth: Real,
    pub(super) surface: Aabb,
    pub(super) errors: Errors,
    /// Errors that measuring does not find: of single precision, and of corners that re-distancing
    /// cuts.
    pub(super) unseen: Real,
    pub(super) lipschitz: Real,
    pub(super) redistanced: bool,
}

impl Baked {
    /// Bound on the error of values in the band, in metres: one and a half times the largest error
    /// at some two hundred thousand points, two thirds of them in the cells with the largest
    /// curvature. Creases far from the surface decide it, such as the middle of a limb; near the
    /// surface the error is smaller, see [`Baked::error_bound_within`]. Where values were
    /// re-distanced and the surface has creases, a seventh of a cell is added for the corners that
    /// its extraction cuts.
    pub fn error_bound(&self) -> Real {
        self.error_bound_within(Real::INFINITY)
    }

    /// The same for points within `reach` metres of the surface.
    pub fn error_bound_within(&self, reach: Real) -> Real {
        SAFETY * self.errors.within(reach) + self.unseen
    }

    /// Whether the values of the source were replaced by distances.
    pub fn is_redistanced(&self) -> bool {
        self.redistanced
    }

    /// Edge of the largest cells, in metres.
    pub fn cell(&self) -> Real {
        self.bricks.cell
    }

    /// Edge of the smallest cells, in metres.
    pub fn smallest_cell(&self) -> Real {
        self.bricks.cell_of(self.bricks.places.iter().map(|p| p.level).max().unwrap_or(0))
    }

    /// Number of bricks of 64 cells, by the number of halvings of their cells.
    pub fn bricks_by_level(&self) -> Vec<usize> {
        let mut counts = Vec::new();
        for place in &self.bricks.places {
            let level = place.level as usize;
            counts.resize(counts.len().max(level + 1), 0);
            counts[level] += 1;
        }
        counts
    }

    /// Distance outside the surface up to which values are stored, in metres.
    pub fn band(&self) -> Real {
        self.band
    }

    /// Memory of the field, in bytes.
    pub fn bytes(&self) -> usize {
        self.bricks.bytes()
    }
}

impl SignedDistance for Baked {
    #[inline]
    fn distance(&self, p: &Point) -> Real {
        self.sample(p).distance
    }

    #[inline]
    fn sample(&self, p: &Point) -> FieldSample {
        debug_assert!(p.iter().all(|x| x.is_finite()), "a query in {p}");
        self.sample_of(p, self.bricks.read(p))
    }

    fn distances(&self, points: &[Point], out: &mut [Real]) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        self.all(points, out, |s| s.distance);
    }

    fn samples(&self, points: &[Point], out: &mut [FieldSample]) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        self.all(points, out, |s| s);
    }

    /// The box of the surface.
    fn bounds(&self) -> Option<Aabb> {
        Some(self.surface)
    }

    fn lipschitz(&self) -> Real {
        self.lipschitz
    }
}

impl Baked {
    /// Converted samples of all points, in parallel.
    fn all<T: Send>(
        &self,
        points: &[Point],
        out: &mut [T],
        convert: impl Fn(FieldSample) -> T + Sync,
    ) {
        if points.len() <= CHUNK {
            self.each(points, out, convert);
        } else {
            points
                .par_chunks(CHUNK)
                .zip(out.par_chunks_mut(CHUNK))
                .for_each(|(ps, os)| self.each(ps, os, &convert));
        }
    }

    /// The samples of a few points. All cells are located first, so that waits for memory overlap.
    fn each<T>(&self, points: &[Point], out: &mut [T], convert: impl Fn(FieldSample) -> T) {
        let mut spots = [Spot::Outside; AHEAD];
        for (points, out) in points.chunks(AHEAD).zip(out.chunks_mut(AHEAD)) {
            for (spot, p) in spots.iter_mut().zip(points) {
                *spot = self.bricks.spot(p);
            }
            for ((spot, p), o) in spots.iter().zip(points).zip(out) {
                *o = convert(self.sample_of(p, self.bricks.reading(spot)));
            }
        }
    }

    /// The sample at `p`, clamped to the band and the depth.
    #[inline]
    fn sample_of(&self, p: &Point, reading: Reading) -> FieldSample {
        match reading {
            Reading::Blend(value, gradient) if value < self.band => {
                if value >= -self.depth {
                    FieldSample { distance: value, gradient }
                } else {
                    FieldSample { distance: -self.depth, gradient: Vector::zeros() }
                }
            }
            Reading::Inside => FieldSample { distance: -self.depth, gradient: Vector::zeros() },
            _ => self.far(p),
        }
    }

    /// Above the band: the band, or the distance to the box of the surface.
    fn far(&self, p: &Point) -> FieldSample {
        let d2 = self.surface.distance_squared(p);
        // The empty box is infinitely far from everything.
        if !(d2 > self.band * self.band && d2.is_finite()) {
            return FieldSample { distance: self.band, gradient: Vector::zeros() };
        }
        let nearest = p.inf(&self.surface.max).sup(&self.surface.min);
        FieldSample { distance: d2.sqrt(), gradient: (p - nearest) / d2.sqrt() }
    }
}
