//! A narrow-band grid of any signed distance field: tens of nanoseconds a query, whatever the
//! source costs, and a stated error. Cells are as small as that error needs, each where it is.

mod accuracy;
mod bricks;
mod build;
mod choose;
mod file;
mod index;
mod join;
mod params;
mod refine;
mod samples;
mod zero_set;

use accuracy::{Errors, SAFETY};
use bricks::{BRICK, Bricks, Reading, SIDE, Spot, bumps, cells, corners};
pub use file::BakedFileError;
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
pub use params::{BakeError, BakeParams, Redistance};
use rayon::prelude::*;
use samples::Samples;

/// A source counts as a distance while at most one node in a hundred has | |∇φ| − 1 | above this.
const UNIT: Real = 0.02;
/// Points handed to one task of a batched call.
const CHUNK: usize = 256;
/// Points whose cells are looked up before the first is read: their waits for memory overlap.
const AHEAD: usize = 16;

/// A baked field.
///
/// In the band, between `−depth` and `band` metres from the surface, it differs from the distance
/// by at most [`Baked::error_bound`]; within the reach that was asked for, by about the accuracy
/// that was asked for. Outside the band the value is `band`, or the distance to the box of the
/// surface where that is more: positive and never above the distance, by more than the error.
/// Deeper than `depth` it is `−depth`. The field is continuous, and its gradient, zero where the
/// value is constant, is its own: across cells of different size too, but for rounding to single
/// precision.
///
/// # Examples
///
/// ```
/// use if_core::{field::SignedDistance, math::Point, shapes::Sphere};
/// use if_mesh::baked::{BakeParams, Baked};
/// let ball = Sphere { center: Point::origin(), radius: 0.2 };
/// let baked = Baked::new(&ball, &BakeParams { cell: 0.02, ..BakeParams::default() })?;
/// let p = Point::new(0.1, 0.2, 0.05);
/// assert!((baked.distance(&p) - ball.distance(&p)).abs() <= baked.error_bound());
/// # Ok::<(), if_mesh::baked::BakeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Baked {
    bricks: Bricks,
    band: Real,
    depth: Real,
    surface: Aabb,
    errors: Errors,
    /// What measuring does not see: of single precision, and of corners that re-distancing cuts.
    unseen: Real,
    lipschitz: Real,
    redistanced: bool,
}

impl Baked {
    /// Bakes `source`: asks it at nodes of the largest cells and of those that were halved, in the
    /// middle of each cell near the surface, and at some two hundred thousand random points to
    /// measure the error.
    ///
    /// Whether the accuracy was reached, [`Baked::error_bound_within`] says;
    /// [`Baked::with_accuracy`] makes it an error.
    ///
    /// # Errors
    ///
    /// Absurd parameters or sizes, a source without bounds where no region is given, one that is
    /// NaN or infinite in the band, or one whose inside leaves the region.
    pub fn new(
        source: &(impl SignedDistance + ?Sized),
        params: &BakeParams,
    ) -> Result<Self, BakeError> {
        Self::bake(&source, params)
    }

    /// Not generic: made once, and not for each kind of field.
    fn bake(source: &dyn SignedDistance, params: &BakeParams) -> Result<Self, BakeError> {
        params.validate()?;
        let region = build::region(source, params)?;
        let mut bricks = build::band_bricks(source, &region, params)?;
        let all: Vec<u32> = (0..bricks.places.len() as u32).collect();
        let raw = Samples::of_all(source, &bricks)?;
        samples::fill(&mut bricks, &all, &raw);
        build::check_border(&bricks)?;
        let redistanced = match params.redistance {
            Redistance::Always => true,
            Redistance::Never => false,
            Redistance::WhenNeeded => !is_distance(&raw.samples, params),
        };
        let (errors, cut) = if redistanced {
            // Beyond the band by more than a brick, so that bricks no surface reaches are dropped.
            let far = 2.0 * SIDE as Real * bricks.cell;
            let zero_set = zero_set::ZeroSet::new(source, &region, params, &raw.samples, far)?;
            let raw = Samples::of_all(&zero_set, &bricks)?;
            samples::fill(&mut bricks, &all, &raw);
            (refine::refine(&mut bricks, &zero_set, params, raw)?, zero_set.unseen())
        } else {
            (refine::refine(&mut bricks, source, params, raw)?, 0.0)
        };
        let (bytes, limit, cell, lipschitz) =
            (bricks.bytes(), params.memory, params.cell, source.lipschitz());
        let bricks = bricks.compacted(params.band, params.depth).ok_or(BakeError::TooLarge {
            bytes,
            limit,
            cell,
            lipschitz,
        })?;
        // Values are stored in single precision.
        let unseen = cut
            + Real::from(bricks.nodes.iter().fold(0.0f32, |m, n| m.max(n[0].abs())) * f32::EPSILON);
        let surface = surface_box(&bricks);
        let lipschitz = accuracy::steepest(&bricks).max(1.0);
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

    /// How far a value in the band may be from the distance, in metres: one and a half times the
    /// largest error at some two hundred thousand points, two thirds of them where the grid looks
    /// worst. Creases far from the surface decide it, such as the middle of a limb; near the
    /// surface the error is smaller, see [`Baked::error_bound_within`]. Where values were
    /// re-distanced and the surface has creases, a seventh of a cell is added for the corners that
    /// its extraction cuts.
    pub fn error_bound(&self) -> Real {
        self.error_bound_within(Real::INFINITY)
    }

    /// The same for points no farther than `reach` metres from the surface.
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

    /// Bricks of 64 cells, by how often their cells were halved.
    pub fn bricks_by_level(&self) -> Vec<usize> {
        let mut counts = Vec::new();
        for place in &self.bricks.places {
            let level = place.level as usize;
            counts.resize(counts.len().max(level + 1), 0);
            counts[level] += 1;
        }
        counts
    }

    /// How far outside the surface values are kept, in metres.
    pub fn band(&self) -> Real {
        self.band
    }

    /// Memory taken, in bytes.
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
        self.told(p, self.bricks.read(p))
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
    fn all<T: Send>(
        &self,
        points: &[Point],
        out: &mut [T],
        told: impl Fn(FieldSample) -> T + Sync,
    ) {
        if points.len() <= CHUNK {
            self.each(points, out, told);
        } else {
            points
                .par_chunks(CHUNK)
                .zip(out.par_chunks_mut(CHUNK))
                .for_each(|(ps, os)| self.each(ps, os, &told));
        }
    }

    /// The samples of a few points: all cells are found first, so that waits for memory overlap.
    fn each<T>(&self, points: &[Point], out: &mut [T], told: impl Fn(FieldSample) -> T) {
        let mut spots = [Spot::Outside; AHEAD];
        for (points, out) in points.chunks(AHEAD).zip(out.chunks_mut(AHEAD)) {
            for (spot, p) in spots.iter_mut().zip(points) {
                *spot = self.bricks.spot(p);
            }
            for ((spot, p), o) in spots.iter().zip(points).zip(out) {
                *o = told(self.told(p, self.bricks.reading(spot)));
            }
        }
    }

    #[inline]
    fn told(&self, p: &Point, reading: Reading) -> FieldSample {
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

/// The box of all cells that may hold a point of the zero set or the inside, and of what is deeper
/// than the band: outside it the field is positive.
fn surface_box(bricks: &Bricks) -> Aabb {
    let mut surface = bricks.inside();
    for (brick, place) in bricks.places.iter().enumerate() {
        let cell = bricks.cell_of(place.level);
        for c in cells() {
            let slot = brick * BRICK + c;
            let least = corners(&bricks.nodes, slot)
                .into_iter()
                .fold(Real::INFINITY, |m, n| m.min(n[0].into()));
            // Along each axis the blend is at most a quarter of the lowest bump below the corners.
            let dip = |b: [f32; 4]| b.into_iter().fold(0.0f32, f32::min);
            let dips: Real = bumps(&bricks.nodes, slot).map(|b| Real::from(dip(b))).iter().sum();
            if least + 0.25 * dips <= 0.0 {
                let low = bricks.at(place.level, bricks.node(brick, c));
                surface = surface.grown_to(&low).grown_to(&(low + Vector::repeat(cell)));
            }
        }
    }
    surface
}

#[cfg(test)]
mod tests;
