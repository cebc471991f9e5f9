//! A narrow-band grid of any signed distance field: tens of nanoseconds a query, whatever the source
//! costs, and a stated error.

mod accuracy;
mod bricks;
mod build;
mod choose;
mod file;
mod params;
mod redistance;

use accuracy::Errors;
use bricks::{Bricks, Reading, SIDE};
pub use file::BakedFileError;
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
pub use params::{BakeError, BakeParams, Redistance};

/// Errors at the probed points times this are the stated bound. On 36 grids of the shapes of the tests
/// a million random points each exceeded the largest of the probed errors by at most 45 %.
const SAFETY: Real = 2.0;
/// A source counts as a distance while at most one node in a hundred has | |∇φ| − 1 | above this.
const UNIT: Real = 0.02;

/// A baked field.
///
/// In the band, between `−depth` and `band` metres from the surface, it differs from the distance by at
/// most [`Baked::error_bound`]. Outside the band the value is `band`, or the distance to the box of the
/// surface where that is more: positive and never above the distance, by more than the error. Deeper
/// than `depth` it is `−depth`. The field is continuous, and its gradient, zero where the value is
/// constant, is its own.
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
    rounding: Real,
    lipschitz: Real,
    redistanced: bool,
}

impl Baked {
    /// Bakes `source`, asking it once for each node of the band, and at most 100,000 times more to
    /// exclude bricks and to measure the error.
    ///
    /// # Errors
    ///
    /// Absurd parameters or sizes, a source without bounds where no region is given, one that is NaN or
    /// infinite in the band, or one whose inside leaves the region.
    pub fn new(source: &(impl SignedDistance + ?Sized), params: &BakeParams) -> Result<Self, BakeError> {
        params.validate()?;
        let (band, depth) = (params.band, params.depth);
        let mut bricks = build::band_bricks(source, params)?;
        build::fill(&mut bricks, source)?;
        build::check_border(&bricks)?;
        let redistanced = match params.redistance {
            Redistance::Always => true,
            Redistance::Never => false,
            Redistance::WhenNeeded => !is_distance(&bricks, band, depth),
        };
        if redistanced {
            // Beyond the band by more than a brick, so that bricks no surface reaches are pruned.
            bricks.nodes = redistance::redistanced(&bricks, band + 2.0 * SIDE as Real * bricks.cell);
            bricks.spread();
        }
        let bricks = bricks.pruned(band, depth);
        let errors = accuracy::errors(&bricks, source, redistanced, band, depth);
        // Values are stored in single precision.
        let rounding = Real::from(bricks.nodes.iter().fold(0.0f32, |m, n| m.max(n[0].abs())) * f32::EPSILON);
        let surface = surface_box(&bricks);
        let lipschitz = accuracy::steepest(&bricks).max(1.0);
        Ok(Self { bricks, band, depth, surface, errors, rounding, lipschitz, redistanced })
    }

    /// How far a value in the band may be from the distance, in metres: twice the largest error at some
    /// fifty thousand points, half of them where the grid looks worst. Creases decide it, such as
    /// the middle of a limb; near the surface the error is smaller, see [`Baked::error_bound_within`].
    pub fn error_bound(&self) -> Real {
        self.error_bound_within(Real::INFINITY)
    }

    /// The same for points no farther than `reach` metres from the surface.
    pub fn error_bound_within(&self, reach: Real) -> Real {
        SAFETY * self.errors.within(reach / self.bricks.cell) + self.rounding
    }

    /// Whether the values of the source were replaced by distances.
    pub fn is_redistanced(&self) -> bool {
        self.redistanced
    }

    /// Edge of a cell, in metres.
    pub fn cell(&self) -> Real {
        self.bricks.cell
    }

    /// How far outside the surface values are kept, in metres.
    pub fn band(&self) -> Real {
        self.band
    }

    /// Memory taken, in bytes.
    pub fn bytes(&self) -> usize {
        accuracy::bytes(self.bricks.places.len(), self.bricks.directory.len())
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
        match self.bricks.read(p) {
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

    /// The box of the surface.
    fn bounds(&self) -> Option<Aabb> {
        Some(self.surface)
    }

    fn lipschitz(&self) -> Real {
        self.lipschitz
    }
}

impl Baked {
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
fn is_distance(bricks: &Bricks, band: Real, depth: Real) -> bool {
    let (mut all, mut off) = (0usize, 0usize);
    for n in &bricks.nodes {
        if (-depth..=band).contains(&Real::from(n[0])) {
            let length = Vector::new(n[1].into(), n[2].into(), n[3].into()).norm();
            all += 1;
            off += usize::from((length - 1.0).abs() > UNIT);
        }
    }
    off * 100 <= all
}

/// The box of all cells that may hold a point of the zero set or the inside: outside it the blend is
/// positive.
fn surface_box(bricks: &Bricks) -> Aabb {
    // A blend is at most half the gradient times the cell's diagonal below its least node.
    let near = |n: &bricks::Node| {
        let slope = Vector::new(n[1].into(), n[2].into(), n[3].into()).norm();
        Real::from(n[0]) <= 0.5 * 3.0f64.sqrt() * bricks.cell * slope
    };
    let cell = Vector::repeat(bricks.cell);
    let mut surface = Aabb::EMPTY;
    for brick in 0..bricks.places.len() {
        for slot in Bricks::cells(brick) {
            if bricks.corners(slot).into_iter().any(near) {
                let low = bricks.position(slot);
                surface = surface.grown_to(&low).grown_to(&(low + cell));
            }
        }
    }
    surface
}

#[cfg(test)]
mod tests;
