//! Surfaces of fields: marching cubes that evaluates a field only where it can vanish.
//!
//! ```text
//! halve boxes, a level a batch, and drop those that balls without zeros cover         [refine]
//! inside is φ < 0; a vertex on each lattice edge with one end inside                   [surface]
//! the vertex: linear, one secant step along the edge, a bounded Newton step along ∇φ   [polish]
//! triangles of each cell by its case, one rule for ambiguous sides                     [cases]
//! if requested, rounds of tangential relaxation behind a flip test                     [crate::marching::relax]
//! measure the error at points chosen by a seed; warn of what the lattice cannot show   [check]
//! ```
//!
//! Every edge of the mesh has two triangles and every vertex one fan, whatever the values at the
//! nodes are, except at the border where the surface leaves the region. Vertices and triangles are
//! in the order of the lattice, and are those of the dense lattice.

mod accuracy;
mod apart;
mod attempt;
mod budget;
mod cases;
mod check;
mod cover;
mod error;
mod grid;
mod lattice;
mod memory;
mod nodes;
mod params;
mod polish;
mod refine;
mod report;
mod rows;
mod slope;
mod surface;
#[cfg(test)]
mod tests;

pub use error::ExtractError;
pub use grid::{GridError, surface_of_grid};
pub use params::{ExtractParams, Resolution, Sampling, Slope, layer_phase};
pub use report::{
    Attempt, ErrorEstimate, Evaluations, ExtractReport, Extraction, Seconds, Warning,
};

use if_core::field::SignedDistance;
use if_core::math::Real;
use if_core::monitor::Monitor;

/// Computes the surface `φ = 0` of a field, by certified sparse marching cubes.
///
/// `monitor` receives the stages `slope`, `refine`, `polish`, `relax` and `check` with the measures
/// `evaluations` (points at which the field was evaluated, in all attempts), `cell` (side of the
/// cells in metres) and `box` (side of the boxes that are being refined, in metres).
///
/// # Source
///
/// Lorensen and Cline 1987 for the cases, which are derived here from one rule for the sides of a
/// cube: opposite inside corners stay apart, and no diagonal lies in a side. The paper extracts its
/// garments by marching cubes on a dense lattice; this returns the same triangles.
///
/// # Accuracy
///
/// Vertices lie on the surface of a smooth field to 1e-9 cells after one Newton step; the centre of
/// a triangle with sides a, b, c is off by κ (a² + b² + c²) / 18 where the surface has the
/// curvature κ: of second order in the cell. Sheets and tubes thinner than a cell may be lost; the
/// report warns of it where the field's values show it. Nothing is lost that the dense lattice
/// has, as long as `slope` bounds |∇φ|; where values show that it does not, a larger bound is used,
/// dropped cells next to the surface are restored, and the report contains a warning.
///
/// # Errors
///
/// [`ExtractError`]: parameters out of range, a missing region, too many cells, more memory than
/// allowed, a field that is NaN, or cancelled.
///
/// # Examples
///
/// ```
/// use if_core::{math::Point, monitor::Silent, shapes::Sphere};
/// use if_mesh::extract::{ExtractParams, Resolution, extract};
/// let ball = Sphere { center: Point::origin(), radius: 0.1 };
/// let params = ExtractParams { resolution: Resolution::Cell(0.01), ..ExtractParams::default() };
/// let found = extract(&ball, &params, &mut Silent)?;
/// assert!(found.mesh.signed_volume() > 0.0041 && found.report.warnings.is_empty());
/// # Ok::<(), if_mesh::extract::ExtractError>(())
/// ```
pub fn extract<F: SignedDistance + ?Sized>(
    field: &F,
    params: &ExtractParams,
    monitor: &mut dyn Monitor,
) -> Result<Extraction, ExtractError> {
    // From here on code is compiled once, and not for each type of field: calls are batched.
    let field: &dyn SignedDistance = &field;
    params.validate()?;
    let region = params.region.or_else(|| field.bounds()).ok_or(ExtractError::NoRegion)?;
    let size = region.size();
    if region.is_empty()
        || !(0..3).all(|k| region.min[k].is_finite() && size[k].is_finite())
        || size.max() <= 0.0
    {
        return Err(ExtractError::Region { region });
    }
    let mut budget = budget::Budget { evaluations: 0, cell: 0.0, memory: params.memory, monitor };
    let slope = slope::slope_bound(&params.slope, field, &region, &mut budget)?;
    let bound = slope::Bound { slope, noise: params.noise };
    let mut with_cell =
        |cell: Real| attempt::attempt(field, &region, cell, &bound, params, &mut budget);
    let mut extraction = match params.resolution {
        Resolution::Cell(cell) => with_cell(cell),
        Resolution::Cells(cells) => with_cell(size.max() / Real::from(cells)),
        Resolution::Accuracy { error, finest } => {
            accuracy::to_accuracy(field, &region, (error, finest), &bound, params, &mut budget)
        }
    }?;
    if extraction.mesh.triangles().is_empty() {
        let inside = field.distance(&nalgebra::center(&region.min, &region.max)) < 0.0;
        extraction.report.warnings.push(Warning::Empty { inside });
    }
    Ok(extraction)
}
