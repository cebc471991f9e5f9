//! Extraction with a requested accuracy: attempts with smaller and smaller cells.

use crate::extract::attempt::attempt;
use crate::extract::budget::Budget;
use crate::extract::check::error_estimate;
use crate::extract::error::ExtractError;
use crate::extract::params::ExtractParams;
use crate::extract::report::{Attempt, Extraction, Warning};
use crate::extract::slope::Bound;
use if_core::aabb::Aabb;
use if_core::edges::{Edges, part_count};
use if_core::field::SignedDistance;
use if_core::math::Real;
use if_core::mesh::TriMesh;

/// Cells along the longest side of the first attempt at a requested accuracy: coarse enough to cost
/// little, fine enough to resolve arms and legs of a person.
const FIRST: Real = 48.0;
/// Maximum number of attempts. The error is of second order, so that the second guess is near:
/// three is usual.
const ATTEMPTS: usize = 8;
/// The next cell is chosen for this share of the requested error, so that it is not missed by a
/// little.
const AIM: Real = 0.8;

/// Extracts with smaller and smaller cells until the error is as requested, at every vertex and triangle.
///
/// Where something smaller than a cell may be lost, that is not enough: the attempt before must have come out with as
/// many parts and tunnels, or been as accurate.
pub(super) fn to_accuracy(
    field: &dyn SignedDistance,
    region: &Aabb,
    (error, finest): (Real, Real),
    bound: &Bound,
    params: &ExtractParams,
    budget: &mut Budget,
) -> Result<Extraction, ExtractError> {
    let mut cell = (region.size().max() / FIRST).max(finest);
    let mut attempts = Vec::new();
    let mut before = None;
    loop {
        let mut found = attempt(field, region, cell, bound, params, budget)?;
        if found.report.error.worst() <= error {
            let everywhere = ExtractParams { check: usize::MAX, ..*params };
            let before = budget.evaluations;
            found.report.error = error_estimate(field, &found.mesh, &everywhere, budget)?;
            found.report.evaluations.check += budget.evaluations - before;
        }
        let reached = found.report.error.worst();
        attempts.push(Attempt { cell, error: reached, triangles: found.mesh.triangles().len() });
        let hidden = found.report.warnings.iter().any(|w| matches!(w, Warning::Unresolved { .. }));
        let shape = shape(&found.mesh);
        let is_alike = before
            .replace((shape, reached))
            .is_some_and(|(other, reached)| other == shape || reached <= error);
        let enough = reached <= error && (!hidden || is_alike);
        if enough || cell <= finest || attempts.len() == ATTEMPTS {
            if reached > error {
                found.report.warnings.push(Warning::Inaccurate { requested: error, reached, cell });
            }
            found.report.attempts = attempts;
            found.report.evaluations.total = budget.evaluations;
            return Ok(found);
        }
        // Second order: half the cell has a quarter of the error. Unresolved details appear in
        // smaller cells only.
        let wanted = if reached > error { (AIM * error / reached).sqrt() } else { 0.5 };
        cell = (cell * wanted.clamp(0.2, 0.8)).max(finest);
    }
}

/// The number of parts, and the Euler characteristic.
fn shape(mesh: &TriMesh) -> (usize, isize) {
    let counts = [mesh.vertices().len(), Edges::new(mesh).vertices.len(), mesh.triangles().len()];
    let [vertices, edges, triangles] = counts.map(|n| n as isize);
    (part_count(mesh), vertices - edges + triangles)
}
