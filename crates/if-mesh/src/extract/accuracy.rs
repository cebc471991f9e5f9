//! Extraction with a requested accuracy: attempts with smaller and smaller cells.

use crate::extract::attempt::attempt;
use crate::extract::budget::Budget;
use crate::extract::error::ExtractError;
use crate::extract::params::ExtractParams;
use crate::extract::report::{Attempt, Extraction, Warning};
use crate::extract::slope::Bound;
use if_core::aabb::Aabb;
use if_core::field::SignedDistance;
use if_core::math::Real;

/// Cells along the longest side of the first attempt at a requested accuracy: coarse enough to cost
/// little, fine enough to resolve arms and legs of a person.
const FIRST: Real = 48.0;
/// Maximum number of attempts. The error is of second order, so that the second guess is near:
/// three is usual.
const ATTEMPTS: usize = 8;
/// The next cell is chosen for this share of the requested error, so that it is not missed by a
/// little.
const AIM: Real = 0.8;

/// Extracts with smaller and smaller cells until the error is as requested.
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
    loop {
        let mut found = attempt(field, region, cell, bound, params, budget)?;
        let reached = found.report.error.worst();
        attempts.push(Attempt { cell, error: reached, triangles: found.mesh.triangles().len() });
        let hidden = found.report.warnings.iter().any(|w| matches!(w, Warning::Unresolved { .. }));
        let enough = reached <= error && !hidden;
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
