//! One garment over what is below it: stretch, collision and air, wired as Algorithm 1 has them.

use crate::air::{Air, AirError, AirParams};
use crate::collision::{CollisionError, SdfCollision};
use crate::constraint::Constraint;
use crate::edge_set::EdgeSet;
use crate::inner_surface::InnerSurface;
use crate::params::SolverParams;
use crate::particles::{Particles, ParticlesError};
use crate::report::{RunError, RunReport};
use crate::solver::Solver;
use crate::stretch::Stretch;
use if_core::field::SignedDistance;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::monitor::Monitor;
use if_core::parameter::ParameterError;

/// What one garment is settled on.
#[derive(Clone, Copy)]
pub struct Below<'a> {
    /// The inner layer's field. Bake it: each vertex is queried thousands of times.
    pub field: &'a dyn SignedDistance,
    /// Weight of the mask at each vertex of the garment, in [0, 1] (Appendix C); all 1 without one.
    pub mask: &'a [f64],
    /// The surface of the air constraint and its parameters; `None` for no air constraint.
    pub air: Option<(&'a InnerSurface<'a>, AirParams)>,
}

impl std::fmt::Debug for Below<'_> {
    /// Numbers only: a field has no `Debug`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut out = f.debug_struct("Below");
        out.field("mask", &self.mask.len())
            .field("air", &self.air.as_ref().map(|a| &a.1))
            .finish_non_exhaustive()
    }
}

/// Why Algorithm 1 failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Algorithm1Error {
    /// A parameter of the solver is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The air constraint is invalid.
    #[error(transparent)]
    Air(#[from] AirError),
    /// The collision group is invalid.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// A position is invalid.
    #[error(transparent)]
    Particles(#[from] ParticlesError),
    /// The field has no value at any vertex that it could push out.
    #[error("the field is NaN at all {vertices} vertices inside the mask; give a field of numbers")]
    Field {
        /// Vertices with a mask weight above zero.
        vertices: usize,
    },
    /// The run failed or was cancelled.
    #[error(transparent)]
    Run(#[from] RunError),
}

/// Runs Algorithm 1: settles `garment`, at rest as given, on the layers `below`, with unit
/// masses (our interpretation: the supplement names none). Returns the new positions and a report. The monitor receives the progress of
/// [`Solver::run`].
///
/// With [`SolverParams::literal`], and [`AirReading::Literal`](crate::air::AirReading::Literal) in
/// [`Below::air`], these are lines 1 to 26 as printed.
///
/// # Errors
///
/// Parameters or mask weights out of range, a field that is NaN at all vertices inside the mask, a
/// step that fails, or [`RunError::Cancelled`]. Where the field is NaN at some vertices only, they are
/// not pushed, and [`Counters::degenerate`](crate::constraint::Counters::degenerate) counts them.
pub fn run_algorithm1(
    garment: &TriMesh,
    below: &Below<'_>,
    params: &SolverParams,
    monitor: &mut dyn Monitor,
) -> Result<(Vec<Point>, RunReport), Algorithm1Error> {
    let mut solver = Solver::new(params.clone())?;
    let clearances = vec![params.clearance; garment.vertices().len()];
    let mut collision = SdfCollision::new(below.field, below.mask, &clearances)?;
    check_field(garment, below)?;
    collision.push = params.push;
    collision.friction = params.friction;
    collision.max_push = params.max_push;
    let mut stretch = Stretch::new(EdgeSet::of_mesh(garment), params.compliance)?;
    stretch.form = params.lambda_form;
    let mut air = match &below.air {
        Some((inner, air)) => Some(Air::new(inner, garment.vertices(), below.mask, *air)?),
        None => None,
    };
    let mut particles = Particles::uniform(garment.vertices().to_vec(), 1.0)?;
    // Lines 6, 11 and 16, in this order.
    let mut groups: Vec<&mut dyn Constraint> = vec![&mut collision];
    groups.extend(air.as_mut().map(|a| a as &mut dyn Constraint));
    groups.push(&mut stretch);
    let report = solver.run(&mut particles, &mut groups, monitor)?;
    Ok((particles.positions, report))
}

/// One query for each vertex, of thousands: a field that is NaN moves nothing, as if all were settled.
fn check_field(garment: &TriMesh, below: &Below<'_>) -> Result<(), Algorithm1Error> {
    let vertices = garment.vertices().iter().zip(below.mask);
    let inside: Vec<Point> = vertices.filter(|(_, m)| **m > 0.0).map(|(p, _)| *p).collect();
    let mut distances = vec![0.0; inside.len()];
    below.field.distances(&inside, &mut distances);
    if !inside.is_empty() && distances.iter().all(|d| d.is_nan()) {
        return Err(Algorithm1Error::Field { vertices: inside.len() });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::monitor::Silent;
    use if_core::shapes::Sphere;
    use if_core::shapes::meshes::cloth;

    #[test]
    fn a_field_without_numbers_is_an_error() {
        let garment = cloth(0.1, 0.1, 2, 2);
        let run = |radius: f64, mask: f64| {
            let field = Sphere { center: Point::origin(), radius };
            let below = Below { field: &field, mask: &[mask; 9], air: None };
            run_algorithm1(&garment, &below, &SolverParams::default(), &mut Silent)
        };
        assert_eq!(run(f64::NAN, 1.0).unwrap_err(), Algorithm1Error::Field { vertices: 9 });
        assert!(run(f64::NAN, 0.0).is_ok() && run(0.02, 1.0).is_ok());
    }
}
