//! Algorithm 1 over the masked field of the clothed body (Appendix C).

use if_core::field::SignedDistance;
use if_core::masked::{BoxesMask, Mask, Masked};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_xpbd::air::AirParams;
use if_xpbd::algorithm1::{Algorithm1Error, Below, run_algorithm1};
use if_xpbd::inner_surface::InnerSurface;
use if_xpbd::params::SolverParams;

/// What Algorithm 1 settles a garment on.
pub struct ClothedBody<'a, F> {
    /// The field, baked: [`ClothedField::baked`](if_mesh::solid::ClothedField::baked).
    pub field: &'a F,
    /// The boxes that mask it; `None` for the original, unmasked field.
    pub mask: Option<BoxesMask>,
    /// The next layer below and how line 13 is read; `None` for no air constraint.
    pub air: Option<(&'a InnerSurface<'a>, AirParams)>,
}

impl<F> std::fmt::Debug for ClothedBody<'_, F> {
    /// Without the field, which cannot tell what it is.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ClothedBody")
            .field("mask", &self.mask)
            .field("air", &self.air)
            .finish_non_exhaustive()
    }
}

/// Settles `garment` by Algorithm 1 with unit masses: [`SolverParams::literal`] for the lines as
/// printed.
///
/// A vertex that starts outside the mask has neither a collision nor an air constraint; one that
/// leaves it has no collision constraint while it is outside.
///
/// # Source
///
/// Supplement, Algorithm 1 and Appendix C.
///
/// # Errors
///
/// See [`Algorithm1Error`]: parameters outside their range, or positions that do not stay finite.
pub fn run<F: SignedDistance + Send>(
    garment: &TriMesh,
    body: &ClothedBody<F>,
    params: &SolverParams,
) -> Result<Vec<Point>, Algorithm1Error> {
    let go = |field: &dyn SignedDistance, mask: &[Real]| {
        let below = Below { field, mask, air: body.air };
        run_algorithm1(garment, &below, params, &mut Silent).map(|(x, _)| x)
    };
    match &body.mask {
        None => go(body.field, &vec![1.0; garment.vertices().len()]),
        Some(mask) => {
            let weights: Vec<Real> =
                garment.vertices().iter().map(|p| Real::from(mask.binds(p))).collect();
            go(&Masked { field: body.field, mask: mask.clone() }, &weights)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::scene::{RADIUS, belt};
    use if_core::aabb::Aabb;
    use if_core::shapes::Sphere;

    const BALL: Sphere = Sphere { center: Point::new(0.0, 0.0, 0.0), radius: RADIUS };

    #[test]
    fn the_corrected_method_brings_the_belt_out_and_the_printed_one_leaves_it_inside() {
        let belt = belt();
        let body = ClothedBody { field: &BALL, mask: None, air: None };
        let inside = |x: &[Point]| x.iter().filter(|p| BALL.distance(p) < 0.0).count();
        let corrected = run(&belt, &body, &SolverParams::default()).unwrap();
        assert_eq!(inside(&corrected), 0);
        let printed =
            run(&belt, &body, &SolverParams { steps: 20, ..SolverParams::literal() }).unwrap();
        assert!(inside(&printed) > 0);
    }

    #[test]
    fn without_stretch_nothing_moves_outside_the_boxes() {
        let belt = belt();
        let upper = Aabb { min: Point::new(-1.0, 0.0, -1.0), max: Point::new(1.0, 1.0, 1.0) };
        let body = ClothedBody {
            field: &BALL,
            mask: Some(BoxesMask::new([upper, Aabb::EMPTY]).unwrap()),
            air: None,
        };
        let collision_only = SolverParams { compliance: Real::INFINITY, ..SolverParams::default() };
        let after = run(&belt, &body, &collision_only).unwrap();
        for (p, q) in after.iter().zip(belt.vertices()) {
            assert!(upper.contains(q) || p == q);
        }
        assert!(after != belt.vertices());
    }
}
