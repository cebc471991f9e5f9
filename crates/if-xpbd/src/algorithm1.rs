//! One garment over what is below it: stretch, collision and air, wired as Algorithm 1 has them.

use crate::air::{Air, AirError, AirParams};
use crate::collision::{CollisionError, SdfCollision};
use crate::constraint::Constraint;
use crate::edge_set::EdgeSet;
use crate::inner_surface::InnerSurface;
use crate::params::{ParamsError, SolverParams};
use crate::particles::{Particles, ParticlesError};
use crate::report::{RunReport, StepError, StepReport};
use crate::solver::Solver;
use crate::stretch::Stretch;
use if_core::field::SignedDistance;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use std::ops::ControlFlow;

/// What one garment is settled on.
#[derive(Clone, Copy)]
pub struct Below<'a> {
    /// The inner layer's field, baked: it is asked thousands of times for each vertex.
    pub field: &'a dyn SignedDistance,
    /// Weight of the mask at each vertex of the garment, in [0, 1] (Appendix C); all 1 without one.
    pub mask: &'a [f64],
    /// The surface for the air constraint, and how it is read; `None` for no air constraint.
    pub air: Option<(&'a InnerSurface<'a>, AirParams)>,
}

impl std::fmt::Debug for Below<'_> {
    /// Numbers only: the field cannot tell what it is.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut out = f.debug_struct("Below");
        out.field("mask", &self.mask.len())
            .field("air", &self.air.as_ref().map(|a| &a.1))
            .finish_non_exhaustive()
    }
}

/// Why a garment cannot be settled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SettleError {
    /// A parameter of the solver.
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// A parameter of the air constraint.
    #[error(transparent)]
    Air(#[from] AirError),
    /// A weight of the mask.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// A position.
    #[error(transparent)]
    Particles(#[from] ParticlesError),
    /// A step.
    #[error(transparent)]
    Step(#[from] StepError),
}

/// Settles `garment`, at rest as it is given, on what is `below`, with unit masses as the paper
/// has them: the new positions, and what was done. `on_step` may end the run.
///
/// With [`SolverParams::literal`] these are lines 1 to 26 as printed.
///
/// # Errors
///
/// Parameters outside their range, or a step that cannot be made.
pub fn settle(
    garment: &TriMesh,
    below: &Below<'_>,
    params: &SolverParams,
    on_step: impl FnMut(u32, &StepReport) -> ControlFlow<()>,
) -> Result<(Vec<Point>, RunReport), SettleError> {
    let mut solver = Solver::new(params.clone())?;
    let clearances = vec![params.clearance; garment.vertices().len()];
    let mut collision = SdfCollision::new(below.field, below.mask, &clearances)?;
    collision.push = params.push;
    collision.friction = params.friction;
    collision.max_push = params.max_push;
    let mut stretch = Stretch::new(EdgeSet::of_mesh(garment), params.compliance);
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
    let report = solver.run(&mut particles, &mut groups, on_step)?;
    Ok((particles.positions, report))
}
